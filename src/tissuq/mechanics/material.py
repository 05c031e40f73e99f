"""Materials: strain energies of the invariants or of the principal stretches, with named parameters, and their sums."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import accumulate, chain, combinations, pairwise
from math import pi
from typing import Any, ClassVar, TypeAlias

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import ModelError
from tissuq.experiments.modes import Deformation
from tissuq.parameters.parameter import Parameter
from tissuq.registry import variants

SUMS = {
    "standard-reinforcing": "neo-hookean+standard-fibres",
    "holzapfel-gasser-ogden": "neo-hookean+exponential-fibres",
    "gasser-ogden-holzapfel": "neo-hookean+dispersed-fibres",
}
"""Sums that have a name in the literature, which is theirs everywhere."""
Addends: TypeAlias = "tuple[tuple[Material, list[int]], ...]"
"""Materials of which one is the sum, and which of its parameters each of them has."""


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
    felt_axes: ClassVar[tuple[int, ...]] = ()
    """The axes of the test, 0 and 1, along which it feels the stretch; none of an isotropic material."""
    shears: ClassVar[bool] = False
    """Whether it would shear where it is pulled along an axis of the test with free sides."""

    def _describe(self, **said: Any) -> None:
        """Say of an object what is not said of its class."""
        for attribute, value in said.items():
            object.__setattr__(self, attribute, value)

    def __add__(self, material: Material) -> Material:
        return MaterialSum.of(self, material)

    @property
    def linear_mask(self) -> BoolArray:
        """To which of its parameters (k,) the stress is proportional."""
        return np.array([parameter.is_linear for parameter in self.parameters], dtype=bool)

    def unit_values(self, nonlinear: FloatArray) -> FloatArray:
        """Return values (m, p, k) in which each of p linear parameters is one by itself, at m others' values (m, s)."""
        is_linear = self.linear_mask
        values = np.repeat(np.eye(is_linear.size)[is_linear][None], len(nonlinear), axis=0)
        values[:, :, ~is_linear] = nonlinear[:, None]
        return values

    @property
    def addends(self) -> Addends:
        """Materials whose energies add up to this one, and which of its parameters each of them has."""
        return ((self, [*range(len(self.parameters))]),)

    @abstractmethod
    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        """Return the strain energy per undeformed volume (MPa) for parameter values in their order."""

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        """Return the same energy (MPa) from the three principal stretches: what stress is derived from."""
        x, y, z = (stretch * stretch for stretch in stretches)
        return self.strain_energy(x + y + z, x * y + y * z + z * x, values)

    def energy_of(self, deformation: Deformation, values: Any) -> Any:
        """Return the same energy (MPa) of a deformation; a material with directions sees more than the stretches."""
        return self.energy(deformation.stretches, values)

    def why_not(self, deformation: Deformation) -> str:
        """Return why the stresses of a mode are not sums over the parameters of this material, or nothing."""
        return ""

    @property
    def plain(self) -> Material:
        """The same material in the parameters of the literature."""
        return self

    def plain_values(self, values: Any) -> Any:
        """Return values of the parameters of the literature, for those (k, ...) of its own parameters."""
        return values


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
        x, y, z = (np.sqrt((I1 + 2 * np.sqrt(spread) * np.cos((angle - turn) / 3)) / 3) for turn in (0, 2 * pi, 4 * pi))
        return self.energy((x, y, z), values)


@dataclass(frozen=True)
class MaterialSum(Material):
    """The sum of the energies of some materials, whose parameters follow each other.

    Different parameters with the same symbol get the place of their material, mu_1 and mu_2. The same parameter in two
    materials (C10 of two polynomials, Jm of two that lock) is refused.
    """

    summands: tuple[Material, ...]

    @classmethod
    def of(cls, *materials: Material) -> MaterialSum:
        """Return the sum of materials; the summands of sums become its own.

        Raises
        ------
        ModelError
            When two of them have the same parameter.
        """
        nested = (material.summands if isinstance(material, MaterialSum) else (material,) for material in materials)
        return cls(tuple(chain.from_iterable(nested)))

    def __post_init__(self) -> None:
        joined = "+".join(material.name for material in self.summands)
        symbols = [parameter.symbol for material in self.summands for parameter in material.parameters]
        of_sum = "The initial shear modulus is the sum of those of the parts."
        self._describe(
            name=next((name for name, summands in SUMS.items() if summands == joined), joined),
            formula=" + ".join(material.formula for material in self.summands),
            source="; ".join(material.source for material in self.summands),
            caution=" ".join([*(material.caution for material in self.summands if material.caution), of_sum]),
            is_isotropic=all(material.is_isotropic for material in self.summands),
            needs_matrix=all(material.needs_matrix for material in self.summands),
            felt_axes=axes_felt_by(self.summands),
            shears=any(material.shears for material in self.summands),
            parameters=tuple(
                replace(parameter, symbol=f"{parameter.symbol}_{number}")
                if symbols.count(parameter.symbol) > 1
                else parameter
                for number, material in enumerate(self.summands, start=1)
                for parameter in material.parameters
            ),
        )
        for material, later in combinations(self.summands, 2):
            shared = [parameter.symbol for parameter in material.parameters if parameter in later.parameters]
            if shared:
                raise ModelError(
                    f"the sum '{self.name}' would have {', '.join(shared)} twice, of '{material.name}' and of "
                    f"'{later.name}'. Leave one of them out, or write the sum as a material of your own in which "
                    "their symbols differ."
                )

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return sum(material.strain_energy(I1, I2, share) for material, share in self.shares(values))

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return sum(material.energy(stretches, share) for material, share in self.shares(values))

    def energy_of(self, deformation: Deformation, values: Any) -> Any:
        return sum(material.energy_of(deformation, share) for material, share in self.shares(values))

    def why_not(self, deformation: Deformation) -> str:
        return next(filter(None, (material.why_not(deformation) for material in self.summands)), "")

    def shares(self, values: Any) -> list[tuple[Material, Any]]:
        """Return every summand with its values."""
        ends = pairwise(accumulate((len(material.parameters) for material in self.summands), initial=0))
        return [(material, values[start:end]) for material, (start, end) in zip(self.summands, ends, strict=True)]

    @property
    def addends(self) -> Addends:
        """Those of its summands."""
        return tuple(
            (addend, [places_of_summand[place] for place in places])
            for summand, places_of_summand in self.shares(range(len(self.parameters)))
            for addend, places in summand.addends
        )


def axes_felt_by(materials: Iterable[Material]) -> tuple[int, ...]:
    """Return the axes that one of some materials feels."""
    return tuple(sorted({axis for material in materials for axis in material.felt_axes}))


def materials() -> dict[str, type[Material]]:
    """Return every material by name, those with few parameters first."""
    return dict(sorted(variants(Material).items(), key=lambda item: len(item[1].parameters)))
