"""The invariants of states of deformation and how they change along paths, without differentiating an energy."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode, States

__all__ = ["farthest_stretch", "invariant_rates", "invariants", "largest_invariants"]

FloatArray = NDArray[np.float64]

LARGEST_STRETCH = 10.0
"""Stretch, or one over it, beyond which no range is followed."""


def invariants(states: States) -> tuple[FloatArray, FloatArray]:
    """Return I1 - 3 and I2 - 3, (n,) each; their digits near the reference are kept."""
    logs, _ = states.log_stretches
    return np.expm1(2 * logs).sum(axis=1), np.expm1(-2 * logs).sum(axis=1)


def invariant_rates(states: States) -> tuple[FloatArray, FloatArray]:
    """Return the engineering stresses (n,) of the energies I1 and I2."""
    logs, rates = states.log_stretches
    return (2 * np.exp(2 * logs) * rates).sum(axis=1), (-2 * np.exp(-2 * logs) * rates).sum(axis=1)


def largest_invariants(states: States) -> tuple[float, float]:
    """Return the largest I1 - 3 and I2 - 3 of states."""
    I1, I2 = invariants(states)
    return float(I1.max()), float(I2.max())


@lru_cache(maxsize=256)
def farthest_stretch(mode: LoadingMode, limits: tuple[float, float], sign: int) -> float:
    """Return the stretch of a mode, above (sign 1) or below (-1) its rest, where I1 - 3 or I2 - 3 reaches its limit."""
    (control,) = mode.controls
    farthest = LARGEST_STRETCH - 1
    low, high = 0.0, farthest if sign > 0 else min(farthest, control.reference - control.above)
    for _ in range(60):
        middle = 0.5 * (low + high)
        reached = largest_invariants(mode.paths[0].at(mode.excursion([sign * middle])))  # the same on every path
        is_inside = all(value <= limit for value, limit in zip(reached, limits, strict=True))
        low, high = (middle, high) if is_inside else (low, middle)
    return float(mode.excursion(sign * low))
