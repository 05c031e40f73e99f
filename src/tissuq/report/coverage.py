"""The run folder of a campaign: tables, figures and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.report.coverage_figures import campaign_figures
from tissuq.report.figures import save_figure
from tissuq.report.page import embedded_figure, render
from tissuq.report.rows import significant
from tissuq.report.run_folder import RECIPE
from tissuq.studies.coverage import CoverageSettings, summarise, summarise_unseen

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["readable_coverage", "write_campaign"]

Rows = tuple[list[str], list[list[str]]]

ROUNDING = 1e-9
PLACES = {"design": "design", "strength": "strength", "noise": "noise", "family": "family", "mode": "loading mode"}


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
    """Return headers and rows of a summary as text, with Monte Carlo errors; what is the same in all rows left out."""
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
    places = [name for name in PLACES if name in table and table[name].nunique() > 1]
    columns = {
        name: header
        for name, header in headers.items()
        if name in table and (header[1] != "count" or table[name].nunique() > 1)
    }
    rows = [
        [
            *(f"{row[name]:g}" if name == "strength" else str(row[name]) for name in places),
            str(row["formulation"]),
            *(_with_error(row, name, kind) for name, (_, kind) in columns.items()),
        ]
        for row in table.to_dict("records")
    ]
    return [*(PLACES[name] for name in places), "formulation", *(text for text, _ in columns.values())], rows


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
    return f"{significant(value)} ± {significant(error if error > ROUNDING * abs(value) else 0.0, 2)}"
