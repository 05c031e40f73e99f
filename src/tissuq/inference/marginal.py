"""Marginal posteriors of one parameter: mean, standard deviation, density and highest-density interval."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.parameters.checks import check_probability

TABLE_POINTS = 1001
"""In a table that is smoothed from many values."""
HDI_STARTS = 101
"""Lower ends among which the shortest interval is sought, at every zoom."""
MIXTURE_NODES = 160
"""Points at which the density of a mixture is computed."""
POINTS_PER_NODE = 6
"""Tabulated for each of these."""
FEW_GAUSSIANS = 60
"""Up to which Gaussians that are nearly the same are not merged."""
QUANTILES_OF_WIDENED = 800
"""Of equal probability, into which a marginal is divided."""
NEGLIGIBLE = 1e-9
"""Probability at either end that is left out of the table of weighted points that lie far apart."""
MANY_AT_END = 10
"""Effective points that a bandwidth holds at the last density of points, if it is cut there; of tails about one."""
ROUNDING = 1e-9
"""By which a probability that is computed may be below zero or above one."""
LOG_BINS = 10_000
"""In which the logarithms of many values are sorted."""


@dataclass(frozen=True, eq=False)
class Marginal:
    """A one-dimensional posterior, tabulated finely.

    Attributes
    ----------
    mean, sd : float
        In the parameter's unit; exact to the accuracy of the route, not of the table.
    points, density, cumulative : (k,) arrays
        Values, probability density and cumulative probability at them.
    """

    mean: float
    sd: float
    points: FloatArray
    density: FloatArray
    cumulative: FloatArray

    def __repr__(self) -> str:
        low, high = self.hdi()
        return f"<Marginal: mean {self.mean:.4g}, sd {self.sd:.2g}, 95 % interval {low:.4g} to {high:.4g}>"

    @classmethod
    def of(cls, mean: float, sd: float, points: FloatArray, density: FloatArray, cumulative: FloatArray) -> Marginal:
        """Return a marginal whose density is not negative and whose cumulative probabilities rise to one."""
        rising = np.maximum.accumulate(np.clip(cumulative, 0.0, None))
        return cls(mean, sd, points, np.maximum(density, 0.0), rising / rising[-1] if rising[-1] > 0 else rising)

    def pdf(self, values: ArrayLike) -> FloatArray:
        """Return the posterior density at values (zero outside the table)."""
        return np.asarray(np.interp(np.asarray(values), self.points, self.density, left=0.0, right=0.0))

    def quantile(self, probability: ArrayLike) -> FloatArray:
        """Return the values below which the given probabilities lie."""
        asked = np.asarray(probability, dtype=np.float64)
        if asked.size and not -ROUNDING < asked.min() <= asked.max() < 1 + ROUNDING:
            raise InputError(f"probabilities must be from 0 to 1, not {probability!r:.80}.")
        return np.asarray(np.interp(asked, self.cumulative, self.points))

    def hdi(self, prob: float = 0.95) -> tuple[float, float]:
        """Return the shortest interval that holds ``prob`` of the posterior (95 % HPD for 0.95)."""
        check_probability(prob)
        start = np.linspace(0.0, 1.0 - prob, HDI_STARTS)
        best = int((self.quantile(start + prob) - self.quantile(start)).argmin())
        low, high = start[max(best - 2, 0)], start[min(best + 2, HDI_STARTS - 1)]
        for _ in range(7):
            inner = np.linspace(low, high, HDI_STARTS)
            rising = self.pdf(self.quantile(inner)) < self.pdf(self.quantile(inner + prob))
            peak = int(rising.argmin()) if not rising.all() else HDI_STARTS - 1
            low, high = inner[max(peak - 1, 0)], inner[peak]
        return float(self.quantile(low)), float(self.quantile(low + prob))


def widened(marginal: Marginal, error: float) -> Marginal:
    """Return the marginal of a parameter times 1 + e, e a normal error of some standard deviation."""
    if not error:
        return marginal
    values = marginal.quantile((np.arange(QUANTILES_OF_WIDENED) + 0.5) / QUANTILES_OF_WIDENED)
    sds = np.sqrt((error * values) ** 2 + np.gradient(values) ** 2 / 12)
    mixture = marginal_of_mixture(np.full(QUANTILES_OF_WIDENED, 1 / QUANTILES_OF_WIDENED), values, sds)
    sd = float(np.sqrt(marginal.sd**2 * (1 + error**2) + (error * marginal.mean) ** 2))
    return replace(mixture, mean=marginal.mean, sd=sd)


def marginal_of_mixture(weights: FloatArray, means: FloatArray, sds: FloatArray) -> Marginal:
    """Return the marginal of a mixture of M Gaussians with weights, means and standard deviations (M,).

    Density and distribution are computed at few points, and between them by cubics that share their slopes.
    """
    from scipy.special import ndtr

    weights = weights / weights.sum()
    mean = float(weights @ means)
    sd = float(np.sqrt(weights @ (sds**2 + (means - mean) ** 2)))
    weights, means, sds = _merged(weights, means, sds)
    scores = np.linspace(-8, 8, 25)
    spread, shares = means[:, None] + sds[:, None] * scores, weights[:, None] * np.exp(-0.5 * scores**2)
    coarse = weighted_grid(spread.ravel(), shares.ravel(), (spread.min(), spread.max()), MIXTURE_NODES)
    scores = (coarse - means[:, None]) / sds[:, None]
    heights = (weights / sds)[:, None] * np.exp(-0.5 * scores**2) / np.sqrt(2 * np.pi)
    slope = -(heights * scores / sds[:, None]).sum(axis=0)
    points = refined(coarse)
    density, cumulative = heights.sum(axis=0), weights @ ndtr(scores)
    tabulated = HermiteCubics(coarse, density, slope)(points), HermiteCubics(coarse, cumulative, density)(points)
    return Marginal.of(mean, sd, points, *tabulated)


def marginal_of_points(
    points: FloatArray, weights: FloatArray, bounds: tuple[float, float], bandwidth: float | None = None
) -> Marginal:
    """Return the marginal of weighted points within bounds, by a kernel estimate that keeps their variance.

    Silverman's bandwidth, unless another is given, for the shortest interval that holds half of them, as between two
    peaks the standard deviation is that of neither. Points are mirrored at a bound near them, and where they end at
    once, as a ridge does at the bound of another parameter; elsewhere they are drawn towards the mean by what the
    kernel adds to the variance. Above a bound that is positive, as those of what may differ by powers of ten are, the
    logarithms are smoothed; above zero where a tail is so long that the table would have few values in the middle.
    """
    weights = weights / weights.sum()
    if bounds[0] > 0 and bandwidth is None:
        logs = marginal_of_points(np.log(points), weights, (log(bounds[0]), log(bounds[1])))
        values = np.exp(logs.points)
        return Marginal.of(*moments_of_values(weights, points), values, logs.density / values, logs.cumulative)
    mean, sd = moments_of_values(weights, points)
    spread = min(sd, _shortest_half(points, weights) / 1.349 or sd)
    is_silverman, bandwidth = bandwidth is None, bandwidth or 0.9 * spread * float(weights @ weights) ** 0.2
    if np.ptp(points) > 0.5 * TABLE_POINTS * bandwidth:  # points far off would leave a narrow posterior few bins
        order = np.argsort(points)
        rising = np.cumsum(weights[order])
        of_weight = order[(rising > NEGLIGIBLE) & (rising - weights[order] < rising[-1] - NEGLIGIBLE)]
        points, weights = points[of_weight], weights[of_weight]
        if is_silverman and np.ptp(points) > 0.5 * TABLE_POINTS * bandwidth and bounds[0] == 0 < points.min():
            return replace(
                marginal_of_points(points, weights, (float(np.finfo(float).tiny), bounds[1])), mean=mean, sd=sd
            )
    if is_silverman:
        bounds = -_last(-points, weights, bandwidth, -bounds[0]), _last(points, weights, bandwidth, bounds[1])
        points = np.clip(points, *bounds)
    low, high = max(bounds[0], points.min() - 4 * bandwidth), min(bounds[1], points.max() + 4 * bandwidth)
    is_cut = low > points.min() - bandwidth or high < points.max() + bandwidth
    if not is_cut and sd > bandwidth:
        points = mean + (points - mean) * np.sqrt(1 - (bandwidth / sd) ** 2)
    heights, edges = np.histogram(points, bins=TABLE_POINTS - 1, range=(low, high), weights=weights, density=True)
    step = edges[1] - edges[0]
    reach = min(int(4 * bandwidth / step) + 1, TABLE_POINTS - 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / bandwidth) ** 2)
    smooth = np.convolve(np.pad(heights, reach, mode="symmetric"), kernel / kernel.sum(), mode="valid")
    cumulative = np.concatenate([[0.0], np.cumsum(smooth)])
    return Marginal.of(mean, sd, edges, np.interp(edges, edges[:-1] + 0.5 * step, smooth), cumulative)


def _last(points: FloatArray, weights: FloatArray, bandwidth: float, bound: float) -> float:
    """Return where the density of weighted points ends at once: a bound, unless they end before it and do not tail off.

    The density is extended from the last two bandwidths, as a line; beyond the end lies half of an effective point.
    """
    order = np.argsort(points)
    one = float(weights @ weights)
    last = float(points[order][np.searchsorted(np.cumsum(weights[order]), 1 - 0.5 * one)])
    outer, both = (float(weights[points > last - reach].sum()) for reach in (bandwidth, 2 * bandwidth))
    is_cut = 1.5 * outer - 0.5 * (both - outer) > MANY_AT_END * one
    return last if is_cut and last + bandwidth < bound else bound


def _shortest_half(points: FloatArray, weights: FloatArray) -> float:
    """Return the length of the shortest interval that holds half of weighted points; of a Gaussian 1.349 of its sd."""
    order = np.argsort(points)
    ascending, rising = points[order], np.cumsum(weights[order])
    ends = np.searchsorted(rising, rising - weights[order] + 0.5)
    begins = np.flatnonzero(ends < len(points))
    return float((ascending[ends[begins]] - ascending[begins]).min())


def marginal_of_logs(values: FloatArray, weights: FloatArray, step: float) -> Marginal:
    """Return the marginal of a positive quantity from weighted values (M,), smoothed over a step of their logarithm.

    Mean and standard deviation are those of the values themselves.
    """
    weights = weights / weights.sum()
    positive = values > 0
    mean, sd = moments_of_values(weights, values)
    if not positive.any():
        return Marginal(mean, sd, np.array([0.0, 1e-300]), np.ones(2), np.array([0.0, 1.0]))
    logs, shares = np.log(values[positive]), weights[positive]
    if step:
        heights, edges = np.histogram(logs, bins=LOG_BINS, weights=shares)
        filled = np.flatnonzero(heights)
        spread = step * ((np.arange(8) + 0.5) / 8 - 0.5)
        logs = (0.5 * (edges[filled] + edges[filled + 1])[:, None] + spread).ravel()
        shares = np.repeat(heights[filled], 8)
    smooth = marginal_of_points(logs, shares, (-np.inf, np.inf), 0.25 * step)
    points = np.exp(smooth.points)
    share = float(weights[positive].sum())
    return Marginal.of(mean, sd, points, share * smooth.density / points, 1 - share + share * smooth.cumulative)


def marginal_of_table(points: FloatArray, density: FloatArray) -> Marginal:
    """Return the marginal of which the density (k,) is known at points (k,), up to a factor."""
    weights = 0.5 * (density[1:] + density[:-1]) * np.diff(points)
    middle = 0.5 * (points[1:] + points[:-1])
    cumulative = np.concatenate([[0.0], np.cumsum(weights)])
    return Marginal.of(*moments_of_values(weights / weights.sum(), middle), points, density / weights.sum(), cumulative)


def moments_of_values(weights: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Return the mean and the standard deviation of weighted values; the weights sum to one."""
    mean = float((weights * values).sum())
    return mean, float(np.sqrt((weights * (values - mean) ** 2).sum()))


def weighted_grid(values: FloatArray, weights: FloatArray, ends: tuple[float, float], count: int) -> FloatArray:
    """Return about ``count`` points between two ends, close where weighted values are: heavy tails get their share."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    tails = 10.0 ** -np.arange(1, 10)
    probabilities = np.concatenate([np.linspace(0, 1, count // 2), tails, 1 - tails])
    close = np.interp(probabilities * cumulative[-1], cumulative, values[order])
    core = np.interp(np.array([1e-4, 1 - 1e-4]) * cumulative[-1], cumulative, values[order])
    even = np.linspace(max(ends[0], core[0]), min(ends[1], core[1]), count // 2)
    return np.unique(np.clip(np.concatenate([close, even, ends]), *ends))


class HermiteCubics:
    """Cubics through values (k,) at points, of given slopes: those of SciPy, whose import takes longer than a fit."""

    def __init__(self, points: FloatArray, values: FloatArray, slopes: FloatArray) -> None:
        width = np.diff(points)
        secant = np.diff(values) / width
        bend = (slopes[:-1] + slopes[1:] - 2 * secant) / width
        self.points = points
        self.coefficients = values[:-1], slopes[:-1], (secant - slopes[:-1]) / width - bend, bend / width

    def __call__(self, arguments: FloatArray) -> FloatArray:
        """Return the values at points (g,) within the outermost."""
        index, step = self._steps(arguments)
        return np.asarray(sum(factor[index] * step**power for power, factor in enumerate(self.coefficients)))

    def integral(self, arguments: FloatArray) -> FloatArray:
        """Return the integrals from the first point to others (g,)."""
        index, step = self._steps(arguments)
        width = np.diff(self.points)
        terms = [(power, factor / power) for power, factor in enumerate(self.coefficients, 1)]
        integral_to_interval = np.append(0.0, np.cumsum(sum(factor * width**power for power, factor in terms)))
        return np.asarray(integral_to_interval[index] + sum(factor[index] * step**power for power, factor in terms))

    def _steps(self, arguments: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Return the interval (g,) of each point, and how far in it the point lies."""
        index = np.searchsorted(self.points[1:-1], arguments, side="right")
        return index, arguments - self.points[index]


def refined(coarse: FloatArray) -> FloatArray:
    """Return coarse points with others evenly between them."""
    fractional_index = np.arange(POINTS_PER_NODE * (len(coarse) - 1) + 1) / POINTS_PER_NODE
    return np.asarray(np.interp(fractional_index, np.arange(len(coarse)), coarse), dtype=np.float64)


def _merged(weights: FloatArray, means: FloatArray, sds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Merge Gaussians that are nearly the same (means within a 300th of the range, sds within 5 %), keeping moments."""
    if len(weights) <= FEW_GAUSSIANS:
        return weights, means, sds
    seen = weights > 1e-12
    weights, means, sds = weights[seen], means[seen], sds[seen]
    mean_bin = np.floor((means - means.min()) / (np.ptp(means) / 300 + 1e-300)).astype(int)
    sd_bin = np.floor(np.log(sds / sds.min()) / 0.05).astype(int)
    _, group = np.unique(mean_bin * (sd_bin.max() + 1) + sd_bin, return_inverse=True)
    total = np.asarray(np.bincount(group, weights), dtype=np.float64)
    mean = np.bincount(group, weights * means) / total
    variance = np.bincount(group, weights * (sds**2 + (means - mean[group]) ** 2)) / total
    return total, np.asarray(mean, dtype=np.float64), np.sqrt(variance)


def blended(weighted_marginals: list[tuple[float, Marginal]], bounds: tuple[float, float]) -> Marginal:
    """Return the mixture, within bounds, of marginals with weights that sum to one."""
    if len(weighted_marginals) == 1:
        return weighted_marginals[0][1]
    mean = sum(weight * marginal.mean for weight, marginal in weighted_marginals)
    variance = sum(weight * (marginal.sd**2 + (marginal.mean - mean) ** 2) for weight, marginal in weighted_marginals)
    points = np.unique(np.clip(np.concatenate([marginal.points for _, marginal in weighted_marginals]), *bounds))
    density = sum(weight * marginal.pdf(points) for weight, marginal in weighted_marginals)
    cumulative = sum(
        weight * np.interp(points, marginal.points, marginal.cumulative, left=0.0, right=1.0)
        for weight, marginal in weighted_marginals
    )
    return Marginal.of(mean, float(np.sqrt(variance)), points, np.asarray(density), np.asarray(cumulative))
