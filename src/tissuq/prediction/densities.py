"""Densities of the measurements under draws of a posterior: each given the others, and all together."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy import side_by_side
from tissuq.inference.solution import Components, Solution
from tissuq.model import StatisticalModel
from tissuq.prediction.moments import basis_of, coefficients, correlated_parts, mean_stress
from tissuq.prediction.replicates import MOST_VALUES, draws_by_symbol, stride

__all__ = ["LeaveOneOut", "joint_log_likelihood", "leave_one_out", "left_out_log_density"]

FloatArray = NDArray[np.float64]

BLOCK = 4_000_000
"""Values in an array over components, measurements and parameters at once: what bounds the memory."""
FEWEST = 5
"""Components, at least, that stand for the posterior of very many measurements."""
EFFECTIVE, MOST_KHAT = 0.2, 0.7
"""Effective number of components that are left without a measurement, as a share of those with it, below which its
density is rough; and the Pareto shape from which it is (Vehtari, Gelman & Gabry 2017)."""
LEAST = 1e-12
"""Share of a measurement's precision that the others must leave to it; with less they say nothing about it."""


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Log densities (n,) of each stress given all the others, and whether each is rough: known by few components."""

    log_density: FloatArray
    is_rough: NDArray[np.bool_]


def leave_one_out(solution: Solution) -> LeaveOneOut:
    """Return the density of each stress given all others, parameters and discrepancy integrated.

    1 / p(y_i | others) is the posterior mean of 1 / p(y_i | others, h). The inner density is a closed form
    (`left_out_log_density`); the mean over h is the sum over the components of an integrated posterior, and
    Pareto-smoothed importance sampling over those of a sampled one. Where bounds or a sampler left draws of the linear
    parameters instead of Gaussians, these belong to h; bounds that do not cut the whole posterior are not looked at.

    References
    ----------
    Gelfand, Dey & Chang (1992), Bayesian Statistics 4, 147-167; Vehtari, Gelman & Gabry (2017), Statistics and
    Computing 27, 1413-1432 (PSIS).
    """
    components = solution.wide_components
    size = len(solution.model.experiment) * max(1, components.root.shape[2])
    if len(components.weights) * size > MOST_VALUES:
        components = components.thinned(max(FEWEST, MOST_VALUES // size))
    density = left_out_log_density(solution.model, components)
    with np.errstate(divide="ignore"):  # a component may have no weight
        log_weights = np.log(components.weights)[:, None] - density
    is_unsure = np.zeros(density.shape[1], dtype=bool)
    if solution.diagnostics is not None and len(components.weights) > FEWEST:
        from arviz_stats.base import array_stats

        varies = np.ptp(density, axis=0) > 0  # a material has no stress at rest, whatever its parameters
        smoothed, khat = array_stats.psislw(density[:, varies], axis=0)
        log_weights[:, varies], is_unsure[varies] = smoothed.T, khat > MOST_KHAT
    log_weights = log_weights - log_weights.max(axis=0)
    weights = np.exp(log_weights) / np.exp(log_weights).sum(axis=0)
    effective = (components.weights**2).sum() / (weights**2).sum(axis=0)
    top = density.max(axis=0)
    found = top + np.log((weights * np.exp(density - top)).sum(axis=0))
    return LeaveOneOut(found, is_unsure | (effective < EFFECTIVE))


def left_out_log_density(model: StatisticalModel, components: Components) -> FloatArray:
    """Return log p(y_i | all other y, h), (M, n), for every component of a posterior.

    Given h all is Gaussian: y ~ N(X b0, P^-1) with P = V^-1 - V^-1 X S X' V^-1, V the covariance of errors and
    discrepancy and S that of the linear parameters given the data. Then y_i given the others is normal with residual
    [V^-1 (y - X b)]_i / P_ii and variance 1 / P_ii, b the posterior mean; without correlation these are the residual
    and the variance over one minus the leverage.

    References
    ----------
    Sundararajan & Keerthi (2001), Neural Computation 13, 1103-1118; Vehtari, Mononen, Tolvanen, Sivula & Winther
    (2016), JMLR 17(103), 1-38.
    """
    count, size = len(components.weights), len(model.experiment) * max(1, components.root.shape[2])
    blocks = np.array_split(np.arange(count), min(count, 1 + count * size // BLOCK))
    return np.concatenate([_left_out(model, components[block]) for block in blocks])


def _left_out(model: StatisticalModel, components: Components) -> FloatArray:
    mean_b, root_b = coefficients(model, components)
    if model.bent_symbols:
        bases = basis_of(model, model.experiment.stretch, components.settings)
        basis = np.array([model.white(each) for each in bases])
    else:
        basis = model.design
    residual = model.stress - (basis @ mean_b[:, :, None])[:, :, 0]
    root = basis @ root_b
    if components.member is not None:
        for place in np.unique(components.member):
            own = np.flatnonzero(components.member == place)
            features = side_by_side(model.energy_features(place), len(model.experiment))
            weights = slice(len(model.linear), len(model.linear) + features.shape[1])
            residual[own] -= components.mean[own, weights] @ features.T
            root[own] += features @ components.root[own, weights]
    precision = np.empty_like(residual)
    if model.is_correlated:
        for part in correlated_parts(model, components.settings):
            own = part.chosen
            solved = part.solved(np.concatenate([residual[own, :, None], root[own]], axis=2))
            residual[own], root[own] = solved[..., 0], solved[..., 1:]
            precision[own] = part.precision
    else:
        precision[:] = 1 / _white_variance(model, components.settings)
        residual *= precision
        root *= precision[:, :, None]
    if model.whitening is not None:
        residual, precision = model.whitening.transposed(residual.T).T, model.whitening.precisions(precision)
        root = np.array([model.whitening.transposed(each) for each in root])
    left = np.maximum(precision - (root**2).sum(axis=2), LEAST * precision)
    return np.asarray(-0.5 * (residual**2 / left - np.log(left) + log(2 * pi)))


def joint_log_likelihood(solution: Solution) -> FloatArray:
    """Return (chains, draws) log densities of all measurements given a draw's parameters, the discrepancy integrated.

    The likelihood of linear and nonlinear parameters together: whatever the discrepancy is, its random part counts
    among the errors, and the amplitudes that set its size are parameters.
    """
    model, step = solution.model, stride(solution)
    values = draws_by_symbol(solution)
    count = len(next(iter(values.values())))
    columns, settings = (
        np.array([values[symbol] for symbol in symbols]).reshape(len(symbols), count).T
        for symbols in (model.column_symbols, model.nonlinear)
    )
    chosen = solution.component_of_draw[:, ::step]
    member = None if solution.components.member is None else solution.components.member[chosen].ravel()
    blocks = np.array_split(np.arange(count), min(count, 1 + count * len(model.experiment) // BLOCK))
    found = [
        _joint(model, columns[block], settings[block], None if member is None else member[block]) for block in blocks
    ]
    return np.concatenate(found).reshape(chosen.shape)


def _joint(
    model: StatisticalModel, columns: FloatArray, settings: FloatArray, member: NDArray[np.intp] | None
) -> FloatArray:
    residual = model.stress - mean_stress(model, columns, settings)
    exponent = np.empty(len(residual))  # the squared residual plus the log determinant
    if model.is_correlated:
        for part in correlated_parts(model, settings):
            own = residual[part.chosen]
            solved = part.solved(own[:, :, None])[..., 0]
            exponent[part.chosen] = (own * solved).sum(axis=1) + part.log_determinant
    else:
        white = _white_variance(model, settings)
        exponent = (residual**2 / white + np.log(white)).sum(axis=1)
        if member is not None:
            for place in np.unique(member):
                mine = np.flatnonzero(member == place)
                exponent[mine] += _with_energies(model, int(place), residual[mine], settings[mine], white[mine])
    return np.asarray(model.log_whitening - 0.5 * (exponent + residual.shape[1] * log(2 * pi)))


def _with_energies(
    model: StatisticalModel, place: int, residual: FloatArray, settings: FloatArray, white: FloatArray
) -> FloatArray:
    """Return what an energy discrepancy adds to the squared residual and the log determinant (Woodbury)."""
    blocks = model.energy_features(place)
    features = side_by_side(blocks, len(model.experiment))
    symbols = [model.energy_symbols[k] for k in model.energy_members[place].places]
    amplitudes = settings[:, [model.nonlinear.index(symbol) for symbol in symbols]]
    scale = np.repeat(amplitudes, [each.shape[1] for each in blocks], axis=1)
    if model.noise.depends_on_level:
        products = np.stack([features.T @ (features / own[:, None]) for own in white])
    else:
        products = (features.T @ features) / white[:, :1, None]
    triangle = np.linalg.cholesky(np.eye(features.shape[1]) + scale[:, :, None] * products * scale[:, None, :])
    along = scale * ((residual / white) @ features)
    whitened = np.linalg.solve(triangle, along[:, :, None])[:, :, 0]
    return np.asarray(2 * np.log(np.einsum("mii->mi", triangle)).sum(axis=1) - (whitened**2).sum(axis=1))


def _white_variance(model: StatisticalModel, settings: FloatArray) -> FloatArray:
    """Return the variances (M, n) of what is independent from measurement to measurement."""
    values = {symbol: column[:, None] for symbol, column in zip(model.nonlinear, settings.T, strict=True)}
    levels = model.levels if model.noise.depends_on_level else 0.0
    return np.broadcast_to(model.white_variance(values, levels), (len(settings), len(model.experiment)))
