"""The standard normal distribution between two bounds, right to full digits in both tails."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["interval_quantile", "log_interval"]

FloatArray = NDArray[np.float64]


def log_interval(low: Any, high: Any) -> FloatArray:
    """Return log(Phi(high) - Phi(low))."""
    _, lower, upper = _mirrored(low, high)
    with np.errstate(divide="ignore"):
        return np.asarray(upper + np.log(-np.expm1(lower - upper)))


def interval_quantile(probability: Any, low: Any, high: Any) -> FloatArray:
    """Return the value between two bounds below which a share ``probability`` of what they enclose lies."""
    from scipy.special import ndtri_exp

    is_mirrored, lower, _ = _mirrored(low, high)
    position = np.where(is_mirrored, 1 - np.asarray(probability), probability)
    with np.errstate(divide="ignore"):
        value = ndtri_exp(np.logaddexp(lower, np.log(position) + log_interval(low, high)))
    return np.asarray(np.clip(np.where(is_mirrored, -value, value), low, high))


def _mirrored(low: Any, high: Any) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Return whether the interval is taken on the other side of zero, and log Phi at its ends there."""
    from scipy.special import log_ndtr

    is_mirrored = np.asarray(low) > 0
    start, end = np.where(is_mirrored, -np.asarray(high), low), np.where(is_mirrored, -np.asarray(low), high)
    return is_mirrored, log_ndtr(start), log_ndtr(end)
