"""The posterior by importance sampling with evenly spread points, checked; by NUTS where these fail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.likelihood import Likelihood, log_posterior
from tissuq.emulation.problem import Method, Problem
from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.importance import Proposal, adapted, effective, log_normal
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.nuts import NutsSettings, sample_nuts
from tissuq.inference.resampling import systematic

__all__ = ["Sampled", "sampled"]

FloatArray = NDArray[np.float64]

SCOUTS, ROUND, ROUNDS = 512, 1024, 8
"""Points of the rounds that find the posterior; of those that are the result, and how many there are."""
LEAST_EFFECTIVE = 800
MOST_ALONE = 0.02
"""Share of the weight that no point may exceed."""
CHAINS, DRAWS = 4, 1000
PRIOR_POINTS = 512
"""Among which NUTS starts at the best."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """A posterior as weighted points.

    Parameters
    ----------
    symbols : tuple of str
    values : (N, D) array
    weights : (N,) array
        Their sum is one.
    method : str
    converged : bool
    verdict : str
        Whether it can be used, in words.
    ess, rhat : mapping of str to float
        Effective sample size of every parameter; R-hat where chains were run.
    log_evidence, log_evidence_error : float or None
        Priors normalised.
    draws : (chains, draws, D) array
        Equally weighted.
    """

    symbols: tuple[str, ...]
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
    supports: tuple[tuple[float, float], ...]

    @cached_property
    def marginals(self) -> dict[str, Marginal]:
        """The marginal posterior of every parameter."""
        columns = zip(self.symbols, self.values.T, self.supports, strict=True)
        return {symbol: marginal_of_points(column, self.weights, ends) for symbol, column, ends in columns}


def sampled(likelihood: Likelihood, seed: int = 0, method: Method = "auto") -> Sampled:
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
    found = _by_importance(likelihood, seed)
    return found if found.converged or method == "importance" else _by_nuts(likelihood, seed, found)


def _by_importance(likelihood: Likelihood, seed: int) -> Sampled:
    """Return weighted points: scores of a standard normal prior, drawn from heavy-tailed fits of the posterior."""
    problem = likelihood.problem
    scores, logs = _weighted_scores(likelihood, seed)
    weights = np.exp(logs - logs.max())
    mean_weight = float(weights.mean())
    weights /= weights.sum()
    count, enough, alone = len(logs), effective(logs), float(weights.max())
    converged = enough > LEAST_EFFECTIVE and alone < MOST_ALONE
    verdict = (
        f"{'Converged' if converged else 'Not converged'}: {enough:.0f} of {count} weighted points are effective (at "
        f"least {LEAST_EFFECTIVE}); the heaviest has {alone:.2g} of the weight (less than {MOST_ALONE})."
    )
    values = _values(problem, scores)
    order = np.random.default_rng([seed, 47]).permutation(systematic(weights[None], CHAINS * DRAWS)[0])
    return Sampled(
        symbols=problem.symbols,
        values=values,
        weights=weights,
        method="importance",
        converged=converged,
        verdict=verdict,
        ess=dict.fromkeys(problem.symbols, enough),
        rhat={},
        log_evidence=float(logs.max() + np.log(mean_weight)),
        log_evidence_error=float(np.sqrt(max(1 / enough - 1 / count, 0.0))),
        draws=values[order].reshape(CHAINS, DRAWS, -1),
        supports=tuple(each.support for each in problem.priors.values()),
    )


def _weighted_scores(likelihood: Likelihood, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return scores (N, D) and the logarithms of their weights (N,), over the mixture of all rounds' proposals.

    Where an emulator knows nothing anything is possible, and a search may end there: so there are two, one of them as
    if it were exact, and both lead to the posterior.
    """
    from scipy.stats import qmc

    exact = Likelihood(likelihood.problem, likelihood.emulator, has_error=False)
    size = len(likelihood.problem.symbols)
    searched = [adapted(partial(_log_target, each), size, SCOUTS) for each in (exact, likelihood)]
    cube = qmc.Sobol(size, rng=np.random.default_rng([seed, 43])).random(ROUND * ROUNDS)
    proposals: list[Proposal] = []
    scores, targets, logs = np.zeros((0, size)), np.zeros(0), np.zeros(0)
    for number, uniforms in enumerate(np.split(np.clip(cube, 1e-12, 1 - 1e-12), ROUNDS)):
        proposals.append(searched[number] if number < len(searched) else _moved(scores, logs))
        new = proposals[-1].points(uniforms)
        scores, targets = np.concatenate([scores, new]), np.concatenate([targets, _log_target(likelihood, new)])
        if not np.isfinite(targets).any():
            raise ConvergenceError("the measurements have no probability at any parameters that the priors allow.")
        mixture = np.logaddexp.reduce([each.log_density(scores) for each in proposals], axis=0)
        logs = targets - mixture + np.log(len(proposals))
    return scores, logs


def _log_target(likelihood: Likelihood, scores: FloatArray) -> FloatArray:
    """Return the log of the posterior (N,) at scores (N, D), up to the evidence."""
    height = likelihood.log_density(_values(likelihood.problem, scores)) + log_normal(scores)
    return np.where(np.isfinite(height), height, -np.inf)


def _values(problem: Problem, scores: FloatArray) -> FloatArray:
    """Return the parameters (N, D) below which the priors hold what a standard normal holds below scores (N, D)."""
    from scipy.special import ndtr

    priors = problem.priors.values()
    return np.column_stack([each.quantile(ndtr(column)) for each, column in zip(priors, scores.T, strict=True)])


def _moved(scores: FloatArray, logs: FloatArray) -> Proposal:
    """Return a proposal with the mean and the covariance of points with log weights (N,)."""
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    mean = weights @ scores
    away = scores - mean
    covariance = (weights[:, None] * away).T @ away + 1e-12 * np.eye(len(mean))
    return Proposal(mean, np.asarray(np.linalg.cholesky(covariance)))


def _by_nuts(likelihood: Likelihood, seed: int, before: Sampled | None) -> Sampled:
    """Return equally weighted draws of the no-U-turn sampler, begun where importance sampling came to."""
    problem = likelihood.problem
    lower, upper = np.array([prior.support for prior in problem.priors.values()]).T
    scattered = np.random.default_rng([seed, 53]).standard_normal((PRIOR_POINTS, len(problem.symbols)))
    points = _values(problem, scattered) if before is None else before.values
    heights = likelihood.log_density(points) if before is None else before.weights
    start = points[int(np.argmax(np.where(np.isfinite(heights), heights, -np.inf)))]
    density = log_posterior(likelihood.form, tuple(problem.priors.values()))
    found = sample_nuts(density, lower, upper, start, NutsSettings(seed=seed), problem.symbols, likelihood.data)
    values = found.values.reshape(-1, len(problem.symbols))
    sizes = np.minimum(found.ess_bulk, found.ess_tail)
    return Sampled(
        symbols=problem.symbols,
        values=values,
        weights=np.full(len(values), 1 / len(values)),
        method="nuts",
        converged=found.converged,
        verdict=found.verdict,
        ess=dict(zip(problem.symbols, map(float, sizes), strict=True)),
        rhat=dict(zip(problem.symbols, map(float, found.rhat), strict=True)),
        log_evidence=None,
        log_evidence_error=None,
        draws=found.values,
        supports=tuple(each.support for each in problem.priors.values()),
    )
