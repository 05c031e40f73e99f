"""Draws of a posterior as complete hyperelastic materials, discrepancy included: what other programs can compute with.

Their energy is that of the material, of a discrepancy's further terms, and of a discrepancy that is an energy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal, get_args, overload

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.stability import calibrated_range, stable_draws
from tissuq.discrepancy.blocks import Coordinates
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, Path, loading_modes
from tissuq.inference.solution import Components, Solution
from tissuq.mechanics import Material, StretchMaterial, stress_basis
from tissuq.mechanics.complex_step import MOST_VALUES
from tissuq.mechanics.path import invariant_rates, invariants, log_stretches
from tissuq.mechanics.pieces import PiecewiseEnergy, pieces
from tissuq.model import StatisticalModel
from tissuq.prediction.moments import values_of

__all__ = ["EnergyDraw", "Ensemble", "Sampling", "drawn_ensemble"]

FloatArray = NDArray[np.float64]

Sampling = Literal["sobol", "latin", "random"]
"""How draws spread: a scrambled Sobol sequence, Latin hypercubes, or independently."""
KNOTS = 1001
"""Of a discrepancy's functions: 25 or more in the shortest length scale."""
MOST_TRIES = 64
"""Draws tried for each admissible one that is wanted."""


@dataclass(frozen=True, eq=False)
class EnergyDraw(StretchMaterial):
    """One draw of a posterior as a material without free parameters.

    Beyond the range of the data its discrepancy keeps the slopes dW/dI1, dW/dI2 and l dw/dl that it has at the end.

    Attributes
    ----------
    number : int
        Its place in the ensemble, from zero.
    parts : tuple of (Material, tuple of float)
        The material, and further terms of the discrepancy where it has some, with their parameters.
    discrepancy : PiecewiseEnergy or None
        The energy of a discrepancy that is one.
    """

    number: int
    parts: tuple[tuple[Material, tuple[float, ...]], ...]
    discrepancy: PiecewiseEnergy | None

    parameters = ()
    source = "tissuq"
    __eq__ = object.__eq__  # what is remembered of one draw is not true of another
    __hash__ = object.__hash__

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The material's name and the draw's number."""
        return f"{self.parts[0][0].name}, draw {self.number}"

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The formulas of the parts, joined."""
        return " + ".join(part.formula for part, _ in self.parts) + (" + discrepancy" if self.discrepancy else "")

    @property
    def values(self) -> dict[str, float]:
        """The parameters of the material by their symbols."""
        material, values = self.parts[0]
        return {parameter.symbol: value for parameter, value in zip(material.parameters, values, strict=True)}

    def energy(self, stretches: tuple[Any, Any, Any], values: Any = ()) -> Any:
        own = sum(part.energy(stretches, given) for part, given in self.parts)
        return own if self.discrepancy is None else own + self.discrepancy(stretches)


@dataclass(frozen=True, eq=False)
class Ensemble(Sequence[EnergyDraw]):
    """Equally probable draws of a posterior as complete materials.

    Attributes
    ----------
    draws : tuple of EnergyDraw
    model : StatisticalModel
        What was fitted.
    admissible_in : tuple of str
        Loading modes in which every draw is stable over the range in which both invariants were measured; empty where
        none was left out.
    tried : int
        Draws among which the admissible ones were found.
    ranges : mapping of str to (float, float)
        Stretches of each loading mode of one stretch between which both invariants were measured.
    """

    draws: tuple[EnergyDraw, ...]
    model: StatisticalModel
    admissible_in: tuple[str, ...]
    tried: int
    ranges: Mapping[str, tuple[float, float]]

    @overload
    def __getitem__(self, place: int) -> EnergyDraw: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[EnergyDraw]: ...
    def __getitem__(self, place: int | slice) -> EnergyDraw | Sequence[EnergyDraw]:
        return self.draws[place]

    def __len__(self) -> int:
        return len(self.draws)

    def __iter__(self) -> Iterator[EnergyDraw]:
        return iter(self.draws)

    @property
    def admissible_share(self) -> float:
        """The share of the posterior that is admissible, as far as the tried draws tell."""
        return len(self.draws) / self.tried

    @property
    def alone(self) -> Ensemble:
        """The same draws of the material's parameters, without any discrepancy."""
        return replace(self, draws=tuple(replace(each, parts=each.parts[:1], discrepancy=None) for each in self.draws))

    def stress(self, mode: Path, stretch: FloatArray) -> FloatArray:
        """Return the engineering stresses (N, n), MPa, of all draws at points (n,) of a mode of one stress."""
        return _stress(self.draws, np.asarray(stretch), mode)

    @cached_property
    def most(self) -> tuple[float, float]:
        """The largest I1 - 3 and I2 - 3 that were measured."""
        first, second = invariants(self.model.experiment.mode, self.model.experiment.stretch)
        return float(first.max()), float(second.max())


def drawn_ensemble(
    solution: Solution, count: int, seed: int = 0, sampling: Sampling = "sobol", *, admissible: bool = True
) -> Ensemble:
    """Return draws of a posterior as materials.

    Parameters
    ----------
    solution : Solution
        Of an isotropic material, and a discrepancy that is an energy, has none, or adds the terms of another material.
    count : int
    seed : int
        From which the draws follow.
    sampling : str
        ``"sobol"``, ``"latin"`` or ``"random"``: how they spread over the posterior (before any is left out).
    admissible : bool
        Leave out draws that are not stable in every loading mode over the range that was measured.

    Raises
    ------
    InputError, ModelError
        When the posterior is not one of energies, or hardly any draw is admissible.
    """
    model = solution.model
    _check(model, count, seed, sampling)
    modes, draws, tried = _curve_modes(), list[EnergyDraw](), 0
    while len(draws) < count:
        if tried >= MOST_TRIES * count:
            raise ModelError(
                f"only {len(draws)} of {tried} draws are stable over the measured range of every loading mode, and "
                f"{count} are wanted: fit with stable_in='all', choose another material, or take all draws."
            )
        batch = _materials(solution, count, [seed, tried // count], sampling)
        stable = np.ones(count, dtype=bool)
        if admissible:
            stable = stable_draws(partial(_curves, batch), count, model.experiment, modes)
        chosen = np.flatnonzero(stable)[: count - len(draws)]
        draws += [batch[place] for place in chosen]
        tried += int(chosen[-1]) + 1 if len(draws) == count else count
    ranges = {mode.name: calibrated_range(model.experiment, mode) for mode in modes}
    numbered = tuple(replace(draw, number=number) for number, draw in enumerate(draws))
    return Ensemble(numbered, model, tuple(mode.name for mode in modes) if admissible else (), tried, ranges)


def _stress(draws: Sequence[EnergyDraw], stretch: FloatArray, mode: Path) -> FloatArray:
    """Return the stresses (N, n) of draws at points of a mode."""
    found = np.zeros((len(draws), len(stretch)))
    for part, (material, _) in enumerate(draws[0].parts):
        found += _of_material(material, np.array([draw.parts[part][1] for draw in draws]), stretch, mode)
    rates, (logs, log_rates) = invariant_rates(mode, stretch), log_stretches(mode, stretch)
    first, second = invariants(mode, stretch)
    for row, energy in zip(found, (draw.discrepancy for draw in draws), strict=True):
        if energy is not None:
            row += energy.first.slope(first) * rates[0] + energy.second.slope(second) * rates[1]
            row += (energy.logarithm.slope(logs) * log_rates).sum(axis=1)
    return found


def _of_material(material: Material, values: FloatArray, stretch: FloatArray, mode: Path) -> FloatArray:
    """Return the stresses (N, n) of a material with parameters (N, k), a few at a time, as derivatives like them."""
    is_linear = np.array([parameter.is_linear for parameter in material.parameters])
    if is_linear.all():
        return np.asarray(values @ stress_basis(material, mode, stretch).T)
    count = max(1, MOST_VALUES // (len(stretch) * int(is_linear.sum())))
    blocks = [values[start : start + count] for start in range(0, len(values), count)]
    bases = (stress_basis(material, mode, stretch, block[:, ~is_linear]) for block in blocks)
    pairs = zip(bases, blocks, strict=True)
    return np.concatenate([np.einsum("nsk,nk->ns", basis, block[:, is_linear]) for basis, block in pairs])


def _curves(draws: Sequence[EnergyDraw], places: NDArray[np.intp]) -> Callable[[FloatArray, Path], FloatArray]:
    """Return the function that gives the stresses of some of the draws."""
    some = [draws[place] for place in places]

    def stresses(points: FloatArray, path: Path) -> FloatArray:
        try:
            return _stress(some, points, path)
        except TypeError as error:
            raise ModelError(
                f"the stability of material '{some[0].parts[0][0].name}' is not known, because its energy is not plain "
                "arithmetic of arrays: take exp, log and the like from tissuq.mechanics.arithmetic instead of "
                "jax.numpy, write no branches, or take all draws (tissuq export --all-draws)."
            ) from error

    return stresses


def _check(model: StatisticalModel, count: int, seed: int, sampling: str) -> None:
    if count < 1:
        raise InputError(f"an ensemble has one draw or more, not {count}.")
    if seed < 0:
        raise InputError(f"the seed of an ensemble must be 0 or more, not {seed}.")
    if sampling not in get_args(Sampling):
        raise InputError(f"sampling must be one of {', '.join(get_args(Sampling))}, not '{sampling}'.")
    if not model.material.is_isotropic:
        raise ModelError(f"material '{model.material.name}' has fibres; draws as materials are of isotropic ones only.")
    if not model.discrepancy.is_energy and model.discrepancy.parameters:
        raise ModelError(
            f"discrepancy '{model.discrepancy.name}' is an error of the measured stress and no material: fit with one "
            "that is an energy, such as 'auto', or with 'none'."
        )


def _points(solution: Solution, count: int, seed: list[int], sampling: Sampling) -> tuple[Components, FloatArray]:
    """Return draws as components without width, and the factor (count,) of the error that all tests have in common."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    parts, generator = solution.components, np.random.default_rng(seed)
    size = parts.mean.shape[1] + 2
    if sampling == "random":
        place = generator.random((count, size))
    else:
        engine = {"sobol": qmc.Sobol, "latin": qmc.LatinHypercube}[sampling](size, rng=generator)
        place = engine.random_base2((count - 1).bit_length())[:count] if sampling == "sobol" else engine.random(count)
    place = np.clip(place, 1e-12, 1 - 1e-12)
    headline, _ = values_of(solution.model, parts, [solution.model.headline])
    order = np.argsort(headline[:, 0], kind="stable")  # neighbours are alike, so that an even spread is one over them
    chosen = order[np.searchsorted(np.cumsum(parts.weights[order]), place[:, 0] * parts.weights.sum())]
    own = parts[chosen]
    mean = own.mean + np.einsum("mpq,mq->mp", own.root, ndtri(place[:, 2:]))
    points = replace(own, mean=mean, root=np.zeros_like(own.root), weights=np.full(count, 1 / count))
    return points, np.asarray(1 + solution.model.common_error * ndtri(place[:, 1]))


def _materials(solution: Solution, count: int, seed: list[int], sampling: Sampling) -> list[EnergyDraw]:
    """Return so many draws of a posterior as materials."""
    model = solution.model
    points, factor = _points(solution, count, seed, sampling)
    values, _ = values_of(model, points, model.symbols)
    values = values * np.where(np.isin(model.symbols, model.column_symbols), factor[:, None], 1.0)
    energies = _energies(model, points, factor, seed) if model.energy_symbols else [None] * count
    draws = []
    for number, (row, energy) in enumerate(zip(values, energies, strict=True)):
        known = dict(zip(model.symbols, map(float, row), strict=True))
        further = model.discrepancy.material_part(known)
        own = model.material, tuple(known[symbol] for symbol in model.material_symbols)
        draws.append(EnergyDraw(number, (own, further) if further else (own,), energy))
    return draws


def _energies(
    model: StatisticalModel, points: Components, factor: FloatArray, seed: list[int]
) -> list[PiecewiseEnergy]:
    """Return the discrepancies of draws, over the states whose invariants were measured."""
    generator, start = np.random.default_rng([*seed, 1]), len(model.linear)
    at = Coordinates(*(np.linspace(*each, KNOTS) for each in _ends(model.experiment)))
    slopes = [np.zeros((KNOTS, len(factor))) for _ in at]
    assert points.member is not None  # noqa: S101 (an energy discrepancy has members)
    for place in np.unique(points.member):
        own, member, column = np.flatnonzero(points.member == place), model.energy_members[place], start
        for which, (terms, count) in zip(member.places, member.slopes(at), strict=True):
            amplitude = points.settings[own, model.nonlinear.index(model.energy_symbols[which])]
            beyond = generator.standard_normal((len(own), terms.first.shape[1] - count)) * amplitude[:, None]
            weights = np.hstack([points.mean[own, column : column + count], beyond]) * factor[own, None]
            column += count
            for every, each in zip(slopes, terms, strict=True):
                every[:, own] += each @ weights.T
    functions = (pieces(knots, each) for knots, each in zip(at, slopes, strict=True))
    return [PiecewiseEnergy(*each) for each in zip(*functions, strict=True)]


def _ends(data: Experiment) -> Iterator[tuple[float, float]]:
    """Return the ranges of I1 - 3, I2 - 3 and the logarithms of stretches in states whose invariants were measured."""
    states = [(mode, np.array(calibrated_range(data, mode))) for mode in _curve_modes()]
    every = [invariants(data.mode, data.stretch), *(invariants(*state) for state in states)]
    logs = [log_stretches(data.mode, data.stretch)[0], *(log_stretches(*state)[0] for state in states)]
    for each in zip(*every, strict=True):
        yield 0.0, max(float(some.max()) for some in each)
    yield min(float(each.min()) for each in logs), max(float(each.max()) for each in logs)


def _curve_modes() -> list[LoadingMode]:
    return [mode for mode in (kind() for kind in loading_modes().values()) if mode.is_curve]
