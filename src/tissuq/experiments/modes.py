"""Loading modes: how a specimen is deformed, as a path of deformations along what is measured."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

from tissuq.errors import ModelError
from tissuq.registry import find, variants

__all__ = ["Deformation", "Equibiaxial", "LoadingMode", "Path", "Planar", "Uniaxial", "loading_mode", "loading_modes"]


@dataclass(frozen=True)
class Deformation:
    """An isochoric deformation in the axes of the test: what a strain energy is a function of.

    Attributes
    ----------
    stretches : tuple of three arrays
        The principal stretches.
    plane : tuple of three arrays
        C11, C22 and C12 of C = F'F in the plane of the test, the first loaded axis first: what fibres there feel.
    """

    stretches: tuple[Any, Any, Any]
    plane: tuple[Any, Any, Any]

    @classmethod
    def along_axes(cls, stretches: tuple[Any, Any, Any]) -> Deformation:
        """Return the deformation whose principal axes are those of the test."""
        first, second, _ = stretches
        return cls(stretches, (first**2, second**2, 0.0))


class Path(ABC):
    """Deformations at some points, and how they change with what the measured stress does work on."""

    loaded_axes: ClassVar[int] = 1
    """Number of axes that carry the measured stress (work per step = loaded_axes * stress)."""

    @abstractmethod
    def moved(self, point: Any, step: Any) -> Deformation:
        """Return the deformation a step further than at a point: plain arithmetic, differentiable."""

    def abscissa(self, points: Any) -> Any:
        """Return what the measured stress is drawn against, one number for each point."""
        return points


@dataclass(frozen=True)
class LoadingMode(Path):
    """A path of isochoric deformations F(stretch), with F(1) the identity.

    A new mode is one subclass: it names itself and says which deformation belongs to a stretch. The
    engineering stress is the derivative of the strain energy along the path, shared by the loaded axes.
    """

    name: ClassVar[str]
    description: ClassVar[str]

    @abstractmethod
    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        """Return the diagonal of F for a stretch (dimensionless): plain arithmetic, differentiable."""

    def moved(self, point: Any, step: Any) -> Deformation:
        return Deformation.along_axes(self.principal_stretches(point + step))

    @property
    def channels(self) -> tuple[Path, ...]:
        """One path for each measured stress, along what that stress does work on; here there is one stress."""
        return (self,)


class Uniaxial(LoadingMode):
    """Tension or compression along one axis: F = diag(l, l^-1/2, l^-1/2)."""

    name = "uniaxial"
    description = "tension or compression along one axis"

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        lateral = stretch**-0.5
        return stretch, lateral, lateral


class Equibiaxial(LoadingMode):
    """Equal stretch along two axes: F = diag(l, l, l^-2)."""

    name = "equibiaxial"
    description = "equal tension along two axes"
    loaded_axes = 2

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        return stretch, stretch, stretch**-2


class Planar(LoadingMode):
    """Planar tension (pure shear): F = diag(l, 1, 1/l)."""

    name = "planar"
    description = "planar tension (pure shear), one lateral axis held"

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        return stretch, 1.0, 1.0 / stretch


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
