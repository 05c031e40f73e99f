"""A density of one coordinate, of one mode or several, known at few places: more where it changes fast, and matters."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray

LogDensity = Callable[[FloatArray], FloatArray]

FIRST_END, FIRST_PLACES = 4.0, 17
"""Where a search begins on either side of zero, and with how many places."""
MIN_INTERVAL, MIN_RELATIVE_GAP = 1e-4, 0.25
"""Between two places; and at first over the smaller one of the gaps beside."""
NEGLIGIBLE_DROP, MAX_DROP = 7.5, 1e3
"""Log density below the largest one at which places do not matter, and the lowest that is told apart."""
MAX_PLACES = 100
"""Places of one search."""
PEAK_PLACES, MAX_PEAK_DROP, PARABOLAS = 161, 50.0, 6
"""Places among which peaks are sought, how far the logarithm of one may lie below the largest, and parabolas each."""
MAX_EXCESS = 0.5
"""By which a log density between two places may exceed those there."""
POINTS_PER_INTERVAL = 40
"""Between two places, at which the density is interpolated."""


class Accuracy(NamedTuple):
    """How well a density is to be known.

    Attributes
    ----------
    max_difference : float
        Log densities of neighbouring places differ by no more, where they matter.
    max_share : float
        Share of the mass between two neighbouring places, at the most.
    end_drop : float
        Log density below the largest one at which no more places are added at the ends.
    probabilities : tuple of float
        Of places that are spread over the density.
    min_effective, enough_effective : float
        Effective number of quasi-random points of a density of more coordinates: at the least, and where no more are
        taken.
    bounded_points : int
        Points, at most, of which masses are computed within bounds of more parameters than two.
    points_of_value : int
        Points of an energy's amplitudes, at most, that are kept of each value of the other parameters.
    tolerance : float
        Of the interpolation of adaptive quadrature, relative to its integral.
    """

    max_difference: float
    max_share: float
    end_drop: float
    probabilities: tuple[float, ...]
    min_effective: float
    enough_effective: float
    bounded_points: int
    points_of_value: int
    tolerance: float


PROBABILITIES = (0.001, 0.012, 0.06, 0.16, 0.32, 0.5, 0.68, 0.84, 0.94, 0.988, 0.999)
FINE = Accuracy(2.0, 0.22, 6.5, PROBABILITIES, 20.0, 200.0, 8000, 2000, 1e-3)
OF_SUM = FINE._replace(enough_effective=20.0, bounded_points=4000, points_of_value=1000)
"""For one of many posteriors that are summed, each with points of its own."""
ROUGH = Accuracy(4.0, 0.5, 3.0, (0.005, 0.1, 0.5, 0.9, 0.995), 6.0, 6.0, 500, 500, 0.03)


@dataclass(frozen=True)
class Line:
    """A density, known as its logarithm (K,) at ascending places (K,)."""

    places: FloatArray
    logs: FloatArray

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Many points, and the density there over its largest known value: Akima's interpolation of its logarithm."""
        from scipy.interpolate import Akima1DInterpolator

        fractions = np.arange(POINTS_PER_INTERVAL * (len(self.places) - 1) + 1) / POINTS_PER_INTERVAL
        points = np.interp(fractions, np.arange(len(self.places)), self.places)
        heights = self.logs - self.logs.max()
        interval = np.minimum(fractions.astype(int), len(heights) - 2)
        largest_heights = np.maximum(heights[:-1], heights[1:])[interval] + MAX_EXCESS
        return points, np.exp(np.minimum(Akima1DInterpolator(self.places, heights)(points), largest_heights))

    @cached_property
    def log_masses(self) -> FloatArray:
        """The logarithms (K,) of the masses that belong to the places: of the density between them and the next."""
        points, density = self._table
        cells = density * np.gradient(points)
        position = np.interp(points, self.places, np.arange(len(self.places)))
        lower_index = np.minimum(position.astype(int), len(self.places) - 2)
        share = position - lower_index
        masses = np.bincount(lower_index, cells * (1 - share), len(self.places))
        masses[1:] += np.bincount(lower_index, cells * share, len(self.places))[:-1]
        return np.asarray(np.log(np.maximum(masses, 1e-300)) + self.logs.max())

    @property
    def shares_between(self) -> FloatArray:
        """The shares (K - 1,) of the mass between neighbouring places."""
        _, _, cumulative = self.distribution
        return np.diff(cumulative[::POINTS_PER_INTERVAL])

    @property
    def error(self) -> float:
        """The relative error of the whole mass, from that of straight lines between the logarithms."""
        points, density = self._table
        straight = np.exp(np.interp(points, self.places, self.logs - self.logs.max()))
        return float(abs((straight @ np.gradient(points)) / (density @ np.gradient(points)) - 1))

    @property
    def distribution(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points, and density and cumulative probability there."""
        points, density = self._table
        steps = 0.5 * (density[1:] + density[:-1]) * np.diff(points)
        cumulative = np.concatenate([[0.0], np.cumsum(steps)])
        return points, density / cumulative[-1], cumulative / cumulative[-1]

    def spread(self, accuracy: Accuracy) -> FloatArray:
        """Return places that are spread over the density: close where it is large."""
        points, _, cumulative = self.distribution
        return np.unique(np.interp(accuracy.probabilities, cumulative, points))


def peaks(log_density: LogDensity, end: float) -> FloatArray:
    """Return the places of the largest peaks of a density that costs little, each with one on either side of it.

    These are about a standard deviation away.
    """
    grid = np.linspace(-end, end, PEAK_PLACES)
    logs = np.nan_to_num(log_density(grid), nan=-1e300, neginf=-1e300)
    inner = logs[1:-1]
    tops = 1 + np.flatnonzero((inner >= logs[:-2]) & (inner > logs[2:]) & (inner > logs.max() - MAX_PEAK_DROP))
    return np.array([point for top in tops for point in _about(log_density, grid[top], grid[1] - grid[0])])


def _about(log_density: LogDensity, top: float, step: float) -> FloatArray:
    """Return a peak near a place, by parabolas, and places a standard deviation beside it."""
    for _ in range(PARABOLAS):
        value_before, value, value_after = log_density(top + step * np.array([-1.0, 0.0, 1.0]))
        curvature = max((2 * value - value_before - value_after) / step**2, 1e-12)
        top += float(np.clip((value_after - value_before) / (2 * step * curvature), -step, step))
        step = min(0.5 * step, curvature**-0.5)
    return np.asarray(top + min(curvature**-0.5, FIRST_END / FIRST_PLACES) * np.array([-1.0, 0.0, 1.0]))


def _apart(places: FloatArray) -> FloatArray:
    """Return ascending places without those that are much closer to the one before than others are."""
    gaps = np.diff(places)
    smaller_gaps = np.minimum(np.append(np.inf, gaps[:-1]), np.append(gaps[1:], np.inf))
    is_apart = np.append(True, gaps > MIN_RELATIVE_GAP * np.where(np.isfinite(smaller_gaps), smaller_gaps, 0.0))
    return np.asarray(places[is_apart])


def first_places() -> FloatArray:
    """Return places from which a search begins where nothing is known."""
    return np.linspace(-FIRST_END, FIRST_END, FIRST_PLACES)


def known_along(log_density: LogDensity, places: Iterable[float], end: float, accuracy: Accuracy = FINE) -> Line:
    """Return a density at places, more than at first where it changes fast, and matters, and beyond them.

    Parameters
    ----------
    log_density : callable
        Returns the logarithms (k,) of the density at ascending places (k,).
    places : iterable of float
    end : float
        No place is farther from zero.
    accuracy : Accuracy
    """
    log_densities: dict[float, float] = {}
    new = set(_apart(np.unique(np.clip(list(places), -end, end))).tolist())
    while new and len(log_densities) < MAX_PLACES:
        log_densities |= dict(zip(sorted(new), log_density(np.array(sorted(new))).tolist(), strict=True))
        ordered = np.array(sorted(log_densities))
        logs = np.nan_to_num([log_densities[point] for point in ordered], nan=-np.inf)
        logs = np.maximum(logs, logs.max() - MAX_DROP)
        matters = logs > logs.max() - NEGLIGIBLE_DROP
        is_rough = (matters[1:] | matters[:-1]) & (np.abs(np.diff(logs)) > accuracy.max_difference)
        is_rough |= Line(ordered, logs).shares_between > accuracy.max_share
        is_rough &= np.diff(ordered) > MIN_INTERVAL
        new = set(0.5 * (ordered[1:] + ordered[:-1])[is_rough])
        outer_ends = 2 * ordered[[0, -1]] - ordered[[1, -2]]
        at_ends = logs[[0, -1]] > logs.max() - accuracy.end_drop
        new |= set(np.clip(outer_ends, -end, end)[at_ends])
        new -= set(log_densities)
    first_index, last = np.flatnonzero(matters)[[0, -1]]
    range_that_matters = slice(max(first_index - 1, 0), last + 2)
    return Line(ordered[range_that_matters], logs[range_that_matters])
