"""A mixture of Gaussians within bounds of the linear parameters: what these cut, its marginals, and draws within."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import ConvergenceError
from tissuq.inference.box import NEGLIGIBLE_MASS, TOUCHED_MASS, Boxes, lower_triangle
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import (
    FEW_GAUSSIANS,
    MIXTURE_NODES,
    HermiteCubics,
    Marginal,
    blended,
    marginal_of_points,
    moments_of_values,
    refined,
    weighted_grid,
)
from tissuq.inference.nested import MAX_NESTED, nested_log_density, nested_points
from tissuq.inference.quasi_monte_carlo import quasi_random
from tissuq.parameters.normal_interval import log_interval

MIN_DRAWS = 4000
"""Draws, at least, that represent what bounds cut, in predictions and a posterior's draws, unless fewer are wanted."""
MAX_COMPONENTS = 200
"""Components, at most, whose marginals within several bounds are computed, and whose masses are checked."""
POINTS_PER_COMPONENT = 1000
"""Points for each of so many components, that stand for all together where more bounds cut than can be integrated."""
SAME_GAUSSIAN = 0.005
"""Difference in mean (sd) and sd (relative) up to which Gaussians that a bound cuts are taken together."""
VALUES_AT_ONCE = 50_000
"""Values of single Gaussians that are computed together: few enough for a processor's cache."""
MAX_SPREAD = 5000
"""Components, at most, over which the points are spread at which the density of a cut mixture is computed."""
MAX_VALUES = 300_000
"""Values of single Gaussians, at most, from which the density of a cut mixture is computed."""
HEAVY_SHARE = 1e-6
"""Share of the posterior, and mass beyond bounds, above which a component's error counts."""
MAX_LOG_MASS_ERROR = 0.1
"""Error of the log mass within bounds from which the result is refused."""
FAR_SDS = 15.0
"""Standard deviations beyond a bound from which a cut Gaussian's variance is taken from its expansion."""


@dataclass(frozen=True, eq=False)
class TruncatedMixture:
    """A mixture within bounds, in three groups of components, by what bounds do to them.

    Attributes
    ----------
    gaussians : GaussianMixture
        Gaussian before the bounds cut them; weights after that.
    box : Boxes
        The bounds (1, p).
    """

    gaussians: GaussianMixture
    box: Boxes

    @cached_property
    def mass_beyond(self) -> FloatArray:
        """The masses (M, p) of the Gaussians beyond the bounds of each parameter."""
        return self.box.beyond(self.gaussians.mean, self.gaussians.root)

    @cached_property
    def touched(self) -> BoolArray:
        """Bounds of which parameters cut which component (M, p).

        Components that together have less than 1e-8 of the posterior outside the bounds count as free.
        """
        loss = self.gaussians.weights * self.mass_beyond.sum(axis=1)
        order = np.argsort(loss)
        is_cut = np.zeros(len(loss), dtype=bool)
        is_cut[order[np.cumsum(loss[order]) > NEGLIGIBLE_MASS]] = True
        return is_cut[:, None] & (self.mass_beyond > TOUCHED_MASS)

    @property
    def is_cut(self) -> bool:
        """Whether any bound matters."""
        return bool(self.touched.any())

    @cached_property
    def free(self) -> GaussianMixture:
        """The components that no bound cuts."""
        return self.gaussians[self.touched.sum(axis=1) == 0]

    @cached_property
    def cut(self) -> dict[int, GaussianMixture]:
        """The components that bounds of one parameter cut, by its index."""
        is_single = self.touched.sum(axis=1) == 1
        indices = np.flatnonzero(self.touched[is_single].any(axis=0))
        return {int(index): self.gaussians[is_single & self.touched[:, index]] for index in indices}

    @cached_property
    def crossed(self) -> GaussianMixture:
        """The components that bounds of several parameters cut."""
        return self.gaussians[self.touched.sum(axis=1) > 1]

    def components(self, count: int | None = None) -> GaussianMixture:
        """Return all, or at most so many that stand for all: Gaussians, and draws in the bounds from what these cut."""
        groups = [gaussians for gaussians in (*self.cut.values(), self.crossed) if gaussians.weights.sum() > 0]
        total = self.gaussians.weights.sum()
        draws = (min(MIN_DRAWS, ceil(count * g.weights.sum() / total)) if count else MIN_DRAWS for g in groups)
        return GaussianMixture.of_all([self.free, *map(self._drawn, groups, draws)], count)

    def checked_masses(self, symbols: Sequence[str]) -> tuple[FloatArray, float]:
        """Return the log masses within bounds of components that these cut notably, and the error of all.

        Of many, some stand for all of them.

        Raises
        ------
        ConvergenceError
            When they are not known well enough; the message has the symbols of the parameters.
        """
        weights, outside = self.gaussians.weights, self.mass_beyond.sum(axis=1)
        heavy = self.gaussians[(weights > HEAVY_SHARE) & (outside > HEAVY_SHARE)].resampled(MAX_COMPONENTS)
        log_mass, error = self._boxes(heavy).log_mass(heavy.mean, heavy.root)
        error_of_mass = float(heavy.weights @ error + weights @ np.minimum(outside, HEAVY_SHARE))
        if error_of_mass > MAX_LOG_MASS_ERROR:
            raise ConvergenceError(
                f"bounds of several linear parameters ({', '.join(symbols)}) cut so deep that the mass "
                "within them is not known well enough; use the method 'joint', or wider priors."
            )
        return log_mass, error_of_mass

    def marginal(self, index: int, most: int = MAX_COMPONENTS) -> Marginal:
        """Return the marginal of one linear parameter: in closed form where at most one bound cuts.

        Elsewhere from so many components at ``most``.
        """
        marginals = [(self.free.weights.sum(), self.free.marginal(index))] if self.free.weights.sum() > 0 else []
        for cut_index, gaussians in self.cut.items():
            if gaussians.weights.sum() >= NEGLIGIBLE_MASS * 100:
                marginal = _marginal_of_cut(gaussians, index, cut_index, self._bounds(cut_index))
                marginals.append((gaussians.weights.sum(), marginal))
        if len(self.crossed):
            marginals += self._crossed_marginals(index, most)
        return blended(marginals, self._bounds(index))

    def _bounds(self, index: int) -> tuple[float, float]:
        return float(self.box.lower[0, index]), float(self.box.upper[0, index])

    def _crossed_marginals(self, index: int, components: int) -> list[tuple[float, Marginal]]:
        """Return marginals of what several bounds cut, with their weights: by which bounds these are."""
        thinned, share = self.crossed.thinned(components), self.crossed.weights.sum()
        active = self._boxes(thinned).beyond(thinned.mean, thinned.root) > TOUCHED_MASS
        active[:, index] = True
        marginals = []
        for pattern in np.unique(active, axis=0):
            gaussians = thinned[(active == pattern).all(axis=1)]
            order = np.array([index, *(k for k in np.flatnonzero(pattern) if k != index)])
            if len(order) > MAX_NESTED:
                points = self._points(gaussians, max(64, POINTS_PER_COMPONENT * components // len(gaussians)))
                marginal = marginal_of_points(points.mean[:, index], points.weights, self._bounds(index))
            else:
                low, high = ((ends[0] - gaussians.mean)[:, order] for ends in (self.box.lower, self.box.upper))
                triangle = lower_triangle(gaussians.root[:, order])
                marginal = _marginal_of_crossed(gaussians.weights, gaussians.mean[:, index], triangle, low, high)
            marginals.append((share * gaussians.weights.sum(), marginal))
        return marginals

    def _boxes(self, gaussians: GaussianMixture) -> Boxes:
        return self.box.repeated(len(gaussians))

    def _drawn(self, gaussians: GaussianMixture, number: int) -> GaussianMixture:
        """Return so many draws within the bounds, or more, as components without extent."""
        thinned = gaussians.thinned(number)
        count, p = thinned.mean.shape
        draws = -(-number // count)
        uniforms = quasi_random(p, count * draws).reshape(count, draws, p)
        points = self._boxes(thinned).draws(thinned.mean, thinned.root, uniforms)
        return _of_points(thinned, gaussians.weights.sum() * np.ones(points.shape[:2]) / points.shape[1], points)

    def _points(self, gaussians: GaussianMixture, number: int) -> GaussianMixture:
        """Return weighted points within the bounds, so many for each Gaussian."""
        log_shares, points = self._boxes(gaussians).points(gaussians.mean, gaussians.root, number)
        shares = np.exp(log_shares - log_shares.max(axis=1, keepdims=True))
        return _of_points(gaussians, shares / shares.sum(axis=1, keepdims=True), points)


def _of_points(gaussians: GaussianMixture, shares: FloatArray, points: FloatArray) -> GaussianMixture:
    """Return components without extent: points (M, R, p) that have shares (M, R) of the weights of M Gaussians."""
    weights = (gaussians.weights[:, None] * shares).ravel()
    rows, p = np.repeat(np.arange(len(points)), points.shape[1]), points.shape[2]
    member = None if gaussians.member is None else gaussians.member[rows]
    return GaussianMixture.of_points(gaussians.settings[rows], points.reshape(-1, p), member).weighted(weights)


def _marginal_of_cut(gaussians: GaussianMixture, index: int, cut_index: int, ends: tuple[float, float]) -> Marginal:
    """Return the marginal of one parameter of Gaussians that the bounds of one parameter cut, in closed form.

    Parameters
    ----------
    gaussians : GaussianMixture
        Gaussian before the cut; weights after it.
    index, cut_index : int
        Of the parameter whose marginal is wanted, and of the one with bounds.
    ends : tuple of float
        The bounds.
    """
    weights, means, covariances = _merged(gaussians, (index, cut_index))
    sd, sd_cut = (np.sqrt(covariances[:, k, k]) for k in (index, cut_index))
    low, high = ((end - means[:, cut_index]) / sd_cut for end in ends)
    log_mass = log_interval(low, high)
    shift, shrink = _cut_moments(low, high, log_mass)
    along = covariances[:, index, cut_index] / sd_cut
    cut_mean = means[:, index] + along * shift
    cut_variance = np.maximum(sd**2 - along**2 * (1 - shrink), 0.0)
    mean = float(weights @ cut_mean)
    variance = float(weights @ (cut_variance + (cut_mean - mean) ** 2))
    scores, cut_sd = np.linspace(-25, 25, 51), np.sqrt(cut_variance)  # a bound may leave an exponential tail
    limits = ends if index == cut_index else (-np.inf, np.inf)
    reach = (
        max((cut_mean + scores[0] * cut_sd).min(), limits[0]),
        min((cut_mean + scores[-1] * cut_sd).max(), limits[1]),
    )
    sample = slice(None, None, 1 + len(weights) // MAX_SPREAD)
    spread = np.clip(cut_mean[sample, None] + cut_sd[sample, None] * scores, *reach)
    shares = weights[sample, None] * np.exp(-np.abs(scores))
    count = max(2 * MIXTURE_NODES, min(4 * MIXTURE_NODES, MAX_VALUES // len(weights)))
    coarse = weighted_grid(spread.ravel(), shares.ravel(), reach, count)

    def density_and_slope(block: IndexArray) -> tuple[FloatArray, FloatArray]:
        scores = (coarse - means[block, index, None]) / sd[block, None]
        log_density = -0.5 * scores**2 - (np.log(sd[block] * np.sqrt(2 * np.pi)) + log_mass[block])[:, None]
        rise = -scores
        if index != cut_index:
            correlation = np.clip(along[block] / sd[block], -1 + 1e-12, 1 - 1e-12)[:, None]
            complement = np.sqrt(1 - correlation**2)
            low_given, high_given = ((end[block, None] - correlation * scores) / complement for end in (low, high))
            log_given = log_interval(low_given, high_given)
            log_density += log_given
            with np.errstate(over="ignore"):  # far from a component, where it has no height
                rise += correlation / complement * (_height(low_given, log_given) - _height(high_given, log_given))
        heights = weights[block, None] * np.exp(log_density)
        return heights.sum(axis=0), (np.where(heights > 0, rise, 0.0) * heights / sd[block, None]).sum(axis=0)

    blocks = np.array_split(np.arange(len(weights)), 1 + len(weights) * len(coarse) // VALUES_AT_ONCE)
    smooth, points = HermiteCubics(coarse, *np.sum(list(map(density_and_slope, blocks)), axis=0)), refined(coarse)
    return Marginal.of(mean, float(np.sqrt(variance)), points, smooth(points), smooth.integral(points))


def _marginal_of_crossed(
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
    mean, sd = moments_of_values(shares, values)
    coarse = weighted_grid(values.ravel(), shares.ravel(), (values.min(), values.max()), 2 * MIXTURE_NODES)
    scores = (coarse - means[:, None]) / scale
    log_density = nested_log_density(triangle, low, high, scores)[0] - log_mass
    is_inside = (scores >= low[:, :1] / scale) & (scores <= high[:, :1] / scale)
    density = (weights / weights.sum() / scale[:, 0]) @ np.where(is_inside, np.exp(log_density), 0.0)
    smooth, points = PchipInterpolator(coarse, density), refined(coarse)
    return Marginal.of(mean, sd, points, smooth(points), smooth.antiderivative()(points))


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


def _merged(gaussians: GaussianMixture, index_pair: tuple[int, int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights, means and covariances, Gaussians that are nearly the same in two parameters merged to one."""
    weights, means, covariances = gaussians.weights / gaussians.weights.sum(), gaussians.mean, gaussians.covariance
    if len(weights) <= FEW_GAUSSIANS:
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
