"""The invariants of states of deformation and how they change along paths, without differentiating an energy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.experiments.modes import LoadingMode, States

LARGEST_STRETCH = 10.0
"""Stretch, or one over it, beyond which no range is followed."""
ROUNDING = 1e-9
"""Difference of strains, or share of the largest measured invariants, that is none."""


def invariants(states: States) -> tuple[FloatArray, FloatArray]:
    """Return I1 - 3 and I2 - 3, (n,) each; their digits near the reference are kept."""
    logs, _ = states.log_stretches
    return np.expm1(2 * logs).sum(axis=1), np.expm1(-2 * logs).sum(axis=1)


def invariant_rates(states: States) -> tuple[FloatArray, FloatArray]:
    """Return the engineering stresses (n,) of the energies I1 and I2."""
    logs, rates = states.log_stretches
    return (2 * np.exp(2 * logs) * rates).sum(axis=1), (-2 * np.exp(-2 * logs) * rates).sum(axis=1)


def largest_invariants(states: States) -> tuple[float, float]:
    """Return the largest I1 - 3 and I2 - 3 of states."""
    I1, I2 = invariants(states)
    return float(I1.max()), float(I2.max())


@dataclass(frozen=True)
class MeasuredStates:
    """The states up to which a material was measured.

    Attributes
    ----------
    I1, I2 : float
        Largest I1 - 3 and I2 - 3.
    strains : tuple of (float, float)
        Smallest and largest C11 - 1, and C22 - 1, along the axes of the test of a material with fibres, whose stretches
        lie between those along the axes. None of an isotropic material.
    """

    I1: float
    I2: float
    strains: tuple[tuple[float, float], ...] = ()

    @classmethod
    def of(cls, states: States, *, is_isotropic: bool = True) -> MeasuredStates:
        """Return those up to the largest of states, and the reference."""
        columns = () if is_isotropic else states.axis_strains[0].T
        ends = ((min(0.0, float(column.min())), max(0.0, float(column.max()))) for column in columns)
        return cls(*largest_invariants(states), tuple(ends))

    def times(self, factor: float) -> MeasuredStates:
        """Return those up to so many times I1 - 3 and I2 - 3, which small strains enter squared."""
        strains = tuple((factor**0.5 * low, factor**0.5 * high) for low, high in self.strains)
        return MeasuredStates(factor * self.I1, factor * self.I2, strains)

    def contain(self, states: States, rounding: float = ROUNDING) -> BoolArray:
        """Return which states (n,) are among them, where invariants may be larger by such a share."""
        reached_I1, reached_I2 = invariants(states)
        inside = (reached_I1 <= self.I1 * (1 + rounding)) & (reached_I2 <= self.I2 * (1 + rounding))
        if self.strains:
            low, high = np.array(self.strains).T
            strains = states.axis_strains[0]
            inside &= ((low - ROUNDING <= strains) & (strains <= high + ROUNDING)).all(axis=1)
        return np.asarray(inside)


@lru_cache(maxsize=256)
def farthest_stretch(mode: LoadingMode, measured: MeasuredStates, sign: int) -> float:
    """Return the stretch of a mode, above (sign 1) or below (-1) its rest, up to which states were measured."""
    (control,) = mode.controls
    farthest = LARGEST_STRETCH - 1
    low, high = 0.0, farthest if sign > 0 else min(farthest, control.reference - control.above)
    for _ in range(60):
        middle = 0.5 * (low + high)
        states = mode.paths[0].at(mode.excursion([sign * middle]))  # the same on every path
        low, high = (middle, high) if measured.contain(states, rounding=0.0)[0] else (low, middle)
    return float(mode.excursion(sign * low))
