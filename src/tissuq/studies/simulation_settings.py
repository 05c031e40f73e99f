"""What a simulation of a case of finite elements depends on."""

from __future__ import annotations

from dataclasses import fields
from math import inf
from typing import TYPE_CHECKING

from tissuq.errors import InputError
from tissuq.registry import find
from tissuq.studies.option import option
from tissuq.studies.option_texts import number_or_text, pairs_of
from tissuq.studies.shared_options import RunSettings, seed

if TYPE_CHECKING:
    from tissuq.finite_elements.case import Case

__all__ = ["SimulationSettings"]


def _bulk_ratio() -> float:
    from tissuq.finite_elements.response import BULK_RATIO

    return BULK_RATIO


class SimulationSettings(RunSettings):
    """Everything that a simulation depends on.

    ``sizes`` are fields of the case (mm); ``force_noise`` is in N.
    """

    case: str = option(
        "indentation", "indentation (flat punch, disc), bar (clamped, in tension) or plate (with a hole)."
    )
    sizes: dict[str, float | str] = option(
        default_factory=dict,
        help="Size of the case in mm, NAME=VALUE; repeat for more. Indentation: depth, punch_radius, height, radius, "
        "contact=bonded|frictionless, fineness; bar: elongation, bar_length, bar_radius, fineness; plate: elongation, "
        "width, thickness, hole_radius, fineness.",
        name="size",
        unit="mm",
        parse=pairs_of("--size", "a size", "NAME=VALUE, as in depth=0.4", number_or_text),
    )
    draws: int = option(64, "Draws of the posterior.", ge=2)
    steps: int = option(8, "Steps at which the force is computed.", ge=1)
    seed: int = seed()
    full_runs: int | None = option(
        None, "Draws computed in full; the others follow to first order, much faster [all].", ge=4
    )
    force_noise: float | None = option(
        None,
        "Sd of a new measurement of the force, N [same share of the force as in the test].",
        unit="N",
        ge=0,
        lt=inf,
    )
    bulk_ratio: float = option(
        help="Bulk modulus in initial shear moduli [2000].", default_factory=_bulk_ratio, gt=0, lt=inf
    )

    def sized_case(self) -> Case:
        """Return the case with its sizes.

        Raises
        ------
        InputError
            When there is no such case or size, or a size is not possible.
        """
        from tissuq.finite_elements.case import Case

        kind = find(Case, "case", self.case, InputError)
        sizes = {field.name: field.default for field in fields(kind)}
        for name, value in self.sizes.items():
            if name not in sizes:
                defaults = ", ".join(f"{size}={default}" for size, default in sizes.items())
                raise InputError(f"case '{self.case}' has no size '{name}'; its sizes are {defaults}.")
            if isinstance(value, str) != isinstance(sizes[name], str):
                wanted = "a word" if isinstance(sizes[name], str) else "a number"
                raise InputError(f"case '{self.case}': {name} must be {wanted} like {sizes[name]}, not '{value}'.")
        return kind(**self.sizes)
