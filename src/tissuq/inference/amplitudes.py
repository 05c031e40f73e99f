"""Sums over the amplitudes of energy discrepancies and over the noise: points of lattices, and what they weigh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.lattice import Lattice, times_gaussians
from tissuq.model import StatisticalModel
from tissuq.priors import Prior

__all__ = ["LIGHT", "Points", "Weighing", "log_prior_of_amplitude", "log_prior_of_noise", "noise_grid"]

FloatArray = NDArray[np.float64]
Places = NDArray[np.intp]

NOISE_NODES, NOISE_BELOW, NOISE_ABOVE = 6, 5.0, 20.0
"""Of the noise given the rest: values, and the reach of its logarithm around its mode, in standard deviations
1 / sqrt(2 freedom); above, further by a multiple of 1 / sqrt(freedom), for its heavy tail."""
CUT_NODES = 24
"""Values of the noise where its prior cuts or is narrow."""
IRRELEVANT = 18.0
"""Log density below the largest, at the best noise, at which a point of a lattice is left out at once."""
LIGHT = 1e-6
"""Share of the posterior that may be left out."""
LIKELY, POSSIBLE = np.array([1e-3, 1 - 1e-3]), np.array([1e-12, 1 - 1e-12])
"""Probabilities of the noise's prior between which it is likely, and between which it is at all."""
TINY = 1e-200


@dataclass(frozen=True, eq=False)
class Points:
    """M points of lattices: which lattice, where in it, what noise, both amplitudes, log p(data and point).

    ``misfit`` and ``freedom`` tell how likely any other noise would be at the same ratios.
    """

    lattice: Places
    second: Places
    first: Places
    noise_sd: FloatArray
    amplitudes: FloatArray
    log_weight: FloatArray
    misfit: FloatArray

    def __getitem__(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> Points:
        return Points(*(array[chosen] for array in vars(self).values()))

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """Return all points of several sets."""
        return cls(*(np.concatenate(arrays) for arrays in zip(*(vars(part).values() for part in parts), strict=True)))


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
    """

    def __init__(
        self,
        model: StatisticalModel,
        lattices: Sequence[Lattice],
        index: int,
        ratios: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._model, self._lattices, self._index, self._ratios = model, lattices, index, ratios

    def points(self) -> tuple[Points, float]:
        """Return the points that matter, and the relative error of their sum: from that of every second point."""
        every = [self._best_noise(place) for place in range(len(self._lattices))]
        top = max(float(points.log_weight.max()) for points in every)
        every = [points[points.log_weight > top - IRRELEVANT] for points in every]
        least = _least_that_matters(np.concatenate([np.exp(points.log_weight - top) for points in every]))
        every = [points[np.exp(points.log_weight - top) >= least] for points in every]
        if self._model.noise.parameters:
            every = [self._all_noise(each) for each in every if len(each.lattice)]
        points = Points.joined(every)
        mass = np.exp(points.log_weight - points.log_weight.max())
        coarse = 0.0
        for place, lattice in enumerate(self._lattices):
            own = points.lattice == place
            for grid, places in zip(lattice.ratios, (points.first, points.second), strict=True):
                own = own & ((places % 2 == 0) | (len(grid) == 1))
            coarse += 2 ** sum(len(grid) > 1 for grid in lattice.ratios) * mass[own].sum()
        return points[mass >= _least_that_matters(mass)], float(abs(coarse / mass.sum() - 1) ** 1.5)

    def _best_noise(self, place: int) -> Points:
        """Return all points of a lattice at the known noise, or at the noise that each thinks best."""
        lattice, noise = self._lattices[place], self._model.noise
        second, first = np.indices(lattice.misfit.shape[:2]).reshape(2, -1)
        misfit = lattice.misfit[second, first, self._index]
        if not noise.parameters:
            return self._weighed(place, second, first, misfit, np.full(len(second), float(noise.sd({}, 0.0))))
        likely = np.clip(self._model.priors["noise_sd"].quantile(LIKELY), *np.exp(_ends(self._model, self._ratios)))
        return self._weighed(place, second, first, misfit, np.clip(np.sqrt(misfit / lattice.freedom), *likely))

    def _all_noise(self, points: Points) -> Points:
        """Return the points of a lattice with several values of the noise for each, row by row.

        They are those of a Gauss rule for the likelihood's own shape; where the prior cuts that or is narrower,
        those of a Gauss-Legendre rule on what it leaves.
        """
        place = int(points.lattice[0])
        freedom, ends = self._lattices[place].freedom, _ends(self._model, self._ratios)
        mode = 0.5 * np.log(np.maximum(points.misfit / freedom, TINY))[:, None]
        below, above = _reach(freedom)
        low, high = mode - below, mode + above
        if (low >= ends[0]).all() and (high <= ends[1]).all():
            nodes, cells = _noise_rule(freedom)
            logs = mode + nodes
        else:
            cut = np.maximum(low, ends[0]), np.minimum(high, ends[1])
            keeps = (cut[0] < cut[1]) & (high - low < ends[1] - ends[0])
            low, high = (np.where(keeps, own, end) for own, end in zip(cut, ends, strict=True))
            nodes, cells = np.polynomial.legendre.leggauss(CUT_NODES)
            logs, cells = low + (high - low) * 0.5 * (1 + nodes), (high - low) * 0.5 * cells
        noise_sd = np.exp(logs).ravel()
        rows = np.repeat(np.arange(len(points.misfit)), len(nodes))
        found = self._weighed(place, points.second[rows], points.first[rows], points.misfit[rows], noise_sd)
        log_cell = log_prior_of_noise(self._model, self._ratios, noise_sd) + np.log(
            np.broadcast_to(cells, logs.shape).ravel()
        )
        return replace(found, log_weight=found.log_weight + log_cell)

    def _weighed(self, place: int, second: Places, first: Places, misfit: FloatArray, noise_sd: FloatArray) -> Points:
        """Return points of a lattice with their weights: likelihood and prior of member and amplitudes."""
        lattice, symbols = self._lattices[place], self._model.energy_symbols
        amplitudes = np.zeros((len(first), len(symbols)))
        log_weight = lattice.log_likelihood(self._index, second, first, noise_sd) + np.log(lattice.member.probability)
        priors = [self._model.priors[symbol] for symbol in self._model.linear]
        if any(prior.gaussian and prior.gaussian[1] for prior in priors):
            mean, root = lattice.linear(self._index, second, first)
            log_weight += times_gaussians(mean, root * noise_sd[:, None, None], priors)[2]
        chosen = ((lattice.ratios[0], first), (lattice.ratios[1], second))
        for which, (grid, place_on_grid) in zip(lattice.member.places, chosen, strict=False):
            amplitudes[:, which] = grid[place_on_grid] * noise_sd
            log_weight += log_prior_of_amplitude(self._model.priors[symbols[which]], amplitudes[:, which])
            # The first point stands for all smaller amplitudes, too, among which the density is constant.
            log_weight += np.log(np.where(place_on_grid == 0, lattice.step / -np.expm1(-lattice.step), lattice.step))
        return Points(np.full(len(first), place), second, first, noise_sd, amplitudes, log_weight, misfit)


def log_prior_of_amplitude(prior: Prior, amplitude: FloatArray) -> FloatArray:
    """Return the log prior density (M,) of the logarithms of amplitudes (M,)."""
    return np.asarray(prior.log_density(amplitude) + np.log(amplitude))


def log_prior_of_noise(model: StatisticalModel, ratios: Mapping[str, float], noise_sd: FloatArray) -> FloatArray:
    """Return the log prior density (M,) of log noise_sd, and of the noise's other parameters over it."""
    value = model.priors["noise_sd"].log_density(noise_sd) + np.log(noise_sd)
    for symbol, ratio in ratios.items():
        value = value + model.priors[symbol].log_density(ratio * noise_sd) + np.log(noise_sd)
    return np.asarray(value)


def noise_grid(model: StatisticalModel, points: Points, freedom: int, count: int) -> FloatArray:
    """Return values of the noise, evenly spaced in their logarithm, among which it lies given any of the points."""
    modes = 0.5 * np.log(np.maximum(points.misfit / freedom, TINY))
    below, above = _reach(freedom)
    low, high = np.clip([modes.min() - below, modes.max() + above], *_ends(model, {}))
    return np.exp(np.linspace(low, high, count))


def _ends(model: StatisticalModel, ratios: Mapping[str, float]) -> FloatArray:
    """Return the logarithms of the noise between which its priors leave it."""
    ends = np.maximum(model.priors["noise_sd"].quantile(POSSIBLE), TINY)
    for symbol, ratio in ratios.items():
        ends[1] = min(ends[1], model.priors[symbol].support[1] / ratio)
    return np.asarray(np.log(ends))


def _reach(freedom: int) -> tuple[float, float]:
    """Return how far log noise_sd reaches below its mode and above, given the ratios."""
    unit = 1 / np.sqrt(2 * freedom)
    return NOISE_BELOW * unit, (NOISE_BELOW + NOISE_ABOVE / np.sqrt(freedom)) * unit


def _least_that_matters(mass: FloatArray) -> float:
    """Return the mass below which points hold next to nothing together."""
    order = np.sort(mass)
    return float(order[np.searchsorted(np.cumsum(order), LIGHT * order.sum())])


@lru_cache(maxsize=64)
def _noise_rule(freedom: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes, as log noise_sd from its mode, and weights of the Gauss rule whose weight is the likelihood.

    Given the ratios it is noise_sd^-f exp(-misfit / (2 noise_sd^2)): the same shape about its mode whatever the misfit.
    It is divided out of the weights again. By the Stieltjes procedure and the Jacobi matrix (Golub & Welsch 1969).
    """
    below, above = _reach(freedom)
    grid, step = np.linspace(-below, above, 4001, retstep=True)
    share = np.exp(_log_shape(grid, freedom))
    diagonal, beside = np.zeros(NOISE_NODES), np.zeros(NOISE_NODES)
    before, now = np.zeros(len(grid)), np.full(len(grid), 1 / np.sqrt(share.sum()))
    for k in range(NOISE_NODES):
        diagonal[k] = (share * grid * now**2).sum()
        further = (grid - diagonal[k]) * now - beside[k - 1] * before
        beside[k] = np.sqrt((share * further**2).sum())
        before, now = now, further / beside[k]
    nodes, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1))
    return nodes, step * share.sum() * vectors[0] ** 2 * np.exp(-_log_shape(nodes, freedom))


def _log_shape(log_noise: FloatArray, freedom: int) -> FloatArray:
    return np.asarray(-freedom * (log_noise + 0.5 * np.expm1(-2 * log_noise)))
