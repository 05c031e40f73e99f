"""Posteriors under an energy discrepancy, given the parameters that no lattice sums over, and where to take these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.enumerators.amplitudes import Points, Weighing
from tissuq.inference.enumerators.lattice import STEP, Directions, Lattice
from tissuq.inference.enumerators.outer import Outer, plain_rows, relative_error, weighted_settings
from tissuq.inference.resampling import systematic
from tissuq.mechanics.invariants import invariant_rates
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["OUTER_STEP", "Node", "single_nodes", "weighted_nodes"]

FloatArray = NDArray[np.float64]
Places = NDArray[np.intp]

UNLIKELY = 1e-3
"""Probability of an amplitude's prior below which a lattice may begin."""
OUTER_STEP, BEGINNINGS = 2 * STEP, 4
"""Step of the lattices at values of the outer parameters, and how many places they begin at in turn: so their errors
are of either sign and cancel."""
OF_NODE, MOST = 2000, 60_000
"""Points kept of each value, and where there are no outer parameters."""
SCOUTS = 6
"""Members, about, whose posterior guides the search for the values."""
GOLDEN = 0.6180339887


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
    rows = plain_rows(models)
    terms = _Terms(models)
    lattices = [Lattice(terms.directions(member, rows.scale), rows) for member in range(len(models[0].energy_members))]
    nodes = []
    for index, model in enumerate(models):
        points, error = Weighing(model, lattices, index).points()
        points = _thinned(points, MOST, 0.5)
        nodes.append(Node(points, *_linear(lattices, index, points), error))
    return nodes


def weighted_nodes(model: StatisticalModel) -> tuple[list[Node], FloatArray, float]:
    """Return nodes at quasi-random values of the outer parameters, their log weights, and their evidence's error."""
    outer = Outer(model)
    members = np.arange(len(model.energy_members))
    scouts = members[:: -(-len(members) // SCOUTS)]
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

    def directions(self, index: int, scale: FloatArray, step: float = STEP, shift: float = 0.0) -> Directions:
        """Return the directions of one member for the noise (n,) of every measurement over noise_sd."""
        member, features = self._members[index], self._features[index]
        symbols = [self._models[0].energy_symbols[block] for block in member.amplitude_indices]
        unlikely = [min(float(m.priors[s].quantile(UNLIKELY)) / _most_noise(m) for m in self._models) for s in symbols]
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
        """Return the posterior of all but the outer parameters, by at most `OF_NODE` points of the same weight."""
        lattices, ratios = self._lattices(settings, members), self._outer.ratios(settings)
        points, error = Weighing(self._model, lattices, 0, ratios).points()
        points = _thinned(points, OF_NODE, GOLDEN * self._calls % 1)
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
