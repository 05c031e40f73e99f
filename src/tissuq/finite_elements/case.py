"""What a worked case of finite elements is: a body of revolution, its mesh, what holds it and what moves it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from math import inf
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.registry import variants

__all__ = ["AXIAL", "RADIAL", "Case", "Mesh", "Supports", "cases", "length"]

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

    A new case is one subclass in one file: its sizes as fields, a mesh, and its supports. It then is in the command
    line, the Python interface and the report. All lengths are in mm and positive, forces in N.
    """

    name: ClassVar[str]
    description: ClassVar[str]
    travel_name: ClassVar[str]
    """What the travel is called: a depth, an elongation."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, bool) and not 0 < value < inf:
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


def length(default: float, help: str) -> float:
    """Return the field of a length in mm; ``help`` says which one."""
    from dataclasses import field

    found: float = field(default=default, metadata={"help": help, "unit": "mm"})
    return found


def cases() -> dict[str, type[Case]]:
    """Return every case by name."""
    return variants(Case)
