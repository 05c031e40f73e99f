"""Points weighted by a density, whose proposals are adapted to it round by round: t distributions or mixtures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import lgamma, log, pi
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.quasi_monte_carlo import LOG_OF_NOTHING, effective, even_points, log_normal, systematic

DEGREES_OF_FREEDOM = 5.0
"""Of the t distribution: its tails are heavier than those of a posterior."""
WIDE_SHARE = 0.1
"""Share of the proposal that stays as wide as the prior, so that no weight is without bound there."""
COMPONENTS, FITTED_POINTS, FIT_STEPS = 4, 1024, 12
"""Gaussians of a mixture, points to which they are fitted, and the steps of the fit."""
WIDENED = 2.25
"""Volume of a proposal over that of its Gaussian, so that the ends of a bent ridge, not yet met, are not left out."""
MAX_ROUNDS, MAX_SEARCHES = 15, 4
MAX_CHANGE = 0.15
"""Of the logarithm of the mass, in the last round."""
MIN_EFFECTIVE_SHARE = 0.3
"""Share of a round's points that must be effective for the adaptation to end."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of t distributions along some axes, with mean (d,) and root (d, d), and the standard normal."""

    mean: FloatArray
    root: FloatArray

    @classmethod
    def of(cls, points: FloatArray, weights: FloatArray) -> Proposal:
        """Return one with the mean and the covariance of points (N, d) with weights (N,), which sum to one."""
        mean = weights @ points
        centred = points - mean
        return cls.of_covariance(mean, (weights[:, None] * centred).T @ centred)

    @classmethod
    def of_covariance(cls, mean: FloatArray, covariance: FloatArray) -> Proposal:
        """Return one with a mean (d,) and a covariance (d, d), no narrower than a millionth along any axis."""
        root = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(mean)))
        return cls(mean, np.asarray(root, dtype=np.float64))

    def points(self, uniforms: FloatArray) -> FloatArray:
        """Return the points (N, d) to which evenly spread points (N, d) of the unit cube lead."""
        from scipy.special import ndtri, stdtrit

        wide = np.arange(len(uniforms)) % round(1 / WIDE_SHARE) == round(0.5 / WIDE_SHARE)
        heavy = self.mean + stdtrit(DEGREES_OF_FREEDOM, uniforms) @ self.root.T
        return np.asarray(np.where(wide[:, None], ndtri(uniforms), heavy))

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the log density (N,) at points (N, d)."""
        score = np.linalg.solve(self.root, (points - self.mean).T)
        half, half_more = 0.5 * DEGREES_OF_FREEDOM, 0.5 * (DEGREES_OF_FREEDOM + 1)
        log_height = lgamma(half_more) - lgamma(half) - 0.5 * log(DEGREES_OF_FREEDOM * pi)
        heavy = (log_height - half_more * np.log1p(score**2 / DEGREES_OF_FREEDOM)).sum(axis=0)
        heavy = heavy - np.log(np.abs(np.diag(self.root))).sum()
        return np.asarray(np.logaddexp(log(1 - WIDE_SHARE) + heavy, log(WIDE_SHARE) + log_normal(points)))


Mixture = Sequence[tuple[float, Proposal]]
"""Proposals with their shares, which sum to one."""


class WeightedPoints(NamedTuple):
    """Points (N, d) with log weights (N,), the density over what proposed all; of the last round also over its own."""

    points: FloatArray
    log_weights: FloatArray
    log_weights_of_round: FloatArray

    @property
    def log_mass(self) -> float:
        """The logarithm of the integral of the density."""
        return float(np.logaddexp.reduce(self.log_weights)) - log(len(self.points))

    @property
    def weights(self) -> FloatArray:
        """The weights (N,), which sum to one."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return np.asarray(weights / weights.sum())

    @property
    def effective(self) -> float:
        """The effective number of points."""
        return effective(self.log_weights)

    @property
    def relative_error(self) -> float:
        """The standard error of the mass, over it."""
        return float(np.sqrt(max(1 / self.effective - 1 / len(self.points), 0.0)))


def weighted_points(
    log_density: Callable[[FloatArray], FloatArray],
    starts: Sequence[Mixture],
    rounds: Iterable[FloatArray],
    fit: Callable[[FloatArray, FloatArray], Mixture],
) -> Iterator[WeightedPoints]:
    """Yield weighted points, after every round.

    The first rounds are proposed by the ``starts``, each later one by what is fitted to all points so far. All points
    are weighted by the mixture of all proposals so far (Cornuet et al. 2012); for a fit they count by the largest power
    at most one of their weights that leaves enough of them effective.

    Parameters
    ----------
    log_density : callable
        Near the standard normal or much narrower, (N,) at points (N, d).
    starts : sequence of Mixture
    rounds : iterable of (n, d) array
        Evenly spread points of the unit cube, of each round the same number.
    fit : callable
        `fitted_proposal`, or `fitted_mixture` for densities with several peaks or bent ridges.
    """
    dimension = len(starts[0][0][1].mean)
    proposals = list[tuple[float, Proposal]]()
    points, heights, mixture, log_weights = np.zeros((0, dimension)), np.zeros(0), np.zeros(0), np.zeros(0)
    for number, uniforms in enumerate(rounds):
        of_round, count = starts[number] if number < len(starts) else fit(points, log_weights), len(uniforms)
        ends = np.round(np.cumsum([share for share, _ in of_round]) * count).astype(int)
        parts = zip(of_round, np.split(uniforms, ends[:-1]), strict=True)
        blocks = [(proposal, block) for (_, proposal), block in parts if len(block)]
        new = np.concatenate([proposal.points(block) for proposal, block in blocks])
        more = [(len(block) / count, proposal) for proposal, block in blocks]
        log_proposed = _log_mixture(more, new)
        mixture = np.concatenate([
            np.logaddexp(mixture, _log_mixture(more, points)), np.logaddexp(_log_mixture(proposals, new), log_proposed)
        ])  # fmt: skip
        proposals += more
        points, heights = np.concatenate([points, new]), np.concatenate([heights, log_density(new)])
        log_weights = _log_ratio(heights, mixture - np.log(number + 1))
        yield WeightedPoints(points, log_weights, _log_ratio(heights[-count:], log_proposed))


def fitted_proposal(points: FloatArray, log_weights: FloatArray) -> Mixture:
    """Return one proposal with the mean and the covariance of points (N, d) with log weights (N,)."""
    return [(1.0, Proposal.of(points, _tempered(log_weights, _least_effective(points.shape[1]))))]


def fitted_mixture(points: FloatArray, log_weights: FloatArray) -> Mixture:
    """Return a mixture whose Gaussians are fitted to points (N, d) with log weights (N,).

    The fit starts at slices of equal weight along one coordinate after the other.
    """
    weights = _tempered(log_weights, COMPONENTS * _least_effective(points.shape[1]))
    points = points[systematic(weights[None], FITTED_POINTS)[0]]
    points = points + 1e-6 * points.std(axis=0) * np.random.default_rng(0).standard_normal(points.shape)
    fits = []
    for axis in range(points.shape[1]):
        slices = np.argsort(np.argsort(points[:, axis])) * COMPONENTS // FITTED_POINTS
        shares = np.eye(COMPONENTS)[:, slices]
        for _ in range(FIT_STEPS):
            gaussians = [Proposal.of(points, share / share.sum()) for share in shares]
            heights = np.array([
                np.log(share.mean()) + _log_gaussian(gaussian, points)
                for share, gaussian in zip(shares, gaussians, strict=True)
            ])  # fmt: skip
            total = np.logaddexp.reduce(heights, axis=0)
            shares = np.maximum(np.exp(heights - total), 1e-3)
            shares /= shares.sum(axis=0)
        parts = [(float(share.mean()), Proposal.of(points, share / share.sum())) for share in shares]
        fits.append((float(total.mean()), parts))
    widths = WIDENED ** (1 / points.shape[1])
    _, mixture = max(fits, key=lambda fit: fit[0])
    return [(share, Proposal(gaussian.mean, widths * gaussian.root)) for share, gaussian in mixture]


def _log_mixture(proposals: Mixture, points: FloatArray) -> FloatArray:
    """Return the logarithm (N,) of the sum of proposals, times their shares, at points (N, d)."""
    heights = [np.log(share) + proposal.log_density(points) for share, proposal in proposals]
    return np.asarray(np.logaddexp.reduce(heights, axis=0))


def _log_gaussian(proposal: Proposal, points: FloatArray) -> FloatArray:
    """Return the log density (N,) of the Gaussian with mean and root of a proposal, at points (N, d)."""
    standard = np.asarray(np.linalg.solve(proposal.root, (points - proposal.mean).T).T, dtype=np.float64)
    return np.asarray(log_normal(standard) - np.log(np.abs(np.diag(proposal.root))).sum())


class Adaptation(NamedTuple):
    """A proposal, and the weighted points that led to it.

    ``is_settled`` says whether enough of them were effective in the end, and the mass no longer changed.
    """

    proposal: Proposal
    weighted: WeightedPoints
    is_settled: bool


def adapted(
    log_density: Callable[[FloatArray], FloatArray],
    dimension: int,
    count: int | None = None,
    *,
    start: Proposal | None = None,
    min_effective: float | None = None,
    enough_effective: float = 0.0,
    points_taken: int = 0,
) -> Adaptation:
    """Return a proposal for a density near the standard normal or much narrower, known (N,) at points (N, d).

    Rounds of `weighted_points` come nearer to the density, each proposed by one t distribution. Where they do not
    suffice, as on the way to a density that is far and narrow, the last proposal is the first of as many others, whose
    points alone count. On the way along a ridge many points may be effective among those that lie lower, and the mass
    still grows: it is to have settled from one round to the next, from the search before to the first, unless the very
    first proposal was good enough.

    ``count`` is the number of points in a round, ``start`` the first proposal, ``min_effective`` how many of all points
    are to be effective in the end (by default a share of those of the last round), and ``enough_effective`` how many
    where there are rounds left. ``points_taken`` quasi-random points went to similar searches before.
    """
    count = count or 16 + 16 * dimension
    points = even_points(dimension, MAX_ROUNDS * count, points_taken)
    is_line = dimension == 1  # on which every k-th point is of the same round
    rounds = points.reshape(count, -1, 1).swapaxes(0, 1) if is_line else points.reshape(-1, count, dimension)
    proposal, log_mass = start or Proposal(np.zeros(dimension), np.eye(dimension)), None
    for _ in range(MAX_SEARCHES):
        for weighted in weighted_points(log_density, [[(1.0, proposal)]], rounds, fitted_proposal):
            number, of_round = weighted.effective, effective(weighted.log_weights_of_round)
            if min_effective is None:
                is_found = number >= _least_effective(dimension) and of_round > MIN_EFFECTIVE_SHARE * count
            else:
                is_found = number > min_effective
            earlier, log_mass = log_mass, weighted.log_mass
            is_settled = is_found and (earlier is None or abs(log_mass - earlier) < MAX_CHANGE)
            if is_settled and number >= enough_effective:
                break
        ((_, proposal),) = fitted_proposal(weighted.points, weighted.log_weights)
        if is_settled:
            break
    return Adaptation(proposal, weighted, is_settled)


def _tempered(log_weights: FloatArray, min_effective: float) -> FloatArray:
    """Return normalised weights to the largest power at most one that leaves enough effective."""
    low, high = 0.0, 1.0
    if effective(log_weights) >= min_effective:
        low = 1.0
    else:
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if effective(middle * log_weights) >= min_effective else (low, middle)
    weights = np.exp(low * (log_weights - log_weights.max()))
    return np.asarray(weights / weights.sum())


def _least_effective(dimension: int) -> float:
    """Return how many effective points tell the covariance of a proposal."""
    return 4.0 + 4 * dimension


def _log_ratio(heights: FloatArray, mixture: FloatArray) -> FloatArray:
    """Return log weights (N,) from the logarithms of a density (N,) and of what proposed the points."""
    return np.nan_to_num(heights - mixture, nan=LOG_OF_NOTHING, neginf=LOG_OF_NOTHING)
