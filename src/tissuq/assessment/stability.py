"""Whether a fitted material is stable, draw by draw: Baker-Ericksen, Drucker, and a stress that rises with stretch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes
from tissuq.inference.resampling import systematic
from tissuq.inference.solution import Components, Solution
from tissuq.mechanics.complex_step import MOST_VALUES
from tissuq.mechanics.path import farthest_stretch, invariants
from tissuq.model import StatisticalModel
from tissuq.prediction.moments import drawn_curves

__all__ = [
    "LOST",
    "Loss",
    "Stability",
    "StableRange",
    "are_stable",
    "calibrated_range",
    "is_calibrated",
    "stability",
    "stability_over",
    "stable_draws",
    "stable_ranges",
]

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]
Curves = Callable[[FloatArray, LoadingMode], FloatArray]

DRAWS, POINTS = 500, 31
"""Draws, and stretches on either side of the reference, to whose distance it is known where stability is lost."""
LOST = 0.05
"""Probability from which a loss of stability is worth a mark."""
AT_ONCE = 4000
"""Draws for which the stresses are computed together."""
STEP = 1e-4
"""Of the logarithmic strains, for the tangent."""
NEUTRAL = 1e-9
"""Of the initial modulus: differences of stress that count as none."""
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
        The greater principal stress along the greater stretch.
    drucker : (g,) array
        Work of every small change of stress is positive: the tangent of Cauchy stress by logarithmic strain, in the
        plane of the first two axes with the third free of stress, is positive definite (as Abaqus checks).
    rising : (g,) array
        The engineering stress rises with the stretch.
    stable : (g,) array
        All three hold everywhere from the reference to this stretch.
    """

    mode: str
    stretch: FloatArray
    baker_ericksen: FloatArray
    drucker: FloatArray
    rising: FloatArray
    stable: FloatArray


class Loss(NamedTuple):
    """With what probability stability is lost, and where: median and 95 % interval of the draws that lose it."""

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
        Stretches between which it was looked at.
    probability : float
        Of stability at all of them.
    surely_low, surely_high : float
        Stretches between which stability is lost with a probability of at most 5 %; both one where there are none.
    below, above : Loss
        At stretches below one, and above; of probability zero and without place where no draw loses it there.
    """

    mode: str
    low: float
    high: float
    probability: float
    surely_low: float
    surely_high: float
    below: Loss
    above: Loss

    @property
    def loss(self) -> Loss:
        """The likelier loss, below or above."""
        return max(self.below, self.above, key=lambda loss: loss.probability)


def stability(solution: Solution, mode: LoadingMode, stretch: FloatArray) -> Stability:
    """Return how probable stability is at stretches (g,) of a loading mode, for material and energy discrepancy.

    A discrepancy that is no energy has no part in it.

    Raises
    ------
    ModelError
        When the material has directions, or its energy cannot be differentiated at many states at once.
    """
    found = _criteria(_curves(solution.model, _some(solution)), mode, stretch)
    stable = _from_reference(stretch - mode.reference, np.logical_and.reduce(found))
    shares = (each.mean(axis=0) for each in (*found, stable))
    return Stability(mode.name, stretch, *shares)


def stability_over(
    solution: Solution, mode: str | LoadingMode | None, stretch: ArrayLike | None, points: int
) -> Stability:
    """Return the stability at stretches, or at so many over the range that was measured; unless said in its own mode.

    Raises
    ------
    InputError, ModelError
        When the mode has several controls; and as `stability`.
    """
    data = solution.model.experiment
    own = [each for each in data.modes if len(each.controls) == len(each.stresses) == 1]
    asked = (own or [loading_mode("uniaxial")])[0] if mode is None else loading_mode(mode)
    if len(asked.controls) > 1:
        raise InputError(f"stability is told in modes of one control, and '{asked.name}' has several.")
    usual = np.linspace(*calibrated_range(data, asked), points)
    return stability(solution, asked, usual if stretch is None else np.atleast_1d(np.asarray(stretch, dtype=float)))


def stable_ranges(solution: Solution) -> dict[str, StableRange]:
    """Return for every mode of one stretch and one stress how far the draws are stable.

    Nothing where the material's energy does not tell. In the other modes the material passes through the same states,
    or through states between theirs.
    """
    found = {}
    for mode in (kind() for kind in loading_modes().values()):
        if not mode.is_curve:
            continue
        stretch = _measured(solution.model.experiment, mode)
        try:
            criteria = _criteria(_curves(solution.model, _some(solution)), mode, stretch)
        except ModelError:
            return {}
        stable = _from_reference(stretch - 1, np.logical_and.reduce(criteria))
        low, high = float(stretch[0]), float(stretch[-1])
        sure, below, above = _surely(stretch, stable), _loss(stretch, stable, -1), _loss(stretch, stable, 1)
        found[mode.name] = StableRange(mode.name, low, high, float(stable.all(axis=1).mean()), *sure, below, above)
    return found


def are_stable(model: StatisticalModel, points: Components, modes: Sequence[LoadingMode]) -> Flags:
    """Return whether draws (M,) are stable over the measured range of all of some loading modes.

    Parameters
    ----------
    model : StatisticalModel
    points : Components
        The draws, without width.
    modes : sequence of LoadingMode

    Raises
    ------
    ModelError
        As `stability` does.
    """
    return stable_draws(lambda left: _curves(model, points[left]), len(points.weights), model.experiment, modes)


def stable_draws(
    curves_of: Callable[[NDArray[np.intp]], Curves], count: int, data: Experiment, modes: Sequence[LoadingMode]
) -> Flags:
    """Return whether draws (count,) are stable over the range that data measured, of all of some loading modes.

    Parameters
    ----------
    curves_of : callable
        From places of M draws, the function of points (n,) and a mode that gives their stresses (M, n).
    count : int
    data : Experiment
    modes : sequence of LoadingMode
    """
    stable = np.ones(count, dtype=bool)
    paths = [(mode, _measured(data, mode)) for mode in modes]
    first, whole = paths[0]
    at_few = first, np.unique([whole[0], 1.0, whole[-1]])  # where most draws fail that do, at little cost
    for mode, stretch in (at_few, *paths):
        left = np.flatnonzero(stable)
        if len(left):
            stable[left] = np.logical_and.reduce(_criteria(curves_of(left), mode, stretch)).all(axis=1)
    return stable


def _measured(data: Experiment, mode: LoadingMode) -> FloatArray:
    """Return stretches of a mode on either side of the reference, and that, over the range that was measured."""
    return np.unique(np.concatenate([np.linspace(1.0, end, POINTS) for end in calibrated_range(data, mode)]))


def _some(solution: Solution) -> Components:
    """Return components of which one draw each stands for the posterior."""
    parts = solution.components
    return parts[systematic(parts.weights[None], DRAWS)[0]]


def _curves(model: StatisticalModel, parts: Components) -> Curves:
    """Return the function that gives the stresses (M, n) of one draw of every component at points of a mode."""
    if not model.material.is_isotropic:
        raise ModelError(
            f"the stability of material '{model.material.name}' is not known: the criteria are those of isotropic "
            "materials, and it has fibres."
        )

    def stresses(points: FloatArray, path: LoadingMode) -> FloatArray:
        usual = 20 * POINTS * len(model.column_symbols)  # the same blocks, and so the same draws, at any points
        count = MOST_VALUES // usual if model.bent_symbols else AT_ONCE
        blocks = np.array_split(np.arange(len(parts.weights)), -(-len(parts.weights) // max(1, count)))
        curves = [drawn_curves(model, parts[block], points, seed, path) for seed, block in enumerate(blocks)]
        return np.concatenate([alone + other for alone, other in curves])

    def explained(points: FloatArray, path: LoadingMode) -> FloatArray:
        try:
            return stresses(points, path)
        except TypeError as error:
            raise ModelError(
                f"the stability of material '{model.material.name}' is not known, because its energy is not plain "
                "arithmetic of arrays: write it without jax.numpy and branches."
            ) from error

    return explained


def _criteria(curves: Curves, mode: LoadingMode, stretch: FloatArray) -> tuple[Flags, Flags, Flags]:
    """Return whether Baker-Ericksen, Drucker and rising stress hold at stretches (g,) of a mode: (M, g) each."""
    base = np.array([np.broadcast_to(each, len(stretch)) for each in mode.principal_stretches(stretch)])
    nudges = [np.zeros(3), *(sign * STEP * each for each in DIRECTIONS for sign in (1, -1))]
    paths = [_Path(base * np.exp(nudge)[:, None], direction) for nudge in nudges for direction in DIRECTIONS]
    whole = _Path(np.hstack([path.base for path in paths]), np.hstack([path.rates(len(stretch)) for path in paths]))
    every = curves(np.ones(whole.base.shape[1]), whole)
    stress = every.reshape(len(every), 5, 2, len(stretch))
    own, tangent = stress[:, 0], (stress[:, 1::2] - stress[:, 2::2]) / (2 * STEP)
    change = stretch - mode.reference
    size = np.abs(np.trace(tangent[..., np.abs(change).argmin()], axis1=1, axis2=2))[:, None]
    differences = np.stack([own[:, 0], own[:, 1], own[:, 0] - own[:, 1]])
    apart = np.stack([base[0] - base[2], base[1] - base[2], base[0] - base[1]])
    baker = ((differences * np.sign(apart)[:, None] > -NEUTRAL * size) | (np.abs(apart)[:, None] < 1e-9)).all(axis=0)
    determinant = tangent[:, 0, 0] * tangent[:, 1, 1] - tangent[:, 0, 1] * tangent[:, 1, 0]
    drucker = (tangent[:, 0, 0] > 0) & (determinant > 0)
    near = np.concatenate([stretch - STEP, stretch + STEP])
    rising = np.diff(curves(near, mode).reshape(len(every), 2, -1), axis=1)[:, 0] > 0
    return baker, drucker, rising


def calibrated_range(data: Experiment, mode: LoadingMode) -> tuple[float, float]:
    """Return the stretches of a mode within which I1 and I2 stay in the range that was measured."""
    own = [part.mode.abscissa(part.stretch) for part in data.parts if part.mode == mode]
    if own:
        at_rest = float(mode.reference)
        return min(at_rest, *(float(each.min()) for each in own)), max(at_rest, *(float(each.max()) for each in own))
    most = [float(each.max()) for each in invariants(data.mode, data.stretch)]
    return farthest_stretch(mode, most, -1), farthest_stretch(mode, most, 1)


def is_calibrated(data: Experiment, mode: LoadingMode, points: FloatArray) -> Flags:
    """Return at which points of a mode, (g,) or (g, c), the invariants stay in the range that was measured.

    With one control that is `calibrated_range`.
    """
    if len(mode.controls) == 1:
        low, high = calibrated_range(data, mode)
        margin = 1e-9 * max(abs(low), abs(high))
        return np.asarray((low - margin <= points) & (points <= high + margin))
    pairs = zip(invariants(mode.channels[0], points), invariants(data.mode, data.stretch), strict=True)
    return np.asarray(np.logical_and.reduce([own <= known.max() * (1 + 1e-9) for own, known in pairs]))


def _from_reference(change: FloatArray, is_stable: Flags) -> Flags:
    """Return whether all is stable (M, g) from the reference to each change (g,) of the stretch."""
    found = np.empty_like(is_stable)
    for outward in (_outward(change, -1), _outward(change, 1)):
        found[:, outward] = np.logical_and.accumulate(is_stable[:, outward], axis=1)
    return found


def _outward(change: FloatArray, side: int) -> NDArray[np.intp]:
    """Return the places of the changes on one side of the reference, and of the reference, from there outward."""
    own = np.flatnonzero(side * change >= 0)
    return own[np.argsort(np.abs(change[own]))]


def _surely(stretch: FloatArray, stable: Flags) -> tuple[float, float]:
    """Return the stretches between which hardly any draw has lost its stability."""
    sure = stretch[stable.mean(axis=0) >= 1 - LOST]
    return float(sure.min(initial=1.0)), float(sure.max(initial=1.0))


def _loss(stretch: FloatArray, stable: Flags, side: int) -> Loss:
    """Return where the draws (M, g), stable from the reference to some stretch, lose stability on one side of it."""
    outward = _outward(stretch - 1, side)
    first = np.argmin(stable[:, outward], axis=1)[~stable[:, outward[-1]]]
    if len(outward) == 1 or not len(first):
        return Loss(0.0, np.nan, np.nan, np.nan)
    path = stretch[outward]
    places = 0.5 * (path[first] + path[np.maximum(first - 1, 0)])
    return Loss(len(first) / len(stable), *map(float, np.quantile(places, [0.5, 0.025, 0.975])))


class _Path(LoadingMode):
    """Deformations through given states: base * l^direction, state by state; its stress is the work per log strain."""

    def __init__(self, base: FloatArray, direction: FloatArray) -> None:
        object.__setattr__(self, "base", base)
        object.__setattr__(self, "direction", direction)

    base: FloatArray
    direction: FloatArray

    def rates(self, count: int) -> FloatArray:
        """Return the direction (3, count) at every state."""
        return np.repeat(self.direction[:, None], count, axis=1)

    def principal_stretches(self, stretch: Any) -> tuple[Any, Any, Any]:
        first, second, third = self.base * stretch**self.direction
        return first, second, third
