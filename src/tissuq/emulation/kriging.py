"""A Gaussian process through few runs of a smooth function, with what is not known of its own parameters.

Given length scales and nugget, the coefficients of the polynomial mean and the variance are integrated in closed form
(flat and 1 / variance), which leaves a Student t distribution; length scales are at their most probable values, or
averaged over them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.kronecker import quasi_random

__all__ = ["Kernel", "Kriging", "Trend", "fitted", "trend_basis"]

FloatArray = NDArray[np.float64]

Kernel = Literal["squared-exponential", "matern-5/2"]
Trend = Literal["constant", "linear", "quadratic"]

NUGGET = (1e-12, 1e-2)
"""Bounds of the nugget over the variance: rounding, and the noise of a solver."""
TYPICAL, SPREAD = 0.7, 1.0
"""Median of the length scales over the width of the design, and the sd of their logarithm, a priori."""
STARTS = 5
SETTINGS = 12
"""Settings of the length scales that are averaged, at most."""
FEW_RUNS = 60
"""Up to which the length scales are averaged: beyond, the data tell them."""
STEP = 1e-3
"""Of the logarithms, for the curvature at the mode."""
WIDER, STEEPNESS = 1.2, (0.1, 400.0)
"""How much wider than the mode's Gaussian the settings spread, and the curvatures that are believed."""
HUGE = 1e10
FLOOR = 1e-20
"""Of the residual sum of squares over that of the function: functions that the mean reproduces to rounding."""


def trend_basis(points: Any, trend: Trend) -> Any:
    """Return the monomials (..., p) of a polynomial mean at points (..., d)."""
    arrays = points.__array_namespace__()
    size = points.shape[-1]
    columns = [arrays.ones_like(points[..., 0])]
    if trend != "constant":
        columns += [points[..., k] for k in range(size)]
    if trend == "quadratic":
        columns += [points[..., i] * points[..., k] for i in range(size) for k in range(i, size)]
    return arrays.stack(columns, axis=-1)


def squared_differences(one: Any, other: Any) -> Any:
    """Return the squared differences (n, m, d) of points (n, d) and (m, d)."""
    return (one[:, None, :] - other[None, :, :]) ** 2


def correlation(kernel: Kernel, squared: Any) -> tuple[Any, Any]:
    """Return the correlations (n, m) at squared distances in length scales, and minus twice their derivative."""
    arrays = squared.__array_namespace__()
    if kernel == "squared-exponential":
        same = arrays.exp(-0.5 * squared)
        return same, same
    distance = arrays.sqrt(5.0 * squared + 1e-30)
    decay = arrays.exp(-distance)
    return (1 + distance + distance**2 / 3) * decay, 5 / 3 * (1 + distance) * decay


@dataclass(frozen=True, eq=False)
class Kriging:
    """The processes of q functions of points in the unit box, each known at the same m points, in S settings.

    Attributes
    ----------
    weights : (q, S) array
        Of the settings of the length scales; their sum is one.
    lengths : (q, S, d) array
    nugget : (q,) array
    log_evidence : float
        Of all functions at their most probable length scales, up to a constant that the points alone set.
    """

    points: FloatArray
    values: FloatArray
    weights: FloatArray
    lengths: FloatArray
    nugget: FloatArray
    log_evidence: float
    kernel: Kernel
    trend: Trend

    @cached_property
    def parts(self) -> list[list[Parts]]:
        """What every setting of every function gives."""
        return [
            [_parts(self.kernel, self.trend, self.points, values, lengths, nugget) for lengths in own]
            for values, own, nugget in zip(self.values.T, self.lengths, self.nugget, strict=True)
        ]

    @cached_property
    def arrays(self) -> dict[str, Any]:
        """What `moments` needs, each (q, S, ...)."""
        names = ("whitener", "whitened", "root", "beta", "weight", "variance")
        found = {name: np.array([[getattr(part, name) for part in own] for own in self.parts]) for name in names}
        return found | {name: getattr(self, name) for name in ("points", "lengths", "weights", "nugget")}


@dataclass(frozen=True, eq=False)
class Parts:
    """What a setting of the length scales says of a function: R = covariance over the variance, H the mean's basis.

    Attributes
    ----------
    whitener : (m, m) array
        R^-1/2.
    whitened : (m, p) array
        R^-1/2 H.
    root : (p, p) array
        (H' R^-1 H)^-1/2.
    beta : (p,) array
        Coefficients of the mean.
    weight : (m,) array
        R^-1 (z - H beta).
    squares : float
        Of the whitened residuals.
    variance : float
        Of the process, its own uncertainty included.
    """

    whitener: FloatArray
    whitened: FloatArray
    root: FloatArray
    beta: FloatArray
    weight: FloatArray
    squares: float
    variance: float

    @property
    def projection(self) -> FloatArray:
        """R^-1 without what the mean's coefficients explain (m, m)."""
        explained = self.root @ (self.whitener.T @ self.whitened).T
        return np.asarray(self.whitener.T @ self.whitener - explained.T @ explained)


def fitted(points: FloatArray, values: FloatArray, kernel: Kernel, trend: Trend) -> Kriging:
    """Return the processes of functions known at points of the unit box.

    Parameters
    ----------
    points : (m, d) array
    values : (m, q) array
        Of the q functions, each of about unit size.
    """
    own = [_most_probable(points, column, kernel, trend) for column in values.T]
    settings = [_settings(points, column, best, kernel, trend) for column, (best, _) in zip(values.T, own, strict=True)]
    count = max(len(weights) for weights, _ in settings)
    weights = np.stack([np.pad(each, (0, count - len(each))) for each, _ in settings])
    lengths = np.stack([np.pad(each, ((0, count - len(each)), (0, 0)), mode="edge") for _, each in settings])
    nugget = np.exp(np.array([best[-1] for best, _ in own]))
    evidence = float(sum(value for _, value in own))
    return Kriging(points, values, weights, lengths, nugget, evidence, kernel, trend)


def moments(kernel: Kernel, trend: Trend, arrays: dict[str, Any], point: Any) -> tuple[Any, Any]:
    """Return means and variances (q,) of the functions at a point (d,), the settings averaged; JAX traces it."""
    import jax.numpy as jnp

    squared = (squared_differences(point[None], arrays["points"])[0] / arrays["lengths"][:, :, None] ** 2).sum(axis=-1)
    among, _ = correlation(kernel, squared)
    basis = trend_basis(point, trend)
    own = jnp.einsum("qsij,qsj->qsi", arrays["whitener"], among)
    rest = basis - jnp.einsum("qsip,qsi->qsp", arrays["whitened"], own)
    rest = jnp.einsum("qsij,qsj->qsi", arrays["root"], rest)
    nugget = arrays["nugget"][:, None]
    left = jnp.maximum(1 + nugget - (own**2).sum(axis=-1) + (rest**2).sum(axis=-1), nugget)
    mean = arrays["beta"] @ basis + (among * arrays["weight"]).sum(axis=-1)
    centre = (arrays["weights"] * mean).sum(axis=1)
    spread = (arrays["weights"] * (arrays["variance"] * left + (mean - centre[:, None]) ** 2)).sum(axis=1)
    return centre, spread


def left_out(model: Kriging) -> tuple[FloatArray, FloatArray]:
    """Return errors and standard deviations (m, q) of every value predicted from the others.

    Mean and variance of the process are estimated without it (Dubrule 1983), the length scales with it.
    """
    errors, sds = [], []
    for weights, own in zip(model.weights, model.parts, strict=True):
        error, variance = np.array([_left_out(part) for part in own]).transpose(1, 0, 2)
        centre = weights @ error
        errors.append(centre)
        sds.append(np.sqrt(weights @ (variance + (error - centre) ** 2)))
    return np.array(errors).T, np.array(sds).T


def _left_out(part: Parts) -> tuple[FloatArray, FloatArray]:
    """Return errors and variances (m,) in one setting."""
    m, p = part.whitened.shape
    diagonal = np.diag(part.projection)
    error = part.weight / diagonal
    squares = np.maximum(part.squares - error**2 * diagonal, FLOOR)
    return error, squares / (m - p - 3) / diagonal


def _most_probable(points: FloatArray, values: FloatArray, kernel: Kernel, trend: Trend) -> tuple[FloatArray, float]:
    """Return logarithms of the length scales and the nugget (d + 1,) that the runs make most probable, and how much."""
    from scipy.optimize import minimize

    size = points.shape[1]

    def loss(logs: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = _log_posterior(kernel, trend, logs, points, values)
        return -value, -gradient

    bounds = [(np.log(0.02), np.log(50.0))] * size + [(np.log(NUGGET[0]), np.log(NUGGET[1]))]
    starts = np.column_stack([np.log(0.15) + np.log(30.0) * quasi_random(size, STARTS), np.full(STARTS, np.log(1e-8))])
    found = min(
        (minimize(loss, start, jac=True, bounds=bounds, method="L-BFGS-B") for start in starts),
        key=lambda each: float(each.fun),
    )
    return np.asarray(found.x), -float(found.fun)


def _settings(
    points: FloatArray, values: FloatArray, best: FloatArray, kernel: Kernel, trend: Trend
) -> tuple[FloatArray, FloatArray]:
    """Return weights (S,) and settings (S, d) of the length scales that stand for their posterior.

    Quasi-random points of the Gaussian with the curvature at the mode, weighted to be the posterior.
    """
    from scipy.special import ndtri

    size = points.shape[1]
    if len(points) > FEW_RUNS:
        return np.ones(1), np.exp(best[None, :size])
    steps = np.eye(size + 1)[:size] * STEP
    slopes = [
        [_log_posterior(kernel, trend, best + way * each, points, values)[1] for way in (1, -1)] for each in steps
    ]
    curvature = np.array([(low - high)[:size] / (2 * STEP) for high, low in slopes])
    steep, axes = np.linalg.eigh(0.5 * (curvature + curvature.T))
    root = WIDER * axes * np.clip(steep, *STEEPNESS) ** -0.5
    scores = np.concatenate([np.zeros((1, size)), ndtri(np.clip(quasi_random(size, SETTINGS - 1), 1e-3, 1 - 1e-3))])
    logs = best[:size] + scores @ root.T
    heights = np.array([_log_posterior(kernel, trend, np.append(each, best[size]), points, values)[0] for each in logs])
    weights = np.exp(heights - heights.max() + 0.5 * (scores**2).sum(axis=1) - 0.5 * (scores**2).sum(axis=1).max())
    return weights / weights.sum(), np.exp(logs)


def _log_posterior(
    kernel: Kernel, trend: Trend, logs: FloatArray, points: FloatArray, values: FloatArray
) -> tuple[float, FloatArray]:
    """Return the log of marginal likelihood times prior of the length scales, up to a constant, and its gradient."""
    lengths, nugget = np.exp(logs[:-1]), float(np.exp(logs[-1]))
    try:
        part = _parts(kernel, trend, points, values, lengths, nugget)
    except np.linalg.LinAlgError:
        return -HUGE, np.zeros_like(logs)
    free = len(points) - len(part.beta)
    score = (logs[:-1] - np.log(TYPICAL)) / SPREAD
    value = np.log(np.diag(part.whitener)).sum() + np.log(np.abs(np.diag(part.root))).sum()
    value += -0.5 * free * np.log(part.squares) - 0.5 * (score**2).sum()
    apart = squared_differences(points, points) / lengths**2
    change = part.projection - free / part.squares * np.outer(part.weight, part.weight)
    slope = -0.5 * np.einsum("ij,ij,ijd->d", change, correlation(kernel, apart.sum(axis=-1))[1], apart)
    return float(value), np.append(slope - score / SPREAD, -0.5 * nugget * np.trace(change))


def _parts(
    kernel: Kernel, trend: Trend, points: FloatArray, values: FloatArray, lengths: FloatArray, nugget: float
) -> Parts:
    from scipy.linalg import solve_triangular

    basis = trend_basis(points, trend)
    m, p = basis.shape
    cov, _ = correlation(kernel, (squared_differences(points, points) / lengths**2).sum(axis=-1))
    whitener = solve_triangular(np.linalg.cholesky(cov + nugget * np.eye(m)), np.eye(m), lower=True)
    whitened, target = whitener @ basis, whitener @ values
    orthonormal, triangle = np.linalg.qr(whitened)
    root = solve_triangular(triangle, np.eye(p))
    beta = root @ (orthonormal.T @ target)
    rest = target - whitened @ beta
    squares = float(rest @ rest + FLOOR * values @ values)
    return Parts(whitener, whitened, root.T, beta, whitener.T @ rest, squares, squares / (m - p - 2))
