"""Points weighted by a density, proposed by mixtures of t distributions: of several peaks, and along bent ridges."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.quasi_monte_carlo import LOG_OF_NOTHING, Proposal, log_normal, systematic, tempered

Mixture = Sequence[tuple[float, Proposal]]
"""Proposals with their shares, which sum to one."""

COMPONENTS, FITTED_POINTS, FIT_STEPS = 4, 1024, 12
"""Gaussians of a mixture, points to which they are fitted, and the steps of the fit."""
WIDENED = 2.25
"""Volume of a proposal over that of its Gaussian, so that the ends of a bent ridge, not yet met, are not left out."""


def weighted_points(
    log_density: Callable[[FloatArray], FloatArray], starts: Sequence[Mixture], count: int, seed: int | Sequence[int]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield points (N, d) with log weights (N,), the density over what proposed them, round after round.

    The first rounds are proposed by the ``starts``, each later one by a mixture that is `fitted` to all points so far.
    All points are weighted by the mixture of all proposals so far (Cornuet et al. 2012).

    Parameters
    ----------
    log_density : callable
        Near the standard normal or much narrower, (N,) at points (N, d).
    starts : sequence of Mixture
    count : int
        Points of a round.
    seed : int or sequence of int
        Of the shifts of the evenly spread points.
    """
    from scipy.stats import qmc

    dimension = len(starts[0][0][1].mean)
    sequence = qmc.Sobol(dimension, rng=np.random.default_rng(seed))
    proposals = list[tuple[float, Proposal]]()
    points, heights, mixture = np.zeros((0, dimension)), np.zeros(0), np.zeros(0)
    log_weights, number = np.zeros(0), 0
    while True:
        uniforms = np.clip(sequence.random(count), 1e-12, 1 - 1e-12)
        of_round = starts[number] if number < len(starts) else fitted(points, log_weights)
        ends = np.round(np.cumsum([share for share, _ in of_round]) * count).astype(int)
        parts = zip(of_round, np.split(uniforms, ends[:-1]), strict=True)
        blocks = [(proposal, block) for (_, proposal), block in parts if len(block)]
        new = np.concatenate([proposal.points(block) for proposal, block in blocks])
        more = [(len(block) / count, proposal) for proposal, block in blocks]
        proposals += more
        mixture = np.concatenate([np.logaddexp(mixture, _log_mixture(more, points)), _log_mixture(proposals, new)])
        points, heights = np.concatenate([points, new]), np.concatenate([heights, log_density(new)])
        number += 1
        log_weights = np.nan_to_num(heights - mixture + np.log(number), nan=LOG_OF_NOTHING, neginf=LOG_OF_NOTHING)
        yield points, log_weights


def fitted(points: FloatArray, log_weights: FloatArray) -> Mixture:
    """Return a mixture whose Gaussians are fitted to points (N, d) with log weights (N,).

    The fit starts at slices of equal weight along one coordinate after the other.
    """
    least_effective = COMPONENTS * (4.0 + 4 * points.shape[1])
    points = points[systematic(tempered(log_weights, least_effective)[0][None], FITTED_POINTS)[0]]
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
