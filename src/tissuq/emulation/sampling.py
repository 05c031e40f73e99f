"""The posterior by importance sampling with evenly spread points, checked; by NUTS where these fail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import get_args

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.emulation.likelihood import Likelihood, log_posterior
from tissuq.emulation.problem import Method
from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.enumerators.nuts import NutsSettings, sample_nuts
from tissuq.inference.enumerators.ridges import around_peaks
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.proposals import WeightedPoints, fitted_mixture, weighted_points
from tissuq.inference.quasi_monte_carlo import LOG_OF_NOTHING, log_normal, sobol_rounds, systematic
from tissuq.parameters.priors import Prior

ROUND_POINTS, ROUNDS, MAX_ROUNDS = 1024, 16, 64
"""Points of a round, the number of rounds, and where that does not suffice, at most."""
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
    weighted = _weighted_scores(likelihood, seed)
    weights, effective, converged = weighted.weights, weighted.effective, _suffice(weighted)
    verdict = (
        f"{'Converged' if converged else 'Not converged'}: {effective:.0f} of {len(weights)} weighted points are "
        f"effective (at least {MIN_EFFECTIVE_POINTS}); the heaviest has {weights.max():.2g} of the weight (less than "
        f"{MAX_POINT_WEIGHT})."
    )
    values = problem.values_of(weighted.points)
    order = np.random.default_rng([seed, 47]).permutation(systematic(weights[None], CHAINS * DRAWS)[0])
    return SampledPosterior(
        priors=problem.priors,
        values=values,
        weights=weights,
        method="importance",
        converged=converged,
        verdict=verdict,
        ess=dict.fromkeys(problem.symbols, effective),
        rhat={},
        log_evidence=weighted.log_mass,
        log_evidence_error=weighted.relative_error,
        draws=values[order].reshape(CHAINS, DRAWS, -1),
    )


def _weighted_scores(likelihood: Likelihood, seed: int) -> WeightedPoints:
    """Return weighted scores (N, D).

    The first rounds lie around peaks and along ridges. Where the emulator is uncertain every outcome is possible, and a
    search for these may end there. So there are two, one of them as if the emulator were exact.
    """
    exact = Likelihood(likelihood.problem, likelihood.emulator, has_error=False)
    size = len(likelihood.problem.symbols)
    searched = [around_peaks(partial(_log_target, candidate), size) for candidate in (exact, likelihood)]
    uniforms = islice(sobol_rounds(size, ROUND_POINTS, [seed, 43]), MAX_ROUNDS)
    rounds = weighted_points(partial(_log_target, likelihood), searched, uniforms, fitted_mixture)
    for number, weighted in enumerate(rounds, 1):
        if not weighted.log_weights.max() > LOG_OF_NOTHING:
            raise ConvergenceError("the measurements have no probability at any parameters that the priors allow.")
        if number >= ROUNDS and _suffice(weighted):
            break
    return weighted


def _suffice(weighted: WeightedPoints) -> bool:
    """Return whether weighted points represent a posterior."""
    return bool(weighted.effective > MIN_EFFECTIVE_POINTS and weighted.weights.max() < MAX_POINT_WEIGHT)


def _log_target(likelihood: Likelihood, scores: FloatArray) -> FloatArray:
    """Return the log of the posterior (N,) at scores (N, D), up to the evidence."""
    height = likelihood.log_density(likelihood.problem.values_of(scores)) + log_normal(scores)
    return np.where(np.isfinite(height), height, -np.inf)


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
