"""Draws of a posterior as materials: spread through it, stable where that is asked for, continued beyond the data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, get_args

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.assessment.stability import calibrated_range, stability_modes, stable_draws
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import LoadingMode, States
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.solution import Representation, Solution, are_isotropic
from tissuq.mechanics.draws import PiecewiseEnergy, continuations, pieces, rays_to_ends
from tissuq.mechanics.invariants import largest_invariants
from tissuq.mechanics.rays import MAX_CORNER_EXCESS, Range, scores, through, with_errors
from tissuq.model.discrepancy.blocks import Coordinates
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.checks import check_count, check_seed
from tissuq.posterior.ensemble import EnergyDraw, Ensemble, stress_of, stress_within
from tissuq.prediction.moments import values_of

Sampling = Literal["sobol", "latin", "random"]
"""How draws spread: a scrambled Sobol sequence, Latin hypercubes, or independently."""
KNOTS = 1001
"""Of a discrepancy's functions: 25 or more in the shortest length scale."""
MOST_TRIES = 64
"""Draws tried for each admissible one that is wanted."""


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


def _curves(draws: Sequence[EnergyDraw], indices: IndexArray) -> Callable[[States], FloatArray]:
    """Return the function that gives the stresses of some of the draws."""
    return partial(stress_of, [draws[index] for index in indices])


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
    check_count(count, "an ensemble has one draw or more")
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
    return replace(solution, representation=Representation.of(mixture))


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
        of_material = tuple(parameters[symbol] for symbol in model.material_symbols)
        base_term = model.material.plain, tuple(model.material.plain_values(of_material))
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
    model: StatisticalModel, draws: Sequence[EnergyDraw], member: IndexArray, score: FloatArray
) -> list[EnergyDraw]:
    """Return draws with their continuations, of exponents whose errors have a score (N,)."""
    continued = list(draws)
    for limits, rows in model.by_limits(member):
        if limits == Range():
            continue
        rays, of_rows = rays_to_ends(limits), [draws[row] for row in rows]
        at_end, farther_in = np.split(stress_within(of_rows, rays.last_states), 2, axis=1)
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
