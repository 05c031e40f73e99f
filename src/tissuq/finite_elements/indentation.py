"""A flat rigid punch is pressed into a disc of tissue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.finite_elements.case import AXIAL, RADIAL, Case, Mesh, Supports, length
from tissuq.finite_elements.grading import graded, grid

__all__ = ["Indentation"]

FloatArray = NDArray[np.float64]

SMALLEST, GROWTH = 0.05, 1.5
"""Of the cells at the punch's edge with fineness 1: their size in punch radii, and how much larger each next one is."""


@dataclass(frozen=True)
class Indentation(Case):
    """Indentation by a flat rigid punch along the axis of a disc that is glued to a rigid base.

    The tissue under the punch is glued to it, or slides on it without friction (``is_bonded``); which points touch the
    punch does not change, and the rest of the surface is free.

    Attributes
    ----------
    depth, punch_radius, height, radius : float
        In mm. The usual ones are those of tests of brain slices: a punch 1.5 mm wide, a slice 5 mm thick.
    is_bonded : bool
        Whether the tissue sticks to the punch.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "indentation"
    description: ClassVar[str] = "a flat rigid punch in a disc of tissue on a rigid base"
    travel_name: ClassVar[str] = "depth"

    depth: float = length(0.4, "How deep the punch goes.")
    punch_radius: float = length(0.75, "Radius of the punch.")
    height: float = length(5.0, "Height of the disc.")
    radius: float = length(7.5, "Radius of the disc.")
    is_bonded: bool = True
    fineness: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.depth >= self.height or self.punch_radius >= self.radius:
            raise InputError(
                f"case '{self.name}': the depth ({self.depth:g} mm) must be less than the height ({self.height:g} mm), "
                f"and the punch radius ({self.punch_radius:g} mm) less than the radius ({self.radius:g} mm)."
            )

    @property
    def travel(self) -> float:
        return self.depth

    def mesh(self) -> Mesh:
        a, smallest, growth = (
            self.punch_radius,
            self.punch_radius * SMALLEST / self.fineness,
            GROWTH ** (1 / self.fineness),
        )
        inside, outside = graded(a, smallest, growth), graded(self.radius - a, smallest, growth)
        radial = np.concatenate([a - inside[::-1], a + outside[1:]])
        return grid(self.height - graded(self.height, smallest, growth)[::-1], radial)

    def supports(self, points: FloatArray) -> Supports:
        axial, radial = points[:, AXIAL], points[:, RADIAL]
        near = 1e-9 * self.radius
        base = axial < near
        punch = (axial > self.height - near) & (radial < self.punch_radius + near)
        fixed = np.stack([base, base | (radial < near) | (punch & self.is_bonded)], axis=-1)
        return Supports(fixed, punch, -1.0)
