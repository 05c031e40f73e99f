"""The posterior under an energy discrepancy: exact sums over its members and lattices of their amplitudes.

Given a member and the ratios g = c / noise_sd of its amplitudes, everything is linear and Gaussian
(`tissuq.inference.lattice`). The integrand is smooth in log g and log noise_sd, so that equally spaced points integrate
it with an error that falls exponentially with their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.inference.bounds import bounded
from tissuq.inference.box import Boxes
from tissuq.inference.lattice import STEP, Lattice
from tissuq.inference.marginal import Marginal, marginal_of_logs
from tissuq.inference.resampling import systematic
from tissuq.inference.solution import Components, Solution
from tissuq.inference.threads import one_thread
from tissuq.model import StatisticalModel
from tissuq.priors import Flat, Prior

__all__ = ["EnergySolution", "solve_energies", "why_no_energies"]

FloatArray = NDArray[np.float64]
Places = NDArray[np.intp]

NOISE_STEP, NOISE_BELOW, NOISE_ABOVE = 1.0, 5.0, 20.0
"""Of the lattice of log noise_sd: in standard deviations from its conditional mode, which are 1 / sqrt(2 freedom), the
distance of its points, and its reach below; above, further by a multiple of 1 / sqrt(freedom), for its heavy tail."""
SMALLER = STEP / (1 - np.exp(-STEP))
"""Width of the first point's cell: of all points below it, weighted by their amplitudes."""
IRRELEVANT = 18.0
"""Log density below the largest, at the best noise, at which a point of the lattice is left out at once."""
CUT_NODES = 24
"""Values of the noise where its prior cuts or is narrow."""
LIKELY, POSSIBLE = np.array([1e-3, 1 - 1e-3]), np.array([1e-12, 1 - 1e-12])
"""Probabilities of the noise's prior between which it is likely, and between which it is at all."""
TINY = 1e-200
NOISE_RATIOS, FINE = 1000, 0.15
"""Ratios of the amplitudes, and spacing, from which the marginal of the noise is computed."""
LIGHT = 1e-7
"""Share of the posterior that may be left out."""
MOST_PRIOR_ERROR = 0.01
TOUCHED = 1e-10
"""Mass outside the bounds from which it is taken off a component's weight."""
REPRESENTED = 3000
"""Components, at most, that represent the posterior in draws and predictions."""
TAILS = 0.25
"""Power of the weights by which components are taken that must represent the tails, too."""


def why_no_energies(model: StatisticalModel) -> str:
    """Return why an energy discrepancy cannot be integrated with the rest of a model, or nothing where it can."""
    if model.bent_symbols:
        return f"the material's stress is not linear in {', '.join(model.bent_symbols)}"
    others = [symbol for symbol in model.nonlinear if symbol not in (*model.energy_symbols, "noise_sd")]
    if others or model.noise.depends_on_level or model.noise.shares_discrepancy:
        return f"noise '{model.noise.name}' or a prior leaves more than amplitudes and noise_sd to integrate"
    for symbol in model.energy_symbols:
        if _lattice_error(model.priors[symbol]) > MOST_PRIOR_ERROR:
            return (
                f"the prior {model.priors[symbol]} of {symbol} has a bound or is narrow, where a wide positive one is"
            )
    gaussians = (model.priors[symbol].gaussian for symbol in model.linear)
    if any(each is not None and each[1] for each in gaussians):
        return "a linear parameter has a Gaussian prior, where only uniform and flat ones are integrated"
    return ""


def _lattice_error(prior: Prior) -> float:
    """Return by how much the mass of a prior is wrong on every second point of the lattice, wherever this begins."""
    if prior.support != (0.0, np.inf):
        return np.inf
    middle = np.log(prior.quantile(0.5))
    starts = middle + 2 * STEP * np.arange(8)[:, None] / 8
    amplitudes = np.exp(starts + 2 * STEP * np.arange(-60, 61))
    masses = (2 * STEP * amplitudes * np.exp(prior.log_density(amplitudes))).sum(axis=1)
    return float(np.abs(masses - 1).max())


def solve_energies(models: Sequence[StatisticalModel], seed: int = 0) -> list[EnergySolution]:
    """Return posterior and evidence of models with an energy discrepancy, on the same stretches.

    Parameters
    ----------
    models : sequence of StatisticalModel
        With the same material, discrepancy and noise on the same stretches: they share every decomposition.
    seed : int
        Of the draws; nothing else is random.

    Raises
    ------
    ModelError
        When the model has parameters that this route does not integrate.
    """
    reason = why_no_energies(models[0])
    if reason:
        raise ModelError(
            f"discrepancy '{models[0].discrepancy.name}' needs a material that is linear in its parameters, uniform or "
            "flat priors on them, and noise that is known, or unknown but the same everywhere. Here "
            f"{reason}: choose otherwise, or another discrepancy."
        )
    with one_thread():
        lattices = [Lattice(models, member) for member in models[0].energy_members]
        return [EnergySolution(model, lattices, index, seed) for index, model in enumerate(models)]


@dataclass(frozen=True, eq=False)
class _Points:
    """M points of the lattices: which lattice, where in it, what noise, both amplitudes, log p(data and point)."""

    lattice: Places
    second: Places
    first: Places
    noise_sd: FloatArray
    amplitudes: FloatArray
    log_weight: FloatArray

    def __getitem__(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> _Points:
        return _Points(*(array[chosen] for array in vars(self).values()))

    @classmethod
    def joined(cls, parts: Sequence[_Points]) -> _Points:
        """Return all points of several sets."""
        return cls(*(np.concatenate(arrays) for arrays in zip(*(vars(part).values() for part in parts), strict=True)))


class EnergySolution(Solution):
    """The posterior of one data set under an energy discrepancy."""

    route = "exact"

    def __init__(self, model: StatisticalModel, lattices: Sequence[Lattice], index: int, seed: int) -> None:
        self.model, self._lattices, self._index, self._seed = model, lattices, index, seed
        points, error = self._weigh()
        mean, root = self._linear(points)
        supports = np.array([model.priors[symbol].support for symbol in model.linear])
        self._box = Boxes(supports[None, :, 0], supports[None, :, 1])
        beyond = self._box.beyond(mean, root)
        near = np.flatnonzero(beyond.sum(axis=1) > TOUCHED)
        log_mass, error_of_mass = np.zeros(len(mean)), np.zeros(len(mean))
        every = self._box.repeated(len(near))
        log_mass[near], error_of_mass[near] = every.log_mass(mean[near], root[near])
        log_weights = points.log_weight + log_mass
        top = log_weights.max()
        total = np.exp(log_weights - top).sum()
        self._points, self._weights = points, np.exp(log_weights - top) / total
        self._bounded = bounded(Components(self._weights, self._settings(points), mean, root), beyond, self._box)
        if not any(isinstance(prior, Flat) for prior in model.priors.values()):
            self.log_evidence = float(top + np.log(total) - np.log(np.diff(supports, axis=1)).sum())
            self.log_evidence_error = float(error + self._weights @ error_of_mass + LIGHT)

    @property
    def reason(self) -> str:  # type: ignore[override]  # computed, where others store it
        """What was done."""
        model = self.model
        return (
            f"{', '.join(model.linear)} and the discrepancy's weights integrated in closed form; sums over "
            f"{len(self._lattices)} energies and lattices of {', '.join(model.nonlinear)}"
        )

    @cached_property
    def members(self) -> dict[str, float]:  # type: ignore[override]  # a cached property
        """The posterior probability of every sum of blocks, its length scales together."""
        found: dict[str, float] = {}
        shares = np.bincount(self._points.lattice, self._weights, minlength=len(self._lattices))
        for lattice, share in zip(self._lattices, shares, strict=True):
            found[lattice.member.name] = found.get(lattice.member.name, 0.0) + float(share)
        return found

    @cached_property
    def components(self) -> Components:  # type: ignore[override]  # a cached property
        """The posterior as a mixture; after the material's parameters come the weights of the discrepancy."""
        return self._represented(1.0)

    @cached_property
    def wide_components(self) -> Components:
        """The same, with more components in the tails, where the posterior of fewer data may lie."""
        return self._represented(TAILS)

    def _represented(self, power: float) -> Components:
        """Return components that stand for all points, taken as often as a power of their weights says."""
        points, weights = self._points, self._weights
        if len(weights) > REPRESENTED:
            order = np.lexsort((points.noise_sd, points.first, points.second, points.lattice))  # neighbours are alike
            chosen = order[systematic((weights**power)[order][None], REPRESENTED)[0]]
            points, weights = points[chosen], weights[chosen] ** (1 - power)
            weights = weights / weights.sum()
        width = len(self.model.linear) + max(sum(f.shape[1] for f in each.features) for each in self._lattices)
        mean, root = np.zeros((len(weights), width)), np.zeros((len(weights), width, width))
        for place in np.unique(points.lattice):
            lattice, own = self._lattices[place], np.flatnonzero(points.lattice == place)
            amplitudes = points.amplitudes[own][:, list(lattice.member.places)]
            found, found_root = lattice.everything(self._index, amplitudes, points.noise_sd[own])
            q = found.shape[1]
            mean[own, :q], root[own, :q, :q] = found, found_root
        whole = Components(weights, self._settings(points), mean, root, points.lattice)
        free = np.full((1, width - len(self.model.linear)), np.inf)
        box = Boxes(np.hstack([self._box.lower, -free]), np.hstack([self._box.upper, free]))
        return bounded(whole, box.beyond(mean, root), box).components()

    @cached_property
    def draws(self) -> dict[str, FloatArray]:
        """Independent draws of every parameter."""
        chosen, linear = self._drawn
        columns = np.moveaxis(np.concatenate([self.components.settings[chosen], linear], axis=2), 2, 0)
        named = dict(zip((*self.model.nonlinear, *self.model.linear), columns, strict=False))  # then the weights
        return {symbol: named[symbol] for symbol in self.model.symbols}

    @cached_property
    def drawn_discrepancy(self) -> FloatArray:  # type: ignore[override]  # a cached property
        """The discrepancy's stress (chains, draws, n) at the measurements in every draw."""
        chosen, linear = self._drawn
        assert self.components.member is not None  # noqa: S101 (this solution's components have one)
        member, start = self.components.member[chosen], len(self.model.linear)
        values = np.zeros((*chosen.shape, len(self.model.experiment)))
        for place in np.unique(member):
            features = np.hstack([np.zeros((values.shape[2], 0)), *self._lattices[place].features])
            own = member == place
            values[own] = linear[own][:, start : start + features.shape[1]] @ features.T
        return values

    @cached_property
    def _drawn(self) -> tuple[Places, FloatArray]:
        """The component of every draw, and its linear parameters and weights."""
        return self.components.drawn(self._seed)

    @property
    def component_of_draw(self) -> Places:
        """The component of every draw."""
        return self._drawn[0]

    def _marginal(self, symbol: str) -> Marginal:
        if symbol in self.model.linear:
            return self._bounded.marginal(self.model.linear.index(symbol))
        if symbol not in self.model.energy_symbols:
            return self._noise_marginal()
        values = self._settings(self._points)[:, self.model.nonlinear.index(symbol)]
        return marginal_of_logs(values, self._weights, STEP)

    def _noise_marginal(self) -> Marginal:
        """Return the marginal of the noise from a finer lattice of it, for some of the ratios."""
        points, side = self._points, 1 + max(max(map(len, lattice.ratios)) for lattice in self._lattices)
        keys, group = np.unique((points.lattice * side + points.second) * side + points.first, return_inverse=True)
        shares_of_keys = np.asarray(np.bincount(group, self._weights), dtype=np.float64)
        chosen = keys[systematic(shares_of_keys[None], NOISE_RATIOS)[0]]
        values, shares = [], []
        for place in np.unique(chosen // side**2):
            own, width = chosen[chosen // side**2 == place], len(self._lattices[place].ratios[0])
            fine = self._all_noise(self._best_noise(int(place))[own // side % side * width + own % side], FINE)
            row = np.repeat(np.arange(len(own)), len(fine.noise_sd) // len(own))
            weight = np.exp(fine.log_weight - fine.log_weight.max())
            values.append(fine.noise_sd)
            shares.append(weight / np.bincount(row, weight)[row])
        return marginal_of_logs(np.concatenate(values), np.concatenate(shares), 0.0)

    def _settings(self, points: _Points) -> FloatArray:
        """Return the nonlinear parameters (M, d)."""
        columns = dict(zip(self.model.energy_symbols, points.amplitudes.T, strict=True)) | {"noise_sd": points.noise_sd}
        return np.column_stack([columns[symbol] for symbol in self.model.nonlinear])

    def _linear(self, points: _Points) -> tuple[FloatArray, FloatArray]:
        """Return means (M, p) and roots (M, p, p) of the linear parameters, before their bounds."""
        p = len(self.model.linear)
        mean, root = np.empty((len(points.lattice), p)), np.empty((len(points.lattice), p, p))
        for place in np.unique(points.lattice):
            own = np.flatnonzero(points.lattice == place)
            # Points that differ in the noise alone have the same mean, and roots in proportion.
            size = len(self._lattices[place].ratios[0])
            pair, group = np.unique(points.second[own] * size + points.first[own], return_inverse=True)
            found, found_root = self._lattices[place].linear(self._index, pair // size, pair % size)
            mean[own], root[own] = found[group], found_root[group] * points.noise_sd[own, None, None]
        return mean, root

    def _weigh(self) -> tuple[_Points, float]:
        """Return the points that matter, and the error of their sum: from that of every second point."""
        known = not self.model.noise.parameters
        every = [self._best_noise(place) for place in range(len(self._lattices))]
        top = max(float(points.log_weight.max()) for points in every)
        every = [points[points.log_weight > top - IRRELEVANT] for points in every]
        if not known:
            every = [self._all_noise(each, NOISE_STEP) for each in every if len(each.lattice)]
        points = _Points.joined(every)
        mass = np.exp(points.log_weight - points.log_weight.max())
        coarse = 0.0
        for place, lattice in enumerate(self._lattices):
            own = points.lattice == place
            for grid, places in zip(lattice.ratios, (points.first, points.second), strict=True):
                own = own & ((places % 2 == 0) | (len(grid) == 1))
            coarse += 2 ** sum(len(grid) > 1 for grid in lattice.ratios) * mass[own].sum()
        order = np.argsort(mass)
        heavy = order[np.cumsum(mass[order]) > LIGHT * mass.sum()]
        return points[heavy], float(abs(coarse / mass.sum() - 1) ** 1.5)

    def _best_noise(self, place: int) -> _Points:
        """Return all points of a lattice at the known noise, or at the noise that each thinks best."""
        lattice, noise = self._lattices[place], self.model.noise
        second, first = np.indices(lattice.misfit.shape[:2]).reshape(2, -1)
        if not noise.parameters:
            return self._weighed(place, second, first, np.full(len(second), float(noise.sd({}, 0.0))))
        low, high = self.model.priors["noise_sd"].quantile(LIKELY)
        return self._weighed(place, second, first, np.clip(self._noise_modes(place, second, first), low, high))

    def _noise_modes(self, place: int, second: Places, first: Places) -> FloatArray:
        lattice = self._lattices[place]
        return np.asarray(np.sqrt(lattice.misfit[second, first, self._index] / lattice.freedom))

    def _all_noise(self, points: _Points, spacing: float) -> _Points:
        """Return the points of a lattice with several values of the noise for each, row by row.

        They are evenly spaced in its logarithm where likelihood and prior are wide; where the prior cuts the likelihood
        or is narrower, they are those of a Gauss-Legendre rule on what it leaves.
        """
        place = int(points.lattice[0])
        prior, freedom = self.model.priors["noise_sd"], self._lattices[place].freedom
        ends = np.log(np.maximum(prior.quantile(POSSIBLE), TINY))
        unit = 1 / np.sqrt(2 * freedom)
        mode = np.log(np.maximum(self._noise_modes(place, points.second, points.first), TINY))
        low, high = mode - NOISE_BELOW * unit, mode + (NOISE_BELOW + NOISE_ABOVE / np.sqrt(freedom)) * unit
        is_cut = bool(((low < ends[0]) | (high > ends[1])).any())
        if is_cut:
            cut = np.maximum(low, ends[0]), np.minimum(high, ends[1])
            keeps = (cut[0] < cut[1]) & (high - low < ends[1] - ends[0])
            low, high = (np.where(keeps, own, end) for own, end in zip(cut, ends, strict=True))
            nodes, weights = np.polynomial.legendre.leggauss(int(CUT_NODES / spacing))
            nodes, weights = 0.5 * (1 + nodes), 0.5 * weights
        else:
            nodes = np.linspace(0, 1, int((high[0] - low[0]) / (spacing * unit)) + 1)
            weights = np.full(len(nodes), nodes[1])
        width = (high - low)[:, None]
        noise_sd = np.exp(low[:, None] + width * nodes).ravel()
        second, first = (np.repeat(each, len(nodes)) for each in (points.second, points.first))
        found = self._weighed(place, second, first, noise_sd)
        log_cell = prior.log_density(noise_sd) + np.log(noise_sd * (width * weights).ravel())
        return replace(found, log_weight=found.log_weight + log_cell)

    def _weighed(self, place: int, second: Places, first: Places, noise_sd: FloatArray) -> _Points:
        """Return points of a lattice with their weights: likelihood and prior of member and amplitudes."""
        lattice, symbols = self._lattices[place], self.model.energy_symbols
        amplitudes = np.zeros((len(first), len(symbols)))
        log_weight = lattice.log_likelihood(self._index, second, first, noise_sd) + np.log(lattice.member.probability)
        chosen = ((lattice.ratios[0], first), (lattice.ratios[1], second))
        for which, (grid, place_on_grid) in zip(lattice.member.places, chosen, strict=False):
            amplitudes[:, which] = grid[place_on_grid] * noise_sd
            prior = self.model.priors[symbols[which]]
            # The first point stands for all smaller amplitudes, too, among which the density is constant.
            cell = np.where(place_on_grid == 0, SMALLER, STEP)
            log_weight += prior.log_density(amplitudes[:, which]) + np.log(cell * amplitudes[:, which])
        return _Points(np.full(len(first), place), second, first, noise_sd, amplitudes, log_weight)
