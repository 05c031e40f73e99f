"""The case of a plate with a hole: a solid, of which symmetry leaves an eighth."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import ClassVar

import numpy as np

from tissuq.errors import InputError
from tissuq.finite_elements.case import AXIAL, Case, FloatArray, Mesh, Supports

__all__ = ["PlateWithHole"]

CELLS, LAYERS = (10, 16), 2
"""Cells with fineness 1 from the hole to the edge, along a quarter of the hole, and through half of the thickness."""
GRADING = 1.4
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
        outward, quarter = (ceil(count * self.fineness) for count in CELLS)
        angles = np.linspace(0, np.pi / 2, quarter + quarter % 2 + 1)  # one cell ends in the plate's corner
        rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        edge = self.width / 2 * rays / rays.max(axis=1, keepdims=True)
        shares = (np.linspace(0, 1, outward + 1) ** GRADING)[:, None]
        plane = self.hole_radius * rays[:, None] * (1 - shares) + edge[:, None] * shares
        heights = np.linspace(0, self.thickness / 2, ceil(LAYERS * self.fineness) + 1)
        points = np.concatenate(np.broadcast_arrays(plane[..., None, 0:1], plane[..., None, 1:2], heights[:, None]), -1)
        number = np.arange(points.size // 3).reshape(points.shape[:-1])
        faces = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
        corners = [face[..., layer].ravel() for layer in (slice(-1), slice(1, None)) for face in faces]
        return Mesh(points.reshape(-1, 3), np.stack(corners, axis=-1))

    def supports(self, points: FloatArray) -> Supports:
        tolerance = 1e-9 * self.width
        pulled = points[:, AXIAL] > self.width / 2 - tolerance
        return Supports(points < tolerance, pulled, 0.5, parts=4.0)
