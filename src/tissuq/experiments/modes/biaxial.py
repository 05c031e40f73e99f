"""Modes in the plane of a sheet whose faces are free: biaxial, tubes, one axis held, stretches imposed."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.experiments.modes.mode import AlongAxis2, Control, LoadingMode
from tissuq.experiments.modes.one_control import Planar
from tissuq.experiments.modes.path import Deformation, Path


def _sheet(stretch_1: Any, stretch_2: Any) -> Deformation:
    return Deformation.along_axes((stretch_1, stretch_2, 1 / (stretch_1 * stretch_2)))


@dataclass(frozen=True)
class _Pulled(Path):
    """A step of one of two stretches, the other one as it is."""

    axis: int

    def moved(self, point: Any, step: Any) -> Deformation:
        stretch_1, stretch_2 = point[..., 0], point[..., 1]
        return _sheet(stretch_1, stretch_2 + step) if self.axis else _sheet(stretch_1 + step, stretch_2)

    def abscissa(self, points: Any) -> Any:
        return points[..., self.axis]


@dataclass(frozen=True)
class _Held(Path):
    """A step of the stretch that is held at one; its stress is drawn against the other one."""

    def moved(self, point: Any, step: Any) -> Deformation:
        return _sheet(point, 1 + step)

    def cauchy_ratio(self, points: Any) -> Any:
        return np.ones_like(points)


class Biaxial(LoadingMode):
    """Any two stretches: F = diag(l1, l2, 1/(l1 l2)); stresses dW/dl1 and dW/dl2."""

    name = "biaxial"
    description = "any two stretches of a sheet, with the stresses of both axes"
    controls = (Control("stretch of axis 1"), Control("stretch of axis 2"))
    stresses = ("engineering stress of axis 1", "engineering stress of axis 2")
    machine_axes: ClassVar[tuple[str, ...]] = ("x", "y")

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return _sheet(point[..., 0], point[..., 1]).stretches

    @property
    def paths(self) -> tuple[Path, ...]:
        return _Pulled(0), _Pulled(1)


class ThinTube(Biaxial):
    """Extension and inflation of a thin tube that does not twist: hoop and axial stretch, as `Biaxial`.

    Files of pressure, diameter and axial force are read in it. `engineering_stresses` tells what a pressure and a force
    are in these stresses where the wall is thin.
    """

    name = "thin-tube"
    description = "extension and inflation of a thin tube: hoop and axial stretch, with both stresses"
    controls = (Control("hoop stretch"), Control("axial stretch"))
    stresses = ("hoop engineering stress", "axial engineering stress")
    machine_axes = ()

    @staticmethod
    def engineering_stresses(
        stretch: ArrayLike, pressure: ArrayLike, reduced_force: ArrayLike, radius: float, thickness: float
    ) -> FloatArray:
        """Return hoop and axial engineering stress (n, 2) in MPa.

        Virtual work: the energy 2 pi R H L dW of a wall of radius R, thickness H and length L is p dv + f dl with the
        volume v = pi R^2 L l_hoop^2 l_axial inside and the length l = L l_axial. So

            dW/dl_hoop = p (R/H) l_hoop l_axial,   dW/dl_axial = f/(2 pi R H) + p R/(2 H) l_hoop^2.

        Parameters
        ----------
        stretch : (n, 2) array, dimensionless
            Hoop and axial stretch, of the middle of the wall.
        pressure : (n,) array, MPa
            Inside, above that outside.
        reduced_force : (n,) array, N
            What the machine pulls with in addition to the pressure on the closed ends.
        radius, thickness : float, mm
            Of the middle of the wall and of the wall, undeformed.

        Examples
        --------
        >>> ThinTube.engineering_stresses([[1.2, 1.5]], [0.016], [0.3], radius=5.0, thickness=0.5).round(4).tolist()
        [[0.288, 0.1343]]
        """
        hoop, axial = np.moveaxis(np.asarray(stretch, dtype=np.float64), -1, 0)
        pressure, reduced_force = np.asarray(pressure), np.asarray(reduced_force)
        of_hoop = pressure * radius / thickness * hoop * axial
        of_axis = reduced_force / (2 * pi * radius * thickness) + pressure * radius / (2 * thickness) * hoop**2
        return np.stack([of_hoop, of_axis], axis=-1)


class InflatedTube(LoadingMode):
    """Inflation of a tube at any axial stretch: hoop and axial stretch, as `ThinTube`, with the hoop stress alone.

    That is dW/dl_hoop at the axial stretch, l_hoop times which is the hoop less the radial Cauchy stress. At an axial
    stretch l_axial it is zero where l_hoop = l_axial^-1/2 if the material is isotropic; at 1 the mode is `Planar`.
    Files of pressure and diameter without an axial force are read in it.
    """

    name = "inflated-tube"
    description = "inflation of a tube held at any axial stretch, with the hoop stress alone"
    controls = (Control("hoop stretch"), Control("axial stretch"))
    stresses = ("hoop engineering stress",)

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return _sheet(point[..., 0], point[..., 1]).stretches

    @property
    def paths(self) -> tuple[Path, ...]:
        return (_Pulled(0),)


class ConstrainedUniaxial(LoadingMode):
    """Tension with one lateral axis held, F = diag(l, 1, 1/l), with the stress dW/dl2 of the held axis, too."""

    name = "constrained-uniaxial"
    description = "tension with one lateral axis held, with the stresses of both axes"
    stresses = ("engineering stress of the pulled axis", "engineering stress of the held axis")

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return Planar().principal_stretches(point)

    @property
    def paths(self) -> tuple[Path, ...]:
        return Planar().path, _Held()


@dataclass(frozen=True)
class ImposedStretches(LoadingMode):
    """The principal stretches of a mode of one stretch, imposed along the axes of the test whatever the material.

    Its stress is what does work on the stretch of the mode. It is no test, and has no place among the modes by name.

    Attributes
    ----------
    mode : LoadingMode
    axis : int
        The axis, 1 or 2, along which the first of its stretches is.
    """

    mode: LoadingMode
    axis: int = 1

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The name of the mode, and of its axis."""
        return f"{self.mode.name} along axis {self.axis}"

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return (self.mode if self.axis == 1 else AlongAxis2(self.mode)).principal_stretches(point)
