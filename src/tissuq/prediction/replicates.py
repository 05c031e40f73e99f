"""Draws at the measured points: replicated data, and the pointwise predictive density of the data."""

from __future__ import annotations

from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.solution import Solution
from tissuq.prediction.moments import correlated_groups, mean_stress

__all__ = ["MAX_VALUES_AT_ONCE", "draws_by_symbol", "pointwise_log_likelihood", "replicate_data", "stride"]

FloatArray = NDArray[np.float64]

MAX_VALUES_AT_ONCE, MAX_VALUES_CONDENSED = 40_000_000, 4_000_000
"""Values at most in an array over draws and measurements (320 MB), and where the measurements are condensed."""


def stride(solution: Solution) -> int:
    """Return the step between the draws that get values at every measurement: one, unless memory would not do."""
    chains, draws = solution.shape
    max_values = MAX_VALUES_AT_ONCE if solution.model.condensed is None else MAX_VALUES_CONDENSED
    return min(draws, 1 + chains * draws * solution.model.experiment.size // max_values)


def replicate_data(solution: Solution, seed: int) -> FloatArray:
    """Return (chains, draws, n) replicated stresses, MPa: a draw of everything, discrepancy and noise included.

    Where there are many measurements, only every `stride`-th draw is there. A correlated discrepancy is drawn given
    the data, at the draw's own parameters (eq. 27 as corrected).
    """
    generator = np.random.default_rng([seed, 3])
    mean, settings, white = _given_draws(solution)
    replicate = mean + np.sqrt(white) * generator.standard_normal(mean.shape)
    if solution.model.is_correlated:
        residual = solution.model.stress - mean
        for group in correlated_groups(solution.model, settings):
            share = group.covariance.correlated / (group.covariance.correlated + group.covariance.white[:, None])
            score = generator.standard_normal(share.shape)
            along = share * ((residual[group.components] / group.covariance.size) @ group.covariance.spectrum.vectors)
            along += np.sqrt(share * group.covariance.white[:, None]) * score
            replicate[group.components] += (along @ group.covariance.spectrum.vectors.T) * group.covariance.size
    if solution.model.whitening is not None:
        replicate = solution.model.whitening.undone(replicate.T).T
    return replicate.reshape(solution.shape[0], -1, mean.shape[1])


def pointwise_log_likelihood(solution: Solution) -> FloatArray:
    """Return (chains, draws, n) log densities of each stress given all others and the draw's parameters.

    Without a correlated discrepancy this is the ordinary pointwise log likelihood; with one it is the closed
    form of leave-one-out conditioning (Sundararajan & Keerthi 2001), which is what PSIS-LOO of the draws needs.
    """
    mean, settings, white = _given_draws(solution)
    whitening = solution.model.whitening
    precision = 1 / np.broadcast_to(white, mean.shape)
    stress = solution.model.stress if solution.model.condensed is None else solution.model.experiment.stress
    solved = (stress - mean) * precision
    if solution.model.is_correlated:
        residual = solution.model.stress - mean
        for group in correlated_groups(solution.model, settings):
            solved[group.components] = group.covariance.solved(residual[group.components][:, :, None])[..., 0]
            precision[group.components] = group.covariance.precision
    if whitening is not None:
        solved, precision = whitening.transposed(solved.T).T, whitening.precisions(precision)
    residual, variance = solved / precision, 1 / precision
    density = -0.5 * (residual**2 / variance + np.log(variance) + log(2 * pi))
    return density.reshape(solution.shape[0], -1, mean.shape[1])


def draws_by_symbol(solution: Solution, step: int) -> dict[str, FloatArray]:
    """Return every so many-th draw (D,) of every parameter, the chains one after another."""
    return {symbol: drawn[:, ::step].ravel() for symbol, drawn in solution.draws.items()}


def _given_draws(solution: Solution) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean stress (D, n), nonlinear parameters (D, d) and white variance (D, 1 or n) of every `stride`-th draw.

    D draws in all; the stress is whitened.
    """
    model, step = solution.model, stride(solution)
    values = draws_by_symbol(solution, step)
    count = len(next(iter(values.values())))
    columns = np.column_stack([values[symbol] for symbol in model.column_symbols])
    settings = np.array([values[symbol] for symbol in model.nonlinear]).reshape(-1, count).T
    column_values = {symbol: drawn[:, None] for symbol, drawn in values.items()}
    levels = model.levels if model.noise.depends_on_level else 0.0
    white = np.atleast_2d(model.white_variance(column_values, levels))
    mean = mean_stress(model, columns, settings)
    if solution.drawn_discrepancy is not None:
        mean = mean + solution.drawn_discrepancy[:, ::step].reshape(mean.shape)
    mean = model.at_measurements(mean.T).T
    return mean, settings, np.broadcast_to(white, (count, white.shape[1]))
