"""A measured curve without its noise: a smoothing spline, and how far the measurements scatter about a smooth curve."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import FloatArray, IndexArray

MAX_KNOTS = 2000
"""Number of different stretches at most between which a curve is smoothed."""
MIN_KNOTS = 5
"""Number of different stretches from which there is a spline."""
ORDER = 3
"""Order of the differences that show the scatter: they are zero for a parabola."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Stress and its slope (n,) along a smooth curve, at every measurement."""

    stress: FloatArray
    slope: FloatArray


def smoothed(abscissa: FloatArray, stress: FloatArray) -> Smoothed:
    """Return a smoothing spline through stresses (n,) at abscissas (n,), or with few of them the means and their slope.

    Generalised cross-validation chooses how smooth (SciPy); where it cannot, as of abscissas that hardly differ, they
    are as few.
    """
    knots, mean, count, group = _averaged(abscissa, stress)
    if len(knots) >= MIN_KNOTS:
        from scipy.interpolate import make_smoothing_spline

        with suppress(ValueError):
            spline = make_smoothing_spline(knots, mean, w=count)
            return Smoothed(np.asarray(spline(abscissa)), np.asarray(spline.derivative()(abscissa)))
    slope = np.gradient(mean, knots) if len(knots) > 1 else np.zeros(1)
    return Smoothed(mean[group], slope[group])


def scatter(abscissa: FloatArray, stress: FloatArray) -> float | None:
    """Return the standard deviation of single measurements about a smooth curve; None where there are too few.

    From third divided differences, scaled to the variance of a measurement: what is left of noise, next to nothing of a
    smooth curve (Gasser, Sroka & Jennen-Steinmetz 1986, there with second differences).
    """
    knots, mean, count, _ = _averaged(abscissa, stress)
    if len(knots) <= 2 * ORDER:
        return None
    windows = np.lib.stride_tricks.sliding_window_view
    neighbours = windows(knots, ORDER + 1)
    distances = neighbours[:, :, None] - neighbours[:, None, :] + np.eye(ORDER + 1)
    weights = 1 / distances.prod(axis=2)
    size = np.sqrt((weights**2 / windows(count, ORDER + 1)).sum(axis=1))
    differences = (weights * windows(mean, ORDER + 1)).sum(axis=1) / size
    return float(np.sqrt((differences**2).mean()))


def _averaged(abscissa: FloatArray, stress: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, IndexArray]:
    """Return different abscissas, mean stresses and numbers of measurements there, and at which of them each one is."""
    knots, group, count = np.unique(abscissa, return_inverse=True, return_counts=True)
    if len(knots) > MAX_KNOTS:
        edges = np.linspace(knots[0], knots[-1], MAX_KNOTS + 1)[1:-1]
        _, group, count = np.unique(np.searchsorted(edges, abscissa), return_inverse=True, return_counts=True)
        knots = np.bincount(group, abscissa) / count
    return knots, np.bincount(group, stress) / count, count.astype(np.float64), group
