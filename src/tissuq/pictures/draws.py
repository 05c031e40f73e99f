"""The picture of draws: a thin line for the stress of each, and their median."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.drawing.panels import Panels, limits_of, within
from tissuq.drawing.pieces import line
from tissuq.drawing.style import BAND, BASE
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit

__all__ = ["curves"]

FloatArray = NDArray[np.float64]

MOST_DRAWN = 200
"""Draws with a line of their own; of more some are drawn, evenly through the ensemble."""


def curves(drawn: Panels, stretch: FloatArray, stress: FloatArray, mode: LoadingMode, unit: StressUnit) -> None:
    """Draw the stresses (N, g), MPa, of draws at stretches (g,), and their median."""
    (axis,), count = drawn.axes, len(stress)
    order = np.argsort(stretch, kind="stable")
    abscissa, values = stretch[order], stress[:, order] / unit.to_mpa
    median = np.median(values, axis=0)
    limits = limits_of([median], [np.quantile(values, [0.005, 0.995], axis=0)])
    indices = np.linspace(0, count - 1, min(count, MOST_DRAWN)).round().astype(int)
    label = f"{count} draws" if len(indices) == count else f"{len(indices)} of {count} draws"
    for number, row in enumerate(values[indices]):
        line(axis, abscissa, within(row, limits), color=BASE, width=0.6, alpha=0.5, label="" if number else label)
    line(axis, abscissa, median, color=BAND, label="median of the draws")
    axis.set_ylim(limits)
    axis.set_xlabel(mode.controls[0].name)
    axis.set_ylabel(f"{mode.stresses[0]} [{unit.name}]")
    if drawn.is_new:
        axis.set_title(mode.name)
    drawn.explain()
