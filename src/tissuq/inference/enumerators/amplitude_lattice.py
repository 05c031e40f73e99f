"""The posterior under an energy discrepancy: exact sums over its members and lattices of their amplitudes.

Given a member and the ratios g = c / noise_sd of its amplitudes, everything is linear and Gaussian
(`tissuq.inference.enumerators.lattice`). The integrand is smooth in log g and log noise_sd, so that equally spaced
points integrate it with an error that falls exponentially with their number. A parameter that is left, such as an
exponent, takes values spread over its posterior, and several those of weighted quasi-random points
(`tissuq.inference.enumerators.outer_search`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import ModelError
from tissuq.inference.box import Boxes
from tissuq.inference.enumerators.amplitudes import (
    NEGLIGIBLE_SHARE,
    Points,
    log_prior_of_log,
    log_prior_of_noise,
    noise_grid,
)
from tissuq.inference.enumerators.lattice import LOG_RATIO_STEP, Reduced
from tissuq.inference.enumerators.nodes import OUTER_STEP, SETTINGS_AT_ONCE, Guide, Node, single_nodes
from tissuq.inference.enumerators.outer import Outer
from tissuq.inference.enumerators.outer_search import weighted_nodes
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.linear import LinearPriors
from tissuq.inference.marginal import Marginal, marginal_of_logs, marginal_of_points, marginal_of_table
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Marginals, Representation, Solution, shares_of_members
from tissuq.inference.truncated_mixture import TruncatedMixture
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Prior

MAX_PRIOR_MASS_ERROR = 0.01
"""Error of the mass of an amplitude's prior, summed on every second point, up to which the lattice serves it."""
TOUCHED_MASS = 1e-10
"""Mass outside the bounds from which it is taken off a component's weight."""
MAX_COMPONENTS = 3000
"""Components, at most, that represent the posterior in draws and predictions."""
MAX_MARGINAL_POINTS = 100_000
"""Points, at most, from which marginals of linear parameters are computed."""
MARGINAL_DIVISOR = 15
"""So many times fewer components are taken for the marginals within several bounds."""
MARGINAL_POINTS, MARGINAL_NOISES = 1000, 400
"""Points, and values of the noise for each, from which the marginal of the noise is computed."""
PULLED_DIVISOR = 5
"""So many times fewer, where priors of linear parameters depend on the noise, too."""
OUTER_BOUNDED_DIVISOR = 4
"""So many times fewer masses within bounds are computed where the sum over other parameters has a larger error."""
MAX_CHEAP_BOUNDS = 2
"""Linear parameters up to which the masses within bounds cost little."""
TAILS_POWER = 0.25
"""Power of the weights by which components are taken that must represent the tails, too."""


@dataclass(frozen=True)
class AmplitudeLattice:
    """Lattices of the amplitudes of an energy discrepancy, at importance points of parameters beside them.

    Parameters
    ----------
    components : int
        Components, at most, that represent a posterior in draws and predictions.
    guide : Guide
        Where amplitudes lie, and parameters that no lattice sums over; kept from one model to the next, which must be
        similar.
    """

    components: int = MAX_COMPONENTS
    guide: Guide = field(default_factory=Guide)

    def why_not(self, model: StatisticalModel) -> str:
        """Return why an energy discrepancy cannot be integrated with the rest of a model; nothing where it can."""
        for symbol in model.energy_symbols:
            if _lattice_error(model.priors[symbol]) > MAX_PRIOR_MASS_ERROR:
                return (
                    f"the prior {model.priors[symbol]} of {symbol} has a bound or is narrow, where a wide positive one "
                    "is"
                )
        return "" if model.energy_symbols else f"discrepancy '{model.discrepancy.name}' is no energy"

    def solve(self, models: Sequence[StatisticalModel], seed: int = 0) -> list[Solution]:
        """Return posterior and evidence of models with an energy discrepancy, on the same stretches.

        Parameters
        ----------
        models : sequence of StatisticalModel
            With the same material, discrepancy and noise on the same stretches: they share every decomposition, unless
            parameters are left that no lattice sums over.
        seed : int
            Of the draws; nothing else is random.

        Raises
        ------
        ModelError
            When the model has parameters that this route does not integrate.
        ConvergenceError
            When it is not found where the parameters lie that no lattice sums over.
        """
        reason = self.why_not(models[0])
        if reason:
            raise ModelError(
                f"discrepancy '{models[0].discrepancy.name}' needs wide positive priors on its amplitudes. Here "
                f"{reason}: choose otherwise, or another discrepancy."
            )
        bounded_points = self.guide.accuracy.bounded_points
        if Outer(models[0]).symbols:
            few = bounded_points // OUTER_BOUNDED_DIVISOR
            sums = (_EnergySums(model, *weighted_nodes(model, self.guide), few) for model in models)
            return [energy_sums.solution(self.components, seed) for energy_sums in sums]
        nodes = single_nodes(models, self.guide)
        sums = (
            _EnergySums(model, [node], np.zeros(1), 0.0, bounded_points)
            for model, node in zip(models, nodes, strict=True)
        )
        return [energy_sums.solution(self.components, seed) for energy_sums in sums]


def _lattice_error(prior: Prior) -> float:
    """Return by how much the mass of a prior is wrong on every second point of the lattice, wherever this begins."""
    if prior.support != (0.0, np.inf):
        return np.inf
    middle = np.log(prior.quantile(0.5))
    starts = middle + 2 * LOG_RATIO_STEP * np.arange(8)[:, None] / 8
    amplitudes = np.exp(starts + 2 * LOG_RATIO_STEP * np.arange(-60, 61))
    masses = (2 * LOG_RATIO_STEP * amplitudes * np.exp(prior.log_density(amplitudes))).sum(axis=1)
    return float(np.abs(masses - 1).max())


class _EnergySums:
    """The posterior of one data set under an energy discrepancy.

    Parameters
    ----------
    model : StatisticalModel
    nodes : sequence of Node
        At weighted values of the outer parameters.
    log_weights : (K,) array
        Of the nodes: priors of the outer parameters over the density of the values taken.
    error : float
        Relative error of the nodes' sum.
    bounded_points : int
        Points, at most, of which masses are computed within bounds of more parameters than two.
    """

    def __init__(
        self,
        model: StatisticalModel,
        nodes: Sequence[Node],
        log_weights: FloatArray,
        error: float,
        bounded_points: int,
    ) -> None:
        self.model, self._nodes = model, nodes
        self._outer = Outer(model)
        self._step = LOG_RATIO_STEP if len(nodes) == 1 else OUTER_STEP
        points = Points.joined([node.points for node in nodes])
        self._node = np.repeat(np.arange(len(nodes)), [len(node.points.lattice) for node in nodes])
        self._bare = tuple(np.concatenate([getattr(node, name) for node in nodes]) for name in ("mean", "root"))
        self._priors = LinearPriors(model)
        self._box = self._priors.box
        mean, root, _ = self._priors.times(self._bare[0], self._bare[1] * points.noise_sd[:, None, None])
        log_weight = points.log_weight + log_weights[self._node]
        is_near = self._box.beyond(mean, root).sum(axis=1) > TOUCHED_MASS
        if mean.shape[1] > MAX_CHEAP_BOUNDS and is_near.sum() > bounded_points:
            at_most = log_weight + points.log_inside
            total = np.logaddexp.reduce(at_most)
            rows = systematic(np.exp(at_most - total)[None], bounded_points)[0]
            points, self._node, self._bare = points[rows], self._node[rows], (self._bare[0][rows], self._bare[1][rows])
            mean, root, is_near = mean[rows], root[rows], is_near[rows]
            log_weight = total - np.log(bounded_points) - points.log_inside
        near = np.flatnonzero(is_near)
        log_mass, error_of_mass = np.zeros(len(mean)), np.zeros(len(mean))
        boxes = self._box.repeated(len(near))
        log_mass[near], error_of_mass[near] = boxes.log_mass(mean[near], root[near])
        masses = log_weight + log_mass
        top = masses.max()
        total = np.exp(masses - top).sum()
        self._points, self._weights = points, np.exp(masses - top) / total
        self._shares = np.bincount(self._node, self._weights, minlength=len(nodes))
        settings = self._settings(points, self._node)
        gaussians = GaussianMixture(self._weights, settings, mean, root).resampled(MAX_MARGINAL_POINTS)
        self._truncated = TruncatedMixture(gaussians, self._box)
        self._evidence: tuple[float, float] | tuple[None, None] = None, None
        if not model.is_improper:
            evidence = float(top + np.log(total) + self._priors.log_height + model.log_whitening)
            # Nodes far from the posterior may end within large amplitudes: what is unknown there does not matter.
            matters = self._shares > NEGLIGIBLE_SHARE
            of_nodes = np.linalg.norm(self._shares[matters] * np.array([node.error for node in nodes])[matters])
            self._evidence = evidence, float(error + of_nodes + self._weights @ error_of_mass + NEGLIGIBLE_SHARE)

    def solution(self, components: int, seed: int) -> Solution:
        """Return the posterior; in its mixture the weights of the discrepancy follow the material's parameters."""
        log_evidence, error = self._evidence
        return Solution(
            self.model,
            "exact",
            self._reason(),
            Representation(*(partial(self._represented, power, components) for power in (1.0, TAILS_POWER))),
            Marginals.of(self.model, partial(self._marginal, max(1, components // MARGINAL_DIVISOR))),
            seed,
            log_evidence=log_evidence,
            log_evidence_error=error,
            members=shares_of_members(self.model, self._points.lattice, self._weights),
        )

    def _reason(self) -> str:
        """Return what was done."""
        model, outer = self.model, self._outer.symbols
        inner = ", ".join(symbol for symbol in model.nonlinear if symbol not in outer)
        done = (
            f"{', '.join(model.linear)} and the discrepancy's weights integrated in closed form; sums over "
            f"{len(model.energy_members)} energies and lattices of {inner}"
        )
        effective = 1 / (self._shares @ self._shares)
        return done + (
            f", and over {len(self._nodes)} values of {', '.join(outer)} ({effective:.0f} effective)" if outer else ""
        )

    def _represented(self, power: float, count: int, few: int | None) -> GaussianMixture:
        """Return so many components that stand for all points, taken as often as a power of their weights says.

        Or the ``few`` that stand for these, the others of which need not be computed.
        """
        points, node, weights = self._points, self._node, self._weights
        if len(weights) > count:
            order = np.lexsort((points.noise_sd, points.first_index, points.second_index, points.lattice, node))
            # In this order neighbours are alike.
            representatives = order[systematic((weights**power)[order][None], count)[0]]
            points, node, weights = (
                points[representatives],
                node[representatives],
                weights[representatives] ** (1 - power),
            )
            weights = weights / weights.sum()
        if few is not None and len(weights) > few:
            representatives = systematic(weights[None], few)[0]
            points, node = points[representatives], node[representatives]
            weights = np.full(few, weights.sum() / few)
        features = {int(member): self.model.energy_features(member) for member in np.unique(points.lattice)}
        width = len(self.model.linear) + max(sum(f.shape[1] for f in blocks) for blocks in features.values())
        mean, root = np.zeros((len(weights), width)), np.zeros((len(weights), width, width))
        numbers, designs = np.unique(node, return_inverse=True)
        outer = np.array([self._nodes[number].outer for number in numbers])
        for alike in self._outer.alike(outer, SETTINGS_AT_ONCE):
            rows, is_alike = self._outer.rows(outer[alike]), np.isin(designs, alike)
            for member in np.unique(points.lattice[is_alike]):
                of_member = np.flatnonzero(is_alike & (points.lattice == member))
                amplitudes = points.amplitudes[of_member][:, list(self.model.energy_members[member].amplitude_indices)]
                linear_mean, linear_root = Reduced(rows, features[member]).linear_and_weights(
                    designs[of_member] - alike[0], amplitudes, points.noise_sd[of_member]
                )
                linear_mean, linear_root, _ = self._priors.times(linear_mean, linear_root)
                q = linear_mean.shape[1]
                mean[of_member, :q], root[of_member, :q, :q] = linear_mean, linear_root
        mixture = GaussianMixture(weights, self._settings(points, node), mean, root, points.lattice)
        free = np.full((1, width - len(self.model.linear)), np.inf)
        box = Boxes(np.hstack([self._box.lower, -free]), np.hstack([self._box.upper, free]))
        return TruncatedMixture(mixture, box).components(few)

    def _marginal(self, components: int, symbol: str) -> Marginal:
        if symbol in self.model.linear:
            return self._truncated.marginal(self.model.linear.index(symbol), components)
        if symbol == "noise_sd":
            return self._noise_marginal()
        values = self._settings(self._points, self._node)[:, self.model.nonlinear.index(symbol)]
        if symbol in self.model.energy_symbols:
            return marginal_of_logs(values, self._weights, self._step)
        if symbol not in self._nodes[0].ratios:  # one value at each node
            first_of_node = np.flatnonzero(np.diff(self._node, prepend=-1))
            shares = np.add.reduceat(self._weights, first_of_node)
            if self._nodes[0].place is not None:
                nodes = [self._nodes[number] for number in self._node[first_of_node]]
                places, widths = np.array([(node.place, node.width) for node in nodes]).T
                return self._outer.marginal(places, widths, shares)
            return marginal_of_points(values[first_of_node], shares, self.model.priors[symbol].support)
        return marginal_of_points(values, self._weights, self.model.priors[symbol].support)

    def _noise_marginal(self) -> Marginal:
        """Return the marginal of the noise from its densities given the rest, at some of the points."""
        is_pulled = self._truncated.is_cut or self._priors.is_gaussian
        order = np.argsort(self._points.misfit, kind="stable")  # in which neighbours tell nearly the same noise
        count = MARGINAL_POINTS // (PULLED_DIVISOR if is_pulled else 1)
        representatives = order[systematic(self._weights[order][None], count)[0]]
        points, freedom = self._points[representatives], self.model.experiment.size - len(self.model.linear)
        logs = np.log(noise_grid(self.model, points, freedom, MARGINAL_NOISES // (2 if is_pulled else 1)))
        noise_sd, step = np.exp(logs), logs[1] - logs[0]
        log_density = -freedom * logs - 0.5 * points.misfit[:, None] / noise_sd**2
        for number in np.unique(self._node[representatives]):
            is_concerned = self._node[representatives] == number
            log_density[is_concerned] += log_prior_of_noise(self.model, self._nodes[number].ratios, noise_sd)
        for index, symbol in enumerate(self.model.energy_symbols):
            is_concerned = points.amplitudes[:, index] > 0
            ratios = points.amplitudes[is_concerned, index] / points.noise_sd[is_concerned]
            log_density[is_concerned] += log_prior_of_log(self.model.priors[symbol], ratios[:, None] * noise_sd)
        if is_pulled:
            mean, root = (np.repeat(bare[representatives], len(noise_sd), axis=0) for bare in self._bare)
            root = root * np.tile(noise_sd, len(representatives))[:, None, None]
            log_density += self._priors.log_mass(mean, root).reshape(log_density.shape)
        density = np.exp(log_density - log_density.max(axis=1, keepdims=True))
        density /= density.sum(axis=1, keepdims=True) * step
        return marginal_of_table(noise_sd, density.mean(axis=0) / noise_sd)

    def _settings(self, points: Points, node: IndexArray) -> FloatArray:
        """Return the nonlinear parameters (M, d)."""
        columns = dict(zip(self.model.energy_symbols, points.amplitudes.T, strict=True)) | {"noise_sd": points.noise_sd}
        for index, symbol in enumerate(self._outer.symbols):
            values = np.array([one_node.outer[index] for one_node in self._nodes])[node]
            columns[symbol] = values * (points.noise_sd if symbol in self._nodes[0].ratios else 1.0)
        return np.column_stack([columns[symbol] for symbol in self.model.nonlinear])
