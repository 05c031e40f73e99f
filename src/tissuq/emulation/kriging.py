"""A Gaussian process through few runs of a smooth function, with the uncertainty of its own parameters.

Given length scales and nugget, the coefficients of the polynomial mean and the variance are integrated in closed form
(flat and 1 / variance), which leaves a Student t distribution; length scales are at their most probable values, or
averaged over them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.length_scales import (
    MIN_RELATIVE_RESIDUAL,
    Kernel,
    LengthScales,
    Mode,
    Trend,
    correlation,
    squared_differences,
    trend_basis,
)

__all__ = ["Kriging", "fitted", "leave_one_out", "moments"]

FloatArray = NDArray[np.float64]

MAX_UNEXPLAINED = 0.8
"""Largest variance of the leave-one-out errors, over that of the function, of a function that is predicted."""
MAX_UNPREDICTED = 2
"""Number of functions that are not predicted after which no further ones are tried."""


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
) -> tuple[Kriging, NDArray[np.bool_]]:
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
