"""Densities of the measurements under a posterior, at draws, left out and all together; and replicated data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import log, pi

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.inference.enumerators.noise_grid import NoiseGrid, shares_with_factors
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.linear import integrated
from tissuq.inference.solution import Solution
from tissuq.model.discrepancy import side_by_side
from tissuq.model.noise import NOISE_SD
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import (
    basis_of,
    coefficients,
    correlated_groups,
    mean_stress,
    stress_moments,
    values_by_symbol,
)

MAX_VALUES_AT_ONCE, MAX_VALUES_CONDENSED = 40_000_000, 4_000_000
"""Values at most in an array over draws and measurements (320 MB), and where the measurements are condensed."""


MAX_NOISE_VALUES = 100
"""Values of the noise that a sum over it has at most."""


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
        noise, stress = replicate - mean, solution.model.whitening.undone(mean.T).T
        for model, rows in _at_noise(solution.model, settings):
            assert model.whitening is not None  # noqa: S101 (another level has one, too)
            replicate[rows] = stress[rows] + model.whitening.undone(noise[rows].T).T
    return replicate.reshape(solution.shape[0], -1, mean.shape[1])


def pointwise_log_likelihood(solution: Solution) -> FloatArray:
    """Return (chains, draws, n) log densities of each stress given all others and the draw's parameters.

    Without a correlated discrepancy this is the ordinary pointwise log likelihood; with one it is the closed
    form of leave-one-out conditioning (Sundararajan & Keerthi 2001), which is what PSIS-LOO of the draws needs.
    """
    mean, settings, white = _given_draws(solution)
    density = np.empty_like(mean)
    for model, rows in _at_noise(solution.model, settings):
        if model is not solution.model and solution.model.whitening is not None:
            mean[rows] = model.white(solution.model.whitening.undone(mean[rows].T)).T
        density[rows] = _pointwise(model, mean[rows], settings[rows], white[rows])
    return density.reshape(solution.shape[0], -1, mean.shape[1])


def _pointwise(model: StatisticalModel, mean: FloatArray, settings: FloatArray, white: FloatArray) -> FloatArray:
    precision = 1 / np.broadcast_to(white, mean.shape)
    stress = model.stress if model.condensed is None else model.experiment.stress
    solved = (stress - mean) * precision
    if model.is_correlated:
        residual = model.stress - mean
        for group in correlated_groups(model, settings):
            solved[group.components] = group.covariance.solved(residual[group.components][:, :, None])[..., 0]
            precision[group.components] = group.covariance.precision
    if model.whitening is not None:
        solved, precision = model.whitening.transposed(solved.T).T, model.whitening.precisions(precision)
    residual, variance = solved / precision, 1 / precision
    return np.asarray(-0.5 * (residual**2 / variance + np.log(variance) + log(2 * pi)))


def _at_noise(model: StatisticalModel, settings: FloatArray) -> Iterator[tuple[StatisticalModel, IndexArray]]:
    """Yield a model for every value of the noise, and at which settings (M, d) of the nonlinear parameters that is.

    It matters beside errors of whole tests, whose sizes do not grow with the noise. Where the noise was sampled, or
    adds to that of the discrepancy, they are those at its estimated level.
    """
    noise = settings[:, model.nonlinear.index(NOISE_SD.symbol)] if NOISE_SD.symbol in model.nonlinear else np.zeros(0)
    values = np.unique(noise)
    if not model.tolerances or model.discrepancy.is_scattered or not 0 < len(values) <= MAX_NOISE_VALUES:
        yield model, np.arange(len(settings))
        return
    for value in values:
        yield model.with_errors(level=float(value)), np.flatnonzero(noise == value)


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


BLOCK = 4_000_000
"""Values in an array over components, measurements and parameters at once: what bounds the memory."""
MIN_COMPONENTS = 5
"""Number of components to which the posterior of very many measurements is thinned at the most."""
MIN_EFFECTIVE_SHARE, MAX_KHAT = 0.2, 0.7
"""Effective number of components that are left without a measurement, as a share of those with it, below which its
density is rough; and the Pareto shape from which it is (Vehtari, Gelman & Gabry 2017)."""
MAX_GAIN_AT_END = 0.2
"""By how much the share of the lowest or of the highest value of the noise may grow without a measurement whose density
is not rough."""
ARRAYS_PER_CONDENSED = 4
"""Arrays over components and condensed measurements that take part in a density."""
MIN_PRECISION_SHARE = 1e-12
"""Smallest share of the precision of a measurement that counts as given by the others, against rounding."""


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Log densities (n,) of each stress given all the others, and whether each is rough: known by few components."""

    log_density: FloatArray
    is_rough: BoolArray


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
    wide, is_condensed = solution.wide_mixture, solution.model.condensed is not None
    size = solution.model.experiment.size * (ARRAYS_PER_CONDENSED if is_condensed else max(1, wide.root.shape[2]))
    is_thinned = len(wide.weights) * size > MAX_VALUES_AT_ONCE
    components = wide.thinned(max(MIN_COMPONENTS, MAX_VALUES_AT_ONCE // size)) if is_thinned else wide
    density = left_out_log_density(solution.model, components)
    with np.errstate(divide="ignore"):  # a component may have no weight
        log_weights = np.log(components.weights)[:, None] - density
    is_unsure = np.zeros(density.shape[1], dtype=bool)
    if solution.diagnostics is not None and len(components.weights) > MIN_COMPONENTS:
        from arviz_stats.base import array_stats

        varies = np.ptp(density, axis=0) > 0  # a material has no stress at rest, whatever its parameters
        smoothed, khat = array_stats.psislw(density[:, varies], axis=0)
        log_weights[:, varies], is_unsure[varies] = smoothed.T, khat > MAX_KHAT
    elif not NoiseGrid.why_not(solution.model):
        log_weights, is_unsure = _over_noise(solution.model, wide, components, log_weights)
    log_weights = log_weights - np.logaddexp.reduce(log_weights, axis=0)
    effective = components.weights.sum() ** 2 / (components.weights**2).sum()
    remaining = 1 / np.exp(2 * log_weights).sum(axis=0)
    log_density = np.logaddexp.reduce(log_weights + density, axis=0)
    return LeaveOneOut(log_density, is_unsure | (remaining < MIN_EFFECTIVE_SHARE * effective))


def _over_noise(
    model: StatisticalModel, wide: GaussianMixture, components: GaussianMixture, log_weights: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return log weights (M, n) with those at each value of the noise as its density says, and what is unsure (n,).

    A measurement that is left out moves the noise, and its inverse density changes much from one value to the next.
    """
    column = model.nonlinear.index(NOISE_SD.symbol)
    values, number = np.unique(components.settings[:, column], return_inverse=True)
    shares = np.array([wide.weights[wide.settings[:, column] == value].sum() for value in values])
    if len(values) < 2:
        return log_weights, np.zeros(log_weights.shape[1], dtype=bool)
    rows = [np.flatnonzero(number == index) for index in range(len(values))]
    of_values = np.array([np.logaddexp.reduce(log_weights[of_value], axis=0) for of_value in rows])
    weights = np.array([components.weights[of_value].sum() for of_value in rows])
    shares /= shares.sum()
    log_factors = of_values - np.log(weights)[:, None]
    reweighted = shares_with_factors(np.log(values), shares, log_factors, model.priors[NOISE_SD.symbol])
    with np.errstate(divide="ignore"):
        log_weights = log_weights + (np.log(reweighted) - of_values)[number]
    return log_weights, (reweighted - shares[:, None])[[0, -1]].max(axis=0) > MAX_GAIN_AT_END


def left_out_log_density(model: StatisticalModel, components: GaussianMixture) -> FloatArray:
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
    if model.condensed is not None:
        return _left_out_of_condensed(model, components)
    count, size = len(components.weights), model.experiment.size * max(1, components.root.shape[2])
    density = np.empty((count, model.experiment.size))
    for at_noise, rows in _at_noise(model, components.settings):
        for block in np.array_split(rows, min(len(rows), 1 + len(rows) * size // BLOCK)):
            density[block] = _left_out(at_noise, components[block])
    return density


def _left_out_of_condensed(model: StatisticalModel, components: GaussianMixture) -> FloatArray:
    """Return the same from the means and variances of the stress at the points to which measurements are condensed."""
    independent = model.discrepancy.independent_variance(values_by_symbol(model, components.settings))
    mean, variance = stress_moments(model, components, model.states)
    white = _white_variance(model, components.settings)[:, :1]
    residual = model.experiment.stress - model.at_measurements(mean.T).T
    leverage = model.at_measurements((variance - independent).T).T / white
    loo = white / np.maximum(1 - leverage, MIN_PRECISION_SHARE)  # the variance of a measurement given the others
    return np.asarray(-0.5 * ((residual * loo / white) ** 2 / loo + np.log(loo) + log(2 * pi)))


def _left_out(model: StatisticalModel, components: GaussianMixture) -> FloatArray:
    mean_b, root_b = coefficients(model, components)
    if model.bent_symbols:
        bases = basis_of(model, model.experiment.states, components.settings)
        basis = np.array([model.white(columns) for columns in bases])
    else:
        basis = model.design
    residual = model.stress - (basis @ mean_b[:, :, None])[:, :, 0]
    root = basis @ root_b
    if components.member is not None:
        for number in np.unique(components.member):
            rows = np.flatnonzero(components.member == number)
            features = side_by_side(model.energy_features(number), model.experiment.size)
            weights = slice(len(model.linear), len(model.linear) + features.shape[1])
            residual[rows] -= components.mean[rows, weights] @ features.T
            root[rows] += features @ components.root[rows, weights]
    precision = np.empty_like(residual)
    if model.is_correlated:
        for group in correlated_groups(model, components.settings):
            rows = group.components
            solved = group.covariance.solved(np.concatenate([residual[rows, :, None], root[rows]], axis=2))
            residual[rows], root[rows] = solved[..., 0], solved[..., 1:]
            precision[rows] = group.covariance.precision
    else:
        precision[:] = 1 / _white_variance(model, components.settings)
        residual *= precision
        root *= precision[:, :, None]
    if model.whitening is not None:
        residual, precision = model.whitening.transposed(residual.T).T, model.whitening.precisions(precision)
        root = np.array([model.whitening.transposed(columns) for columns in root])
    loo = np.maximum(precision - (root**2).sum(axis=2), MIN_PRECISION_SHARE * precision)
    return np.asarray(-0.5 * (residual**2 / loo - np.log(loo) + log(2 * pi)))


def joint_log_likelihood(solution: Solution) -> FloatArray:
    """Return (chains, draws) log densities of all measurements given a draw's parameters, the discrepancy integrated.

    The likelihood of linear and nonlinear parameters together: whatever the discrepancy is, its random part counts
    among the errors, and the amplitudes that set its size are parameters.
    """
    model = solution.model
    step = stride(solution) if model.condensed is None else 1
    values = draws_by_symbol(solution, step)
    count = len(next(iter(values.values())))
    columns, settings = (
        np.array([values[symbol] for symbol in symbols]).reshape(len(symbols), count).T
        for symbols in (model.column_symbols, model.nonlinear)
    )
    component_index = solution.component_of_draw[:, ::step]
    member = None if solution.mixture.member is None else solution.mixture.member[component_index].ravel()
    density = np.empty(count)
    for at_noise, rows in _at_noise(model, settings):
        for block in np.array_split(rows, min(len(rows), 1 + len(rows) * len(model.stress) // BLOCK)):
            members = None if member is None else member[block]
            density[block] = _joint(at_noise, columns[block], settings[block], members)
    return density.reshape(component_index.shape)


def _joint(model: StatisticalModel, columns: FloatArray, settings: FloatArray, member: IndexArray | None) -> FloatArray:
    mean = mean_stress(model, columns, settings)
    residual = model.stress - (mean if model.condensed is None else model.condensed(mean.T).T)
    exponent = np.empty(len(residual))  # the squared residual plus the log determinant
    if model.is_correlated:
        for group in correlated_groups(model, settings):
            correlated = residual[group.components]
            solved = group.covariance.solved(correlated[:, :, None])[..., 0]
            exponent[group.components] = (correlated * solved).sum(axis=1) + group.covariance.log_determinant
    else:
        white = _white_variance(model, settings)
        exponent = (residual**2 / white).sum(axis=1) + model.experiment.size * np.log(white).mean(axis=1)
        if member is not None:
            for number in np.unique(member):
                rows = np.flatnonzero(member == number)
                exponent[rows] += _with_energies(model, int(number), residual[rows], settings[rows], white[rows])
    return np.asarray(model.log_whitening - 0.5 * (exponent + model.experiment.size * log(2 * pi)))


def _with_energies(
    model: StatisticalModel, number: int, residual: FloatArray, settings: FloatArray, white: FloatArray
) -> FloatArray:
    """Return what an energy discrepancy, its weights integrated, adds to squared residual and log determinant."""
    blocks = model.energy_features(number)
    features = side_by_side(blocks, len(model.stress))
    symbols = [model.energy_symbols[k] for k in model.energy_members[number].amplitude_indices]
    amplitudes = settings[:, [model.nonlinear.index(symbol) for symbol in symbols]]
    scale = np.repeat(amplitudes, [block.shape[1] for block in blocks], axis=1)
    if model.noise.depends_on_level:
        products = np.stack([features.T @ (features / variances[:, None]) for variances in white])
    else:
        products = (features.T @ features) / white[:, :1, None]
    precision = np.eye(features.shape[1]) + scale[:, :, None] * products * scale[:, None, :]
    result = integrated(precision, (scale * ((residual / white) @ features))[:, :, None], np.zeros((len(scale), 1)))
    return np.asarray(result.misfit[:, 0] - 2 * result.log_volume)


def _white_variance(model: StatisticalModel, settings: FloatArray) -> FloatArray:
    """Return the variances (M, n) of what is independent from measurement to measurement."""
    values = values_by_symbol(model, settings)
    levels = model.levels if model.noise.depends_on_level else 0.0
    return np.broadcast_to(model.white_variance(values, levels), (len(settings), len(model.stress)))
