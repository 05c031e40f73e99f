"""What a page says of covariates of a population and of numbers of specimens, and its methods."""

from __future__ import annotations

from importlib.metadata import version
from math import isnan
from typing import TYPE_CHECKING

from tissuq.population.answer import PopulationAnswer
from tissuq.population.draws import ALL_COVARIATES
from tissuq.population.sample_size import MAX_SPECIMENS
from tissuq.report.measured import (
    INTRODUCTION,
    LAW,
    METHODS,
    SPECIMENS,
    WHOLE_TESTS,
    discrepancy_in_words,
    errors_in_words,
    noise_of_specimens,
)
from tissuq.report.result import Number, Section, Table
from tissuq.report.tables import interval, percent
from tissuq.studies.population import PopulationStudy

if TYPE_CHECKING:
    import pandas as pd

FITTED_SEPARATELY = (
    "Every specimen was fitted separately, with its own discrepancy and noise and wide priors, which are then divided "
    "out (Lunn et al. 2013)."
)


def between_specimens(study: PopulationStudy) -> str:
    """Return how parameters are distributed between specimens, and under which priors."""
    population = study.population
    logs = [s for s, is_log in zip(population.symbols, population.coordinates.is_log, strict=True) if is_log]
    linear = [symbol for symbol in population.symbols if symbol not in logs]
    gaussian = [f"The logarithm{'s' * (len(logs) > 1)} of {', '.join(logs)}"] * bool(logs)
    gaussian += [f"{', '.join(linear)} {'itself' if len(linear) == 1 else 'themselves'}"] * bool(linear)
    sizes = " (in units of the typical size, for parameters of either sign)" if linear else ""
    verb, mean, of_effects = "is" if len(population.symbols) == 1 else "are", "", ""
    if population.covariates:
        effects = ", ".join(f"{name} ({per})" for name, per in population.covariates.effects)
        mean = f", with a mean that is linear in {effects}"
        of_effects = "; of effects, normal with sd 1 (of a number for its standard deviation among the specimens)"
    return (
        f"{' and '.join(gaussian)} {verb} Gaussian between specimens{mean}. The prior of every spread is half-normal "
        f"with sd {study.settings.spread:.3g}{sizes}; of the mean, wide; of correlations, LKJ(2){of_effects}."
    )


def methods_of_population(study: PopulationStudy, answer: PopulationAnswer) -> Section:
    """Return the text for the methods section of a paper: specimens, model, hierarchy, computation and result."""
    population, unit = study.population, study.unit
    model = next(iter(population.posteriors.values())).model
    modes = ", ".join(mode.name for mode in study.modes)
    numbers = (Number(*estimate) for estimate in answer.estimates)
    medians = "; ".join(f"{number.name} {number.text} ({number.range})" for number in numbers)
    sizes = errors_in_words(model.tolerances, unit)
    sentences = (
        INTRODUCTION.format(
            law=LAW.format(model.material),
            version=version("tissuq"),
            data=f"{len(population.posteriors)} specimens ({modes} tests, {study.measurements} measurements)",
        ),
        f"How the file of each was read stands under '{SPECIMENS}'.",
        discrepancy_in_words(model, study.settings.discrepancy),
        noise_of_specimens(population.posteriors, unit),
        WHOLE_TESTS.format(sizes=sizes) if sizes else "",
        FITTED_SEPARATELY,
        between_specimens(study),
        population.diagnostics.verdict,
        f"Posterior medians, with 95 % highest-density intervals: {medians}.",
    )
    return Section(METHODS, (" ".join(filter(None, sentences)),))


HEADERS_OF_EFFECTS = ["parameter", "covariate", "effect", "95 % interval", "positive"]
HEADERS_OF_NUMBERS = ["parameter", "quantity", "now", "with any number", "specimens in all", "more"]
QUANTITIES = {
    "median": "median of the population",
    "spread": "spread between specimens",
    "new specimen": "a new specimen",
    "complete pooling": "complete pooling",
}


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
            "the share that all covariates explain. Positive: the probability that the parameter is larger with it.",
        ),
    )  # fmt: skip


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
