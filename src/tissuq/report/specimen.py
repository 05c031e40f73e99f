"""The folders of measured files: of a fit and of an inspection, with the converted data, tables and figures."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.assessment import Assessment
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.inspection import Inspection
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.pictures.curves import Described
from tissuq.posterior.posterior import Posterior
from tissuq.report.answer import ANSWER, answer_record, readable_estimates, shown_and_folded
from tissuq.report.chart import chart_data
from tissuq.report.figures import BAND, BASE, INK, described_curves, new_figure
from tissuq.report.inputs import inputs_of
from tissuq.report.run_folder import (
    ASSESSMENT,
    HELD_OUT_TESTS,
    INPUT,
    write_data,
    write_figures,
    write_page,
    write_posteriors,
    write_recipe,
    write_tables,
)
from tissuq.report.tables import (
    HELD_OUT_HEADLINE,
    Row,
    in_unit_of,
    readable_held_out,
    readable_methods,
    readable_parameters,
    readable_stability,
    readable_summary,
    significant,
    stability_cells,
    stability_rows,
    summary_row,
    tolerances_in_words,
    with_named_units,
    write_csv,
    write_json,
)
from tissuq.studies.specimen import SpecimenSettings, SpecimenStudy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "curve_figure",
    "lines_of_tests",
    "noise_in_words",
    "specimen_summary",
    "write_inputs",
    "write_inspection",
    "write_specimen_run",
]


LETTERS = 13
"""Size of letters in the figure of an inspection, which is looked at on small screens, too; points."""
_BROAD: dict[str, Any] = {"ls": "-", "lw": 9, "alpha": 0.45, "solid_capstyle": "round"}
_RING: dict[str, Any] = {"ls": "", "marker": "o", "ms": 14, "mfc": "none", "mew": 2.5}
REGIONS: dict[str, dict[str, Any]] = {
    "slack": _BROAD | {"color": "#E69F00"},
    "rupture": _BROAD | {"color": "#D55E00"},
    "hold": _BROAD | {"color": "#CC79A7"},
    "saturation": _BROAD | {"color": "#009E73"},
    "slip": _RING | {"color": "#D55E00"},
    "outlier": _RING | {"color": "#CC79A7"},
    "drift": _RING | {"color": "#009E73", "marker": "s"},
}
"""How the regions of a test are marked."""


def write_specimen_run(study: SpecimenStudy, sources: Sequence[Path], folder: Path, *, figures: bool = True) -> None:
    """Write the results of a fit into an empty folder.

    Parameters
    ----------
    study : SpecimenStudy
    sources : sequence of Path
        The files that were read; copies go with the run.
    folder : Path
        Exists and is empty.
    figures : bool
        Draw them, too.
    """
    command = write_inputs(study.settings, study.experiment, sources, folder, figures=figures)
    summary = specimen_summary(study)
    write_tables(folder, summary, study.posteriors, unit=study.unit)
    stability = stability_rows(study.posteriors)
    if stability:
        write_csv(folder / "stability.csv", stability)
    if study.held_out:
        columns = [f"{study.headline}_{name}" for name in HELD_OUT_HEADLINE]
        write_csv(folder / "held_out.csv", with_named_units(study.held_out, columns, study.unit))
        write_json(folder / HELD_OUT_TESTS, in_unit_of(study.held_out, columns, study.unit))
    write_posteriors(folder, study.posteriors)
    write_json(folder / ASSESSMENT, [_assessment_row(*item) for item in study.assessments.items()])
    record = answer_record(_title(study), study.main, study.answer, study.unit, study.warnings)
    write_json(folder / ANSWER, record)
    found = {name: described_curves(posterior) for name, posterior in study.posteriors.items()}
    if figures:
        write_figures(folder, _figures(study, found))
    context = _context(study, summary, record)
    context["chart_data"] = chart_data(study.posteriors, study.main, study.unit, found) if figures else None
    write_page(folder, "specimen.html", **context, command=command)


def write_inputs(
    settings: SpecimenSettings, experiment: Experiment, sources: Sequence[Path], folder: Path, *, figures: bool
) -> str:
    """Write copies of the files and laws, recipe and measurements of a fit; return the command in the recipe."""
    inputs = inputs_of(settings, experiment, sources)
    (folder / INPUT).mkdir()
    for name, source in inputs.files.items():
        shutil.copyfile(source, folder / name)
    command = f"fit{'' if figures else ' --no-figures'}{inputs.options}"
    write_recipe(folder, command, inputs.recipe, without=inputs.without)
    write_data(folder, experiment, stress_unit(experiment.stress_unit))
    return command


def _assessment_row(name: str, assessment: Assessment) -> Row:
    modulus = [value / stress_unit(assessment.unit).to_mpa for value in assessment.modulus]
    return {"formulation": name, **asdict(assessment), "modulus": modulus, "sentences": assessment.sentences}


def specimen_summary(study: SpecimenStudy) -> list[Row]:
    """Return one row a discrepancy."""
    rows = []
    for name, posterior in study.posteriors.items():
        row = summary_row(name, posterior, study.seconds[name])
        seconds = row.pop("seconds")
        row["estimand"] = posterior.model.tolerances.estimand
        row["noise_lag"] = posterior.model.fitted_errors.lag
        rows.append(row | stability_cells(posterior) | {"seconds": seconds})
    return rows


def _figures(study: SpecimenStudy, found: Mapping[str, Sequence[Described]]) -> dict[str, Figure]:
    from tissuq.report.figures import answer_figure, marginal_figure, predictive_figure

    return {
        "answer": answer_figure(study.posteriors[study.main], study.unit, is_narrow=True, found=found[study.main]),
        "marginals": marginal_figure(study.posteriors, study.headline, study.unit),
        "with_discrepancy": predictive_figure(study.posteriors, discrepancy=True, unit=study.unit, found=found),
        "model_alone": predictive_figure(study.posteriors, discrepancy=False, unit=study.unit, found=found),
    }


def _title(study: SpecimenStudy) -> str:
    return f"{study.experiment.name}: {study.settings.material} with the discrepancy '{study.main}'"


def _context(study: SpecimenStudy, summary: list[Row], record: dict[str, Any]) -> dict[str, Any]:
    shown, folded = shown_and_folded(record)
    return {
        "answer": record | {"estimates": readable_estimates(record), "next": record["next"].replace("{run}", "RUN")},
        "shown_warnings": shown,
        "folded_warnings": folded,
        "headline": study.headline,
        "settings": study.settings,
        "experiment": study.experiment,
        "tests": lines_of_tests(study.experiment),
        "tolerances": tolerances_in_words(study.tolerances, study.unit),
        "estimand": study.tolerances.meaning,
        "unit": study.unit.name,
        "comparison": _comparison(summary, study) if len(summary) > 1 else "",
        "summary": readable_summary(summary, study.unit),
        "is_sampled": any(row["rhat"] is not None for row in summary),
        "discrepancy_warnings": {
            name: posterior.model.discrepancy.caution
            for name, posterior in study.posteriors.items()
            if posterior.model.discrepancy.caution
        },
        "parameters": readable_parameters(study.posteriors, study.unit),
        "assessments": {name: posterior.sentences for name, posterior in study.assessments.items()},
        "stability": readable_stability(stability_rows(study.posteriors)),
        "held_out": readable_held_out(study.held_out, study.headline, study.unit),
        "methods": readable_methods(study.posteriors),
        "noise": noise_in_words(study.settings, next(iter(study.posteriors.values())), study.unit),
        "skipped": study.skipped,
    }


def noise_in_words(settings: SpecimenSettings, posterior: Posterior, unit: StressUnit) -> str:
    """Return what the noise was, in words."""
    noise, lag = posterior.model.noise, posterior.model.fitted_errors.lag
    if noise.parameters:
        return noise.description + (f" (lag-1 correlation {lag:.2f})" if lag else "")
    values = [test.noise_sd for test in settings.tests if test.noise_sd is not None]
    return f"sd {', '.join(f'{value:g}' for value in values) or f'{settings.noise_sd:g}'} {unit.name}"


def lines_of_tests(experiment: Experiment) -> list[str]:
    """Return every test in a few words."""
    return [_test_line(test) for test in experiment.tests]


def _test_line(test: Experiment) -> str:
    """Return a test in a few words: its mode, measurements and range."""
    control, values = test.mode.controls[0].name, test.stretch.reshape(len(test), -1)[:, 0]
    specimen_words = f" of specimen {test.specimen}" if test.specimen else ""
    ends = f"{values.min():.4g} to {values.max():.4g}"
    return f"{test.mode.name} test{specimen_words}, {len(test)} measurements, {control} {ends}"


def _comparison(summary: list[Row], study: SpecimenStudy) -> str:
    """Return what several discrepancies say of the headline parameter, in a sentence or two."""
    scale, unit = study.unit.to_mpa, study.unit.name
    rows = [row for row in summary if not study.is_cut_by_prior(row["formulation"])] or summary
    left_out = len(summary) - len(rows)
    name = study.headline
    means = [row[f"{name}_mean"] / scale for row in rows]
    overlap = max(row[f"{name}_hdi_low"] for row in rows) <= min(row[f"{name}_hdi_high"] for row in rows)
    verdict = (
        "all 95 % intervals overlap"
        if overlap
        else "the 95 % intervals contradict each other: the choice of discrepancy matters more than the noise"
    )
    return (
        f"With {len(rows)} ways to account for model uncertainty, the mean of {name} ranges from "
        f"{significant(min(means))} to {significant(max(means))} {unit}; {verdict}."
        + (
            f" ({left_out} more left out here, because a prior bound determines part of the result.)"
            if left_out
            else ""
        )
    )


def write_inspection(inspections: Sequence[Inspection], folder: Path) -> None:
    """Write figures, converted data and text of every test into an empty folder."""
    experiment = Experiment.of([inspection.reading.experiment for inspection in inspections])
    write_data(folder, experiment, stress_unit(experiment.stress_unit))
    numbers = [f"-{number}" for number in range(1, len(inspections) + 1)] if len(inspections) > 1 else [""]
    figures = {f"curve{number}": curve_figure(item) for number, item in zip(numbers, inspections, strict=True)}
    write_figures(folder, figures)
    (folder / "inspection.txt").write_text("\n\n".join(map(str, inspections)) + "\n", encoding="utf-8")


def curve_figure(inspection: Inspection) -> Figure:
    """Return two panels: every row of the file with what happened in the test, and the rows as they would be fitted.

    Of a loading mode with two stresses, two for each.
    """
    reading = inspection.reading
    count = len(reading.used.labels)
    with new_figure(6.4 * count, 8.4) as figure:
        axes = figure.subplots(2, count, squeeze=False)
        for number, (recorded_axis, fitted_axis) in enumerate(axes.T):
            _draw_recorded(recorded_axis, reading, number)
            _draw_fitted(fitted_axis, reading, number)
    return figure


def _draw_recorded(axis: Axes, reading: Reading, number: int) -> None:
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    stretch, stress = reading.recorded.stretch[number], reading.recorded.stress[number] / unit.to_mpa
    axis.plot(stretch, stress, "-", color=BASE, lw=1, label="all rows")
    axis.plot(stretch[used.rows], stress[used.rows], ".", color=BAND, ms=4, label="rows used")
    for region in reading.regions[number]:
        if len(region.rows):
            marked = np.full(len(stress), np.nan)  # gaps between runs of rows
            marked[used.rows[region.rows]] = stress[used.rows[region.rows]]
            axis.plot(stretch, marked, label=region.kind, **REGIONS[region.kind])
    _label(axis, reading, number, "as recorded")
    axis.legend(fontsize=LETTERS)


def _draw_fitted(axis: Axes, reading: Reading, number: int) -> None:
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    axis.axhline(0, color=BASE, lw=0.8)
    axis.axvline(reading.experiment.mode.controls[0].reference, color=BASE, lw=0.8)
    axis.plot(used.stretch[number], used.stress[number] / unit.to_mpa, ".", color=INK, ms=4)
    _label(axis, reading, number, f"to be fitted: {len(used)} rows")


def _label(axis: Axes, reading: Reading, number: int, title: str) -> None:
    label, controls = reading.used.labels[number], reading.experiment.mode.controls
    axis.set_title(f"{label}, {title}" if label else title, fontsize=LETTERS + 1)
    axis.set_xlabel(controls[0].name if len(controls) == 1 else "stretch", fontsize=LETTERS)
    axis.set_ylabel(f"engineering stress [{reading.experiment.stress_unit}]", fontsize=LETTERS)
    axis.tick_params(labelsize=LETTERS)
