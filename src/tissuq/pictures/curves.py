"""What a posterior says of a measured curve: bands of measurements, of the stress and of the material alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.experiments.curve import Curve
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.tube import SAME_STRETCH, rows_at_each_stretch
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Solution
from tissuq.inference.threads import one_thread
from tissuq.parameters.checks import check_probability
from tissuq.prediction.bands import Band, inside_band, predict_bands
from tissuq.prediction.moments import drawn_curves
from tissuq.prediction.scores import root_mean_square

POINTS, SHARE_POINTS, SHARE_DRAWS = 101, 41, 800
"""Points of a band and of a share along a curve, and draws of the latter."""
RETURN, JUMP, MOST_WAYS = 0.3, 5.0, 7
"""Decrease of the deformation, or step, at which a new path begins, over its largest change; such a step over others;
and the most paths of a picture."""
NEARLY = 0.02
"""Changes of a control that do not count, over its range."""
NO_STRESS = 0.02
"""Stress over the largest one of a curve, below which there is no share of it."""


class Way(NamedTuple):
    """Indices of points in the order of what they are drawn against, and whether as a curve or by themselves."""

    indices: IndexArray
    is_curve: bool


@dataclass(frozen=True, eq=False)
class Described:
    """A measured curve and what a posterior says of it, MPa: every band is computed when it is first asked for.

    Attributes
    ----------
    solution : Solution
    curve : Curve
    prob : float
        Probability of the bands, equal tails.
    known_inside : (n,) array of bool, optional
        What `inside` is, where it has been computed.
    """

    solution: Solution
    curve: Curve
    prob: float = 0.95
    known_inside: BoolArray | None = None

    @cached_property
    def points(self) -> FloatArray:
        """The points of the bands: over the range of the curve, or its own where the test has several controls."""
        return points_along(self.curve, POINTS)

    @property
    def abscissa(self) -> FloatArray:
        """What the stress at these points is drawn against, (g,)."""
        return self.curve.drawn_at(self.points)

    @property
    def measurements(self) -> Band:
        """Of new measurements, with the discrepancy."""
        return self._joint[0]

    @property
    def stress(self) -> Band:
        """Of the stress itself, with the discrepancy."""
        return self._joint[1]

    @property
    def measurements_alone(self) -> Band:
        """Of new measurements of the material alone."""
        return self._alone[0]

    @property
    def stress_alone(self) -> Band:
        """Of the stress of the material alone."""
        return self._alone[1]

    @cached_property
    def ways(self) -> list[Way]:
        """The paths that the points of the bands follow."""
        return ways_of(self.curve.mode, self.points, self.abscissa)

    @cached_property
    def measured_rows(self) -> list[IndexArray]:
        """The measurements of each of `ways`."""
        if held := rows_where_held(self.curve.mode, self.curve.points):
            return held
        if len(self.ways) == 1:
            return [np.argsort(self.curve.drawn_at(), kind="stable")]
        return [way.indices for way in self.ways]

    @cached_property
    def inside(self) -> BoolArray:
        """Which measurements are inside the band of new ones, with the discrepancy."""
        if self.known_inside is not None:
            return self.known_inside
        return inside_band(self.solution, self.curve, discrepancy=True, prob=self.prob)

    @cached_property
    def _joint(self) -> list[Band]:
        return self._bands(True)

    @cached_property
    def _alone(self) -> list[Band]:
        return self._bands(False) if has_discrepancy(self.solution) else self._joint

    def _bands(self, discrepancy: bool) -> list[Band]:
        options: dict[str, Any] = {"prob": self.prob, "curve": self.curve}
        return predict_bands([(1.0, self.solution)], self.points, (True, False), discrepancy=discrepancy, **options)


def described(
    solution: Solution, prob: float = 0.95, inside: Sequence[BoolArray | None] | None = None
) -> list[Described]:
    """Return what a posterior says of every measured curve, of which it may be known what is inside its band."""
    check_probability(prob)
    curves = solution.model.experiment.curves
    pairs = zip(curves, inside or [None] * len(curves), strict=True)
    return [Described(solution, curve, prob, is_inside) for curve, is_inside in pairs]


def has_discrepancy(solution: Solution) -> bool:
    """Return whether there is a discrepancy, without which the material alone is all."""
    return bool(solution.model.discrepancy.parameters)


def is_determined(material: Band, stress: Band) -> bool:
    """Return whether the stress of the material alone is known at all: to no less than all stress beside it."""
    return root_mean_square(material.high - material.low) / 2 <= root_mean_square(stress.median)


def ways_of(mode: LoadingMode, points: FloatArray, abscissa: FloatArray) -> list[Way]:
    """Return the paths that points (g,) or (g, c) of a mode follow: a new one begins where a test goes back or jumps.

    Points of a tube that was inflated at several axial stretches follow one at each of them. Each path is in the order
    of what it is drawn against. Where nothing changes along that, or there are many, it is no curve.
    """
    if points.ndim == 1:
        return [Way(np.argsort(abscissa, kind="stable"), True)]
    size, steps = np.linalg.norm(points - mode.reference, axis=1), np.linalg.norm(np.diff(points, axis=0), axis=1)
    jump = max(RETURN * float(np.linalg.norm(np.ptp(points, axis=0))), JUMP * float(np.median(steps)))
    starts = 1 + np.flatnonzero((np.diff(size) < -RETURN * np.ptp(size)) | (steps > jump))
    if held := rows_where_held(mode, points):
        return [Way(rows[np.argsort(abscissa[rows], kind="stable")], True) for rows in held]
    branches = np.split(np.arange(len(points)), starts)
    nearly, smallest_change = NEARLY * np.ptp(points, axis=0), NEARLY * np.ptp(abscissa)
    ways = []
    for branch in branches:
        order = branch[np.argsort(abscissa[branch], kind="stable")]
        control_changes, along = np.diff(points[order], axis=0), np.diff(abscissa[order])
        is_one = ((control_changes >= -nearly).all(axis=0) | (control_changes <= nearly).all(axis=0)).all() and (
            along > 0
        ).all()
        is_held = along.sum() <= smallest_change
        if len(branches) > MOST_WAYS or not (is_one or is_held):
            return [Way(np.argsort(abscissa, kind="stable"), False)]
        ways.append(Way(order, not is_held))
    return ways


def rows_where_held(mode: LoadingMode, points: FloatArray) -> list[IndexArray]:
    """Return the rows at each value of the second control of a mode with one stress, along the first one.

    Nothing of other modes, and where it is held at no few values.
    """
    if not (len(mode.stresses) == 1 and len(mode.controls) == 2):
        return []
    column = points[:, 1]
    groups = rows_at_each_stretch(column)
    are_held = all(np.ptp(column[rows]) <= 2 * SAME_STRETCH for rows in groups)
    return groups if are_held and len(groups) <= MOST_WAYS else []


def held_along(mode: LoadingMode, points: FloatArray) -> str:
    """Return at which value one of several controls is held along a path, in words; nothing where none is."""
    pairs = zip(mode.controls, np.transpose(points), strict=True) if points.ndim > 1 else ()
    held = (f"{control.name} {column.mean():.4g}" for control, column in pairs if np.ptp(column) <= 2 * SAME_STRETCH)
    return next(held, "")


def points_along(curve: Curve, count: int) -> FloatArray:
    """Return points over the range of a curve, at each axial stretch of a tube, or its own for other controls."""
    points = curve.points
    if held := rows_where_held(curve.mode, points):
        ends = [(points[rows, 0].min(), points[rows, 0].max(), points[rows, 1].mean()) for rows in held]
        lines = [np.column_stack([np.linspace(low, high, count), np.full(count, at)]) for low, high, at in ends]
        return np.concatenate(lines)
    return points if points.ndim > 1 else np.linspace(points.min(), points.max(), count)


def share_along(solution: Solution, curve: Curve, prob: float = 0.95) -> tuple[list[Way], FloatArray, FloatArray]:
    """Return the share of a curve's stress that the discrepancy carries: low, median and high (3, g).

    After the paths of the points and what they are drawn against (g,).

    Of the stress itself: scatter from point to point is left out. Not known (nan) where there is next to no stress.
    """
    model = solution.model
    points = points_along(curve, SHARE_POINTS)
    states = model.experiment.states_of(curve, points)
    components = solution.mixture[systematic(solution.mixture.weights[None], SHARE_DRAWS)[0]]
    with one_thread():
        material, discrepancy = drawn_curves(model, components, states)
    total = material + discrepancy
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.quantile(discrepancy / total, [0.5 * (1 - prob), 0.5, 0.5 * (1 + prob)], axis=0)
    size = np.abs(np.median(total, axis=0))
    share[:, size <= NO_STRESS * size.max()] = np.nan
    abscissa = curve.drawn_at(points)
    return ways_of(curve.mode, points, abscissa), abscissa, share
