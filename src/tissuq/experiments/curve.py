"""A measured curve: one stress that a test measured, and its picture before any fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.drawing.panels import Panels, shortened, small_panels
from tissuq.drawing.pieces import points
from tissuq.drawing.style import BASE, inline_svg, relative_size
from tissuq.errors import InputError
from tissuq.experiments.branches import unloading
from tissuq.experiments.modes import LoadingMode, Path
from tissuq.experiments.modes.mode import values_of_control
from tissuq.experiments.units import stress_unit
from tissuq.result_warning import ResultWarning

MAX_WIDTH_OF_MEANS = 0.05
"""Of a control over its range, within half of the groups of measurements that are averaged, and between two."""
MAX_GROUPS_FACTOR = 2
"""Groups over those of measurements without jumps, beyond which measurements are not in order."""
MIN_ROWS = 200
"""Rows that a curve keeps at least where consecutive measurements are averaged."""
MOST_SMALL = 2
"""Curves of a notebook's figure at the most."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One stress that a test measured, and where.

    Parameters
    ----------
    mode : LoadingMode
        How the specimen was loaded.
    channel : int
        The number of the stress among those of the mode.
    points : (n,) or (n, c) array, dimensionless
        What the mode controls.
    stress : (n,) array, MPa
        Engineering stress.
    standard_error : (n,) array, MPa
        Of a stress that is the mean of several specimens; zero of one that is not.
    name, source, stress_unit, specimen : str
        Those of the test.
    least_errors : mapping of str to float
    direction, condition : str
        Those of the test.
    averaged : int
        Consecutive measurements, at most, of which each row is the mean; 1 where rows are single measurements.
    apart : int
        Rows of the file from one measurement to the next: more than 1 where every second, third ... was read.
    warnings : tuple of ResultWarning
        What is implausible in the file that the test was read from, or in its course.
    """

    mode: LoadingMode
    channel: int
    points: FloatArray
    stress: FloatArray
    standard_error: FloatArray
    name: str
    source: str
    stress_unit: str
    specimen: str
    least_errors: Mapping[str, float] = field(default_factory=dict)
    direction: str = ""
    condition: str = ""
    averaged: int = 1
    apart: int = 1
    warnings: tuple[ResultWarning, ...] = ()

    def __post_init__(self) -> None:
        for label in ("name", "source", "specimen", "direction", "condition"):
            if not isinstance(text := getattr(self, label), str):
                raise InputError(f"{label} must be a text, such as '{text}', not {text!r:.80}.")
        stress_unit(self.stress_unit)  # which refuses what is none

    def __len__(self) -> int:
        return len(self.stress)

    @property
    def path(self) -> Path:
        """What the stress does work along."""
        return self.mode.paths[self.channel]

    @property
    def abscissa(self) -> FloatArray:
        """The strain along which the stress acts, (n,)."""
        return np.asarray(self.path.abscissa(self.points))

    @cached_property
    def drawn_against(self) -> int:
        """The number of the control that the stress is drawn against: what it acts along, unless that is held."""
        return self.mode.drawn_against(self.channel, self.points)

    @property
    def drawn_name(self) -> str:
        """What an axis is called along which the stress is drawn."""
        return self.mode.controls[self.drawn_against].name

    def drawn_at(self, points: FloatArray | None = None) -> FloatArray:
        """Return where on that axis the stress at points (g,) or (g, c) of the mode stands, or at those measured."""
        return values_of_control(self.points if points is None else points, self.drawn_against)

    @property
    def is_back(self) -> BoolArray:
        """Which measurements (n,) are of unloading."""
        return unloading(self.points, self.mode.reference)

    @property
    def quantity(self) -> str:
        """What the mode calls the stress."""
        return self.mode.stresses[self.channel]

    def of_means(self, rows: int) -> Curve:
        """Return the curve as so many rows, about: `in_means_of` some measurements."""
        return self.in_means_of(self.averaged * -(-len(self) // max(rows, MIN_ROWS)))

    def in_means_of(self, measurements: int) -> Curve:
        """Return means of so many consecutive measurements, or of neighbours along the curve.

        Neighbours where consecutive measurements lie far apart, as repeated or shuffled ones do. Where these have
        several controls, and neighbours in one of them differ in others, all measurements are left.
        """
        count = measurements // self.averaged
        if count <= 1:
            return self
        controls = self.points.reshape(len(self), -1)
        order = np.arange(len(self))
        starts, width = _groups(controls, count)
        if width > MAX_WIDTH_OF_MEANS:
            order = np.lexsort(controls.T)
            starts, width = _groups(controls[order], count)
        if width > MAX_WIDTH_OF_MEANS:
            return self
        sizes = np.diff(np.append(starts, len(self)))
        points, stress, error = (
            (np.add.reduceat(values[order], starts, axis=0).T / sizes).T
            for values in (self.points, self.stress, self.standard_error)
        )
        return replace(self, points=points, stress=stress, standard_error=error, averaged=self.averaged * count)


def _groups(controls: FloatArray, count: int) -> tuple[IndexArray, float]:
    """Return where groups of so many rows (n, c) begin, anew at every jump, and how wide half of them are at the most.

    Jumps and widths are of the controls over their ranges, for these the largest of all controls.
    """
    reach = np.ptp(controls, axis=0)
    shares = controls / np.where(reach > 0, reach, 1.0)
    is_jump = np.append(True, (np.abs(np.diff(shares, axis=0)) > MAX_WIDTH_OF_MEANS).any(axis=1))
    rows = np.arange(len(controls))
    starts = np.flatnonzero((rows - np.maximum.accumulate(np.where(is_jump, rows, 0))) % count == 0)
    if len(starts) > MAX_GROUPS_FACTOR * len(controls) / count:
        return starts, np.inf
    widths = np.maximum.reduceat(shares, starts) - np.minimum.reduceat(shares, starts)
    return starts, float(np.median(widths.max(axis=1)))


def draw_curves(drawn: Panels, curves: Sequence[Curve], unit_name: str) -> None:
    """Draw every curve on a panel of its own, with its standard errors where there are any."""
    unit, size = stress_unit(unit_name), relative_size()
    for number, (axis, curve) in enumerate(zip(drawn.axes, curves, strict=True)):
        axis.axhline(0, color=BASE, lw=0.6 * size, zorder=0.5)
        axis.axvline(curve.mode.controls[curve.drawn_against].reference, color=BASE, lw=0.6 * size, zorder=0.5)
        error = curve.standard_error / unit.to_mpa
        points(axis, curve.drawn_at(), curve.stress / unit.to_mpa, error=error, label="measured",
               is_back=curve.is_back)  # fmt: skip
        axis.set_xlabel(curve.drawn_name)
        if number % drawn.columns == 0 or len(curve.mode.stresses) > 1:
            axis.set_ylabel(f"{curve.quantity} [{unit.name}]")
        if drawn.is_new:
            axis.set_title(shortened(curve.name, drawn.letters))


def small_svg(curves: Sequence[Curve], unit_name: str) -> str:
    """Return the first curves as a small SVG for a notebook."""
    with small_panels(min(len(curves), MOST_SMALL)) as (figure, drawn):
        draw_curves(drawn, curves[:MOST_SMALL], unit_name)
    return inline_svg(figure, "Measured stresses")
