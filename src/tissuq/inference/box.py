"""Gaussians within bounds: how much mass a box holds, and points that stand for what it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tissuq.gaussian import interval_quantile, log_interval

__all__ = ["NEGLIGIBLE", "POINTS", "Box"]

FloatArray = NDArray[np.float64]

NEGLIGIBLE = 1e-8
"""Mass outside the bounds below which the unbounded closed form stands."""
POINTS = 512
MANY_POINTS = 16_384


@dataclass(frozen=True, eq=False)
class Box:
    """Lower and upper bounds (p,) of p jointly Gaussian parameters."""

    lower: FloatArray
    upper: FloatArray

    def mass(self, mean: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return, for N Gaussians, an upper bound on the mass outside and the log of the mass inside.

        The bound is the sum over parameters (Boole). Where it is negligible the log mass is taken from it; elsewhere
        the mass inside is computed over the parameters that come near their bounds: exactly for one, and by
        Genz's sequential conditioning on quasi-random points for more (Genz 1992, J. Comput. Graph. Stat. 1:141).
        """
        from scipy.special import logsumexp, ndtr

        sd = np.sqrt((root**2).sum(2))
        low, high = (self.lower - mean) / sd, (self.upper - mean) / sd
        by_parameter = ndtr(low) + ndtr(-high)
        outside = by_parameter.sum(1)
        log_inside = np.log1p(-np.minimum(outside, 0.5))
        active = by_parameter > 1e-3 * NEGLIGIBLE
        for pattern in np.unique(active[active.any(axis=1)], axis=0):
            crossed = np.flatnonzero((active == pattern).all(axis=1))
            kept = np.flatnonzero(pattern)
            if len(kept) == 1:
                log_inside[crossed] = log_interval(low[crossed, kept[0]], high[crossed, kept[0]])
                continue
            part = Box(self.lower[kept], self.upper[kept])
            covariance = (root[crossed] @ root[crossed].swapaxes(1, 2))[:, kept[:, None], kept]
            triangle = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
            number = max(POINTS, min(MANY_POINTS, MANY_POINTS // len(crossed)))
            log_weights, _ = part.points(mean[crossed][:, kept], triangle, number)
            log_inside[crossed] = logsumexp(log_weights, axis=1) - np.log(number)
        return outside, log_inside

    def points(self, mean: FloatArray, root: FloatArray, number: int = POINTS) -> tuple[FloatArray, FloatArray]:
        """Return log weights (N, P) and P = number points (N, P, p) inside the box: a weighted bounded Gaussian.

        The mean weight is the mass inside.
        """
        count, p = mean.shape
        triangle = np.linalg.cholesky(root @ root.swapaxes(1, 2))
        uniforms = _quasi_random(p, number)
        log_weights = np.zeros((count, len(uniforms)))
        standard = np.empty((count, len(uniforms), p))
        points = np.empty_like(standard)
        for j in range(p):
            centre = mean[:, None, j] + np.einsum("nqk,nk->nq", standard[:, :, :j], triangle[:, j, :j])
            scale = triangle[:, j, j][:, None]
            low, high = (self.lower[j] - centre) / scale, (self.upper[j] - centre) / scale
            standard[:, :, j], log_mass = interval_quantile(uniforms[:, j], low, high)
            log_weights += log_mass
            points[:, :, j] = np.clip(centre + scale * standard[:, :, j], self.lower[j], self.upper[j])
        return log_weights, points


@lru_cache
def _quasi_random(dimension: int, number: int) -> FloatArray:
    """Return a Kronecker sequence of the generalised golden ratio in the unit cube, folded by the tent map.

    The fold makes any integrand periodic, which lets the error fall faster than one over the number of points.
    """
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimension + 1))
    steps = ratio ** -np.arange(1.0, dimension + 1)
    return np.asarray(np.abs(2 * ((0.5 + np.arange(1, number + 1)[:, None] * steps) % 1.0) - 1))
