"""The run folder of a calibration by simulation: table, figure and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.report.coverage_figures import COLORS
from tissuq.report.figures import STYLE, save_figure
from tissuq.report.page import embedded_figure, render
from tissuq.report.run_folder import RECIPE
from tissuq.studies.sbc import SbcSettings, summarise_ranks
from tissuq.studies.sbc.summary import probabilities_of
from tissuq.studies.sbc.uniformity import ecdf_band

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["readable_ranks", "write_sbc"]

ACROSS = 4


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
    for (formulation, noise, symbol), below in probabilities_of(settings, results).items():
        panels.setdefault((formulation, noise), {})[symbol] = np.sort(below[np.isfinite(below)])
    symbols = list(dict.fromkeys(symbol for lines in panels.values() for symbol in lines))
    across = min(ACROSS, len(panels))
    down = -(-len(panels) // across)
    with rc_context(STYLE):
        figure = Figure(figsize=(2.7 * across + 0.8, 1.9 * down + 0.9))
        axes = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True).ravel()
        for axis in axes[len(panels) :]:
            axis.remove()
        handles: dict[str, Any] = {}
        for axis, ((formulation, noise), lines) in zip(axes, panels.items(), strict=False):
            places, low, high = ecdf_band(min(map(len, lines.values())))
            axis.fill_between(places, low - places, high - places, color="#d9dee5", lw=0)
            for symbol, below in lines.items():
                share = np.searchsorted(below, places, side="right") / len(below)
                which = symbols.index(symbol)
                style = {"color": COLORS[which % len(COLORS)], "ls": ("-", "--", ":")[which // len(COLORS) % 3]}
                (handles[symbol],) = axis.plot(places, share - places, lw=1.2, **style)
            axis.set_title(formulation if len(settings.noise) == 1 else f"{formulation}, {noise}", fontsize=9.5)
        for axis in axes[max(0, len(panels) - across) : len(panels)]:
            axis.tick_params(labelbottom=True)
        figure.supxlabel("posterior probability below the truth", fontsize=10)
        figure.supylabel("ECDF less that of uniform ranks", fontsize=10)
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=min(8, len(handles)))
    return figure
