"""The sampled route: NUTS on the full joint density, as in the paper."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.inference.conditional import ConditionalGaussian
from tissuq.inference.marginal import marginal_of_points
from tissuq.inference.nuts import NutsDraws, NutsSettings, sample_nuts
from tissuq.inference.solution import Components, Diagnostics, Solution
from tissuq.mechanics.stress import differentiator
from tissuq.model import StatisticalModel

__all__ = ["solve_by_sampling"]

FloatArray = NDArray[np.float64]

LARGEST_CORRELATED = 1000
"""Measurements beyond which a dense covariance at every step of the sampler is out of reach."""


def solve_by_sampling(model: StatisticalModel, seed: int = 0, draws: int = 1000) -> Solution:
    """Return the posterior of any model from NUTS on the joint density of all its parameters.

    The density is the paper's (eq. 15 with eq. 20 to 26): a dense multivariate normal for correlated
    discrepancies, nothing integrated. It shares no step with the exact route but the model itself, and gives no
    evidence. A run that has not converged says so in its diagnostics and warnings.

    Parameters
    ----------
    model : StatisticalModel
    seed : int
    draws : int
        Draws in each of four chains.

    Raises
    ------
    ModelError
        When a correlated discrepancy meets more measurements than a dense covariance can bear.
    """
    if model.discrepancy.is_correlated and len(model.experiment) > LARGEST_CORRELATED:
        raise ModelError(
            f"NUTS factorises a {len(model.experiment)} x {len(model.experiment)} covariance at every step; beyond "
            f"{LARGEST_CORRELATED} measurements use the sampler 'exact', or thin the data."
        )
    supports = np.array([model.priors[symbol].support for symbol in model.symbols])
    settings = NutsSettings(draws=draws, seed=seed, target_acceptance=0.95 if model.discrepancy.is_correlated else 0.9)
    density, (lower, upper) = joint_log_density(model), supports.T
    return _solution(model, sample_nuts(density, lower, upper, _start(model), settings, names=model.symbols))


def joint_log_density(model: StatisticalModel) -> Any:
    """Return the log of p(y | parameters) p(parameters) as a JAX function of the parameter vector."""
    jnp = differentiator().numpy
    design, stress = jnp.asarray(model.design), jnp.asarray(model.experiment.stress)
    stretch = jnp.asarray(model.experiment.stretch)
    columns = jnp.asarray([model.symbols.index(symbol) for symbol in model.column_symbols])

    def log_density(vector: Any) -> Any:
        values = dict(zip(model.symbols, vector, strict=True))
        residual = stress - design @ vector[columns]
        log_prior = sum(model.priors[symbol].log_density(value) for symbol, value in values.items())
        white = model.white_variance(values)
        if not model.discrepancy.is_correlated:
            squares = residual @ residual / white + len(stress) * jnp.log(2 * jnp.pi * white)
            return log_prior - 0.5 * squares
        covariance = model.discrepancy.correlated_variance(values) * model.discrepancy.correlation(
            stretch, stretch, values
        ) + white * jnp.eye(len(stress))
        cholesky = jnp.linalg.cholesky(covariance)
        whitened = differentiator().scipy.linalg.solve_triangular(cholesky, residual, lower=True)
        log_root = jnp.log(jnp.diag(cholesky)).sum()
        return log_prior - 0.5 * (whitened @ whitened + len(stress) * jnp.log(2 * jnp.pi)) - log_root

    return log_density


def _start(model: StatisticalModel) -> FloatArray:
    """Return a point inside the support: the best of some prior points, linear parameters at their conditional mean."""
    uniforms = np.random.default_rng(0).random((256, len(model.nonlinear))) ** 2
    settings = (
        np.array([model.priors[s].quantile(u) for s, u in zip(model.nonlinear, uniforms.T, strict=True)])
        .reshape(-1, 256)
        .T
    )
    given = ConditionalGaussian(model)(settings)
    best = int(np.argmax(given.log_likelihood))
    chosen = dict(zip((*model.nonlinear, *model.linear), [*settings[best], *given.mean[best]], strict=True))
    for symbol in model.linear:
        low, high = model.priors[symbol].support
        sd = float(np.linalg.norm(given.root[best, model.linear.index(symbol)]))
        margin = min(1e-6 * (high - low), 1e-3 * sd)
        chosen[symbol] = float(np.clip(chosen[symbol], low + margin, high - margin))
    return np.array([chosen[symbol] for symbol in model.symbols])


def _solution(model: StatisticalModel, sampled: NutsDraws) -> Solution:
    chains, draws, _ = sampled.values.shape
    values = dict(zip(model.symbols, np.moveaxis(sampled.values, 2, 0), strict=True))
    count = chains * draws
    weights = np.full(count, 1 / count)
    settings, mean = (
        np.array([values[symbol].ravel() for symbol in symbols]).reshape(-1, count).T
        for symbols in (model.nonlinear, model.linear)
    )
    components = Components(weights, settings, mean, np.zeros((count, mean.shape[1], mean.shape[1])))
    rhat, ess_bulk, ess_tail = (
        dict(zip(model.symbols, map(float, column), strict=True))
        for column in (sampled.rhat, sampled.ess_bulk, sampled.ess_tail)
    )
    diagnostics = Diagnostics(sampled.converged, sampled.verdict, rhat, ess_bulk, ess_tail, sampled.divergences)
    return Solution(
        model=model,
        route="nuts",
        reason=f"NUTS on the joint density of {', '.join(model.symbols)}",
        components=components,
        marginals={
            symbol: marginal_of_points(values[symbol].ravel(), weights, model.priors[symbol].support)
            for symbol in model.symbols
        },
        draws=values,
        diagnostics=diagnostics,
    )
