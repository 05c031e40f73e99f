"""The likelihood of each specimen's pooled parameters, as a sum of Gaussians in coordinates in which it is smooth.

A specimen's separate posterior is a mixture of thousands of Gaussians. On the line of the logarithms each of them is
still nearly one, as long as it is much narrower than its mean is large; wider ones are split. Few Gaussians then stand
for all (`mixture`).

A likelihood need not fall off: where a modulus may be zero, it is level towards minus infinity on the line. So the
mixture is that of the posterior under a wide Gaussian reference that all specimens share, and the reference is divided
out of every Gaussian, which may leave one level in a direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.assessment.modulus import positive_symbols
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.quasi_monte_carlo import quasi_random
from tissuq.inference.solution import Solution
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.moments import values_of

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
) -> IndexArray:
    """Return first clusters: by size and distance from the middle, on either side of it, finer towards the ends."""
    from scipy.special import ndtr

    size = (whitened_means**2).sum(axis=1) + np.trace(whitened_covariances, axis1=1, axis2=2)
    order = np.argsort(np.where(whitened_means[:, 0] < 0, -size, size), kind="stable")
    cumulative = np.empty(len(order))
    cumulative[order] = np.cumsum(weights[order]) - 0.5 * weights[order]
    edges = ndtr(np.linspace(-EDGE_SD, EDGE_SD, count + 1)[1:-1])
    return np.asarray(np.searchsorted(edges, cumulative / weights.sum(), side="right"), dtype=np.intp)


MIN_REFERENCE_SD = 2.0
"""Smallest sd of the reference on the line; of a logarithm it is a factor of seven either way."""
REFERENCE_SD_RATIO = 3.0
"""Sd of the reference over the sd between the specimens."""
MAX_NARROW_RATIO = 0.02
"""Largest sd over mean of a Gaussian whose logarithm is taken to be Gaussian, too."""
MAX_WIDE_COMPONENTS, NODES_PER_COMPONENT = 64, 60
"""Largest number of wider Gaussians, and the number of narrow ones into which each is split."""
SPLIT_SD = 5.0
"""Half-width of the split range, in standard deviations."""
MIN_MODULUS_RATIO = 1e-4
"""Smallest modulus on the line, over the size of the modulus."""
MIN_DRAWS = 4000
"""Smallest number of draws that represent Gaussians without extent in some direction."""
KERNEL_WIDTH_RATIO = 0.5
"""Width of the kernel around draws over Silverman's, because their clusters smooth them, too."""


@dataclass(frozen=True, eq=False)
class Likelihoods:
    """p(data | theta) of specimens, up to a factor: sum_k exp(log_factor + pull' theta - theta' precision theta / 2).

    Attributes
    ----------
    log_factor : (I, K) array
        Logarithms of the factors; minus infinity where a specimen needs fewer Gaussians.
    pull : (I, K, d) array
    precision : (I, K, d, d) array
        Positive semidefinite precision matrices.
    """

    log_factor: FloatArray
    pull: FloatArray
    precision: FloatArray


def mixtures_of(posteriors: Sequence[Posterior], coordinates: Coordinates) -> tuple[list[GaussianMixture], FloatArray]:
    """Return every specimen's posterior on the line with a reference for its prior, and the reference's sd (d,)."""
    solutions = [posterior.solution for posterior in posteriors]
    mixtures = [_with_common_error(on_line(solution, coordinates), solution, coordinates) for solution in solutions]
    between = np.std([mixture.moments()[0] for mixture in mixtures], axis=0)
    reference = np.hypot(MIN_REFERENCE_SD, REFERENCE_SD_RATIO * between)
    return [_under(reference, *mixture, coordinates) for mixture in zip(mixtures, posteriors, strict=True)], reference


def likelihoods_of(mixtures: Sequence[GaussianMixture], reference: FloatArray, max_components: int) -> Likelihoods:
    """Return mixtures, by at most so many Gaussians each, with the reference of sd (d,) divided out of them."""
    reduced_mixtures = [reduced(mixture, max_components) for mixture in mixtures]
    count, size = max(len(mixture.weights) for mixture in reduced_mixtures), len(reference)
    log_factor = np.full((len(reduced_mixtures), count), -np.inf)
    pull = np.zeros((len(reduced_mixtures), count, size))
    precision = np.zeros((len(reduced_mixtures), count, size, size))
    for index, mixture in enumerate(reduced_mixtures):
        values, vectors = np.linalg.eigh(mixture.covariance / np.outer(reference, reference))
        values = np.minimum(values, 1.0)  # a cluster is hardly ever wider than the reference
        sides = vectors.swapaxes(1, 2) / reference
        covariance, k = sides.swapaxes(1, 2) @ (sides / values[:, :, None]), len(values)
        pull[index, :k] = (covariance @ mixture.mean[:, :, None])[:, :, 0]
        precision[index, :k] = sides.swapaxes(1, 2) @ (sides * (1 / values - 1)[:, :, None])
        log_size = -0.5 * np.log(values).sum(axis=1) - 0.5 * (pull[index, :k] * mixture.mean).sum(axis=1)
        log_factor[index, :k] = np.log(mixture.weights) + log_size
    return Likelihoods(log_factor, pull, precision)


def on_line(solution: Solution, coordinates: Coordinates) -> GaussianMixture:
    """Return the posterior of one specimen as Gaussians on the line, without what errors of stress have in common."""
    mean, root = values_of(solution.model, solution.mixture, coordinates.symbols)
    mixture = GaussianMixture.of_covariances(solution.mixture.weights, mean, root @ root.swapaxes(1, 2))
    sd = np.linalg.norm(root, axis=2)
    is_point = (sd == 0).any(axis=1)
    is_narrow = ~is_point & (~coordinates.is_log | (sd <= MAX_NARROW_RATIO * mean)).all(axis=1)
    pieces = [_mapped(mixture[is_narrow], coordinates)]
    if (~is_narrow & ~is_point).any():
        pieces.append(_split(reduced(mixture[~is_narrow & ~is_point], MAX_WIDE_COMPONENTS), coordinates))
    if is_point.any():
        pieces.append(_smoothed(mixture[is_point], coordinates))
    return GaussianMixture.of_all(pieces)


def _with_common_error(mixture: GaussianMixture, solution: Solution, coordinates: Coordinates) -> GaussianMixture:
    """Return Gaussians on the line with the error that all stresses of a specimen share, to first order.

    It widens the likelihood, which is the posterior over the slope of its prior on the line (`_under`): so the
    posterior moves by as much as this slope pulls at what is added.
    """
    error, columns = solution.model.common_error, solution.model.column_symbols
    if not error:
        return mixture
    along = np.where(coordinates.is_log, 1.0, mixture.mean + coordinates.centre)
    along = error * along * np.isin(coordinates.symbols, columns)
    covariance = mixture.covariance + along[:, :, None] * along[:, None, :]
    pulled = along @ coordinates.is_log
    weights = mixture.weights * np.exp(0.5 * pulled**2)
    return GaussianMixture.of_covariances(weights, mixture.mean + pulled[:, None] * along, covariance)


def _mapped(mixture: GaussianMixture, coordinates: Coordinates) -> GaussianMixture:
    """Return Gaussians on the line for Gaussians of parameters that are narrow: to second order in their width."""
    slope = np.where(coordinates.is_log, 1 / np.where(coordinates.is_log, mixture.mean, 1.0), 1 / coordinates.scale)
    covariances = mixture.covariance * slope[:, :, None] * slope[:, None, :]
    shift = np.where(coordinates.is_log, -0.5 * np.diagonal(covariances, axis1=1, axis2=2), 0.0)
    return GaussianMixture.of_covariances(mixture.weights, coordinates.to_line(mixture.mean) + shift, covariances)


def _split(mixture: GaussianMixture, coordinates: Coordinates) -> GaussianMixture:
    """Return Gaussians on the line for wider ones: each cut into narrow ones along its parameter of least precision.

    Where a bound does not cut them already, what lies below zero is left out.
    """
    variance = np.diagonal(mixture.covariance, axis1=1, axis2=2)
    relative = np.sqrt(variance) / np.abs(mixture.mean) * coordinates.is_log
    row, along = np.arange(len(variance)), relative.argmax(axis=1)
    centre, sd = mixture.mean[row, along], np.sqrt(variance[row, along])
    smallest_modulus = MIN_MODULUS_RATIO * (np.abs(centre) + sd)
    low, high = (np.log(np.maximum(centre + sign * SPLIT_SD * sd, smallest_modulus)) for sign in (-1, 1))
    logs = low[:, None] + np.linspace(0, 1, NODES_PER_COMPONENT) * (high - low)[:, None]
    step = np.diff(logs[:, :2], axis=1)
    score = (np.exp(logs) - centre[:, None]) / sd[:, None]
    weights = mixture.weights[:, None] * np.exp(-0.5 * score**2 + logs) * step / (np.sqrt(2 * np.pi) * sd[:, None])
    pull = mixture.covariance[row, :, along] / sd[:, None]
    means = mixture.mean[:, None] + score[:, :, None] * pull[:, None]
    node_variance = (0.5 * step * np.exp(logs) / sd[:, None])[:, :, None, None] ** 2  # of the score, around a node
    conditional_covariance = mixture.covariance - pull[:, :, None] * pull[:, None, :]
    covariances = conditional_covariance[:, None] + node_variance * (pull[:, :, None] * pull[:, None, :])[:, None]
    size = means.shape[2]
    is_inside = (np.where(coordinates.is_log, means, 1.0) > 0).all(axis=2)
    positive = GaussianMixture.of_covariances(
        weights[is_inside], means[is_inside], covariances[is_inside].reshape(-1, size, size)
    )
    return _mapped(positive, coordinates)


def _smoothed(mixture: GaussianMixture, coordinates: Coordinates) -> GaussianMixture:
    """Return draws from Gaussians with no extent in some direction, with a kernel that keeps the moments."""
    from scipy.special import ndtri

    count, size = mixture.mean.shape
    draws_per_component = -(-MIN_DRAWS // count)
    values, vectors = np.linalg.eigh(mixture.covariance)
    side = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    score = ndtri(quasi_random(size, count * draws_per_component)).reshape(count, draws_per_component, size)
    draws = (mixture.mean[:, None] + np.einsum("mdp,mep->med", side, score)).reshape(-1, size)
    is_inside = (draws[:, coordinates.is_log] > 0).all(axis=1)
    weights, line = (
        np.repeat(mixture.weights / draws_per_component, draws_per_component)[is_inside],
        coordinates.to_line(draws[is_inside]),
    )
    centre, covariance = GaussianMixture.of_points(np.zeros((len(line), 0)), line).weighted(weights).moments()
    effective = weights.sum() ** 2 / (weights**2).sum()
    width = KERNEL_WIDTH_RATIO * (4 / (size + 2) / effective) ** (1 / (size + 4))
    points = centre + np.sqrt(1 - width**2) * (line - centre)
    return GaussianMixture.of_covariances(
        weights, points, np.broadcast_to(width**2 * covariance, (len(points), size, size))
    )


def _under(
    reference: FloatArray, mixture: GaussianMixture, posterior: Posterior, coordinates: Coordinates
) -> GaussianMixture:
    """Return a posterior on the line with its prior there replaced by the reference.

    The prior on the line is that of the parameters times the slope, which is theta itself for a logarithm: both factors
    are exponentials of at most squares, so that every Gaussian stays one. The parameters' own prior is wide, and taken
    at the middle of each.
    """
    values = coordinates.from_line(mixture.mean)
    priors = [posterior.model.priors[symbol] for symbol in coordinates.symbols]
    log_prior = sum(prior.log_density(column) for prior, column in zip(priors, values.T, strict=True))
    pull = -(coordinates.is_log + mixture.mean / reference**2)
    covariances = mixture.covariance
    shrunk = covariances - covariances @ np.linalg.solve(covariances + np.diag(reference**2), covariances)
    log_size = -0.5 * np.linalg.slogdet(np.eye(len(reference)) + mixture.covariance / reference**2)[1]
    log_factor = -(mixture.mean * (coordinates.is_log + 0.5 * mixture.mean / reference**2)).sum(axis=1)
    log_factor += 0.5 * np.einsum("mi,mij,mj->m", pull, shrunk, pull) + log_size - log_prior
    weights = mixture.weights * np.exp(log_factor - log_factor.max())
    return GaussianMixture.of_covariances(
        weights / weights.sum(), mixture.mean + np.einsum("mij,mj->mi", shrunk, pull), shrunk
    )


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The map from the pooled parameters to a line on which specimens are Gaussian.

    A positive parameter is mapped to its logarithm, because moduli differ between specimens by factors. A parameter of
    either sign (C20, C01, an exponent) is divided by its typical size, so that its spread is an absolute one.

    Attributes
    ----------
    symbols : tuple of str
        The pooled parameters.
    is_log : (d,) array of bool
    scale : (d,) array
        Size of a unit of the line for parameters that are not logarithms; one for the others.
    centre : (d,) array
        Origin of the line: the median of the specimens.
    """

    symbols: tuple[str, ...]
    is_log: BoolArray
    scale: FloatArray
    centre: FloatArray

    def to_line(self, values: FloatArray) -> FloatArray:
        """Return places (..., d) on the line for parameters (..., d); minus infinity for a modulus of zero."""
        with np.errstate(divide="ignore"):
            logs = np.log(np.where(self.is_log, np.maximum(values, 0.0), 1.0))
        return np.asarray(np.where(self.is_log, logs, values / self.scale) - self.centre)

    def from_line(self, line_values: FloatArray) -> FloatArray:
        """Return parameters (..., d) for places (..., d) on the line."""
        line = line_values + self.centre
        return np.asarray(np.where(self.is_log, np.exp(np.where(self.is_log, line, 0.0)), line * self.scale))


def coordinates_of(posteriors: Sequence[Posterior], symbols: Sequence[str]) -> Coordinates:
    """Return the coordinates of pooled parameters, with origin and scale from the specimens' separate fits."""
    is_log = np.isin(symbols, positive_symbols(posteriors[0].model))
    medians = np.array([[float(p.marginals[s].quantile(0.5)) for s in symbols] for p in posteriors])
    sizes = np.array([[np.hypot(p.marginals[s].mean, p.marginals[s].sd) for s in symbols] for p in posteriors])
    scale = np.where(is_log, 1.0, np.median(sizes, axis=0))
    start = Coordinates(tuple(symbols), is_log, scale, np.zeros(len(symbols)))
    return Coordinates(tuple(symbols), is_log, scale, np.median(start.to_line(medians), axis=0))
