"""A predictive distribution: at every place a mixture of Gaussians, with its quantiles and its score."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.quasi_monte_carlo import systematic

__all__ = ["Mixtures"]

FloatArray = NDArray[np.float64]

MAX_PAIRS, MIN_COMPONENTS = 5_000_000, 200
"""Number of pairs of Gaussians, over all points, of a score; number to which a mixture is thinned at the most."""
MAX_STANDARD_SCORE = 30.0
"""Standard scores beyond which the tail of a Gaussian is nothing."""


@dataclass(frozen=True, eq=False)
class Mixtures:
    """Mixtures of M Gaussians at g places, their weights the same at all of them.

    Attributes
    ----------
    weights : (M,) array
        Non-negative, sum one.
    means : (M, g) array
    variances : (M, g) array
    """

    weights: FloatArray
    means: FloatArray
    variances: FloatArray

    @property
    def mean(self) -> FloatArray:
        """The mean (g,) at every place."""
        return np.asarray(self.weights @ self.means)

    def quantile(self, probability: float) -> FloatArray:
        """Return the quantile (g,) at every place, by safeguarded Newton iteration."""
        from scipy.special import ndtr, ndtri

        mean, centre = self.means, self.mean
        spread = np.sqrt(self.weights @ (self.variances + (mean - centre) ** 2))
        sd = np.sqrt(np.maximum(self.variances, (0.01 * spread) ** 2))
        sd = np.maximum(sd, 1e-300)
        low, high = (mean - 10 * sd).min(axis=0), (mean + 10 * sd).max(axis=0)
        value = np.clip(centre + ndtri(probability) * spread, low, high)
        for _ in range(60):
            scores = (value - mean) / sd
            excess = self.weights @ ndtr(scores) - probability
            if np.abs(excess).max() < 1e-9:
                break
            low, high = np.where(excess < 0, value, low), np.where(excess < 0, high, value)
            density = self.weights @ (np.exp(-0.5 * scores**2) / sd) / np.sqrt(2 * np.pi)
            step = value - excess / np.maximum(density, 1e-300)
            value = np.where(
                (step >= low) & (step <= high), step, 0.5 * (low + high)
            )  # at an end where it has converged
        return np.where(spread > 0, value, centre)

    def crps(self, values: FloatArray) -> FloatArray:
        """Return the continuous ranked probability score (g,) of a value at every place, in its unit; small is good.

        The integral of (F(x) - [y <= x])^2, which is E|X - y| - E|X - X'| / 2 with X and X' independent of F. A
        difference of Gaussians is Gaussian, and E|N(m, v)| = m (2 Phi(m / s) - 1) + 2 s phi(m / s) with s^2 = v, so
        that the score of a mixture is a sum over its Gaussians less one over their pairs. Where places are many,
        few Gaussians stand for all.

        References
        ----------
        Grimit, Gneiting, Berrocal & Johnson (2006), Quarterly Journal of the Royal Meteorological Society 132,
        2925-2942 (mixtures); Gneiting & Raftery (2007), Journal of the American Statistical Association 102, 359-378.
        """
        thinned = self._thinned(max(MIN_COMPONENTS, int(np.sqrt(2 * MAX_PAIRS / len(values)))))
        i, j = np.triu_indices(len(thinned.weights), 1)
        pairs, squares = thinned.weights[i] * thinned.weights[j], thinned.weights**2
        scores = thinned.weights @ _mean_distance(thinned.means - values, thinned.variances)
        for index, (mean, variance) in enumerate(zip(thinned.means.T, thinned.variances.T, strict=True)):
            distance = pairs @ _mean_distance(mean[i] - mean[j], variance[i] + variance[j])
            scores[index] -= distance + squares @ np.sqrt(variance / np.pi)  # one Gaussian: E|X - X'| = 2 s / sqrt(pi)
        return np.asarray(scores)

    def _thinned(self, count: int) -> Mixtures:
        if len(self.weights) <= count:
            return self
        selected = systematic(self.weights[None], count)[0]
        return Mixtures(np.full(count, 1 / count), self.means[selected], self.variances[selected])


def _mean_distance(mean: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the mean distance from zero of Gaussians."""
    from scipy.special import erf

    sd = np.maximum(np.sqrt(variance), 1e-300)
    scores = np.clip(mean / sd / np.sqrt(2), -MAX_STANDARD_SCORE, MAX_STANDARD_SCORE)
    return np.asarray(mean * erf(scores) + sd * np.sqrt(2 / np.pi) * np.exp(-(scores**2)))
