"""The sampled routes: NUTS or tempered SMC on the nonlinear parameters, or NUTS on all, as in the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import jax
import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.inference.box import Boxes
from tissuq.inference.densities import Density, conditional_density, joint_density
from tissuq.inference.enumerators.nuts import NutsDraws, NutsSettings, sample_nuts
from tissuq.inference.enumerators.smc import SmcDraws, SmcSettings, sample_smc
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.quasi_monte_carlo import resampled_at_random
from tissuq.inference.solution import Diagnostics, Marginals, Representation, Solution
from tissuq.model.statistical_model import StatisticalModel

MAX_CORRELATED = 1000
"""Measurements beyond which a dense covariance at every step of the sampler is out of reach."""
PRIOR_POINTS = 512
"""Points of the prior among which the sampler starts at the best."""
MIN_EFFECTIVE_SHARE = 0.5
"""Share of the draws that must stay effective when the bounds of the linear parameters weight them."""


class JointNuts:
    """NUTS on the joint density of all parameters, as in the paper: every draw is a point."""

    def why_not(self, model: StatisticalModel) -> str:
        """Return why no sampler serves a model: an energy discrepancy has too many weights."""
        if model.energy_symbols:
            return f"discrepancy '{model.discrepancy.name}' is integrated exactly. Use 'auto' or 'exact'"
        return ""

    def solve(self, models: Sequence[StatisticalModel], seed: int) -> list[Solution]:
        """Return the posteriors of models, one after another."""
        return [sample_joint(model, seed) for model in models]


@dataclass(frozen=True)
class Nuts(JointNuts):
    """NUTS on the nonlinear parameters, every draw a setting; ``refusal`` says why the exact route was not taken."""

    refusal: str = ""

    def why_not(self, model: StatisticalModel) -> str:
        """Return why a sampler of nonlinear parameters does not serve a model: it may have none."""
        if model.nonlinear or model.energy_symbols:
            return super().why_not(model)
        return (
            "every parameter is linear with a flat, uniform or Gaussian prior, so nothing is left to sample. Use "
            "'exact', or 'joint' to sample all of them"
        )

    def solve(self, models: Sequence[StatisticalModel], seed: int) -> list[Solution]:
        """Return the posteriors of models, one after another."""
        return [sample_by_nuts(model, seed, self.refusal) for model in models]


class TemperedSmc(Nuts):
    """Tempered sequential Monte Carlo on the nonlinear parameters, which gives the evidence, too."""

    def solve(self, models: Sequence[StatisticalModel], seed: int) -> list[Solution]:
        """Return the posteriors of models, one after another."""
        return [sample_by_smc(model, seed) for model in models]


def sample_joint(model: StatisticalModel, seed: int = 0, draws: int = 1000, because: str = "") -> Solution:
    """Return the posterior of any model from NUTS on the joint density of all its parameters.

    It shares no step with the exact route but the model itself, and gives no evidence. A run that has not converged
    says so in its diagnostics.

    Parameters
    ----------
    model : StatisticalModel
    seed : int
    draws : int
        Draws in each of four chains.
    because : str
        Why this route was taken.

    Raises
    ------
    ModelError
        When a correlated discrepancy meets more measurements than a dense covariance can bear.
    """
    _check_size(model)
    density, data = joint_density(model)
    lower, upper = np.array([model.priors[symbol].support for symbol in model.symbols]).T
    settings = NutsSettings(draws=draws, seed=seed, target_acceptance=_acceptance(model))
    sampled = sample_nuts(density, lower, upper, _start(model), settings, model.symbols, data)
    settings_of_draws, linear = (
        sampled.values[:, :, [model.symbols.index(symbol) for symbol in symbols]]
        for symbols in (model.nonlinear, model.linear)
    )
    reason = f"{because}NUTS on the joint density of {', '.join(model.symbols)}"
    return _solution(model, "joint", reason, _points(settings_of_draws, linear), linear, sampled)


def sample_by_nuts(model: StatisticalModel, seed: int = 0, refusal: str = "") -> Solution:
    """Return the posterior from NUTS on the nonlinear parameters, the linear ones integrated and then drawn.

    Where bounds of the linear parameters cut deep, all parameters are sampled together instead.

    Parameters
    ----------
    model : StatisticalModel
        With at least one nonlinear parameter.
    seed : int
    refusal : str
        Why the exact route was not taken; the evidence then comes from tempered SMC. Empty when NUTS was asked for.
    """
    because = f"the exact route does not serve: {refusal}; " if refusal else ""
    if not model.nonlinear:
        return sample_joint(model, seed, because=because)
    _check_size(model)
    density, data = conditional_density(model)
    lower, upper = np.array([model.priors[symbol].support for symbol in model.nonlinear]).T
    settings = NutsSettings(seed=seed, target_acceptance=_acceptance(model))
    start = _best_prior_point(model, density, data)
    sampled = sample_nuts(_log_posterior(density), lower, upper, start, settings, model.nonlinear, data)
    conditional = _ConditionalDraws(model, density, data, sampled.values)
    if conditional.effective < MIN_EFFECTIVE_SHARE:
        solution = sample_joint(model, seed, because=f"{because}bounds cut deep into the linear parameters; ")
    else:
        reason = f"{because}NUTS on {', '.join(model.nonlinear)}; {conditional.account}"
        solution = _solution(model, "nuts", reason, *conditional.mixture_and_draws(seed), sampled)
    if refusal and not model.is_improper:
        by_smc = sample_by_smc(model, seed)
        solution = replace(
            solution,
            log_evidence=by_smc.log_evidence,
            log_evidence_error=by_smc.log_evidence_error,
            reason=f"{solution.reason}; evidence by tempered SMC",
        )
    return solution


def sample_by_smc(model: StatisticalModel, seed: int = 0) -> Solution:
    """Return posterior and evidence from tempered SMC on the nonlinear parameters, the linear ones integrated.

    The evidence without bounds of the linear parameters times the mean mass within them is that with bounds.
    """
    _check_size(model)
    density, data = conditional_density(model)
    priors = [model.priors[symbol] for symbol in model.nonlinear]
    lower, upper = np.array([prior.support for prior in priors]).T
    settings = SmcSettings(seed=seed)
    points = _prior_points(model, np.random.default_rng([seed, 7]).random((settings.particles, len(priors))))
    sampled = sample_smc(*_likelihood_and_prior(density), lower, upper, points, settings, model.nonlinear, data)
    conditional = _ConditionalDraws(model, density, data, sampled.values)
    reason = f"tempered SMC on {', '.join(model.nonlinear)}; {conditional.account}"
    solution = _solution(model, "smc", reason, *conditional.mixture_and_draws(seed), sampled)
    if model.is_improper:
        return solution
    evidence = sampled.log_evidence + conditional.log_mean_inside
    error = float(np.hypot(sampled.log_evidence_error, conditional.log_mean_inside_error))
    return replace(solution, log_evidence=evidence, log_evidence_error=error)


class _ConditionalDraws:
    """The linear parameters given draws (chains, draws, d) of the nonlinear ones."""

    def __init__(self, model: StatisticalModel, density: Density, data: Mapping[str, Any], h: FloatArray) -> None:
        self.model, self.shape = model, h.shape[:2]
        self.settings = h.reshape(-1, h.shape[2])
        _, _, mean, root = (np.asarray(array) for array in _compiled(density)(self.settings, data))
        self.mean, self.root = mean, root
        supports = np.array([model.priors[symbol].support for symbol in model.linear]).reshape(-1, 2)
        lower, upper = (np.broadcast_to(ends, mean.shape) for ends in supports.T)
        self._boxes = Boxes(lower, upper)
        self._log_inside, error = self._boxes.log_mass(mean, root)
        top = self._log_inside.max()
        self._inside = np.exp(self._log_inside - top)
        self.log_mean_inside = float(top + np.log(self._inside.mean()))
        count = len(self._inside)
        self.effective = float(self._inside.sum() ** 2 / (self._inside @ self._inside) / count)
        sampling_error = float(self._inside.std() / self._inside.mean() / np.sqrt(count))
        self.log_mean_inside_error = sampling_error + float(self._inside @ error / self._inside.sum())
        self.is_cut = bool((self._log_inside < -1e-8).any())

    @property
    def account(self) -> str:
        """What happened to the linear parameters, in words."""
        linear = ", ".join(self.model.linear)
        return f"{linear} integrated in closed form, then drawn" if linear else "these are all parameters"

    def mixture_and_draws(self, seed: int) -> tuple[GaussianMixture, FloatArray]:
        """Return the posterior as one Gaussian for each draw, or one point where bounds cut, and the draws.

        The latter (chains, draws, p) are of the linear parameters, exact given the nonlinear ones.
        """
        generator = np.random.default_rng([seed, 5])
        if self.is_cut:
            draw_in_chain = resampled_at_random(self._log_inside.reshape(self.shape), generator)
            indices = (draw_in_chain + self.shape[1] * np.arange(self.shape[0])[:, None]).ravel()
            uniforms = generator.random((len(indices), 1, self.mean.shape[1]))
            linear = self._boxes[indices].draws(self.mean[indices], self.root[indices], uniforms)[:, 0]
            linear = linear.reshape(*self.shape, -1)
            return _points(self.settings[indices].reshape(*self.shape, -1), linear), linear
        linear = self.mean + np.einsum("nij,nj->ni", self.root, generator.standard_normal(self.mean.shape))
        weights = np.full(len(self.settings), 1 / len(self.settings))
        return GaussianMixture(weights, self.settings, self.mean, self.root), linear.reshape(*self.shape, -1)


def _points(settings: FloatArray, linear: FloatArray) -> GaussianMixture:
    """Return draws (chains, draws, d) and (chains, draws, p) as points of the same weight."""
    count = settings.shape[0] * settings.shape[1]
    return GaussianMixture.of_points(settings.reshape(count, -1), linear.reshape(count, -1))


def _solution(
    model: StatisticalModel,
    route: str,
    reason: str,
    mixture: GaussianMixture,
    linear: FloatArray,
    sampled: NutsDraws | SmcDraws,
) -> Solution:
    """Return the posterior with one component for each draw, of which ``linear`` (chains, draws, p) are drawn."""

    def marginal(symbol: str) -> Marginal:
        if symbol in model.linear and mixture.root.any():
            return mixture.marginal(model.linear.index(symbol))
        return marginal_of_points(solution.draws[symbol].ravel(), mixture.weights, model.priors[symbol].support)

    solution = Solution(model, route, reason, Representation.of(mixture), Marginals.of(model, marginal), sampled=linear)
    return replace(solution, diagnostics=_diagnostics(solution.draws, sampled))


def _diagnostics(draws: Mapping[str, FloatArray], sampled: NutsDraws | SmcDraws) -> Diagnostics:
    diagnostics = Diagnostics.of(sampled.of(np.stack(list(draws.values()), axis=2), tuple(draws)))
    if isinstance(sampled, SmcDraws):
        return diagnostics
    return replace(diagnostics, divergences=sampled.divergences, least_bfmi=float(sampled.bfmi.min()))


def _acceptance(model: StatisticalModel) -> float:
    return 0.95 if model.is_correlated else 0.9


def _check_size(model: StatisticalModel) -> None:
    n = model.experiment.size
    if model.is_correlated and n > MAX_CORRELATED:
        raise ModelError(
            f"sampling factorises a {n} x {n} covariance at every step; beyond {MAX_CORRELATED} measurements use "
            "the method 'exact', or thin the data."
        )


@lru_cache(maxsize=64)
def _log_posterior(density: Density) -> Density:
    """Return log p(y | h) + log p(h); the same function for the same density."""
    return lambda h, data: sum(density(h, data)[:2])


@lru_cache(maxsize=64)
def _likelihood_and_prior(density: Density) -> tuple[Density, Density]:
    """Return log p(y | h) and log p(h); the same functions for the same density."""
    return lambda h, data: density(h, data)[0], lambda h, data: density(h, data)[1]


@lru_cache(maxsize=64)
def _compiled(density: Density) -> Any:
    return jax.jit(jax.vmap(density, (0, None)))


def _prior_points(model: StatisticalModel, probabilities: FloatArray) -> FloatArray:
    """Return the nonlinear parameters (N, d) below which their priors hold probabilities (N, d)."""
    columns = zip(model.nonlinear, probabilities.T, strict=True)
    return np.column_stack([model.priors[symbol].quantile(column) for symbol, column in columns])


def _best_prior_point(model: StatisticalModel, density: Density, data: Mapping[str, Any]) -> FloatArray:
    points = _prior_points(model, np.random.default_rng(0).random((PRIOR_POINTS, len(model.nonlinear))) ** 2)
    log_likelihood = np.asarray(_compiled(density)(points, data)[0])
    best = int(np.argmax(np.where(np.isfinite(log_likelihood), log_likelihood, -np.inf)))
    return np.asarray(points[best], dtype=np.float64)


def _start(model: StatisticalModel) -> FloatArray:
    """Return a point inside the support: the best of some prior points, linear parameters at their conditional mean."""
    density, data = conditional_density(model)
    best = _best_prior_point(model, density, data) if model.nonlinear else np.zeros(0)
    _, _, mean, root = (np.asarray(array)[0] for array in _compiled(density)(best[None], data))
    start = dict(zip((*model.nonlinear, *model.linear), [*best, *mean], strict=True))
    for index, symbol in enumerate(model.linear):
        low, high = model.priors[symbol].support
        margin = min(1e-6 * (high - low), 1e-3 * float(np.linalg.norm(root[index])))
        start[symbol] = float(np.clip(start[symbol], low + margin, high - margin))
    return np.array([start[symbol] for symbol in model.symbols])
