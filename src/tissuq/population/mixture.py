"""Mixtures of Gaussians, and few Gaussians that stand for many: clusters by Kullback-Leibler divergence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mixture", "reduced"]

FloatArray = NDArray[np.float64]

STEPS = 30
REACH = 3.3
"""Standard deviations of a normal distribution over which the first clusters are even: tails get their own."""
LEAST = 1e-6
"""Of the variance of the whole, that a cluster keeps in every direction."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """M Gaussians with weights (M,), means (M, d) and covariances (M, d, d), which may be zero: points."""

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    def __getitem__(self, chosen: NDArray[Any]) -> Mixture:
        return Mixture(self.weights[chosen], self.means[chosen], self.covariances[chosen])

    def moments(self) -> tuple[FloatArray, FloatArray]:
        """Return the mean (d,) and the covariance (d, d) of the whole."""
        weights = self.weights / self.weights.sum()
        mean = weights @ self.means
        away = self.means - mean
        return mean, (away.T * weights) @ away + np.einsum("m,mij->ij", weights, self.covariances)


def reduced(mixture: Mixture, count: int) -> Mixture:
    """Return at most ``count`` Gaussians with the moments of the clusters that they stand for.

    The Gaussians of a posterior differ in scale as much as in place: they start sorted by size, and every one then goes
    to the cluster from which it diverges least, until none moves. Whole Gaussians are moved, so that nothing is drawn.

    References
    ----------
    Davis & Dhillon (2006), Differential entropic clustering of multivariate Gaussians, NIPS 19.

    Examples
    --------
    >>> places = np.array([[0.0], [0.1], [5.0], [5.1]])
    >>> few = reduced(Mixture(np.ones(4), places, np.full((4, 1, 1), 0.01)), 2)
    >>> sorted(few.means.round(3).ravel().tolist())
    [0.05, 5.05]
    """
    mean, covariance = mixture.moments()
    size = len(mean)
    sides = np.sqrt(np.diag(covariance)) + 1e-300
    root = sides[:, None] * np.linalg.cholesky(covariance / np.outer(sides, sides) + 1e-12 * np.eye(size))
    inverse = np.linalg.inv(root)
    places, own = (mixture.means - mean) @ inverse.T, inverse @ mixture.covariances @ inverse.T
    squares = (places[:, :, None] * places[:, None, :] + own).reshape(len(places), -1)
    features = np.hstack([np.ones((len(places), 1)), places, squares])
    cluster = _first(places, own, mixture.weights, count)
    for _ in range(STEPS):
        used, cluster = np.unique(cluster, return_inverse=True)
        cluster = cluster.ravel()
        moments = np.zeros((len(used), features.shape[1]))
        np.add.at(moments, cluster, mixture.weights[:, None] * features)
        total, means = moments[:, 0], moments[:, 1 : 1 + size] / moments[:, :1]
        second = (moments[:, 1 + size :] / moments[:, :1]).reshape(-1, size, size)
        covariances = second - means[:, :, None] * means[:, None, :] + LEAST * np.eye(size)
        precision = np.linalg.inv(covariances)
        pull = (precision @ means[:, :, None])[:, :, 0]
        constant = 0.5 * np.linalg.slogdet(precision)[1] - 0.5 * (pull * means).sum(axis=1)
        factors = np.hstack([constant[:, None], pull, -0.5 * precision.reshape(len(used), -1)])
        before, cluster = cluster, np.argmax(features @ factors.T, axis=1)
        if (cluster == before).all():
            break
    return Mixture(total, mean + means @ root.T, root @ covariances @ root.T)


def _first(places: FloatArray, own: FloatArray, weights: FloatArray, count: int) -> NDArray[np.intp]:
    """Return first clusters: by size and distance from the middle, on either side of it, finer towards the ends."""
    from scipy.special import ndtr

    size = (places**2).sum(axis=1) + np.trace(own, axis1=1, axis2=2)
    order = np.argsort(np.where(places[:, 0] < 0, -size, size), kind="stable")
    below = np.empty(len(order))
    below[order] = np.cumsum(weights[order]) - 0.5 * weights[order]
    edges = ndtr(np.linspace(-REACH, REACH, count + 1)[1:-1])
    return np.asarray(np.searchsorted(edges, below / weights.sum(), side="right"), dtype=np.intp)
