"""Draws of a posterior as complete hyperelastic materials, discrepancy included: what other programs can compute with.

Their energy is that of the material, of a discrepancy's further terms, and of a discrepancy that is an energy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from html import escape
from typing import Any, Literal, get_args, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.assessment.stability import calibrated_range, measured_range, stability_modes, stable_draws
from tissuq.drawing.panels import panels
from tissuq.errors import InputError, ModelError
from tissuq.experiments.headed_tables import headed
from tissuq.experiments.modes import Deformation, LoadingMode, Path, States, loading_mode
from tissuq.experiments.units import stress_unit
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.solution import Solution, are_isotropic
from tissuq.mechanics import Material, StretchMaterial, stress_basis
from tissuq.mechanics.continuation import Continuation, continuations, rays_to_ends, sum_of_energies
from tissuq.mechanics.invariants import invariant_rates, invariants, largest_invariants
from tissuq.mechanics.pieces import PiecewiseEnergy, pieces
from tissuq.mechanics.rays import MAX_CORNER_EXCESS, Range, scores, through, with_errors
from tissuq.mechanics.stress import MAX_COMPLEX_STEP_VALUES
from tissuq.model.discrepancy.blocks import Coordinates
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.checks import check_seed
from tissuq.pictures.draws import curves
from tissuq.prediction.moments import values_of

__all__ = ["EnergyDraw", "Ensemble", "Sampling", "drawn_ensemble"]

FloatArray = NDArray[np.float64]

Sampling = Literal["sobol", "latin", "random"]
"""How draws spread: a scrambled Sobol sequence, Latin hypercubes, or independently."""
KNOTS = 1001
"""Of a discrepancy's functions: 25 or more in the shortest length scale."""
PLOT_POINTS = 81
"""Stretches of a picture."""
MOST_TRIES = 64
"""Draws tried for each admissible one that is wanted."""


@dataclass(frozen=True, eq=False)
class EnergyDraw(StretchMaterial):
    """One draw of a posterior as a material without free parameters.

    Beyond the range of the data of its discrepancy, its energy goes on along rays (`tissuq.mechanics.rays`). With
    fibres it does not, and its energy is one of the deformation, not of the stretches alone.

    Attributes
    ----------
    number : int
        Its place in the ensemble, from zero.
    parts : tuple of (Material, tuple of float)
        The material, and further terms of the discrepancy where it has some, with their parameters.
    discrepancy : PiecewiseEnergy or None
        The energy of a discrepancy that is one.
    continuation : Continuation or None
        The energy of all beyond the range of the data of such a discrepancy.
    beyond_score : float
        Quantile of the normal distribution at which the draw goes on beyond that range, less steeply or more.
    test_scale : float
        The factor of the error that all tests have in common.
    """

    number: int
    parts: tuple[tuple[Material, tuple[float, ...]], ...]
    discrepancy: PiecewiseEnergy | None
    continuation: Continuation | None = None
    beyond_score: float = 0.0
    test_scale: float = 1.0

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
        terms = [material.formula for material, _ in self.parts]
        return " + ".join([*terms, "discrepancy"] if self.discrepancy else terms)

    @property
    def values(self) -> dict[str, float]:
        """The parameters of the material by their symbols."""
        material, values = self.parts[0]
        return {parameter.symbol: value for parameter, value in zip(material.parameters, values, strict=True)}

    @property
    def is_isotropic(self) -> bool:  # type: ignore[override]
        """Whether all parts are."""
        return all(material.is_isotropic for material, _ in self.parts)

    def energy(self, stretches: tuple[Any, Any, Any], values: Any = ()) -> Any:
        materials, parameters = zip(*self.parts, strict=True)
        return sum_of_energies(materials, parameters, stretches, self.discrepancy, self.continuation)

    def energy_of(self, deformation: Deformation, values: Any = ()) -> Any:
        if self.is_isotropic:
            return self.energy(deformation.stretches)
        energy = sum(material.energy_of(deformation, parameters) for material, parameters in self.parts)
        return energy if self.discrepancy is None else energy + self.discrepancy(deformation.stretches)

    def why_not(self, deformation: Deformation) -> str:
        return next(filter(None, (material.why_not(deformation) for material, _ in self.parts)), "")


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
        Stretches of each loading mode of one stretch between which both invariants were measured; with fibres, measured
        stretches along the axes of the test.
    origin : str
        Where the draws come from, in words, where that is no fit of measurements: a new patient of a population.
    """

    draws: tuple[EnergyDraw, ...]
    model: StatisticalModel
    admissible_in: tuple[str, ...]
    tried: int
    ranges: Mapping[str, tuple[float, float]]
    origin: str = ""

    @overload
    def __getitem__(self, index: int) -> EnergyDraw: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[EnergyDraw]: ...
    def __getitem__(self, index: int | slice) -> EnergyDraw | Sequence[EnergyDraw]:
        return self.draws[index]

    def __len__(self) -> int:
        return len(self.draws)

    def shuffled(self, seed: int | Sequence[int]) -> Ensemble:
        """Return the same draws in another order, numbered by it, to pair them with those of another ensemble."""
        order = np.random.default_rng(seed).permutation(len(self))
        return replace(self, draws=tuple(replace(self.draws[k], number=number) for number, k in enumerate(order)))

    def __iter__(self) -> Iterator[EnergyDraw]:
        return iter(self.draws)

    @property
    def admissible_share(self) -> float:
        """The share of the posterior that is admissible, as far as the tried draws tell."""
        return len(self.draws) / self.tried

    @property
    def sources(self) -> dict[str, FloatArray]:
        """What the draws differ by besides parameters and discrepancy, independently of these: columns (N, k) by name.

        ``extrapolation``, the score of how a draw goes on beyond the data and its square, where any does so;
        ``test_scale``, the factor that all tests have in common, where there is one.
        """
        score, scale = (np.array([getattr(draw, name) for draw in self]) for name in ("beyond_score", "test_scale"))
        columns = {}
        if any(draw.continuation is not None for draw in self):
            columns["extrapolation"] = np.stack([score, score**2 - 1], axis=1)
        if np.ptp(scale) > 0:
            columns["test_scale"] = scale[:, None] - 1
        return columns

    @property
    def alone(self) -> Ensemble:
        """The same draws of the material's parameters, without any discrepancy."""
        return replace(
            self,
            draws=tuple(
                replace(draw, parts=draw.parts[:1], discrepancy=None, continuation=None) for draw in self.draws
            ),
        )

    def stress(self, mode: str | LoadingMode | Path, stretch: FloatArray) -> FloatArray:
        """Return the engineering stresses (N, n), MPa, of all draws at points (n,) of a mode of one stress."""
        return self.stresses_at((loading_mode(mode) if isinstance(mode, str) else mode).at(np.asarray(stretch)))

    def stresses_at(self, states: States) -> FloatArray:
        """Return the engineering stresses (N, n), MPa, of all draws at states (n,)."""
        return _stress(self.draws, states)

    def plot(
        self,
        mode: str | LoadingMode | None = None,
        stretch: ArrayLike | None = None,
        ax: Any = None,
        *,
        unit: str | None = None,
    ) -> Any:
        """Draw the stress of every draw in a loading mode of one stress.

        Parameters
        ----------
        mode : str or LoadingMode, optional
            That of the first test, unless given.
        stretch : (g,) array, optional
            Over the range in which both invariants were measured, unless given.
        ax : Axes, optional
            Unless given, a new figure is made in `matplotlib.pyplot`.
        unit : str, optional
            Of the stress; that of the measurements, unless given.

        Returns
        -------
        Axes
        """
        loading = self.model.experiment.modes[0] if mode is None else loading_mode(mode)
        if len(loading.controls) > 1 or len(loading.stresses) > 1:
            raise InputError(
                f"draws are drawn in modes of one control and one stress, and '{loading.name}' has more: choose of "
                f"{', '.join(self.ranges)}."
            )
        if stretch is None:
            stretches = np.linspace(*measured_range(self.model.experiment, loading), PLOT_POINTS)
        else:
            stretches = np.atleast_1d(np.asarray(stretch, dtype=np.float64))
        with panels(ax, 1) as drawn:
            curves(
                drawn,
                stretches,
                self.stress(loading, stretches),
                loading,
                stress_unit(unit or self.model.experiment.stress_unit),
            )
        return drawn.result

    def _repr_html_(self) -> str:
        """Return how the draws' parameters spread as a table, which notebooks show."""
        import pandas as pd

        is_stress = {parameter.symbol: bool(parameter.unit) for parameter in self.model.material.parameters}
        unit = stress_unit(self.model.experiment.stress_unit)
        table = pd.DataFrame([draw.values for draw in self.draws])
        table = table.div([unit.to_mpa if is_stress[str(name)] else 1.0 for name in table])
        spread = headed(table.describe().loc[["min", "50%", "max"]].rename(index={"50%": "median"}).T, unit)
        return f"<p>{escape(repr(self))}</p>{spread.to_html(float_format='{:.4g}'.format)}"

    def __repr__(self) -> str:
        stable = "" if self.admissible_in else ", stable or not"
        return f"<Ensemble of {len(self)} draws of {self.model.material.name}{stable}>"

    @cached_property
    def most(self) -> tuple[float, float]:
        """The largest I1 - 3 and I2 - 3 that were measured."""
        return largest_invariants(self.model.experiment.states)


def drawn_ensemble(
    solution: Solution, count: int, seed: int = 0, sampling: Sampling = "sobol", *, admissible: bool = True
) -> Ensemble:
    """Return draws of a posterior as materials.

    Parameters
    ----------
    solution : Solution
        Of a discrepancy that is an energy, has none, or adds the terms of another material.
        Of an average, energies with a preferred direction are left out.
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
        When the posterior is not one of energies, has a preferred direction more probably than not, or hardly any draw
        is admissible.
    """
    model = solution.model
    _check(model, count, seed, sampling)
    solution, all_isotropic = _isotropic(solution), np.ones(count, dtype=bool)
    modes, draws, tried = stability_modes(model.material), list[EnergyDraw](), 0
    while len(draws) < count:
        if tried >= MOST_TRIES * count:
            in_fit = "require stability in the fit (--stable-in all, in Python stable_in='all'), "
            raise ModelError(
                f"only {len(draws)} of {tried} draws are stable over the measured range of every loading mode, and "
                f"{count} are wanted: {in_fit if model.material.is_isotropic else ''}choose another material, or take "
                "all draws (--all-draws, in Python admissible=False)."
            )
        batch = _materials(solution, count, [seed, tried // count], sampling)
        stable = all_isotropic
        if admissible:
            has_axes = all_isotropic if model.material.is_isotropic else ~all_isotropic
            stable = stable_draws(partial(_curves, batch), has_axes, model.experiment, modes)
        accepted = np.flatnonzero(stable)[: count - len(draws)]
        draws += [batch[index] for index in accepted]
        tried += int(accepted[-1]) + 1 if len(draws) == count else count
    ranges = _ranges(model, modes)
    numbered = tuple(replace(draw, number=number) for number, draw in enumerate(draws))
    admissible_in = tuple(mode.name for mode in modes) if admissible else ()
    return Ensemble(numbered, model, admissible_in, tried, ranges, "" if solution.is_of_data else solution.reason)


def _stress(draws: Sequence[EnergyDraw], states: States) -> FloatArray:
    """Return the stresses (N, n) of draws at states (n,)."""
    stresses = _stress_within(draws, states)
    for row, draw in zip(stresses, draws, strict=True):
        if draw.continuation is not None:
            is_beyond, continued = draw.continuation.stress(*states.log_stretches)
            row[is_beyond] = continued
    return stresses


def _stress_within(draws: Sequence[EnergyDraw], states: States) -> FloatArray:
    """Return the stresses (N, n) of draws at states (n,) in the range of their data."""
    stresses = np.zeros((len(draws), len(states)))
    for term, (material, _) in enumerate(draws[0].parts):
        stresses += _of_material(material, np.array([draw.parts[term][1] for draw in draws]), states)
    rates, (logs, log_rates) = invariant_rates(states), states.log_stretches
    I1, I2 = invariants(states)
    for row, energy in zip(stresses, (draw.discrepancy for draw in draws), strict=True):
        if energy is not None:
            row += energy.of_i1.slope(I1) * rates[0] + energy.of_i2.slope(I2) * rates[1]
            row += (energy.logarithm.slope(logs) * log_rates).sum(axis=1)
    return stresses


def _of_material(material: Material, values: FloatArray, states: States) -> FloatArray:
    """Return the stresses (N, n) of a material with parameters (N, k), a few at a time, as derivatives like them."""
    is_linear = np.array([parameter.is_linear for parameter in material.parameters])
    if is_linear.all():
        return np.asarray(values @ stress_basis(material, states).T)
    count = max(1, MAX_COMPLEX_STEP_VALUES // (len(states) * int(is_linear.sum())))
    blocks = [values[start : start + count] for start in range(0, len(values), count)]
    bases = (stress_basis(material, states, block[:, ~is_linear]) for block in blocks)
    pairs = zip(bases, blocks, strict=True)
    return np.concatenate([np.einsum("nsk,nk->ns", basis, block[:, is_linear]) for basis, block in pairs])


def _curves(draws: Sequence[EnergyDraw], indices: NDArray[np.intp]) -> Callable[[States], FloatArray]:
    """Return the function that gives the stresses of some of the draws."""
    return partial(_stress, [draws[index] for index in indices])


def _ranges(model: StatisticalModel, modes: Sequence[LoadingMode]) -> dict[str, tuple[float, float]]:
    """Return the measured stretches of modes; with fibres, those along the axes of the test."""
    if model.material.is_isotropic:
        return {mode.name: calibrated_range(model, mode) for mode in modes}
    columns = np.sqrt(1 + model.experiment.states.axis_strains[0]).T
    return {
        f"axis {axis}": (min(1.0, *map(float, column)), max(1.0, *map(float, column)))
        for axis, column in enumerate(columns, start=1)
    }


def _check(model: StatisticalModel, count: int, seed: int, sampling: str) -> None:
    if count < 1:
        raise InputError(f"an ensemble has one draw or more, not {count}.")
    check_seed(seed)
    if sampling not in get_args(Sampling):
        raise InputError(f"sampling must be one of {', '.join(get_args(Sampling))}, not '{sampling}'.")
    if not model.discrepancy.is_energy:
        raise ModelError(
            f"discrepancy '{model.discrepancy.name}' is an error of the measured stress and no material: fit with one "
            "that is an energy, such as 'auto', or with 'none'."
        )


def _isotropic(solution: Solution) -> Solution:
    """Return the posterior given that there is no preferred direction."""
    if not solution.direction_probability:
        return solution
    if solution.is_directed:
        raise ModelError(
            f"the material has a preferred direction with a probability of {solution.direction_probability:.3g}, and "
            "draws as materials are the same in all directions: fit with the discrepancy 'auto-isotropic' if its "
            "direction does not matter."
        )
    isotropic = solution.mixture[np.flatnonzero(are_isotropic(solution.model, solution.mixture))]
    mixture = isotropic.weighted(isotropic.weights / isotropic.weights.sum())
    return replace(solution, represent=lambda: mixture)


def _points(
    solution: Solution, count: int, seed: list[int], sampling: Sampling
) -> tuple[GaussianMixture, FloatArray, FloatArray]:
    """Return draws as mixture without width, the factor of the error that all tests have in common, and probabilities.

    The latter, (count,) both, are those at which exponents are beyond the data.
    """
    from scipy.special import ndtri
    from scipy.stats import qmc

    mixture, generator = solution.mixture, np.random.default_rng(seed)
    size = mixture.mean.shape[1] + 3
    if sampling == "random":
        uniform = generator.random((count, size))
    else:
        engine = {"sobol": qmc.Sobol, "latin": qmc.LatinHypercube}[sampling](size, rng=generator)
        uniform = engine.random_base2((count - 1).bit_length())[:count] if sampling == "sobol" else engine.random(count)
    uniform = np.clip(uniform, 1e-12, 1 - 1e-12)
    headline, _ = values_of(solution.model, mixture, [solution.model.headline])
    order = np.argsort(headline[:, 0], kind="stable")  # neighbours are alike, so that an even spread is one over them
    cumulative = np.cumsum(mixture.weights[order])
    selected = mixture[order[np.searchsorted(cumulative, uniform[:, 0] * mixture.weights.sum())]]
    mean = selected.mean + np.einsum("mpq,mq->mp", selected.root, ndtri(uniform[:, 3:]))
    points = replace(selected, mean=mean, root=np.zeros_like(selected.root), weights=np.full(count, 1 / count))
    return points, np.asarray(1 + solution.model.common_error * ndtri(uniform[:, 1])), uniform[:, 2]


def _materials(solution: Solution, count: int, seed: list[int], sampling: Sampling) -> list[EnergyDraw]:
    """Return so many draws of a posterior as materials."""
    from scipy.special import ndtri

    model = solution.model
    points, factor, probability = _points(solution, count, seed, sampling)
    values, _ = values_of(model, points, model.symbols)
    values = values * np.where(np.isin(model.symbols, model.column_symbols), factor[:, None], 1.0)
    energies = _energies(model, points, factor) if model.energy_symbols else [None] * count
    draws = []
    beyond_scores = ndtri(probability)
    for number, (row, energy) in enumerate(zip(values, energies, strict=True)):
        parameters = dict(zip(model.symbols, map(float, row), strict=True))
        extra_term = model.discrepancy.material_part(parameters)
        base_term = model.material, tuple(parameters[symbol] for symbol in model.material_symbols)
        terms = (base_term, extra_term) if extra_term else (base_term,)
        draws.append(EnergyDraw(number, terms, energy, None, float(beyond_scores[number]), float(factor[number])))
    return _continued(model, draws, points.member, scores(probability)) if points.member is not None else draws


def _energies(model: StatisticalModel, points: GaussianMixture, factor: FloatArray) -> list[PiecewiseEnergy]:
    """Return the discrepancies of draws, over the range of the data."""
    start = len(model.linear)
    grid = Coordinates(*(_knots(*ends) for ends in _ends(model.experiment.states)))
    slopes = [np.zeros((KNOTS, len(factor))) for _ in grid]
    assert points.member is not None  # noqa: S101 (an energy discrepancy has members)
    for number in np.unique(points.member):
        rows, member, column = np.flatnonzero(points.member == number), model.energy_members[number], start
        for terms in member.slopes(grid):
            count = terms.invariant_1.shape[1]
            weights = points.mean[rows, column : column + count] * factor[rows, None]
            column += count
            for slope, features in zip(slopes, terms, strict=True):
                slope[:, rows] += features @ weights.T
    functions = (pieces(knots, values) for knots, values in zip(grid, slopes, strict=True))
    return [PiecewiseEnergy(*terms) for terms in zip(*functions, strict=True)]


def _knots(low: float, high: float) -> FloatArray:
    """Return knots around zero, their distances in proportion to the root of how far they are from it."""
    roots = np.linspace(-np.sqrt(-low), np.sqrt(high), KNOTS)
    return np.asarray(roots * np.abs(roots))


def _continued(
    model: StatisticalModel, draws: Sequence[EnergyDraw], member: NDArray[np.intp], score: FloatArray
) -> list[EnergyDraw]:
    """Return draws with their continuations, of exponents whose errors have a score (N,)."""
    continued = list(draws)
    for limits, rows in model.by_limits(member):
        if limits == Range():
            continue
        rays, of_rows = rays_to_ends(limits), [draws[row] for row in rows]
        at_end, farther_in = np.split(_stress_within(of_rows, rays.last_states), 2, axis=1)
        stretches = tuple(np.exp(rays.ends).T)
        with np.errstate(invalid="ignore"):
            energies = np.array([draw.energy(stretches) for draw in of_rows])
        exponents = with_errors(rays.last_exponents(at_end, farther_in), score[rows, None])
        is_known = np.isfinite([energies, at_end, *exponents]).all(axis=(0, 2))  # not where the material has locked
        finite = (values[is_known] for values in (energies, at_end, *exponents))
        for row, continuation in zip(rows[is_known], continuations(rays, *finite), strict=True):
            continued[row] = replace(draws[row], continuation=continuation)
    return continued


def _ends(states: States) -> Iterator[tuple[float, float]]:
    """Return the ranges of I1 - 3, I2 - 3 and the logarithms of stretches in states, with rounded corners."""
    logs, rates = states.log_stretches
    wider = np.exp(MAX_CORNER_EXCESS) * logs
    for largest in largest_invariants(through(wider, rates)):
        yield 0.0, largest
    yield float(wider.min()), float(wider.max())
