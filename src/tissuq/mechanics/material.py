"""Materials: strain-energy densities of the invariants or of the principal stretches, with named parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import numpy as np

from tissuq.experiments.modes import Deformation
from tissuq.parameters.parameter import Parameter
from tissuq.registry import variants

__all__ = ["Material", "StretchMaterial", "materials"]


@dataclass(frozen=True)
class Material(ABC):
    """An incompressible hyperelastic material, isotropic as W(I1, I2) unless it says otherwise.

    A new material is one subclass in one file: its name, formula, parameters and energy. The energy is written
    with plain arithmetic and must vanish at I1 = I2 = 3; every stress is its derivative along a loading mode, so no
    material holds a stress formula. A law of the principal stretches, such as Ogden's, is a `StretchMaterial`; fibres
    are a `FibreMaterial`. The sum of two materials is a material.
    """

    entry_point_group: ClassVar[str] = "tissuq.materials"
    name: ClassVar[str]
    formula: ClassVar[str] = "formula not stated"
    source: ClassVar[str] = "source not stated"
    parameters: ClassVar[tuple[Parameter, ...]]
    caution: ClassVar[str] = ""
    """What a reader of its parameters must know."""
    is_isotropic: ClassVar[bool] = True
    needs_matrix: ClassVar[bool] = False
    """Whether it has no stiffness of its own at the reference, so that it is only part of a sum."""

    def __add__(self, other: Material) -> Material:
        from tissuq.mechanics.laws.sums import added

        return added(self, other)

    @abstractmethod
    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        """Return the strain energy per undeformed volume (MPa) for parameter values in their order."""

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        """Return the same energy (MPa) from the three principal stretches: what stress is derived from."""
        first, second, third = (stretch * stretch for stretch in stretches)
        return self.strain_energy(first + second + third, first * second + second * third + third * first, values)

    def energy_of(self, deformation: Deformation, values: Any) -> Any:
        """Return the same energy (MPa) of a deformation; a material with directions sees more than the stretches."""
        return self.energy(deformation.stretches, values)

    def why_not(self, deformation: Deformation) -> str:
        """Return why a mode does not say how a specimen of this material deforms, in a sentence, or nothing."""
        return ""


class StretchMaterial(Material):
    """An isotropic, incompressible hyperelastic material W(l1, l2, l3), symmetric in the principal stretches.

    As `Material`, but `energy` is what a subclass writes. It must vanish at l1 = l2 = l3 = 1, where it needs two
    derivatives along any path (sums of powers have them; sorted or subtracted stretches in a root do not).
    """

    @abstractmethod
    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        """Return the strain energy per undeformed volume (MPa) for parameter values in their order."""

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        """Return the energy at given invariants (NumPy only, and no derivatives: two equal roots have none)."""
        spread = np.maximum(I1**2 - 3 * I2, 0)  # squared stretches solve x^3 - I1 x^2 + I2 x - 1 = 0
        skew = 2 * I1**3 - 9 * I1 * I2 + 27
        angle = np.arctan2(np.sqrt(np.maximum(4 * spread**3 - skew**2, 0)), skew)
        first, second, third = (
            np.sqrt((I1 + 2 * np.sqrt(spread) * np.cos((angle - turn) / 3)) / 3) for turn in (0, 2 * pi, 4 * pi)
        )
        return self.energy((first, second, third), values)


def materials() -> dict[str, type[Material]]:
    """Return every material by name, those with few parameters first."""
    return dict(sorted(variants(Material).items(), key=lambda item: len(item[1].parameters)))
