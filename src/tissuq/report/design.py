"""The folder of a ranking of tests: table, figure and page."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import BAND, BASE, INK, UNSTABLE, new_figure
from tissuq.next_test.candidates import Target
from tissuq.report.run_folder import write_figures, write_page, write_recipe
from tissuq.report.tables import Row, significant, write_csv, write_json
from tissuq.studies.design import DesignSettings, DesignStudy

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["HEADERS", "design_figure", "heading", "readable_design", "write_design"]

HEADERS = ["test", "expected sd", "reduction", "note"]
"""Of `readable_design`."""
MAX_ROWS = 16
"""Number of tests in a panel of the figure, besides repeats of the tests of the data."""
BEYOND = UNSTABLE
SDS = ("sd_now", "sd_after")
"""Columns in the unit of a target."""


def readable_design(study: DesignStudy, target: Target) -> list[list[str]]:
    """Return the rows of one target as text, under `HEADERS`, in the unit of the data; best first, the others last."""
    factor, _ = _unit(study, target)
    rows = []
    for _, row in _rows_of(study, target).iterrows():
        is_ranked = not isnan(row["reduction"])
        rows.append(
            [
                str(row["candidate"]),
                f"{row['sd_after'] / factor:#.3g}" if is_ranked else "",
                f"{row['reduction']:.1%}" + (f" ± {row['error']:.1%}" if row["error"] else "") if is_ranked else "",
                str(row["note"]),
            ]
        )
    return rows


def heading(study: DesignStudy, target: Target) -> str:
    """Return what a target is, and how uncertain it is now."""
    factor, unit = _unit(study, target)
    sd_now = significant(float(_rows_of(study, target)["sd_now"].iloc[0]) / factor)
    return f"{target.title(study.posterior.model)}: sd {sd_now}{' ' * bool(unit)}{unit} now"


def design_figure(study: DesignStudy) -> Figure:
    """Return the expected standard deviation after every test, a panel for each target, the best on top."""
    shown = [_shown(_rows_of(study, target)) for target in study.targets]
    height = 1.5 + 0.3 * max(map(len, shown))
    with new_figure(9.5, 0.4 + height * len(shown)) as figure:
        axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        for axis, target, table in zip(axes, study.targets, shown, strict=True):
            _panel(axis, study, target, table)
        marks: list[Any] = [axes[0].plot([], [], "o", color=color)[0] for color in (BAND, BEYOND, BASE)]
        words = ["within the measured I1 and I2", "beyond", "repeats of the tests of the data"]
        figure.legend(marks, words, loc="outside lower right", ncols=3, fontsize=9)
    return figure


def write_design(study: DesignStudy, recipe: DesignSettings, folder: Path, *, figures: bool = True) -> None:
    """Write design.csv and design.json, the figure, run.toml and report.html into an empty folder.

    Standard deviations are in the unit of the data, which stands beside each.

    Parameters
    ----------
    study : DesignStudy
    recipe : DesignSettings
        The settings, with the run as it is seen from the folder.
    folder : Path
        Exists and is empty.
    figures : bool
        Draw it, too.
    """
    rows = _rows_in_unit(study)
    write_csv(folder / "design.csv", rows)
    write_json(folder / "design.json", rows)
    write_recipe(folder, "design", recipe)
    if figures:
        write_figures(folder, {"design": design_figure(study)})
    model = study.posterior.model
    write_page(
        folder,
        "design.html",
        data=model.experiment.name,
        material=model.material.name,
        discrepancy=model.discrepancy.name,
        lead=_lead(study),
        tables=[
            (heading(study, target), [HEADERS[0], f"{HEADERS[1]}{_in(study, target)}", *HEADERS[2:]],
             readable_design(study, target))
            for target in study.targets
        ],
        explanations=study.explanations,
        warnings=study.warnings,
        command="design",
    )  # fmt: skip


def _rows_in_unit(study: DesignStudy) -> list[Row]:
    """Return the rows of the table, standard deviations in the unit of the data."""
    units = {target.name: _unit(study, target) for target in study.targets}
    rows: list[Row] = []
    for record in study.table.to_dict("records"):
        factor, unit = units[record["target"]]
        in_unit: Row = {"unit": unit} | {name: record[name] / factor for name in SDS}
        rows.append({str(name): value for name, value in record.items()} | in_unit)
    return rows


def _rows_of(study: DesignStudy, target: Target) -> pd.DataFrame:
    return study.table[study.table["target"] == target.name]


def _unit(study: DesignStudy, target: Target) -> tuple[float, str]:
    """Return what one unit of a target's values is in MPa, and the unit's name."""
    has_unit = bool(target.unit(study.posterior.model))
    return (study.unit.to_mpa, study.unit.name) if has_unit else (1.0, "")


def _in(study: DesignStudy, target: Target) -> str:
    unit = _unit(study, target)[1]
    return f", {unit}" if unit else ""


def _lead(study: DesignStudy) -> list[str]:
    """Return the best test for each target in a sentence, compared with repeating the tests of the data."""
    sentences = []
    for target in study.targets:
        table = _rows_of(study, target).dropna(subset=["reduction"])
        best, again = table[~table["is_repeat"]], table[table["is_repeat"]]
        if not len(best):
            continue
        row = best.iloc[0]
        title = target.title(study.posterior.model)
        words = f"{title}: {row['candidate']}, is expected to lower its sd by {row['reduction']:.0%}"
        if len(again):
            repeat = again.iloc[-1]
            words += f"; {repeat['candidate']}, by {repeat['reduction']:.0%}"
        sentences.append(words + ".")
    return sentences


def _shown(table: pd.DataFrame) -> pd.DataFrame:
    """Return the best tests with numbers, and the tests of the data again."""
    ranked = table.dropna(subset=["reduction"])
    ranks = np.arange(len(ranked))
    return ranked[ranked["is_repeat"].to_numpy() | (ranks < MAX_ROWS)]


def _panel(axis: Axes, study: DesignStudy, target: Target, table: pd.DataFrame) -> None:
    """Draw the tests of one target."""
    factor, unit = _unit(study, target)
    sd_now, heights = float(table["sd_now"].iloc[0]) / factor, np.arange(len(table))[::-1]
    for height, (_, row) in zip(heights, table.iterrows(), strict=True):
        sd_after, error = row["sd_after"] / factor, 2 * row["error"] * sd_now
        color = BASE if row["is_repeat"] else BEYOND if row["beyond"] > 0 else BAND
        axis.plot([sd_after, sd_now], [height, height], color=color, lw=2, alpha=0.4, solid_capstyle="butt")
        axis.plot([sd_after - error, sd_after + error], [height, height], color=INK, lw=1.2)
        axis.plot(sd_after, height, "o", color="white" if row["is_rough"] else color, mec=color, ms=6)
    axis.axvline(sd_now, color=INK, lw=1)
    axis.set_yticks(heights, [str(name) for name in table["candidate"]])
    axis.set_ylim(-0.7, len(table) - 0.3)
    axis.set_xlim(0, 1.04 * sd_now)
    axis.set_title(target.title(study.posterior.model))
    axis.set_xlabel(f"expected sd after the test{f' [{unit}]' if unit else ''}; line: now")
    axis.tick_params(axis="y", length=0)
