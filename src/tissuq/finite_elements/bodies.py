"""The cases that come with the package: a bar and a plate with a hole in tension, a disc under a punch or a sphere."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log
from typing import ClassVar, Literal, get_args

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError
from tissuq.finite_elements.case import ACROSS, AXIAL, Case, Mesh, RigidTip, Supports

ROUNDING = 1e-9
"""Distance over the size of a body up to which a point lies on a plane."""


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


def graded_towards(length: float, smallest_cell: float, growth: float) -> FloatArray:
    """Return places from 0 to a length, towards which their distances shrink as those of `graded` grow."""
    return length - graded(length, smallest_cell, growth)[::-1]


def grid(axial: FloatArray, radial: FloatArray) -> Mesh:
    """Return the mesh of all pairs of places along the axis and distances from it."""
    points = np.stack(np.meshgrid(axial, radial, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(len(axial), len(radial))
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return Mesh(points, np.stack([corner.ravel() for corner in corners], axis=-1))


BAR_CELL, BAR_GROWTH = 0.04, 1.4
"""Size of the cells at the clamp's rim with fineness 1, in radii, and ratio of the sizes of neighbouring cells."""


@dataclass(frozen=True)
class ClampedBar(Case):
    """Tension of a round bar, both ends glued to rigid plates, so that it necks in; half of it, by symmetry.

    Attributes
    ----------
    elongation, bar_length, bar_radius : float
        Sizes of the whole bar, mm.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "bar"
    description: ClassVar[str] = "a round bar glued to two plates, in tension"
    travel_name: ClassVar[str] = "elongation"

    elongation: float = 1.0
    bar_length: float = 10.0
    bar_radius: float = 2.5
    fineness: float = 1.0

    def mesh(self) -> Mesh:
        smallest_cell, growth = self.bar_radius * BAR_CELL / self.fineness, BAR_GROWTH ** (1 / self.fineness)
        axial, radial = (
            graded_towards(length, smallest_cell, growth) for length in (self.bar_length / 2, self.bar_radius)
        )
        return grid(axial, radial)

    def supports(self, points: FloatArray) -> Supports:
        axial, radial = points[:, AXIAL], points[:, ACROSS]
        tolerance = ROUNDING * self.bar_length
        middle, clamp = axial < tolerance, axial > self.bar_length / 2 - tolerance
        return Supports(np.stack([middle, clamp | (radial < tolerance)], axis=-1), clamp, 0.5)


Contact = Literal["bonded", "frictionless"]


def _surface_and_base(points: FloatArray, height: float, radius: float) -> tuple[BoolArray, BoolArray]:
    """Return which points of a disc on its base lie on its surface (n,), and which directions of them are held (n, 2).

    The base is held, and the axis in its place.
    """
    axial, radial = points[:, AXIAL], points[:, ACROSS]
    tolerance = ROUNDING * radius
    base = axial < tolerance
    return axial > height - tolerance, np.stack([base, base | (radial < tolerance)], axis=-1)


PUNCH_CELL, PUNCH_GROWTH = 0.05, 1.3
"""Size of the cells at the punch's edge with fineness 1, in punch radii, and ratio of neighbouring cells' sizes."""


@dataclass(frozen=True)
class Indentation(Case):
    """Indentation by a flat rigid punch along the axis of a disc that is glued to a rigid base.

    The tissue under the punch sticks to it, or slides on it without friction; which points touch it does not change, so
    that without friction the punch must not go deep. The rest of the surface is free. Strains are singular at the edge,
    as under any sharp punch: a finer mesh goes less deep.

    Attributes
    ----------
    depth, punch_radius, height, radius : float
        Sizes in mm. Defaults are those of tests of brain slices: a punch 1.5 mm wide, a slice 5 mm thick.
    contact : str
        ``"bonded"`` or ``"frictionless"``.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "indentation"
    description: ClassVar[str] = "a flat rigid punch in a disc of tissue on a rigid base"
    travel_name: ClassVar[str] = "depth"

    depth: float = 0.4
    punch_radius: float = 0.75
    height: float = 5.0
    radius: float = 7.5
    contact: Contact = "bonded"
    fineness: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contact not in get_args(Contact):
            contacts = " or ".join(get_args(Contact))
            raise InputError(f"case '{self.name}': contact must be {contacts}, not {self.contact!r}.")
        if self.depth >= self.height or self.punch_radius >= self.radius:
            raise InputError(
                f"case '{self.name}': the depth ({self.depth:g} mm) must be less than the height ({self.height:g} mm), "
                f"and the punch radius ({self.punch_radius:g} mm) less than the radius ({self.radius:g} mm)."
            )

    def mesh(self) -> Mesh:
        a, smallest_cell, growth = (
            self.punch_radius,
            self.punch_radius * PUNCH_CELL / self.fineness,
            PUNCH_GROWTH ** (1 / self.fineness),
        )
        inside, outside = graded_towards(a, smallest_cell, growth), graded(self.radius - a, smallest_cell, growth)
        return grid(graded_towards(self.height, smallest_cell, growth), np.concatenate([inside, a + outside[1:]]))

    def supports(self, points: FloatArray) -> Supports:
        surface, fixed = _surface_and_base(points, self.height, self.radius)
        punch = surface & (points[:, ACROSS] < self.punch_radius + ROUNDING * self.radius)
        fixed[:, ACROSS] |= punch & (self.contact == "bonded")
        return Supports(fixed, punch, -1.0)


PLATE_CELLS, PLATE_LAYERS = (10, 16), 2
"""Cells with fineness 1 from the hole to the edge, along a quarter of the hole, and through half of the thickness."""
PLATE_GRADING = 1.4
"""Power of the fractions of the way from the hole to the edge at which cells end: they are smaller at the hole."""


@dataclass(frozen=True)
class PlateWithHole(Case):
    """Tension of a square plate with a round hole in its middle, whose pulled edges are free to contract.

    Attributes
    ----------
    elongation, width, thickness, hole_radius : float
        Sizes of the whole plate, mm.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "plate"
    description: ClassVar[str] = "a square plate with a hole, in tension"
    travel_name: ClassVar[str] = "elongation"
    mesh_order: ClassVar[int] = 2

    elongation: float = 2.0
    width: float = 20.0
    thickness: float = 2.0
    hole_radius: float = 4.0
    fineness: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2 * self.hole_radius >= self.width:
            raise InputError(
                f"case '{self.name}': the hole (radius {self.hole_radius:g} mm) must be smaller than the plate (width "
                f"{self.width:g} mm)."
            )

    def mesh(self) -> Mesh:
        outward, quarter = (ceil(count * self.fineness) for count in PLATE_CELLS)
        angles = np.linspace(0, np.pi / 2, quarter + quarter % 2 + 1)  # one cell ends in the plate's corner
        rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        edge = self.width / 2 * rays / rays.max(axis=1, keepdims=True)
        shares = (np.linspace(0, 1, outward + 1) ** PLATE_GRADING)[:, None]
        plane = self.hole_radius * rays[:, None] * (1 - shares) + edge[:, None] * shares
        heights = np.linspace(0, self.thickness / 2, ceil(PLATE_LAYERS * self.fineness) + 1)
        points = np.concatenate(np.broadcast_arrays(plane[..., None, 0:1], plane[..., None, 1:2], heights[:, None]), -1)
        number = np.arange(points.size // 3).reshape(points.shape[:-1])
        faces = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
        corners = [face[..., layer].ravel() for layer in (slice(-1), slice(1, None)) for face in faces]
        return Mesh(points.reshape(-1, 3), np.stack(corners, axis=-1))

    def supports(self, points: FloatArray) -> Supports:
        tolerance = ROUNDING * self.width
        pulled = points[:, AXIAL] > self.width / 2 - tolerance
        return Supports(points < tolerance, pulled, 0.5, parts=4.0)


SPHERE_CELL, SPHERE_GROWTH = 0.06, 1.3
"""Size of the cells under the sphere with fineness 1, in radii of the circle where it would cut the surface, and ratio
of the sizes of neighbouring cells beyond."""


@dataclass(frozen=True)
class SphericalIndentation(Case):
    """Indentation by a rigid sphere, without friction, along the axis of a disc that is glued to a rigid base.

    Attributes
    ----------
    depth, tip_radius, height, radius : float
        Sizes in mm.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "sphere"
    description: ClassVar[str] = "a rigid sphere in a disc of tissue on a rigid base"
    travel_name: ClassVar[str] = "depth"
    mesh_order: ClassVar[int] = 2

    depth: float = 0.4
    tip_radius: float = 1.5
    height: float = 5.0
    radius: float = 7.5
    fineness: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.depth >= min(self.height, self.tip_radius) or self.tip_radius >= self.radius:
            raise InputError(
                f"case '{self.name}': the depth ({self.depth:g} mm) must be less than the height ({self.height:g} mm) "
                f"and the tip's radius ({self.tip_radius:g} mm), and that less than the radius ({self.radius:g} mm)."
            )

    def mesh(self) -> Mesh:
        cut = np.sqrt(self.depth * (2 * self.tip_radius - self.depth))
        smallest_cell, growth = cut * SPHERE_CELL / self.fineness, SPHERE_GROWTH ** (1 / self.fineness)
        inside = np.linspace(0, cut, round(self.fineness / SPHERE_CELL) + 1)
        radial = np.concatenate([inside, cut + graded(self.radius - cut, smallest_cell, growth)[1:]])
        return grid(graded_towards(self.height, smallest_cell, growth), radial)

    def supports(self, points: FloatArray) -> Supports:
        surface, fixed = _surface_and_base(points, self.height, self.radius)
        tip = RigidTip(surface & (points[:, ACROSS] < self.tip_radius), self.height, self.tip_radius)
        return Supports(fixed, np.zeros(len(points), dtype=bool), -1.0, load=tip)
