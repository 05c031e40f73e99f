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
    return _log_difference(lower, upper)


def interval_quantile(probability: Any, low: Any, high: Any) -> tuple[FloatArray, FloatArray]:
    """Return values between bounds, below which a share ``probability`` of the mass there lies, and its log."""
    from scipy.special import ndtri_exp

    is_mirrored, lower, upper = _mirrored(low, high)
    log_mass = _log_difference(lower, upper)
    position = np.where(is_mirrored, 1 - np.asarray(probability), probability)
    with np.errstate(divide="ignore"):
        value = ndtri_exp(np.logaddexp(lower, np.log(position) + log_mass))
    return np.asarray(np.clip(np.where(is_mirrored, -value, value), low, high)), log_mass


def _mirrored(low: Any, high: Any) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Return whether the interval is taken on the other side of zero, and log Phi at its ends there."""
    is_mirrored = np.asarray(low) > 0
    start, end = np.where(is_mirrored, -np.asarray(high), low), np.where(is_mirrored, -np.asarray(low), high)
    return is_mirrored, _log_phi(start), _log_phi(end)


def _log_difference(lower: FloatArray, upper: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.asarray(upper + np.log(-np.expm1(lower - upper)))


def _log_phi(score: FloatArray) -> FloatArray:
    """Return log Phi; the slow function only where the quick one underflows."""
    from scipy.special import log_ndtr, ndtr

    with np.errstate(divide="ignore"):
        value = np.asarray(np.log(ndtr(score)))
    is_far = score < -20
    if is_far.any():
        value = np.where(is_far, log_ndtr(np.where(is_far, score, 0.0)), value)
    return value
