"""Modes with one control: uniaxial, equibiaxial, planar, and simple shear with or without its normal stress."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes.mode import SHEAR, ControlPath, LoadingMode
from tissuq.experiments.modes.path import TINY, Deformation, Path


class Uniaxial(LoadingMode):
    """Tension or compression along one axis: F = diag(l, l^-1/2, l^-1/2).

    The lateral stretches are equal if the material is isotropic, or symmetric about the axis; else they follow from its
    parameters, as no lateral stress acts. A specimen along axis 2 of the tissue is `uniaxial@2`.
    """

    name = "uniaxial"
    description = "tension or compression along one axis"
    has_axis = True

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        lateral = point**-0.5
        return point, lateral, lateral

    def deformation(self, point: Any) -> Deformation:
        stretches = self.principal_stretches(point)
        return Deformation(stretches, (stretches[0] ** 2, None, None))


class Equibiaxial(LoadingMode):
    """Equal stretch along two axes: F = diag(l, l, l^-2).

    The stresses of both axes are one because the material is isotropic; `Biaxial` has two.
    """

    name = "equibiaxial"
    description = "equal tension along two axes"

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return point, point, point**-2

    def deformation(self, point: Any) -> Deformation:
        return Deformation(self.principal_stretches(point), (None, None, None))

    @property
    def paths(self) -> tuple[Path, ...]:
        return (ControlPath(self, loaded_axes=2),)


class Planar(LoadingMode):
    """Planar tension (pure shear): F = diag(l, 1, 1/l)."""

    name = "planar"
    description = "planar tension (pure shear), one lateral axis held"
    has_axis = True

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return point, 1.0, 1.0 / point


def _sheared(shear: Any, height: Any, difference: Any) -> Deformation:
    """Return F = [[1, shear], [0, height]] in the plane, where its principal stretches have that difference."""
    total = ((1 + height) ** 2 + shear**2) ** 0.5
    stretches = 0.5 * (total + difference), 0.5 * (total - difference), 1 / height
    return Deformation(stretches, (1.0, height**2 + shear**2, shear))


class SimpleShear(LoadingMode):
    """Simple shear F = I + g e1 e2', of either sign; the stress dW/dg is P12, engineering and Cauchy stress alike.

    The principal stretches are sqrt(1 + g^2/4) + g/2, sqrt(1 + g^2/4) - g/2 and 1.
    """

    name = "simple-shear"
    description = "simple shear along axis 1 of planes normal to axis 2, with the shear stress"
    controls = (SHEAR,)
    stresses = ("shear stress",)

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return self.deformation(point).stretches

    def deformation(self, point: Any) -> Deformation:
        return _sheared(point, 1.0, point)

    @property
    def paths(self) -> tuple[Path, ...]:
        return (_Shear(self),)

    def from_second_piola_kirchhoff(self, points: Any, stresses: Any) -> Any:
        raise InputError(
            "in simple shear by an amount g the shear stress is P12 = S12 + g S22, so that the second Piola-Kirchhoff "
            "stress S12 alone does not determine it. Give the engineering or Cauchy shear stress, or with the normal "
            "stress S22 the mode simple-shear-normal."
        )


class _Shear(ControlPath):
    """A step of the shear, whose stress is engineering and Cauchy stress alike."""

    def cauchy_ratio(self, points: Any) -> Any:
        return np.ones_like(points)


@dataclass(frozen=True)
class _Normal(Path):
    """A step of the height of the sheared planes, whose stress is P22 where the thickness is free."""

    def moved(self, point: Any, step: Any) -> Deformation:
        # The principal stretches differ by sqrt(g^2 + step^2). An energy is symmetric in them, so that the corner of
        # this root at g = 0 leaves no trace in its first derivative.
        return _sheared(point, 1 + step, (point**2 + step**2 + TINY) ** 0.5)

    def cauchy_ratio(self, points: Any) -> Any:
        return np.ones_like(points)


class SimpleShearNormal(LoadingMode):
    """Simple shear with the normal stress P22 on the sheared planes (Poynting's effect); the thickness is free.

    P22 is the derivative of W along l2 at l2 = 1, where F = [[1, g], [0, l2]] in the plane and 1/l2 in the thickness.
    """

    name = "simple-shear-normal"
    description = "simple shear, with the shear stress and the normal stress on the sheared planes"
    controls = (SHEAR,)
    stresses = ("shear stress", "normal stress")

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return SimpleShear().principal_stretches(point)

    @property
    def paths(self) -> tuple[Path, ...]:
        return _Shear(SimpleShear()), _Normal()

    def from_second_piola_kirchhoff(self, points: Any, stresses: Any) -> Any:
        """Return P12 = S12 + g S22 and P22 = S22."""
        shear_stress, normal_stress = stresses
        return np.stack([shear_stress + points * normal_stress, normal_stress])
