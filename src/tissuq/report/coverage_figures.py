"""Figures of a campaign: coverage and its price, by family, by strength, and in unseen loading modes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing import pieces
from tissuq.drawing.panels import legend_above
from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, MARKERS, SERIES, TRUTH, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CELL = ["design", "strength", "noise"]
BAR_HALF_WIDTH = 1.96
"""Half width of an error bar in Monte Carlo standard errors (95 %)."""
GAP = 0.17
"""Distance of the marks of two series in one row."""
WIDE_ROW = 3
"""Panels in a row from which the figure keeps its width."""


def coverage_figure(summary: pd.DataFrame, prob: float) -> Figure:
    """Return coverage and price of the formulations, over the strength of the model's error where this is a series."""
    return (_of_strength if summary["strength"].nunique() > 1 else _overview)(summary, prob)


def shares_figure(table: pd.DataFrame, column: str, nominal: float, label: str) -> Figure:
    """Return shares by formulation, a mark for each row of a table, for the head of a page; ``nominal`` in percent."""
    names = list(dict.fromkeys(table["formulation"]))
    with new_figure(ANSWER_WIDTH, 1.0 + 0.3 * len(names)) as figure:
        axis = figure.subplots()
        dots_by_row(axis, names, {"": (table["formulation"], 100 * table[column], None)}, nominal)
        axis.set_xlim(-2, 102)
        axis.set_xlabel(label)
    return figure


def _overview(summary: pd.DataFrame, prob: float) -> Figure:
    """Draw coverage and price of every formulation, a row of panels a design and noise.

    Where there is one formulation only, designs take the place of formulations.
    """
    measures = ["coverage", "price", *(["predictive"] if "predictive" in summary else [])]
    if summary["formulation"].nunique() == 1:
        panels = [(str(summary["formulation"].iloc[0]), _labels(summary), summary)]
    else:
        panels = [(_labels(rows)[0], list(rows["formulation"]), rows) for _, rows in summary.groupby(CELL, sort=False)]
    tall = max(len(labels) for _, labels, _ in panels)
    with panel_grid(len(panels), len(measures), 0.75 + 0.24 * tall) as (figure, axes):
        for row, (title, labels, table) in zip(axes, panels, strict=True):
            heights = list(range(len(labels)))[::-1]
            for axis, measure in zip(row, measures, strict=True):
                _dots(axis, table, measure, heights, prob)
                axis.set_yticks(heights, labels if axis is row[0] else [""] * len(labels))
                axis.set_ylim(-0.7, len(labels) - 0.3)
            row[0].set_title(title)
        texts = {
            "coverage": f"{100 * prob:g} % intervals that hold the true C10 [%]",
            "price": "mean score ●, median width ○; oracle's width = 1",
            "predictive": f"new measurements in the {100 * prob:g} % band [%]",
        }
        for axis, measure in zip(axes[-1], measures, strict=True):
            axis.set_xlabel(texts[measure])
    return figure


def _dots(axis: Axes, table: pd.DataFrame, measure: str, heights: list[int], prob: float) -> None:
    factor = 1.0 if measure == "price" else 100.0
    axis.axvline(1.0 if measure == "price" else 100 * prob, color=BASE, linewidth=1)
    error: Any = BAR_HALF_WIDTH * factor * table[f"{measure}_error"]
    if measure == "price":
        axis.plot(table["width"], heights, "o", markersize=5, markerfacecolor="white", color=BAND)
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.xaxis.set_minor_formatter("")
        error = np.minimum(error, 0.9 * table["price"])
    else:
        axis.set_xlim(-2, 102)
    axis.errorbar(factor * table[measure], heights, xerr=error, fmt="o", markersize=4, color=BAND)


def family_figure(families: pd.DataFrame, prob: float) -> Figure:
    """Draw coverage by family as a table of colours, a panel a formulation and a column a design.

    Where there is one design only, formulations take the place of designs.
    """
    from matplotlib.colors import LinearSegmentedColormap

    families = families.assign(cell=_labels(families))
    if families["cell"].nunique() == 1:
        families = families.assign(cell=families["formulation"], formulation=families["cell"])
    panels = list(families.groupby("formulation", sort=False))
    columns, names = list(dict.fromkeys(families["cell"])), list(dict.fromkeys(families["family"]))
    across = max(1, min(len(panels), 12 // len(columns)))
    down = -(-len(panels) // across)
    colors = LinearSegmentedColormap.from_list(
        "held", [(0, TRUTH), (0.8, "#fbe3d4"), (0.95, "#ffffff"), (1, "#cfe3f1")]
    )
    beneath = 0.4 + 0.08 * max(map(len, columns))
    width = max(9.0, 1.6 + across * (0.62 * len(columns) + 0.3))
    with new_figure(width, down * (0.27 * len(names) + 0.4) + beneath) as figure:
        axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
        for axis in axes[len(panels) :]:
            axis.remove()
        for axis, (title, rows) in zip(axes, panels, strict=False):
            table = rows.pivot_table("coverage", "family", "cell", sort=False, aggfunc="first")
            values = table.reindex(index=names, columns=columns).to_numpy()
            above = 0.95 + 0.05 * (values - prob) / (1 - prob)  # the nominal coverage is at 0.95
            shades = np.where(values <= prob, 0.95 * values / prob, above)
            pieces.heat(axis, shades, 100 * values, columns, names, colors)
            axis.set_title(str(title))
    return figure


def _of_strength(summary: pd.DataFrame, prob: float) -> Figure:
    """Draw coverage and price over the strength of the model's error, a line a formulation."""
    panels = list(summary.groupby(["design", "noise"], sort=False))
    with panel_grid(len(panels), 2, 2.6) as (figure, axes):
        for row, ((design, noise), table) in zip(axes, panels, strict=True):
            for index, (name, line) in enumerate(table.groupby("formulation", sort=False)):
                style: dict[str, Any] = {"color": SERIES[index % len(SERIES)], "marker": MARKERS[index % len(MARKERS)]}
                style |= {"markersize": 4, "label": name}
                error = 100 * BAR_HALF_WIDTH * line["coverage_error"]
                row[0].errorbar(line["strength"], 100 * line["coverage"], yerr=error, **style)
                row[1].errorbar(line["strength"], line["price"], yerr=BAR_HALF_WIDTH * line["price_error"], **style)
            row[0].axhline(100 * prob, color=BASE, linewidth=1, zorder=0)
            row[0].set_ylabel("intervals that hold C10 [%]")
            row[1].set_ylabel("mean score / oracle's width")
            row[1].set_yscale("log")
            row[1].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            row[1].yaxis.set_minor_formatter("")
            row[0].set_title(str(design) if summary["noise"].nunique() == 1 else f"{design}, {noise} noise")
        for axis in axes[-1]:
            axis.set_xlabel("strength of the error of the model")
        legend_above(figure, axes[0][:1], 5, font_size=10)
    return figure


def unseen_figure(unseen: pd.DataFrame, prob: float) -> Figure:
    """Draw coverage and error of the true stress in other loading modes, a row of panels a design and noise."""
    panels = list(unseen.groupby(CELL, sort=False))
    names = list(dict.fromkeys(unseen["formulation"]))
    with panel_grid(len(panels), 2, 0.75 + 0.3 * len(names)) as (figure, axes):
        for row, (_, table) in zip(axes, panels, strict=True):
            for axis, measure in zip(row, ("coverage", "error"), strict=True):
                series = {
                    str(mode): (
                        rows["formulation"],
                        100 * rows[measure],
                        BAR_HALF_WIDTH * 100 * rows[f"{measure}_error"],
                    )
                    for mode, rows in table.groupby("mode", sort=False)
                }
                dots_by_row(axis, names, series, 100 * prob if measure == "coverage" else None, is_named=axis is row[0])
            row[0].set_xlim(-2, 102)
            row[0].set_title(_labels(table)[0])
        axes[-1][1].set_xlim(left=0)
        axes[-1][0].set_xlabel(f"true stress in the {100 * prob:g} % band [%]")
        axes[-1][1].set_xlabel("median error of the predicted median [%]")
        legend_above(figure, axes[0][:1], font_size=10)
    return figure


def dots_by_row(
    axis: Axes,
    names: Sequence[str],
    series: Mapping[str, tuple[Iterable[str], Any, Any]],
    nominal: float | None = None,
    *,
    is_named: bool = True,
) -> None:
    """Draw values in named rows, a series beneath the other in each, and a line where they should be.

    Parameters
    ----------
    axis : Axes
    names : sequence of str
        Of the rows, from top to bottom.
    series : mapping of str to (names of rows, values, half widths of error bars or None)
    nominal : float, optional
        Where the line stands.
    is_named : bool
        Whether the axis shows the names.
    """
    levels = dict(zip(names, pieces.rows(axis, names, is_named=is_named), strict=True))
    for index, (label, (of_rows, values, errors)) in enumerate(series.items()):
        heights = [levels[name] + GAP * (0.5 * (len(series) - 1) - index) for name in of_rows]
        style: dict[str, Any] = {"fmt": MARKERS[index % len(MARKERS)], "color": SERIES[index % len(SERIES)]}
        axis.errorbar(values, heights, xerr=errors, markersize=4.5, label=label, **style)
    if nominal is not None:
        axis.axvline(nominal, color=BASE, linewidth=1, zorder=0)


@contextmanager
def panel_grid(down: int, across: int, height: float) -> Iterator[tuple[Figure, list[list[Axes]]]]:
    """Give a figure with rows of panels that share their horizontal axes, to draw on."""
    with new_figure(4.9 * across if across < WIDE_ROW else 11.5, down * height + 0.5) as figure:
        yield figure, figure.subplots(down, across, squeeze=False, sharex="col").tolist()


def _labels(table: pd.DataFrame) -> list[str]:
    """Return what tells the rows' designs, strengths and noises apart."""
    return [
        str(design)
        + (", noise unknown" if noise == "unknown" else "")
        + (f", strength {strength:g}" if strength != 1 else "")
        for design, strength, noise in zip(table["design"], table["strength"], table["noise"], strict=True)
    ]
