"""Draws at the measured points: replicated data, and the pointwise predictive density of the data."""

from __future__ import annotations

from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.solution import Solution
from tissuq.prediction.moments import correlated_parts, mean_stress

__all__ = ["MOST_VALUES", "draws_by_symbol", "pointwise_log_likelihood", "replicate_data", "stride"]

FloatArray = NDArray[np.float64]

MOST_VALUES = 40_000_000
"""Values at most in an array over draws and measurements (320 MB)."""


def stride(solution: Solution) -> int:
    """Return the step between the draws that get values at every measurement: one, unless memory would not do."""
    chains, draws = solution.shape
    return min(draws, 1 + chains * draws * len(solution.model.experiment) // MOST_VALUES)


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
        for part in correlated_parts(solution.model, settings):
            share = part.kernel / (part.kernel + part.white[:, None])
            score = generator.standard_normal(share.shape)
            along = share * ((residual[part.chosen] / part.scale) @ part.correlation.vectors)
            along += np.sqrt(share * part.white[:, None]) * score
            replicate[part.chosen] += (along @ part.correlation.vectors.T) * part.scale
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
    solved = (solution.model.stress - mean) * precision
    if solution.model.is_correlated:
        residual = solution.model.stress - mean
        for part in correlated_parts(solution.model, settings):
            solved[part.chosen] = part.solved(residual[part.chosen][:, :, None])[..., 0]
            precision[part.chosen] = part.precision
    if whitening is not None:
        solved, precision = whitening.transposed(solved.T).T, whitening.precisions(precision)
    residual, variance = solved / precision, 1 / precision
    density = -0.5 * (residual**2 / variance + np.log(variance) + log(2 * pi))
    return density.reshape(solution.shape[0], -1, mean.shape[1])


def draws_by_symbol(solution: Solution) -> dict[str, FloatArray]:
    """Return every `stride`-th draw (D,) of every parameter, the chains one after another."""
    step = stride(solution)
    return {symbol: drawn[:, ::step].ravel() for symbol, drawn in solution.draws.items()}


def _given_draws(solution: Solution) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean stress (D, n), nonlinear parameters (D, d) and white variance (D, 1 or n) of every `stride`-th draw.

    D draws in all; the stress is whitened.
    """
    model, step = solution.model, stride(solution)
    values = draws_by_symbol(solution)
    count = len(next(iter(values.values())))
    columns = np.column_stack([values[symbol] for symbol in model.column_symbols])
    settings = np.array([values[symbol] for symbol in model.nonlinear]).reshape(-1, count).T
    column_values = {symbol: drawn[:, None] for symbol, drawn in values.items()}
    levels = model.levels if model.noise.depends_on_level else 0.0
    white = np.atleast_2d(model.white_variance(column_values, levels))
    mean = mean_stress(model, columns, settings)
    if solution.drawn_discrepancy is not None:
        mean = mean + solution.drawn_discrepancy[:, ::step].reshape(mean.shape)
    return mean, settings, np.broadcast_to(white, (count, white.shape[1]))
