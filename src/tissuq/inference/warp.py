"""Coordinates of the nonlinear parameters in which their posterior is nearly flat: what quadrature works in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tissuq.priors import Prior

__all__ = ["Warp", "warp_around_mode"]

FloatArray = NDArray[np.float64]

PROBES = 10
"""Prior probabilities tried along each parameter in the search for the mode: 2^-1, 2^-2, ..."""
NEWTON_STEPS = 25
STEP = 1e-3
REACH = 20.0
"""e-folds below the mode at which the logarithm of a parameter ends: about e^-20 of the mass lies below."""


@dataclass(frozen=True, eq=False)
class Warp:
    """A map between the unit cube and d parameters with bounds, through one Cauchy distribution after another.

    Each parameter enters by its logarithm where its support is positive. Given those before it, its coordinate is
    the probability of a Cauchy distribution cut at its bounds, whose centre follows the others along the ridges
    of the posterior. The map is exact whatever centre and scale; good ones only save work.
    """

    is_log: NDArray[np.bool_]
    lower: FloatArray
    upper: FloatArray
    centre: FloatArray
    slope: FloatArray
    scale: FloatArray

    def parameters(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return parameters (N, d) at points (N, d) of the cube, and the log density of the map there."""
        g = np.empty_like(u)
        log_density = np.zeros(len(u))
        for j in range(u.shape[1]):
            centre = self._centre(j, g)
            start, mass = self._cut(j, centre)
            tangent = np.tan(np.pi * (start + mass * u[:, j] - 0.5))
            g[:, j] = np.clip(centre + self.scale[j] * tangent, self.lower[j], self.upper[j])
            log_density -= np.log(np.pi * self.scale[j] * (1 + tangent**2) * mass)
        h = np.where(self.is_log, np.exp(np.where(self.is_log, g, 0.0)), g)
        return h, log_density - (g * self.is_log).sum(axis=1)

    def bounds(self, j: int) -> tuple[float, float]:
        """Return the lowest and highest value of parameter j."""
        ends = np.array([self.lower[j], self.upper[j]])
        low, high = np.exp(ends) if self.is_log[j] else ends
        return float(low), float(high)

    def coordinate(self, j: int, value: FloatArray, before: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coordinate u_j (N, k) of values (k,) given coordinates before it (N, j), and du_j/dvalue."""
        g = np.zeros((len(before), len(self.scale)))
        if j:
            padded = np.hstack([before, np.full((len(before), len(self.scale) - j), 0.5)])
            h, _ = self.parameters(padded)
            g[:, :j] = np.where(self.is_log, np.log(np.where(self.is_log, h, 1.0)), h)[:, :j]
        centre = self._centre(j, g)[:, None]
        start, mass = self._cut(j, centre)
        target = np.log(value) if self.is_log[j] else value
        distance = (target - centre) / self.scale[j]
        slope = 1 / (np.pi * self.scale[j] * (1 + distance**2) * mass)
        coordinate = (0.5 + np.arctan(distance) / np.pi - start) / mass
        return np.clip(coordinate, 0.0, 1.0 - 1e-12), slope / value if self.is_log[j] else slope

    def _centre(self, j: int, g: FloatArray) -> FloatArray:
        return np.asarray(self.centre[j] + (g[:, :j] - self.centre[:j]) @ self.slope[j, :j])

    def _cut(self, j: int, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
        start = 0.5 + np.arctan((self.lower[j] - centre) / self.scale[j]) / np.pi
        end = 0.5 + np.arctan((self.upper[j] - centre) / self.scale[j]) / np.pi
        return start, end - start


def warp_around_mode(priors: Sequence[Prior], log_likelihood: Callable[[FloatArray], FloatArray]) -> Warp:
    """Return the warp that follows the posterior of d parameters around its mode.

    Parameters
    ----------
    priors : sequence of d Prior
    log_likelihood : callable
        Maps parameters (N, d) to (N,) values.
    """
    supports = np.array([prior.support for prior in priors])
    is_log = supports[:, 0] >= 0
    with np.errstate(divide="ignore"):
        bounds = np.where(is_log[:, None], np.log(np.maximum(supports, 0.0)), supports)

    def log_posterior(g: FloatArray) -> FloatArray:
        h = np.where(is_log, np.exp(np.where(is_log, g, 0.0)), g)
        log_prior = sum(prior.log_density(column) for prior, column in zip(priors, h.T, strict=True))
        return np.asarray(log_likelihood(h) + log_prior + (g * is_log).sum(axis=1))

    mode, covariance = _laplace(log_posterior, _best_probe(priors, is_log, log_posterior), bounds)
    slope = np.zeros_like(covariance)
    scale = np.sqrt(np.diag(covariance)).copy()
    for j in range(1, len(mode)):
        slope[j, :j] = np.linalg.solve(covariance[:j, :j], covariance[:j, j])
        scale[j] = np.sqrt(covariance[j, j] - covariance[j, :j] @ slope[j, :j])
    lowest = np.where(is_log, np.maximum(bounds[:, 0], mode - REACH), bounds[:, 0])
    return Warp(is_log, lowest, bounds[:, 1], mode, slope, scale)


def _best_probe(
    priors: Sequence[Prior], is_log: NDArray[np.bool_], log_posterior: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    probabilities = 0.5 ** np.arange(1, PROBES + 1)
    lines = [
        np.asarray(prior.quantile(probabilities if log else np.linspace(0.05, 0.95, PROBES)))
        for prior, log in zip(priors, is_log, strict=True)
    ]
    probes = np.array(list(product(*lines)))
    g = np.where(is_log, np.log(np.where(is_log, probes, 1.0)), probes)
    return np.asarray(g[int(np.nanargmax(log_posterior(g)))])


def _laplace(
    log_posterior: Callable[[FloatArray], FloatArray], start: FloatArray, bounds: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mode and a covariance there: damped Newton steps on finite differences, inside the bounds."""
    d = len(start)
    inside = np.where(np.isfinite(bounds), bounds, np.sign(bounds) * 1e6)
    width = inside[:, 1] - inside[:, 0]
    low, high = inside[:, 0] + 1e-4 * np.minimum(width, 1.0), inside[:, 1] - 1e-4 * np.minimum(width, 1.0)
    point, damping = np.clip(start, low, high), 1e-2
    pairs = [(i, j) for i in range(d) for j in range(i)]
    eye = np.eye(d) * STEP
    stencil = np.array([np.zeros(d), *eye, *-eye, *(eye[i] + eye[j] for i, j in pairs)])
    value, gradient, curvature = _derivatives(log_posterior(point + stencil), d, pairs)
    for _ in range(NEWTON_STEPS):
        step = np.linalg.solve(_positive(curvature) + damping * np.eye(d), gradient)
        trial = np.clip(point + np.clip(step, -2.0, 2.0), low, high)
        result = _derivatives(log_posterior(trial + stencil), d, pairs)
        if not result[0] > value:
            damping *= 8
            if damping > 1e8 or np.abs(trial - point).max() < STEP:
                break
            continue
        moved, point = np.abs(trial - point).max(), trial
        value, gradient, curvature = result
        damping = max(damping / 8, 1e-8)
        if moved < STEP:
            break
    return point, np.asarray(np.linalg.inv(_positive(curvature)), dtype=np.float64)


def _derivatives(values: FloatArray, d: int, pairs: list[tuple[int, int]]) -> tuple[float, FloatArray, FloatArray]:
    """Return the value, gradient and negative Hessian from values on the stencil."""
    here, up, down, mixed = values[0], values[1 : d + 1], values[d + 1 : 2 * d + 1], values[2 * d + 1 :]
    hessian = np.diag((up - 2 * here + down) / STEP**2)
    for (i, j), both in zip(pairs, mixed, strict=True):
        hessian[i, j] = hessian[j, i] = (both - here - (up[i] - down[i] + up[j] - down[j]) / 2) / STEP**2 - 0.5 * (
            hessian[i, i] + hessian[j, j]
        )
    return float(here), (up - down) / (2 * STEP), -hessian


def _positive(curvature: FloatArray) -> FloatArray:
    """Return the curvature with eigenvalues of at least a twenty-fifth: no scale beyond five e-folds or units."""
    if not np.isfinite(curvature).all():
        return np.eye(len(curvature))
    values, vectors = np.linalg.eigh(curvature)
    return np.asarray((vectors * np.maximum(values, 0.04)) @ vectors.T)
