"""Sums over few points: evenly spread ones, those of an adapted proposal, and few that stand for many weighted ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import lgamma, log, pi
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray, IndexArray

SHIFTS = 8
"""Shifted copies of the quasi-random points, whose spread tells the error (more, where few points count)."""


DEGREES_OF_FREEDOM = 5.0
"""Of the t distribution: its tails are heavier than those of a posterior."""
WIDE_SHARE = 0.1
"""Share of the proposal that stays as wide as the prior, so that no weight is without bound there."""
LOG_OF_NOTHING = -1e300
"""Stands for the logarithm of a weight that is zero or not a number."""
MAX_ROUNDS, MAX_SEARCHES = 15, 4
MAX_CHANGE = 0.15
"""Of the logarithm of the mass, in the last round."""
MIN_EFFECTIVE_SHARE = 0.3
"""Share of a round's points that must be effective for the adaptation to end."""


def even_points(dimension: int, count: int, points_taken: int = 0) -> FloatArray:
    """Return evenly spread points (count, d) of the unit cube; those of every slice of them are, too.

    Of a line, every k-th of them. ``points_taken`` of them, except of a line, went before.
    """
    if dimension == 1:
        return (np.arange(count)[:, None] + 0.5) / count
    return np.asarray((0.5 + (points_taken + np.arange(1, count + 1))[:, None] * _steps(dimension)) % 1.0)


@lru_cache
def quasi_random(dimension: int, number: int) -> FloatArray:
    """Return points (number, d) of the unit cube, shifted copy by shifted copy.

    The tent map makes any integrand periodic, which lets the error fall faster than one over the number of points.
    """
    shifts = np.random.default_rng(0).random((SHIFTS, 1, dimension))
    lattice = shifts + np.arange(1, -(-number // SHIFTS) + 1)[:, None] * _steps(dimension)
    return np.asarray(np.abs(2 * (lattice % 1.0) - 1)).reshape(-1, dimension)[:number]


def _steps(dimension: int) -> FloatArray:
    """Return the steps (d,) along each side: powers of one over the root of r^(d + 1) = r + 1."""
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimension + 1))
    return np.asarray(ratio ** -np.arange(1.0, dimension + 1))


def systematic(weights: FloatArray, count: int, offset: float | FloatArray = 0.5) -> IndexArray:
    """Return which points to take, each as often as its weight says, in ascending order: neighbours stay neighbours.

    Parameters
    ----------
    weights : (R, n) array
        Weights of the points of R sets, which need not sum to one.
    count : int
        Points to take from each set.
    offset : float or (R, 1) array
        Place of the first tick, between zero and one.

    Returns
    -------
    (R, count) array
    """
    edges = np.cumsum(weights, axis=1)
    ticks = (np.arange(count) + offset) / count * edges[:, -1:]
    indices = [np.searchsorted(edge, tick, side="right") for edge, tick in zip(edges, ticks, strict=True)]
    return np.asarray(np.minimum(indices, edges.shape[1] - 1), dtype=np.intp)


def resampled_at_random(log_weights: FloatArray, generator: np.random.Generator) -> IndexArray:
    """Return as many draws of R sets as these have, (R, n), from log weights (R, n) up to a constant for each set."""
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    return systematic(weights, weights.shape[1], generator.random((len(weights), 1)))


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
        covariance = (weights[:, None] * centred).T @ centred + 1e-12 * np.eye(len(mean))
        return cls(mean, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))

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


def log_normal(points: FloatArray) -> FloatArray:
    """Return the log density (N,) of the standard normal at points (N, d)."""
    return np.asarray(-0.5 * (points**2).sum(axis=1) - 0.5 * points.shape[1] * log(2 * pi))


class Adaptation(NamedTuple):
    """A proposal, and the points (N, d) that led to it with log weights (N,): the density over what proposed them.

    ``is_settled`` says whether enough points were effective in the end, and the mass no longer changed.
    """

    proposal: Proposal
    points: FloatArray
    log_weights: FloatArray
    is_settled: bool = True

    @property
    def log_mass(self) -> float:
        """The logarithm of the integral of the density."""
        return float(np.logaddexp.reduce(self.log_weights)) - log(len(self.points))


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

    Rounds of quasi-random points come nearer to the density: all points so far, weighted by a power of the density over
    the mixture of all proposals so far, give the next t distribution its mean and covariance; the power is the
    largest at most one that leaves enough of them effective (Cornuet et al. 2012, with tempering). Where the rounds do
    not suffice, as on the way to a density that is far and narrow, the last proposal is the first of as many others,
    whose points alone count. ``count`` is the number of points in a round, ``start`` the first proposal,
    ``min_effective`` how many of all points are to be effective in the end (by default a share of those of the last
    round), and ``enough_effective`` how many where there are rounds left. ``points_taken`` quasi-random points went to
    similar searches before.
    """
    count = count or 16 + 16 * dimension
    rounds = _rounds(dimension, count, points_taken)
    proposal, log_mass = start or Proposal(np.zeros(dimension), np.eye(dimension)), None
    for _ in range(MAX_SEARCHES):
        adaptation = _search(log_density, rounds, proposal, min_effective, enough_effective, log_mass)
        if adaptation.is_settled:
            break
        proposal, log_mass = adaptation.proposal, adaptation.log_mass
    return adaptation


def _rounds(dimension: int, count: int, points_taken: int) -> FloatArray:
    """Return points (rounds, count, d) of the unit cube, evenly spread in each round and together."""
    points = even_points(dimension, MAX_ROUNDS * count, points_taken)
    if dimension == 1:
        return points.reshape(count, MAX_ROUNDS, 1).swapaxes(0, 1)
    return points.reshape(MAX_ROUNDS, count, dimension)


def _search(
    log_density: Callable[[FloatArray], FloatArray],
    rounds: FloatArray,
    start: Proposal,
    min_effective: float | None,
    enough_effective: float,
    log_mass: float | None,
) -> Adaptation:
    """Return what the rounds of one search lead to.

    On the way along a ridge many points may be effective among those that lie lower, and the mass still grows: it is to
    have settled from one round to the next, from the search before to the first, unless the very first proposal was
    good enough.
    """
    _, count, dimension = rounds.shape
    least_effective = 4.0 + 4 * dimension
    proposal, proposals = start, list[Proposal]()
    points, values = np.zeros((0, dimension)), np.zeros(0)
    for uniforms in rounds:
        new = proposal.points(uniforms)
        proposals.append(proposal)
        points = np.concatenate([points, new])
        values = np.concatenate([values, log_density(new)])
        mixture = np.logaddexp.reduce(
            [proposal_of_round.log_density(points) for proposal_of_round in proposals], axis=0
        ) - log(len(proposals))
        log_weights = np.nan_to_num(values - mixture, nan=LOG_OF_NOTHING, neginf=LOG_OF_NOTHING)
        weights, power = tempered(log_weights, least_effective)
        proposal = Proposal.of(points, weights)
        effective_new = effective(values[-count:] - proposals[-1].log_density(new)) if power == 1 else 0.0
        is_found, number = effective_new > MIN_EFFECTIVE_SHARE * count, effective(log_weights)
        if min_effective is not None:
            is_found = number > min_effective
        adaptation = Adaptation(proposal, points, log_weights)
        earlier, log_mass = log_mass, adaptation.log_mass
        is_settled = is_found and (earlier is None or abs(log_mass - earlier) < MAX_CHANGE)
        if is_settled and number >= enough_effective:
            break
    return adaptation._replace(is_settled=is_settled)


def tempered(log_weights: FloatArray, min_effective: float) -> tuple[FloatArray, float]:
    """Return normalised weights to the largest power at most one that leaves enough effective, and that power."""
    low, high = 0.0, 1.0
    if effective(log_weights) >= min_effective:
        low = 1.0
    else:
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if effective(middle * log_weights) >= min_effective else (low, middle)
    weights = np.exp(low * (log_weights - log_weights.max()))
    return weights / weights.sum(), low


def effective(log_weights: FloatArray) -> float:
    """Return the effective number of weighted points; none where no weight is more than nothing."""
    if log_weights.max() <= LOG_OF_NOTHING:
        return 0.0
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.sum() ** 2 / (weights**2).sum())
