"""Whether a posterior has mass where the quadrature did not look: ridges that a survey's lattice steps over."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTILES", "has_missed"]

FloatArray = NDArray[np.float64]

QUANTILES = np.array([0.15, 0.5, 0.85])
"""Of the priors, from which climbs start."""
MAX_EVALUATIONS = 300
"""Evaluations that a climb may take."""
MASS_THAT_COUNTS, MOST_GAINED = 3.0, 5.0
"""Log density below the quadrature's best point from which a place outside its range has mass that counts, and above
it that no place may have."""
HEAVIEST = 500
"""Points, the heaviest, among which the best one is."""
LEAST_WEIGHT = 1e-6
"""Weight of a point that is in no range."""


def has_missed(
    log_density: Callable[[FloatArray], FloatArray],
    bounds: FloatArray,
    points: FloatArray,
    weights: FloatArray,
    starts: FloatArray,
) -> bool:
    """Return whether climbs end where the points of a quadrature have no weight.

    Parameters
    ----------
    log_density : callable
        Of places (N, d).
    bounds : (d, 2) array
        Of the places, infinite where there is none.
    points : (M, d) array
        Of the quadrature.
    weights : (M,) array
        Their shares of the mass.
    starts : (s, k) array
        Values of the first s coordinates from which to climb; the others start at the best point.
    """
    from scipy.optimize import minimize

    heaviest = points[np.argsort(weights)[-HEAVIEST:]]
    heights = log_density(heaviest)
    best, best_height = heaviest[heights.argmax()], float(heights.max())
    heavy, sd = points[weights > LEAST_WEIGHT], np.sqrt(weights @ (points - weights @ points) ** 2)
    low, high = heavy.min(axis=0) - sd, heavy.max(axis=0) + sd
    for structure_start in [best[: len(starts)], *product(*starts)]:
        start = np.concatenate([structure_start, best[len(starts) :]])
        climb = minimize(
            _depth, start, (log_density,), "Nelder-Mead", bounds=bounds, options={"maxfev": MAX_EVALUATIONS}
        )
        gained, is_outside = -float(climb.fun) - best_height, bool(((climb.x < low) | (climb.x > high)).any())
        if gained > MOST_GAINED or (is_outside and gained > -MASS_THAT_COUNTS):
            return True
    return False


def _depth(point: FloatArray, log_density: Callable[[FloatArray], FloatArray]) -> float:
    return -float(log_density(point[None])[0])
