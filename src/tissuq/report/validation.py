"""The run folders of validation, of the paper's study and of campaigns: tables, figures and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.style import new_figure
from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.units import StressUnit
from tissuq.mechanics import Yeoh, engineering_stress
from tissuq.report.coverage_figures import COLORS, campaign_figures
from tissuq.report.run_folder import (
    write_data,
    write_figures,
    write_page,
    write_posteriors,
    write_recipe,
    write_tables,
)
from tissuq.report.tables import Row, readable_parameters, readable_summary, significant, summary_row, write_csv
from tissuq.result_warning import in_shell
from tissuq.validation.coverage import CoverageSettings, summarise, summarise_unseen
from tissuq.validation.paper.study import AMPLITUDE_BOUNDS, FORMULATIONS, Fitted, PaperStudy
from tissuq.validation.sbc import SbcSettings, ecdf_band, probabilities_of, summarise_ranks

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["readable_coverage", "readable_ranks", "write_campaign", "write_paper_run", "write_sbc"]

MPA = StressUnit("MPa", 1.0)
GROUPS = {
    1: ("none", "constant", "linear", "quadratic"),
    3: ("none", "mooney-rivlin", "yeoh"),
    5: ("none", "gp"),
}
"""The formulations of each pair of the paper's figures, by the number of the first of the pair."""


def write_paper_run(study: PaperStudy, folder: Path, *, figures: bool = True) -> None:
    """Write the results of a run into an empty folder.

    Parameters
    ----------
    study : PaperStudy
    folder : Path
        Exists and is empty.
    figures : bool
        Draw them.
    """
    command = "paper" if figures else "paper --no-figures"
    write_recipe(folder, command, study.settings)
    write_data(folder, study.experiment)
    summary = _summary(study, study.main)
    write_tables(folder, summary, _posteriors(study.main))
    write_posteriors(folder, _posteriors(study.main))
    if study.sampled:
        write_tables(folder, _summary(study, study.sampled), _posteriors(study.sampled), "-nuts")
        write_posteriors(folder, _posteriors(study.sampled), "-nuts")
        write_csv(folder / "agreement.csv", _agreement(study))
    write_csv(folder / "sensitivity.csv", [vars(cell) for cell in study.cells])
    write_csv(folder / "claims.csv", _claims(study))
    if figures:
        write_figures(folder, paper_figures(study))
    write_page(folder, "paper.html", **_context(study, summary), command=command)


def paper_figures(study: PaperStudy) -> dict[str, Figure]:
    """Return the paper's figures 1 to 7 by name."""
    from tissuq.report.figures import marginal_figure, predictive_figure

    posteriors = _posteriors(study.main)
    stretch = study.settings.stretch
    truth = [study.settings.truth[p.symbol] for p in Yeoh.parameters]
    curve = (stretch, engineering_stress(Yeoh(), Uniaxial(), stretch, truth))
    figures = {}
    for figure_number, names in GROUPS.items():
        shown = {name: posteriors[name] for name in names}
        for number, discrepancy in ((figure_number, True), (figure_number + 1, False)):
            figures[f"figure{number}"] = predictive_figure(shown, discrepancy=discrepancy, unit=MPA, true_curve=curve)
    figures["figure7"] = marginal_figure(posteriors, "C10", MPA, study.settings.truth["C10"])
    return figures


def _posteriors(fitted: dict[str, Fitted]) -> dict[str, Any]:
    return {name: fit.posterior for name, fit in fitted.items()}


def _summary(study: PaperStudy, fitted: dict[str, Fitted]) -> list[Row]:
    truth = study.settings.truth["C10"]
    return [summary_row(name, fit.posterior, fit.seconds, truth) for name, fit in fitted.items()]


def _agreement(study: PaperStudy) -> list[Row]:
    rows = []
    for name, sampled in study.sampled.items():
        exact, nuts = (fit.posterior.solution.marginals["C10"] for fit in (study.main[name], sampled))
        diagnostics = sampled.posterior.solution.diagnostics
        ends = [(b - a) / exact.sd for a, b in zip(exact.hdi(), nuts.hdi(), strict=True)]
        rows.append(
            {
                "formulation": name,
                "mean_shift_in_sd": (nuts.mean - exact.mean) / exact.sd,
                "sd_ratio": nuts.sd / exact.sd,
                "hdi_low_shift_in_sd": ends[0],
                "hdi_high_shift_in_sd": ends[1],
                "rhat": diagnostics.rhat["C10"] if diagnostics else None,
                "ess": min(diagnostics.ess_bulk["C10"], diagnostics.ess_tail["C10"]) if diagnostics else None,
                "converged": diagnostics.converged if diagnostics else None,
            }
        )
    return rows


def _claims(study: PaperStudy) -> list[Row]:
    return [
        {
            "claim": verdict.claim.text,
            "this_data_set": verdict.word,
            "times": verdict.times,
            "decided": verdict.decided,
            "found": verdict.observed,
        }
        for verdict in study.verdicts
    ]


def _context(study: PaperStudy, summary: list[Row]) -> dict[str, Any]:
    posteriors = _posteriors(study.main)
    return {
        "settings": study.settings,
        "summary": readable_summary(summary, MPA),
        "held": [row["formulation"] for row in summary if row["contains_truth"]],
        "passed": [name for name, fit in study.main.items() if fit.finding.passes],
        "is_sampled": study.settings.sampler == "nuts",
        "warnings": list(map(in_shell, study.warnings)),
        "verdicts": study.verdicts,
        "cells": _cells(study),
        "agreement": [_readable_agreement(row) for row in _agreement(study)],
        "parameters": readable_parameters(posteriors, MPA),
    }


def _cells(study: PaperStudy) -> dict[str, Any]:
    """Return the sensitivity table: a row a range, a column a formulation."""
    columns: list[tuple[str, float | None]] = [(name, None) for name in FORMULATIONS if name != "gp"]
    columns += [("gp", bound) for bound in AMPLITUDE_BOUNDS]
    cells = {(c.stretch_low, c.stretch_high, c.formulation, c.amplitude_bound): c for c in study.cells}
    ranges = list(dict.fromkeys((cell.stretch_low, cell.stretch_high) for cell in study.cells))

    def word(held: int) -> str:
        return ("yes" if held else "no") if study.settings.replicates == 1 else f"{held}/{study.settings.replicates}"

    return {
        "headers": [
            "stretch range",
            *(name if b is None else f"{name}, c up to {b:g} MPa" for name, b in columns),
        ],
        "rows": [
            [f"{low:g} to {high:g}", *(word(cells[low, high, *column].held) for column in columns)]
            for low, high in ranges
        ],
    }


def _readable_agreement(row: Row) -> list[str]:
    return [
        row["formulation"],
        f"{row['mean_shift_in_sd']:+.3f}",
        f"{row['sd_ratio']:.3f}",
        f"{row['hdi_low_shift_in_sd']:+.3f}",
        f"{row['hdi_high_shift_in_sd']:+.3f}",
        f"{row['rhat']:.4f}",
        f"{row['ess']:.0f}",
        "yes" if row["converged"] else "NO",
    ]


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
    write_figures(folder, figures)
    write_page(
        folder,
        "coverage.html",
        settings=settings,
        summary=readable_coverage(summary),
        families=readable_coverage(families) if "families" in figures else None,
        unseen=_readable_unseen(tables["unseen"]) if settings.unseen else None,
        is_series=len(settings.strengths) > 1,
        failed=int(summary["failed"].sum()),
        command="study coverage",
    )
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
    write_figures(folder, {"ranks": _figure(settings, results)})
    write_page(
        folder,
        "sbc.html",
        settings=settings,
        priors=[f"{symbol}: {prior}" for symbol, prior in settings.chosen_priors.items()],
        table=readable_ranks(table),
        wrong=int((~table["calibrated"]).sum()),
        failed=int(table.groupby(["formulation", "noise"])["failed"].first().sum()),
        command="study sbc",
    )
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
    panels: dict[tuple[str, str], dict[str, Any]] = {}
    for (formulation, noise, symbol), probabilities in probabilities_of(settings, results).items():
        panels.setdefault((formulation, noise), {})[symbol] = np.sort(probabilities[np.isfinite(probabilities)])
    symbols = list(dict.fromkeys(symbol for lines in panels.values() for symbol in lines))
    across = min(MAX_COLUMNS, len(panels))
    down = -(-len(panels) // across)
    with new_figure(2.7 * across + 0.8, 1.9 * down + 0.9) as figure:
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
