"""The posterior by importance sampling with evenly spread points, checked; by NUTS where these fail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.likelihood import Likelihood, log_posterior
from tissuq.emulation.problem import Method
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
    """Return weighted points: scores of a standard normal prior, drawn from a heavy-tailed fit of the posterior."""
    from scipy.stats import qmc

    priors = tuple(likelihood.problem.priors.values())
    size = len(priors)

    def log_target(scores: FloatArray) -> FloatArray:
        height = likelihood.log_density(_values(likelihood, scores)) + log_normal(scores)
        return np.where(np.isfinite(height), height, -np.inf)

    proposal = adapted(log_target, size, SCOUTS)
    cube = qmc.Sobol(size, rng=np.random.default_rng([seed, 43])).random(ROUND * ROUNDS)
    cube = np.clip(cube, 1e-12, 1 - 1e-12)
    proposals, scores, targets = [], np.zeros((0, size)), np.zeros(0)
    for uniforms in np.split(cube, ROUNDS):
        proposals.append(proposal)
        new = proposal.points(uniforms)
        scores, targets = np.concatenate([scores, new]), np.concatenate([targets, log_target(new)])
        if not np.isfinite(targets).any():
            raise ConvergenceError("the measurements have no probability at any parameters that the priors allow.")
        mixture = np.logaddexp.reduce([each.log_density(scores) for each in proposals], axis=0)
        logs = targets - mixture + np.log(len(proposals))
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        proposal = _moved(scores, weights)
    number_effective, alone = effective(logs), float(weights.max())
    converged = number_effective > LEAST_EFFECTIVE and alone < MOST_ALONE
    evidence = float(logs.max() + np.log(np.exp(logs - logs.max()).mean()))
    error = float(np.sqrt(1 / number_effective - 1 / len(logs))) if number_effective < len(logs) else 0.0
    verdict = (
        f"{'Converged' if converged else 'Not converged'}: {number_effective:.0f} of {len(logs)} weighted points are "
        f"effective (at least {LEAST_EFFECTIVE}); the heaviest has {alone:.2g} of the weight (less than {MOST_ALONE})."
    )
    generator = np.random.default_rng([seed, 47])
    order = generator.permutation(systematic(weights[None], CHAINS * DRAWS)[0])
    values = _values(likelihood, scores)
    return Sampled(
        likelihood.problem.symbols, values, weights, "importance", converged, verdict,
        dict.fromkeys(likelihood.problem.symbols, number_effective), {}, evidence, error,
        values[order].reshape(CHAINS, DRAWS, size), tuple(each.support for each in priors),
    )  # fmt: skip


def _values(likelihood: Likelihood, scores: FloatArray) -> FloatArray:
    """Return the parameters (N, D) below which the priors hold what a standard normal holds below scores (N, D)."""
    from scipy.special import ndtr

    priors = likelihood.problem.priors.values()
    return np.column_stack([each.quantile(ndtr(column)) for each, column in zip(priors, scores.T, strict=True)])


def _moved(scores: FloatArray, weights: FloatArray) -> Proposal:
    """Return a proposal with the mean and the covariance of weighted points."""
    mean = weights @ scores
    away = scores - mean
    covariance = (weights[:, None] * away).T @ away + 1e-12 * np.eye(len(mean))
    return Proposal(mean, np.asarray(np.linalg.cholesky(covariance)))


def _by_nuts(likelihood: Likelihood, seed: int, before: Sampled | None) -> Sampled:
    """Return equally weighted draws of the no-U-turn sampler, with the evidence that importance sampling gave."""
    priors = tuple(likelihood.problem.priors.values())
    symbols = likelihood.problem.symbols
    lower, upper = np.array([prior.support for prior in priors]).T
    scores = np.random.default_rng([seed, 53]).standard_normal((512, len(priors)))
    points = _values(likelihood, scores) if before is None else before.values
    heights = likelihood.log_density(points) if before is None else before.weights
    start = points[int(np.argmax(np.where(np.isfinite(heights), heights, -np.inf)))]
    density = log_posterior(likelihood.form, priors)
    found = sample_nuts(density, lower, upper, start, NutsSettings(seed=seed), symbols, likelihood.data)
    values = found.values.reshape(-1, len(symbols))
    ess = np.minimum(found.ess_bulk, found.ess_tail)
    return Sampled(
        symbols, values, np.full(len(values), 1 / len(values)), "nuts", found.converged, found.verdict,
        dict(zip(symbols, map(float, ess), strict=True)), dict(zip(symbols, map(float, found.rhat), strict=True)),
        None, None, found.values, tuple(zip(lower.tolist(), upper.tolist(), strict=True)),
    )  # fmt: skip
