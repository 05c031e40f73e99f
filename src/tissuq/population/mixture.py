"""Mixtures of Gaussians, and their reduction to a few Gaussians: clusters by Kullback-Leibler divergence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.gaussian_mixture import GaussianMixture

__all__ = ["reduced"]

FloatArray = NDArray[np.float64]

MAX_STEPS = 30
EDGE_SD = 3.3
"""Standard deviations over which the initial clusters are even, so that tails get clusters of their own."""
MIN_VARIANCE_SHARE = 1e-6
"""Smallest variance of a cluster in any direction, as a share of the variance of the mixture."""


def reduced(mixture: GaussianMixture, count: int) -> GaussianMixture:
    """Return at most ``count`` Gaussians with the moments of the clusters that they represent.

    The Gaussians of a posterior differ in scale as much as in place: they start sorted by size, and every one then goes
    to the cluster from which it diverges least, until none moves. Whole Gaussians are moved, so that nothing is drawn.

    References
    ----------
    Davis & Dhillon (2006), Differential entropic clustering of multivariate Gaussians, NIPS 19.

    Examples
    --------
    >>> places = np.array([[0.0], [0.1], [5.0], [5.1]])
    >>> few = reduced(GaussianMixture.of_covariances(np.ones(4), places, np.full((4, 1, 1), 0.01)), 2)
    >>> sorted(few.mean.round(3).ravel().tolist())
    [0.05, 5.05]
    """
    mean, covariance = mixture.moments()
    size = len(mean)
    sides = np.sqrt(np.diag(covariance)) + 1e-300
    root = sides[:, None] * np.linalg.cholesky(covariance / np.outer(sides, sides) + 1e-12 * np.eye(size))
    inverse = np.linalg.inv(root)
    whitened_means, whitened_covariances = (mixture.mean - mean) @ inverse.T, inverse @ mixture.covariance @ inverse.T
    squares = (whitened_means[:, :, None] * whitened_means[:, None, :] + whitened_covariances).reshape(
        len(whitened_means), -1
    )
    features = np.hstack([np.ones((len(whitened_means), 1)), whitened_means, squares])
    cluster = _initial_clusters(whitened_means, whitened_covariances, mixture.weights, count)
    for _ in range(MAX_STEPS):
        used, cluster = np.unique(cluster, return_inverse=True)
        cluster = cluster.ravel()
        moments = np.zeros((len(used), features.shape[1]))
        np.add.at(moments, cluster, mixture.weights[:, None] * features)
        total, means = moments[:, 0], moments[:, 1 : 1 + size] / moments[:, :1]
        second_moments = (moments[:, 1 + size :] / moments[:, :1]).reshape(-1, size, size)
        covariances = second_moments - means[:, :, None] * means[:, None, :] + MIN_VARIANCE_SHARE * np.eye(size)
        precision = np.linalg.inv(covariances)
        pull = (precision @ means[:, :, None])[:, :, 0]
        constant = 0.5 * np.linalg.slogdet(precision)[1] - 0.5 * (pull * means).sum(axis=1)
        factors = np.hstack([constant[:, None], pull, -0.5 * precision.reshape(len(used), -1)])
        previous, cluster = cluster, np.argmax(features @ factors.T, axis=1)
        if (cluster == previous).all():
            break
    return GaussianMixture.of_covariances(total, mean + means @ root.T, root @ covariances @ root.T)


def _initial_clusters(
    whitened_means: FloatArray, whitened_covariances: FloatArray, weights: FloatArray, count: int
) -> NDArray[np.intp]:
    """Return first clusters: by size and distance from the middle, on either side of it, finer towards the ends."""
    from scipy.special import ndtr

    size = (whitened_means**2).sum(axis=1) + np.trace(whitened_covariances, axis1=1, axis2=2)
    order = np.argsort(np.where(whitened_means[:, 0] < 0, -size, size), kind="stable")
    cumulative = np.empty(len(order))
    cumulative[order] = np.cumsum(weights[order]) - 0.5 * weights[order]
    edges = ndtr(np.linspace(-EDGE_SD, EDGE_SD, count + 1)[1:-1])
    return np.asarray(np.searchsorted(edges, cumulative / weights.sum(), side="right"), dtype=np.intp)
