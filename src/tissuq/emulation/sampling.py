"""The posterior by importance sampling with evenly spread points, checked; by NUTS where these fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.likelihood import Likelihood, log_posterior
from tissuq.emulation.problem import Method
from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.enumerators.nuts import NutsSettings, sample_nuts
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.quasi_monte_carlo import Proposal, adapted, effective, log_normal, systematic
from tissuq.parameters.priors import Prior

__all__ = ["SampledPosterior", "sample_posterior"]

FloatArray = NDArray[np.float64]

SEARCH_POINTS, ROUND_POINTS, ROUNDS, MAX_ROUNDS = 512, 1024, 16, 32
"""Points of a search round; points of a sampling round, the number of these, and where it does not suffice, at most."""
COMPONENTS, FITTED_POINTS, FIT_STEPS = 4, 1024, 12
"""Gaussians of a proposal, points to which they are fitted, and the steps of the fit."""
MIN_EFFECTIVE_POINTS = 800
"""Smallest effective number of points of a converged posterior."""
MAX_POINT_WEIGHT = 0.02
"""Largest share of the weight of any point of a converged posterior."""
CHAINS, DRAWS = 4, 1000
PRIOR_POINTS = 512
"""Number of points of the prior, at the best of which NUTS starts."""


@dataclass(frozen=True, eq=False)
class SampledPosterior:
    """A posterior as weighted points.

    Parameters
    ----------
    priors : mapping of str to Prior
        Of all parameters.
    values : (N, D) array
    weights : (N,) array
        Weights, whose sum is one.
    method : str
    converged : bool
    verdict : str
        Convergence, in words.
    ess, rhat : mapping of str to float
        Effective sample size of every parameter; R-hat where chains were run.
    log_evidence, log_evidence_error : float or None
        Log evidence with normalised priors, and its standard error.
    draws : (chains, draws, D) array
        Equally weighted draws.
    """

    priors: Mapping[str, Prior]
    values: FloatArray
    weights: FloatArray
    method: str
    converged: bool
    verdict: str
    ess: Mapping[str, float]
    rhat: Mapping[str, float]
    log_evidence: float | None
    log_evidence_error: float | None
    draws: FloatArray

    @cached_property
    def marginals(self) -> dict[str, Marginal]:
        """The marginal posterior of every parameter."""
        columns = zip(self.priors.items(), self.values.T, strict=True)
        return {symbol: marginal_of_points(column, self.weights, prior.support) for (symbol, prior), column in columns}

    def thinned(self, count: int) -> FloatArray:
        """Return equally probable draws (count, D) of all parameters."""
        flat = self.draws.reshape(-1, len(self.priors))
        return np.asarray(flat[np.linspace(0, len(flat) - 1, count).round().astype(int)])


def sample_posterior(likelihood: Likelihood, seed: int = 0, method: Method = "auto") -> SampledPosterior:
    """Return the posterior of the parameters.

    Parameters
    ----------
    likelihood : Likelihood
    seed : int
    method : str
        ``"importance"``, ``"nuts"``, or ``"auto"``: the former where enough of its points are effective.

    Raises
    ------
    InputError, ConvergenceError
        When the method is unknown, or the likelihood is zero wherever the prior is not.
    """
    if method not in get_args(Method):
        raise InputError(f"the method must be one of {', '.join(get_args(Method))}, not '{method}'.")
    if method == "nuts":
        return _by_nuts(likelihood, seed, None)
    weighted = _by_importance(likelihood, seed)
    return weighted if weighted.converged or method == "importance" else _by_nuts(likelihood, seed, weighted)


def _by_importance(likelihood: Likelihood, seed: int) -> SampledPosterior:
    """Return weighted points: scores of a standard normal prior, drawn from heavy-tailed fits of the posterior."""
    problem = likelihood.problem
    scores, logs = _weighted_scores(likelihood, seed)
    weights = np.exp(logs - logs.max())
    mean_weight = float(weights.mean())
    weights /= weights.sum()
    count, effective_points, heaviest = len(logs), effective(logs), float(weights.max())
    converged = _suffice(logs)
    verdict = (
        f"{'Converged' if converged else 'Not converged'}: {effective_points:.0f} of {count} weighted points are "
        f"effective (at least {MIN_EFFECTIVE_POINTS}); the heaviest has {heaviest:.2g} of the weight (less than "
        f"{MAX_POINT_WEIGHT})."
    )
    values = problem.values_of(scores)
    order = np.random.default_rng([seed, 47]).permutation(systematic(weights[None], CHAINS * DRAWS)[0])
    return SampledPosterior(
        priors=problem.priors,
        values=values,
        weights=weights,
        method="importance",
        converged=converged,
        verdict=verdict,
        ess=dict.fromkeys(problem.symbols, effective_points),
        rhat={},
        log_evidence=float(logs.max() + np.log(mean_weight)),
        log_evidence_error=float(np.sqrt(max(1 / effective_points - 1 / count, 0.0))),
        draws=values[order].reshape(CHAINS, DRAWS, -1),
    )


def _weighted_scores(likelihood: Likelihood, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return scores (N, D) and the logarithms of their weights (N,), over the mixture of all rounds' proposals.

    Where the emulator is uncertain every outcome is possible, and a search may end there. So there are two searches,
    one of them as if the emulator were exact.
    """
    from scipy.stats import qmc

    exact = Likelihood(likelihood.problem, likelihood.emulator, has_error=False)
    size = len(likelihood.problem.symbols)
    searched = [
        adapted(partial(_log_target, candidate), size, SEARCH_POINTS).proposal for candidate in (exact, likelihood)
    ]
    sequence = qmc.Sobol(size, rng=np.random.default_rng([seed, 43]))
    proposals: list[tuple[float, Proposal]] = []
    scores, targets, logs, mixture = np.zeros((0, size)), np.zeros(0), np.zeros(0), np.zeros(0)
    for number in range(MAX_ROUNDS):
        if number >= ROUNDS and _suffice(logs):
            break
        uniforms = np.clip(sequence.random(ROUND_POINTS), 1e-12, 1 - 1e-12)
        of_round = [(1.0, searched[number])] if number < len(searched) else _components(scores, logs)
        ends = np.round(np.cumsum([share for share, _ in of_round]) * ROUND_POINTS).astype(int)
        blocks = np.split(uniforms, ends[:-1])
        new = np.concatenate([proposal.points(block) for (_, proposal), block in zip(of_round, blocks, strict=True)])
        more = [
            (len(block) / ROUND_POINTS, proposal)
            for (_, proposal), block in zip(of_round, blocks, strict=True)
            if len(block)
        ]
        proposals += more
        mixture = np.concatenate([np.logaddexp(mixture, _log_mixture(more, scores)), _log_mixture(proposals, new)])
        scores, targets = np.concatenate([scores, new]), np.concatenate([targets, _log_target(likelihood, new)])
        if not np.isfinite(targets).any():
            raise ConvergenceError("the measurements have no probability at any parameters that the priors allow.")
        logs = targets - mixture + np.log(number + 1)
    return scores, logs


def _log_mixture(proposals: Sequence[tuple[float, Proposal]], scores: FloatArray) -> FloatArray:
    """Return the logarithm (N,) of the sum of proposals, times their shares, at scores (N, D)."""
    heights = [np.log(share) + proposal.log_density(scores) for share, proposal in proposals]
    return np.asarray(np.logaddexp.reduce(heights, axis=0))


def _suffice(logs: FloatArray) -> bool:
    """Return whether points with these log weights (N,) represent a posterior."""
    heaviest = np.exp(logs.max() - np.logaddexp.reduce(logs))
    return bool(effective(logs) > MIN_EFFECTIVE_POINTS and heaviest < MAX_POINT_WEIGHT)


def _log_target(likelihood: Likelihood, scores: FloatArray) -> FloatArray:
    """Return the log of the posterior (N,) at scores (N, D), up to the evidence."""
    height = likelihood.log_density(likelihood.problem.values_of(scores)) + log_normal(scores)
    return np.where(np.isfinite(height), height, -np.inf)


def _components(scores: FloatArray, logs: FloatArray) -> list[tuple[float, Proposal]]:
    """Return proposals with their shares: a mixture of Gaussians fitted to points (N, D) with log weights (N,).

    The width of a discrepancy's amplitude and that of the parameters beside it grow together, which a single Gaussian
    does not follow. The fit starts at slices of equal weight along one score after the other.
    """
    weights = np.exp(logs - logs.max())
    points = scores[systematic(weights[None], FITTED_POINTS)[0]]
    points = points + 1e-6 * points.std(axis=0) * np.random.default_rng(0).standard_normal(points.shape)
    fits = []
    for axis in range(points.shape[1]):
        slices = np.argsort(np.argsort(points[:, axis])) * COMPONENTS // FITTED_POINTS
        shares = np.eye(COMPONENTS)[:, slices]
        for _ in range(FIT_STEPS):
            gaussians = [_moved(points, share) for share in shares]
            heights = np.array([
                np.log(share.mean()) + _log_gaussian(gaussian, points)
                for share, gaussian in zip(shares, gaussians, strict=True)
            ])  # fmt: skip
            total = np.logaddexp.reduce(heights, axis=0)
            shares = np.maximum(np.exp(heights - total), 1e-3)
            shares /= shares.sum(axis=0)
        fits.append((float(total.mean()), [(float(share.mean()), _moved(points, share)) for share in shares]))
    return max(fits, key=lambda fit: fit[0])[1]


def _log_gaussian(proposal: Proposal, points: FloatArray) -> FloatArray:
    """Return the log density (N,) of the Gaussian with mean and root of a proposal, at points (N, D)."""
    standard = np.asarray(np.linalg.solve(proposal.root, (points - proposal.mean).T).T, dtype=np.float64)
    return np.asarray(log_normal(standard) - np.log(np.abs(np.diag(proposal.root))).sum())


def _moved(scores: FloatArray, weights: FloatArray) -> Proposal:
    """Return a proposal with the mean and the covariance of points (N, D) with weights (N,)."""
    weights = weights / weights.sum()
    mean = weights @ scores
    centred = scores - mean
    covariance = (weights[:, None] * centred).T @ centred + 1e-12 * np.eye(len(mean))
    return Proposal(mean, np.asarray(np.linalg.cholesky(covariance)))


def _by_nuts(likelihood: Likelihood, seed: int, search: SampledPosterior | None) -> SampledPosterior:
    """Return equally weighted draws of the no-U-turn sampler, started at the best point of importance sampling."""
    problem = likelihood.problem
    lower, upper = np.array([prior.support for prior in problem.priors.values()]).T
    scattered = np.random.default_rng([seed, 53]).standard_normal((PRIOR_POINTS, len(problem.symbols)))
    points = problem.values_of(scattered) if search is None else search.values
    heights = likelihood.log_density(points) if search is None else search.weights
    start = points[int(np.argmax(np.where(np.isfinite(heights), heights, -np.inf)))]
    density = log_posterior(likelihood.form, tuple(problem.priors.values()), problem.correlation)
    chains = sample_nuts(density, lower, upper, start, NutsSettings(seed=seed), problem.symbols, likelihood.data)
    values = chains.values.reshape(-1, len(problem.symbols))
    sizes = np.minimum(chains.ess_bulk, chains.ess_tail)
    return SampledPosterior(
        priors=problem.priors,
        values=values,
        weights=np.full(len(values), 1 / len(values)),
        method="nuts",
        converged=chains.converged,
        verdict=chains.verdict,
        ess=dict(zip(problem.symbols, map(float, sizes), strict=True)),
        rhat=dict(zip(problem.symbols, map(float, chains.rhat), strict=True)),
        log_evidence=None,
        log_evidence_error=None,
        draws=chains.values,
    )
