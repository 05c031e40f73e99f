"""What a loading mode is: controls that a test sets, and a path of deformations for each stress that it measures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.experiments.modes.path import Deformation, Path, States
from tissuq.registry import find, variants

WORDS_FOR_MODES = {
    "tension": "uniaxial",
    "tensile": "uniaxial",
    "compression": "uniaxial",
    "unconfined-compression": "uniaxial",
    "shear": "simple-shear",
    "torsion": "simple-shear",
    "pure-shear": "planar",
    "equi-biaxial": "equibiaxial",
    "inflation": "inflated-tube",
}
"""Words of laboratories for loading modes that have another name here."""


@dataclass(frozen=True)
class Control:
    """What a test sets: its name, its value where nothing is deformed, and the number that it must exceed."""

    name: str
    reference: float = 1.0
    above: float = 0.0


STRETCH = Control("stretch")
SHEAR = Control("amount of shear", reference=0.0, above=-inf)
SMALL_CHANGES = np.array([0.0, 0.05, 0.1])
"""Of the first control from rest, at which a mode that is not from here is looked at."""
NO_CHANGE = 1e-9
"""Largest difference of a stretch, or a volume, from 1 that is a rounding error."""
HELD = 0.1
"""Step of a control from one measurement to the next, over those of another one, below which it is held."""


def values_of_control(points: FloatArray, number: int) -> FloatArray:
    """Return the values (n,) of one control at points (n,) or (n, c)."""
    return points if points.ndim == 1 else np.asarray(points[:, number])


@dataclass(frozen=True)
class LoadingMode(ABC):
    """Isochoric deformations from the identity that a test sets, and a path for each stress that it measures.

    A new mode is one subclass: it names itself and says which principal stretches belong to a point. Its engineering
    stress is then the derivative of the strain energy by its control. A mode whose principal axes are not those of the
    test overrides `deformation`, too, as does one whose deformation only an isotropic material has. One with other
    controls or with several stresses names them; where a stress is not the derivative by the control, or several axes
    carry it, the mode overrides `paths`. What is not from here is checked when it is used: three stretches, 1 at rest,
    of product 1.
    """

    entry_point_group: ClassVar[str] = "tissuq.modes"
    name: ClassVar[str]
    description: ClassVar[str]
    controls: ClassVar[tuple[Control, ...]] = (STRETCH,)
    """What is set, in the order of the last axis of points."""
    stresses: ClassVar[tuple[str, ...]] = ("engineering stress",)
    """What is measured, in the order of `paths`."""
    machine_axes: ClassVar[tuple[str, ...]] = ()
    """What the axes of the stresses are called in the file of a biaxial machine, where the mode is of such a test."""
    has_axis: ClassVar[bool] = False
    """Whether a specimen may be cut along axis 2 of the tissue, too: `AlongAxis2`."""

    @abstractmethod
    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        """Return the principal stretches at a point: plain arithmetic, differentiable."""

    def deformation(self, point: Any) -> Deformation:
        """Return the deformation at a point."""
        return Deformation.along_axes(self.principal_stretches(point))

    @property
    def problem(self) -> str:
        """What is wrong with its deformations, in words; nothing where they are isochoric and begin from the identity.

        Examples
        --------
        >>> loading_mode("planar").problem
        ''
        """
        try:
            deformations = [path.moved(self.excursion(SMALL_CHANGES), 0.0) for path in self.paths]
        except Exception as error:  # of code that is not from here
            return f"its deformation cannot be computed ({type(error).__name__}: {error})"
        if len(deformations) != len(self.stresses):
            return f"it names {len(self.stresses)} stresses and has {len(deformations)} paths"
        for deformation in deformations:
            stretches = np.broadcast_arrays(*deformation.stretches, SMALL_CHANGES)[:-1]
            if len(stretches) != 3:
                return f"it has {len(stretches)} principal stretches, not three"
            if not np.allclose([stretch[0] for stretch in stretches], 1.0, atol=NO_CHANGE):
                return f"its principal stretches where nothing is deformed are {_numbers(stretches, 0)}, not 1"
            volume = stretches[0] * stretches[1] * stretches[2]
            if not np.allclose(volume, 1.0, atol=NO_CHANGE):
                found = f"are {_numbers(stretches, -1)}, of product {volume[-1]:.4g}"
                return f"it changes the volume: principal stretches a little from rest {found}, not 1"
        return ""

    @property
    def paths(self) -> tuple[Path, ...]:
        """One path for each measured stress, along what that stress does work on; here its one control."""
        return (ControlPath(self),)

    @property
    def path(self) -> Path:
        """The path of the only stress.

        Raises
        ------
        ModelError
            When there are several.
        """
        if len(self.stresses) > 1:
            raise ModelError(
                f"loading mode '{self.name}' measures {' and '.join(self.stresses)}, each along a path of its own: "
                "take one of its paths."
            )
        return self.paths[0]

    def at(self, points: Any) -> States:
        """Return the states at points of the mode, on the path of its only stress."""
        return self.path.at(points)

    def from_second_piola_kirchhoff(self, points: Any, stresses: Any) -> Any:
        """Return engineering stresses P = F S (k, n) for second Piola-Kirchhoff stresses S (k, n).

        Here along axes that are the principal ones, where F is the stretch along the axis of each stress.

        Raises
        ------
        InputError
            When the stresses of the mode do not determine them.
        """
        return np.stack([stress * path.cauchy_ratio(points) for path, stress in zip(self.paths, stresses, strict=True)])

    @property
    def along_axis_1(self) -> LoadingMode:
        """The same mode of a specimen along axis 1 of the tissue."""
        return self

    @property
    def is_curve(self) -> bool:
        """Whether it is one stress against one stretch."""
        return self.controls == (STRETCH,) and len(self.stresses) == 1

    @property
    def abscissa_control(self) -> Control:
        """What stresses are drawn against: the first control, or where there are several stresses a stretch of each."""
        return self.controls[0] if 1 in (len(self.controls), len(self.stresses)) else STRETCH

    def drawn_against(self, channel: int, points: ArrayLike) -> int:
        """Return the number of the control that a stress at points (n,) or (n, c) is drawn against.

        That along whose axis it acts; where this one is held and another one changes, the latter.
        """
        columns, probe = np.atleast_2d(np.transpose(points)), self.excursion(0.1)
        acting = np.flatnonzero(np.atleast_1d(probe) == self.paths[channel].abscissa(probe))
        steps = np.median(np.abs(np.diff(columns, axis=1)), axis=1) if columns.shape[1] > 1 else np.zeros(len(columns))
        if len(acting) and steps[acting[0]] >= HELD * steps.max():
            return int(acting[0])
        return int(np.argmax(steps))

    @property
    def reference(self) -> Any:
        """The point at which nothing is deformed: a number, or (c,) of several controls."""
        return self.excursion(0.0)

    def excursion(self, change: ArrayLike) -> FloatArray:
        """Return points on a line through the reference: the first control changes so much, every further one less."""
        rates = 1 / np.arange(1.0, 1 + len(self.controls))
        points = np.array([control.reference for control in self.controls]) + np.multiply.outer(change, rates)
        return np.asarray(points if len(self.controls) > 1 else points[..., 0])


@dataclass(frozen=True)
class ControlPath(Path):
    """The deformations of a mode with one control, whose stress does work on that."""

    mode: LoadingMode
    loaded_axes: int = 1

    def moved(self, point: Any, step: Any) -> Deformation:
        return self.mode.deformation(point + step)


@dataclass(frozen=True)
class AlongAxis2(LoadingMode):
    """A mode of one stretch with a specimen that was cut along axis 2 of the tissue, not along axis 1.

    Attributes
    ----------
    mode : LoadingMode
        That of a specimen along axis 1.
    """

    mode: LoadingMode

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The name of the mode, and of the axis."""
        return f"{self.mode.name}@2"

    @property
    def description(self) -> str:  # type: ignore[override]
        """That of the mode, and the axis."""
        return f"{self.mode.description}, of a specimen along axis 2 of the tissue"

    @property
    def along_axis_1(self) -> LoadingMode:
        return self.mode

    def principal_stretches(self, point: Any) -> tuple[Any, Any, Any]:
        return self.deformation(point).stretches

    def deformation(self, point: Any) -> Deformation:
        of_axis_1 = self.mode.deformation(point)
        (stretch_1, stretch_2, stretch_3), (c11, c22, c12) = of_axis_1.stretches, of_axis_1.plane
        return Deformation((stretch_2, stretch_1, stretch_3), (c22, c11, c12))


def _numbers(stretches: Sequence[FloatArray], place: int) -> str:
    return ", ".join(f"{stretch[place]:.4g}" for stretch in stretches)


def _checked(mode: LoadingMode) -> LoadingMode:
    """Return a mode, or raise where it is not from here and its deformations are wrong."""
    kind = type(mode)
    if not kind.__module__.startswith("tissuq.") and (problem := mode.problem):
        raise ModelError(
            f"loading mode '{mode.name}' ({kind.__module__}.{kind.__qualname__}) cannot be used: {problem}."
        )
    return mode


def loading_modes() -> dict[str, type[LoadingMode]]:
    """Return every loading mode by name.

    Raises
    ------
    ModelError
        When the deformations of one of another package, or of your own, do not keep the volume or begin elsewhere.
    """
    return {name: type(_checked(kind())) for name, kind in variants(LoadingMode).items()}


def curve_modes() -> list[LoadingMode]:
    """Return the loading modes of one stretch and one stress."""
    return [mode for mode in (kind() for kind in loading_modes().values()) if mode.is_curve]


def loading_mode(mode: str | LoadingMode) -> LoadingMode:
    """Return the loading mode of that name; a mode is returned as it is.

    A specimen that was cut along axis 2 of the tissue has ``@2`` after the name, as in ``uniaxial@2``.

    Raises
    ------
    ModelError
        When no mode has that name, or its deformations do not keep the volume or begin elsewhere.
    """
    if isinstance(mode, LoadingMode):
        return _checked(mode)
    name, _, axis = str(mode).partition("@")
    along_axis_1 = _mode_named(name)
    if not axis:
        return along_axis_1
    if axis not in ("1", "2") or not along_axis_1.has_axis:
        having = " or ".join(f"{name}@2" for name, kind in loading_modes().items() if kind.has_axis)
        raise ModelError(
            f"there is no loading mode named '{mode}': after @ stands axis 1 or 2 of the tissue, along which a "
            f"specimen was cut, as in {having}."
        )
    return along_axis_1 if axis == "1" else AlongAxis2(along_axis_1)


def _mode_named(mode: str) -> LoadingMode:
    try:
        return _checked(find(LoadingMode, "loading mode", mode, ModelError)())
    except ModelError as error:
        word = mode.strip().lower().replace("_", "-").replace(" ", "-")
        if word not in WORDS_FOR_MODES:
            raise
        raise ModelError(f"{error} For {word} take '{WORDS_FOR_MODES[word]}'.") from error
