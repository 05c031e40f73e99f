"""Gaussians within bounds: how much mass a box holds, and points that stand for what it leaves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.inference.nested import MAX_NESTED, nested_draws, nested_log_mass
from tissuq.inference.quasi_monte_carlo import SHIFTS, quasi_random
from tissuq.parameters.normal_interval import interval_quantile, log_interval

NEGLIGIBLE_MASS = 1e-8
"""Mass outside the bounds below which the unbounded closed form stands."""
TOUCHED_MASS = 1e-3 * NEGLIGIBLE_MASS
"""Mass of one parameter beyond its bounds below which it is as good as unbounded."""
SMALL_MASS = 1e-6
"""Mass outside below which the sum over parameters is near enough."""
FIRST_POINTS, MAX_POINTS = 512, 30_000
"""Points for each Gaussian to begin with, and beyond which no more are taken."""
MAX_LOG_MASS_ERROR = 1e-3
"""Error of the log mass from which more points are taken."""
MAX_LOG_MASS_DROP = 15.0
"""Log of the mass within all bounds, relative to the least within one, below which the points may have missed it."""
MAX_POINTS_AT_ONCE = 500_000
"""Points at once: what bounds the memory."""
GIBBS_SWEEPS = 100
"""Gibbs sweeps that take draws to their distribution."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Lower and upper bounds (B, p) of p jointly Gaussian parameters, for each of B data sets."""

    lower: FloatArray
    upper: FloatArray

    def __getitem__(self, index: Any) -> Boxes:
        return Boxes(self.lower[index], self.upper[index])

    def repeated(self, count: int) -> Boxes:
        """Return the bounds of the first data set for each of some Gaussians."""
        return self[np.zeros(count, dtype=int)]

    def ceiling(self, mean: FloatArray, root: FloatArray) -> FloatArray:
        """Return an upper bound on the log mass inside, (M,) for M Gaussians: the least over single parameters."""
        if not np.isfinite(self.lower).any() and not np.isfinite(self.upper).any():
            return np.zeros(len(mean))
        low, high = self._scores(mean, root)
        return np.asarray(np.minimum(log_interval(low, high).min(axis=1, initial=0.0), 0.0))

    def beyond(self, mean: FloatArray, root: FloatArray) -> FloatArray:
        """Return the mass (M, p) of each parameter of M Gaussians beyond its bounds.

        Their sum over the parameters bounds the mass outside from above (Boole).
        """
        return _beyond(*self._scores(mean, root))

    def log_mass(self, mean: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log mass (M,) of M Gaussians inside the bounds (M, p), and its error (M,).

        It is at least one less the sum of the masses beyond single bounds, which is near enough where that is small.
        Elsewhere it is computed over the parameters that come near their bounds: by nested quadrature for up to
        three, and by Genz's sequential conditioning on quasi-random points for more (Genz 1992, J. Comput. Graph.
        Stat. 1:141).
        """
        low, high = self._scores(mean, root)
        mass_beyond = _beyond(low, high)
        outside = mass_beyond.sum(axis=1)
        log_mass, error = np.log1p(-np.minimum(outside, 0.5)), np.minimum(outside, SMALL_MASS)
        active = mass_beyond > TOUCHED_MASS
        is_single = active.sum(axis=1) == 1
        if is_single.any():
            only = active[is_single].argmax(axis=1)[:, None]
            log_mass[is_single] = log_interval(*(np.take_along_axis(s[is_single], only, 1)[:, 0] for s in (low, high)))
            error[is_single] = 0.0
        several = (active.sum(axis=1) > 1) & (outside > SMALL_MASS)
        for parameters, crossed in _by_pattern(active, several):
            crossing = np.ix_(crossed, parameters)
            log_mass[crossed], error[crossed] = self[crossing]._log_mass(mean[crossing], root[crossing])
        return log_mass, error

    def draws(self, mean: FloatArray, root: FloatArray, uniforms: FloatArray) -> FloatArray:
        """Return R draws within the bounds from each of M Gaussians, (M, R, p), from uniforms (M, R, p).

        Exact where up to three bounds matter; else a few weighted points, then Gibbs sweeps.
        """
        from scipy.special import ndtri

        values = np.empty(uniforms.shape)
        active = self.beyond(mean, root) > TOUCHED_MASS
        for parameters, rows in _by_pattern(active, np.ones(len(mean), dtype=bool)):
            k, near = len(parameters), np.ix_(rows, parameters)
            order = np.concatenate([parameters, np.setdiff1d(np.arange(mean.shape[1]), parameters)])
            triangle = lower_triangle(root[np.ix_(rows, order)])
            triangle_near, uniforms_near = triangle[:, :k, :k], uniforms[rows, :, :k]
            scores = ndtri(uniforms[rows])
            if k > MAX_NESTED:
                deviations = self[near]._gibbs(mean[near], triangle_near, uniforms_near) - mean[near][:, None]
                scores[:, :, :k] = np.linalg.solve(triangle_near, deviations.swapaxes(1, 2)).swapaxes(1, 2)
            elif k:
                low, high = (bound[near] - mean[near] for bound in (self.lower, self.upper))
                scores[:, :, :k] = nested_draws(triangle_near, low, high, uniforms_near)
            ordered = mean[np.ix_(rows, order)][:, None] + np.einsum("mjk,mrk->mrj", triangle, scores)
            values[np.ix_(rows, np.arange(uniforms.shape[1]), order)] = ordered
        return np.clip(values, self.lower[:, None], self.upper[:, None])

    def _log_mass(self, mean: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log masses and their errors where every bound matters."""
        if mean.shape[1] > MAX_NESTED:
            log_mass, error = self._by_points(mean, root, FIRST_POINTS)
            # The error is not to be trusted where no bound alone tells how little is left.
            return log_mass, error + np.where(self.ceiling(mean, root) - log_mass > MAX_LOG_MASS_DROP, 1.0, 0.0)
        log_mass, error = np.empty(len(mean)), np.empty(len(mean))
        for block in np.array_split(np.arange(len(mean)), 1 + len(mean) // 500):
            ends = ((bound[block] - mean[block]) for bound in (self.lower, self.upper))
            log_mass[block], error[block] = nested_log_mass(lower_triangle(root[block]), *ends)
        return log_mass, error

    def _gibbs(self, mean: FloatArray, root: FloatArray, uniforms: FloatArray) -> FloatArray:
        """Return draws (M, R, p) from uniforms (M, R, p) that start the sweeps."""
        draws, p = uniforms.shape[1:]
        rows = np.repeat(np.arange(len(mean)), draws)
        boxes, mean, root = self[rows], mean[rows], root[rows]
        generator, values = np.random.default_rng(0), np.empty(mean.shape)
        for block in np.array_split(np.arange(len(rows)), max(1, len(rows) // 500)):
            log_weights, points = boxes[block].points(mean[block], root[block])
            cumulative = np.cumsum(np.exp(log_weights - log_weights.max(axis=1, keepdims=True)), axis=1)
            targets = uniforms.reshape(-1, p)[block, :1] * cumulative[:, -1:]
            values[block] = points[np.arange(len(block)), (cumulative < targets).sum(axis=1)]
        inverse = np.linalg.inv(root)
        precision = inverse.swapaxes(1, 2) @ inverse
        for _ in range(GIBBS_SWEEPS):
            for j in range(p):
                deviation, precision_of_j = values - mean, precision[:, j, j]
                deviation[:, j] = 0.0
                centre = mean[:, j] - (precision[:, j] * deviation).sum(axis=1) / precision_of_j
                low, high = boxes.lower[:, j], boxes.upper[:, j]
                ends = ((bound - centre) * np.sqrt(precision_of_j) for bound in (low, high))
                score, _ = interval_quantile(generator.random(len(centre)), *ends)
                values[:, j] = np.clip(centre + score / np.sqrt(precision_of_j), low, high)
        return values.reshape(-1, draws, p)

    def _by_points(self, mean: FloatArray, root: FloatArray, number: int) -> tuple[FloatArray, FloatArray]:
        """Return the log mass inside the bounds and its error by quasi-random points; more of them where needed."""
        from scipy.special import logsumexp

        log_mass, error = np.empty(len(mean)), np.empty(len(mean))
        for block in np.array_split(np.arange(len(mean)), 1 + len(mean) * number // MAX_POINTS_AT_ONCE):
            log_weights, _ = self[block].points(mean[block], root[block], number)
            top = log_weights.max(axis=1, keepdims=True)
            shares = np.exp(log_weights - top).reshape(len(block), SHIFTS, -1).mean(axis=2)
            log_mass[block] = top[:, 0] + np.log(shares.mean(axis=1))
            effective = np.exp(2 * logsumexp(log_weights, axis=1) - logsumexp(2 * log_weights, axis=1))
            spread = shares.std(axis=1, ddof=1) / np.sqrt(SHIFTS) / shares.mean(axis=1)
            error[block] = spread + 10 / effective**1.5
        rough = np.flatnonzero(error > MAX_LOG_MASS_ERROR)
        if len(rough) and number < MAX_POINTS:
            log_mass[rough], error[rough] = self[rough]._by_points(mean[rough], root[rough], 8 * number)
        return log_mass, error

    def points(self, mean: FloatArray, root: FloatArray, number: int = FIRST_POINTS) -> tuple[FloatArray, FloatArray]:
        """Return log weights (M, P) and P = number points (M, P, p) inside the bounds (M, p).

        They stand for M bounded Gaussians, drawn one parameter after another; the mean weight is the mass inside.
        """
        count, p = mean.shape
        order = np.argsort(-self.beyond(mean, root).mean(axis=0))  # the tightest bound first
        triangle = lower_triangle(root[:, order])
        uniforms = quasi_random(p, number)
        log_weights = np.zeros((count, len(uniforms)))
        standard = np.empty((count, len(uniforms), p))
        points = np.empty_like(standard)
        for step, j in enumerate(order):
            shift = np.einsum("nqk,nk->nq", standard[:, :, :step], triangle[:, step, :step])
            centre, scale = mean[:, None, j] + shift, triangle[:, step, step][:, None]
            lower, upper = self.lower[:, j, None], self.upper[:, j, None]
            ends = (lower - centre) / scale, (upper - centre) / scale
            standard[:, :, step], log_mass = interval_quantile(uniforms[:, step], *ends)
            log_weights += log_mass
            points[:, :, j] = np.clip(centre + scale * standard[:, :, step], lower, upper)
        return log_weights, points

    def _scores(self, mean: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the bounds in standard deviations from the means."""
        sd = np.sqrt((root**2).sum(axis=2))
        return (self.lower - mean) / sd, (self.upper - mean) / sd


def _beyond(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the masses of standard normal variables beyond bounds."""
    from scipy.special import ndtr

    return np.asarray(ndtr(low) + ndtr(-high))


def _by_pattern(active: BoolArray, rows: BoolArray) -> Iterator[tuple[IndexArray, IndexArray]]:
    """Yield places of parameters whose bounds matter, and the rows among some of which this is true."""
    for pattern in np.unique(active[rows], axis=0) if rows.any() else ():
        yield np.flatnonzero(pattern), np.flatnonzero(rows & (active == pattern).all(axis=1))


def lower_triangle(root: FloatArray) -> FloatArray:
    """Return lower triangles L (M, k, k) with L L' = root root' for roots (M, k, p), without squaring them."""
    upper = np.asarray(np.linalg.qr(root.swapaxes(1, 2), mode="r"), dtype=np.float64)
    diagonal = np.einsum("mii->mi", upper)
    lower = (upper * np.where(diagonal < 0, -1.0, 1.0)[:, :, None]).swapaxes(1, 2)
    smallest = 1e-12 * np.sqrt((root**2).sum(axis=2))
    np.einsum("mii->mi", lower)[:] = np.maximum(np.abs(diagonal), smallest)
    return lower
