"""The parameters that no closed form and no lattice integrates, under an energy discrepancy: exponents, noise_share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.amplitudes import Points, Weighing, at_end, known_log_weights, linear_at
from tissuq.inference.enumerators.lattice import LOG_RATIO_STEP, MAX_STRESS_RATIO, Directions, Lattice, Rows
from tissuq.inference.enumerators.line import FINE, Accuracy, Line, first_places, known_along, peaks
from tissuq.inference.marginal import Marginal, marginal_of_table
from tissuq.inference.quasi_monte_carlo import Proposal, adapted, effective, log_normal, systematic
from tissuq.mechanics.invariants import invariant_rates
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["OUTER_STEP", "Guide", "Node", "Outer", "single_nodes", "weighted_nodes"]

FloatArray = NDArray[np.float64]

VALUES_PER_PARAMETER = 64
"""Values taken at first for each of the parameters, and once more."""
MAX_SCORE = 8.0
"""Standard deviations beyond which probabilities round to one."""
LOG_RATIO_SD = 3.0
"""Standard deviation of the log of a ratio of noise parameters, in the coordinate that proposes it."""


TINY = 1e-300
"""The smallest number of which there is a logarithm."""
Places = NDArray[np.intp]
UNLIKELY_PROBABILITY = 1e-3
"""Probability of an amplitude's prior below which a lattice may begin."""
OUTER_STEP, BEGINNINGS = 2 * LOG_RATIO_STEP, 2
"""Step of the lattices at values of the outer parameters, and how many places they begin at in turn: so their errors
are of either sign and cancel."""
MAX_POINTS_OF_NODE, MAX_POINTS = 2000, 60_000
"""Points kept of each value, and where there are no outer parameters."""
SETTINGS_AT_ONCE = 32
"""Values of which the lattices are computed together, which bounds the memory."""
SCOUT_MEMBERS = 6
"""Members, about, whose posterior guides the search for the values."""
GUIDED_DIVISOR = 8
"""So many times fewer values in a round, where it is known from a similar model about where they lie."""
MAX_RATIO_TO_DATA = 3000.0
"""Stress of the discrepancy over that of the data, beyond which there is mostly nothing."""
NEGLIGIBLE_MEMBERS = 1e-3
"""Share of the posterior, in its middle, of all members that are left out."""
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

    def marginal(self, nodes: Sequence[Node], shares: FloatArray) -> Marginal:
        """Return the marginal of the one parameter, no ratio, from the shares (K,) of nodes at its places."""
        from scipy.special import ndtr

        widths, places = np.array([node.width for node in nodes]), np.array([node.place for node in nodes])
        points, density, _ = Line(places, np.log(np.maximum(shares / widths, TINY))).distribution
        values = self._model.priors[self.symbols[0]].quantile(ndtr(points))
        is_new = np.concatenate([[True], np.diff(values) > 0])
        values, points, density = values[is_new], points[is_new], density[is_new]
        return marginal_of_table(values, density * np.gradient(points) / np.gradient(values))

    def ratios(self, settings: FloatArray) -> dict[str, float]:
        """Return those of the noise's parameters to noise_sd, by symbol."""
        pairs = zip(self.symbols, settings, self.of_noise, strict=True)
        return {symbol: float(value) for symbol, value, of_noise in pairs if of_noise}

    def alike(self, settings: FloatArray, most: int) -> Iterator[NDArray[np.intp]]:
        """Yield the rows of settings (N, d), so many at once at the most, of which the relative noise is the same."""
        most = 1 if self.of_noise.any() else most
        return iter(np.split(np.arange(len(settings)), range(most, len(settings), most)))

    def rows(self, settings: FloatArray) -> Rows:
        """Return the measurements with these parameters given, (D, d), of which the relative noise is the same."""
        model = self._model
        values = dict(zip(self.symbols, settings.T, strict=True))
        of_noise = {symbol: float(values[symbol][0]) for symbol in np.array(self.symbols)[self.of_noise]}
        scale = np.asarray(model.noise.sd(of_noise | {"noise_sd": 1.0}, model.levels)) if of_noise else 1.0
        scale = np.broadcast_to(scale, len(model.stress)).astype(float)
        bent = [values[symbol] for symbol in model.bent_symbols]
        basis = (
            model.designs_at(np.column_stack(bent)) if bent else np.repeat(model.design[None], len(settings), axis=0)
        )
        is_linear = np.isin(model.column_symbols, model.linear)
        fixed = [values[symbol] for symbol in np.array(model.column_symbols)[~is_linear]]
        stresses = np.repeat(model.stress[None, :, None], len(settings), axis=0)
        if fixed:
            stresses = stresses - basis[:, :, ~is_linear] @ np.column_stack(fixed)[:, :, None]
        return Rows(basis[:, :, is_linear] / scale[:, None], stresses / scale[:, None], scale, model.experiment.size)


def relative_error(outer: Outer, log_masses: FloatArray, min_effective: float) -> float:
    """Return the relative error of a sum of independent masses, given their logarithms (K,).

    Raises
    ------
    ConvergenceError
        When few of them hold nearly everything.
    """
    count = effective(log_masses)
    if count < min_effective:
        raise ConvergenceError(
            f"the posterior of {', '.join(outer.symbols)} was not found well enough to integrate the discrepancy: "
            f"{count:.0f} of {len(log_masses)} values are effective. Give these parameters narrower priors, or choose "
            "a material with fewer of them."
        )
    return float(np.sqrt(1 / count - 1 / len(log_masses)))


@dataclass
class Guide:
    """Where the posterior of the outer parameters was last: what the search in a similar model begins with.

    A lower accuracy takes fewer values.
    """

    accuracy: Accuracy = FINE
    places: FloatArray | None = None
    peaks: FloatArray | None = None
    proposal: Proposal | None = None


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
        """The logarithm of the points' sum."""
        return float(np.logaddexp.reduce(self.points.log_weight))


def single_nodes(models: Sequence[StatisticalModel]) -> list[Node]:
    """Return the posteriors of models on the same stretches that have no outer parameters."""
    stresses = np.array([model.stress for model in models]).T
    rows = Rows(models[0].design[None], stresses[None], np.ones(len(stresses)), models[0].experiment.size)
    terms, members = _Terms(models), range(len(models[0].energy_members))
    for largest in _largest_ratios(models):
        lattices = [Lattice(terms.directions(member, rows.scale, largest=largest), rows) for member in members]
        sums = [Weighing(model, lattices, index).points() for index, model in enumerate(models)]
        if not any(at_end(lattices, points).any() for points, _ in sums):
            break
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


def weighted_nodes(model: StatisticalModel, guide: Guide) -> tuple[list[Node], FloatArray, float]:
    """Return nodes at values of the outer parameters, their log weights, and the relative error of their sum.

    One parameter takes values spread along its posterior; more take quasi-random ones of an adapted proposal.

    Raises
    ------
    ConvergenceError
        When the posterior of these parameters is far outside their priors, or few of the values hold nearly all of it.
    """
    outer = Outer(model)
    search = _Search(_Sums(model, outer), outer, len(model.energy_members))
    return search.on_line(guide) if len(outer.symbols) == 1 else search.by_proposal(guide)


class _Search:
    """The search for values of the outer parameters of one model."""

    def __init__(self, sums: _Sums, outer: Outer, member_count: int) -> None:
        self._sums, self._outer, self._members = sums, outer, np.arange(member_count)

    def on_line(self, guide: Guide) -> tuple[list[Node], FloatArray, float]:
        """Return nodes at places of the one outer parameter's coordinate that are spread along its posterior."""
        places = guide.places
        if places is None:
            scout = known_along(lambda at: self._scouted(at[:, None]), first_places(), MAX_SCORE)
            places = scout.spread(guide.accuracy)
        nodes: dict[float, Node] = {}

        def log_density(at: FloatArray) -> FloatArray:
            new = self._nodes(at[:, None])
            nodes.update(zip(at.tolist(), new, strict=True))
            return self._log_masses(new, at[:, None])

        self._leave_out_members(places[[len(places) // 2]])
        places = np.concatenate([places, self._peaks(guide)])
        line = known_along(log_density, places, MAX_SCORE, guide.accuracy)
        guide.places = line.spread(guide.accuracy)
        self._check_place(line.places[[line.log_masses.argmax()]])
        cells = zip(line.places, np.exp(line.log_masses - line.logs), strict=True)
        line_nodes = [replace(nodes[float(place)], place=float(place), width=float(width)) for place, width in cells]
        return *_weighted(line_nodes, line.log_masses), line.error

    def _peaks(self, guide: Guide) -> FloatArray:
        """Return places about where the material alone fits the data: a posterior may have a narrow peak there."""
        model = self._sums.model
        freedom, noise = model.experiment.size - len(model.linear), model.noise

        def log_likelihood(at: FloatArray) -> FloatArray:
            settings, misfit = self._settings(at[:, None]), np.empty(len(at))
            for rows in self._outer.alike(settings, len(settings)):
                misfit[rows] = (self._outer.rows(settings[rows]).fit.left ** 2).sum(axis=(1, 2))
            if noise.parameters:
                return np.asarray(-0.5 * freedom * np.log(np.maximum(misfit, TINY)))
            return np.asarray(-0.5 * misfit / float(noise.sd({}, 0.0)) ** 2)

        if guide.peaks is None:
            guide.peaks = peaks(log_likelihood, MAX_SCORE / 2)
        return guide.peaks

    def by_proposal(self, guide: Guide) -> tuple[list[Node], FloatArray, float]:
        """Return nodes at points that a proposal gives, adapted until enough of them are effective."""
        d = len(self._outer.symbols)
        start = guide.proposal
        if start is None:
            start = adapted(self._scouted, d).proposal
        self._check_place(start.mean)
        self._leave_out_members(start.mean)
        nodes = list[Node]()

        def log_masses(points: FloatArray) -> FloatArray:
            new = self._nodes(points)
            nodes.extend(new)
            return self._log_masses(new, points)

        count = VALUES_PER_PARAMETER * (d + 1) // (1 if guide.proposal is None else GUIDED_DIVISOR)
        min_effective = guide.accuracy.min_effective
        adaptation = adapted(log_masses, d, count, start=start, min_effective=min_effective)
        guide.proposal = adaptation.proposal
        error = relative_error(self._outer, adaptation.log_weights, min_effective)
        return *_weighted(nodes, adaptation.log_weights - np.log(len(nodes))), error

    def _scouted(self, points: FloatArray) -> FloatArray:
        """Return the logarithms of the density at points (N, d), roughly: from a few of the members."""
        scouts = self._members[:: -(-len(self._members) // SCOUT_MEMBERS)]
        sums = self._sums.points(self._settings(points), scouts)
        return np.asarray(self._bases(points) + [np.logaddexp.reduce(of_point.log_weight) for of_point in sums])

    def _nodes(self, points: FloatArray) -> list[Node]:
        return self._sums.nodes(self._settings(points), self._members)

    def _log_masses(self, nodes: Sequence[Node], points: FloatArray) -> FloatArray:
        """Return the logarithms of the density at points (N, d), given the nodes there."""
        return np.asarray(self._bases(points) + [node.log_mass for node in nodes])

    def _settings(self, points: FloatArray) -> FloatArray:
        return np.array([self._outer.settings(point) for point in points])

    def _bases(self, points: FloatArray) -> FloatArray:
        return np.array([self._outer.log_base(point) for point in points])

    def _leave_out_members(self, point: FloatArray) -> None:
        """Leave out members that have next to no mass at a point (d,) in the middle of the posterior."""
        (points,) = self._sums.points(self._settings(point[None]), self._members)
        masses = np.bincount(points.lattice, np.exp(points.log_weight - points.log_weight.max()), len(self._members))
        order = np.argsort(masses)
        self._members = np.sort(order[np.cumsum(masses[order]) > NEGLIGIBLE_MEMBERS * masses.sum()])

    def _check_place(self, point: FloatArray) -> None:
        far = [s for s, score in zip(self._outer.symbols, np.abs(point), strict=True) if score > MAX_SCORE - 1]
        if far:
            raise ConvergenceError(
                f"the data put {', '.join(far)} where the prior leaves next to nothing (less than 1e-12): give a prior "
                "that holds what the data say, in MPa where it is a stress."
            )


def _weighted(nodes: Sequence[Node], log_masses: FloatArray) -> tuple[list[Node], FloatArray]:
    """Return nodes with a mass at all, and log weights that give them these masses (K,)."""
    node_masses = np.array([node.log_mass for node in nodes])
    numbers = np.flatnonzero(np.isfinite(node_masses))
    return [nodes[int(number)] for number in numbers], (log_masses - node_masses)[numbers]


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


class _Sums:
    """The posterior of one model at any value of its outer parameters."""

    def __init__(self, model: StatisticalModel, outer: Outer) -> None:
        self.model, self._outer, self._calls = model, outer, 0
        self._terms = _Terms([model])
        self._known: dict[tuple[int, int], Directions] = {}

    def points(self, settings: FloatArray, members: Places) -> list[Points]:
        """Return the points that matter at settings (N, d); ``lattice`` is a place among the members."""
        return [weighing.points()[0] for _, _, weighing in self._weighings(settings, members)]

    def nodes(self, settings: FloatArray, members: Places) -> list[Node]:
        """Return the posteriors at settings (N, d) of all but these, by few points of the same weight."""
        first_call, nodes = self._calls + 1, list[Node]()
        for lattices, index, weighing in self._weighings(settings, members):
            of_setting, call = settings[len(nodes)], first_call + len(nodes)
            points, error = weighing.points()
            points = _thinned(points, MAX_POINTS_OF_NODE, GOLDEN_RATIO * call % 1)
            mean, root = linear_at(lattices, index, points)
            points = replace(points, lattice=members[points.lattice])
            nodes.append(Node(points, mean, root, error, of_setting, self._outer.ratios(of_setting)))
        return nodes

    def _weighings(self, settings: FloatArray, members: Places) -> Iterator[tuple[list[Lattice], int, Weighing]]:
        """Yield the posterior at each setting (N, d), the lattices behind it, and its number there.

        Lattices begin at other amplitudes in turn.
        """
        for rows in self._outer.alike(settings, SETTINGS_AT_ONCE):
            turns = (self._calls + np.arange(len(rows))) % BEGINNINGS
            self._calls += len(rows)
            of_turns = [self._of_turn(settings[rows[turns == turn]], members, turn) for turn in range(BEGINNINGS)]
            yield from (next(of_turns[turn]) for turn in turns)

    def _of_turn(
        self, settings: FloatArray, members: Places, turn: int
    ) -> Iterator[tuple[list[Lattice], int, Weighing]]:
        rows, ratios = self._outer.rows(settings), self._outer.ratios(settings[0])
        lattices = [Lattice(self._directions(rows.scale, int(member), turn), rows) for member in members]
        is_known = not self.model.noise.parameters
        logs = [known_log_weights(self.model, lattice, slice(None)) for lattice in lattices] if is_known else []
        for index in range(len(settings)):
            of_setting = [log_weights[:, :, index] for log_weights in logs] or None
            yield lattices, index, Weighing(self.model, lattices, index, ratios, of_setting)

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
    return _size_of_data(model) if model.noise.parameters else float(model.noise.sd({}, 0.0))


def _size_of_data(model: StatisticalModel) -> float:
    """Return the root mean square of the measured stresses."""
    return float(np.sqrt((model.stress**2).sum() / model.experiment.size))
