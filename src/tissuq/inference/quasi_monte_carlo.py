"""Sums over few points: evenly spread ones, and few that stand for many weighted ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from math import log, pi

import numpy as np

from tissuq.arrays import FloatArray, IndexArray

SHIFTS = 8
"""Shifted copies of the quasi-random points, whose spread tells the error (more, where few points count)."""
LOG_OF_NOTHING = -1e300
"""Stands for the logarithm of a weight that is zero or not a number."""


def even_points(dimension: int, count: int, points_taken: int = 0) -> FloatArray:
    """Return evenly spread points (count, d) of the unit cube; those of every slice of them are, too.

    Of a line, every k-th of them. ``points_taken`` of them, except of a line, went before.
    """
    if dimension == 1:
        return (np.arange(count)[:, None] + 0.5) / count
    return np.asarray((0.5 + (points_taken + np.arange(1, count + 1))[:, None] * _steps(dimension)) % 1.0)


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


def systematic(weights: FloatArray, count: int, offset: float | FloatArray = 0.5) -> IndexArray:
    """Return which points to take, each as often as its weight says, in ascending order: neighbours stay neighbours.

    Parameters
    ----------
    weights : (R, n) array
        Weights of the points of R sets, which need not sum to one.
    count : int
        Points to take from each set.
    offset : float or (R, 1) array
        Place of the first tick, between zero and one.

    Returns
    -------
    (R, count) array
    """
    edges = np.cumsum(weights, axis=1)
    ticks = (np.arange(count) + offset) / count * edges[:, -1:]
    indices = [np.searchsorted(edge, tick, side="right") for edge, tick in zip(edges, ticks, strict=True)]
    return np.asarray(np.minimum(indices, edges.shape[1] - 1), dtype=np.intp)


def resampled_at_random(log_weights: FloatArray, generator: np.random.Generator) -> IndexArray:
    """Return as many draws of R sets as these have, (R, n), from log weights (R, n) up to a constant for each set."""
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    return systematic(weights, weights.shape[1], generator.random((len(weights), 1)))


def sobol_rounds(dimension: int, count: int, seed: int | Sequence[int]) -> Iterator[FloatArray]:
    """Yield points (count, d) of the unit cube, those of all rounds evenly spread together, scrambled by the seed."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimension, rng=np.random.default_rng(seed))
    while True:
        yield np.clip(sequence.random(count), 1e-12, 1 - 1e-12)


def log_normal(points: FloatArray) -> FloatArray:
    """Return the log density (N,) of the standard normal at points (N, d)."""
    return np.asarray(-0.5 * (points**2).sum(axis=1) - 0.5 * points.shape[1] * log(2 * pi))


def effective(log_weights: FloatArray) -> float:
    """Return the effective number of weighted points; none where no weight is more than nothing."""
    if log_weights.max() <= LOG_OF_NOTHING:
        return 0.0
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.sum() ** 2 / (weights**2).sum())
