"""What each specimen's data say of the pooled parameters, its own fit's prior divided out: sums of Gaussians.

A specimen's posterior by itself is a mixture of thousands of Gaussians. On the line of the logarithms each of them is
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
from numpy.typing import NDArray

from tissuq.inference.kronecker import quasi_random
from tissuq.inference.solution import Solution
from tissuq.population.coordinates import Coordinates
from tissuq.population.mixture import Mixture, reduced
from tissuq.posterior import Posterior
from tissuq.prediction.moments import values_of

__all__ = ["Likelihoods", "likelihoods_of", "mixtures_of"]

FloatArray = NDArray[np.float64]

REFERENCE = 2.0
"""Sd of the reference on the line, at least: in logarithms, a factor of seven either way."""
BEYOND = 3.0
"""The same, as a multiple of the sd between the specimens."""
NARROW = 0.02
"""Sd over mean up to which a Gaussian is taken to be one of the logarithm, too."""
SPLIT, NODES = 64, 60
"""Wider Gaussians at most, and into how many narrow ones each is split."""
REACH = 5.0
"""Standard deviations of them that are split."""
LEAST = 1e-4
"""Where the line ends towards a modulus of zero, over the size of the modulus."""
DRAWN = 4000
"""Draws, at least, that stand for what has no extent in some direction."""
KERNEL = 0.5
"""Width of the kernel around draws over Silverman's: the clusters that they go into smooth them, too."""


@dataclass(frozen=True, eq=False)
class Likelihoods:
    """p(data | theta) of specimens, up to a factor: sum_k exp(log_factor + pull' theta - theta' precision theta / 2).

    Attributes
    ----------
    log_factor : (I, K) array
        Minus infinity where a specimen needs fewer Gaussians.
    pull : (I, K, d) array
    precision : (I, K, d, d) array
        Positive semidefinite.
    """

    log_factor: FloatArray
    pull: FloatArray
    precision: FloatArray


def mixtures_of(posteriors: Sequence[Posterior], coordinates: Coordinates) -> tuple[list[Mixture], FloatArray]:
    """Return every specimen's posterior on the line with a reference for its prior, and the reference's sd (d,)."""
    found = [_on_line(posterior.solution, coordinates) for posterior in posteriors]
    between = np.std([each.moments()[0] for each in found], axis=0)
    reference = np.hypot(REFERENCE, BEYOND * between)
    return [_under(reference, *each, coordinates) for each in zip(found, posteriors, strict=True)], reference


def likelihoods_of(mixtures: Sequence[Mixture], reference: FloatArray, most: int) -> Likelihoods:
    """Return mixtures, by at most so many Gaussians each, with the reference of sd (d,) divided out of them."""
    few = [reduced(each, most) for each in mixtures]
    count, size = max(len(each.weights) for each in few), len(reference)
    log_factor = np.full((len(few), count), -np.inf)
    pull = np.zeros((len(few), count, size))
    precision = np.zeros((len(few), count, size, size))
    for place, each in enumerate(few):
        values, vectors = np.linalg.eigh(each.covariances / np.outer(reference, reference))
        values = np.minimum(values, 1.0)  # a cluster is hardly ever wider than the reference
        sides = vectors.swapaxes(1, 2) / reference
        own, k = sides.swapaxes(1, 2) @ (sides / values[:, :, None]), len(values)
        pull[place, :k] = (own @ each.means[:, :, None])[:, :, 0]
        precision[place, :k] = sides.swapaxes(1, 2) @ (sides * (1 / values - 1)[:, :, None])
        log_size = -0.5 * np.log(values).sum(axis=1) - 0.5 * (pull[place, :k] * each.means).sum(axis=1)
        log_factor[place, :k] = np.log(each.weights) + log_size
    return Likelihoods(log_factor, pull, precision)


def _on_line(solution: Solution, coordinates: Coordinates) -> Mixture:
    """Return the posterior of one specimen as Gaussians on the line."""
    mean, root = values_of(solution.model, solution.components, coordinates.symbols)
    every = Mixture(solution.components.weights, mean, root @ root.swapaxes(1, 2))
    sd = np.linalg.norm(root, axis=2)
    is_point = (sd == 0).any(axis=1)
    is_narrow = ~is_point & (~coordinates.is_log | (sd <= NARROW * mean)).all(axis=1)
    parts = [_mapped(every[is_narrow], coordinates)]
    if (~is_narrow & ~is_point).any():
        parts.append(_split(reduced(every[~is_narrow & ~is_point], SPLIT), coordinates))
    if is_point.any():
        parts.append(_smoothed(every[is_point], coordinates))
    return Mixture(*(np.concatenate(each) for each in zip(*(vars(part).values() for part in parts), strict=True)))


def _mapped(mixture: Mixture, coordinates: Coordinates) -> Mixture:
    """Return Gaussians on the line for Gaussians of parameters that are narrow: to second order in their width."""
    slope = np.where(coordinates.is_log, 1 / np.where(coordinates.is_log, mixture.means, 1.0), 1 / coordinates.scale)
    covariances = mixture.covariances * slope[:, :, None] * slope[:, None, :]
    shift = np.where(coordinates.is_log, -0.5 * np.diagonal(covariances, axis1=1, axis2=2), 0.0)
    return Mixture(mixture.weights, coordinates.to_line(mixture.means) + shift, covariances)


def _split(mixture: Mixture, coordinates: Coordinates) -> Mixture:
    """Return Gaussians on the line for wider ones: each cut into narrow ones along its parameter of least precision.

    Where a bound does not cut them already, what lies below zero is left out.
    """
    variance = np.diagonal(mixture.covariances, axis1=1, axis2=2)
    relative = np.sqrt(variance) / np.abs(mixture.means) * coordinates.is_log
    row, along = np.arange(len(variance)), relative.argmax(axis=1)
    middle, sd = mixture.means[row, along], np.sqrt(variance[row, along])
    least = LEAST * (np.abs(middle) + sd)
    low, high = (np.log(np.maximum(middle + sign * REACH * sd, least)) for sign in (-1, 1))
    logs = low[:, None] + np.linspace(0, 1, NODES) * (high - low)[:, None]
    step = np.diff(logs[:, :2], axis=1)
    score = (np.exp(logs) - middle[:, None]) / sd[:, None]
    weights = mixture.weights[:, None] * np.exp(-0.5 * score**2 + logs) * step / (np.sqrt(2 * np.pi) * sd[:, None])
    pull = mixture.covariances[row, :, along] / sd[:, None]
    means = mixture.means[:, None] + score[:, :, None] * pull[:, None]
    own = (0.5 * step * np.exp(logs) / sd[:, None])[:, :, None, None] ** 2  # of the score, around a node
    rest = mixture.covariances - pull[:, :, None] * pull[:, None, :]
    covariances = rest[:, None] + own * (pull[:, :, None] * pull[:, None, :])[:, None]
    size = means.shape[2]
    is_inside = (np.where(coordinates.is_log, means, 1.0) > 0).all(axis=2)
    kept = Mixture(weights[is_inside], means[is_inside], covariances[is_inside].reshape(-1, size, size))
    return _mapped(kept, coordinates)


def _smoothed(mixture: Mixture, coordinates: Coordinates) -> Mixture:
    """Return draws from Gaussians with no extent in some direction, with a kernel that keeps the moments."""
    from scipy.special import ndtri

    count, size = mixture.means.shape
    each = -(-DRAWN // count)
    values, vectors = np.linalg.eigh(mixture.covariances)
    side = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    score = ndtri(quasi_random(size, count * each)).reshape(count, each, size)
    drawn = (mixture.means[:, None] + np.einsum("mdp,mep->med", side, score)).reshape(-1, size)
    is_inside = (drawn[:, coordinates.is_log] > 0).all(axis=1)
    weights, line = np.repeat(mixture.weights / each, each)[is_inside], coordinates.to_line(drawn[is_inside])
    middle, covariance = Mixture(weights, line, np.zeros((len(line), size, size))).moments()
    effective = weights.sum() ** 2 / (weights**2).sum()
    width = KERNEL * (4 / (size + 2) / effective) ** (1 / (size + 4))
    places = middle + np.sqrt(1 - width**2) * (line - middle)
    return Mixture(weights, places, np.broadcast_to(width**2 * covariance, (len(places), size, size)))


def _under(reference: FloatArray, mixture: Mixture, posterior: Posterior, coordinates: Coordinates) -> Mixture:
    """Return a posterior on the line with its prior there replaced by the reference.

    The prior on the line is that of the parameters times the slope, which is theta itself for a logarithm: both factors
    are exponentials of at most squares, so that every Gaussian stays one. The parameters' own prior is wide, and taken
    at the middle of each.
    """
    values = coordinates.from_line(mixture.means)
    priors = [posterior.model.priors[symbol] for symbol in coordinates.symbols]
    log_prior = sum(prior.log_density(column) for prior, column in zip(priors, values.T, strict=True))
    pull = -(coordinates.is_log + mixture.means / reference**2)
    own = mixture.covariances
    shrunk = own - own @ np.linalg.solve(own + np.diag(reference**2), own)
    log_size = -0.5 * np.linalg.slogdet(np.eye(len(reference)) + mixture.covariances / reference**2)[1]
    log_factor = -(mixture.means * (coordinates.is_log + 0.5 * mixture.means / reference**2)).sum(axis=1)
    log_factor += 0.5 * np.einsum("mi,mij,mj->m", pull, shrunk, pull) + log_size - log_prior
    weights = mixture.weights * np.exp(log_factor - log_factor.max())
    return Mixture(weights / weights.sum(), mixture.means + np.einsum("mij,mj->mi", shrunk, pull), shrunk)
