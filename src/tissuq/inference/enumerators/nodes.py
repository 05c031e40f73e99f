"""The posterior at given exponents: sums over lattices of all members, those of many exponents together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.inference.enumerators.amplitudes import Points, PointsAtKnownNoise, Weighing, at_end, linear_at
from tissuq.inference.enumerators.lattice import LOG_RATIO_STEP, MAX_STRESS_RATIO, Directions, Lattice, Rows
from tissuq.inference.enumerators.line import FINE, Accuracy
from tissuq.inference.enumerators.outer import Outer
from tissuq.inference.proposals import Proposal
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.mechanics.invariants import invariant_rates
from tissuq.model.statistical_model import StatisticalModel

UNLIKELY_PROBABILITY = 1e-3
"""Probability of an amplitude's prior below which a lattice may begin."""
OUTER_STEP, BEGINNINGS = 2 * LOG_RATIO_STEP, 2
"""Step of the lattices at values of the outer parameters, and how many places they begin at in turn: so their errors
are of either sign and cancel."""
MAX_POINTS = 60_000
"""Points kept where there are no outer parameters."""
SETTINGS_AT_ONCE = 32
"""Values of which the lattices are computed together, which bounds the memory."""
MAX_RATIO_TO_DATA = 3000.0
"""Stress of the discrepancy over that of the data, beyond which there is mostly nothing."""
GOLDEN_RATIO = 0.6180339887
"""Multiples of it, modulo one, are where systematic resampling starts at each node in turn."""


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
    place, width : float
        Of one outer parameter: its coordinate, and of that the length for which the node stands; None of more.
    """

    points: Points
    mean: FloatArray
    root: FloatArray
    error: float
    outer: FloatArray = field(default_factory=lambda: np.zeros(0))
    ratios: Mapping[str, float] = field(default_factory=dict)
    place: float | None = None
    width: float = 1.0

    @property
    def log_mass(self) -> float:
        """The logarithm of the points' sum, with what bounds leave of each where they cut deep."""
        return float(np.logaddexp.reduce(self.points.log_mass))


@dataclass
class Guide:
    """Where the posterior of amplitudes and outer parameters was last: what the search in a similar model begins with.

    A lower accuracy takes fewer values. Errors of posteriors that are summed cancel where each takes other ones:
    ``points_taken`` of the quasi-random points went before.
    """

    accuracy: Accuracy = FINE
    places: FloatArray | None = None
    peaks: FloatArray | None = None
    proposal: Proposal | None = None
    points_taken: int = 0
    has_large_amplitudes: bool = False


def single_nodes(models: Sequence[StatisticalModel], guide: Guide) -> list[Node]:
    """Return the posteriors of models on the same stretches that have no outer parameters."""
    stresses = np.array([model.stress for model in models]).T
    rows = Rows(models[0].design[None], stresses[None], np.ones(len(stresses)), models[0].experiment.size)
    terms, members = _Terms(models), range(len(models[0].energy_members))
    for largest in _largest_ratios(models)[-1 if guide.has_large_amplitudes else 0 :]:
        lattices = [Lattice(terms.directions(member, rows.scale, largest=largest), rows) for member in members]
        sums = [Weighing(model, lattices, index).points() for index, model in enumerate(models)]
        if not any(at_end(lattices, points).any() for points, _ in sums):
            break
        guide.has_large_amplitudes = True
    nodes = []
    for index, (points, error) in enumerate(sums):
        points = _thinned(points, MAX_POINTS, 0.5)
        nodes.append(Node(points, *linear_at(lattices, index, points), error))
    return nodes


def _largest_ratios(models: Sequence[StatisticalModel]) -> list[float]:
    """Return ratios of the discrepancy's stress to the noise, ascending, up to which lattices are tried.

    Where the noise is known, so is about the largest that the data allow: most posteriors end there.
    """
    of_data = np.inf
    if not models[0].noise.parameters:
        of_data = max(_size_of_data(model) / _most_noise(model) for model in models)
    return sorted({min(MAX_RATIO_TO_DATA * of_data, MAX_STRESS_RATIO), MAX_STRESS_RATIO})


class Sums:
    """The posterior of one model at any value of its outer parameters, of which nodes keep so many points at most."""

    def __init__(self, model: StatisticalModel, outer: Outer, points_of_value: int) -> None:
        self.model, self._outer, self._points_of_value, self._calls = model, outer, points_of_value, 0
        self._terms = _Terms([model])
        self._known: dict[tuple[int, int], Directions] = {}

    def points(self, settings: FloatArray, members: IndexArray) -> list[Points]:
        """Return the points that matter at settings (N, d); ``lattice`` is a place among the members."""
        return [weighing.points()[0] for _, _, weighing in self._weighings(settings, members)]

    def nodes(self, settings: FloatArray, members: IndexArray) -> list[Node]:
        """Return the posteriors at settings (N, d) of all but these, by few points of the same weight."""
        first_call, nodes = self._calls + 1, list[Node]()
        for lattices, index, weighing in self._weighings(settings, members):
            of_setting, call = settings[len(nodes)], first_call + len(nodes)
            points, error = weighing.points()
            points = _thinned(points, self._points_of_value, GOLDEN_RATIO * call % 1)
            mean, root = linear_at(lattices, index, points)
            points = replace(points, lattice=members[points.lattice])
            nodes.append(Node(points, mean, root, error, of_setting, self._outer.ratios(of_setting)))
        return nodes

    def _weighings(self, settings: FloatArray, members: IndexArray) -> Iterator[tuple[list[Lattice], int, Weighing]]:
        """Yield the posterior at each setting (N, d), the lattices behind it, and its number there.

        Lattices begin at other amplitudes in turn.
        """
        for rows in self._outer.alike(settings, SETTINGS_AT_ONCE):
            turns = (self._calls + np.arange(len(rows))) % BEGINNINGS
            self._calls += len(rows)
            of_turns = [self._of_turn(settings[rows[turns == turn]], members, turn) for turn in range(BEGINNINGS)]
            yield from (next(of_turns[turn]) for turn in turns)

    def _of_turn(
        self, settings: FloatArray, members: IndexArray, turn: int
    ) -> Iterator[tuple[list[Lattice], int, Weighing]]:
        rows, ratios = self._outer.rows(settings), self._outer.ratios(settings[0])
        lattices = [Lattice(self._directions(rows.scale, int(member), turn), rows) for member in members]
        is_known = not self.model.noise.parameters
        at_known_noise = PointsAtKnownNoise.of(self.model, lattices, slice(None)) if is_known else None
        for index in range(len(settings)):
            yield lattices, index, Weighing(self.model, lattices, index, ratios, at_known_noise)

    def _directions(self, scale: FloatArray, member: int, turn: int) -> Directions:
        """Return the directions of one member, remembered while the relative noise stays the same."""
        directions = self._known.get((member, turn))
        if directions is None or self._outer.of_noise.any():
            shift = OUTER_STEP * (turn + 0.5) / BEGINNINGS
            directions = self._known[member, turn] = self._terms.directions(member, scale, OUTER_STEP, shift)
        return directions


class _Terms:
    """The stresses of the members of an energy discrepancy on one design, the same for all models on it."""

    def __init__(self, models: Sequence[StatisticalModel]) -> None:
        self._models, self._members = models, models[0].energy_members
        self._features = [models[0].energy_features(member) for member in range(len(self._members))]
        unit, _ = invariant_rates(models[0].states)
        self._count = models[0].experiment.size
        self._negligible_stress = float(np.sqrt((models[0].rows(unit) ** 2).sum() / self._count))

    def directions(
        self,
        index: int,
        scale: FloatArray,
        step: float = LOG_RATIO_STEP,
        shift: float = 0.0,
        largest: float = MAX_STRESS_RATIO,
    ) -> Directions:
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
        return Directions(member, scale, features, self._count, self._negligible_stress, unlikely, step, shift, largest)


def _thinned(points: Points, count: int, offset: float) -> Points:
    """Return the points, or where these are more, so many of the same weight that stand for all."""
    if len(points.lattice) <= count:
        return points
    total = np.logaddexp.reduce(points.log_mass)
    representatives = points[systematic(np.exp(points.log_mass - total)[None], count, offset)[0]]
    return replace(representatives, log_weight=total - np.log(count) - representatives.log_inside)


def _most_noise(model: StatisticalModel) -> float:
    """Return the noise, or the most that it can be."""
    return _size_of_data(model) if model.noise.parameters else float(model.noise.sd({}, 0.0))


def _size_of_data(model: StatisticalModel) -> float:
    """Return the root mean square of the measured stresses."""
    return float(np.sqrt((model.stress**2).sum() / model.experiment.size))
