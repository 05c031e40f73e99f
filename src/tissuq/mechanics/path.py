"""How the principal stretches change along a loading mode, without differentiating an energy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.experiments.modes import LoadingMode, Path

__all__ = ["STEP", "farthest_stretch", "invariant_rates", "invariants", "log_stretches"]

FloatArray = NDArray[np.float64]

STEP = 1e-30
"""Imaginary step: the derivative is the imaginary part over it, without subtraction and so without loss of digits."""
LARGEST = 10.0
"""Stretch, or one over it, beyond which no range is followed."""


def log_stretches(mode: Path, stretch: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the logarithms (n, 3) of the principal stretches and their rates (n, 3) along a mode.

    Divided by the number of loaded axes, so that the engineering stress of a separable energy
    w(l1) + w(l2) + w(l3) is sum_k l_k w'(l_k) rate_k.
    """
    points = np.asarray(stretch, dtype=np.float64)
    principal = mode.moved(points, 1j * STEP).stretches
    logs = np.log(np.stack([np.broadcast_to(each, len(points)).astype(complex) for each in principal], axis=-1))
    return np.asarray(logs.real), np.asarray(logs.imag / STEP / mode.loaded_axes)


def invariants(mode: Path, stretch: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return I1 - 3 and I2 - 3, (n,) each; their digits near the reference are kept."""
    logs, _ = log_stretches(mode, stretch)
    return np.expm1(2 * logs).sum(axis=1), np.expm1(-2 * logs).sum(axis=1)


def invariant_rates(mode: Path, stretch: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the engineering stresses (n,) of the energies I1 and I2."""
    logs, rates = log_stretches(mode, stretch)
    return (2 * np.exp(2 * logs) * rates).sum(axis=1), (-2 * np.exp(-2 * logs) * rates).sum(axis=1)


def farthest_stretch(mode: LoadingMode, most: Sequence[float], sign: int) -> float:
    """Return the stretch of a mode, above (sign 1) or below (-1) its rest, where I1 - 3 or I2 - 3 reaches ``most``."""
    (control,) = mode.controls
    low, high = 0.0, LARGEST - 1 if sign > 0 else min(LARGEST - 1, control.reference - control.above)
    for _ in range(60):
        middle = 0.5 * (low + high)
        reached = invariants(mode.channels[0], mode.excursion([sign * middle]))  # the same along every channel
        is_inside = all(each[0] <= limit for each, limit in zip(reached, most, strict=True))
        low, high = (middle, high) if is_inside else (low, middle)
    return float(mode.excursion(sign * low))
