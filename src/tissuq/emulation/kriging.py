"""A Gaussian process through few runs of a smooth function, with the uncertainty of its own parameters.

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

from tissuq.inference.quasi_monte_carlo import quasi_random

__all__ = ["Kernel", "Kriging", "Trend", "fitted", "trend_basis"]

FloatArray = NDArray[np.float64]

Kernel = Literal["squared-exponential", "matern-5/2"]
Trend = Literal["constant", "linear", "quadratic"]

NUGGET_BOUNDS = (1e-12, 1e-2)
"""Bounds of the nugget over the variance: rounding, and the noise of a solver."""
MEDIAN_LENGTH, LOG_LENGTH_SD = 0.7, 1.0
"""Prior of the length scales: median over the width of the run plan, and sd of the logarithm."""
OPTIMISER_STARTS = 5
MAX_SETTINGS = 12
"""Largest number of settings of the length scales that are averaged."""
MAX_RUNS_AVERAGED = 60
"""Largest number of runs for which length scales are averaged; with more, the runs determine them."""
LOG_STEP = 1e-3
"""Step of the logarithms of the length scales for the curvature at the mode."""
PROPOSAL_WIDENING, CURVATURE_BOUNDS = 1.2, (0.1, 400.0)
"""Width of the settings over that of the mode's Gaussian, and the bounds of the curvature."""
IMPROBABLE = 1e10
MIN_RELATIVE_RESIDUAL = 1e-20
"""Smallest residual sum of squares over that of the function, for functions that the mean reproduces to rounding."""


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


def squared_differences(first_points: Any, second_points: Any) -> Any:
    """Return the squared differences (n, m, d) of points (n, d) and (m, d)."""
    return (first_points[:, None, :] - second_points[None, :, :]) ** 2


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
        Weights of the settings of the length scales; their sum is one.
    lengths : (q, S, d) array
    nugget : (q,) array
    log_evidence : float
        Log evidence of all functions at their most probable length scales, up to a constant that the points alone set.
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
    def terms(self) -> list[list[SettingTerms]]:
        """The terms of every setting of every function."""
        return [
            [
                _setting_terms(self.kernel, self.trend, self.points, values, lengths, nugget)
                for lengths in lengths_of_function
            ]
            for values, lengths_of_function, nugget in zip(self.values.T, self.lengths, self.nugget, strict=True)
        ]

    @cached_property
    def arrays(self) -> dict[str, Any]:
        """The arrays of which `moments` is computed, (q, S, ...)."""
        names = ("whitener", "whitened", "root", "beta", "weight", "variance")
        stacked = {name: np.array([[getattr(terms, name) for terms in row] for row in self.terms]) for name in names}
        return stacked | {name: getattr(self, name) for name in ("points", "lengths", "weights", "nugget")}


@dataclass(frozen=True, eq=False)
class SettingTerms:
    """Terms of a function in one setting of the length scales: R = covariance over the variance, H the mean's basis.

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
        Sum of squares of the whitened residuals.
    variance : float
        Variance of the process, its own uncertainty included.
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
        """R^-1 less the part that the mean's coefficients explain (m, m)."""
        explained = self.root @ (self.whitener.T @ self.whitened).T
        return np.asarray(self.whitener.T @ self.whitener - explained.T @ explained)


def fitted(points: FloatArray, values: FloatArray, kernel: Kernel, trend: Trend) -> Kriging:
    """Return the processes of functions known at points of the unit box.

    Parameters
    ----------
    points : (m, d) array
    values : (m, q) array
        Values of the q functions, each of about unit size.
    """
    modes = [_most_probable(points, column, kernel, trend) for column in values.T]
    settings = [
        _settings(points, column, best, kernel, trend) for column, (best, _) in zip(values.T, modes, strict=True)
    ]
    count = max(len(weights) for weights, _ in settings)
    weights = np.stack([np.pad(row, (0, count - len(row))) for row, _ in settings])
    lengths = np.stack([np.pad(rows, ((0, count - len(rows)), (0, 0)), mode="edge") for _, rows in settings])
    nugget = np.exp(np.array([best[-1] for best, _ in modes]))
    evidence = float(sum(value for _, value in modes))
    return Kriging(points, values, weights, lengths, nugget, evidence, kernel, trend)


def moments(kernel: Kernel, trend: Trend, arrays: dict[str, Any], point: Any) -> tuple[Any, Any]:
    """Return means and variances (q,) of the functions at a point (d,), the settings averaged; JAX traces it."""
    import jax.numpy as jnp

    squared = (squared_differences(point[None], arrays["points"])[0] / arrays["lengths"][:, :, None] ** 2).sum(axis=-1)
    correlations, _ = correlation(kernel, squared)
    basis = trend_basis(point, trend)
    whitened = jnp.einsum("qsij,qsj->qsi", arrays["whitener"], correlations)
    unexplained = basis - jnp.einsum("qsip,qsi->qsp", arrays["whitened"], whitened)
    unexplained = jnp.einsum("qsij,qsj->qsi", arrays["root"], unexplained)
    nugget = arrays["nugget"][:, None]
    relative_variance = jnp.maximum(1 + nugget - (whitened**2).sum(axis=-1) + (unexplained**2).sum(axis=-1), nugget)
    mean = arrays["beta"] @ basis + (correlations * arrays["weight"]).sum(axis=-1)
    centre = (arrays["weights"] * mean).sum(axis=1)
    spread = (arrays["weights"] * (arrays["variance"] * relative_variance + (mean - centre[:, None]) ** 2)).sum(axis=1)
    return centre, spread


def leave_one_out(model: Kriging) -> tuple[FloatArray, FloatArray]:
    """Return errors and standard deviations (m, q) of every value predicted from the others.

    Mean and variance of the process are estimated without it (Dubrule 1983), the length scales with it.
    """
    errors, sds = [], []
    for weights, terms_of_function in zip(model.weights, model.terms, strict=True):
        error, variance = np.array([_leave_one_out_in_setting(terms) for terms in terms_of_function]).transpose(1, 0, 2)
        centre = weights @ error
        errors.append(centre)
        sds.append(np.sqrt(weights @ (variance + (error - centre) ** 2)))
    return np.array(errors).T, np.array(sds).T


def _leave_one_out_in_setting(terms: SettingTerms) -> tuple[FloatArray, FloatArray]:
    """Return errors and variances (m,) in one setting."""
    m, p = terms.whitened.shape
    diagonal = np.diag(terms.projection)
    error = terms.weight / diagonal
    squares = np.maximum(terms.squares - error**2 * diagonal, MIN_RELATIVE_RESIDUAL)
    return error, squares / (m - p - 3) / diagonal


def _most_probable(points: FloatArray, values: FloatArray, kernel: Kernel, trend: Trend) -> tuple[FloatArray, float]:
    """Return logarithms of the length scales and the nugget (d + 1,) that the runs make most probable, and how much."""
    from scipy.optimize import minimize

    size = points.shape[1]

    def loss(logs: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = _log_posterior(kernel, trend, logs, points, values)
        return -value, -gradient

    bounds = [(np.log(0.02), np.log(50.0))] * size + [(np.log(NUGGET_BOUNDS[0]), np.log(NUGGET_BOUNDS[1]))]
    starts = np.column_stack(
        [np.log(0.15) + np.log(30.0) * quasi_random(size, OPTIMISER_STARTS), np.full(OPTIMISER_STARTS, np.log(1e-8))]
    )
    best = min(
        (minimize(loss, start, jac=True, bounds=bounds, method="L-BFGS-B") for start in starts),
        key=lambda result: float(result.fun),
    )
    return np.asarray(best.x), -float(best.fun)


def _settings(
    points: FloatArray, values: FloatArray, best: FloatArray, kernel: Kernel, trend: Trend
) -> tuple[FloatArray, FloatArray]:
    """Return weights (S,) and settings (S, d) of the length scales that represent their posterior.

    Quasi-random points of the Gaussian with the curvature at the mode, weighted to be the posterior.
    """
    from scipy.special import ndtri

    size = points.shape[1]
    if len(points) > MAX_RUNS_AVERAGED:
        return np.ones(1), np.exp(best[None, :size])
    steps = np.eye(size + 1)[:size] * LOG_STEP
    slopes = [
        [_log_posterior(kernel, trend, best + sign * step, points, values)[1] for sign in (1, -1)] for step in steps
    ]
    curvature = np.array([(low - high)[:size] / (2 * LOG_STEP) for high, low in slopes])
    steep, axes = np.linalg.eigh(0.5 * (curvature + curvature.T))
    root = PROPOSAL_WIDENING * axes * np.clip(steep, *CURVATURE_BOUNDS) ** -0.5
    scores = np.concatenate([np.zeros((1, size)), ndtri(np.clip(quasi_random(size, MAX_SETTINGS - 1), 1e-3, 1 - 1e-3))])
    logs = best[:size] + scores @ root.T
    heights = np.array([_log_posterior(kernel, trend, np.append(row, best[size]), points, values)[0] for row in logs])
    weights = np.exp(heights - heights.max() + 0.5 * (scores**2).sum(axis=1) - 0.5 * (scores**2).sum(axis=1).max())
    return weights / weights.sum(), np.exp(logs)


def _log_posterior(
    kernel: Kernel, trend: Trend, logs: FloatArray, points: FloatArray, values: FloatArray
) -> tuple[float, FloatArray]:
    """Return the log of marginal likelihood times prior of the length scales, up to a constant, and its gradient."""
    lengths, nugget = np.exp(logs[:-1]), float(np.exp(logs[-1]))
    try:
        terms = _setting_terms(kernel, trend, points, values, lengths, nugget)
    except np.linalg.LinAlgError:
        return -IMPROBABLE, np.zeros_like(logs)
    free = len(points) - len(terms.beta)
    score = (logs[:-1] - np.log(MEDIAN_LENGTH)) / LOG_LENGTH_SD
    value = np.log(np.diag(terms.whitener)).sum() + np.log(np.abs(np.diag(terms.root))).sum()
    value += -0.5 * free * np.log(terms.squares) - 0.5 * (score**2).sum()
    scaled = squared_differences(points, points) / lengths**2
    change = terms.projection - free / terms.squares * np.outer(terms.weight, terms.weight)
    slope = -0.5 * np.einsum("ij,ij,ijd->d", change, correlation(kernel, scaled.sum(axis=-1))[1], scaled)
    return float(value), np.append(slope - score / LOG_LENGTH_SD, -0.5 * nugget * np.trace(change))


def _setting_terms(
    kernel: Kernel, trend: Trend, points: FloatArray, values: FloatArray, lengths: FloatArray, nugget: float
) -> SettingTerms:
    from scipy.linalg import solve_triangular

    basis = trend_basis(points, trend)
    m, p = basis.shape
    cov, _ = correlation(kernel, (squared_differences(points, points) / lengths**2).sum(axis=-1))
    whitener = solve_triangular(np.linalg.cholesky(cov + nugget * np.eye(m)), np.eye(m), lower=True)
    whitened, target = whitener @ basis, whitener @ values
    orthonormal, triangle = np.linalg.qr(whitened)
    root = solve_triangular(triangle, np.eye(p))
    beta = root @ (orthonormal.T @ target)
    residual = target - whitened @ beta
    squares = float(residual @ residual + MIN_RELATIVE_RESIDUAL * values @ values)
    return SettingTerms(whitener, whitened, root.T, beta, whitener.T @ residual, squares, squares / (m - p - 2))
