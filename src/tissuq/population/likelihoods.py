"""What each specimen's data say of the pooled parameters, its own fit's prior divided out: sums of Gaussians.

A specimen's posterior by itself is a mixture of thousands of Gaussians. On the line of the logarithms each of them is
still nearly one, as long as it is much narrower than its mean is large; wider ones are replaced by draws. Few Gaussians
then stand for all (`mixture`).

A likelihood need not fall off: where a modulus may be zero, it is level towards minus infinity on the line. So the
mixture is that of the posterior under a wide Gaussian reference that all specimens share, and the reference is divided
out of every Gaussian, which may leave one level in a direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.box import quasi_random
from tissuq.inference.solution import Solution
from tissuq.population.coordinates import Coordinates, values_of
from tissuq.population.mixture import Mixture, reduced
from tissuq.posterior import Posterior

__all__ = ["Likelihoods", "likelihoods_of", "mixtures_of"]

FloatArray = NDArray[np.float64]

REFERENCE = 2.0
"""Sd of the reference on the line, at least: in logarithms, a factor of seven either way."""
BEYOND = 3.0
"""The same, as a multiple of the sd between the specimens."""
NARROW = 0.1
"""Sd over mean up to which a Gaussian is taken to be one of the logarithm, too."""
DRAWN = 4000
"""Draws, at least, that stand for wider ones."""
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
    parts, is_log = solution.components, coordinates.is_log
    mean, root = values_of(solution.model, parts, coordinates.symbols)
    sd = np.linalg.norm(root, axis=2)
    is_narrow = ((sd > 0) & (~is_log | (sd <= NARROW * mean))).all(axis=1)
    slope = np.where(is_log, 1 / np.where(is_log, mean[is_narrow], 1.0), 1 / coordinates.scale)
    side = root[is_narrow] * slope[:, :, None]
    middle = coordinates.to_line(mean[is_narrow]) - np.where(is_log, 0.5 * (sd[is_narrow] * slope) ** 2, 0.0)
    narrow = Mixture(parts.weights[is_narrow], middle, side @ side.swapaxes(1, 2))
    if is_narrow.all():
        return narrow
    wide = _smoothed(parts.weights[~is_narrow], mean[~is_narrow], root[~is_narrow], coordinates)
    pairs = zip(vars(narrow).values(), vars(wide).values(), strict=True)
    return Mixture(*(np.concatenate(pair) for pair in pairs))


def _smoothed(weights: FloatArray, mean: FloatArray, root: FloatArray, coordinates: Coordinates) -> Mixture:
    """Return draws from Gaussians (M,) with a Gaussian kernel on the line that keeps the moments of all."""
    from scipy.special import ndtri

    each = -(-DRAWN // len(weights))
    values, vectors = np.linalg.eigh(root @ root.swapaxes(1, 2))
    side = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    score = ndtri(quasi_random(mean.shape[1], len(weights) * each)).reshape(len(weights), each, -1)
    values = (mean[:, None] + np.einsum("mdp,mep->med", side, score)).reshape(-1, mean.shape[1])
    weights = np.repeat(weights / each, each)
    is_inside = (values[:, coordinates.is_log] > 0).all(axis=1)
    weights, values = weights[is_inside], values[is_inside]
    size, line = mean.shape[1], coordinates.to_line(values)
    middle, covariance = Mixture(weights, line, np.zeros((len(line), size, size))).moments()
    count = weights.sum() ** 2 / (weights**2).sum()
    width = KERNEL * (4 / (size + 2) / count) ** (1 / (size + 4))
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
