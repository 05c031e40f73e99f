"""The picture of a population: every specimen by itself and within the population, and where a new one may be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.drawing.panels import Panels, limits_of
from tissuq.drawing.pieces import forest
from tissuq.drawing.style import BAND, BASE, INK, TRUTH, relative_size

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

ALONE = "#b8b8b8"
ENDS = ("hdi_low", "hdi_high")
COLUMNS = [f"{prefix}{name}" for prefix in ("", "alone_") for name in ("median", *ENDS)]
FENCE = 3.0
"""Quartile ranges beyond the quartiles of the medians from which a specimen need not be within the axis."""
DECADES = 300.0
"""Ratio of the ends of a logarithmic axis from which it has a number a decade."""
FAR_APART = 4.0
"""Ratio of the quartiles of the medians from which the axis is logarithmic."""
SMALL_MARKS_ABOVE = 25
"""Number of specimens above which names and marks are smaller."""


def draw_specimens(
    drawn: Panels,
    summary: pd.DataFrame,
    specimen_summary: pd.DataFrame,
    units: Mapping[str, str],
    whose: tuple[str, str] = ("", ""),
) -> None:
    """Draw a caterpillar plot, a panel a parameter: specimens alone and within the population, in the same order.

    The tables are those of a `Population`, in the unit of each parameter; ``whose`` says of whom the new specimen and
    the median are, as `patient_in_words` does.
    """
    quantities, specimens = numbers_of(summary), numbers_of(specimen_summary)
    names, first_symbol = dict.fromkeys(name for name, _ in specimens), next(iter(units))
    order = sorted(names, key=lambda name: specimens[name, first_symbol]["median"])
    small, size = len(order) > SMALL_MARKS_ABOVE, relative_size()
    for number, (panel, (symbol, unit)) in enumerate(zip(drawn.axes, units.items(), strict=True)):
        estimates = {key: np.array([specimens[name, symbol][key] for name in order]) for key in COLUMNS}
        new, median, complete = (
            [quantities[symbol, name][end] for end in ENDS] for name in ("new specimen", "median", "complete pooling")
        )
        panel.axvspan(*new, color=BAND, alpha=0.10, lw=0, label=f"a new specimen{whose[0]}, 95 %")
        panel.axvspan(*median, color=BAND, alpha=0.28, lw=0, label=f"median of the population{whose[1]}, 95 %")
        words = "complete pooling (all as one specimen)"
        panel.hlines(-0.55, complete[0], complete[1], color=TRUTH, lw=4 * size, label=words)
        pooled = quantities[symbol, "complete pooling"]["median"]
        panel.plot([pooled], [-0.55], "D", color=TRUTH, ms=4 * size)  # seen however narrow it is
        _draw_specimens(panel, estimates, small)
        _set_axis(panel, estimates, np.array([*new, *median, *complete]))
        bottom = _say_what_is_outside(panel, estimates, new, height_of_row(small))
        panel.set_xlabel(f"{symbol} [{unit}]" if unit else symbol)
        labels = order if number % drawn.columns == 0 else [""] * len(order)
        panel.set_yticks(range(len(order)), labels, fontsize=(6.5 if small else 9) * size)
        panel.tick_params(axis="y", length=0)
        panel.set_ylim(bottom, len(order) - 0.2)
    drawn.explain(2)


def height_of(count: int, letters: float = 1.0) -> float:
    """Return the height of a panel of so many specimens, inches, for letters of a size over the usual one."""
    return letters * (1.2 + height_of_row(count > SMALL_MARKS_ABOVE) * count)


def height_of_row(small: bool) -> float:
    """Return the height of a specimen in a panel, inches."""
    return 0.15 if small else 0.27


def numbers_of(table: pd.DataFrame) -> dict[Any, dict[str, float]]:
    """Return the rows of a table by what they are indexed by."""
    return {index: {str(name): float(value) for name, value in row.items()} for index, row in table.T.to_dict().items()}


def _set_axis(axis: Axes, estimates: Mapping[str, FloatArray], bands: FloatArray) -> None:
    """Set an axis for the specimens, logarithmic where they, all positive, differ by orders of magnitude."""
    from matplotlib.ticker import LogLocator

    lower, upper = np.quantile(estimates["median"], [0.25, 0.75])
    if min(bands.min(), *(values.min() for values in estimates.values())) > 0 and upper > FAR_APART * lower:
        low, high = np.exp(_limits({name: np.log(values) for name, values in estimates.items()}, np.log(bands)))
        axis.set_xscale("log", subs=[])
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0,) if high / low > DECADES else (1.0, 2.0, 5.0)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.set_xlim(low, high)
    else:
        axis.set_xlim(*_limits(estimates, bands))
        axis.locator_params(axis="x", nbins=6)


def _limits(estimates: Mapping[str, FloatArray], bands: FloatArray) -> tuple[float, float]:
    """Return the ends of an axis for specimens not far from the rest, and a usual interval; others may run out."""
    lower, upper = np.quantile(estimates["median"], [0.25, 0.75])
    reach = FENCE * (upper - lower)
    near = (estimates["median"] >= lower - reach) & (estimates["median"] <= upper + reach)
    ends = [estimates[f"{prefix}{end}"][near] for prefix in ("", "alone_") for end in ENDS]
    return limits_of([estimates["median"][near], *map(np.median, ends)], [*ends, bands], margin=1.0)


def _say_what_is_outside(axis: Axes, estimates: Mapping[str, FloatArray], new: list[float], row: float) -> float:
    """Mark specimens whose median lies beyond the axis, and say where; and how far the range of new ones goes on.

    Return where the panel ends: beneath complete pooling, and what is said beneath that. ``row`` is the height of a
    specimen, inches.
    """
    low, high = axis.get_xlim()
    looks: dict[str, Any] = {"transform": axis.get_yaxis_transform(), "color": INK}
    words: dict[str, Any] = looks | {"fontsize": "small", "va": "center"}
    for level, (median, start, end) in enumerate(zip(*(estimates[name] for name in ("median", *ENDS)), strict=True)):
        if not low <= median <= high:
            mark, side, position, inward = (
                (">", "right", 0.985, -0.025) if median > high else ("<", "left", 0.015, 0.025)
            )
            axis.plot([position], [level], mark, ms=4 * relative_size(), **looks)
            axis.text(position + inward, level, f"{median:.3g} [{start:.3g}, {end:.3g}]", ha=side, **words)
    cut_ends = [f"{word} {end:.3g}" for word, end, is_beyond in zip(
        ("from", "to"), new, (new[0] < low, new[1] > high), strict=True) if is_beyond]  # fmt: skip
    if not cut_ends:
        return -0.8
    beneath = -0.55 - 0.13 / row
    axis.text(0.985, beneath, f"a new specimen: {' '.join(cut_ends)}", ha="right", **words)
    return beneath - 0.09 / row


def _draw_specimens(axis: Axes, estimates: Mapping[str, FloatArray], small: bool) -> None:
    heights = np.arange(len(estimates["median"]))
    gap, width, size = (0.18, 1.6, 4.0) if small else (0.16, 2.6, 8.0)
    for prefix, side, color, dot, label in (
        ("alone_", gap, ALONE, BASE, "specimen by itself, 95 % interval"),
        ("", -gap, BAND, INK, "within the population, 95 % interval"),
    ):
        low, middle, high = (estimates[f"{prefix}{name}"] for name in ("hdi_low", "median", "hdi_high"))
        forest(axis, heights + side, low, middle, high, color=color, width=width, mark="|", size=size,
               mark_color=dot, label=label)  # fmt: skip
