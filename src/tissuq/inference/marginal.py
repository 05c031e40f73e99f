"""Marginal posteriors of one parameter: mean, standard deviation, density and highest-density interval."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.inference.enumerators.quadrature import Lines, Quadrature
from tissuq.inference.enumerators.survey import Warp
from tissuq.inference.nested import nested_log_density, nested_points
from tissuq.parameters.normal_interval import log_interval

__all__ = [
    "HermiteCubics",
    "Marginal",
    "blended",
    "marginal_of_crossed_mixture",
    "marginal_of_cut_mixture",
    "marginal_of_logs",
    "marginal_of_mixture",
    "marginal_of_points",
    "marginal_of_quadrature",
    "marginal_of_table",
    "widened",
]

FloatArray = NDArray[np.float64]

TABLE_POINTS = 1001
HDI_STARTS = 101
MIXTURE_NODES = 160
POINTS_PER_NODE = 6
FEW_COMPONENTS = 60
QUANTILES_OF_WIDENED = 800
"""Of equal probability, into which a marginal is divided."""
MAX_VALUES = 300_000
FAR_SDS = 15.0
"""Standard deviations beyond a bound from which a cut Gaussian's variance is taken from its expansion."""
SAME_GAUSSIAN = 0.005
"""Difference in mean (sd) and sd (relative) up to which Gaussians that a bound cuts are taken together."""
MANY_LINES = 2000
MANY_BINS = 10_000
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

    def pdf(self, values: ArrayLike) -> FloatArray:
        """Return the posterior density at values (zero outside the table)."""
        return np.asarray(np.interp(np.asarray(values), self.points, self.density, left=0.0, right=0.0))

    def quantile(self, probability: ArrayLike) -> FloatArray:
        """Return the values below which the given probabilities lie."""
        return np.asarray(np.interp(np.asarray(probability), self.cumulative, self.points))

    def hdi(self, prob: float = 0.95) -> tuple[float, float]:
        """Return the shortest interval that holds ``prob`` of the posterior (95 % HPD for 0.95)."""
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
    coarse = _grid(spread.ravel(), shares.ravel(), (spread.min(), spread.max()), MIXTURE_NODES)
    scores = (coarse - means[:, None]) / sds[:, None]
    heights = (weights / sds)[:, None] * np.exp(-0.5 * scores**2) / np.sqrt(2 * np.pi)
    slope = -(heights * scores / sds[:, None]).sum(axis=0)
    points = _between(coarse)
    density, cumulative = heights.sum(axis=0), weights @ ndtr(scores)
    return Marginal(
        mean,
        sd,
        points,
        np.maximum(HermiteCubics(coarse, density, slope)(points), 0.0),
        _proper(HermiteCubics(coarse, cumulative, density)(points)),
    )


def marginal_of_cut_mixture(
    weights: FloatArray,
    means: FloatArray,
    covariances: FloatArray,
    index: int,
    cut_index: int,
    ends: tuple[float, float],
) -> Marginal:
    """Return the marginal of one parameter of M Gaussians that the bounds of one parameter cut, in closed form.

    Parameters
    ----------
    weights : (M,) array
        Of the Gaussians after the cut.
    means : (M, p) array
    covariances : (M, p, p) array
        Before the cut.
    index, cut_index : int
        The parameter whose marginal is wanted, and the one with bounds.
    ends : tuple of float
        The bounds.
    """
    weights, means, covariances = _alike(weights / weights.sum(), means, covariances, (index, cut_index))
    sd, sd_cut = (np.sqrt(covariances[:, k, k]) for k in (index, cut_index))
    low, high = ((end - means[:, cut_index]) / sd_cut for end in ends)
    log_mass = log_interval(low, high)
    shift, shrink = _cut_moments(low, high, log_mass)
    along = covariances[:, index, cut_index] / sd_cut
    own_mean = means[:, index] + along * shift
    own_variance = np.maximum(sd**2 - along**2 * (1 - shrink), 0.0)
    mean = float(weights @ own_mean)
    variance = float(weights @ (own_variance + (own_mean - mean) ** 2))
    scores = np.linspace(-25, 25, 51)  # what a bound leaves may have an exponential tail
    spread = own_mean[:, None] + np.sqrt(own_variance)[:, None] * scores
    limits = ends if index == cut_index else (-np.inf, np.inf)
    reach = max(spread.min(), limits[0]), min(spread.max(), limits[1])
    shares = weights[:, None] * np.exp(-np.abs(scores))
    count = max(2 * MIXTURE_NODES, min(4 * MIXTURE_NODES, MAX_VALUES // len(weights)))
    coarse = _grid(np.clip(spread, *reach).ravel(), shares.ravel(), reach, count)
    scores = (coarse - means[:, index, None]) / sd[:, None]
    log_density = -0.5 * scores**2 - np.log(sd * np.sqrt(2 * np.pi))[:, None] - log_mass[:, None]
    rise = -scores
    if index != cut_index:
        correlation = np.clip(along / sd, -1 + 1e-12, 1 - 1e-12)[:, None]
        complement = np.sqrt(1 - correlation**2)
        low_given, high_given = ((end[:, None] - correlation * scores) / complement for end in (low, high))
        log_given = log_interval(low_given, high_given)
        log_density += log_given
        rise += correlation / complement * (_height(low_given, log_given) - _height(high_given, log_given))
    heights = weights[:, None] * np.exp(log_density)
    smooth = HermiteCubics(coarse, heights.sum(axis=0), (heights * rise / sd[:, None]).sum(axis=0))
    points = _between(coarse)
    cumulative = smooth.integral(points)
    return Marginal(mean, float(np.sqrt(variance)), points, np.maximum(smooth(points), 0.0), _proper(cumulative))


def marginal_of_crossed_mixture(
    weights: FloatArray, means: FloatArray, triangle: FloatArray, low: FloatArray, high: FloatArray
) -> Marginal:
    """Return the marginal of the first parameter of M Gaussians that bounds of several parameters cut.

    Parameters
    ----------
    weights, means : (M,) arrays
        Of the Gaussians after the cut, and of the parameter before it.
    triangle : (M, k, k) array
        Lower triangles L of the covariances L L'.
    low, high : (M, k) arrays
        Bounds, from the means.
    """
    from scipy.interpolate import PchipInterpolator

    scale = triangle[:, 0, :1]
    scores, log_terms = nested_points(triangle, low, high)
    top = log_terms.max(axis=1, keepdims=True)
    log_mass = top + np.log(np.exp(log_terms - top).sum(axis=1, keepdims=True))
    shares = (weights / weights.sum())[:, None] * np.exp(log_terms - log_mass)
    values = means[:, None] + scale * scores
    mean = float((shares * values).sum())
    sd = float(np.sqrt((shares * (values - mean) ** 2).sum()))
    coarse = _grid(values.ravel(), shares.ravel(), (values.min(), values.max()), 2 * MIXTURE_NODES)
    scores = (coarse - means[:, None]) / scale
    log_density = nested_log_density(triangle, low, high, scores)[0] - log_mass
    is_inside = (scores >= low[:, :1] / scale) & (scores <= high[:, :1] / scale)
    density = (weights / weights.sum() / scale[:, 0]) @ np.where(is_inside, np.exp(log_density), 0.0)
    smooth, points = PchipInterpolator(coarse, density), _between(coarse)
    return Marginal(mean, sd, points, np.maximum(smooth(points), 0.0), _proper(smooth.antiderivative()(points)))


def marginal_of_quadrature(rule: Quadrature, warp: Warp, index: int, side: int, values: FloatArray) -> Marginal:
    """Return the marginal of a nonlinear parameter: the quadrature's own interpolant, other parameters integrated.

    Parameters
    ----------
    rule : Quadrature
        In the coordinates of the warp.
    warp : Warp
    index : int
        The data set's place among those of rule and warp.
    side : int
        The parameter's place among the nonlinear ones.
    values : (M,) array
        Its values at the points of the rule.
    """
    weights, warp = rule.weights[index], warp[index]
    mean = float(weights @ values)
    sd = float(np.sqrt(weights @ (values - mean) ** 2))
    lines = rule.lines(side, index)
    heavy = np.abs(lines.series[:, 0] * lines.width) > 1e-8
    lines = Lines(lines.preceding[heavy], lines.start[heavy], lines.width[heavy], lines.series[heavy])
    seen = values[weights > 1e-8]
    low, high = warp.bounds(side)
    margin = 0.05 * np.ptp(seen)
    ends = max(low, seen.min() - margin), min(high, seen.max() + margin)
    points = _grid(values, weights, ends, TABLE_POINTS if len(lines.start) <= MANY_LINES else TABLE_POINTS // 4)
    coordinates, slope = warp.coordinate(side, points, lines.preceding)
    density = np.maximum(lines.evaluate(coordinates, slope), 0.0)
    return Marginal(mean, sd, points, density, _proper(lines.integrate_to(coordinates)))


def marginal_of_points(
    points: FloatArray, weights: FloatArray, bounds: tuple[float, float], bandwidth: float | None = None
) -> Marginal:
    """Return the marginal of weighted points within bounds, by a kernel estimate that keeps their variance.

    Silverman's bandwidth, unless another is given; points near a bound are mirrored there, and elsewhere drawn towards
    the mean by what the kernel adds to the variance.
    """
    weights = weights / weights.sum()
    mean = float(weights @ points)
    sd = float(np.sqrt(weights @ (points - mean) ** 2))
    bandwidth = bandwidth or 0.9 * sd * float(weights @ weights) ** 0.2
    low, high = max(bounds[0], points.min() - 4 * bandwidth), min(bounds[1], points.max() + 4 * bandwidth)
    is_cut = low > points.min() - bandwidth or high < points.max() + bandwidth
    if not is_cut:
        points = mean + (points - mean) * np.sqrt(1 - (bandwidth / sd) ** 2)
    heights, edges = np.histogram(points, bins=TABLE_POINTS - 1, range=(low, high), weights=weights, density=True)
    step = edges[1] - edges[0]
    reach = min(int(4 * bandwidth / step) + 1, TABLE_POINTS - 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / bandwidth) ** 2)
    smooth = np.convolve(np.pad(heights, reach, mode="symmetric"), kernel / kernel.sum(), mode="valid")
    cumulative = np.concatenate([[0.0], np.cumsum(smooth)])
    return Marginal(mean, sd, edges, np.interp(edges, edges[:-1] + 0.5 * step, smooth), _proper(cumulative))


def marginal_of_logs(values: FloatArray, weights: FloatArray, step: float) -> Marginal:
    """Return the marginal of a positive quantity from weighted values (M,), smoothed over a step of their logarithm.

    Mean and standard deviation are those of the values themselves.
    """
    weights = weights / weights.sum()
    positive = values > 0
    mean = float(weights @ values)
    sd = float(np.sqrt(weights @ (values - mean) ** 2))
    if not positive.any():
        return Marginal(mean, sd, np.array([0.0, 1e-300]), np.ones(2), np.array([0.0, 1.0]))
    logs, shares = np.log(values[positive]), weights[positive]
    if step:
        heights, edges = np.histogram(logs, bins=MANY_BINS, weights=shares)
        filled = np.flatnonzero(heights)
        spread = step * ((np.arange(8) + 0.5) / 8 - 0.5)
        logs = (0.5 * (edges[filled] + edges[filled + 1])[:, None] + spread).ravel()
        shares = np.repeat(heights[filled], 8)
    smooth = marginal_of_points(logs, shares, (-np.inf, np.inf), 0.25 * step)
    points = np.exp(smooth.points)
    share = float(weights[positive].sum())
    return Marginal(mean, sd, points, share * smooth.density / points, _proper(1 - share + share * smooth.cumulative))


def marginal_of_table(points: FloatArray, density: FloatArray) -> Marginal:
    """Return the marginal of which the density (k,) is known at points (k,), up to a factor."""
    weights = 0.5 * (density[1:] + density[:-1]) * np.diff(points)
    middle = 0.5 * (points[1:] + points[:-1])
    mean = float(weights @ middle / weights.sum())
    sd = float(np.sqrt(weights @ (middle - mean) ** 2 / weights.sum()))
    cumulative = np.concatenate([[0.0], np.cumsum(weights)])
    return Marginal(mean, sd, points, density / weights.sum(), _proper(cumulative))


def _grid(values: FloatArray, weights: FloatArray, ends: tuple[float, float], count: int) -> FloatArray:
    """Return about ``count`` points between two ends, close where weighted values are: heavy tails get their share."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    tails = 10.0 ** -np.arange(1, 10)
    probabilities = np.concatenate([np.linspace(0, 1, count // 2), tails, 1 - tails])
    close = np.interp(probabilities * cumulative[-1], cumulative, values[order])
    core = np.interp(np.array([1e-4, 1 - 1e-4]) * cumulative[-1], cumulative, values[order])
    even = np.linspace(max(ends[0], core[0]), min(ends[1], core[1]), count // 2)
    return np.unique(np.clip(np.concatenate([close, even, ends]), *ends))


def _cut_moments(low: FloatArray, high: FloatArray, log_mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return means and variances of standard normal variables between bounds.

    Far beyond a bound the usual formula cancels; what is left there is nearly exponential.
    """
    at_low, at_high = _height(low, log_mass), _height(high, log_mass)
    mean = at_low - at_high
    pull = np.where(np.isfinite(low), low, 0.0) * at_low - np.where(np.isfinite(high), high, 0.0) * at_high
    nearest = np.maximum(low, -high)
    far = np.maximum(nearest, FAR_SDS)
    is_far = (nearest > FAR_SDS) & (far * (high - low) > 40)
    return mean, np.where(is_far, far**-2 * (1 - 6 * far**-2 + 50 * far**-4), 1 + pull - mean**2)


def _height(score: FloatArray, log_mass: FloatArray) -> FloatArray:
    """Return the standard normal density over a mass."""
    return np.asarray(np.exp(-0.5 * score**2 - log_mass) / np.sqrt(2 * np.pi))


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

    def _steps(self, arguments: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """Return the interval (g,) of each point, and how far in it the point lies."""
        index = np.searchsorted(self.points[1:-1], arguments, side="right")
        return index, arguments - self.points[index]


def _between(coarse: FloatArray) -> FloatArray:
    """Return coarse points with others evenly between them."""
    fractional_index = np.arange(POINTS_PER_NODE * (len(coarse) - 1) + 1) / POINTS_PER_NODE
    return np.asarray(np.interp(fractional_index, np.arange(len(coarse)), coarse), dtype=np.float64)


def _alike(
    weights: FloatArray, means: FloatArray, covariances: FloatArray, index_pair: tuple[int, int]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Merge Gaussians that are nearly the same in two of their dimensions, keeping moments."""
    if len(weights) <= FEW_COMPONENTS:
        return weights, means, covariances
    seen = weights > 1e-9 * weights.max()
    weights, means, covariances = weights[seen] / weights[seen].sum(), means[seen], covariances[seen]
    sds = np.sqrt(covariances[:, index_pair, index_pair])
    means_of_pair = means[:, index_pair]
    bins = np.hstack(
        [
            (means_of_pair - means_of_pair.min(axis=0)) / (SAME_GAUSSIAN * sds),
            np.log(sds / sds.min(axis=0)) / SAME_GAUSSIAN,
        ]
    ).astype(int)
    _, group = np.unique(bins, axis=0, return_inverse=True)
    group = group.ravel()
    total = np.asarray(np.bincount(group, weights), dtype=np.float64)
    mean = np.zeros((len(total), means.shape[1]))
    np.add.at(mean, group, weights[:, None] * means)
    mean /= total[:, None]
    away = means - mean[group]
    covariance = np.zeros((len(total), *covariances.shape[1:]))
    np.add.at(covariance, group, weights[:, None, None] * (covariances + away[:, :, None] * away[:, None, :]))
    return total, mean, covariance / total[:, None, None]


def _merged(weights: FloatArray, means: FloatArray, sds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Merge Gaussians that are nearly the same (means within a 300th of the range, sds within 5 %), keeping moments."""
    if len(weights) <= FEW_COMPONENTS:
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
    return Marginal(mean, float(np.sqrt(variance)), points, np.asarray(density), _proper(np.asarray(cumulative)))


def _proper(cumulative: FloatArray) -> FloatArray:
    """Return the cumulative probabilities made monotone and ending at one."""
    rising = np.maximum.accumulate(np.clip(cumulative, 0.0, None))
    return rising / rising[-1] if rising[-1] > 0 else rising
