"""A measured curve without its noise: a smoothing spline, and how far the measurements scatter about a smooth curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Smoothed", "scatter", "smoothed"]

FloatArray = NDArray[np.float64]

SMOOTHED = 2000
"""Places at most between which a curve is smoothed."""
FEWEST = 5
"""Different places from which there is a spline."""
ORDER = 3
"""Of the differences that tell the scatter: they are zero for a parabola."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Stress and its slope (n,) along a smooth curve, at every measurement."""

    stress: FloatArray
    slope: FloatArray


def smoothed(place: FloatArray, stress: FloatArray) -> Smoothed:
    """Return a smoothing spline through stresses (n,) at places (n,), or with few places the means and their slope.

    Generalised cross-validation chooses how smooth (SciPy).
    """
    at, mean, count, which = _averaged(place, stress)
    if len(at) < FEWEST:
        slope = np.gradient(mean, at) if len(at) > 1 else np.zeros(1)
        return Smoothed(mean[which], slope[which])
    from scipy.interpolate import make_smoothing_spline

    spline = make_smoothing_spline(at, mean, w=count)
    return Smoothed(np.asarray(spline(place)), np.asarray(spline.derivative()(place)))


def scatter(place: FloatArray, stress: FloatArray) -> float | None:
    """Return the standard deviation of single measurements about a smooth curve; None where there are too few.

    From third divided differences, scaled to the variance of a measurement: what is left of noise, next to nothing of a
    smooth curve (Gasser, Sroka & Jennen-Steinmetz 1986, there with second differences).
    """
    at, mean, count, _ = _averaged(place, stress)
    if len(at) <= 2 * ORDER:
        return None
    windows = np.lib.stride_tricks.sliding_window_view
    around = windows(at, ORDER + 1)
    apart = around[:, :, None] - around[:, None, :] + np.eye(ORDER + 1)
    weights = 1 / apart.prod(axis=2)
    size = np.sqrt((weights**2 / windows(count, ORDER + 1)).sum(axis=1))
    differences = (weights * windows(mean, ORDER + 1)).sum(axis=1) / size
    return float(np.sqrt((differences**2).mean()))


def _averaged(place: FloatArray, stress: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.intp]]:
    """Return different places, mean stresses and numbers of measurements there, and whose place each one has."""
    at, which, count = np.unique(place, return_inverse=True, return_counts=True)
    if len(at) > SMOOTHED:
        edges = np.linspace(at[0], at[-1], SMOOTHED + 1)[1:-1]
        _, which, count = np.unique(np.searchsorted(edges, place), return_inverse=True, return_counts=True)
        at = np.bincount(which, place) / count
    return at, np.bincount(which, stress) / count, count.astype(np.float64), which
