"""Draws at the measured points: replicated data, and the pointwise predictive density of the data."""

from __future__ import annotations

from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.solution import Solution
from tissuq.prediction.moments import correlated_parts

__all__ = ["pointwise_log_likelihood", "replicate_data"]

FloatArray = NDArray[np.float64]


def replicate_data(solution: Solution, seed: int) -> FloatArray:
    """Return (chains, draws, n) replicated stresses, MPa: a draw of everything, discrepancy and noise included.

    A correlated discrepancy is drawn given the data, at the draw's own parameters (eq. 27 as corrected).
    """
    generator = np.random.default_rng([seed, 3])
    mean, settings, white = _given_draws(solution)
    replicate = mean + np.sqrt(white)[:, None] * generator.standard_normal(mean.shape)
    if solution.model.discrepancy.is_correlated:
        residual = solution.model.experiment.stress - mean
        for part in correlated_parts(solution.model, settings):
            share = part.kernel / (part.kernel + part.white[:, None])
            score = generator.standard_normal(share.shape)
            along = share * (residual[part.chosen] @ part.correlation.vectors)
            along += np.sqrt(share * part.white[:, None]) * score
            replicate[part.chosen] += along @ part.correlation.vectors.T
    return replicate.reshape(*solution.drawn_from.shape, -1)


def pointwise_log_likelihood(solution: Solution) -> FloatArray:
    """Return (chains, draws, n) log densities of each stress given all others and the draw's parameters.

    Without a correlated discrepancy this is the ordinary pointwise log likelihood; with one it is the closed
    form of leave-one-out conditioning (Sundararajan & Keerthi 2001), which is what PSIS-LOO needs.
    """
    mean, settings, white = _given_draws(solution)
    residual = solution.model.experiment.stress - mean
    variance = np.broadcast_to(white[:, None], residual.shape).copy()
    if solution.model.discrepancy.is_correlated:
        for part in correlated_parts(solution.model, settings):
            vectors = part.correlation.vectors
            own, inverse = residual[part.chosen], 1 / (part.kernel + part.white[:, None])
            inside = own @ vectors
            solved = (inside * inverse) @ vectors.T + (own - inside @ vectors.T) / part.white[:, None]
            rest = np.maximum(1 - (vectors**2).sum(axis=1), 0.0)
            diagonal = inverse @ (vectors**2).T + rest / part.white[:, None]
            residual[part.chosen], variance[part.chosen] = solved / diagonal, 1 / diagonal
    density = -0.5 * (residual**2 / variance + np.log(variance) + log(2 * pi))
    return density.reshape(*solution.drawn_from.shape, -1)


def _given_draws(solution: Solution) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean stress (D, n), nonlinear parameters (D, d) and white variance (D,) of every draw."""
    model, values = solution.model, solution.drawn_values()
    count = solution.drawn_from.size
    columns = np.column_stack([values[symbol] for symbol in model.column_symbols])
    settings = np.array([values[symbol] for symbol in model.nonlinear]).reshape(-1, count).T
    white = np.broadcast_to(model.white_variance(values), count).astype(float)
    return columns @ model.design.T, settings, white
