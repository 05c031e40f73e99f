"""How many specimens like these it takes until the median of a population, or a new patient, is known to some width.

The specimens' own likelihoods are taken for one Gaussian each, y_i ~ N(theta_i, w_i^2), parameter by parameter. From
draws of m, B and tau the measurement goes on: further specimens with the covariates and widths of random ones of these.
What would then be known is computed with the same priors, in closed form given tau and by a sum over tau.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.parameters.checks import check_probability
from tissuq.population.draws import PopulationDraws
from tissuq.population.hierarchy import EFFECT_PRIOR_SD, MEAN_PRIOR_SD
from tissuq.population.likelihoods import mixtures_of

if TYPE_CHECKING:
    import pandas as pd

FUTURES = 200
"""Draws of the population from which the measurement goes on."""
MAX_SPECIMENS = 1000
"""Largest number of specimens that is looked at."""
GROWTH = 1.2
"""From one number of specimens that is looked at to the next."""
SPREADS = 80
"""Values of tau in the sum, at equal ratios."""
LOWEST_SPREAD, HIGHEST_SPREAD = 0.003, 4.0
"""The first and the last of them, over the sd of the prior."""
BISECTIONS = 20
MIN_PRECISION_RATIO = 1e-6
"""Smallest precision of a specimen's likelihood, over that of the reference that is divided out of it."""


@dataclass(frozen=True, eq=False)
class _Specimens:
    """Specimens as Gaussians of one parameter on the line: y, w (I,), and columns (I, 1 + k) of m and the effects."""

    y: FloatArray
    w: FloatArray
    columns: FloatArray

    def sums(self, spreads: FloatArray) -> FloatArray:
        """Return what the specimens add for every tau: precision, pull, and log density without m and B (T, q)."""
        weights = 1 / (spreads[:, None] ** 2 + self.w**2)
        size = self.columns.shape[1]
        squares = (self.columns[:, :, None] * self.columns[:, None, :]).reshape(-1, size * size)
        per_specimen = np.hstack([squares, self.columns * self.y[:, None], -0.5 * self.y[:, None] ** 2])
        return np.column_stack([weights @ per_specimen, 0.5 * np.log(weights).sum(axis=1)])


def needed_table(population: PopulationDraws, aim: float, prob: float, assurance: float) -> pd.DataFrame:
    """Return `Population.specimens_needed`."""
    import pandas as pd

    check_probability(prob)
    check_probability(assurance)
    if not 0 < aim < np.inf:
        raise InputError(f"aim must be a positive half width over the median, such as 0.1 for 10 %, not {aim!r}.")
    mixtures, reference = mixtures_of(list(population.posteriors.values()), population.coordinates)
    moments = [mixture.moments() for mixture in mixtures]
    count, rows = len(population.names), {}
    sizes = _sizes(count)
    for j, symbol in enumerate(population.symbols):
        mean, variance = (np.array(moment) for moment in zip(*((m[j], c[j, j]) for m, c in moments), strict=True))
        precision = np.maximum(1 / variance - 1 / reference[j] ** 2, MIN_PRECISION_RATIO / reference[j] ** 2)
        columns = np.column_stack([np.ones(count), population.covariates.design])
        specimens = _Specimens(mean / variance / precision, 1 / np.sqrt(precision), columns)
        covariance = population.shared_covariance
        shared = 0.0 if covariance is None else score(prob) * np.sqrt(covariance[j, j])
        half_widths = np.hypot(_half_widths(population, j, specimens, sizes, prob), shared)
        widths = relative_width(population, j, half_widths)
        tau = population.hierarchy.tau[..., j].ravel()
        for quantity, of_quantity in zip(("median", "new specimen"), widths, strict=True):
            likely = np.quantile(of_quantity, assurance, axis=0)
            scatter = score(prob) * tau * (quantity == "new specimen")
            floor = float(np.quantile(relative_width(population, j, np.hypot(scatter, shared)), assurance))
            needed = _first_below(aim, sizes, likely) if floor < aim else np.nan
            rows[symbol, quantity] = [likely[0], floor, needed, needed - count]
    index = pd.MultiIndex.from_tuples(rows, names=["parameter", "quantity"])
    return pd.DataFrame(list(rows.values()), index, ["now", "floor", "specimens", "more"])


def _sizes(count: int) -> IndexArray:
    """Return numbers of specimens from those that there are to `MAX_SPECIMENS`."""
    steps = int(np.ceil(np.log(max(MAX_SPECIMENS / count, 1)) / np.log(GROWTH)))
    sizes = np.ceil(count * GROWTH ** np.arange(steps + 1)).astype(int)
    return np.unique(np.clip(sizes, count, max(count, MAX_SPECIMENS)))


def _half_widths(
    population: PopulationDraws, j: int, specimens: _Specimens, sizes: IndexArray, prob: float
) -> FloatArray:
    """Return half the widths (2, futures, sizes) of the intervals of the median and of a new patient, on the line."""
    generator = np.random.default_rng([population.seed, 6, j])
    hierarchy, count = population.hierarchy, len(specimens.y)
    spreads = population.spread_prior * np.geomspace(LOWEST_SPREAD, HIGHEST_SPREAD, SPREADS)
    log_prior = np.log(spreads) - 0.5 * (spreads / population.spread_prior) ** 2
    rows = np.array([np.zeros(len(population.covariates.effects)),
                     population.covariates.row(population.patient_covariates)])  # fmt: skip
    row = np.column_stack([np.ones(2), rows])
    tau = hierarchy.tau[..., j].ravel()
    futures = generator.choice(len(tau), FUTURES, replace=False)
    effects = hierarchy.effects[..., j].reshape(len(tau), -1)
    slopes = np.column_stack([hierarchy.sampled.values[..., j].ravel(), effects])[futures]
    measured_sums = specimens.sums(spreads)
    widths = []
    for slope, own_tau in zip(slopes, tau[futures], strict=True):
        likewise = generator.integers(count, size=int(sizes[-1]) - count)
        columns, w = specimens.columns[likewise], specimens.w[likewise]
        y = columns @ slope + np.hypot(own_tau, w) * generator.standard_normal(len(w))
        sums, of_sizes = measured_sums, []
        for start, stop in zip(np.r_[count, sizes[:-1]] - count, sizes - count, strict=True):
            batch = slice(start, stop)
            sums = sums + _Specimens(y[batch], w[batch], columns[batch]).sums(spreads)
            of_sizes.append(sums)
        widths.append(_known_then(np.array(of_sizes), spreads, log_prior, row, prob))
    return np.stack(widths, axis=1)


def _known_then(
    sums: FloatArray, spreads: FloatArray, log_prior: FloatArray, row: FloatArray, prob: float
) -> FloatArray:
    """Return half the widths (2, n) of the intervals of the median and of a new patient for sums (n, T, q)."""
    size = row.shape[1]
    prior = np.diag([MEAN_PRIOR_SD**-2.0, *[EFFECT_PRIOR_SD**-2.0] * (size - 1)])
    precision = sums[..., : size * size].reshape(*sums.shape[:2], size, size) + prior
    pull = sums[..., size * size : size * (size + 1)]
    inverse = np.linalg.inv(precision)
    middle = np.einsum("ntab,ntb->nta", inverse, pull)
    log_weight = log_prior + sums[..., -2] + sums[..., -1] + 0.5 * (middle * pull).sum(axis=2)
    log_weight += 0.5 * np.linalg.slogdet(inverse)[1]
    weights = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    variance = np.einsum("pa,ntab,pb->pnt", row, inverse, row) + np.array([0.0, 1.0])[:, None, None] * spreads**2
    return _half_width(weights, np.einsum("pa,nta->pnt", row, middle), np.sqrt(variance), prob)


def _half_width(weights: FloatArray, mean: FloatArray, sd: FloatArray, prob: float) -> FloatArray:
    """Return half the width (2, n) of the interval with equal tails of mixtures (2, n, T) of Gaussians."""
    from scipy.special import ndtr

    ends = []
    for level in (0.5 - prob / 2, 0.5 + prob / 2):
        low, high = (mean - 10 * sd).min(axis=2), (mean + 10 * sd).max(axis=2)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            is_below = (weights * ndtr((middle[..., None] - mean) / sd)).sum(axis=2) < level
            low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
        ends.append(0.5 * (low + high))
    return np.asarray(0.5 * (ends[1] - ends[0]))


def relative_width(population: PopulationDraws, j: int, half_width: FloatArray) -> FloatArray:
    """Return half widths on the line over the median of a parameter."""
    if population.coordinates.is_log[j]:
        return np.asarray(np.sinh(half_width))
    values = population.coordinates.from_line(population.hierarchy.sampled.values[..., : len(population.symbols)])
    return np.asarray(half_width * population.coordinates.scale[j] / np.abs(np.median(values[..., j])))


def score(prob: float) -> float:
    """Return half the width of the interval of a standard Gaussian."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + prob / 2))


def _first_below(aim: float, sizes: Any, widths: FloatArray) -> float:
    """Return the number of specimens from which widths are below the aim; nan where none is."""
    index = int(np.argmax(widths <= aim))
    if widths[index] > aim:
        return np.nan
    if index == 0:
        return float(sizes[0])
    share = np.log(widths[index - 1] / aim) / np.log(widths[index - 1] / widths[index])
    return float(np.ceil(sizes[index - 1] * (sizes[index] / sizes[index - 1]) ** share))
