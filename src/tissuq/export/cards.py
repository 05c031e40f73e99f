"""What is asked of cards, what they are, and the base of everything that draws can be written as."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from tissuq.ensemble import Ensemble
from tissuq.errors import InputError
from tissuq.experiments.units import stress_unit
from tissuq.registry import find, variants

__all__ = ["CardFormat", "CardSettings", "Cards", "UnitSystem", "card_format", "card_formats"]


class UnitSystem(NamedTuple):
    """Consistent units of a finite-element model: the others, and the density of water in them."""

    others: str
    water: float


UNITS = {
    "MPa": UnitSystem("mm, N, t, s", 1e-9),
    "kPa": UnitSystem("mm, mN, kg, s", 1e-6),
    "Pa": UnitSystem("m, N, kg, s", 1e3),
}
STIFF = 1000.0
"""Default bulk modulus over the mean initial shear modulus: near 0.4995 for Poisson's ratio."""


@dataclass(frozen=True)
class CardSettings:
    """What is asked of cards.

    Parameters
    ----------
    law : str, optional
        The family of materials in which the nearest one is taken: ``"polynomial"``, ``"reduced-polynomial"``,
        ``"ogden"`` or ``"mixture"``. Unless given, the draws' own law where the code has it, else the best of the
        code's projections: nearly all draws stable, then the smallest error.
    order : int, optional
        Of that family; unless given, the highest that the code has or is worthwhile.
    unit : str
        Of stress in the finite-element model: ``"MPa"`` (mm, N, t), ``"kPa"`` (mm, mN, kg) or ``"Pa"`` (m, N, kg).
    bulk_modulus : float, optional
        In that unit, the same for all draws; unless given, 1000 times the mean initial shear modulus.
    poisson : float, optional
        Instead: Poisson's ratio at the reference, from which each draw has a bulk modulus of its own.
    name : str
        Of the material in the cards, the same in all so that they can be exchanged.
    source : str
        Where the draws come from, for the comments.

    Raises
    ------
    InputError
        When a value has no meaning.
    """

    law: str | None = None
    order: int | None = None
    unit: str = "MPa"
    bulk_modulus: float | None = None
    poisson: float | None = None
    name: str = "TISSUE"
    source: str = ""

    def __post_init__(self) -> None:
        if self.unit not in UNITS:
            raise InputError(f"the unit of a model must be one of {', '.join(UNITS)}, not '{self.unit}'.")
        if self.bulk_modulus is not None and self.poisson is not None:
            raise InputError("give the bulk modulus or Poisson's ratio, not both.")
        if self.bulk_modulus is not None and not 0 < self.bulk_modulus < float("inf"):
            raise InputError(f"a bulk modulus must be positive, not {self.bulk_modulus:g}.")
        if self.poisson is not None and not 0 < self.poisson < 0.5:
            raise InputError(f"Poisson's ratio must lie between 0 and 0.5, not at {self.poisson:g}.")
        if self.order is not None and self.law is None:
            raise InputError("an order is that of a law: name the law, too, such as polynomial or ogden.")
        if not (self.name.isascii() and self.name.replace("_", "").replace("-", "").isalnum() and len(self.name) <= 40):
            raise InputError(f"'{self.name}' cannot name a material: use up to 40 letters, digits, _ and -.")

    @property
    def factor(self) -> float:
        """The number of units of stress in one MPa."""
        return 1 / stress_unit(self.unit).to_mpa

    @property
    def system(self) -> UnitSystem:
        """The other units."""
        return UNITS[self.unit]

    def bulk(self, modulus: float, mean: float) -> float:
        """Return the bulk modulus of a draw with this initial shear modulus, in the unit, where all have that mean.

        Raises
        ------
        InputError
            When Poisson's ratio gives none, because the shear modulus is not positive.
        """
        if self.poisson is not None and not modulus > 0:
            raise InputError(
                "a draw's initial shear modulus is not positive, so that Poisson's ratio gives it no bulk modulus: "
                "give that of all draws (--bulk-modulus), or leave out draws that are not stable."
            )
        if self.poisson is not None:
            return 2 * modulus * (1 + self.poisson) / (3 * (1 - 2 * self.poisson))
        return self.bulk_modulus if self.bulk_modulus is not None else STIFF * mean


@dataclass(frozen=True)
class Cards:
    """Draws as files for another program.

    Attributes
    ----------
    files : mapping of str to str
        Texts by the names of the files, one for each draw.
    index : tuple of mappings
        A row for each draw: its file, parameters, constants, and how far its card is from the draw.
    notes : tuple of str
        What a reader must know, in sentences.
    """

    files: Mapping[str, str]
    index: tuple[Mapping[str, Any], ...]
    notes: tuple[str, ...]


class CardFormat(ABC):
    """A way to write draws for another program; a new one is one subclass in one file."""

    name: ClassVar[str]
    description: ClassVar[str]

    @abstractmethod
    def cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        """Return the draws as files."""


def card_formats() -> dict[str, type[CardFormat]]:
    """Return the formats by name."""
    return variants(CardFormat)


def card_format(name: str) -> CardFormat:
    """Return the format of that name.

    Raises
    ------
    InputError
        When there is none.
    """
    return find(CardFormat, "format of cards", name, InputError)()
