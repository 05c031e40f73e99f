"""What a worked case of finite elements is: a body of revolution, its mesh, what holds it and what moves it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from math import ceil, inf, log
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.registry import variants

__all__ = ["AXIAL", "RADIAL", "Case", "Mesh", "Supports", "cases", "graded", "grid"]

FloatArray = NDArray[np.float64]

AXIAL, RADIAL = 0, 1
"""Columns of points and displacements."""


class Mesh(NamedTuple):
    """Quadrilaterals in a half plane through the axis.

    Attributes
    ----------
    points : (n, 2) array, mm
        Along the axis, and the distance from it.
    cells : (c, 4) integer array
        Corners, in order.
    """

    points: FloatArray
    cells: NDArray[np.intp]


class Supports(NamedTuple):
    """What holds the body, and what moves it along the axis.

    Attributes
    ----------
    fixed : (n, 2) boolean array
        Displacements that stay zero.
    moved : (n,) boolean array
        Points whose displacement along the axis is given.
    direction : float
        1 or -1: along the axis or against it.
    """

    fixed: NDArray[np.bool_]
    moved: NDArray[np.bool_]
    direction: float


@dataclass(frozen=True)
class Case(ABC):
    """A body of revolution that something moves along its axis, and the force that this needs.

    A new case is one subclass in one file: its sizes as fields, a mesh, and its supports. Everything that takes a case,
    figures and report included, then takes it. All lengths are in mm and positive, forces in N.
    Where a size is called ``fineness``, twice as much of it halves all cells.
    """

    entry_point_group: ClassVar[str] = "tissuq.cases"
    name: ClassVar[str]
    description: ClassVar[str]
    travel_name: ClassVar[str]
    """What the travel is called: a depth, an elongation."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, str) and not 0 < value < inf:
                raise InputError(f"case '{self.name}': {field.name} must be a positive number, not {value!r}.")

    @property
    @abstractmethod
    def travel(self) -> float:
        """How far the moved points go, mm."""

    @abstractmethod
    def mesh(self) -> Mesh:
        """Return the mesh."""

    @abstractmethod
    def supports(self, points: FloatArray) -> Supports:
        """Return what holds the points (n, 2), and what moves them."""

    def steps(self, count: int) -> FloatArray:
        """Return travels (count,) at equal distances, the last one all of it."""
        return np.linspace(0, self.travel, count + 1)[1:]


def cases() -> dict[str, type[Case]]:
    """Return every case by name."""
    return variants(Case)


def graded(length: float, smallest_cell: float, growth: float) -> FloatArray:
    """Return places from 0 to a length whose distances grow from about the smallest one, each by the same factor.

    Examples
    --------
    >>> graded(7.0, 1.0, 2.0).tolist()
    [0.0, 1.0, 3.0, 7.0]
    """
    count = max(1, ceil(log(1 + length / smallest_cell * (growth - 1)) / log(growth) - 1e-9))
    fractions = (growth ** np.arange(count + 1) - 1) / (growth**count - 1)
    return np.asarray(length * fractions)


def grid(axial: FloatArray, radial: FloatArray) -> Mesh:
    """Return the mesh of all pairs of places along the axis and distances from it."""
    points = np.stack(np.meshgrid(axial, radial, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(len(axial), len(radial))
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return Mesh(points, np.stack([corner.ravel() for corner in corners], axis=-1))
