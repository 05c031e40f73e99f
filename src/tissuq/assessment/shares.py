"""Which share of the stress and of the initial stiffness the discrepancy carries."""

from __future__ import annotations

from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import States
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Solution
from tissuq.prediction.moments import drawn_curves

Share: TypeAlias = tuple[float, float, float]
"""Mean, and ends of the 95 % interval."""

SHARE_DRAWS = 2000
MAX_SHARE_POINTS = 60
"""Largest number of measured stretches over which the share is averaged."""
STRETCH_STEP = 1e-4
"""Step of the stretch for the initial slope."""

_SHARES: WeakKeyDictionary[Solution, tuple[Share, Share]] = WeakKeyDictionary()


def shares_of_discrepancy(solution: Solution) -> tuple[Share, Share]:
    """Return the discrepancy's share of the stress and of the initial stiffness: means and ends of 95 % intervals.

    A discrepancy of the stress is another in each of several tests: of these, the test in which its mean share of the
    initial stiffness is largest counts. Remembered as long as the posterior is there, as answers, assessments and
    populations ask for them.
    """
    if solution not in _SHARES:
        _SHARES[solution] = _computed(solution)
    return _SHARES[solution]


def _computed(solution: Solution) -> tuple[Share, Share]:
    experiment, components = solution.model.experiment, solution.mixture
    measured = _even(experiment.states)
    beside_rest = [
        experiment.states_of(test.curves[0], test.curves[0].mode.excursion([-STRETCH_STEP, STRETCH_STEP]))
        for test in experiment.tests
    ]
    material_stress, discrepancy_stress = drawn_curves(
        solution.model,
        components[systematic(components.weights[None], SHARE_DRAWS)[0]],
        States.joined([measured, *beside_rest]),
    )
    count = len(measured)
    size = np.sqrt(
        (discrepancy_stress[:, :count] ** 2).mean(axis=1)
        / ((material_stress + discrepancy_stress)[:, :count] ** 2).mean(axis=1)
    )
    slopes, material_slopes = (
        curve[:, count + 1 :: 2] - curve[:, count::2] for curve in (discrepancy_stress, material_stress)
    )
    shares = map(_mean_and_ends, (slopes / (slopes + material_slopes)).T)
    return _mean_and_ends(size), max(shares, key=lambda share: abs(share[0]))


def _even(states: States) -> States:
    """Return few states that stand for all different ones."""
    different = []
    for path, points in zip(states.paths, states.points, strict=True):
        unique = np.unique(points, axis=0)
        different.append(unique[np.argsort(path.abscissa(unique), kind="stable")])
    ends = np.cumsum([len(points) for points in different])
    indices = np.linspace(0, ends[-1] - 1, min(int(ends[-1]), MAX_SHARE_POINTS)).astype(int)
    starts = ends - [len(points) for points in different]
    points = [
        unique[indices[(start <= indices) & (indices < end)] - start]
        for unique, start, end in zip(different, starts, ends, strict=True)
    ]
    return States(states.paths, tuple(points), states.curves)


def _mean_and_ends(values: FloatArray) -> Share:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(values.mean()), float(low), float(high)
