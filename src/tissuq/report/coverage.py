"""The run folder of a campaign: tables, a figure and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.report.figures import BAND, BASE, STYLE, save_figure
from tissuq.report.page import embedded_figure, render
from tissuq.report.run_folder import RECIPE
from tissuq.studies.coverage import CoverageSettings, summarise

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["COLUMNS", "readable_coverage", "write_campaign"]

COLUMNS = ["design", "strength", "formulation", "fits", "coverage", "score", "width", "bias"]
"""Of `readable_coverage`."""


def write_campaign(settings: CoverageSettings, results: list[dict[str, Any]], folder: Path) -> pd.DataFrame:
    """Write summary.csv, families.csv, the figure and report.html beside the results; return the summary."""
    summary, families = summarise(settings, results), summarise(settings, results, "family")
    summary.to_csv(folder / "summary.csv", index=False)
    families.to_csv(folder / "families.csv", index=False)
    (folder / "figures").mkdir(exist_ok=True)
    save_figure(_figure(summary, settings.prob), folder / "figures", "coverage")
    page = render(
        "coverage.html",
        settings=settings,
        columns=COLUMNS,
        rows=readable_coverage(summary),
        families=_by_family(families),
        failed=int(summary["failed"].sum()),
        recipe=(folder / RECIPE).read_text(encoding="utf-8"),
        command="study coverage",
        figure=embedded_figure(folder / "figures" / "coverage.svg"),
    )
    (folder / "report.html").write_text(page, encoding="utf-8")
    return summary


def readable_coverage(summary: pd.DataFrame) -> list[list[str]]:
    """Return the rows of a summary as text, with Monte Carlo errors."""
    return [
        [
            str(row["design"]),
            f"{row['strength']:g}",
            str(row["formulation"]),
            str(row["fits"]),
            f"{row['coverage']:.1%} ± {row['coverage_error']:.1%}",
            f"{row['score']:.3f} ± {row['score_error']:.3f}",
            f"{row['width']:.1f}",
            f"{row['bias']:+.1%}",
        ]
        for row in summary.to_dict("records")
    ]


def _by_family(families: pd.DataFrame) -> dict[str, Any]:
    """Return the coverage by family: one table, formulations as columns."""
    table = families.pivot_table(
        "coverage", ["design", "strength", "family"], "formulation", sort=False, aggfunc="first"
    ).reset_index()
    texts = [[f"{cell:.0%}" if isinstance(cell, float) and place > 2 else f"{cell:g}" if place == 1 else str(cell)
              for place, cell in enumerate(row)] for row in table.itertuples(index=False)]  # fmt: skip
    return {"columns": list(table.columns), "rows": texts}


def _figure(summary: pd.DataFrame, prob: float) -> Figure:
    """Draw the coverage of every formulation, a panel a design and strength."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    panels = list(summary.groupby(["design", "strength"], sort=False))
    across = min(2, len(panels))
    down = -(-len(panels) // across)
    tall = max(len(rows) for _, rows in panels)
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, down * (1.3 + 0.24 * tall)))
        axes = figure.subplots(down, across, squeeze=False, sharex=True).ravel()
        for axis in axes[len(panels) :]:
            axis.remove()
        for axis, ((design, strength), rows) in zip(axes, panels, strict=False):
            places = list(range(len(rows)))[::-1]
            axis.axvline(100 * prob, color=BASE, linewidth=1)
            error = 196 * rows["coverage_error"]
            axis.errorbar(100 * rows["coverage"], places, xerr=error, fmt="o", markersize=4, color=BAND)
            axis.set_yticks(places, rows["formulation"])
            axis.set_ylim(-0.7, len(rows) - 0.3)
            axis.set_xlim(-2, 102)
            axis.set_title(design if summary["strength"].nunique() == 1 else f"{design}, strength {strength:g}")
        for axis in axes[max(0, len(panels) - across) : len(panels)]:
            axis.tick_params(labelbottom=True)
            axis.set_xlabel(f"{100 * prob:g} % intervals that hold the true C10 [%]")
    return figure
