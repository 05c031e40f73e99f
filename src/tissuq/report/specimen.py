"""The result of a fit of one material: the answer, the discrepancies beside one another, tests from the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.assessment import Assessment
from tissuq.assessment.answer import NOTABLE_SHARE
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.experiments.units import stress_unit
from tissuq.pictures.answer import answer_on_new_figure
from tissuq.pictures.curves import Described
from tissuq.report.chart import chart_data
from tissuq.report.figures import described_curves, marginal_figure, predictive_figure
from tissuq.report.inputs import with_inputs
from tissuq.report.measured import computed_section, data_section, methods_section, named, subject_of
from tissuq.report.result import Block, Number, Picture, Result, Section, Table
from tissuq.report.run_folder import ASSESSMENT
from tissuq.report.summary import (
    held_out_files,
    held_out_table,
    parameter_table,
    stability_cells,
    stability_rows,
    stability_section,
    summary_row,
    summary_table,
    summary_tables,
)
from tissuq.report.tables import Row, significant
from tissuq.report.writer import data_file, posterior_files
from tissuq.result_warning import has_code
from tissuq.studies.specimen import SpecimenStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MARGINALS = "Marginal posteriors of {name}: density (each to its own scale), 95 % interval (bar) and median (dot)."
CHECKS = (
    "A good predictive check (many measurements inside the band) says nothing about the parameter: a flexible "
    "discrepancy passes it even if it has absorbed part of the stiffness. Where the band of the material alone misses "
    "the data, the material alone does not describe this specimen."
)
WITH_DISCREPANCY = (
    "95 % predictive bands with the discrepancy and noise (eq. 27 of Zeraatpisheh, Bordas & Beex 2021). Shaded: "
    "stability of the material with an energy discrepancy is lost with a probability above 5 %."
)
MODEL_ALONE = (
    "95 % bands of the material alone, with noise (eq. 28 of the same paper). Shaded: its stability, beside a "
    "discrepancy that is no energy, is lost with a probability above 5 %."
)
EVIDENCE = (
    "The log evidence is that of the data in MPa with respect to the normalised priors, uniform densities included. "
    "Differences in it compare descriptions of these data under these priors; they do not say which {name} is true."
)


def specimen_answer(study: SpecimenStudy) -> Result:
    """Return the answer of a fit alone, which is there before anything is assessed."""
    answer, unit = study.answer, study.unit
    return Result(
        command="fit",
        title=f"{named(study.experiment)}: {study.posteriors[study.main].model.material.name}",
        subject=f"{subject_of(study.experiment)} · discrepancy {study.main}",
        numbers=tuple(
            Number(name, mean / unit.to_mpa, low / unit.to_mpa, high / unit.to_mpa, unit.name)
            for name, mean, low, high in answer.estimates
        )
        + _over_discrepancies(study),
        finding=" ".join(answer.sentences),
        uses=answer.uses,
        next_step=answer.next_step.shell,
        warnings=tuple(study.warnings),
    )


def specimen_result(study: SpecimenStudy, beside: Path = Path()) -> Result:
    """Return what a fit says; relative files of its settings lie in ``beside``."""
    unit, posteriors = study.unit, study.posteriors
    summary = []
    for name, posterior in posteriors.items():
        more: Row = {"estimand": posterior.model.tolerances.estimand, "noise_lag": posterior.model.fitted_errors.lag}
        more |= stability_cells(posterior)
        summary.append(summary_row(name, posterior, study.seconds[name], more=more))

    @cache
    def computed() -> dict[str, Sequence[Described]]:
        return {name: described_curves(posterior) for name, posterior in posteriors.items()}

    result = replace(
        specimen_answer(study),
        picture=Picture(
            "answer",
            lambda: answer_on_new_figure(computed()[study.main], unit, is_narrow=True),
            "Measurements, and the 95 % predictive band of material, discrepancy and noise",
            "Measurements, and the 95 % band of new ones.",
            chart=lambda: chart_data(posteriors, study.main, unit, computed()),
        ),
        tables=_tables(study, summary),
        sections=_sections(study, summary, partial(_predictive, study, computed)),
        files=_files(study, summary),
    )
    return with_inputs(result, study, beside)


def _files(study: SpecimenStudy, summary: list[Row]) -> dict[str, Any]:
    """Return the tables, measurements and posteriors of the run folder."""
    files: dict[str, Any] = data_file(study.experiment, study.unit)
    files |= summary_tables(summary, study.posteriors, unit=study.unit) | posterior_files(study.posteriors)
    files[ASSESSMENT] = [_assessment_row(*item) for item in study.assessments.items()]
    if stability := stability_rows(study.posteriors):
        files["stability.csv"] = stability
    if study.held_out:
        files |= held_out_files(study.held_out, study.headline, study.unit)
    return files


def _assessment_row(name: str, assessment: Assessment) -> Row:
    modulus = [value / stress_unit(assessment.unit).to_mpa for value in assessment.modulus]
    return {"formulation": name, **asdict(assessment), "modulus": modulus, "sentences": assessment.sentences}


def _tables(study: SpecimenStudy, summary: list[Row]) -> tuple[Table, ...]:
    """Return the discrepancies beside one another, and how tests are predicted from the others."""
    tables = []
    if len(summary) > 1:
        words = f"{_comparison(summary, study)} The answer above is that of '{study.main}'."
        table = _summary_table(study, summary)
        tables.append(replace(table, note=f"{words} {table.note}", picture=_marginals(study)))
    if study.held_out:
        tables.append(held_out_table(study.held_out, study.headline, study.unit))
    return tuple(tables)


def _summary_table(study: SpecimenStudy, summary: list[Row]) -> Table:
    law = study.posteriors[study.main].model.material.name
    title = f"{study.experiment.name}: {law} with model uncertainty"
    return summary_table(summary, study.unit, title, study.main)


def _marginals(study: SpecimenStudy) -> Picture:
    name = study.headline
    return Picture(
        "marginals", lambda: marginal_figure(study.posteriors, name, study.unit), f"Marginal posteriors of {name}",
        MARGINALS.format(name=name), is_slim=True,
    )  # fmt: skip


def _predictive(study: SpecimenStudy, computed: Any, *, discrepancy: bool) -> Figure:
    return predictive_figure(study.posteriors, discrepancy=discrepancy, unit=study.unit, computed=computed())


def _sections(study: SpecimenStudy, summary: list[Row], predictive: Any) -> tuple[Section, ...]:
    """Return what a page folds: the material's faults, checks, stability, parameters, methods, data."""
    is_slim, is_single = len(summary) < 3, len(summary) == 1
    checks: list[Block] = [CHECKS]
    of_parameters: list[Block] = []
    if is_single:  # several are compared above
        checks.append(_summary_table(study, summary))
        of_parameters.append(_marginals(study))
    for name, kind, alt, caption in (
        ("with_discrepancy", True, "Predictive bands with the discrepancy", WITH_DISCREPANCY),
        ("model_alone", False, "Predictive bands of the model alone", MODEL_ALONE),
    ):
        checks.append(Picture(name, partial(predictive, discrepancy=kind), alt, caption, is_slim))
    of_parameters.append(parameter_table(study.posteriors))
    cautions = tuple(
        f"**{name}**: {posterior.model.discrepancy.caution}"
        for name, posterior in study.posteriors.items()
        if posterior.model.discrepancy.caution
    )
    if cautions:
        of_parameters.append(cautions)
    sections = [_extent(study.assessments)] if study.assessments else []
    sections.append(Section("Predictive checks", tuple(checks)))
    if rows := stability_rows(study.posteriors):
        sections.append(stability_section(rows))
    sections.append(Section("Every parameter", tuple(of_parameters)))
    evidence = EVIDENCE.format(name=study.headline)
    sections.append(computed_section(study.posteriors, study.skipped, evidence, seconds=study.seconds))
    return (*sections, data_section(study, study.posteriors[study.main]), methods_section(study))


def _extent(assessments: Mapping[str, Assessment]) -> Section:
    """Return to what extent the material is wrong, by discrepancy where there are several."""
    blocks: list[Block] = []
    for name, assessment in assessments.items():
        if len(assessments) > 1:
            blocks.append(f"**{name}**")
        blocks.append(tuple(assessment.sentences))
    return Section("To what extent the material is wrong", tuple(blocks))


def _uncut(study: SpecimenStudy) -> list[str]:
    """Return the discrepancies whose posteriors no bound of a prior cuts, or all where each is cut."""
    uncut = [name for name, fit in study.posteriors.items() if not has_code(fit.warnings, "prior-bound")]
    return uncut or list(study.posteriors)


def _over_discrepancies(study: SpecimenStudy) -> tuple[Number, ...]:
    """Return between what the mean of the headline parameter lies with several discrepancies; nothing of one.

    With those of which it is not in the interval that the answer gives.
    """
    if len(study.posteriors) == 1:
        return ()
    means = {name: study.posteriors[name].marginals[study.headline].mean / study.unit.to_mpa for name in _uncut(study)}
    ends = f"{significant(min(means.values()))} to {significant(max(means.values()))} {study.unit.name}"
    low, high = (end / study.unit.to_mpa for end in study.posteriors[study.main].marginals[study.headline].hdi())
    outside = [name for name, mean in means.items() if not low <= mean <= high]
    shares = [abs(shares_of_discrepancy(study.posteriors[name].solution)[1][0]) for name in outside]
    reason = " (they change the initial stiffness)" if min(shares, default=0.0) > NOTABLE_SHARE else ""
    remark = f"the answer is that of {study.main}; beyond its interval: {', '.join(outside)}{reason}" if outside else ""
    return (Number(f"{study.headline} with {len(means)} discrepancies", ends, remark=remark),)


def _comparison(summary: list[Row], study: SpecimenStudy) -> str:
    """Return what several discrepancies say of the headline parameter, in a sentence or two."""
    scale, unit = study.unit.to_mpa, study.unit.name
    uncut, name = _uncut(study), study.headline
    rows = [row for row in summary if row["formulation"] in uncut]
    left_out = [discrepancy for discrepancy in study.posteriors if discrepancy not in uncut]
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
            f" (Left out here, because a prior bound determines part of the result: {', '.join(left_out)}.)"
            if left_out
            else ""
        )
        + _of_what(study)
    )


def _of_what(study: SpecimenStudy) -> str:
    """Return a sentence about intervals that are not of the same; nothing where all are."""
    names: dict[str, list[str]] = {}
    for name, posterior in study.posteriors.items():
        names.setdefault(posterior.model.meaning, []).append(name)
    if len(names) == 1:
        return ""
    of_names = "; ".join(f"those of {', '.join(group)} are of {meaning}" for meaning, group in names.items())
    return f" The intervals mean different things, so do not compare their widths: {of_names}."
