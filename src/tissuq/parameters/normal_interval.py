"""The standard normal distribution between two bounds, right to full digits in both tails."""

from __future__ import annotations

from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray

ALMOST_NOTHING, ALMOST_ALL = -20.0, 8.5
"""Scores below which the quick Phi soon underflows, and from which it is one in double precision."""


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


def _mirrored(low: Any, high: Any) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Return whether the interval is taken on the other side of zero, and log Phi at its ends there."""
    is_mirrored = np.asarray(low) > 0
    start, end = np.where(is_mirrored, -np.asarray(high), low), np.where(is_mirrored, -np.asarray(low), high)
    return is_mirrored, _log_phi(start), _log_phi(end)


def _log_difference(lower: FloatArray, upper: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.asarray(upper + np.log(-np.expm1(lower - upper)))


def _log_phi(score: FloatArray) -> FloatArray:
    """Return log Phi, zero where it rounds to that; the slow function only where the quick one underflows."""
    from scipy.special import log_ndtr, ndtr

    score = np.asarray(score, dtype=np.float64)
    value = np.zeros(score.shape)
    matters, is_far = ~(score >= ALMOST_ALL), score < ALMOST_NOTHING  # what is no number stays none
    value[matters] = np.log(ndtr(np.maximum(score[matters], ALMOST_NOTHING)))
    value[is_far] = log_ndtr(score[is_far])
    return value
