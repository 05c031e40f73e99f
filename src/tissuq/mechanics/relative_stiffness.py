"""Fibres whose stiffness is a multiple of that of their matrix, for tests with free sides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from tissuq.experiments.modes import Deformation, States
from tissuq.mechanics.equilibrium import has_free_axis
from tissuq.mechanics.material import Material, MaterialSum
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import LogUniform

RATIO = LogUniform(0.01, 1000.0)
"""The default prior of the stiffness of fibres over that of the matrix."""


@dataclass(frozen=True)
class RelativeStiffness(Material):
    """A sum in which one stiffness is that of the matrix, and those of the fibres are multiples of it.

    The lateral stretch of a uniaxial test depends on the ratios of the stiffnesses, so that the stress is proportional
    to one of them where the others are given as multiples of it. What is said of it is what is said of the sum.

    Parameters
    ----------
    material : MaterialSum
    """

    material: MaterialSum

    is_isotropic = False

    def __post_init__(self) -> None:
        said = ("name", "formula", "source", "caution", "felt_axes")
        self._describe(**{attribute: getattr(self.material, attribute) for attribute in said})

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Those of the sum, the stiffnesses of fibres as ratios."""
        [matrix], ratios = self._stiffnesses
        symbol = self.material.parameters[matrix].symbol
        return tuple(
            replace(
                parameter,
                symbol=f"{parameter.symbol}_over_{symbol}",
                description=f"{parameter.description}, over {symbol}",
                dimension="number",
                is_linear=False,
                relative_prior=RATIO,
            )
            if number in ratios
            else parameter
            for number, parameter in enumerate(self.material.parameters)
        )

    @cached_property
    def _stiffnesses(self) -> tuple[list[int], list[int]]:
        return _stiffnesses(self.material)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return self.material.strain_energy(I1, I2, self.plain_values(values))

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return self.material.energy(stretches, self.plain_values(values))

    def energy_of(self, deformation: Deformation, values: Any) -> Any:
        return self.material.energy_of(deformation, self.plain_values(values))

    def why_not(self, deformation: Deformation) -> str:
        return "" if deformation.has_free_axis else self.material.why_not(deformation)

    @property
    def plain(self) -> Material:
        """The sum."""
        return self.material

    def plain_values(self, values: Any) -> list[Any]:
        """Return the values (k, ...) of the sum."""
        [matrix], ratios = self._stiffnesses
        return [value * values[matrix] if number in ratios else value for number, value in enumerate(values)]


def for_states(material: Material, states: States) -> Material:
    """Return a material in parameters of which one is a stiffness, if its lateral stretch at states depends on others.

    Else, and where its matrix has several stiffnesses, the material as it is.
    """
    if not isinstance(material, MaterialSum) or material.shears or len(_stiffnesses(material)[0]) != 1:
        return material
    return RelativeStiffness(material) if has_free_axis(material, states) else material


def _stiffnesses(material: MaterialSum) -> tuple[list[int], list[int]]:
    """Return which parameters are stiffnesses of the matrix, and which of fibres."""
    numbers = material.shares(range(len(material.parameters)))
    matrix, fibres = (
        [n for part, its in numbers for n in its if part.is_isotropic == is_matrix and material.linear_mask[n]]
        for is_matrix in (True, False)
    )
    return matrix, fibres
