"""The run folders of campaigns, of coverage and of simulation-based calibration: tables, figures and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.report.coverage_figures import COLORS, campaign_figures
from tissuq.report.figures import STYLE, save_figure
from tissuq.report.run_folder import RECIPE, embedded_figure, render
from tissuq.report.tables import significant
from tissuq.validation.coverage import CoverageSettings, summarise, summarise_unseen
from tissuq.validation.sbc import SbcSettings, ecdf_band, probabilities_of, summarise_ranks

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["readable_coverage", "readable_ranks", "write_campaign", "write_sbc"]

Rows = tuple[list[str], list[list[str]]]

MIN_RELATIVE_ERROR = 1e-9
"""Monte Carlo error, relative to its number, below which it is rounding and shown as zero."""
SETTING_HEADERS = {
    "design": "design",
    "strength": "strength",
    "noise": "noise",
    "family": "family",
    "mode": "loading mode",
}


def write_campaign(settings: CoverageSettings, results: list[dict[str, Any]], folder: Path) -> pd.DataFrame:
    """Write the tables as CSV, the figures and report.html beside the results; return the summary."""
    summary, families = summarise(settings, results), summarise(settings, results, "family")
    tables = {"summary": summary, "families": families}
    if settings.unseen:
        tables["unseen"] = summarise_unseen(settings, results)
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    figures = campaign_figures(tables, settings.prob)
    (folder / "figures").mkdir(exist_ok=True)
    for name, figure in figures.items():
        save_figure(figure, folder / "figures", name)
    page = render(
        "coverage.html",
        settings=settings,
        summary=readable_coverage(summary),
        families=readable_coverage(families) if "families" in figures else None,
        unseen=_readable_unseen(tables["unseen"]) if settings.unseen else None,
        is_series=len(settings.strengths) > 1,
        failed=int(summary["failed"].sum()),
        recipe=(folder / RECIPE).read_text(encoding="utf-8"),
        command="study coverage",
        figures={name: embedded_figure(folder / "figures" / f"{name}.svg") for name in figures},
    )
    (folder / "report.html").write_text(page, encoding="utf-8")
    return summary


def readable_coverage(summary: pd.DataFrame) -> Rows:
    """Return headers and rows of a summary as text, with Monte Carlo errors; columns with one value are left out."""
    headers = {
        "fits": ("fits", "count"),
        "coverage": ("coverage", "percent"),
        "score": ("score / C10", "number"),
        "price": ("score / oracle", "number"),
        "price_median": ("(median)", "plain"),
        "width": ("width / oracle", "number"),
        "bias": ("bias", "percent"),
        "predictive": ("new data in band", "percent"),
    }
    return _readable(summary, headers)


def _readable_unseen(table: pd.DataFrame) -> Rows:
    headers = {
        "materials": ("materials", "count"),
        "coverage": ("true stress in band", "percent"),
        "error": ("error of the mean", "percent"),
    }
    return _readable(table, headers)


def _readable(table: pd.DataFrame, headers: dict[str, tuple[str, str]]) -> Rows:
    varying = [name for name in SETTING_HEADERS if name in table and table[name].nunique() > 1]
    columns = {
        name: header
        for name, header in headers.items()
        if name in table and (header[1] != "count" or table[name].nunique() > 1)
    }
    rows = [
        [
            *(f"{row[name]:g}" if name == "strength" else str(row[name]) for name in varying),
            str(row["formulation"]),
            *(_with_error(row, name, kind) for name, (_, kind) in columns.items()),
        ]
        for row in table.to_dict("records")
    ]
    return [*(SETTING_HEADERS[name] for name in varying), "formulation", *(text for text, _ in columns.values())], rows


def _with_error(row: Any, name: str, kind: str) -> str:
    """Return a number and its Monte Carlo standard error as text: a share in percent, or any other number."""
    value, error = row[name], row.get(f"{name}_error")
    if kind == "count":
        return f"{value:.0f}"
    if kind == "plain":
        return significant(value)
    if error != error:  # of one data set
        return significant(100 * value) + " %" if kind == "percent" else significant(value)
    if kind == "percent":
        return f"{100 * value:.1f} ± {100 * error:.1f} %"
    return f"{significant(value)} ± {significant(error if error > MIN_RELATIVE_ERROR * abs(value) else 0.0, 2)}"


MAX_COLUMNS = 4
"""Panels in a row of the figure."""


def write_sbc(settings: SbcSettings, results: list[dict[str, Any]], folder: Path) -> pd.DataFrame:
    """Write ranks.csv, the figure and report.html beside the results; return the table."""
    table = summarise_ranks(settings, results)
    table.to_csv(folder / "ranks.csv", index=False)
    (folder / "figures").mkdir(exist_ok=True)
    save_figure(_figure(settings, results), folder / "figures", "ranks")
    page = render(
        "sbc.html",
        settings=settings,
        priors=[f"{symbol}: {prior}" for symbol, prior in settings.chosen_priors.items()],
        table=readable_ranks(table),
        wrong=int((~table["calibrated"]).sum()),
        failed=int(table.groupby(["formulation", "noise"])["failed"].first().sum()),
        recipe=(folder / RECIPE).read_text(encoding="utf-8"),
        command="study sbc",
        figure=embedded_figure(folder / "figures" / "ranks.svg"),
    )
    (folder / "report.html").write_text(page, encoding="utf-8")
    return table


def readable_ranks(table: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Return headers and rows of the table as text."""
    rows = [
        [
            *(str(row[name]) for name in ("formulation", "noise", "parameter", "fits")),
            f"{row['mean']:.3f}",
            f"{row['spread']:.3f}",
            f"{row['p_shape']:.2g}",
            f"{row['p_spread']:.2g}",
            "yes" if row["calibrated"] else "NO",
        ]
        for row in table.to_dict("records")
    ]
    headers = ["formulation", "noise", "parameter", "fits", "mean", "spread", "p (shape)", "p (spread)", "calibrated"]
    return headers, rows


def _figure(settings: SbcSettings, results: list[dict[str, Any]]) -> Figure:
    """Draw, for each formulation and noise, by how much the ECDF of the ranks differs from that of uniform ones."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    panels: dict[tuple[str, str], dict[str, Any]] = {}
    for (formulation, noise, symbol), probabilities in probabilities_of(settings, results).items():
        panels.setdefault((formulation, noise), {})[symbol] = np.sort(probabilities[np.isfinite(probabilities)])
    symbols = list(dict.fromkeys(symbol for lines in panels.values() for symbol in lines))
    across = min(MAX_COLUMNS, len(panels))
    down = -(-len(panels) // across)
    with rc_context(STYLE):
        figure = Figure(figsize=(2.7 * across + 0.8, 1.9 * down + 0.9))
        axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
        for axis in axes[len(panels) :]:
            axis.remove()
        handles: dict[str, Any] = {}
        for axis, ((formulation, noise), lines) in zip(axes, panels.items(), strict=False):
            probability_grid, low, high = ecdf_band(min(map(len, lines.values())))
            axis.fill_between(probability_grid, low - probability_grid, high - probability_grid, color="#d9dee5", lw=0)
            for symbol, probabilities in lines.items():
                share = np.searchsorted(probabilities, probability_grid, side="right") / len(probabilities)
                number = symbols.index(symbol)
                style = {"color": COLORS[number % len(COLORS)], "ls": ("-", "--", ":")[number // len(COLORS) % 3]}
                (handles[symbol],) = axis.plot(probability_grid, share - probability_grid, lw=1.2, **style)
            axis.set_title(formulation if len(settings.noise) == 1 else f"{formulation}, {noise}", fontsize=9.5)
        for axis in axes[max(0, len(panels) - across) : len(panels)]:
            axis.tick_params(labelbottom=True)
        figure.supxlabel("posterior probability below the truth", fontsize=10)
        figure.supylabel("ECDF less that of uniform ranks", fontsize=10)
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=min(8, len(handles)))
    return figure
