"""The result of a comparison: which fit the evidence and the predictions prefer, and the parameter of each."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.assessment.evidence import warnings_of_evidence
from tissuq.drawing.pieces import forest, rows
from tissuq.drawing.style import ANSWER_WIDTH, BAND, BASE, INK, new_figure
from tissuq.experiments.units import StressUnit
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.report.tables import interval, significant, with_named_units
from tissuq.studies.laws import SIGNIFICANT_ERRORS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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


def comparison_table(table: pd.DataFrame, unit: StressUnit) -> Table:
    """Return a comparison as text, the parameter in the given unit; its name where all fits have the same one."""

    def text(name: str, form: str) -> Callable[[Any], str]:
        return lambda row: "" if isnan(row[name]) else format(row[name], form)

    def of_other_priors(row: Any) -> str:
        low, high = row["log_bayes_factor_low"], row["log_bayes_factor_high"]
        return "" if isnan(low) else f"{low:.1f} to {high:.1f}"

    def of_parameter(row: Any) -> str:
        low, high = (float(row[name]) / unit.to_mpa for name in ("hdi_low", "hdi_high"))
        return "" if isnan(row["median"]) else " to ".join(interval(low, high, (high - low) / 4))

    columns: dict[str, Callable[[Any], str]] = {
        "fit": lambda row: str(row.name),
        "log evidence": text("log_evidence", ".2f"),
        "log Bayes factor": text("log_bayes_factor", ".2f"),
        "with other priors": of_other_priors,
        "probability": lambda row: "" if isnan(row["probability"]) else f"{100 * row['probability']:.1f} %",
        "elpd difference": lambda row: f"{0.0 - row['elpd_difference']:.1f} ± {row['elpd_difference_error']:.1f}",
        "stacking": lambda row: f"{row['stacking']:.2f}{' (rough)' * bool(row['is_rough'])}",
        f"{' or '.join(table['parameter'].dropna().unique())}, {unit.name} (95 %)": of_parameter,
    }
    return Table.of((row for _, row in table.iterrows()), columns, "Fits of the same measurements")


def comparison_warnings(table: pd.DataFrame) -> list[str]:
    """Return the warnings about a comparison."""
    evidences = zip(table["log_evidence"], table["log_evidence_error"], strict=True)
    warnings: list[str] = [*warnings_of_evidence(dict(zip(map(str, table.index), evidences, strict=True)))]
    if table["is_rough"].any():
        warnings.append(
            "Numbers marked rough are not reliable: a few influential measurements dominate the importance weights."
        )
    names = {
        str(quantity): list(rows.index)
        for quantity, rows in table[table["intervals_of"] != ""].groupby("intervals_of", sort=False)
    }
    if len(names) > 1:
        said = "; ".join(f"of {', '.join(map(str, fits))} they are of {quantity}" for quantity, fits in names.items())
        warnings.append(f"The intervals are of different things, so that their widths cannot be compared: {said}.")
    return warnings


def comparison_figure(table: pd.DataFrame, unit: StressUnit) -> Figure:
    """Return evidence, leave-one-out prediction and the headline parameter of every fit, side by side.

    Parameters
    ----------
    table : pandas.DataFrame
        From `tissuq.compare`, in MPa.
    unit : StressUnit
        Of the parameter's axis.
    """
    with new_figure(11.5, 1.9 + 0.42 * len(table)) as figure:
        evidence, prediction, parameter = figure.subplots(1, 3, sharey=True, width_ratios=(1, 1.15, 1))
        levels = rows(evidence, [str(name) for name in table.index])
        low, high = (table[f"log_bayes_factor_{end}"] for end in ("low", "high"))
        _differences(evidence, levels, table["log_bayes_factor"], low, high)
        evidence.set_title("Evidence")
        evidence.set_xlabel("log Bayes factor against the best\n(line: with other widths of the priors)")
        difference, error = -table["elpd_difference"], table["elpd_difference_error"]
        _differences(prediction, levels, difference, difference - error, difference + error)
        prediction.set_title("Prediction")
        prediction.set_xlabel("elpd minus that of the best\n(line: ± standard error)")
        prediction.text(1.02, 1.0, "stacking,\nfor predictions only", transform=prediction.transAxes, fontsize=8.5,
                        ha="left", va="bottom", color="#5a6472")  # fmt: skip
        marks = np.where(table["is_rough"], " (rough)", "")
        for level, weight, mark in zip(levels, table["stacking"], marks, strict=True):
            prediction.text(
                1.02, level, f"{weight:.2f}{mark}", transform=prediction.get_yaxis_transform(), va="center",
                fontsize=9, color="#5a6472",
            )  # fmt: skip
        _intervals(parameter, levels, table, unit)
        for axis in (evidence, prediction, parameter):
            axis.tick_params(axis="y", length=0)
            axis.grid(axis="y", color="#e6e9ee", linewidth=0.8)
            axis.set_axisbelow(True)
    return figure


def comparison_result(table: pd.DataFrame, runs: list[str], unit: StressUnit) -> Result:
    """Return what a comparison says.

    Parameters
    ----------
    table : pandas.DataFrame
        From `tissuq.compare`, in MPa.
    runs : list of str
        What was compared, as it was named.
    unit : StressUnit
        Of the parameter.
    """
    records = [{"fit": name, **row} for name, row in table.astype(object).where(table.notna(), None).iterrows()]
    command = " ".join(["compare", *runs])
    caption = (
        "Log Bayes factors, leave-one-out predictions and 95 % intervals of the parameter. The fit with the largest "
        "evidence is first; this does not imply that its interval contains the true value."
    )
    figure = Picture("comparison", lambda: comparison_figure(table, unit),
                     "Evidence, prediction and parameter of every fit", caption)  # fmt: skip
    answer = Picture("answer", lambda: _parameter_figure(table, unit), "The parameter of every fit",
                     "95 % interval and median of the parameter; that of the largest evidence is on top.")  # fmt: skip
    excluding = (
        "Where the intervals of the parameter exclude each other, the choice of material and discrepancy matters more "
        "than the noise: read what each fit's own report says of its use."
    )
    return Result(
        command=command,
        title="Fits of the same measurements, side by side",
        subject=f"{len(table)} fits",
        numbers=_numbers(table, unit),
        next_step="before you take one of these numbers, read in its own report what it may be used for, and what a "
        "discrepancy does to the initial stiffness.",
        picture=answer,
        tables=(comparison_table(table, unit),),
        sections=(Section("Evidence, prediction and parameter", (figure,)),
                  Section("How to read it", ((*EXPLANATIONS, excluding),))),
        warnings=tuple(comparison_warnings(table)),
        files={"comparison.csv": with_named_units(records, ("median", "hdi_low", "hdi_high"), unit)},
        how_to_repeat=f"`tissuq {command}`. Every number is in `comparison.csv` in this folder.",
    )  # fmt: skip


def _numbers(table: pd.DataFrame, unit: StressUnit) -> tuple[Number, ...]:
    """Return the parameter over the fits and whether its intervals overlap, the most probable and the best fit."""
    numbers = []
    summarised = table.dropna(subset=["median"])
    if len(summarised) and summarised["parameter"].nunique() == 1:
        low, high = (float(end) / unit.to_mpa for end in (summarised["median"].min(), summarised["median"].max()))
        overlap = summarised["hdi_low"].max() <= summarised["hdi_high"].min()
        words = "all 95 % intervals overlap" if overlap else "the 95 % intervals contradict each other"
        value = f"{' to '.join(dict.fromkeys((significant(low), significant(high))))} {unit.name}"
        numbers.append(Number(f"median of {summarised['parameter'].iloc[0]}, over the fits", value, remark=words))
    if table["log_evidence"].notna().any():
        name = str(table["log_evidence"].idxmax())
        share = 100 * table["probability"][name]
        probability = "more than 99 %" if share > 99 and len(table) > 1 else f"{share:.0f} %"
        numbers.append(Number("largest evidence", name, remark=f"probability {probability}"))
    best = str(table["elpd"].idxmax())
    is_close = table["elpd_difference"] <= SIGNIFICANT_ERRORS * table["elpd_difference_error"]
    as_good = [str(name) for name in table.index[is_close] if name != best]
    remark = f"as good: {', '.join(as_good)}" if as_good else "no other as good"
    return (*numbers, Number("best for left-out measurements", best, remark=remark))


def _parameter_figure(table: pd.DataFrame, unit: StressUnit) -> Figure:
    """Return the headline parameter of every fit."""
    with new_figure(ANSWER_WIDTH, 1.3 + 0.34 * len(table)) as figure:
        axis = figure.subplots()
        _intervals(axis, rows(axis, [str(name) for name in table.index]), table, unit)
    return figure


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
            axis.text(edge + margin, level, f"{value:.0f}", va="center", fontsize=9, color=INK)
        else:
            if end > start:
                axis.plot([max(start, edge), end], [level, level], color=BAND, lw=2, alpha=0.55, solid_capstyle="butt")
            axis.plot(value, level, "o", color=BAND, ms=5)
    axis.set_xlim(edge - margin, max(2 * margin, float(np.nanmax([*high, 0.0])) + margin))


def _intervals(axis: Axes, levels: Any, table: pd.DataFrame, unit: StressUnit) -> None:
    """Draw the 95 % interval and the median of the headline parameter of every fit."""
    names = table["parameter"].dropna().unique()
    axis.set_title("Parameter" if len(names) != 1 else str(names[0]))
    axis.set_xlabel(f"{' or '.join(names)} [{unit.name}]\n(95 % interval and median)")
    for level, (_, row) in zip(levels, table.iterrows(), strict=True):
        low, median, high = (float(row[name]) / unit.to_mpa for name in ("hdi_low", "median", "hdi_high"))
        forest(axis, [level], [low], [median], [high], width=4, strength=0.55, mark_color=INK)
        if len(names) > 1:
            axis.annotate(
                str(row["parameter"]), (high, level), (5, 0), textcoords="offset points", va="center", fontsize=9
            )
