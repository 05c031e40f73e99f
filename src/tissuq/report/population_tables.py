"""Tables of a population for people: effects of covariates, and how many specimens are needed."""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING

from tissuq.population.draws import ALL_COVARIATES
from tissuq.population.sample_size import MAX_SPECIMENS
from tissuq.report.result import Table
from tissuq.report.tables import interval, percent
from tissuq.studies.population import PopulationStudy

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["effects_of_covariates", "needed_of", "needed_table_of", "patient_in_words"]

HEADERS_OF_EFFECTS = ["parameter", "covariate", "effect", "95 % interval", "positive"]
HEADERS_OF_NUMBERS = ["parameter", "quantity", "now", "with any number", "specimens in all", "more"]
QUANTITIES = {"median": "median of the population", "new patient": "a new specimen"}


def effects_of_covariates(study: PopulationStudy) -> tuple[Table, ...]:
    """Return the table of effects in the unit of the files; none without covariates."""
    population = study.population
    if not population.covariates:
        return ()
    rows = []
    for row in population.effects(unit=study.unit.name).reset_index().to_dict("records"):
        symbol, name = str(row["parameter"]), str(row["covariate"])
        is_share = row["kind"] == "share"
        numbers = [row[end] for end in ("hdi_low", "median", "hdi_high")]
        sd = (numbers[2] - numbers[0]) / 4
        low, median, high = (percent(number) if is_share else interval(number, number, sd)[0] for number in numbers)
        unit = population.unit_of(symbol, study.unit).name if row["kind"] == "difference" else ""
        sign = "× " if row["kind"] == "factor" else ""
        words = f"{sign}{median}{f' {unit}' * bool(unit)} {row['per']}"
        cells = "" if is_share else percent(row["positive"])
        rows.append([symbol, "all" if name == ALL_COVARIATES else name, words, f"[{low}, {high}]", cells])
    return (
        Table(
            HEADERS_OF_EFFECTS, rows, "Effects of covariates", (1, 2),
            f"Medians of the population are at {population.covariates.described({})}; a new specimen has "
            f"{population.covariates.described(population.patient_covariates)}. Of the variance between specimens: "
            "the share that all covariates explain.",
        ),
    )  # fmt: skip


def patient_in_words(study: PopulationStudy) -> str:
    """Return what is known of the new specimen, in brackets; nothing without covariates."""
    text = study.population.covariates.described(study.population.patient_covariates)
    return f" ({text})" if text else ""


def needed_of(study: PopulationStudy) -> pd.DataFrame | None:
    """Return `Population.specimens_needed` for the aim of the settings, if there is one."""
    aim = study.settings.aim
    return None if aim is None else study.population.specimens_needed(aim)


def needed_table_of(study: PopulationStudy, needed: pd.DataFrame | None) -> tuple[Table, ...]:
    """Return the table of how many specimens are needed; none without an aim."""
    if needed is None:
        return ()
    aim, rows = float(study.settings.aim or 0.0), []
    for row in needed.reset_index().to_dict("records"):
        total, floor = float(row["specimens"]), float(row["floor"])
        none = "not reached: specimens differ more" if floor else f"more than {MAX_SPECIMENS}"
        cells = [none, ""] if isnan(total) else [f"{total:.0f}", f"{row['more']:.0f}"]
        shown = [f"± {percent(row['now'])}", f"± {percent(floor)}" if floor else ""]
        rows.append([str(row["parameter"]), QUANTITIES[str(row["quantity"])], *shown, *cells])
    return (
        Table(
            HEADERS_OF_NUMBERS, rows, f"Specimens like these for ± {percent(aim)} (95 %)", (1, 4),
            "Half the interval over the median. With so many specimens four of five populations reach the aim. However "
            "many there are, specimens differ as much as they do. By how much is not known well from few specimens, so "
            "that the interval of a new specimen with any number, which holds in four of five, may be wider than now.",
        ),
    )  # fmt: skip
