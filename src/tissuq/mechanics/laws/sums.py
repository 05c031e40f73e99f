"""A sum of materials is a material."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate, combinations, pairwise
from typing import Any

from tissuq.errors import ModelError
from tissuq.experiments.modes import Deformation
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter

__all__ = ["MaterialSum", "added"]


@dataclass(frozen=True)
class MaterialSum(Material):
    """The sum of the energies of some materials, whose parameters follow each other.

    Different parameters with the same symbol get the place of their material, mu_1 and mu_2. The same parameter in two
    materials (C10 of two polynomials, Jm of two that lock) is refused.
    """

    parts: tuple[Material, ...]

    def __post_init__(self) -> None:
        for first, second in combinations(self.parts, 2):
            shared = [each.symbol for each in first.parameters if each in second.parameters]
            if shared:
                raise ModelError(
                    f"the sum '{self.name}' would have {', '.join(shared)} twice, of '{first.name}' and of "
                    f"'{second.name}'. Leave one of them out, or write the sum as a material of your own in which "
                    "their symbols differ."
                )

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The names of its parts, joined."""
        return "+".join(part.name for part in self.parts)

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formulas of its parts, joined."""
        return " + ".join(part.formula for part in self.parts)

    @property
    def source(self) -> str:  # type: ignore[override]
        """The sources of its parts, joined."""
        return "; ".join(part.source for part in self.parts)

    @property
    def caution(self) -> str:  # type: ignore[override]
        """What its parts say, and what the sum adds."""
        own = "The initial shear modulus is the sum of those of the parts."
        return " ".join([*(part.caution for part in self.parts if part.caution), own])

    @property
    def is_isotropic(self) -> bool:  # type: ignore[override]
        """Whether all parts are."""
        return all(part.is_isotropic for part in self.parts)

    @property
    def needs_matrix(self) -> bool:  # type: ignore[override]
        """Whether all parts do."""
        return all(part.needs_matrix for part in self.parts)

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The parameters of its parts."""
        every = [each.symbol for part in self.parts for each in part.parameters]
        return tuple(
            replace(each, symbol=f"{each.symbol}_{place}") if every.count(each.symbol) > 1 else each
            for place, part in enumerate(self.parts, start=1)
            for each in part.parameters
        )

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return sum(part.strain_energy(I1, I2, own) for part, own in self._shares(values))

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return sum(part.energy(stretches, own) for part, own in self._shares(values))

    def energy_of(self, deformation: Deformation, values: Any) -> Any:
        return sum(part.energy_of(deformation, own) for part, own in self._shares(values))

    def why_not(self, deformation: Deformation) -> str:
        return next(filter(None, (part.why_not(deformation) for part in self.parts)), "")

    def _shares(self, values: Any) -> list[tuple[Material, Any]]:
        """Return every part with its values."""
        ends = pairwise(accumulate((len(part.parameters) for part in self.parts), initial=0))
        return [(part, values[start:end]) for part, (start, end) in zip(self.parts, ends, strict=True)]


def added(*materials: Material) -> MaterialSum:
    """Return the sum of materials; the parts of sums become its own.

    Raises
    ------
    ModelError
        When two of them have the same parameter.
    """
    parts: list[Material] = []
    for each in materials:
        parts.extend(each.parts if isinstance(each, MaterialSum) else [each])
    return MaterialSum(tuple(parts))
