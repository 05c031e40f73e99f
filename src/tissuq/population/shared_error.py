"""A model error that all specimens share: the same missing physics, which does not average out.

Given its discrepancy, a specimen leaves its parameters open only as far as the noise does. The rest of its posterior
covariance is due to the discrepancy (law of total variance),

    V_i = Cov(theta_i) - E[Cov(theta_i | discrepancy)].

If the discrepancy is the same in all specimens, so is what it does to their parameters: a bias b ~ N(0, V) of all of
them, V the mean of the V_i. It is added to the draws of the hierarchy, which keeps its spread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.solution import Solution
from tissuq.model.discrepancy import NoDiscrepancy
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.checks import check_probability
from tissuq.parameters.priors import Flat, Prior
from tissuq.population.draws import PopulationDraws, interval
from tissuq.population.likelihoods import Coordinates, on_line
from tissuq.population.sample_size import relative_width, score
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.moments import values_by_symbol, values_of

if TYPE_CHECKING:
    import pandas as pd

    from tissuq.population.hierarchy import Hierarchy

COMPONENTS, BENT_COMPONENTS = 200, 32
"""Components of a posterior over which covariances given the discrepancy are averaged; of a law with exponents."""
ROUNDING = 1e-12
"""Of correlations, so that those of one are no obstacle."""
RELATIVE_STEP = 1e-4
"""Of an exponent, for the slope of the stress."""


def shared_covariance(posteriors: Sequence[Posterior], coordinates: Coordinates) -> FloatArray:
    """Return the covariance (d, d), on the line, of the bias of all specimens if they share their discrepancy."""
    return np.asarray(
        np.mean([_due_to_discrepancy(posterior.solution, coordinates) for posterior in posteriors], axis=0)
    )


def biased(hierarchy: Hierarchy, covariance: FloatArray, seed: int) -> Hierarchy:
    """Return draws of a population with a bias N(0, covariance), in each draw the same of mean and specimens."""
    values, vectors = np.linalg.eigh(covariance)
    standard = np.random.default_rng([seed, 8]).standard_normal(hierarchy.mean.shape)
    bias = standard @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return replace(hierarchy, mean=hierarchy.mean + bias, specimens=hierarchy.specimens + bias[:, :, None])


def width_table(population: PopulationDraws, covariance: FloatArray, prob: float) -> pd.DataFrame:
    """Return `Population.median_half_widths` for the covariance (d, d) of a shared bias."""
    import pandas as pd

    check_probability(prob)
    sd, rows = np.sqrt(np.diag(covariance)), {}
    for j, symbol in enumerate(population.symbols):
        _, low, high = interval(population.hierarchy.sampled.values[..., j], prob)
        half = np.array([(high - low) / 2, np.hypot((high - low) / 2, score(prob) * sd[j])])
        rows[symbol] = relative_width(population, j, half)
    return pd.DataFrame.from_dict(rows, orient="index", columns=["independent", "shared"]).rename_axis("parameter")


def _due_to_discrepancy(solution: Solution, coordinates: Coordinates) -> FloatArray:
    """Return the part (d, d) of a specimen's covariance on the line that is due to its discrepancy.

    It is the same share of it as of the covariance of the parameters themselves.
    """
    model = solution.model
    if isinstance(model.discrepancy, NoDiscrepancy):
        return np.zeros((len(coordinates.symbols), len(coordinates.symbols)))
    mean, root = values_of(model, solution.mixture, coordinates.symbols)
    of_all = GaussianMixture(solution.mixture.weights, np.zeros((len(mean), 0)), mean, root)
    total, on_the_line = (_root(mixture.moments()[1]) for mixture in (of_all, on_line(solution, coordinates)))
    inverse = np.linalg.inv(total)
    conditional = inverse @ _given_discrepancy(model, solution.mixture, coordinates.symbols) @ inverse.T
    values, vectors = np.linalg.eigh(np.eye(len(conditional)) - conditional)
    sides = on_the_line @ vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(sides @ sides.T)


def _root(covariance: FloatArray) -> FloatArray:
    """Return a triangle whose square is a covariance, which may be singular."""
    sides = np.sqrt(np.diag(covariance)) + 1e-300
    correlation = covariance / np.outer(sides, sides) + ROUNDING * np.eye(len(sides))
    return np.asarray(sides[:, None] * np.linalg.cholesky(correlation))


def _given_discrepancy(model: StatisticalModel, mixture: GaussianMixture, symbols: Sequence[str]) -> FloatArray:
    """Return the mean covariance (d, d) of parameters of the material if the discrepancy were known.

    Then the stress is that of the material with independent noise, whose information is that of least squares.
    """
    components = mixture.thinned(BENT_COMPONENTS if model.bent_symbols else COMPONENTS)
    parameters = [model.material_symbols.index(symbol) for symbol in symbols]
    prior_precision = np.diag([_precision(model.priors[symbol]) for symbol in model.material_symbols])
    settings = values_by_symbol(model, components.settings)
    levels = model.levels if model.noise.depends_on_level else np.zeros(1)
    variance = np.broadcast_to(model.noise_variance(settings, levels), (len(components), len(levels)))
    values, _ = values_of(model, components, model.material_symbols)
    slopes, covariance = _slopes(model, values[0]), np.zeros((len(values), len(values[0]), len(values[0])))
    for index, of_component in enumerate(values):
        slopes = _slopes(model, of_component) if model.bent_symbols else slopes
        precision = slopes.T @ (slopes / variance[index][:, None]) + prior_precision
        size = 1 / np.sqrt(np.diag(precision))
        covariance[index] = np.linalg.inv(precision * size[:, None] * size) * size[:, None] * size
    is_finite = np.isfinite(covariance).all(axis=(1, 2))  # not at a stretch at which the material locks
    mean = np.average(covariance[is_finite], axis=0, weights=components.weights[is_finite])
    return np.asarray(mean[np.ix_(parameters, parameters)])


def _slopes(model: StatisticalModel, values: FloatArray) -> FloatArray:
    """Return the slopes (r, p) of the material's stress along its parameters (p,), as rows that inference sees."""
    of_symbol = dict(zip(model.material_symbols, values, strict=True))
    bent = np.array([of_symbol[symbol] for symbol in model.bent_symbols])
    coefficients = np.array([of_symbol.get(symbol, 0.0) for symbol in model.column_symbols])
    design = model.design_at(bent) if len(bent) else model.design
    columns = dict(zip(model.column_symbols, design.T, strict=True))
    for symbol, step in zip(model.bent_symbols, np.diag(RELATIVE_STEP * np.abs(bent)), strict=True):
        difference = model.design_at(bent + step) - model.design_at(bent - step)
        columns[symbol] = difference @ coefficients / (2 * step.sum())
    return np.column_stack([columns[symbol] for symbol in model.material_symbols])


def _precision(prior: Prior) -> float:
    """Return about the precision of a prior, by the width of its middle."""
    low, high = (0.0, np.inf) if isinstance(prior, Flat) else prior.quantile(np.array([0.16, 0.84]))
    return float(4 / (high - low) ** 2)
