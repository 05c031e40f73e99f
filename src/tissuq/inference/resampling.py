"""Systematic resampling: few of many weighted points that stand for all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["resampled_at_random", "systematic"]

FloatArray = NDArray[np.float64]


def systematic(weights: FloatArray, count: int, offset: float | FloatArray = 0.5) -> NDArray[np.intp]:
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


def resampled_at_random(log_weights: FloatArray, generator: np.random.Generator) -> NDArray[np.intp]:
    """Return as many draws of R sets as these have, (R, n), from log weights (R, n) up to a constant for each set."""
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    return systematic(weights, weights.shape[1], generator.random((len(weights), 1)))
