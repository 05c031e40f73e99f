"""Whether a fitted material is stable, draw by draw: Baker-Ericksen, Drucker, and a stress that rises with stretch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import ImposedStretches, LoadingMode, States, curve_modes, loading_mode
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Solution, are_isotropic
from tissuq.mechanics import Material
from tissuq.mechanics.invariants import MeasuredStates, farthest_stretch
from tissuq.mechanics.rays import through
from tissuq.mechanics.stress import MAX_COMPLEX_STEP_VALUES
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.checks import check_count
from tissuq.prediction.moments import drawn_curves

Curves = Callable[[States], FloatArray]

STABILITY_DRAWS, POINTS_PER_SIDE = 500, 31
"""Number of draws, and of stretches on either side of the reference, with which the loss of stability is located."""
MIN_LOSS_PROBABILITY = 0.05
"""Smallest probability of a loss of stability that is marked."""
DRAWS_PER_BLOCK = 4000
"""Number of draws for which the stresses are computed together."""
LOG_STRAIN_STEP = 1e-4
"""Step of the logarithmic strains for the tangent."""
NEUTRAL_STRESS_RATIO = 1e-9
"""Largest difference of stresses that counts as none, over the initial modulus."""
DIRECTIONS = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, -1.0]])
"""Logarithmic strains of the first and of the second axis at constant volume, the third axis free of stress."""


@dataclass(frozen=True)
class Stability:
    """Shares of draws that are stable at stretches of a loading mode, and from the reference up to them.

    Attributes
    ----------
    mode : str
    stretch : (g,) array
    baker_ericksen : (g,) array
        The greater principal stress along the greater stretch, where there is no preferred direction.
    drucker : (g,) array
        Work of every small change of stress is positive: the tangent of Cauchy stress by logarithmic strain, in the
        plane of the first two axes with the third free of stress, is positive definite (as Abaqus checks).
    rising : (g,) array
        The engineering stress rises with the stretch.
    stable : (g,) array
        All three hold everywhere from the reference to this stretch: at as many stretches on the way as `StableRange`
        looks at, too.
    """

    mode: str
    stretch: FloatArray
    baker_ericksen: FloatArray
    drucker: FloatArray
    rising: FloatArray
    stable: FloatArray


class Loss(NamedTuple):
    """Probability of a loss of stability, and its stretch: median and 95 % interval of the draws that lose it."""

    probability: float
    median: float
    low: float
    high: float


@dataclass(frozen=True)
class StableRange:
    """How far from the reference a material is stable in one loading mode, over the range that was measured.

    Attributes
    ----------
    mode : str
    low, high : float
        Stretches between which stability was examined.
    probability : float
        Probability of stability at all of them.
    surely_low, surely_high : float
        Stretches between which stability is lost with a probability of at most 5 %; both one where there are none.
    loss_below, loss_above : Loss
        Loss at stretches below one, and above; of probability zero, without a stretch, where no draw loses stability.
    """

    mode: str
    low: float
    high: float
    probability: float
    surely_low: float
    surely_high: float
    loss_below: Loss
    loss_above: Loss

    @property
    def loss(self) -> Loss:
        """The likelier loss, below or above."""
        return max(self.loss_below, self.loss_above, key=lambda loss: loss.probability)


def stability(solution: Solution, mode: LoadingMode, stretch: FloatArray) -> Stability:
    """Return the probability of stability at stretches (g,) of a loading mode, for material and energy discrepancy.

    A discrepancy that is not an energy is ignored.

    Raises
    ------
    ModelError
        When the material has directions, or its energy cannot be differentiated at many states at once.
    """
    components = _sampled_components(solution)
    curves, is_isotropic = _curves(solution.model, components), are_isotropic(solution.model, components)
    way = np.unique(np.concatenate([stretch, *_ways(mode, float(stretch.min()), float(stretch.max()))]))
    criteria = _criteria(curves, mode, way, is_isotropic)
    stable = _from_reference(way - mode.reference, np.logical_and.reduce(criteria))
    shares = (flags.mean(axis=0)[np.searchsorted(way, stretch)] for flags in (*criteria, stable))
    return Stability(mode.name, stretch, *shares)


def stability_over(
    solution: Solution, mode: str | LoadingMode | None, stretch: ArrayLike | None, points: int
) -> Stability:
    """Return the stability at stretches, or at ``points`` of them over the measured range; by default in its own mode.

    Raises
    ------
    InputError, ModelError
        When the mode has several controls; and as `stability`.
    """
    data = solution.model.experiment
    if mode is None:
        simple = (test_mode for test_mode in data.modes if len(test_mode.controls) == len(test_mode.stresses) == 1)
        mode = next(simple, "uniaxial")
    loading = loading_mode(mode)
    if len(loading.controls) > 1:
        raise InputError(f"stability is computed in modes of one control, and '{loading.name}' has several.")
    if stretch is None:
        check_count(points, "points must be one or more")
        stretch = np.linspace(*measured_range(data, loading), points)
    return stability(solution, loading, checked_points(loading, np.atleast_1d(stretch)))


def stable_ranges(solution: Solution, reach: float = 1.0) -> dict[str, StableRange]:
    """Return the range in which the draws are stable, for every mode of one stretch and one stress.

    Over the measured range; with a reach above one, as far as I1 - 3 and I2 - 3 are so many times the largest measured
    ones. Empty where stability cannot be computed from the material's energy. In the other modes the material passes
    through the same states, or through states between theirs.
    """
    ranges, components = {}, _sampled_components(solution)
    is_isotropic = are_isotropic(solution.model, components)
    for mode in curve_modes():
        stretch = _measured(solution.model.experiment, mode, reach)
        try:
            criteria = _criteria(_curves(solution.model, components), mode, stretch, is_isotropic)
        except ModelError:
            return {}
        stable = _from_reference(stretch - 1, np.logical_and.reduce(criteria))
        low, high = float(stretch[0]), float(stretch[-1])
        probability, sure = float(stable.all(axis=1).mean()), _surely_stable(stretch, stable)
        losses = _loss(stretch, stable, -1), _loss(stretch, stable, 1)
        ranges[mode.name] = StableRange(mode.name, low, high, probability, *sure, *losses)
    return ranges


def are_stable(model: StatisticalModel, points: GaussianMixture, modes: Sequence[LoadingMode]) -> BoolArray:
    """Return whether draws (M,) are stable over the measured range of all of some loading modes.

    Parameters
    ----------
    model : StatisticalModel
    points : GaussianMixture
        The draws, without width.
    modes : sequence of LoadingMode

    Raises
    ------
    ModelError
        As `stability` does.
    """
    is_isotropic = are_isotropic(model, points)
    return stable_draws(lambda rows: _curves(model, points[rows]), is_isotropic, model.experiment, modes)


def stability_modes(material: Material) -> list[LoadingMode]:
    """Return the modes in which draws of a material are examined: those of one stretch and one stress.

    With fibres, whose lateral stretches these modes leave open, the stretches are imposed along both axes of the test.
    """
    modes = curve_modes()
    return modes if material.is_isotropic else [ImposedStretches(mode, axis) for axis in (1, 2) for mode in modes]


def stable_draws(
    curves_of: Callable[[IndexArray], Curves],
    is_isotropic: BoolArray,
    data: Experiment,
    modes: Sequence[LoadingMode],
    reach: float = 1.0,
) -> BoolArray:
    """Return whether draws (N,) are stable over the range that data measured, of all of some loading modes.

    Parameters
    ----------
    curves_of : callable
        From places of M draws, the function of states (n,) that gives their stresses (M, n).
    is_isotropic : (N,) array of bool
        Which draws have no preferred direction.
    data : Experiment
    modes : sequence of LoadingMode
    reach : float
        Beyond that range where it is above one: up to so many times the measured invariants.
    """
    stable = np.ones(len(is_isotropic), dtype=bool)
    paths = [(mode, _measured(data, mode, reach)) for mode in modes]
    first_mode, first_stretch = paths[0]
    # The ends first, at little cost: most draws that are not stable fail there.
    at_ends = first_mode, np.unique([first_stretch[0], 1.0, first_stretch[-1]])
    for mode, stretch in (at_ends, *paths):
        remaining = np.flatnonzero(stable)
        if len(remaining):
            criteria = _criteria(curves_of(remaining), mode, stretch, is_isotropic[remaining])
            stable[remaining] = np.logical_and.reduce(criteria).all(axis=1)
    return stable


def _measured(data: Experiment, mode: LoadingMode, reach: float = 1.0) -> FloatArray:
    """Return stretches of a mode on either side of the reference, and that, over the range that was measured or more.

    Of a larger reach, up to so many times the measured invariants.
    """
    ends = measured_range(data, mode)
    if reach > 1:
        states = MeasuredStates.of(data.states).times(reach)
        ends = farthest_stretch(mode, states, -1), farthest_stretch(mode, states, 1)
    return np.unique(np.concatenate(_ways(mode, *ends)))


def _ways(mode: LoadingMode, low: float, high: float) -> list[FloatArray]:
    """Return stretches from the reference of a mode to the lowest and to the highest one on either side of it."""
    reference = float(mode.reference)
    return [np.linspace(reference, end, POINTS_PER_SIDE) for end in (min(low, reference), max(high, reference))]


def _sampled_components(solution: Solution) -> GaussianMixture:
    """Return components that represent the posterior by one draw each."""
    mixture = solution.mixture
    return mixture[systematic(mixture.weights[None], STABILITY_DRAWS)[0]]


def _curves(model: StatisticalModel, mixture: GaussianMixture) -> Curves:
    """Return the function that gives the stresses (M, n) of one draw of every component at states (n,)."""
    if not model.material.is_isotropic:
        raise ModelError(
            f"the stability of material '{model.material.name}' is unknown: the criteria are those of isotropic "
            "materials, and it has fibres."
        )

    def stresses(states: States) -> FloatArray:
        # The same blocks, and so the same draws, at any points.
        count = MAX_COMPLEX_STEP_VALUES // (20 * POINTS_PER_SIDE * len(model.column_symbols))
        count = count if model.bent_symbols else DRAWS_PER_BLOCK
        blocks = np.array_split(np.arange(len(mixture.weights)), -(-len(mixture.weights) // max(1, count)))
        curves = [drawn_curves(model, mixture[block], states, seed) for seed, block in enumerate(blocks)]
        return np.concatenate([material + discrepancy for material, discrepancy in curves])

    return stresses


def _criteria(
    curves: Curves, mode: LoadingMode, stretch: FloatArray, is_isotropic: BoolArray
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return whether Baker-Ericksen, Drucker and rising stress hold at stretches (g,) of a mode: (M, g) each.

    The first is no condition of a draw (M,) that has a preferred direction.
    """
    base = np.array([np.broadcast_to(values, len(stretch)) for values in mode.principal_stretches(stretch)])
    nudges = [np.zeros(3), *(sign * LOG_STRAIN_STEP * direction for direction in DIRECTIONS for sign in (1, -1))]
    logs = np.concatenate([np.log(base.T) + nudge for nudge in nudges for _ in DIRECTIONS])
    rates = np.repeat(np.tile(DIRECTIONS, (len(nudges), 1)), len(stretch), axis=0)
    stress_values = curves(through(logs, rates))
    stress = stress_values.reshape(len(stress_values), 5, 2, len(stretch))
    base_stress, tangent = stress[:, 0], (stress[:, 1::2] - stress[:, 2::2]) / (2 * LOG_STRAIN_STEP)
    change = stretch - mode.reference
    size = np.abs(np.trace(tangent[..., np.abs(change).argmin()], axis1=1, axis2=2))[:, None]
    differences = np.stack([base_stress[:, 0], base_stress[:, 1], base_stress[:, 0] - base_stress[:, 1]])
    gaps = np.stack([base[0] - base[2], base[1] - base[2], base[0] - base[1]])
    baker = (
        (differences * np.sign(gaps)[:, None] > -NEUTRAL_STRESS_RATIO * size) | (np.abs(gaps)[:, None] < 1e-9)
    ).all(axis=0) | ~is_isotropic[:, None]
    determinant = tangent[:, 0, 0] * tangent[:, 1, 1] - tangent[:, 0, 1] * tangent[:, 1, 0]
    drucker = (tangent[:, 0, 0] > 0) & (determinant > 0)
    nudged = np.concatenate([stretch - LOG_STRAIN_STEP, stretch + LOG_STRAIN_STEP])
    rising = np.diff(curves(mode.at(nudged)).reshape(len(stress_values), 2, -1), axis=1)[:, 0] > 0
    return baker, drucker, rising


def calibrated_range(model: StatisticalModel, mode: LoadingMode, *, is_directed: bool = False) -> tuple[float, float]:
    """Return the stretches of a mode up to which states were measured: `measured_states`."""
    return measured_range(model.experiment, mode, measured_states(model, is_directed=is_directed))


def is_calibrated(
    model: StatisticalModel, mode: LoadingMode, points: FloatArray, *, is_directed: bool = False
) -> BoolArray:
    """Return at which points of a mode, (g,) or (g, c), the state is among those that were measured.

    With one control that is `calibrated_range`.
    """
    if len(mode.controls) == 1:
        low, high = calibrated_range(model, mode, is_directed=is_directed)
        margin = 1e-9 * max(abs(low), abs(high))
        return np.asarray((low - margin <= points) & (points <= high + margin))
    return measured_states(model, is_directed=is_directed).contain(mode.paths[0].at(points))


def measured_states(model: StatisticalModel, *, is_directed: bool = False) -> MeasuredStates:
    """Return the states up to which the material of a model was measured.

    Those are states in which I1, I2 and, of a material with fibres or one that has a preferred direction, the stretches
    along the axes are in the measured range.
    """
    is_isotropic = model.material.is_isotropic and not is_directed
    return MeasuredStates.of(model.experiment.states, is_isotropic=is_isotropic)


def measured_range(data: Experiment, mode: LoadingMode, states: MeasuredStates | None = None) -> tuple[float, float]:
    """Return the stretches of a mode that were measured or, where it was not, up to states.

    Those are the ones of the measured I1 and I2 unless others are given.
    """
    measured = [curve.abscissa for curve in data.curves if curve.mode == mode]
    if measured:
        values = np.concatenate([[float(mode.reference)], *measured])
        return float(values.min()), float(values.max())
    states = states or MeasuredStates.of(data.states)
    return farthest_stretch(mode, states, -1), farthest_stretch(mode, states, 1)


def _from_reference(change: FloatArray, is_stable: BoolArray) -> BoolArray:
    """Return whether all is stable (M, g) from the reference to each change (g,) of the stretch."""
    stable = np.empty_like(is_stable)
    for outward in (_outward(change, -1), _outward(change, 1)):
        stable[:, outward] = np.logical_and.accumulate(is_stable[:, outward], axis=1)
    return stable


def _outward(change: FloatArray, side: int) -> IndexArray:
    """Return the places of the changes on one side of the reference, and of the reference, from there outward."""
    indices = np.flatnonzero(side * change >= 0)
    return indices[np.argsort(np.abs(change[indices]))]


def _surely_stable(stretch: FloatArray, stable: BoolArray) -> tuple[float, float]:
    """Return the stretches between which the probability of a loss of stability is small."""
    sure = stretch[stable.mean(axis=0) >= 1 - MIN_LOSS_PROBABILITY]
    return float(sure.min(initial=1.0)), float(sure.max(initial=1.0))


def _loss(stretch: FloatArray, stable: BoolArray, side: int) -> Loss:
    """Return the loss of stability of draws (M, g) on one side of the reference."""
    outward = _outward(stretch - 1, side)
    first_unstable = np.argmin(stable[:, outward], axis=1)[~stable[:, outward[-1]]]
    if len(outward) == 1 or not len(first_unstable):
        return Loss(0.0, np.nan, np.nan, np.nan)
    path = stretch[outward]
    loss_stretches = 0.5 * (path[first_unstable] + path[np.maximum(first_unstable - 1, 0)])
    return Loss(len(first_unstable) / len(stable), *map(float, np.quantile(loss_stretches, [0.5, 0.025, 0.975])))
