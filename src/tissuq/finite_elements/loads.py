"""Loads on a body: a smooth rigid tip, by a penalty on how deep points are in it, and a pressure that follows it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.finite_elements.case import AXIAL, Inflation, Mesh, RigidTip, Supports, felupe

MPA_OF_KPA = 1e-3
STIFFNESS = 1000.0
"""Pressure in initial shear moduli at a depth of as much as the size of a cell."""


@dataclass(frozen=True, eq=False)
class Action:
    """What a load does to the points: stresses are in initial shear moduli.

    Attributes
    ----------
    residual : (d n,) array
        The forces against it, the derivative of its energy by the displacements.
    stiffness : callable
        Gives their derivative, a sparse (d n, d n) array, which is not needed wherever the forces are.
    residual_rate : (d n,) array
        Their derivative by the travel.
    response : float
        Of a tip the force on it, the derivative of the energy by the travel; of a pressure the displacement, mm.
    """

    residual: FloatArray
    stiffness: Callable[[], Any]
    residual_rate: FloatArray
    response: float


class Load(ABC):
    """Something that acts on a body, more so the longer the travel."""

    @abstractmethod
    def at(self, u: FloatArray, travel: float) -> Action:
        """Return what it does at a travel to points with displacements (n, d)."""


@dataclass(frozen=True, eq=False)
class Contact(Load):
    """A tip that is pressed against points, (n, d), of stiffness (n,) each, zero for those that cannot touch it."""

    tip: RigidTip
    points: FloatArray
    direction: float
    stiffness: FloatArray

    @classmethod
    def of(cls, tip: RigidTip, mesh: Mesh, direction: float, volumes: FloatArray) -> Contact:
        """Return the contact of a mesh whose points of quadrature have volumes (q, c), mm^3.

        The stiffness of a point is that of a layer of the thickness of its cells, over its share of their volume.
        """
        dimensions = mesh.points.shape[1]
        corners = mesh.points[mesh.cells]
        sizes = np.prod(np.ptp(corners, axis=1), axis=1) ** (1 / dimensions)
        shares = volumes.sum(axis=0) / mesh.cells.shape[1]
        stiffness = np.zeros(len(mesh.points))
        np.add.at(stiffness, mesh.cells, (STIFFNESS * shares / sizes**2)[:, None])
        return cls(tip, mesh.points, direction, np.where(tip.points, stiffness, 0.0))

    def at(self, u: FloatArray, travel: float) -> Action:
        count, dimensions = u.shape
        axis = np.zeros(dimensions)
        axis[AXIAL] = self.direction
        offset = self.points + u
        offset[:, AXIAL] -= self.tip.start + self.direction * travel
        if np.isinf(self.tip.radius):
            depth, normal, curvature = -offset @ axis, np.broadcast_to(axis, u.shape), np.zeros(count)
        else:
            offset = offset + self.tip.radius * axis
            distance = np.linalg.norm(offset, axis=1)
            depth, normal, curvature = self.tip.radius - distance, offset / distance[:, None], 1 / distance
        pressed = np.where(depth > 0, self.stiffness, 0.0)
        push = pressed * depth
        squares = normal[:, :, None] * normal[:, None, :]
        across = (push * curvature)[:, None, None] * (np.eye(dimensions) - squares)
        blocks = pressed[:, None, None] * squares - across
        return Action(
            -(push[:, None] * normal).ravel(),
            partial(_block_diagonal, blocks),
            -(blocks @ axis).ravel(),
            float(push @ (normal @ axis)),
        )


class Pressure(Load):
    """A pressure on faces, in kPa, that follows them as they turn and grow.

    Parameters
    ----------
    inflation : Inflation
    mesh : Mesh
    modulus : float
        Initial shear modulus, MPa.

    Raises
    ------
    InputError
        When no face of the surface has all of its points among those under pressure.
    """

    def __init__(self, inflation: Inflation, mesh: Mesh, modulus: float) -> None:
        try:
            region = mesh.region("Boundary", mask=inflation.points, ensure_3d=not mesh.is_solid)
            empty = not len(region.mesh.cells)
        except (ValueError, IndexError):  # FElupe's region of no face
            empty = True
        if empty:
            raise InputError("no face of the surface has all of its points in the set that is under pressure.")
        self._inflation, self._unit = inflation, MPA_OF_KPA / modulus
        self._field = felupe().FieldContainer([mesh.field_on(region)])
        self._body = felupe().SolidBodyPressure(self._field)

    def at(self, u: FloatArray, travel: float) -> Action:
        self._field[0].values[:] = u
        rate = -self._body.assemble.vector(self._field, pressure=1.0).toarray().ravel() * self._unit
        response = float(u[self._inflation.watched, self._inflation.column].mean())
        return Action(travel * rate, partial(self._stiffness, u, travel), rate, response)

    def _stiffness(self, u: FloatArray, travel: float) -> Any:
        self._field[0].values[:] = u
        return (-travel * self._unit * self._body.assemble.matrix(self._field, pressure=1.0)).tocsr()


def _block_diagonal(blocks: FloatArray) -> Any:
    """Return a sparse array with blocks (n, d, d) on its diagonal."""
    from scipy.sparse import bsr_array

    count, size = blocks.shape[:2]
    return bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=2 * (size * count,)).tocsr()


def load_on(mesh: Mesh, supports: Supports, volumes: FloatArray, modulus: float) -> Load | None:
    """Return the load of a body, if there is one, whose points of quadrature have volumes (q, c), mm^3."""
    if isinstance(supports.load, RigidTip):
        return Contact.of(supports.load, mesh, supports.direction, volumes)
    return None if supports.load is None else Pressure(supports.load, mesh, modulus)
