"""The run folder of the paper's study: tables, posteriors, the paper's figures and the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.reading.units import StressUnit
from tissuq.mechanics import Yeoh, engineering_stress
from tissuq.report.run_folder import (
    RECIPE,
    embedded_figure,
    render,
    write_data,
    write_figures,
    write_posteriors,
    write_recipe,
    write_tables,
)
from tissuq.report.tables import Row, readable_parameters, readable_summary, summary_row, write_csv
from tissuq.validation.paper.study import AMPLITUDE_BOUNDS, FORMULATIONS, Fitted, PaperStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["write_paper_run"]

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
    page = render("paper.html", **_context(study, summary, folder), command=command)
    (folder / "report.html").write_text(page, encoding="utf-8")


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


def _context(study: PaperStudy, summary: list[Row], folder: Path) -> dict[str, Any]:
    posteriors = _posteriors(study.main)
    drawn = folder / "figures"
    return {
        "settings": study.settings,
        "recipe": (folder / RECIPE).read_text(encoding="utf-8"),
        "summary": readable_summary(summary, MPA),
        "held": [row["formulation"] for row in summary if row["contains_truth"]],
        "passed": [name for name, fit in study.main.items() if fit.finding.passes],
        "is_sampled": study.settings.sampler == "nuts",
        "warnings": study.warnings,
        "verdicts": study.verdicts,
        "cells": _cells(study),
        "agreement": [_readable_agreement(row) for row in _agreement(study)],
        "parameters": readable_parameters(posteriors, MPA),
        "figures": {path.stem: embedded_figure(path) for path in sorted(drawn.glob("*.svg"))},
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
