"""Bounds of the linear parameters: which components of a posterior they cut, and what is left of those."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.box import NEGLIGIBLE, POINTS, Box
from tissuq.inference.solution import Components

__all__ = ["resampled", "split_at_bounds"]

FloatArray = NDArray[np.float64]

RESAMPLED = 4000
REPRESENTED = 200
"""Components, at most, that are represented by points."""
ALL_POINTS = 50_000
"""Points, at least, that represent all of them together."""


def split_at_bounds(components: Components, outside: FloatArray, box: Box) -> tuple[Components, Components]:
    """Return the components that stay Gaussian, and weighted points within the bounds for those that are cut.

    The Gaussian ones together have less than 1e-8 of the posterior outside the bounds.
    """
    loss = components.weights * outside
    order = np.argsort(loss)
    is_cut = np.zeros(len(loss), dtype=bool)
    is_cut[order[np.cumsum(loss[order]) > NEGLIGIBLE]] = True
    cut = components[is_cut]
    return components[~is_cut], _points_within(cut, box) if len(cut.weights) else cut


def resampled(points: Components) -> Components:
    """Return at most 4000 of the points, equally weighted, that stand for all of them (systematic resampling)."""
    if len(points.weights) <= RESAMPLED:
        return points
    total = points.weights.sum()
    targets = (np.arange(RESAMPLED) + 0.5) * total / RESAMPLED
    chosen = points[np.minimum(np.searchsorted(np.cumsum(points.weights), targets), len(points.weights) - 1)]
    return Components(np.full(RESAMPLED, total / RESAMPLED), chosen.settings, chosen.mean, chosen.root)


def _points_within(components: Components, box: Box) -> Components:
    few = components.thinned(REPRESENTED)
    log_shares, points = box.points(few.mean, few.root, max(POINTS, ALL_POINTS // len(few.weights)))
    shares = np.exp(log_shares - log_shares.max(axis=1, keepdims=True))
    weights = (few.weights[:, None] * shares / shares.sum(axis=1, keepdims=True)).ravel()
    kept = weights > 1e-12 * weights.max()
    p = points.shape[2]
    settings = np.repeat(few.settings, points.shape[1], axis=0)[kept]
    weights = weights[kept] * (components.weights.sum() / weights[kept].sum())
    return Components(weights, settings, points.reshape(-1, p)[kept], np.zeros((len(weights), p, p)))
