"""Contact of points of a body with a smooth rigid tip, a plane or a sphere, by a penalty on how deep they are in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.case import AXIAL, Mesh, RigidTip, Supports

__all__ = ["Contact", "Touch"]

FloatArray = NDArray[np.float64]

STIFFNESS = 1000.0
"""Pressure in initial shear moduli at a depth of as much as the size of a cell."""


@dataclass(frozen=True, eq=False)
class Touch:
    """What a tip does to the points at one place: stresses are in initial shear moduli.

    Attributes
    ----------
    residual : (d n,) array
        The derivative of the energy of the penalty by the displacements.
    stiffness : (d n, d n) sparse array
        The second derivative.
    residual_rate : (d n,) array
        The derivative of ``residual`` by the travel of the tip.
    force : float
        The derivative of the energy by the travel: the force on the tip.
    """

    residual: FloatArray
    stiffness: Any
    residual_rate: FloatArray
    force: float


@dataclass(frozen=True, eq=False)
class Contact:
    """A tip that is pressed against points, (n, d), of stiffness (n,) each, zero for those that cannot touch it."""

    tip: RigidTip
    points: FloatArray
    direction: float
    stiffness: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, supports: Supports, volumes: FloatArray) -> Contact:
        """Return the contact of a mesh whose points of quadrature have volumes (q, c), mm^3.

        The stiffness of a point is that of a layer of the thickness of its cells, over its share of their volume.
        """
        tip = supports.tip
        assert tip is not None  # noqa: S101
        dimensions = mesh.points.shape[1]
        corners = mesh.points[mesh.cells]
        sizes = np.prod(np.ptp(corners, axis=1), axis=1) ** (1 / dimensions)
        shares = volumes.sum(axis=0) / mesh.cells.shape[1]
        stiffness = np.zeros(len(mesh.points))
        np.add.at(stiffness, mesh.cells, (STIFFNESS * shares / sizes**2)[:, None])
        return cls(tip, mesh.points, supports.direction, np.where(tip.points, stiffness, 0.0))

    def at(self, u: FloatArray, travel: float) -> Touch:
        """Return what the tip does at a travel to points with displacements (n, d)."""
        from scipy.sparse import bsr_array

        count, dimensions = u.shape
        axis = np.zeros(dimensions)
        axis[AXIAL] = self.direction
        apart = self.points + u
        apart[:, AXIAL] -= self.tip.start + self.direction * travel
        if np.isinf(self.tip.radius):
            depth, normal, curvature = -apart @ axis, np.broadcast_to(axis, u.shape), np.zeros(count)
        else:
            apart = apart + self.tip.radius * axis
            distance = np.linalg.norm(apart, axis=1)
            depth, normal, curvature = self.tip.radius - distance, apart / distance[:, None], 1 / distance
        pressed = np.where(depth > 0, self.stiffness, 0.0)
        push = pressed * depth
        squares = normal[:, :, None] * normal[:, None, :]
        across = (push * curvature)[:, None, None] * (np.eye(dimensions) - squares)
        blocks = pressed[:, None, None] * squares - across
        stiffness = bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=2 * (dimensions * count,))
        return Touch(
            -(push[:, None] * normal).ravel(),
            stiffness.tocsr(),
            -(blocks @ axis).ravel(),
            float(push @ (normal @ axis)),
        )
