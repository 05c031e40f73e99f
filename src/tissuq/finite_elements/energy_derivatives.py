"""Derivatives of isotropic energies by the principal stretches, by complex steps of NumPy's arithmetic.

Nothing is compiled for that. An energy that is no such arithmetic (written with jax.numpy) is differentiated by JAX.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["gradient", "gradient_and_hessian", "is_arithmetic"]

FloatArray = NDArray[np.float64]
IsochoricEnergy = Callable[[tuple[Any, Any, Any]], Any]
"""An energy (n,) of three principal stretches (n,) whose product is one."""

AXES = np.array([[1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]]) / np.sqrt([[2.0], [6.0]])
"""Orthonormal logarithmic strains without change of volume, along which an isochoric energy changes."""
STEP = 1e-30
"""Imaginary step: its square is nothing."""
NUDGE = 4e-6
"""Real step of logarithmic strains, in which gradients change by far more than their rounding errors."""
SAMPLE = np.log([[1.02, 1.0, 0.99], [0.97, 1.01, 1.03], [1.05, 0.98, 1.01]])
"""Stretches at which it is seen whether complex steps give derivatives."""
AGREEMENT = 1e-4
"""Largest difference to a real difference quotient, relative to the largest slope."""


def gradient(energy: IsochoricEnergy, stretches: FloatArray) -> FloatArray:
    """Return dW/dl_i (3, n) of W(J^(-1/3) l) at principal stretches (3, n), J = l1 l2 l3.

    Examples
    --------
    >>> import numpy as np
    >>> gradient(lambda l: 0.5 * (l[0]**2 + l[1]**2 + l[2]**2 - 3), np.array([[2.0], [0.5], [1.0]])).ravel().round(9)
    array([ 1.125, -3.   , -0.75 ])
    """
    along = AXES.T @ _slopes(energy, _isochoric_logs(stretches))
    return np.asarray(along / stretches)  # not a number where a stretch is none


def gradient_and_hessian(energy: IsochoricEnergy, stretches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return dW/dl_i (3, n) and d2W/dl_i dl_j (3, 3, n) of W(J^(-1/3) l) at principal stretches (3, n)."""
    logs = _isochoric_logs(stretches)
    along = AXES.T @ _slopes(energy, logs)
    ends = [[_slopes(energy, logs + sign * NUDGE * axis[:, None]) for sign in (1, -1)] for axis in AXES]
    rates = np.stack([(high - low) / (2 * NUDGE) for high, low in ends])
    symmetric = (rates + np.swapaxes(rates, 0, 1)) / 2
    hessian = np.einsum("ai,abn,bj->ijn", AXES, symmetric, AXES)
    hessian[np.arange(3), np.arange(3)] -= along
    return along / stretches, hessian / (stretches[:, None] * stretches[None])


def is_arithmetic(energy: IsochoricEnergy) -> bool:
    """Return whether complex steps differentiate an energy, as a real difference quotient shows."""
    logs = (SAMPLE - SAMPLE.mean(axis=1, keepdims=True)).T
    try:
        with np.errstate(all="ignore"):
            slopes = _slopes(energy, logs)
            ends = [[energy(tuple(np.exp(logs + sign * NUDGE * axis[:, None]))) for sign in (1, -1)] for axis in AXES]
    except (TypeError, ValueError):
        return False
    if not all(isinstance(value, np.ndarray) for pair in ends for value in pair):
        return False
    wanted = np.array([(high - low) / (2 * NUDGE) for high, low in ends])
    return bool((np.abs(slopes - wanted) <= AGREEMENT * np.abs(wanted).max()).all())


def _isochoric_logs(stretches: FloatArray) -> FloatArray:
    """Return the logarithms (3, n) without change of volume, zero where a stretch is no number."""
    logs = np.log(stretches)
    return np.asarray(np.where(np.isfinite(logs).all(axis=0), logs - logs.mean(axis=0), 0.0))


def _slopes(energy: IsochoricEnergy, logs: FloatArray) -> FloatArray:
    """Return the slopes (2, n) of an energy along `AXES` at logarithmic strains (3, n)."""
    with np.errstate(all="ignore"):  # a solver's step may have gone too far
        values = [energy(tuple(np.exp(logs + 1j * STEP * axis[:, None]))) for axis in AXES]
    return np.array([np.broadcast_to(np.imag(value) / STEP, logs.shape[1]) for value in values])
