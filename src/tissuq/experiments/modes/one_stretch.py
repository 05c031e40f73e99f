"""Modes with one stretch and one stress: uniaxial, equibiaxial, planar."""

from __future__ import annotations

from typing import Any

from tissuq.experiments.modes.mode import ControlPath, LoadingMode
from tissuq.experiments.modes.path import Deformation, Path

__all__ = ["Equibiaxial", "Planar", "Uniaxial"]


class Uniaxial(LoadingMode):
    """Tension or compression along one axis: F = diag(l, l^-1/2, l^-1/2).

    The lateral stretches are equal because the material is isotropic, or symmetric about the axis.
    """

    name = "uniaxial"
    description = "tension or compression along one axis"

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

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return point, 1.0, 1.0 / point
