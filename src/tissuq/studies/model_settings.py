"""How a user's own finite-element model is run, and what cards of its material are like."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.studies.option import Settings, option

if TYPE_CHECKING:
    from tissuq.export import CardSettings

__all__ = ["ModelSettings"]

GROUP = "Solver and cards"


class ModelSettings(Settings):
    """The solver of a deck, and the cards in it."""

    solver: str | None = option(None, "ccx, febio4 or command [that of the deck].", group=GROUP)
    command: str = option(
        "", "Command of the solver, such as 'abaqus job={job} ask=off', {deck} with suffix.", group=GROUP
    )
    deck: str | None = option(None, "abaqus, febio, ls-dyna or ansys [what the file is].", group=GROUP)
    card_format: str | None = option(None, "Format of cards [that of the solver].", name="format", group=GROUP)
    law: str | None = option(None, "Law of the cards, as of tissuq export.", group=GROUP)
    order: int | None = option(None, "Order or number of terms of that law.", group=GROUP)
    unit: str = option("MPa", "Unit of stress of the model: MPa, kPa or Pa.", group=GROUP)
    bulk_modulus: float | None = option(
        None, "In that unit, of all draws [1000 times the mean initial shear modulus].", gt=0, lt=inf, group=GROUP
    )
    poisson: float | None = option(None, "Instead: Poisson's ratio of all draws.", group=GROUP)
    also: list[str] = option(
        default_factory=list,
        help="Another file that the solver needs beside the deck; repeat for more.",
        takes=list[Path],
        parse=lambda files: list(map(str, files)),
        group=GROUP,
    )

    def card_settings(self, **changes: Any) -> CardSettings:
        """Return the settings of the cards.

        Raises
        ------
        InputError
            When they have no meaning.
        """
        from tissuq.export import CardSettings

        names = "law", "order", "unit", "bulk_modulus", "poisson"
        return CardSettings(**{name: getattr(self, name) for name in names}, **changes)
