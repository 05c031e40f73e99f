"""The search for values of the outer parameters: along a line for one, by an adapted proposal for more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.line import first_places, known_along, peaks
from tissuq.inference.enumerators.nodes import Guide, Node, Sums
from tissuq.inference.enumerators.outer import TINY, Outer
from tissuq.inference.proposals import MAX_SEARCHES, adapted
from tissuq.inference.quasi_monte_carlo import effective
from tissuq.model.scales import MAX_SCORE
from tissuq.model.statistical_model import StatisticalModel

VALUES_PER_PARAMETER = 64
"""Values taken at first for each of the parameters, and once more."""
SCOUT_MEMBERS = 6
"""Members, about, whose posterior guides the search for the values."""
GUIDED_DIVISOR = 8
"""So many times fewer values in a round, where it is known from a similar model about where they lie."""
NEGLIGIBLE_MEMBERS = 1e-3
"""Share of the posterior, in its middle, of all members that are left out."""


def weighted_nodes(model: StatisticalModel, guide: Guide) -> tuple[list[Node], FloatArray, float]:
    """Return nodes at values of the outer parameters, their log weights, and the relative error of their sum.

    One parameter takes values spread along its posterior; more take quasi-random ones of an adapted proposal.

    Raises
    ------
    ConvergenceError
        When the posterior of these parameters is far outside their priors, or few of the values hold nearly all of it.
    """
    outer = Outer(model)
    sums = Sums(model, outer, guide.accuracy.points_of_value)
    search = _Search(sums, outer, len(model.energy_members))
    return search.on_line(guide) if len(outer.symbols) == 1 else search.by_proposal(guide)


class _Search:
    """The search for values of the outer parameters of one model."""

    def __init__(self, sums: Sums, outer: Outer, member_count: int) -> None:
        self._sums, self._outer, self._members = sums, outer, np.arange(member_count)

    def on_line(self, guide: Guide) -> tuple[list[Node], FloatArray, float]:
        """Return nodes at places of the one outer parameter's coordinate that are spread along its posterior."""
        places = guide.places
        if places is None:
            scout = known_along(lambda scores: self._scouted(scores[:, None]), first_places(), MAX_SCORE)
            places = scout.spread(guide.accuracy)
        nodes: dict[float, Node] = {}

        def log_density(scores: FloatArray) -> FloatArray:
            new = self._nodes(scores[:, None])
            nodes.update(zip(scores.tolist(), new, strict=True))
            return self._log_masses(new, scores[:, None])

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

        def log_likelihood(scores: FloatArray) -> FloatArray:
            settings, misfit = self._outer.settings(scores[:, None]), np.empty(len(scores))
            for rows in self._outer.alike(settings, len(settings)):
                misfit[rows] = (self._outer.rows(settings[rows]).fit.left ** 2).sum(axis=(1, 2))
            if noise.parameters:
                return np.asarray(-0.5 * freedom * np.log(np.maximum(misfit, TINY)))
            return np.asarray(-0.5 * misfit / float(noise.sd({}, 0.0)) ** 2)

        if guide.peaks is None:
            guide.peaks = peaks(log_likelihood, MAX_SCORE / 2)
        return guide.peaks

    def by_proposal(self, guide: Guide) -> tuple[list[Node], FloatArray, float]:
        """Return nodes at points that a proposal gives, adapted until enough of them are effective.

        Where those that begin with the posterior of a similar model do not lead there, they begin anew.
        """
        d, members = len(self._outer.symbols), self._members
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
        min_effective, enough = guide.accuracy.min_effective, guide.accuracy.enough_effective
        adaptation = adapted(
            log_masses,
            d,
            count,
            start=start,
            min_effective=min_effective,
            enough_effective=enough,
            points_taken=guide.points_taken,
        )
        guide.points_taken += len(nodes)
        points, log_weights, _ = adaptation.weighted
        is_found = adaptation.is_settled and effective(log_weights) >= min_effective
        if guide.proposal is not None and not is_found:
            guide.proposal, self._members = None, members
            return self.by_proposal(guide)
        guide.proposal, nodes = adaptation.proposal, nodes[-len(points) :]
        self._check_place(guide.proposal.mean)
        error = relative_error(self._outer, log_weights, min_effective)
        if not adaptation.is_settled:
            raise _not_found(self._outer, f"the sum still changes after {MAX_SEARCHES} searches")
        return *_weighted(nodes, log_weights - np.log(len(nodes))), error

    def _scouted(self, points: FloatArray) -> FloatArray:
        """Return the logarithms of the density at points (N, d), roughly: from a few of the members."""
        scouts = self._members[:: -(-len(self._members) // SCOUT_MEMBERS)]
        sums = self._sums.points(self._outer.settings(points), scouts)
        return np.asarray(self._bases(points) + [np.logaddexp.reduce(of_point.log_mass) for of_point in sums])

    def _nodes(self, points: FloatArray) -> list[Node]:
        return self._sums.nodes(self._outer.settings(points), self._members)

    def _log_masses(self, nodes: Sequence[Node], points: FloatArray) -> FloatArray:
        """Return the logarithms of the density at points (N, d), given the nodes there."""
        return np.asarray(self._bases(points) + [node.log_mass for node in nodes])

    def _bases(self, points: FloatArray) -> FloatArray:
        return np.array([self._outer.log_base(point) for point in points])

    def _leave_out_members(self, point: FloatArray) -> None:
        """Leave out members that have next to no mass at a point (d,) in the middle of the posterior."""
        (points,) = self._sums.points(self._outer.settings(point[None]), self._members)
        masses = np.bincount(points.lattice, np.exp(points.log_mass - points.log_mass.max()), len(self._members))
        order = np.argsort(masses)
        self._members = np.sort(order[np.cumsum(masses[order]) > NEGLIGIBLE_MEMBERS * masses.sum()])

    def _check_place(self, point: FloatArray) -> None:
        far = [s for s, score in zip(self._outer.symbols, np.abs(point), strict=True) if score > MAX_SCORE - 1]
        if far:
            raise ConvergenceError(
                f"the data put {', '.join(far)} where the prior leaves next to nothing (less than 1e-12): give a prior "
                "that holds what the data say, in MPa where it is a stress."
            )


def relative_error(outer: Outer, log_masses: FloatArray, min_effective: float) -> float:
    """Return the relative error of a sum of independent masses, given their logarithms (K,).

    Raises
    ------
    ConvergenceError
        When few of them hold nearly everything.
    """
    count = effective(log_masses)
    if count < min_effective:
        raise _not_found(outer, f"{count:.0f} of {len(log_masses)} values are effective")
    return float(np.sqrt(1 / count - 1 / len(log_masses)))


def _not_found(outer: Outer, reason: str) -> ConvergenceError:
    return ConvergenceError(
        f"the posterior of {', '.join(outer.symbols)} was not found well enough to integrate the discrepancy: {reason}"
        ". Give these parameters narrower priors, or choose a material with fewer of them."
    )


def _weighted(nodes: Sequence[Node], log_masses: FloatArray) -> tuple[list[Node], FloatArray]:
    """Return nodes with a mass at all, and log weights that give them these masses (K,)."""
    node_masses = np.array([node.log_mass for node in nodes])
    numbers = np.flatnonzero(np.isfinite(node_masses))
    return [nodes[int(number)] for number in numbers], (log_masses - node_masses)[numbers]
