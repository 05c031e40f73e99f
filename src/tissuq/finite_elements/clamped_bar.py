"""A round bar between two clamps is pulled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.case import AXIAL, RADIAL, Case, Mesh, Supports, graded, grid

__all__ = ["ClampedBar"]

FloatArray = NDArray[np.float64]

SMALLEST_CELL, GROWTH = 0.04, 1.4
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

    @property
    def travel(self) -> float:
        return self.elongation

    def mesh(self) -> Mesh:
        smallest_cell, growth = self.bar_radius * SMALLEST_CELL / self.fineness, GROWTH ** (1 / self.fineness)
        half = self.bar_length / 2
        axial, radial = (
            half - graded(half, smallest_cell, growth)[::-1],
            self.bar_radius - graded(self.bar_radius, smallest_cell, growth)[::-1],
        )
        return grid(axial, radial)

    def supports(self, points: FloatArray) -> Supports:
        axial, radial = points[:, AXIAL], points[:, RADIAL]
        tolerance = 1e-9 * self.bar_length
        middle, clamp = axial < tolerance, axial > self.bar_length / 2 - tolerance
        return Supports(np.stack([middle, clamp | (radial < tolerance)], axis=-1), clamp, 0.5)
