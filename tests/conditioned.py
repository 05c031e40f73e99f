"""Conditioned squared exponentials by dense linear algebra and Simpson's rule: an oracle for the processes in stress.

Nothing of the package is used. Everything a process is conditioned on is written out as a joint covariance, in long
double precision where differences of nearly equal numbers are taken.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import simpson

Array = NDArray[np.float64]

POINTS = 1201
"""Of Simpson's rule: enough for a correlation length of 0.02 times the range."""


def squared_exponential(first: Array, second: Array, psi: float) -> Array:
    return np.exp(-((first[:, None] - second[None, :]) ** 2) / (2 * psi**2))


def pinned(stretch: Array, psi: float) -> Array:
    """Condition the joint covariance of (M(l), M(1), M'(1)) on the latter two being zero."""
    x, length = stretch.astype(np.longdouble), np.longdouble(psi)
    with_value = np.exp(-((x - 1) ** 2) / (2 * length**2))
    with_slope = with_value * (x - 1) / length**2  # d/dl' of the kernel at l' = 1
    slope_variance = 1 / length**2  # and the two are independent
    found = squared_exponential(x, x, length)
    found = found - np.outer(with_value, with_value) - np.outer(with_slope, with_slope) / slope_variance
    return np.asarray(found, dtype=np.float64)


def orthogonal(
    stretch: Array,
    psi: float,
    ends: tuple[float, float],
    stresses: list[Callable[[Array], Array]],
    points: int = POINTS,
) -> Array:
    """Condition the joint covariance of M and its integrals with some stresses on these being zero."""
    line = np.linspace(*ends, points)
    weights = simpson(np.eye(points), x=line, axis=1)
    columns = np.stack([stress(line) for stress in stresses], axis=1) * weights[:, None]
    cross = squared_exponential(stretch, line, psi) @ columns
    integrals = columns.T @ squared_exponential(line, line, psi) @ columns
    return squared_exponential(stretch, stretch, psi) - cross @ np.linalg.solve(integrals, cross.T)


def scaled(stretch: Array, psi: float, ends: tuple[float, float], strength: float, points: int = POINTS) -> Array:
    """Add strength times the quadratic form of the mean square over the range to the precision of all values.

    (K^-1 + P)^-1 = (1 + K P)^-1 K over the points and the line together, P only on the line.
    """
    line = np.linspace(*ends, points)
    weights = simpson(np.eye(points), x=line, axis=1) / (ends[1] - ends[0])
    every = np.concatenate([stretch, line])
    K = squared_exponential(every, every, psi)
    precision = strength * np.concatenate([np.zeros(len(stretch)), weights])
    found = np.linalg.solve(np.eye(len(every)) + K * precision, K[:, : len(stretch)])
    return found[: len(stretch)]
