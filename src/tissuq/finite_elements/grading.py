"""Meshes that are fine where stresses are high."""

from __future__ import annotations

from math import ceil, log

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.case import Mesh

__all__ = ["graded", "grid"]

FloatArray = NDArray[np.float64]


def graded(length: float, smallest: float, growth: float) -> FloatArray:
    """Return places from 0 to a length whose distances grow from about the smallest one, each by the same factor.

    Examples
    --------
    >>> graded(7.0, 1.0, 2.0).tolist()
    [0.0, 1.0, 3.0, 7.0]
    """
    count = max(1, ceil(log(1 + length / smallest * (growth - 1)) / log(growth) - 1e-9))
    places = (growth ** np.arange(count + 1) - 1) / (growth**count - 1)
    return np.asarray(length * places)


def grid(axial: FloatArray, radial: FloatArray) -> Mesh:
    """Return the mesh of all pairs of places along the axis and distances from it."""
    points = np.stack(np.meshgrid(axial, radial, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(len(axial), len(radial))
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return Mesh(points, np.stack([corner.ravel() for corner in corners], axis=-1))
