"""Whether a fitted material is stable, draw by draw: Baker-Ericksen, Drucker, and a stress that rises with stretch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_modes
from tissuq.inference.resampling import systematic
from tissuq.inference.solution import Solution
from tissuq.mechanics.complex_step import MOST_VALUES
from tissuq.mechanics.path import invariants
from tissuq.prediction.moments import drawn_curves

__all__ = ["Stability", "calibrated_range", "probability_of_stability", "stability"]

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]

DRAWS, POINTS = 500, 21
STEP = 1e-4
"""Of the logarithmic strains, for the tangent."""
LARGEST_CHANGE = 9.0
"""Of a stretch or an amount of shear, where the invariants that were measured do not end before."""
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
    everywhere : float
        All three hold at all stretches.
    """

    mode: str
    stretch: FloatArray
    baker_ericksen: FloatArray
    drucker: FloatArray
    rising: FloatArray
    stable: FloatArray
    everywhere: float


def stability(solution: Solution, mode: LoadingMode, stretch: FloatArray) -> Stability:
    """Return how probable stability is at stretches (g,) of a loading mode, for material and energy discrepancy.

    A discrepancy that is no energy has no part in it.

    Raises
    ------
    ModelError
        When the material's energy cannot be differentiated at many states at once.
    """
    model, parts = solution.model, solution.components
    parts = parts[systematic(parts.weights[None], DRAWS)[0]]
    count = MOST_VALUES // (10 * len(stretch) * len(model.column_symbols)) if model.bent_symbols else DRAWS
    blocks = [parts[block] for block in np.array_split(np.arange(DRAWS), -(-DRAWS // max(1, count)))]

    def drawn(points: FloatArray, path: LoadingMode) -> FloatArray:
        curves = [drawn_curves(model, block, points, seed, path) for seed, block in enumerate(blocks)]
        return np.concatenate([alone + other for alone, other in curves])

    base = np.array([np.broadcast_to(each, len(stretch)) for each in mode.principal_stretches(stretch)])
    nudges = [np.zeros(3), *(sign * STEP * each for each in DIRECTIONS for sign in (1, -1))]
    paths = [_Path(base * np.exp(nudge)[:, None], direction) for nudge in nudges for direction in DIRECTIONS]
    whole = _Path(np.hstack([path.base for path in paths]), np.hstack([path.rates(len(stretch)) for path in paths]))
    try:
        stress = drawn(np.ones(whole.base.shape[1]), whole).reshape(DRAWS, 5, 2, len(stretch))
    except TypeError as error:
        raise ModelError(
            f"the stability of material '{model.material.name}' is not known, because its energy is not plain "
            "arithmetic of arrays: write it without jax.numpy and branches."
        ) from error
    own, tangent = stress[:, 0], (stress[:, 1::2] - stress[:, 2::2]) / (2 * STEP)
    change = stretch - mode.reference
    size = np.abs(np.trace(tangent[..., np.abs(change).argmin()], axis1=1, axis2=2))[:, None]
    differences = np.stack([own[:, 0], own[:, 1], own[:, 0] - own[:, 1]])
    apart = np.stack([base[0] - base[2], base[1] - base[2], base[0] - base[1]])
    baker = ((differences * np.sign(apart)[:, None] > -NEUTRAL * size) | (np.abs(apart)[:, None] < 1e-9)).all(axis=0)
    determinant = tangent[:, 0, 0] * tangent[:, 1, 1] - tangent[:, 0, 1] * tangent[:, 1, 0]
    drucker = (tangent[:, 0, 0] > 0) & (determinant > 0)
    near = np.concatenate([stretch - STEP, stretch + STEP])
    rising = np.diff(drawn(near, mode).reshape(DRAWS, 2, -1), axis=1)[:, 0] > 0
    stable = _from_reference(change, baker & drucker & rising)
    first, second, third, all_three = (each.mean(axis=0) for each in (baker, drucker, rising, stable))
    return Stability(mode.name, stretch, first, second, third, all_three, float(stable.all(axis=1).mean()))


def calibrated_range(data: Experiment, mode: LoadingMode) -> tuple[float, float]:
    """Return the stretches of a mode within which I1 and I2 stay in the range that was measured."""
    most = [float(each.max()) for each in invariants(data.mode, data.stretch)]
    if mode == data.mode:
        at_rest = float(mode.reference)
        return min(at_rest, float(data.stretch.min())), max(at_rest, float(data.stretch.max()))
    return _end(mode, most, -1), _end(mode, most, 1)


def probability_of_stability(solution: Solution) -> dict[str, float]:
    """Return for every mode of one stretch and one stress the share of draws stable over the range that was measured.

    In the other modes the material passes through the same states, or through states between theirs.
    """
    found = {}
    for mode in (kind() for kind in loading_modes().values()):
        if not mode.is_curve:
            continue
        ends = calibrated_range(solution.model.experiment, mode)
        result = stability(solution, mode, np.linspace(*ends, POINTS))
        found[mode.name] = float(result.everywhere)
    return found


def _end(mode: LoadingMode, most: Sequence[float], sign: int) -> float:
    (control,) = mode.controls
    low, high = 0.0, LARGEST_CHANGE if sign > 0 else min(LARGEST_CHANGE, control.reference - control.above)
    for _ in range(50):
        middle = 0.5 * (low + high)
        is_inside = all(
            each[0] <= limit
            for each, limit in zip(invariants(mode, mode.excursion([sign * middle])), most, strict=True)
        )
        low, high = (middle, high) if is_inside else (low, middle)
    return float(mode.excursion(sign * low))


def _from_reference(change: FloatArray, is_stable: Flags) -> Flags:
    """Return whether all is stable (M, g) from the reference to each change (g,) of the stretch."""
    found = np.empty_like(is_stable)
    for side in (np.flatnonzero(change >= 0), np.flatnonzero(change < 0)):
        outward = side[np.argsort(np.abs(change[side]))]
        found[:, outward] = np.logical_and.accumulate(is_stable[:, outward], axis=1)
    return found


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
