"""The folder of a comparison: fits side by side as a table, a figure and a page."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.pieces import forest
from tissuq.drawing.style import BAND, BASE, INK, new_figure
from tissuq.experiments.units import StressUnit
from tissuq.report.run_folder import write_figures, write_page
from tissuq.report.tables import interval, with_named_units, write_csv

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "EXPLANATIONS",
    "HEADERS",
    "comparison_figure",
    "comparison_warnings",
    "parameter_header",
    "readable_comparison",
    "write_comparison",
]

HEADERS = [
    "fit",
    "log evidence",
    "log Bayes factor",
    "with other priors",
    "probability",
    "elpd difference",
    "stacking",
]
"""Of `readable_comparison`; the last is the parameter."""
EXPLANATIONS = (
    "Log Bayes factor: log evidence relative to the best fit. With other priors: its range when the prior scales of "
    "the discrepancies are divided or multiplied by four and the uniform priors of linear parameters are four times as "
    "wide, in all fits at once.",
    "Probability: posterior probability of each fit if all were equally probable before the data. It compares "
    "descriptions of these data, not values of a parameter; no fit is discarded because of it.",
    "Elpd difference: sum of the leave-one-out log predictive densities, less that of the best fit, with its standard "
    "error. Good predictions do not validate parameters.",
    "Stacking: weights for averaging predictions; they do not apply to parameters.",
)
MAX_DRAWN_DIFFERENCE = 25.0
"""Difference of a log density beyond which a point is drawn at the edge, with its number."""


def readable_comparison(table: pd.DataFrame, unit: StressUnit) -> list[list[str]]:
    """Return the rows of a comparison as text, under `HEADERS` and the parameter in the given unit."""
    rows = []
    for name, row in table.iterrows():
        ends = row["log_bayes_factor_low"], row["log_bayes_factor_high"]
        rows.append(
            [
                str(name),
                _text(row["log_evidence"], ".2f"),
                _text(row["log_bayes_factor"], ".2f"),
                "" if isnan(ends[0]) else f"{ends[0]:.1f} to {ends[1]:.1f}",
                _text(row["probability"], ".1%"),
                f"{row['elpd_difference']:.1f} ± {row['elpd_difference_error']:.1f}",
                f"{row['stacking']:.2f}{' (rough)' if row['is_rough'] else ''}",
                _interval(row, unit),
            ]
        )
    return rows


def comparison_warnings(table: pd.DataFrame) -> list[str]:
    """Return the warnings about a comparison."""
    text = "Numbers marked rough are not reliable: a few influential measurements dominate the importance weights."
    return [text] * bool(table["is_rough"].any())


def comparison_figure(table: pd.DataFrame, unit: StressUnit) -> Figure:
    """Return evidence, leave-one-out prediction and the headline parameter of every fit, side by side.

    Parameters
    ----------
    table : pandas.DataFrame
        From `tissuq.compare`.
    unit : StressUnit
        Of the parameter's axis.
    """
    with new_figure(11.5, 1.9 + 0.42 * len(table)) as figure:
        evidence, prediction, parameter = figure.subplots(1, 3, sharey=True, width_ratios=(1, 1.15, 1))
        levels = np.arange(len(table))[::-1]
        low, high = (table[f"log_bayes_factor_{end}"] for end in ("low", "high"))
        _differences(evidence, levels, table["log_bayes_factor"], low, high)
        evidence.set_title("Evidence")
        evidence.set_xlabel("log Bayes factor against the best\n(line: with other widths of the priors)")
        difference, error = -table["elpd_difference"], table["elpd_difference_error"]
        _differences(prediction, levels, difference, difference - error, difference + error)
        prediction.set_title("Prediction")
        prediction.set_xlabel("elpd less that of the best\n(line: ± standard error)")
        prediction.text(1.02, 1.0, "stacking,\nfor predictions only", transform=prediction.transAxes, fontsize=8.5,
                        ha="left", va="bottom", color="#5a6472")  # fmt: skip
        marks = np.where(table["is_rough"], " (rough)", "")
        for level, weight, mark in zip(levels, table["stacking"], marks, strict=True):
            prediction.text(
                1.02, level, f"{weight:.2f}{mark}", transform=prediction.get_yaxis_transform(), va="center",
                fontsize=9, color="#5a6472",
            )  # fmt: skip
        _intervals(parameter, levels, table, unit)
        evidence.set_yticks(levels, [str(name) for name in table.index])
        evidence.set_ylim(-0.6, len(table) - 0.4)
        for axis in (evidence, prediction, parameter):
            axis.tick_params(axis="y", length=0)
            axis.grid(axis="y", color="#e6e9ee", linewidth=0.8)
            axis.set_axisbelow(True)
    return figure


def write_comparison(table: pd.DataFrame, runs: list[str], unit: StressUnit, folder: Path) -> None:
    """Write comparison.csv, the figure and report.html into an empty folder.

    Parameters
    ----------
    table : pandas.DataFrame
        From `tissuq.compare`.
    runs : list of str
        What was compared, as it was named.
    unit : StressUnit
        Of the parameter.
    folder : Path
        Exists and is empty.
    """
    rows = [{"fit": name, **row} for name, row in table.astype(object).where(table.notna(), None).iterrows()]
    write_csv(folder / "comparison.csv", with_named_units(rows, ("median", "hdi_low", "hdi_high"), unit))
    write_figures(folder, {"comparison": comparison_figure(table, unit)})
    write_page(
        folder,
        "comparison.html",
        headers=[*HEADERS, parameter_header(table, unit)],
        rows=readable_comparison(table, unit),
        explanations=EXPLANATIONS,
        warnings=comparison_warnings(table),
        command=" ".join(["tissuq compare", *runs]),
    )


def parameter_header(table: pd.DataFrame, unit: StressUnit) -> str:
    """Return the heading of the parameter's column: its name where all fits have the same one."""
    return f"{' or '.join(table['parameter'].dropna().unique())}, {unit.name} (95 %)"


def _text(value: float, form: str) -> str:
    return "" if isnan(value) else format(value, form)


def _interval(row: pd.Series[Any], unit: StressUnit) -> str:
    if isnan(row["median"]):
        return ""
    low, high = (float(row[name]) / unit.to_mpa for name in ("hdi_low", "hdi_high"))
    return " to ".join(interval(low, high, (high - low) / 4))


def _differences(axis: Axes, levels: Any, middle: pd.Series[float], low: Any, high: Any) -> None:
    """Draw differences to the best as points with ranges, those far below at the edge."""
    edge = -MAX_DRAWN_DIFFERENCE if (middle < -MAX_DRAWN_DIFFERENCE).any() else float(np.nanmin([*low, *middle, -1.0]))
    margin = 0.06 * abs(edge)
    axis.axvline(0, color=BASE, linewidth=1, zorder=1)
    for level, value, start, end in zip(levels, middle, low, high, strict=True):
        if isnan(value):
            axis.text(0.5, level, "not known", transform=axis.get_yaxis_transform(), ha="center", va="center",
                      fontsize=9, color="#5a6472")  # fmt: skip
        elif value < edge:
            axis.plot(edge, level, "<", color=BAND, ms=6)
            axis.text(edge + margin, level, f"{value:,.0f}", va="center", fontsize=9, color=INK)
        else:
            if end > start:
                axis.plot([max(start, edge), end], [level, level], color=BAND, lw=2, alpha=0.55, solid_capstyle="butt")
            axis.plot(value, level, "o", color=BAND, ms=5)
    axis.set_xlim(edge - margin, max(2 * margin, float(np.nanmax([*high, 0.0])) + margin))


def _intervals(axis: Axes, levels: Any, table: pd.DataFrame, unit: StressUnit) -> None:
    """Draw the 95 % interval and the median of the headline parameter of every fit."""
    names = table["parameter"].dropna().unique()
    axis.set_title("Parameter" if len(names) != 1 else str(names[0]))
    axis.set_xlabel(f"{' or '.join(names)} [{unit.name}]\n(95 % HPD and median)")
    for level, (_, row) in zip(levels, table.iterrows(), strict=True):
        low, median, high = (float(row[name]) / unit.to_mpa for name in ("hdi_low", "median", "hdi_high"))
        forest(axis, [level], [low], [median], [high], width=4, strength=0.55, mark_color=INK)
        if len(names) > 1:
            axis.annotate(
                str(row["parameter"]), (high, level), (5, 0), textcoords="offset points", va="center", fontsize=9
            )
