"""The case of an indentation by a sphere: its area of contact grows with the depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tissuq.errors import InputError
from tissuq.finite_elements.case import ACROSS, AXIAL, Case, FloatArray, Mesh, RigidTip, Supports, graded, grid

__all__ = ["SphericalIndentation"]

CELL, GROWTH = 0.06, 1.3
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
        smallest_cell, growth = cut * CELL / self.fineness, GROWTH ** (1 / self.fineness)
        inside = np.linspace(0, cut, round(self.fineness / CELL) + 1)
        radial = np.concatenate([inside, cut + graded(self.radius - cut, smallest_cell, growth)[1:]])
        return grid(self.height - graded(self.height, smallest_cell, growth)[::-1], radial)

    def supports(self, points: FloatArray) -> Supports:
        axial, radial = points[:, AXIAL], points[:, ACROSS]
        tolerance = 1e-9 * self.radius
        base = axial < tolerance
        surface = (axial > self.height - tolerance) & (radial < self.tip_radius)
        fixed = np.stack([base, base | (radial < tolerance)], axis=-1)
        tip = RigidTip(surface, self.height, self.tip_radius)
        return Supports(fixed, np.zeros(len(points), dtype=bool), -1.0, load=tip)
