"""The sampled routes: NUTS or tempered SMC on the nonlinear parameters, or NUTS on all, as in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.inference.box import Boxes
from tissuq.inference.densities import Density, given_density, joint_density
from tissuq.inference.marginal import Marginal, blended, marginal_of_mixture, marginal_of_points
from tissuq.inference.nuts import NutsDraws, NutsSettings, sample_nuts
from tissuq.inference.resampling import resampled_at_random
from tissuq.inference.smc import SmcDraws, SmcSettings, sample_smc
from tissuq.inference.solution import Components, Diagnostics, Solution
from tissuq.model import StatisticalModel
from tissuq.priors import Flat

__all__ = ["SampledSolution", "sample_joint", "sample_nuts_given", "sample_smc_given"]

FloatArray = NDArray[np.float64]

LARGEST_CORRELATED = 1000
"""Measurements beyond which a dense covariance at every step of the sampler is out of reach."""
PRIOR_POINTS = 512
"""Points of the prior among which the sampler starts at the best."""
EFFECTIVE = 0.5
"""Share of the draws that must stay effective when the bounds of the linear parameters weight them."""


def sample_joint(model: StatisticalModel, seed: int = 0, draws: int = 1000, because: str = "") -> SampledSolution:
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
    values = dict(zip(model.symbols, np.moveaxis(sampled.values, 2, 0), strict=True))
    return SampledSolution(
        model, "joint", f"{because}NUTS on the joint density of {', '.join(model.symbols)}", values, None, sampled
    )


def sample_nuts_given(model: StatisticalModel, seed: int = 0, refusal: str = "") -> SampledSolution:
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
    density, data = given_density(model)
    lower, upper = np.array([model.priors[symbol].support for symbol in model.nonlinear]).T
    settings = NutsSettings(seed=seed, target_acceptance=_acceptance(model))
    start = _best_prior_point(model, density, data)
    sampled = sample_nuts(_log_posterior(density), lower, upper, start, settings, model.nonlinear, data)
    given = _Given(model, density, data, sampled.values)
    if given.effective < EFFECTIVE:
        found = sample_joint(model, seed, because=f"{because}bounds cut deep into the linear parameters; ")
    else:
        reason = f"{because}NUTS on {', '.join(model.nonlinear)}; {given.rest}"
        found = SampledSolution(model, "nuts", reason, given.draws(seed), given, sampled)
    if refusal and not _is_improper(model):
        by_smc = sample_smc_given(model, seed)
        found.log_evidence, found.log_evidence_error = by_smc.log_evidence, by_smc.log_evidence_error
        found.reason += "; evidence by tempered SMC"
    return found


def sample_smc_given(model: StatisticalModel, seed: int = 0) -> SampledSolution:
    """Return posterior and evidence from tempered SMC on the nonlinear parameters, the linear ones integrated.

    The evidence without bounds of the linear parameters times the mean mass within them is that with bounds.
    """
    _check_size(model)
    density, data = given_density(model)
    priors = [model.priors[symbol] for symbol in model.nonlinear]
    lower, upper = np.array([prior.support for prior in priors]).T
    settings = SmcSettings(seed=seed)
    points = _prior_points(model, np.random.default_rng([seed, 7]).random((settings.particles, len(priors))))
    sampled = sample_smc(*_likelihood_and_prior(density), lower, upper, points, settings, model.nonlinear, data)
    given = _Given(model, density, data, sampled.values)
    reason = f"tempered SMC on {', '.join(model.nonlinear)}; {given.rest}"
    found = SampledSolution(model, "smc", reason, given.draws(seed), given, sampled)
    if not _is_improper(model):
        found.log_evidence = sampled.log_evidence + given.log_mean_inside
        found.log_evidence_error = float(np.hypot(sampled.log_evidence_error, given.log_mean_inside_error))
    return found


class _Given:
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
        own = float(self._inside.std() / self._inside.mean() / np.sqrt(count))
        self.log_mean_inside_error = own + float(self._inside @ error / self._inside.sum())
        self.is_cut = bool((self._log_inside < -1e-8).any())

    @property
    def rest(self) -> str:
        """What happened to the linear parameters, in words."""
        linear = ", ".join(self.model.linear)
        return f"{linear} integrated in closed form, then drawn" if linear else "these are all parameters"

    def components(self) -> Components:
        """Return the posterior as one Gaussian for each draw, as if no bound cut."""
        weights = np.full(len(self.settings), 1 / len(self.settings))
        return Components(weights, self.settings, self.mean, self.root)

    def draws(self, seed: int) -> dict[str, FloatArray]:
        """Return draws (chains, draws) of every parameter, the linear ones exact given the nonlinear ones."""
        generator = np.random.default_rng([seed, 5])
        settings, linear = self.settings, self.mean.copy()
        if self.is_cut:
            within = resampled_at_random(self._log_inside.reshape(self.shape), generator)
            chosen = (within + self.shape[1] * np.arange(self.shape[0])[:, None]).ravel()
            uniforms = generator.random((len(chosen), 1, linear.shape[1]))
            settings = settings[chosen]
            linear = self._boxes[chosen].draws(self.mean[chosen], self.root[chosen], uniforms)[:, 0]
        else:
            linear += np.einsum("nij,nj->ni", self.root, generator.standard_normal(self.mean.shape))
        columns = np.column_stack([settings, linear]).T.reshape(-1, *self.shape)
        named = dict(zip((*self.model.nonlinear, *self.model.linear), columns, strict=True))
        return {symbol: named[symbol] for symbol in self.model.symbols}


class SampledSolution(Solution):
    """The posterior of one data set by a sampler."""

    def __init__(
        self,
        model: StatisticalModel,
        route: str,
        reason: str,
        draws: dict[str, FloatArray],
        given: _Given | None,
        sampled: NutsDraws | SmcDraws,
    ) -> None:
        self.model, self.route, self.reason = model, route, reason
        self._draws, self._given, self._sampled = draws, given, sampled

    @property
    def draws(self) -> dict[str, FloatArray]:
        """Draws of every parameter."""
        return self._draws

    @property
    def component_of_draw(self) -> NDArray[np.intp]:
        """The component of every draw: there is one for each, in their order."""
        return np.arange(np.prod(self.shape)).reshape(self.shape)

    @cached_property
    def diagnostics(self) -> Diagnostics:  # type: ignore[override]  # always there, and computed when asked for
        """Whether sampling converged."""
        return _diagnostics(self._draws, self._sampled)

    @cached_property
    def components(self) -> Components:  # type: ignore[override]  # a cached property
        """The posterior as a mixture: one Gaussian for each draw, or one point where bounds cut."""
        if self._given is not None and not self._given.is_cut:
            return self._given.components()
        values = {symbol: drawn.ravel() for symbol, drawn in self._draws.items()}
        count = len(values[self.model.symbols[0]])
        settings, mean = (
            np.array([values[symbol] for symbol in symbols]).reshape(-1, count).T
            for symbols in (self.model.nonlinear, self.model.linear)
        )
        return Components(np.full(count, 1 / count), settings, mean, np.zeros((count, mean.shape[1], mean.shape[1])))

    def _marginal(self, symbol: str) -> Marginal:
        model, parts = self.model, self.components
        bounds = model.priors[symbol].support
        if symbol in model.linear and parts.root.any():
            place = model.linear.index(symbol)
            sds = np.sqrt((parts.root[:, place] ** 2).sum(axis=1))
            return blended([(1.0, marginal_of_mixture(parts.weights, parts.mean[:, place], sds))], bounds)
        return marginal_of_points(self._draws[symbol].ravel(), parts.weights, bounds)


def _diagnostics(draws: Mapping[str, FloatArray], sampled: NutsDraws | SmcDraws) -> Diagnostics:
    whole = sampled.of(np.stack(list(draws.values()), axis=2), tuple(draws))
    rhat, ess_bulk, ess_tail = (
        dict(zip(draws, map(float, column), strict=True)) for column in (whole.rhat, whole.ess_bulk, whole.ess_tail)
    )
    found = Diagnostics(whole.converged, whole.verdict, rhat, ess_bulk, ess_tail)
    if isinstance(sampled, SmcDraws):
        return found
    return replace(found, divergences=sampled.divergences, least_bfmi=float(sampled.bfmi.min()))


def _acceptance(model: StatisticalModel) -> float:
    return 0.95 if model.is_correlated else 0.9


def _is_improper(model: StatisticalModel) -> bool:
    return any(isinstance(prior, Flat) for prior in model.priors.values())


def _check_size(model: StatisticalModel) -> None:
    n = len(model.experiment)
    if model.is_correlated and n > LARGEST_CORRELATED:
        raise ModelError(
            f"sampling factorises a {n} x {n} covariance at every step; beyond {LARGEST_CORRELATED} measurements use "
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
    density, data = given_density(model)
    best = _best_prior_point(model, density, data) if model.nonlinear else np.zeros(0)
    _, _, mean, root = (np.asarray(array)[0] for array in _compiled(density)(best[None], data))
    chosen = dict(zip((*model.nonlinear, *model.linear), [*best, *mean], strict=True))
    for place, symbol in enumerate(model.linear):
        low, high = model.priors[symbol].support
        margin = min(1e-6 * (high - low), 1e-3 * float(np.linalg.norm(root[place])))
        chosen[symbol] = float(np.clip(chosen[symbol], low + margin, high - margin))
    return np.array([chosen[symbol] for symbol in model.symbols])
