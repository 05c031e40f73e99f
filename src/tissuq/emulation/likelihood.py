"""The density of the measurements: emulator with its error, discrepancy and noise, Gaussian given the parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import block_diag, cho_solve, solve_triangular

from tissuq.arrays import FloatArray
from tissuq.emulation.emulator import Emulator, emulated
from tissuq.emulation.kriging import Kernel, Trend
from tissuq.emulation.problem import PriorCorrelation, Problem, has_process, symbol_of
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.noise import NOISE_SD
from tissuq.parameters.priors import Prior

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]

BLOCK_SIZE = 64
"""Number of parameter settings computed at once, which bounds the memory."""
ROUNDING_SHARE = 1e-9
"""Smallest standard deviation as a share of the largest measurement, so that no covariance is singular."""


@dataclass(frozen=True)
class Form:
    """The static arguments of compiled functions; all else is data, so that one compilation serves many data sets."""

    emulator: tuple[Kernel, Trend]
    symbols: tuple[str, ...]
    forward: int
    discrepancy: Discrepancy
    quantities: tuple[tuple[str, int, int], ...]


class Likelihood:
    """The likelihood of a problem with an emulator.

    Parameters
    ----------
    problem : Problem
    emulator : Emulator
    has_error : bool
        Whether the emulator's own error is part of it.
    """

    def __init__(self, problem: Problem, emulator: Emulator, *, has_error: bool = True) -> None:
        self.problem, self.emulator, self.has_error = problem, emulator, has_error
        self.form = Form(emulator.form, problem.symbols, len(problem.forward_symbols), problem.discrepancy,
                         tuple((name, *ends) for name, ends in problem.quantities.items()))  # fmt: skip
        self.data = {
            "emulator": emulator.arrays,
            "measured": problem.measured,
            "control": problem.control,
            "noise_sd": {name: 0.0 if sd is None else sd for name, sd in problem.noise_sd.items()},
            "has_error": float(has_error),
        }

    def log_density(self, values: FloatArray) -> FloatArray:
        """Return the log density (N,) of the measurements at parameters (N, D)."""
        return self._in_blocks(_density(self.form), values)[0]

    def predictions(self, values: FloatArray, *, discrepancy: bool, noise: bool) -> tuple[FloatArray, FloatArray]:
        """Return means and variances (N, n) at the controls, given the measurements and parameters (N, D)."""
        mean, variance = self._in_blocks(_conditional(self.form, discrepancy), values)
        return (mean, variance + self._in_blocks(_noise(self.form), values)[0]) if noise else (mean, variance)

    def replicates(self, values: FloatArray, scores: FloatArray) -> FloatArray:
        """Return new measurements (N, n), all of a row together, from parameters (N, D) and normal scores (N, n)."""
        return self._in_blocks(_replicate(self.form), np.hstack([values, scores]))[0]

    def error_ratio(self, values: FloatArray) -> float:
        """Return the largest variance of the emulator's error over that of noise and discrepancy, in any direction.

        The mean over parameters (N, D). Where it is small, the error widens any posterior by less
        than this share of its variance.
        """
        return float(self._in_blocks(_ratio(self.form), values)[0].mean())

    def misfits(self, values: FloatArray) -> FloatArray:
        """Return how far the measurements are from the model at parameters (N, D).

        The squared distance (N,) in standard deviations of noise, discrepancy and emulator together: chi-squared with n
        degrees of freedom where the model is right.
        """
        return self._in_blocks(_misfit(self.form), values)[0]

    def _in_blocks(self, function: Any, values: FloatArray) -> tuple[FloatArray, ...]:
        count = len(values)
        padded = np.concatenate([values, np.repeat(values[-1:], -count % BLOCK_SIZE, axis=0)])
        results = [function(block, self.data) for block in np.split(padded, len(padded) // BLOCK_SIZE)]
        return tuple(
            np.concatenate([np.asarray(block) for block in blocks])[:count] for blocks in zip(*results, strict=True)
        )


def _moments(form: Form, values: Any, data: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    """Return the mean, the covariances of the emulator's error and of the discrepancy, and the noise variance."""
    mean, error = emulated(form.emulator, values[: form.forward], data["emulator"])
    values_by_symbol = dict(zip(form.symbols, values, strict=True))
    blocks, rounding = [], []
    for name, start, stop in form.quantities:
        control = data["control"][start:stop]
        rounding.append(jnp.full(stop - start, ROUNDING_SHARE * jnp.abs(data["measured"][start:stop]).max()))
        if not has_process(form.discrepancy, name, form.symbols):
            blocks.append(jnp.zeros((stop - start, stop - start)))
            continue
        hyperparameters = {
            parameter.symbol: values_by_symbol[symbol_of(parameter.symbol, name)]
            for parameter in form.discrepancy.parameters
        }
        kernel = form.discrepancy.kernel(0, control, control, hyperparameters)
        blocks.append(form.discrepancy.correlated_variance(hyperparameters) * kernel)
    return (
        mean,
        data["has_error"] * error,
        block_diag(*blocks),
        _noise_variance(form, values_by_symbol, data) + jnp.concatenate(rounding) ** 2,
    )


def _noise_variance(form: Form, values_by_symbol: Mapping[str, Any], data: Mapping[str, Any]) -> Any:
    """Return the variances (n,) of the noise."""
    sds = [
        jnp.full(stop - start, values_by_symbol.get(symbol_of(NOISE_SD.symbol, name), data["noise_sd"][name]))
        for name, start, stop in form.quantities
    ]
    return jnp.concatenate(sds) ** 2


def _root(error: Any, discrepancy: Any, noise: Any) -> Any:
    return jnp.linalg.cholesky(error + discrepancy + jnp.diag(noise))


def log_density(form: Form, values: Any, data: Mapping[str, Any]) -> Any:
    """Return the log density of the measurements at parameters (D,); JAX traces it."""
    mean, error, discrepancy, noise = _moments(form, values, data)
    root = _root(error, discrepancy, noise)
    score = solve_triangular(root, data["measured"] - mean, lower=True)
    return -0.5 * score @ score - jnp.log(jnp.diag(root)).sum() - 0.5 * len(score) * jnp.log(2 * jnp.pi)


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return what compiles a function of a form, values and data for a form: over many values, once for each form."""

    @lru_cache
    def of_form(form: Form, *choices: Any) -> Any:
        return jax.jit(jax.vmap(partial(function, form, *choices), (0, None)))

    return of_form


@_compiled
def _density(form: Form, values: Any, data: Any) -> tuple[Any]:
    return (log_density(form, values, data),)


@_compiled
def _misfit(form: Form, values: Any, data: Any) -> tuple[Any]:
    mean, error, discrepancy, noise = _moments(form, values, data)
    score = solve_triangular(_root(error, discrepancy, noise), data["measured"] - mean, lower=True)
    return (score @ score,)


@_compiled
def _conditional(form: Form, discrepancy: bool, values: Any, data: Any) -> tuple[Any, Any]:
    mean, error, process, noise = _moments(form, values, data)
    root = _root(error, process, noise)
    predicted = error + process if discrepancy else error
    shift = predicted @ cho_solve((root, True), data["measured"] - mean)
    explained = solve_triangular(root, predicted, lower=True)
    return mean + shift, jnp.maximum(jnp.diag(predicted) - (explained**2).sum(axis=0), 0.0)


@_compiled
def _noise(form: Form, values: Any, data: Any) -> tuple[Any]:
    return (_noise_variance(form, dict(zip(form.symbols, values, strict=True)), data),)


@_compiled
def _replicate(form: Form, row: Any, data: Any) -> tuple[Any]:
    values, scores = jnp.split(row, [len(form.symbols)])
    mean, error, discrepancy, noise = _moments(form, values, data)
    root = _root(error, discrepancy, noise)
    shift = (error + discrepancy) @ cho_solve((root, True), data["measured"] - mean)
    half = solve_triangular(root, jnp.eye(len(scores)), lower=True)
    # A - A K^-1 A + N with K = A + N, but never singular
    spread = jnp.linalg.cholesky(2 * jnp.diag(noise) - noise[:, None] * (half.T @ half) * noise)
    return (mean + shift + spread @ scores,)


@_compiled
def _ratio(form: Form, values: Any, data: Any) -> tuple[Any]:
    _, error, discrepancy, noise = _moments(form, values, data)
    root = _root(0.0 * error, discrepancy, noise)
    half = solve_triangular(root, error, lower=True)
    return (jnp.linalg.eigvalsh(solve_triangular(root, half.T, lower=True))[-1],)


@lru_cache
def log_posterior(form: Form, priors: tuple[Prior, ...], correlation: PriorCorrelation | None = None) -> Any:
    """Return the log posterior of parameters (D,) and data, up to a constant; the same function for the same form."""

    def density(values: Any, data: Any) -> Any:
        log_prior = sum(prior.log_density(value) for prior, value in zip(priors, values, strict=True))
        if correlation is not None:
            log_prior = log_prior + correlation.log_density([values[k] for k in range(form.forward)], jnp)
        return log_density(form, values, data) + log_prior

    return density
