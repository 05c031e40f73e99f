"""Bounds of the linear parameters: which components of a posterior they cut, and what is left of those."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.box import NEGLIGIBLE_MASS, TOUCHED_MASS, Boxes, lower_triangle
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import (
    Marginal,
    blended,
    marginal_of_crossed_mixture,
    marginal_of_cut_mixture,
    marginal_of_mixture,
    marginal_of_points,
)
from tissuq.inference.nested import MAX_NESTED
from tissuq.inference.quasi_monte_carlo import quasi_random

__all__ = ["Bounded", "bounded"]

FloatArray = NDArray[np.float64]

MIN_DRAWS = 4000
"""Draws, at least, that represent what bounds cut, in predictions and in a posterior's draws."""
MAX_COMPONENTS = 200
"""Components, at most, whose marginals within several bounds are computed."""
MIN_POINTS = 200_000
"""Points, at least, that stand for all of them together where more bounds cut than can be integrated."""


@dataclass(frozen=True, eq=False)
class Bounded:
    """A posterior in three parts, by what bounds do to its components.

    Attributes
    ----------
    free : GaussianMixture
        Gaussian: together they have less than 1e-8 of the posterior outside the bounds.
    cut : dict of int to GaussianMixture
        Gaussian before a bound of one parameter, by the parameter's place, cut them; weights are those within.
    crossed : GaussianMixture
        The others, which several bounds cut.
    box : Boxes
        The bounds (1, p).
    """

    free: GaussianMixture
    cut: dict[int, GaussianMixture]
    crossed: GaussianMixture
    box: Boxes

    @property
    def is_cut(self) -> bool:
        """Whether any bound matters."""
        return bool(self.cut) or len(self.crossed.weights) > 0

    def components(self) -> GaussianMixture:
        """Return all as one mixture: Gaussians, and draws within the bounds from what these cut."""
        whole = self.free
        for each in (*self.cut.values(), self.crossed):
            if len(each.weights):
                whole = whole.joined(self._drawn(each))
        return whole

    def marginal(self, place: int) -> Marginal:
        """Return the marginal of one linear parameter: in closed form where at most one bound cuts."""
        bounds = float(self.box.lower[0, place]), float(self.box.upper[0, place])
        parts = []
        if self.free.weights.sum() > 0:
            sds = np.sqrt((self.free.root[:, place] ** 2).sum(axis=1))
            marginal = marginal_of_mixture(self.free.weights, self.free.mean[:, place], sds)
            parts.append((self.free.weights.sum(), marginal))
        for which, each in self.cut.items():
            if each.weights.sum() < NEGLIGIBLE_MASS * 100:
                continue
            ends = float(self.box.lower[0, which]), float(self.box.upper[0, which])
            covariance = each.root @ each.root.swapaxes(1, 2)
            marginal = marginal_of_cut_mixture(each.weights, each.mean, covariance, place, which, ends)
            parts.append((each.weights.sum(), marginal))
        if len(self.crossed.weights):
            parts += self._crossed_marginals(place, bounds)
        return blended(parts, bounds)

    def _crossed_marginals(self, place: int, bounds: tuple[float, float]) -> list[tuple[float, Marginal]]:
        """Return marginals of what several bounds cut, with their weights: by which bounds these are."""
        few = self.crossed.thinned(MAX_COMPONENTS)
        share, every = self.crossed.weights.sum(), self._boxes(few)
        active = every.beyond(few.mean, few.root) > TOUCHED_MASS
        active[:, place] = True
        found = []
        for pattern in np.unique(active, axis=0):
            own = few[(active == pattern).all(axis=1)]
            order = np.array([place, *(k for k in np.flatnonzero(pattern) if k != place)])
            if len(order) > MAX_NESTED:
                points = self._points(own)
                marginal = marginal_of_points(points.mean[:, place], points.weights, bounds)
            else:
                low, high = ((ends[0] - own.mean)[:, order] for ends in (self.box.lower, self.box.upper))
                triangle = lower_triangle(own.root[:, order])
                marginal = marginal_of_crossed_mixture(own.weights, own.mean[:, place], triangle, low, high)
            found.append((share * own.weights.sum(), marginal))
        return found

    def _boxes(self, components: GaussianMixture) -> Boxes:
        return self.box.repeated(len(components.weights))

    def _drawn(self, components: GaussianMixture) -> GaussianMixture:
        """Return draws within the bounds, as components without extent."""
        few = components.thinned(MIN_DRAWS)
        count, p = few.mean.shape
        each = -(-MIN_DRAWS // count)
        uniforms = quasi_random(p, count * each).reshape(count, each, p)
        points = self._boxes(few).draws(few.mean, few.root, uniforms)
        return _of_points(few, components.weights.sum() * np.ones(points.shape[:2]) / points.shape[1], points)

    def _points(self, components: GaussianMixture) -> GaussianMixture:
        """Return weighted points within the bounds."""
        number = max(64, MIN_POINTS // len(components.weights))
        log_shares, points = self._boxes(components).points(components.mean, components.root, number)
        shares = np.exp(log_shares - log_shares.max(axis=1, keepdims=True))
        return _of_points(components, shares / shares.sum(axis=1, keepdims=True), points)


def _of_points(components: GaussianMixture, shares: FloatArray, points: FloatArray) -> GaussianMixture:
    """Return components without extent: points (M, R, p) that have shares (M, R) of the weights of M components."""
    weights = (components.weights[:, None] * shares).ravel()
    rows, p = np.repeat(np.arange(len(points)), points.shape[1]), points.shape[2]
    return replace(components[rows], weights=weights, mean=points.reshape(-1, p), root=np.zeros((len(rows), p, p)))


def bounded(components: GaussianMixture, beyond: FloatArray, box: Boxes) -> Bounded:
    """Return a posterior's components sorted by what bounds (1, p) do to them.

    Parameters
    ----------
    components : GaussianMixture
        Gaussian before the bounds; weights after them.
    beyond : (M, p) array
        The mass of each parameter beyond its bounds.
    box : Boxes
    """
    loss = components.weights * beyond.sum(axis=1)
    order = np.argsort(loss)
    is_cut = np.zeros(len(loss), dtype=bool)
    is_cut[order[np.cumsum(loss[order]) > NEGLIGIBLE_MASS]] = True
    active = beyond > TOUCHED_MASS
    alone = is_cut & (active.sum(axis=1) == 1)
    cut = {place: components[alone & active[:, place]] for place in range(beyond.shape[1])}
    cut = {place: each for place, each in cut.items() if len(each.weights)}
    return Bounded(components[~is_cut], cut, components[is_cut & ~alone], box)
