"""Paths of deformations, what measured stresses work along, and the states on them at which stresses are asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import FloatArray, IndexArray

STEP = 1e-30
"""Imaginary step: the derivative is the imaginary part over it, without subtraction and so without loss of digits."""
TINY = 1e-300
"""Keeps the rate of an angle, or of a root at zero, a number where there is none."""
UNMEASURED = -1
"""Number of the curve of states that belong to no measured one."""


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

    @property
    def has_free_axis(self) -> bool:
        """Whether the test leaves one axis of the plane to the material, without stress along it."""
        return sum(component is None for component in self.plane[:2]) == 1

    @classmethod
    def along_axes(cls, stretches: tuple[Any, Any, Any]) -> Deformation:
        """Return the deformation whose principal axes are those of the test."""
        stretch_1, stretch_2, _ = stretches
        return cls(stretches, (stretch_1**2, stretch_2**2, 0.0))


class Path(ABC):
    """Deformations at some points, and how they change with what one measured stress does work on.

    Points are the values of a mode's controls: (n,) where there is one, (n, c) where there are c. `moved` also takes a
    single point, of shape () or (c,), because JAX maps over them.
    """

    loaded_axes: int = 1
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

    def at(self, points: Any, curve: int = UNMEASURED) -> States:
        """Return the states at points of this path, which are those of a measured curve where its number is given."""
        return States((self,), (np.array(points, dtype=np.float64),), (curve,))  # a copy, as what is computed is kept


@dataclass(frozen=True, eq=False)
class States:
    """States of deformation at which stresses are measured or asked for, path by path.

    States are equal where their paths, points and curves are.

    Attributes
    ----------
    paths : tuple of Path
    points : tuple of arrays
        On each path, (n,) or (n, c).
    curves : tuple of int
        The number of the measured curve that each path with its points belongs to, or `UNMEASURED`.
    """

    paths: tuple[Path, ...]
    points: tuple[Any, ...]
    curves: tuple[int, ...]

    @classmethod
    def joined(cls, states: Sequence[States]) -> States:
        """Return the states of several, one after another."""
        return cls(
            *(tuple(chain(*(getattr(group, name) for group in states))) for name in ("paths", "points", "curves"))
        )

    def __len__(self) -> int:
        return sum(self._counts)

    def __eq__(self, states: object) -> bool:
        if not isinstance(states, States) or (self.paths, self.curves) != (states.paths, states.curves):
            return False
        return all(np.array_equal(*pair) for pair in zip(self.points, states.points, strict=True))

    def __hash__(self) -> int:
        ends = tuple((points.shape, points[:1].tobytes(), points[-1:].tobytes()) for points in self.points)
        return hash((self.paths, self.curves, ends))

    @property
    def _counts(self) -> list[int]:
        return [len(points) for points in self.points]

    @property
    def curve(self) -> IndexArray:
        """The number (n,) of the curve of every state."""
        return np.repeat(self.curves, self._counts)

    @property
    def abscissa(self) -> Any:
        """What the stress at every state is drawn against, (n,)."""
        return _end_to_end([path.abscissa(points) for path, points in zip(self.paths, self.points, strict=True)])

    @property
    def loaded_axes(self) -> Any:
        """The loaded axes of every state, (n,), or the one number of all."""
        axes = [path.loaded_axes for path in self.paths]
        return axes[0] if len(set(axes)) == 1 else np.repeat(axes, self._counts)

    @property
    def is_measured(self) -> bool:
        """Whether some of them belong to a measured curve."""
        return any(curve != UNMEASURED for curve in self.curves)

    @property
    def controls(self) -> int:
        """The largest number of controls of a path."""
        return max(1 if points.ndim == 1 else points.shape[1] for points in self.points)

    def displaced(self, control: int, step: float) -> States:
        """Return the states with one control of every path that has it a step further."""
        points = (p + step * (np.arange(p.shape[-1]) == control if p.ndim > 1 else control == 0) for p in self.points)
        return States(self.paths, tuple(points), self.curves)

    def in_curve(self, number: int) -> Any:
        """Return one for every state (n,) that belongs to that curve and zero for the others; 1.0 where all do."""
        return 1.0 if self.curves == (number,) else (self.curve == number).astype(np.float64)

    def moved(self, step: Any) -> Deformation:
        """Return the deformation a step further than these states, on the path of each."""
        pairs = zip(self.paths, self.points, strict=True)
        moved = [path.moved(points, step) for path, points in pairs]
        if len(moved) == 1:
            return moved[0]
        stretches = (self._column([on_path.stretches[axis] for on_path in moved]) for axis in range(3))
        plane = (self._column([on_path.plane[component] for on_path in moved]) for component in range(3))
        return Deformation((*stretches,), (*plane,))

    def _column(self, components: list[Any]) -> Any:
        """Return a component of the deformation of every state; NaN where only others have it, None where none has."""
        if all(component is None for component in components):
            return None
        numbers = [np.nan if component is None else component for component in components]
        return np.concatenate([np.broadcast_to(*pair) for pair in zip(numbers, self._counts, strict=True)])

    @property
    def _complex_step(self) -> Deformation:
        """The deformation an imaginary step further, whose imaginary part over the step is its rate."""
        return self.moved(1j * STEP)

    def _with_rates(self, moved: NDArray[np.complex128]) -> tuple[FloatArray, FloatArray]:
        """Return what was computed an imaginary step further (n, k), and its rates, over the number of loaded axes."""
        return np.asarray(moved.real), np.asarray((moved.imag.T / STEP / self.loaded_axes).T)

    @cached_property
    def log_stretches(self) -> tuple[FloatArray, FloatArray]:
        """The logarithms (n, 3) of the principal stretches, and their rates (n, 3) along the paths.

        Divided by the number of loaded axes, so that the engineering stress of a separable energy
        w(l1) + w(l2) + w(l3) is sum_k l_k w'(l_k) rate_k.
        """
        stretches = self._complex_step.stretches
        columns = [np.broadcast_to(stretch, len(self)).astype(complex) for stretch in stretches]
        return self._with_rates(np.log(np.stack(columns, axis=-1)))

    @cached_property
    def axis_strains(self) -> tuple[FloatArray, FloatArray]:
        """C11 - 1 and C22 - 1 (n, 2) along the axes of the test, and their rates (n, 2) as in `log_stretches`.

        Where a mode leaves them to the material, they are those of an isotropic one.
        """
        moved = self._complex_step
        squares = [_known(*pair, len(self)) for pair in zip(moved.plane[:2], moved.stretches[:2], strict=True)]
        return self._with_rates(np.stack(squares, axis=-1) - 1)

    @cached_property
    def tilt(self) -> tuple[FloatArray, FloatArray]:
        """The angle (n,) of the first principal axis from axis 1 of the test, and its rate (n,) as in `log_stretches`.

        Both are zero where principal axes are those of the test.
        """
        moved = self._complex_step
        if moved.plane[2] is None:
            return np.zeros(len(self)), np.zeros(len(self))
        c11, c22, c12 = (_known(component, 0.0, len(self)) for component in moved.plane)
        order = np.sign(np.subtract(*(np.asarray(stretch).real for stretch in moved.stretches[:2])))
        cosine, sine = c11 - c22, 2 * c12
        angle = 0.5 * np.arctan2(order * sine.real, order * cosine.real)
        square = np.maximum(np.abs(cosine) ** 2 + np.abs(sine) ** 2, TINY)
        rate = 0.5 * (cosine.real * sine.imag - sine.real * cosine.imag) / square
        is_tilted = (c12.real != 0) | (order * cosine.real < 0)
        return np.where(is_tilted, angle, 0.0), np.where(is_tilted, rate / STEP / self.loaded_axes, 0.0)

    def by_path(self) -> Iterator[tuple[Path, Any, IndexArray]]:
        """Yield every different path with all its points, and their numbers among all states."""
        numbers = np.split(np.arange(len(self)), np.cumsum(self._counts)[:-1])
        for path in dict.fromkeys(self.paths):
            pieces = [number for number, path_of_piece in enumerate(self.paths) if path_of_piece == path]
            points = _end_to_end([self.points[number] for number in pieces])
            yield path, points, np.concatenate([numbers[number] for number in pieces])

    def thinned(self, step: int) -> States:
        """Return one of so many states of every path, from its first."""
        return States(self.paths, tuple(points[::step] for points in self.points), self.curves)

    def among(self, numbers: Sequence[int] | IndexArray) -> States:
        """Return the states of increasing numbers."""
        ends, rows = np.cumsum(self._counts), np.asarray(numbers)
        pieces = zip(self.paths, self.points, self.curves, ends, self._counts, strict=True)
        taken = [
            States((path,), (points[rows[is_here] - end + count],), (curve,))
            for path, points, curve, end, count in pieces
            if (is_here := (end - count <= rows) & (rows < end)).any()
        ]
        return self.joined(taken)


def _known(component: Any, stretch: Any, count: int) -> NDArray[np.complex128]:
    """Return a component (n,) of C, where it is not known the square of a stretch."""
    values = np.broadcast_to(np.nan if component is None else component, count).astype(complex)
    return np.where(np.isnan(values), np.square(stretch), values)


def _end_to_end(arrays: list[Any]) -> Any:
    """Return arrays of NumPy or JAX one after another."""
    return arrays[0] if len(arrays) == 1 else arrays[0].__array_namespace__().concat(arrays)
