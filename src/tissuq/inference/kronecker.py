"""Evenly spread points of the unit cube: Kronecker sequences of the generalised golden ratio."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["SHIFTS", "even_points", "quasi_random"]

FloatArray = NDArray[np.float64]

SHIFTS = 8
"""Shifted copies of the quasi-random points, whose spread tells the error (more, where few points count)."""


def even_points(dimension: int, count: int) -> FloatArray:
    """Return evenly spread points (count, d) of the unit cube; every k-th of them are, too."""
    if dimension == 1:
        return (np.arange(count)[:, None] + 0.5) / count
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] * _steps(dimension)) % 1.0)


@lru_cache
def quasi_random(dimension: int, number: int) -> FloatArray:
    """Return points (number, d) of the unit cube, shifted copy by shifted copy.

    The tent map makes any integrand periodic, which lets the error fall faster than one over the number of points.
    """
    shifts = np.random.default_rng(0).random((SHIFTS, 1, dimension))
    lattice = shifts + np.arange(1, -(-number // SHIFTS) + 1)[:, None] * _steps(dimension)
    return np.asarray(np.abs(2 * (lattice % 1.0) - 1)).reshape(-1, dimension)[:number]


def _steps(dimension: int) -> FloatArray:
    """Return the steps (d,) along each side: powers of one over the root of r^(d + 1) = r + 1."""
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimension + 1))
    return np.asarray(ratio ** -np.arange(1.0, dimension + 1))
