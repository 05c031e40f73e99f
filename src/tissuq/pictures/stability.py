"""The picture of stability: how probable it is at every stretch of every loading mode."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tissuq.assessment.stability import MIN_LOSS_PROBABILITY, StableRange, stability_over
from tissuq.drawing.panels import Panels
from tissuq.drawing.pieces import line
from tissuq.drawing.style import BASE, SERIES, UNSTABLE, relative_size
from tissuq.experiments.modes.mode import curve_modes
from tissuq.inference.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 61
"""Stretches of a mode."""
LEAST_SHOWN = 80.0
"""Percent from which the axis begins, or lower."""
STYLES = ("-", "--", "-.", ":")


def stability(solution: Solution, drawn: Panels) -> None:
    """Draw the probability that the material is stable from the reference up to every stretch, a line a mode."""
    (axis,) = drawn.axes
    sure = 100 * (1 - MIN_LOSS_PROBABILITY)
    axis.axhline(sure, color=BASE, lw=0.8 * relative_size(), ls=":", zorder=0.5,
                 label=f"{sure:g} %, from where it counts as stable")  # fmt: skip
    lowest = 100.0
    for number, mode in enumerate(curve_modes()):
        curve = stability_over(solution, mode, None, POINTS)
        line(axis, curve.stretch, 100 * curve.stable, color=SERIES[number % len(SERIES)], label=mode.name,
             style=STYLES[number % len(STYLES)], width=2.4 - 0.4 * (number % len(STYLES)))  # fmt: skip
        lowest = min(lowest, 100 * float(curve.stable.min()))
    lowest = min(lowest, LEAST_SHOWN)
    axis.set_ylim(lowest - 0.04 * (100 - lowest), 100 + 0.06 * (100 - lowest))
    axis.set_xlabel("stretch")
    axis.set_ylabel("probability of stability [%]")
    drawn.explain()


def shade_instability(axis: Axes, stable_range: StableRange | None, low: float, high: float) -> None:
    """Shade the stretches between two ends at which stability has been lost with a probability above 5 %."""
    if stable_range is None:
        return
    label, size = f"stability lost (probability > {100 * MIN_LOSS_PROBABILITY:.0f} %)", relative_size()
    for sure, end in ((stable_range.surely_low, stable_range.low), (stable_range.surely_high, stable_range.high)):
        start, stop = min(max(sure, low), high), min(max(end, low), high)
        if start != stop:
            axis.axvspan(start, stop, facecolor=UNSTABLE, alpha=0.16, lw=0, zorder=0, label=label)
            axis.axvline(start, color=UNSTABLE, lw=1.2 * size, ls="-.", zorder=0.5, label="where that begins")
