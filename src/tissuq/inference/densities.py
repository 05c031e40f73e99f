"""A model's densities for samplers: of all parameters, or of the nonlinear ones with the others integrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from math import log, pi
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular

from tissuq.experiments.modes import States
from tissuq.inference.linear import Fit, condition
from tissuq.inference.reduction import Reducer, divided_columns
from tissuq.mechanics import traced_stress_basis
from tissuq.model.statistical_model import StatisticalModel

Density = Callable[[Any, Any], Any]
"""Maps a parameter vector and data to what is known there; one function for all models with the same parts."""


def joint_density(model: StatisticalModel) -> tuple[Density, dict[str, Any]]:
    """Return the log of p(y | parameters) p(parameters) as a JAX function of all parameters, and its data.

    The paper's density (eq. 15 with eq. 20 to 26): a dense multivariate normal for correlated discrepancies, nothing
    integrated.
    """
    data = _measurements(model)
    if not model.bent_symbols:
        data["design"] = model.design
    return _remembered(_joint, model), data


def conditional_density(model: StatisticalModel) -> tuple[Density, dict[str, Any]]:
    """Return what is known given the nonlinear parameters h, as a JAX function of h, and its data.

    It returns log p(y | h), linear parameters integrated over their priors as if these had no bounds; the log prior
    density of h; and the mean and a root of the covariance of the linear parameters given y and h.
    """
    gaussians = np.array([model.priors[s].gaussian for s in model.linear], dtype=np.float64).reshape(-1, 3)
    data: dict[str, Any] = {"mean": gaussians[:, 0], "precision": gaussians[:, 1], "constant": gaussians[:, 2].sum()}
    if _is_reduced(model):
        reduced = {name: array[0] for name, array in vars(Reducer([model])(np.zeros((1, 0)))).items()}
        data |= {name: reduced[name] for name in ("counts", "values", "levels", "inverse", "log_size")}
        data |= {"centre": reduced["centre"][0], "squares": reduced["squares"][0]}
        data["count"] = float(model.experiment.size)
    else:
        data |= _measurements(model)
        if not model.bent_symbols:
            data["columns"] = jax.tree.map(np.asarray, _orthogonal(model, model.design, data["stress"]))
    return _remembered(_conditional, model), data


def _measurements(model: StatisticalModel) -> dict[str, Any]:
    data: dict[str, Any] = {"points": model.states.points, "stress": model.stress}
    data |= {"other": model.discrepancy.mean_basis(model.states), "count": float(model.experiment.size)}
    return data | {"levels": model.levels if model.noise.depends_on_level else np.zeros(1)}


def _is_reduced(model: StatisticalModel) -> bool:
    """Return whether one reduction of the data serves all parameters."""
    return not model.structure and model.has_directions


def _remembered(density: Callable[..., Any], model: StatisticalModel) -> Density:
    """Return one function object for all models that differ only in their data, so that JAX compiles it once."""
    identity = model.material, model.discrepancy, model.noise, model.states.paths, model.whitening, model.condensed
    return _shared(density, _Key((*identity, tuple(model.priors.items())), model))


class _Key:
    """A model, equal to every other that has the same parts and priors."""

    def __init__(self, identity: tuple[Any, ...], model: StatisticalModel) -> None:
        self.identity, self.model = identity, model

    def __eq__(self, value: object) -> bool:
        return isinstance(value, _Key) and self.identity == value.identity

    def __hash__(self) -> int:
        return hash(self.identity)


@lru_cache(maxsize=64)
def _shared(density: Callable[..., Any], key: _Key) -> Density:
    return partial(density, key.model)


def _log_prior(model: StatisticalModel, values: Mapping[str, Any]) -> Any:
    return sum((model.priors[symbol].log_density(value) for symbol, value in values.items()), jnp.zeros(()))


def _design(model: StatisticalModel, values: Mapping[str, Any], data: Mapping[str, Any]) -> Any:
    """Return the (n, k) mean stresses of unit parameters."""
    if not model.bent_symbols:
        return data["design"]
    bent = jnp.stack([values[symbol] for symbol in model.bent_symbols])
    of_material = traced_stress_basis(model.material, _states(model, data), bent)
    return model.rows(jnp.hstack([of_material, data["other"]]))


def _states(model: StatisticalModel, data: Mapping[str, Any]) -> States:
    """Return the states of the measurements at points that JAX may trace."""
    return replace(model.states, points=data["points"])


def _whitened(
    model: StatisticalModel, values: Mapping[str, Any], data: Mapping[str, Any], columns: Any
) -> tuple[Any, Any]:
    """Return V^-1/2 times columns (n, k), and log |V|."""
    n = len(columns)
    white = jnp.broadcast_to(model.white_variance(values, data["levels"]), n)
    if not model.is_correlated:
        return columns / jnp.sqrt(white)[:, None], data["count"] * jnp.log(white).mean()
    states = _states(model, data)
    correlation = model.white(model.white(model.correlation(states, states, values)).T)
    root = jnp.linalg.cholesky(model.correlated_variance(values) * correlation + jnp.diag(white))
    return solve_triangular(root, columns, lower=True), 2 * jnp.log(jnp.diag(root)).sum()


def _joint(model: StatisticalModel, vector: Any, data: Mapping[str, Any]) -> Any:
    values = dict(zip(model.symbols, vector, strict=True))
    columns = jnp.asarray([model.symbols.index(symbol) for symbol in model.column_symbols])
    residual = data["stress"] - _design(model, values, data) @ vector[columns]
    (whitened, log_determinant) = _whitened(model, values, data, residual[:, None])
    exponent = (whitened**2).sum() + log_determinant + data["count"] * log(2 * pi)
    return _log_prior(model, values) + model.log_whitening - 0.5 * exponent


def _orthogonal(model: StatisticalModel, design: Any, stress: Any) -> tuple[Any, Fit]:
    """Return the data matrix [Q, F, e], and the fit that it is the basis of."""
    free, fixed = divided_columns(model)
    basis, triangle = jnp.linalg.qr(design[:, free])
    inverse = solve_triangular(triangle, jnp.eye(len(free)))
    centre = inverse @ (basis.T @ stress)
    columns = jnp.hstack([basis, design[:, fixed], (stress - design[:, free] @ centre)[:, None]])
    return columns, Fit(inverse, jnp.log(jnp.abs(jnp.diag(triangle))).sum(), centre)


def _conditional(model: StatisticalModel, h: Any, data: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    values = dict(zip(model.nonlinear, h, strict=True))
    moments, log_determinant, fit = _moments(model, values, data)
    fixed = [values[symbol] for symbol in model.column_symbols if symbol not in model.linear]
    multipliers = jnp.stack([*(-value for value in fixed), jnp.ones(())])
    prior = data["mean"], data["precision"], data["constant"] + model.log_whitening
    conditional = condition(moments, log_determinant, fit, multipliers, prior, data["count"])
    return conditional.log_likelihood, _log_prior(model, values), conditional.mean, conditional.root


def _moments(model: StatisticalModel, values: Mapping[str, Any], data: Mapping[str, Any]) -> tuple[Any, Any, Fit]:
    """Return D' V^-1 D for the data matrix D = [Q, F, e], log |V|, and the fit that D is the basis of."""
    q = len(model.column_symbols) + 1
    if _is_reduced(model):
        variances = model.white_variance(values, data["levels"]) + model.correlated_variance(values) * data["values"]
        variances = jnp.broadcast_to(variances, data["counts"].shape)
        moments = ((1 / variances) @ data["squares"]).reshape(q, q)
        fit = Fit(data["inverse"], data["log_size"], data["centre"])
        return moments, data["counts"] @ jnp.log(variances), fit
    if model.bent_symbols:
        columns, fit = _orthogonal(model, _design(model, values, data), data["stress"])
    else:
        columns, fit = data["columns"]
    whitened, log_determinant = _whitened(model, values, data, columns)
    return whitened.T @ whitened, log_determinant, fit
