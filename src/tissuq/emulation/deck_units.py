"""From the units of a finite-element model to those in which a file has what was measured."""

from __future__ import annotations

from tissuq.decks import parse_quantity
from tissuq.decks.quantity import Component
from tissuq.errors import InputError
from tissuq.experiments.units import FORCE, LENGTH, PRESSURE
from tissuq.export import CardSettings

__all__ = ["conversion", "units_of"]

PHYSICAL = {"U": LENGTH, "RF": FORCE, "S": PRESSURE}


def units_of(cards: CardSettings) -> dict[str, str]:
    """Return the units of length, force and pressure of a model whose stresses are in the unit of its cards."""
    length, force, *_ = cards.system.units.split(", ")
    return {LENGTH.name: length, FORCE.name: force, PRESSURE.name: cards.unit}


def conversion(text: str, cards: CardSettings, unit: str) -> float:
    """Return what a quantity of a model is multiplied with to be in a unit; 1 of one whose unit is not known.

    Parameters
    ----------
    text : str
        The quantity, such as ``RF2@TOP``.
    cards : CardSettings
        With the unit of stress of the model, from which those of lengths and forces follow.
    unit : str
        That of the file; empty where it has none.

    Raises
    ------
    InputError
        When the unit is missing, or is one of another quantity.

    Examples
    --------
    >>> from tissuq.export import CardSettings
    >>> conversion("RF2@TOP", CardSettings(unit="MPa"), "mN")  # the model's are N
    1000.0
    """
    quantity = parse_quantity("quantity", text)
    kind = PHYSICAL.get(quantity.kind) if isinstance(quantity, Component) else None
    if kind is None:
        return 1.0
    if not unit:
        raise InputError(
            f"the file does not say in which unit the {kind.name} is that {text} is compared with: write it into the "
            f"heading of the column, as in {kind.name} [{units_of(cards)[kind.name]}]."
        )
    return kind.factor(units_of(cards)[kind.name]) / kind.factor(unit)
