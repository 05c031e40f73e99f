"""A Gaussian process through few runs of a smooth function, with the uncertainty of its own parameters.

Given length scales and nugget, the coefficients of the polynomial mean and the variance are integrated in closed form
(flat and 1 / variance), which leaves a Student t distribution; length scales are at their most probable values, or
averaged over them. One Cholesky factor gives their density and its slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.inference.quasi_monte_carlo import quasi_random

Kernel = Literal["squared-exponential", "matern-5/2"]
Trend = Literal["constant", "linear", "quadratic"]

LENGTH_BOUNDS = (0.02, 50.0)
"""Bounds of the length scales over the width of the run plan."""
NUGGET_BOUNDS = (1e-12, 1e-2)
"""Bounds of the nugget over the variance: rounding, and the noise of a solver."""
START_NUGGET = 1e-8
MEDIAN_LENGTH, LOG_LENGTH_SD = 0.7, 1.0
"""Prior of the length scales: median over the width of the run plan, and sd of the logarithm."""
OPTIMISER_STARTS = 2
"""Number of starts of a search besides the modes of other functions or coordinates."""
MAX_SETTINGS = 12
"""Largest number of settings of the length scales that are averaged."""
MAX_RUNS_AVERAGED = 100
"""Largest number of runs for which length scales are averaged; with more, the runs determine them."""
LOG_STEP = 1e-3
"""Step of the logarithms of the length scales for the curvature at the mode."""
PROPOSAL_WIDENING, CURVATURE_BOUNDS = 1.2, (0.1, 400.0)
"""Width of the settings over that of the mode's Gaussian, and the bounds of the curvature."""
IMPROBABLE = 1e10
MIN_RELATIVE_RESIDUAL = 1e-20
"""Smallest residual sum of squares over that of the function, for functions that the mean reproduces to rounding."""
MAX_UNEXPLAINED = 0.8
"""Largest variance of the leave-one-out errors, over that of the function, of a function that is predicted."""
MAX_UNPREDICTED = 2
"""Number of functions that are not predicted after which no further ones are tried."""


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
class Mode:
    """Logarithms of the most probable length scales and the nugget (d + 1,), and their log density."""

    logs: FloatArray
    log_density: float


class LengthScales:
    """The posterior of the length scales and the nugget of functions that are known at the same points.

    Parameters
    ----------
    points : (m, d) array
        Points of the unit box.
    kernel : str
    trend : str
    """

    def __init__(self, points: FloatArray, kernel: Kernel, trend: Trend) -> None:
        self.kernel, (self.count, self.size) = kernel, points.shape
        self.basis = trend_basis(points, trend)
        self.squared = squared_differences(points, points).transpose(2, 0, 1).reshape(self.size, -1)

    def log_density(self, logs: FloatArray, values: FloatArray) -> tuple[float, FloatArray]:
        """Return the log of marginal likelihood times prior, up to a constant that the points set, and its gradient.

        Parameters
        ----------
        logs : (d + 1,) array
            Logarithms of the length scales and the nugget.
        values : (m,) array
            Values of the function.
        """
        from scipy.linalg import lapack

        inverse_squares, nugget = np.exp(-2 * logs[:-1]), float(np.exp(logs[-1]))
        cov, slope = (
            matrix.reshape(self.count, -1) for matrix in correlation(self.kernel, inverse_squares @ self.squared)
        )
        factor, failed = lapack.dpotrf(cov + nugget * np.eye(self.count), lower=1)
        if failed:
            return -IMPROBABLE, np.zeros_like(logs)
        whitened, _ = lapack.dtrtrs(factor, np.column_stack([self.basis, values]), lower=1)
        orthonormal, triangle = np.linalg.qr(whitened[:, :-1])
        residual = whitened[:, -1] - orthonormal @ (orthonormal.T @ whitened[:, -1])
        squares = float(residual @ residual + MIN_RELATIVE_RESIDUAL * values @ values)
        free = self.count - self.basis.shape[1]
        score = (logs[:-1] - np.log(MEDIAN_LENGTH)) / LOG_LENGTH_SD
        value = -np.log(np.diag(factor)).sum() - np.log(np.abs(np.diag(triangle))).sum()
        value += -0.5 * free * np.log(squares) - 0.5 * float(score @ score)
        solved, _ = lapack.dtrtrs(
            factor, np.column_stack([orthonormal, np.sqrt(free / squares) * residual]), lower=1, trans=1
        )
        lower = lapack.dpotri(factor, lower=1)[0]
        change = np.tril(lower) + np.tril(lower, -1).T - solved @ solved.T
        of_lengths = -0.5 * inverse_squares * (self.squared @ (change * slope).ravel())
        return float(value), np.append(of_lengths - score / LOG_LENGTH_SD, -0.5 * nugget * np.trace(change))

    def mode(self, values: FloatArray, near: Sequence[Mode] = (), starts: int = OPTIMISER_STARTS) -> Mode:
        """Return the most probable setting for a function.

        Parameters
        ----------
        values : (m,) array
        near : sequence of Mode
            Modes of similar functions, or of the same function in other coordinates, at which a search starts.
        starts : int
            Number of searches that start elsewhere.
        """
        from scipy.optimize import minimize

        def loss(logs: FloatArray) -> tuple[float, FloatArray]:
            value, gradient = self.log_density(logs, values)
            return -value, -gradient

        bounds = [tuple(np.log(LENGTH_BOUNDS))] * self.size + [tuple(np.log(NUGGET_BOUNDS))]
        spread = np.log(0.15) + np.log(30.0) * quasi_random(self.size, starts)
        points = [mode.logs for mode in near] + [np.append(point, np.log(START_NUGGET)) for point in spread]
        optima = [minimize(loss, point, jac=True, bounds=bounds, method="L-BFGS-B") for point in points]
        best = min(optima, key=lambda result: float(result.fun))
        return Mode(np.asarray(best.x), -float(best.fun))

    def settings(self, values: FloatArray, mode: Mode) -> tuple[FloatArray, FloatArray]:
        """Return weights (S,) and settings (S, d) of the length scales that represent their posterior.

        Quasi-random points of the Gaussian with the curvature at the mode, weighted to be the posterior.
        """
        from scipy.special import ndtri

        best, size = mode.logs, self.size
        if self.count > MAX_RUNS_AVERAGED:
            return np.ones(1), np.exp(best[None, :size])
        steps = np.eye(size + 1)[:size] * LOG_STEP
        slopes = [[self.log_density(best + sign * step, values)[1] for sign in (1, -1)] for step in steps]
        curvature = np.array([(low - high)[:size] / (2 * LOG_STEP) for high, low in slopes])
        steep, axes = np.linalg.eigh(0.5 * (curvature + curvature.T))
        root = PROPOSAL_WIDENING * axes * np.clip(steep, *CURVATURE_BOUNDS) ** -0.5
        uniforms = np.clip(quasi_random(size, MAX_SETTINGS - 1), 1e-3, 1 - 1e-3)
        scores = np.concatenate([np.zeros((1, size)), ndtri(uniforms)])
        logs = best[:size] + scores @ root.T
        heights = np.array([self.log_density(np.append(row, best[size]), values)[0] for row in logs])
        log_weights = heights + 0.5 * (scores**2).sum(axis=1)
        weights = np.exp(log_weights - log_weights.max())
        return weights / weights.sum(), np.exp(logs)


@dataclass(frozen=True, eq=False)
class Kriging:
    """The processes of q functions of points in the unit box, each known at the same m points, in S settings.

    Attributes
    ----------
    weights : (q, S) array
        Weights of the settings of the length scales; their sum is one.
    lengths : (q, S, d) array
    nugget : (q,) array
    """

    points: FloatArray
    values: FloatArray
    weights: FloatArray
    lengths: FloatArray
    nugget: FloatArray
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


def fitted(
    points: FloatArray, values: FloatArray, kernel: Kernel, trend: Trend, near: Sequence[Mode] = ()
) -> tuple[Kriging, BoolArray]:
    """Return the processes of functions known at points of the unit box, and which functions (q,) these are.

    Functions that a process does not predict from the other points are left out, and so are all that follow the
    second of them.

    Parameters
    ----------
    points : (m, d) array
    values : (m, q) array
        Values of the q functions, each of unit variance, the smoothest first.
    kernel, trend : str
    near : sequence of Mode
        The most probable length scales of the first functions, where they are known.
    """
    scales, modes = LengthScales(points, kernel, trend), list(near)
    is_predicted = np.zeros(values.shape[1], dtype=bool)
    models: list[Kriging] = []
    for column, function in enumerate(values.T):
        if column - is_predicted[:column].sum() >= MAX_UNPREDICTED:
            break
        if column >= len(near):
            modes.append(scales.mode(function, modes[-1:]))
        weights, lengths = scales.settings(function, modes[column])
        nugget = np.exp(modes[column].logs[-1:])
        model = Kriging(points, function[:, None], weights[None], lengths[None], nugget, kernel, trend)
        error, _ = leave_one_out(model)
        is_predicted[column] = column == 0 or float((error**2).mean()) < MAX_UNEXPLAINED
        if is_predicted[column]:
            models.append(model)
    joined = {
        name: np.concatenate([getattr(model, name) for model in models]) for name in ("weights", "lengths", "nugget")
    }
    return Kriging(points, values[:, is_predicted], **joined, kernel=kernel, trend=trend), is_predicted


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
