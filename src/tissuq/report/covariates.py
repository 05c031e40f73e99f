"""Effects of covariates on a population, as tables and sentences for people, and the copy of their file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tissuq.population.effects import ALL_COVARIATES
from tissuq.report.result import Table
from tissuq.report.run_folder import INPUT
from tissuq.report.tables import percent, significant
from tissuq.studies.population import PopulationStudy

__all__ = ["copy_of_covariates", "effects_of_covariates", "patient_in_words"]

HEADERS = ["parameter", "covariate", "effect", "95 % HPD", "positive"]
COPY = "covariates-of-specimens"
"""The name of the table of covariates in a run's folder."""


def effects_of_covariates(study: PopulationStudy) -> tuple[Table, ...]:
    """Return the table of effects in the unit of the files; none without covariates."""
    population = study.population
    if not population.covariates:
        return ()
    rows = []
    for row in population.effects(unit=study.unit.name).reset_index().to_dict("records"):
        symbol, name = str(row["parameter"]), str(row["covariate"])
        is_share = row["kind"] == "share"
        digits = 4 if row["kind"] == "factor" else 3
        low, median, high = (
            percent(row[end]) if is_share else significant(row[end], digits)
            for end in ("hdi_low", "median", "hdi_high")
        )
        unit = population.unit_of(symbol, study.unit).name if row["kind"] == "difference" else ""
        sign = "× " if row["kind"] == "factor" else ""
        words = f"{sign}{median}{f' {unit}' * bool(unit)} {row['per']}"
        cells = "" if is_share else percent(row["positive"])
        rows.append([symbol, "all" if name == ALL_COVARIATES else name, words, f"[{low}, {high}]", cells])
    return (
        Table(
            HEADERS, rows, "Effects of covariates", (1, 2),
            f"Medians of the population are at {population.covariates.described({})}; a new patient has "
            f"{population.covariates.described(population.patient_covariates)}. Of the variance between specimens: "
            "the share that all covariates explain.",
        ),
    )  # fmt: skip


def patient_in_words(study: PopulationStudy) -> str:
    """Return what is known of the new patient, in brackets; nothing without covariates."""
    text = study.population.covariates.described(study.population.patient_covariates)
    return f" ({text})" if text else ""


def copy_of_covariates(study: PopulationStudy, beside: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the user's table of covariates as a file of the run, and the setting that names it there."""
    if study.settings.covariates is None:
        return {}, {}
    source = beside / study.settings.covariates
    place = f"{INPUT}/{COPY}{source.suffix}"
    return {place: source}, {"covariates": place}
