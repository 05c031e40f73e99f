"""A round bar between two clamps is pulled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.case import AXIAL, RADIAL, Case, Mesh, Supports, length
from tissuq.finite_elements.grading import graded, grid

__all__ = ["ClampedBar"]

FloatArray = NDArray[np.float64]

SMALLEST, GROWTH = 0.04, 1.4
"""Of the cells at the clamp's rim with fineness 1: their size in radii, and how much larger each next one is."""


@dataclass(frozen=True)
class ClampedBar(Case):
    """Tension of a round bar, both ends glued to rigid plates, so that it necks in; half of it, by symmetry.

    Attributes
    ----------
    elongation, bar_length, bar_radius : float
        In mm, of the whole bar.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "bar"
    description: ClassVar[str] = "a round bar glued to two plates, in tension"
    travel_name: ClassVar[str] = "elongation"

    elongation: float = length(1.5, "How much longer the bar becomes.")
    bar_length: float = length(10.0, "Length of the bar between the plates.")
    bar_radius: float = length(2.5, "Radius of the bar.")
    fineness: float = 1.0

    @property
    def travel(self) -> float:
        return self.elongation

    def mesh(self) -> Mesh:
        smallest, growth = self.bar_radius * SMALLEST / self.fineness, GROWTH ** (1 / self.fineness)
        half = self.bar_length / 2
        axial, radial = (
            half - graded(half, smallest, growth)[::-1],
            self.bar_radius - graded(self.bar_radius, smallest, growth)[::-1],
        )
        return grid(axial, radial)

    def supports(self, points: FloatArray) -> Supports:
        axial, radial = points[:, AXIAL], points[:, RADIAL]
        near = 1e-9 * self.bar_length
        middle, clamp = axial < near, axial > self.bar_length / 2 - near
        return Supports(np.stack([middle, clamp | (radial < near)], axis=-1), clamp, 0.5)
