"""Bounds of the linear parameters: which components of a posterior they cut, and what is left of those."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.box import NEGLIGIBLE, TOUCHED, Boxes
from tissuq.inference.marginal import (
    Marginal,
    blended,
    marginal_of_cut_mixture,
    marginal_of_mixture,
    marginal_of_points,
)
from tissuq.inference.solution import Components

__all__ = ["Bounded", "bounded"]

FloatArray = NDArray[np.float64]

RESAMPLED = 4000
REPRESENTED = 200
"""Components, at most, that are represented by points."""
FEW_POINTS, SOME_POINTS, ALL_POINTS = 2000, 50_000, 1_200_000
"""Points, at least, that represent all of them together: few where they are a small share of the posterior."""
SMALL_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Bounded:
    """A posterior in three parts, by what bounds do to its components.

    Attributes
    ----------
    free : Components
        Gaussian: together they have less than 1e-8 of the posterior outside the bounds.
    cut : dict of int to Components
        Gaussian before a bound of one parameter, by the parameter's place, cut them; weights are those within.
    crossed : Components
        The others, which several bounds cut.
    box : Boxes
        The bounds (1, p).
    """

    free: Components
    cut: dict[int, Components]
    crossed: Components
    box: Boxes

    @property
    def is_cut(self) -> bool:
        """Whether any bound matters."""
        return bool(self.cut) or len(self.crossed.weights) > 0

    def components(self) -> Components:
        """Return all as one mixture: Gaussians, and equally weighted points within the bounds for what they cut."""
        cut = [each for each in (*self.cut.values(), self.crossed) if len(each.weights)]
        whole = self.free
        for each in cut:
            points = self._crossed_points if each is self.crossed else self._points(each, SOME_POINTS)
            whole = whole.joined(points.resampled(RESAMPLED // len(cut)))
        return whole

    @cached_property
    def _crossed_points(self) -> Components:
        return self._points(self.crossed, ALL_POINTS)

    def marginal(self, place: int) -> Marginal:
        """Return the marginal of one linear parameter: in closed form unless several bounds cut."""
        bounds = float(self.box.lower[0, place]), float(self.box.upper[0, place])
        parts = []
        if len(self.free.weights):
            sds = np.sqrt((self.free.root[:, place] ** 2).sum(axis=1))
            marginal = marginal_of_mixture(self.free.weights, self.free.mean[:, place], sds)
            parts.append((self.free.weights.sum(), marginal))
        for which, each in self.cut.items():
            if each.weights.sum() < NEGLIGIBLE * 100:
                continue
            ends = float(self.box.lower[0, which]), float(self.box.upper[0, which])
            covariance = each.root @ each.root.swapaxes(1, 2)
            marginal = marginal_of_cut_mixture(each.weights, each.mean, covariance, place, which, ends)
            parts.append((each.weights.sum(), marginal))
        if len(self.crossed.weights):
            points = self._crossed_points
            parts.append((points.weights.sum(), marginal_of_points(points.mean[:, place], points.weights, bounds)))
        return blended(parts, bounds)

    def _points(self, components: Components, number: int) -> Components:
        few = components.thinned(REPRESENTED)
        share = components.weights.sum()
        total = number if share > SMALL_SHARE else FEW_POINTS
        every = self.box[np.zeros(len(few.weights), dtype=int)]
        log_shares, points = every.points(few.mean, few.root, max(64, total // len(few.weights)))
        shares = np.exp(log_shares - log_shares.max(axis=1, keepdims=True))
        weights = (few.weights[:, None] * shares / shares.sum(axis=1, keepdims=True)).ravel()
        kept = weights > 1e-12 * weights.max()
        p = points.shape[2]
        settings = np.repeat(few.settings, points.shape[1], axis=0)[kept]
        weights = weights[kept] * (share / weights[kept].sum())
        return Components(weights, settings, points.reshape(-1, p)[kept], np.zeros((len(weights), p, p)))


def bounded(components: Components, beyond: FloatArray, box: Boxes) -> Bounded:
    """Return a posterior's components sorted by what bounds (1, p) do to them.

    Parameters
    ----------
    components : Components
        Gaussian before the bounds; weights after them.
    beyond : (M, p) array
        The mass of each parameter beyond its bounds.
    box : Boxes
    """
    loss = components.weights * beyond.sum(axis=1)
    order = np.argsort(loss)
    is_cut = np.zeros(len(loss), dtype=bool)
    is_cut[order[np.cumsum(loss[order]) > NEGLIGIBLE]] = True
    active = beyond > TOUCHED
    alone = is_cut & (active.sum(axis=1) == 1)
    cut = {place: components[alone & active[:, place]] for place in range(beyond.shape[1])}
    cut = {place: each for place, each in cut.items() if len(each.weights)}
    return Bounded(components[~is_cut], cut, components[is_cut & ~alone], box)
