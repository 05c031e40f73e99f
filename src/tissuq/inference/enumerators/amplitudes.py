"""Sums over the amplitudes of energy discrepancies and over the noise: points of lattices, and what they weigh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import MappingProxyType

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.inference.enumerators.lattice import Lattice
from tissuq.inference.enumerators.quadrature import gauss_rule
from tissuq.inference.linear import LinearPriors
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Prior

NOISE_NODES, NOISE_BELOW, NOISE_ABOVE = 6, 5.0, 20.0
"""Of the noise given the rest: values, and the reach of its logarithm around its mode, in standard deviations
1 / sqrt(2 freedom); above, further by a multiple of 1 / sqrt(freedom), for its heavy tail."""
CUT_NODES = 24
"""Values of the noise where its prior cuts or is narrow."""
IRRELEVANT_LOG_DROP, NEGLIGIBLE_LOG_DROP = 18.0, 26.0
"""Log density below the largest, at the best noise, at which a point of a lattice is left out at once; and at which
all such points together hold nothing."""
NEGLIGIBLE_SHARE = 1e-6
"""Share of the posterior that may be left out."""
NOISE_TRIALS, HARDLY_PULLED_RISE = 8, 0.1
"""Values of the noise among which the best is sought where priors pull at linear parameters, and the rise of its
logarithm up to which they hardly do."""
MAX_NODES_FACTOR = 8.0
"""Multiple of `CUT_NODES`, at most."""
HARDLY_CUT_SHARE = 0.5
"""Share that bounds of linear parameters leave, above which points may be left out before they are looked at."""
MAX_LAST_SHARE = 1e-3
"""Share of the posterior at the lattice's largest amplitudes from which it is not known what lies beyond."""
LIKELY_PROBABILITIES, POSSIBLE_PROBABILITIES = np.array([1e-3, 1 - 1e-3]), np.array([1e-12, 1 - 1e-12])
"""Probabilities of the noise's prior between which it is likely, and between which it is at all."""
TINY_SQUARE = 1e-200
"""Stands for a misfit (MPa^2) or a noise of zero in a logarithm."""


@dataclass(frozen=True, eq=False)
class Points:
    """M points of lattices: which lattice, where in it, what noise, both amplitudes, log p(data and point).

    ``misfit`` tells how likely any other noise would be at the same ratios, and ``strain`` what priors that pull at the
    linear parameters may add to it. ``log_inside`` bounds from above what their bounds leave, which is not in
    ``log_weight``.
    """

    lattice: IndexArray
    second_index: IndexArray
    first_index: IndexArray
    noise_sd: FloatArray
    amplitudes: FloatArray
    log_weight: FloatArray
    misfit: FloatArray
    strain: FloatArray
    log_inside: FloatArray

    def __getitem__(self, index: IndexArray | BoolArray) -> Points:
        return Points(*(array[index] for array in vars(self).values()))

    @property
    def log_mass(self) -> FloatArray:
        """The logarithm of what points hold, no less than their mass within the bounds (M,)."""
        return self.log_weight + self.log_inside

    @classmethod
    def joined(cls, point_sets: Sequence[Points]) -> Points:
        """Return all points of several sets."""
        return cls(
            *(np.concatenate(arrays) for arrays in zip(*(vars(points).values() for points in point_sets), strict=True))
        )


@dataclass(frozen=True, eq=False)
class PointsAtKnownNoise:
    """All points of several lattices at a known noise, one lattice after another: N points, b data sets.

    Weights and misfits (N, b) are as if the linear parameters had no priors.
    """

    lattice: IndexArray
    second_index: IndexArray
    first_index: IndexArray
    noise_sd: float
    amplitudes: FloatArray
    log_weight: FloatArray
    misfit: FloatArray

    @classmethod
    def of(cls, model: StatisticalModel, lattices: Sequence[Lattice], data_sets: slice) -> PointsAtKnownNoise:
        """Return those of some data sets at the noise of a model."""
        noise_sd = float(model.noise.sd({}, 0.0))
        places = [np.indices(lattice.misfit.shape[:2]).reshape(2, -1) for lattice in lattices]
        amplitudes = [
            _amplitudes(model, lattice, *indices) * noise_sd for lattice, indices in zip(lattices, places, strict=True)
        ]
        log_weights = [_known_log_weights(model, lattice, data_sets) for lattice in lattices]
        misfits = [lattice.misfit[:, :, data_sets] for lattice in lattices]
        weights, misfit = (
            np.concatenate([array.reshape(-1, array.shape[2]) for array in arrays]) for arrays in (log_weights, misfits)
        )
        numbers = np.repeat(np.arange(len(lattices)), [indices.shape[1] for indices in places])
        second_index, first_index = np.concatenate(places, axis=1)
        return cls(numbers, second_index, first_index, noise_sd, np.concatenate(amplitudes), weights, misfit)

    def among(self, data_set: int, matters: BoolArray) -> Points:
        """Return the points that matter (N,) of one data set."""
        rows = np.flatnonzero(matters)
        nothing = np.zeros(len(rows))
        return Points(
            self.lattice[rows],
            self.second_index[rows],
            self.first_index[rows],
            np.full(len(rows), self.noise_sd),
            self.amplitudes[rows],
            self.log_weight[rows, data_set],
            self.misfit[rows, data_set],
            nothing,
            nothing,
        )


class Weighing:
    """The posterior of amplitudes and noise of one data set on lattices, one for each member.

    Parameters
    ----------
    model : StatisticalModel
    lattices : sequence of Lattice
    index : int
        Of the data set in the lattices.
    ratios : mapping of str to float
        Values, over noise_sd, of the other parameters of the noise.
    at_known_noise : PointsAtKnownNoise, optional
        Those of all data sets, where the noise is known: for one model they are quicker to compute together.
    """

    def __init__(
        self,
        model: StatisticalModel,
        lattices: Sequence[Lattice],
        index: int,
        ratios: Mapping[str, float] = MappingProxyType({}),
        at_known_noise: PointsAtKnownNoise | None = None,
    ) -> None:
        self._model, self._lattices, self._index, self._ratios = model, lattices, index, ratios
        self._least_log_weight = -np.inf
        self._of_all = at_known_noise
        self._ends, self._priors = _ends(model, ratios), LinearPriors(model)
        self._is_pulled = self._priors.is_gaussian

    def points(self) -> tuple[Points, float]:
        """Return the points that matter, and the relative error of their sum: from that of every second point.

        Infinite where the largest amplitudes of the lattice hold a part. No points where the noise's priors exclude
        each other.
        """
        if self._ends[0] >= self._ends[1]:
            nowhere = np.zeros(0, dtype=np.intp)
            return self._weighed(0, nowhere, nowhere, np.zeros(0)), 0.0
        points_of_members = self._roughly()
        if not self._is_pulled and self._are_cut(points_of_members):
            self._is_pulled = True
            points_of_members = self._roughly()
        if self._model.noise.parameters:
            points_of_members = [
                self._all_noise(of_member) for of_member in points_of_members if len(of_member.lattice)
            ]
        points = Points.joined(points_of_members)
        mass = _masses([points])[0]
        at_even = np.ones(len(mass))
        of_blocks = points.second_index, points.first_index
        for count, indices in zip(_counts(self._lattices, points), of_blocks, strict=True):
            at_even *= np.where(count == 1, 1.0, 2.0 * (indices % 2 == 0))
        last = mass[at_end(self._lattices, points)].sum()
        coarse = at_even @ mass
        error = np.inf if last > MAX_LAST_SHARE * mass.sum() else float(abs(coarse / mass.sum() - 1) ** 1.5)
        return points[mass >= _least_that_matters(mass)], error

    def _roughly(self) -> list[Points]:
        """Return the points that matter, each at one noise: of every lattice, or at a known noise of all together."""
        if not self._model.noise.parameters and not self._priors.is_gaussian:
            return self._cut_at_known_noise() if self._is_pulled else self._at_known_noise()
        points_of_members = [self._best_noise(member) for member in range(len(self._lattices))]
        masses = _masses(points_of_members)
        least_mass = max(_least_that_matters(np.concatenate(masses)), np.exp(-IRRELEVANT_LOG_DROP))
        return [points[mass >= least_mass] for points, mass in zip(points_of_members, masses, strict=True)]

    def _at_known_noise(self) -> list[Points]:
        """Return the points that matter at the known noise, of which only these are made."""
        points, data_set = self._all_points
        log_weight = points.log_weight[:, data_set]
        mass = np.exp(log_weight - log_weight.max())
        least_mass = max(_least_that_matters(mass), np.exp(-IRRELEVANT_LOG_DROP))
        return [points.among(data_set, mass >= least_mass)]

    def _cut_at_known_noise(self) -> list[Points]:
        """Return the points that matter where bounds, which only take away, leave little."""
        all_points, data_set = self._all_points
        points = all_points.among(data_set, all_points.log_weight[:, data_set] >= self._least_log_weight)
        mean, root = linear_at(self._lattices, self._index, points)
        ceiling = self._priors.box.ceiling(mean, root * points.noise_sd[:, None, None])
        points = replace(points, log_inside=ceiling)
        (mass,) = _masses([points])
        return [points[mass >= max(_least_that_matters(mass), np.exp(-IRRELEVANT_LOG_DROP))]]

    @cached_property
    def _all_points(self) -> tuple[PointsAtKnownNoise, int]:
        """All points at the known noise, and the data set's number among theirs."""
        if self._of_all is not None:
            return self._of_all, self._index
        return PointsAtKnownNoise.of(self._model, self._lattices, slice(self._index, self._index + 1)), 0

    def _are_cut(self, point_sets: Sequence[Points]) -> bool:
        """Return whether the bounds of linear parameters take away much; and learn below which weight nothing matters.

        At a known noise: bounds only take away.
        """
        box = self._priors.box
        if not (np.isfinite(box.lower).any() or np.isfinite(box.upper).any()):
            return False
        points, mass = Points.joined(point_sets), np.concatenate(_masses(point_sets))
        mean, root = linear_at(self._lattices, self._index, points)
        ceiling = box.ceiling(mean, root * points.noise_sd[:, None, None])
        if not self._model.noise.parameters:
            self._least_log_weight = float((points.log_weight + ceiling).max()) - NEGLIGIBLE_LOG_DROP
        return float(mass @ np.exp(ceiling)) < HARDLY_CUT_SHARE * float(mass.sum())

    def _best_noise(self, member: int) -> Points:
        """Return all points of a lattice at the known noise, or at the noise that each thinks best."""
        lattice, noise = self._lattices[member], self._model.noise
        second_index, first_index = np.indices(lattice.misfit.shape[:2]).reshape(2, -1)
        if not noise.parameters:
            noise_sd = np.full(len(second_index), float(noise.sd({}, 0.0)))
            return self._weighed(member, second_index, first_index, noise_sd)
        likely = np.clip(self._model.priors["noise_sd"].quantile(LIKELY_PROBABILITIES), *np.exp(self._ends))
        misfit = lattice.misfit[second_index, first_index, self._index]
        most_likely_noise = np.sqrt(misfit / lattice.freedom)
        candidates = [self._weighed(member, second_index, first_index, np.clip(most_likely_noise, *likely))]
        rise = _rise(candidates[0])
        for share in np.linspace(0, 1, NOISE_TRIALS)[1:] if rise.max() > HARDLY_PULLED_RISE else ():
            noise_sd = np.clip(most_likely_noise * np.exp(share * rise), *likely)
            candidates.append(self._weighed(member, second_index, first_index, noise_sd))
        best = np.argmax([points.log_mass for points in candidates], axis=0)
        arrays = zip(*(vars(points).values() for points in candidates), strict=True)
        return Points(*(np.stack(values)[best, np.arange(len(best))] for values in arrays))

    def _all_noise(self, points: Points) -> Points:
        """Return the points of a lattice with several values of the noise for each, row by row.

        They are those of a Gauss rule for the likelihood's own shape; where the prior cuts that or is narrower,
        those of a Gauss-Legendre rule on what it leaves.
        """
        member = int(points.lattice[0])
        freedom, ends = self._lattices[member].freedom, self._ends
        mode = 0.5 * np.log(np.maximum(points.misfit / freedom, TINY_SQUARE))[:, None]
        reach_below, reach_above = _reach(freedom)
        low, high = mode - reach_below, mode + _rise(points)[:, None] + reach_above
        if not self._is_pulled and (low >= ends[0]).all() and (high <= ends[1]).all():
            nodes, cells = _noise_rule(freedom)
            logs = mode + nodes
        else:
            cut = np.maximum(low, ends[0]), np.minimum(high, ends[1])
            keeps = (cut[0] < cut[1]) & (high - low < ends[1] - ends[0])
            low, high = (np.where(keeps, value, end) for value, end in zip(cut, ends, strict=True))
            wider = float((high - low).max()) / (reach_below + reach_above)
            nodes, cells = gauss_rule(int(CUT_NODES * np.clip(wider, 1, MAX_NODES_FACTOR)))
            logs, cells = low + (high - low) * nodes, (high - low) * cells
        noise_sd = np.exp(logs).ravel()
        rows = np.repeat(np.arange(len(points.misfit)), len(nodes))
        points_of_noise = self._weighed(member, points.second_index[rows], points.first_index[rows], noise_sd)
        log_cell = np.log(np.broadcast_to(cells, logs.shape).ravel())
        log_cell += log_prior_of_noise(self._model, self._ratios, noise_sd)
        return replace(points_of_noise, log_weight=points_of_noise.log_weight + log_cell)

    def _weighed(self, member: int, second_index: IndexArray, first_index: IndexArray, noise_sd: FloatArray) -> Points:
        """Return points of a lattice with their weights: likelihood and prior of member and amplitudes."""
        lattice, symbols = self._lattices[member], self._model.energy_symbols
        log_weight = lattice.log_likelihood(self._index, second_index, first_index, noise_sd) + np.log(
            lattice.member.probability
        )
        strain, log_inside = np.zeros(len(first_index)), np.zeros(len(first_index))
        if self._is_pulled:
            scores_and_roots = lattice.scores_and_roots(self._index, second_index, first_index)
            mean, root = lattice.linear(self._index, *scores_and_roots)
            strain = self._priors.strain(mean, root) if self._model.noise.parameters else strain
            mean, root, log_mass = self._priors.times(mean, root * noise_sd[:, None, None])
            log_weight, log_inside = log_weight + log_mass, self._priors.box.ceiling(mean, root)
        amplitudes = _amplitudes(self._model, lattice, second_index, first_index) * noise_sd[:, None]
        for amplitude, indices in zip(lattice.member.amplitude_indices, (first_index, second_index), strict=False):
            log_weight += log_prior_of_log(self._model.priors[symbols[amplitude]], amplitudes[:, amplitude])
            log_weight += _log_cells(indices, lattice.step)
        misfit, numbers = lattice.misfit[second_index, first_index, self._index], np.full(len(first_index), member)
        return Points(numbers, second_index, first_index, noise_sd, amplitudes, log_weight, misfit, strain, log_inside)


def _amplitudes(
    model: StatisticalModel, lattice: Lattice, second_index: IndexArray, first_index: IndexArray
) -> FloatArray:
    """Return the amplitudes (M, a) at points of a lattice for unit noise; zero where its member has no such block."""
    amplitudes = np.zeros((len(first_index), len(model.energy_symbols)))
    grids = zip(lattice.ratios, (first_index, second_index), strict=True)
    for amplitude, (grid, indices) in zip(lattice.member.amplitude_indices, grids, strict=False):
        amplitudes[:, amplitude] = grid[indices]
    return amplitudes


def _known_log_weights(model: StatisticalModel, lattice: Lattice, data_sets: slice) -> FloatArray:
    """Return the log weights (G2, G1, b) of some data sets at all points of a lattice at the known noise of a model.

    As if the linear parameters had no priors.
    """
    noise_sd, member = float(model.noise.sd({}, 0.0)), lattice.member
    log_weights = lattice.log_likelihoods(data_sets, noise_sd) + np.log(member.probability)
    for amplitude, grid, axes in zip(member.amplitude_indices, lattice.ratios, ((0, 2), (1, 2)), strict=False):
        prior = model.priors[model.energy_symbols[amplitude]]
        of_grid = log_prior_of_log(prior, grid * noise_sd) + _log_cells(np.arange(len(grid)), lattice.step)
        log_weights += np.expand_dims(of_grid, axes)
    return np.asarray(log_weights)


def _counts(lattices: Sequence[Lattice], points: Points) -> IndexArray:
    """Return how many ratios of the second block and of the first one (2, M) the lattices of points have."""
    return np.array([lattice.misfit.shape[:2] for lattice in lattices])[points.lattice].T


def at_end(lattices: Sequence[Lattice], points: Points) -> BoolArray:
    """Return which points (M,) are at the largest amplitudes of their lattice: it is not known what lies beyond."""
    counts, indices = _counts(lattices, points), np.stack([points.second_index, points.first_index])
    return np.asarray(((counts > 1) & (indices == counts - 1)).any(axis=0))


def linear_at(lattices: Sequence[Lattice], index: int, points: Points) -> tuple[FloatArray, FloatArray]:
    """Return means (M, p) of the linear parameters without priors at points, and roots (M, p, p) for unit noise.

    Parameters
    ----------
    lattices : sequence of Lattice
        Those of which the points say the place.
    index : int
        Of the data set in the lattices.
    points : Points
        Those of one lattice after another.
    """
    ends = np.searchsorted(points.lattice, np.arange(len(lattices) + 1))
    blocks = [
        lattice.scores_and_roots(index, points.second_index[start:end], points.first_index[start:end])
        for lattice, start, end in zip(lattices, ends[:-1], ends[1:], strict=True)
        if end > start or not len(points.lattice)
    ]
    scores, root = (np.concatenate(arrays) for arrays in zip(*blocks, strict=True))
    return lattices[0].linear(index, scores, root)


def _log_cells(place_on_grid: IndexArray, step: float) -> FloatArray:
    """Return the logarithms of the cells of places on a grid.

    The first one stands for all smaller amplitudes, too, among which the density is constant.
    """
    return np.asarray(np.log(np.where(place_on_grid == 0, step / -np.expm1(-step), step)))


def log_prior_of_log(prior: Prior, values: FloatArray) -> FloatArray:
    """Return the log prior density (M,) of the logarithms of amplitudes or noise (M,)."""
    return np.asarray(prior.log_density(values) + np.log(values))


def log_prior_of_noise(model: StatisticalModel, ratios: Mapping[str, float], noise_sd: FloatArray) -> FloatArray:
    """Return the log prior density (M,) of log noise_sd, and of the noise's other parameters over it."""
    value = log_prior_of_log(model.priors["noise_sd"], noise_sd)
    for symbol, ratio in ratios.items():
        value = value + model.priors[symbol].log_density(ratio * noise_sd) + np.log(noise_sd)
    return np.asarray(value)


def noise_grid(model: StatisticalModel, points: Points, freedom: int, count: int) -> FloatArray:
    """Return values of the noise, evenly spaced in their logarithm, among which it lies given any of the points."""
    low, high = (
        0.5 * np.log(np.maximum(size / freedom, TINY_SQUARE)) for size in (points.misfit, points.misfit + points.strain)
    )
    reach_below, reach_above = _reach(freedom)
    taken = np.log(points.noise_sd)  # which a prior may draw away from what is likely by the data alone
    ends = min(low.min() - reach_below, taken.min()), max(high.max() + reach_above, taken.max())
    lowest, highest = np.clip(ends, *_ends(model, {}))
    return np.exp(np.linspace(lowest, highest, count))


def _ends(model: StatisticalModel, ratios: Mapping[str, float]) -> FloatArray:
    """Return the logarithms of the noise between which its priors leave it; of a known one, all."""
    if not model.noise.parameters:
        return np.array([-np.inf, np.inf])
    low, high = model.priors["noise_sd"].quantile(POSSIBLE_PROBABILITIES)
    for symbol, ratio in ratios.items():
        limits = model.priors[symbol].quantile(POSSIBLE_PROBABILITIES) / ratio
        low, high = max(low, limits[0]), min(high, limits[1])
    return np.log(np.maximum([low, high], TINY_SQUARE))


def _reach(freedom: int) -> tuple[float, float]:
    """Return how far log noise_sd reaches below its mode and above, given the ratios."""
    unit = 1 / np.sqrt(2 * freedom)
    return NOISE_BELOW * unit, (NOISE_BELOW + NOISE_ABOVE / np.sqrt(freedom)) * unit


def _rise(points: Points) -> FloatArray:
    """Return by how much (M,) the logarithm of the noise may rise where priors pull at the linear parameters."""
    return np.asarray(0.5 * np.log1p(points.strain / np.maximum(points.misfit, TINY_SQUARE)))


def _masses(point_sets: Sequence[Points]) -> list[FloatArray]:
    """Return the masses of the points of several sets, within bounds at most, over the largest of all."""
    logs = [points.log_mass for points in point_sets]
    top = max(log_masses.max(initial=-np.inf) for log_masses in logs)
    return [np.exp(log_masses - top) for log_masses in logs]


def _least_that_matters(mass: FloatArray) -> float:
    """Return the mass below which points hold next to nothing together."""
    negligible = NEGLIGIBLE_SHARE * mass.sum()
    is_tiny = mass < negligible / len(mass)  # which all together are no more
    order = np.sort(mass[~is_tiny])
    return float(order[np.searchsorted(np.cumsum(order), negligible - mass[is_tiny].sum())])


@lru_cache(maxsize=64)
def _noise_rule(freedom: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes, as log noise_sd from its mode, and weights of the Gauss rule whose weight is the likelihood.

    Given the ratios it is noise_sd^-f exp(-misfit / (2 noise_sd^2)): the same shape about its mode whatever the misfit.
    It is divided out of the weights again. By the Stieltjes procedure and the Jacobi matrix (Golub & Welsch 1969).
    """
    reach_below, reach_above = _reach(freedom)
    grid, step = np.linspace(-reach_below, reach_above, 4001, retstep=True)
    share = np.exp(_log_shape(grid, freedom))
    diagonal, beside = np.zeros(NOISE_NODES), np.zeros(NOISE_NODES)
    previous, current = np.zeros(len(grid)), np.full(len(grid), 1 / np.sqrt(share.sum()))
    for k in range(NOISE_NODES):
        diagonal[k] = (share * grid * current**2).sum()
        following = (grid - diagonal[k]) * current - beside[k - 1] * previous
        beside[k] = np.sqrt((share * following**2).sum())
        previous, current = current, following / beside[k]
    nodes, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1))
    return nodes, step * share.sum() * vectors[0] ** 2 * np.exp(-_log_shape(nodes, freedom))


def _log_shape(log_noise: FloatArray, freedom: int) -> FloatArray:
    return np.asarray(-freedom * (log_noise + 0.5 * np.expm1(-2 * log_noise)))
