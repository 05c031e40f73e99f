"""The parameters that no closed form and no lattice integrates, under an energy discrepancy: exponents, noise_share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.amplitudes import Points, Weighing
from tissuq.inference.enumerators.lattice import LOG_RATIO_STEP, Directions, Lattice, Rows
from tissuq.inference.quasi_monte_carlo import adapted, effective, even_points, log_normal, systematic
from tissuq.mechanics.invariants import invariant_rates
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["OUTER_STEP", "Node", "Outer", "single_nodes", "weighted_nodes", "weighted_settings"]

FloatArray = NDArray[np.float64]

VALUES_PER_PARAMETER, MIN_EFFECTIVE_VALUES = 64, 20
"""Values taken for each of the parameters, and once more; how many must be effective."""
MAX_SCORE = 8.0
"""Standard deviations beyond which probabilities round to one."""
LOG_RATIO_SD = 3.0
"""Standard deviation of the log of a ratio of noise parameters, in the coordinate that proposes it."""


Places = NDArray[np.intp]
UNLIKELY_PROBABILITY = 1e-3
"""Probability of an amplitude's prior below which a lattice may begin."""
OUTER_STEP, BEGINNINGS = 2 * LOG_RATIO_STEP, 4
"""Step of the lattices at values of the outer parameters, and how many places they begin at in turn: so their errors
are of either sign and cancel."""
MAX_POINTS_OF_NODE, MAX_POINTS = 2000, 60_000
"""Points kept of each value, and where there are no outer parameters."""
SCOUT_MEMBERS = 6
"""Members, about, whose posterior guides the search for the values."""
GOLDEN_RATIO = 0.6180339887
"""Multiples of it, modulo one, are where systematic resampling starts at each node in turn."""


class Outer:
    """Those parameters of a model, in coordinates that are standard normal under their priors, or near that.

    A parameter of the noise beside noise_sd enters by its ratio to noise_sd: given the ratio, the noise of all
    measurements is in proportion to noise_sd.

    Attributes
    ----------
    symbols : tuple of str
    of_noise : (d,) array
        Which of them belong to the noise.
    """

    def __init__(self, model: StatisticalModel) -> None:
        self._model = model
        inner = (*model.energy_symbols, "noise_sd")
        self.symbols = tuple(symbol for symbol in model.nonlinear if symbol not in inner)
        self.of_noise = np.isin(self.symbols, [p.symbol for p in model.noise.parameters])
        self._middle = -np.log(np.median(model.levels)) if self.of_noise.any() else 0.0

    def settings(self, point: FloatArray) -> FloatArray:
        """Return the values (d,) at a point (d,); ratios in place of the noise's parameters."""
        from scipy.special import ndtr

        probability = ndtr(np.clip(point, -MAX_SCORE, MAX_SCORE))
        quantiles = [
            float(self._model.priors[symbol].quantile(p)) for symbol, p in zip(self.symbols, probability, strict=True)
        ]
        return np.where(self.of_noise, np.exp(self._middle + LOG_RATIO_SD * point), quantiles)

    def log_base(self, point: FloatArray) -> float:
        """Return the log density of the priors in the coordinates at a point (d,); of ratios, that of the measure."""
        log_density = log_normal(point[None, ~self.of_noise])[0]
        return float(log_density + (self._middle + LOG_RATIO_SD * point + np.log(LOG_RATIO_SD))[self.of_noise].sum())

    def ratios(self, settings: FloatArray) -> dict[str, float]:
        """Return those of the noise's parameters to noise_sd, by symbol."""
        pairs = zip(self.symbols, settings, self.of_noise, strict=True)
        return {symbol: float(value) for symbol, value, of_noise in pairs if of_noise}

    def rows(self, settings: FloatArray) -> Rows:
        """Return the measurements with these parameters given."""
        model = self._model
        values = dict(zip(self.symbols, map(float, settings), strict=True))
        scale = np.asarray(model.noise.sd(values | {"noise_sd": 1.0}, model.levels)) if self.of_noise.any() else 1.0
        scale = np.broadcast_to(scale, len(model.stress)).astype(float)
        bent = [values[symbol] for symbol in model.bent_symbols]
        basis = model.design_at(bent) if bent else model.design
        is_linear = np.isin(model.column_symbols, model.linear)
        known_stress = basis[:, ~is_linear] @ [values[symbol] for symbol in np.array(model.column_symbols)[~is_linear]]
        stresses = (model.stress - known_stress) / scale
        return Rows(basis[:, is_linear] / scale[:, None], stresses[:, None], scale, model.experiment.size)


def weighted_settings(outer: Outer, scout: Callable[[FloatArray], float]) -> tuple[FloatArray, FloatArray]:
    """Return values (K, d) of the outer parameters, and the log of prior over proposal (K,) at each, over K.

    Parameters
    ----------
    outer : Outer
    scout : callable
        Log of the likelihood at values (d,), roughly: where it leads is where values are taken.

    Raises
    ------
    ConvergenceError
        When that is far outside the priors.
    """
    d = len(outer.symbols)

    def log_density(points: FloatArray) -> FloatArray:
        return np.array([scout(outer.settings(point)) + outer.log_base(point) for point in points])

    proposal = adapted(log_density, d)
    far = [symbol for symbol, score in zip(outer.symbols, np.abs(proposal.mean), strict=True) if score > MAX_SCORE - 1]
    if far:
        raise ConvergenceError(
            f"the data put {', '.join(far)} where the prior leaves next to nothing (less than 1e-12): give a prior "
            "that holds what the data say, in MPa where it is a stress."
        )
    points = proposal.points(even_points(d, VALUES_PER_PARAMETER * (d + 1)))
    base = np.array([outer.log_base(point) for point in points])
    settings = np.array([outer.settings(point) for point in points])
    return settings, base - proposal.log_density(points) - np.log(len(points))


def relative_error(outer: Outer, log_masses: FloatArray) -> float:
    """Return the relative error of a sum of independent masses, given their logarithms (K,).

    Raises
    ------
    ConvergenceError
        When few of them hold nearly everything.
    """
    count = effective(log_masses)
    if count < MIN_EFFECTIVE_VALUES:
        raise ConvergenceError(
            f"the posterior of {', '.join(outer.symbols)} was not found well enough to integrate the discrepancy: "
            f"{count:.0f} of {len(log_masses)} values are effective. Give these parameters narrower priors, or choose "
            "a material with fewer of them."
        )
    return float(np.sqrt(1 / count - 1 / len(log_masses)))


@dataclass(frozen=True, eq=False)
class Node:
    """The posterior at one value of the outer parameters, (d,): points, of which ``lattice`` is the member's place.

    Attributes
    ----------
    mean, root : (M, p) and (M, p, p) arrays
        Of the linear parameters at the points without their priors, and for unit noise.
    error : float
        Relative error of the points' sum.
    ratios : mapping of str to float
        Those of the noise's parameters to noise_sd.
    """

    points: Points
    mean: FloatArray
    root: FloatArray
    error: float
    outer: FloatArray = field(default_factory=lambda: np.zeros(0))
    ratios: Mapping[str, float] = field(default_factory=dict)


def single_nodes(models: Sequence[StatisticalModel]) -> list[Node]:
    """Return the posteriors of models on the same stretches that have no outer parameters."""
    stresses = np.array([model.stress for model in models]).T
    rows = Rows(models[0].design, stresses, np.ones(len(stresses)), models[0].experiment.size)
    terms = _Terms(models)
    lattices = [Lattice(terms.directions(member, rows.scale), rows) for member in range(len(models[0].energy_members))]
    nodes = []
    for index, model in enumerate(models):
        points, error = Weighing(model, lattices, index).points()
        points = _thinned(points, MAX_POINTS, 0.5)
        nodes.append(Node(points, *_linear(lattices, index, points), error))
    return nodes


def weighted_nodes(model: StatisticalModel) -> tuple[list[Node], FloatArray, float]:
    """Return nodes at quasi-random values of the outer parameters, their log weights, and their evidence's error."""
    outer = Outer(model)
    members = np.arange(len(model.energy_members))
    scouts = members[:: -(-len(members) // SCOUT_MEMBERS)]
    sums = _Sums(model, outer)
    settings, log_weights = weighted_settings(
        outer, lambda values: float(np.logaddexp.reduce(sums.points(values, scouts).log_weight))
    )
    nodes = [sums.node(values, members) for values in settings]
    masses = log_weights + np.array([np.logaddexp.reduce(node.points.log_weight) for node in nodes])
    return nodes, log_weights, relative_error(outer, masses)


class _Terms:
    """The stresses of the members of an energy discrepancy on one design, the same for all models on it."""

    def __init__(self, models: Sequence[StatisticalModel]) -> None:
        self._models, self._members = models, models[0].energy_members
        self._features = [models[0].energy_features(member) for member in range(len(self._members))]
        unit, _ = invariant_rates(models[0].states)
        self._count = models[0].experiment.size
        self._negligible_stress = float(np.sqrt((models[0].rows(unit) ** 2).sum() / self._count))

    def directions(self, index: int, scale: FloatArray, step: float = LOG_RATIO_STEP, shift: float = 0.0) -> Directions:
        """Return the directions of one member for the noise (n,) of every measurement over noise_sd."""
        member, features = self._members[index], self._features[index]
        symbols = [self._models[0].energy_symbols[block] for block in member.amplitude_indices]
        unlikely = [
            min(
                float(model.priors[symbol].quantile(UNLIKELY_PROBABILITY)) / _most_noise(model)
                for model in self._models
            )
            for symbol in symbols
        ]
        return Directions(member, scale, features, self._count, self._negligible_stress, unlikely, step, shift)


class _Sums:
    """The posterior of one model at any value of its outer parameters."""

    def __init__(self, model: StatisticalModel, outer: Outer) -> None:
        self._model, self._outer, self._calls = model, outer, 0
        self._terms = _Terms([model])
        self._known: dict[tuple[int, int], Directions] = {}

    def points(self, settings: FloatArray, members: Places) -> Points:
        """Return the points that matter; ``lattice`` is a place among the members."""
        return Weighing(self._model, self._lattices(settings, members), 0, self._outer.ratios(settings)).points()[0]

    def node(self, settings: FloatArray, members: Places) -> Node:
        """Return the posterior of all but the outer parameters, by few points of the same weight."""
        lattices, ratios = self._lattices(settings, members), self._outer.ratios(settings)
        points, error = Weighing(self._model, lattices, 0, ratios).points()
        points = _thinned(points, MAX_POINTS_OF_NODE, GOLDEN_RATIO * self._calls % 1)
        mean, root = _linear(lattices, 0, points)
        return Node(replace(points, lattice=members[points.lattice]), mean, root, error, settings, ratios)

    def _lattices(self, settings: FloatArray, members: Places) -> list[Lattice]:
        rows, turn = self._outer.rows(settings), self._calls % BEGINNINGS
        self._calls += 1
        return [Lattice(self._directions(rows.scale, int(member), turn), rows) for member in members]

    def _directions(self, scale: FloatArray, member: int, turn: int) -> Directions:
        """Return the directions of one member, remembered while the relative noise stays the same."""
        directions = self._known.get((member, turn))
        if directions is None or self._outer.of_noise.any():
            shift = OUTER_STEP * (turn + 0.5) / BEGINNINGS
            directions = self._known[member, turn] = self._terms.directions(member, scale, OUTER_STEP, shift)
        return directions


def _thinned(points: Points, count: int, offset: float) -> Points:
    """Return the points, or where these are more, so many of the same weight that stand for all."""
    if len(points.lattice) <= count:
        return points
    total = np.logaddexp.reduce(points.log_weight)
    representatives = points[systematic(np.exp(points.log_weight - total)[None], count, offset)[0]]
    return replace(representatives, log_weight=np.full(count, total - np.log(count)))


def _most_noise(model: StatisticalModel) -> float:
    """Return the noise, or the most that it can be."""
    if not model.noise.parameters:
        return float(model.noise.sd({}, 0.0))
    return float(np.sqrt((model.stress**2).sum() / model.experiment.size))


def _linear(lattices: Sequence[Lattice], index: int, points: Points) -> tuple[FloatArray, FloatArray]:
    """Return means (M, p) of the linear parameters without priors, and roots (M, p, p) for unit noise."""
    p = lattices[0].parameters
    mean, root = np.empty((len(points.lattice), p)), np.empty((len(points.lattice), p, p))
    for member in np.unique(points.lattice):
        of_member = np.flatnonzero(points.lattice == member)
        mean[of_member], root[of_member] = lattices[member].linear(
            index, points.second_index[of_member], points.first_index[of_member]
        )
    return mean, root
