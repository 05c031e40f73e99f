"""What a loading mode is: controls that a test sets, and a path of deformations for each stress that it measures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import ModelError
from tissuq.registry import find, variants

__all__ = ["SHEAR", "STRETCH", "Control", "Deformation", "LoadingMode", "Path", "loading_mode", "loading_modes"]


@dataclass(frozen=True)
class Control:
    """What a test sets: its name, its value where nothing is deformed, and the number that it must exceed."""

    name: str
    reference: float = 1.0
    above: float = 0.0


STRETCH = Control("stretch")
SHEAR = Control("amount of shear", reference=0.0, above=-inf)


@dataclass(frozen=True)
class Deformation:
    """An isochoric deformation in the axes of the test: what a strain energy is a function of.

    Attributes
    ----------
    stretches : tuple of three arrays
        The principal stretches, that of the thickness last where it is free of stress.
    plane : tuple of three arrays
        C11, C22 and C12 of C = F'F in the plane of the test, the first loaded axis first: what fibres there feel.
        None where the test leaves it to the material, so that only a symmetric one is known to deform like this.
    """

    stretches: tuple[Any, Any, Any]
    plane: tuple[Any, Any, Any]

    @classmethod
    def along_axes(cls, stretches: tuple[Any, Any, Any]) -> Deformation:
        """Return the deformation whose principal axes are those of the test."""
        first, second, _ = stretches
        return cls(stretches, (first**2, second**2, 0.0))


class Path(ABC):
    """Deformations at some points, and how they change with what the measured stress does work on.

    Points are the values of a mode's controls: (n,) where there is one, (n, c) where there are c. `moved` also takes a
    single point, of shape () or (c,), because JAX maps over them.
    """

    loaded_axes: ClassVar[int] = 1
    """Number of axes that carry the measured stress (work per step = loaded_axes * stress)."""

    @abstractmethod
    def moved(self, point: Any, step: Any) -> Deformation:
        """Return the deformation a step further than at a point: plain arithmetic, differentiable."""

    def abscissa(self, points: Any) -> Any:
        """Return what the measured stress is drawn against, one number for each point."""
        return points

    def cauchy_ratio(self, points: Any) -> Any:
        """Return the Cauchy stress over the engineering stress: the stretch along the axis of the stress."""
        return self.abscissa(points)


@dataclass(frozen=True)
class LoadingMode(Path):
    """A path of isochoric deformations from the identity, or one for each of several measured stresses.

    A new mode is one subclass: it names itself and says which deformation belongs to a stretch. The
    engineering stress is the derivative of the strain energy along the path, shared by the loaded axes. A mode with
    other controls, or with several stresses, names them and overrides `moved` or `channels`; one whose deformation only
    an isotropic material has overrides `moved` to say so.
    """

    name: ClassVar[str]
    description: ClassVar[str]
    controls: ClassVar[tuple[Control, ...]] = (STRETCH,)
    """What is set, in the order of the last axis of points."""
    stresses: ClassVar[tuple[str, ...]] = ("engineering stress",)
    """What is measured, in the order of `channels`."""
    machine_axes: ClassVar[tuple[str, ...]] = ()
    """What the axes of the stresses are called in the file of a biaxial machine, where the mode is of such a test."""

    @abstractmethod
    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        """Return the principal stretches at a point: plain arithmetic, differentiable."""

    def moved(self, point: Any, step: Any) -> Deformation:
        if len(self.stresses) > 1:
            raise ModelError(
                f"loading mode '{self.name}' measures {' and '.join(self.stresses)}, each along a path of its own: "
                "take one of its channels."
            )
        return Deformation.along_axes(self.principal_stretches(point + step))

    @property
    def channels(self) -> tuple[Path, ...]:
        """One path for each measured stress, along what that stress does work on; here there is one stress."""
        return (self,)

    @property
    def is_curve(self) -> bool:
        """Whether it is one stress against one stretch."""
        return self.controls == (STRETCH,) and len(self.stresses) == 1

    @property
    def reference(self) -> Any:
        """The point at which nothing is deformed: a number, or (c,) of several controls."""
        return self.excursion(0.0)

    def excursion(self, change: ArrayLike) -> NDArray[np.float64]:
        """Return points on a line through the reference: the first control changes so much, every further one less."""
        rates = 1 / np.arange(1.0, 1 + len(self.controls))
        points = np.array([each.reference for each in self.controls]) + np.multiply.outer(change, rates)
        return np.asarray(points if len(self.controls) > 1 else points[..., 0])


def loading_modes() -> dict[str, type[LoadingMode]]:
    """Return every loading mode by name."""
    return variants(LoadingMode)


def loading_mode(mode: str | LoadingMode) -> LoadingMode:
    """Return the loading mode of that name; a mode is returned as it is.

    Raises
    ------
    ModelError
        When no mode has that name.
    """
    return mode if isinstance(mode, LoadingMode) else find(LoadingMode, "loading mode", mode, ModelError)()
