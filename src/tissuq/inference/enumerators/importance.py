"""Adaptive importance sampling: few, costly evaluations of a density of a few parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import lgamma, log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.kronecker import even_points

__all__ = ["Proposal", "adapted", "effective", "log_normal"]

FloatArray = NDArray[np.float64]

FREEDOM = 5.0
"""Of the t distribution: its tails are heavier than those of a posterior."""
WIDE = 0.1
"""Share of the proposal that stays as wide as the prior, so that no weight is without bound there."""
HUGE = 1e300
ROUNDS = 15
EFFECTIVE = 0.3
"""Share of a round's points that must be effective for the adaptation to end."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of t distributions along some axes, with mean (d,) and root (d, d), and the standard normal."""

    mean: FloatArray
    root: FloatArray

    def points(self, uniforms: FloatArray) -> FloatArray:
        """Return the points (N, d) to which evenly spread points (N, d) of the unit cube lead."""
        from scipy.special import ndtri, stdtrit

        wide = np.arange(len(uniforms)) % round(1 / WIDE) == round(0.5 / WIDE)
        heavy = self.mean + stdtrit(FREEDOM, uniforms) @ self.root.T
        return np.asarray(np.where(wide[:, None], ndtri(uniforms), heavy))

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the log density (N,) at points (N, d)."""
        score = np.linalg.solve(self.root, (points - self.mean).T)
        log_height = lgamma(0.5 * (FREEDOM + 1)) - lgamma(0.5 * FREEDOM) - 0.5 * log(FREEDOM * pi)
        heavy = (log_height - 0.5 * (FREEDOM + 1) * np.log1p(score**2 / FREEDOM)).sum(axis=0)
        heavy = heavy - np.log(np.abs(np.diag(self.root))).sum()
        return np.asarray(np.logaddexp(log(1 - WIDE) + heavy, log(WIDE) + log_normal(points)))


def log_normal(points: FloatArray) -> FloatArray:
    """Return the log density (N,) of the standard normal at points (N, d)."""
    return np.asarray(-0.5 * (points**2).sum(axis=1) - 0.5 * points.shape[1] * log(2 * pi))


def adapted(log_density: Callable[[FloatArray], FloatArray], dimension: int, count: int | None = None) -> Proposal:
    """Return a proposal for a density near the standard normal or much narrower, known (N,) at points (N, d).

    Rounds of quasi-random points come nearer to the density: all points so far, weighted by a power of the density over
    the mixture of all proposals so far, give the next t distribution its mean and covariance; the power is the
    largest at most one that leaves enough of them effective (Cornuet et al. 2012, with tempering). ``count`` is the
    number of points in a round.
    """
    count = count or 16 + 16 * dimension
    least_effective = 4.0 + 4 * dimension
    proposal = Proposal(np.zeros(dimension), np.eye(dimension))
    proposals, points, values = [], np.zeros((0, dimension)), np.zeros(0)
    uniforms = even_points(dimension, count * ROUNDS)
    for round_ in range(ROUNDS):
        new = proposal.points(uniforms[round_::ROUNDS])
        proposals.append(proposal)
        points = np.concatenate([points, new])
        values = np.concatenate([values, log_density(new)])
        mixture = np.logaddexp.reduce(
            [proposal_of_round.log_density(points) for proposal_of_round in proposals], axis=0
        ) - log(len(proposals))
        weights, power = _tempered(np.nan_to_num(values - mixture, nan=-HUGE, neginf=-HUGE), least_effective)
        mean = weights @ points
        away = points - mean
        covariance = (weights[:, None] * away).T @ away + 1e-12 * np.eye(dimension)
        proposal = Proposal(mean, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))
        if power == 1 and effective(values[-count:] - proposals[-1].log_density(new)) > EFFECTIVE * count:
            break
    return proposal


def _tempered(log_weights: FloatArray, min_effective: float) -> tuple[FloatArray, float]:
    """Return normalised weights to the largest power at most one that leaves ``least`` effective, and that power."""
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
    """Return the effective number of weighted points."""
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.sum() ** 2 / (weights**2).sum())
