"""The result of a population: what to expect of a new specimen, tables, draws, figures and the converted data."""

from __future__ import annotations

from collections.abc import Mapping
from math import exp
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.population.answer import (
    ENDS,
    Measured,
    PopulationAnswer,
    answer_of_population,
    headline,
    patient_in_words,
    stresses_where_measured,
)
from tissuq.population.picture import numbers_of
from tissuq.population.warnings import far_specimens
from tissuq.report.inputs import Copies
from tissuq.report.measured import specimens_section
from tissuq.report.population_figures import Bands, headline_figure, patient_figure, specimens_figure
from tissuq.report.population_in_words import (
    FITTED_SEPARATELY,
    QUANTITIES,
    between_specimens,
    effects_of_covariates,
    methods_of_population,
    needed_table_of,
)
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.report.tables import Row, interval, rows_of, significant, with_named_units
from tissuq.report.writer import posterior_files
from tissuq.studies.population import PopulationStudy
from tissuq.studies.settings import DATA, INPUT

if TYPE_CHECKING:
    import pandas as pd

    from tissuq.model.tolerances import Tolerances
    from tissuq.population import Population

PATIENT = "new-patient"
"""Name of the file with the posterior of a new specimen, from which other commands start."""
COVARIATES, SIZES = "covariates-of-specimens", "sizes-of-specimens"
"""The names of the tables of covariates and of sizes in a run's folder."""
NO_RANGE = "Complete pooling treats all specimens as one: its interval does not describe the range of specimens."
SPECIMENS = (
    "Every specimen by itself (grey) and within the population (blue): 95 % interval and median (tick). Bands: 95 % "
    "for a new specimen, and for the median of the population. At the bottom, complete pooling. Bars may run out of "
    "the panel; where the median of a specimen does, it stands at the edge with its interval."
)
AS_TESTED = (
    " Intervals of single specimens are as tested: errors of their tests, such as slack or area, count as differences "
    "between specimens (--estimand specimen tells these apart)."
)
PATIENT_CAPTION = (
    "Without measurement noise. Blue: material from the population, and the model error of a random specimen measured "
    "at that stretch, scaled with the initial modulus. Dotted: the material alone."
)
HOW_TO_READ = (
    "**By itself** (no pooling): only the data of the specimen. **Within the population** (partial pooling): the other "
    "specimens inform what its data do not determine, so a poorly measured specimen moves towards the population and a "
    "well measured one hardly moves.",
    "**A new specimen**: the median and spread of the population with the uncertainty of both. Use this range for "
    "a specimen that has not been measured.",
    "**Complete pooling** treats all specimens as one. Its interval shrinks with every measurement, however much "
    "specimens differ: it understates the uncertainty and is shown for comparison only.",
    "The specimens' model errors are taken to be independent, unless the discrepancy is shared. An error that all of "
    "them share (the same missing physics) does not average out: with --shared-discrepancy it is included in the "
    "intervals of the population median and of a new specimen.",
    "The spread of a positive parameter is a factor: two of three specimens lie between the median divided by it and "
    "the median times it. Files have its logarithm, the sd of the parameter's logarithm.",
)


def population_result(study: PopulationStudy, beside: Path = Path()) -> Result:
    """Return what a population says.

    Parameters
    ----------
    study : PopulationStudy
    beside : Path
        Where the files of the settings lie, unless they are absolute.
    """
    population, unit, settings = study.population, study.unit, study.settings
    copies, relocated = _copies(study, beside)
    law = relocated["material"]
    several = len(study.modes) > 1
    files: dict[str, Any] = {DATA: with_named_units(_data_rows(study, several), ["stress"], unit)}
    summaries = {"population": population.summary, "specimens": population.specimen_summary}
    tables = {name: _with_units(study, summary(unit=unit.name)) for name, summary in summaries.items()}
    tables |= {"covariates": population.effects(unit=unit.name)} if population.covariates else {}
    needed = None if settings.aim is None else population.specimens_needed(settings.aim)
    tables |= {} if needed is None else {"specimens_needed": needed}
    tables |= {"correlations": population.correlations()} if len(population.symbols) > 1 else {}
    bands, not_predicted = stresses_where_measured(population, (True, False))
    if bands:
        band_table = _band_table(bands, several) / unit.to_mpa
        tables["new_patient"] = band_table.rename(columns={name: f"{name} [{unit.name}]" for name in band_table})
    files |= {f"{name}.csv": table.to_csv for name, table in tables.items()} | {"population.nc": population.save}
    count = len(study.tests)
    modes = ", ".join(mode.name for mode in study.modes)
    answer = answer_of_population(
        population, unit, [band for band, _ in bands.values()], settings.without, has_aim=needed is not None
    )
    return Result(
        command="population" + (f" --material {law}" if law != settings.material else ""),
        title=f"{population.complete.model.material.name} parameters of a population of {count} specimens",
        subject=f"{count} specimens, {modes}, {study.measurements} measurements · discrepancy {settings.discrepancy}",
        numbers=tuple(Number(*estimate) for estimate in answer.estimates),
        finding=" ".join(filter(None, (_lead(study, answer), answer.law))),
        uses=answer.uses,
        next_step=answer.next_step.shell,
        picture=Picture(
            "answer", lambda: headline_figure(population, unit),
            f"{headline(population)[0].capitalize()} of every specimen", _about_specimens(population),
        ),
        tables=(
            _parameters(study),
            *effects_of_covariates(study),
            *needed_table_of(study, needed),
        ),
        sections=_sections(study, answer, bands, not_predicted),
        warnings=population.warnings,
        files=files | copies | posterior_files({PATIENT: population.patient}),
        recipe=settings.model_copy(update=relocated),
    )  # fmt: skip


def _note(population: Population) -> str:
    """Return what stands beneath the table: what it is no range of, and what a shared discrepancy changes."""
    if population.shared_covariance is None:
        return NO_RANGE
    widths = population.median_half_widths().to_dict("index")
    of_each = ", ".join(
        f"{symbol} {_share(row['shared'])} ({_share(row['independent'])})" for symbol, row in widths.items()
    )
    return (
        f"{NO_RANGE} Half the 95 % interval of the median over the median: {of_each}; in brackets if the model "
        "error is independent."
    )


def _share(half_width: float) -> str:
    return f"{significant(100 * half_width, 2)} %"


def _sections(
    study: PopulationStudy, answer: PopulationAnswer, bands: Mapping[Measured, Bands], not_predicted: list[str]
) -> tuple[Section, ...]:
    """Return what a page folds: every parameter, new specimens, specimens, how to read it, how it was computed."""
    population, diagnostics = study.population, study.population.diagnostics
    is_one = len(population.symbols) == 1
    specimens = Picture(
        "specimens", lambda: specimens_figure(population, study.unit),
        "Parameters of every specimen by itself and within the population", _about_specimens(population),
        is_one,
    )  # fmt: skip
    headers = ["specimen", "parameter", "unit", "by itself", "95 % interval", "within the population", "95 % interval"]
    sections = [Section("Every specimen", (specimens, Table(headers, _readable_specimens(study), text_columns=(1, 2))))]
    patient: list[Any] = [f"Not predicted: {reason}" for reason in not_predicted]
    if bands:
        patient.append(
            Picture(
                "new_patient", lambda: patient_figure(population, bands, study.unit),
                "Predicted stress of a new specimen", PATIENT_CAPTION, len(bands) == 1,
            )
        )  # fmt: skip
    if patient:
        sections.append(Section("Stress of a new specimen", tuple(patient)))
    pairs = [[str(name), *_text(numbers)] for name, numbers in numbers_of(population.correlations()).items()]
    if pairs:
        table = Table(["parameters", "correlation between specimens", "95 % interval"], pairs)
        sections.append(Section("Correlations", (table,)))
    computed: tuple[str, ...] = (
        FITTED_SEPARATELY,
        between_specimens(study),
        f"The specimens are integrated in closed form. {diagnostics.verdict} Effective share of the draws after "
        f"importance correction: {100 * population.hierarchy.effective:.1f} %. {study.seconds:.0f} s.",
    )
    if tolerances := _tolerances(population):
        sizes = ", ".join(f"{name} {size:.3g}" for name, size in tolerances.sizes.items())
        computed += (f"Errors of the specimens' own tests are included (of the first one: {sizes}).",)
    data = specimens_section(study.tests, population.posteriors, study.unit)
    how_computed = Section("How it was computed", (computed,))
    methods = methods_of_population(study, answer)
    return (*sections, Section("How to read it", (HOW_TO_READ,)), how_computed, data, methods)


def _about_specimens(population: Population) -> str:
    """Return the caption of the figures of all specimens."""
    return SPECIMENS if _tolerances(population) else SPECIMENS + AS_TESTED


def _tolerances(population: Population) -> Tolerances:
    """Return the errors of a specimen's own tests: of the first one, which stands for all."""
    return next(iter(population.posteriors.values())).model.tolerances


def _data_rows(study: PopulationStudy, several: bool) -> list[Row]:
    """Return the measurements, with their loading mode and the stress where there are several."""
    rows: list[Row] = []
    has_stresses = any(len(mode.stresses) > 1 for mode in study.modes)
    for name, tests in study.tests.items():
        for curve in (curve for test in tests for curve in test.curves):
            labels: Row = {"specimen": name} | ({"mode": curve.mode.name} if several else {})
            labels |= {"measured": curve.quantity} if has_stresses else {}
            rows += rows_of({"stretch": curve.abscissa, "stress": curve.stress}, labels)
    return rows


def _band_table(bands: Mapping[Measured, Bands], several: bool) -> pd.DataFrame:
    """Return the stresses of new specimens by stretch, and by mode and stress where there are several."""
    import pandas as pd

    has_stresses = any(len(mode.stresses) > 1 for mode, _ in bands)
    tables = {
        (mode.name,) * several + (mode.stresses[channel],) * has_stresses: pd.DataFrame(vars(band))
        .merge(pd.DataFrame(vars(material_alone)), on="stretch", suffixes=("", "_material_alone"))
        .set_index("stretch")
        for (mode, channel), (band, material_alone) in bands.items()
    }
    names = ["mode"] * several + ["measured"] * has_stresses
    return pd.concat(tables, names=names) if names else next(iter(tables.values()))


def _copies(study: PopulationStudy, beside: Path) -> tuple[Copies, dict[str, Any]]:
    """Return copies of the user's files, so that the run can be repeated, and the settings that name them."""
    settings, copies = study.settings, Copies()
    for name, files in settings.sources(beside).items():
        is_folder = len(files) > 1 or files[0].stem != name
        for file in files:
            copies.of_file(file, f"{INPUT}/{name}" if is_folder else INPUT)
    sources = INPUT if settings.specimen is None else f"{INPUT}/{Path(settings.files[0]).name}"
    relocated: dict[str, Any] = {"files": (sources,), "material": copies.of_law(settings.material)}
    tables = {"covariates": (settings.covariates, COVARIATES), "sizes": (settings.sizes, SIZES)}
    for setting, (table, name) in tables.items():
        if table is not None:
            relocated[setting] = copies.of_file(beside / table, name=f"{name}{Path(table).suffix}")
    return copies, relocated


def _with_units(study: PopulationStudy, table: pd.DataFrame) -> pd.DataFrame:
    """Return a table indexed by parameter, and perhaps quantity, with a column ``unit``."""
    is_log = dict(zip(study.population.symbols, study.population.coordinates.is_log, strict=True))
    units = [
        "" if row.get("quantity") == "spread" and is_log[row["parameter"]] else _unit(study, row["parameter"])
        for row in table.index.to_frame().to_dict("records")
    ]
    table.insert(0, "unit", units)
    return table


def _parameters(study: PopulationStudy) -> Table:
    """Return the parameters of the population in the unit of the files."""
    population, rows = study.population, []
    table = numbers_of(population.summary(unit=study.unit.name))
    for symbol, is_log in zip(population.symbols, population.coordinates.is_log, strict=True):
        for quantity, words in QUANTITIES.items():
            numbers = table[symbol, quantity]
            if quantity == "spread" and is_log:
                cells = ["factor", words, *_text({name: exp(number) for name, number in numbers.items()})]
            else:
                cells = [_unit(study, symbol), words, *_text(numbers)]
            rows.append([symbol, *cells])
    headers = ["parameter", "unit", "quantity", "median", "95 % interval"]
    return Table(headers, rows, f"A population of {len(study.tests)} specimens", (1, 2), _note(population))


def _readable_specimens(study: PopulationStudy) -> list[list[str]]:
    rows, table = [], numbers_of(study.population.specimen_summary(unit=study.unit.name))
    for name in study.population.names:
        for symbol in study.population.symbols:
            numbers = table[name, symbol]
            rows.append([name, symbol, _unit(study, symbol), *_text(numbers, "alone_"), *_text(numbers)])
    return rows


def _unit(study: PopulationStudy, symbol: str) -> str:
    """Return the name of the unit of a parameter."""
    return study.population.unit_of(symbol, study.unit).name


def _text(numbers: Mapping[str, float], prefix: str = "") -> tuple[str, str]:
    """Return a median and an interval with the decimals that its width supports."""
    low, middle, high = (numbers[f"{prefix}{name}"] for name in ("hdi_low", "median", "hdi_high"))
    width = (high - low) / 4
    largest = max(low, middle, high, key=abs)
    return interval(middle, largest, width)[0], "[{}, {}]".format(*interval(low, high, width))


def _lead(study: PopulationStudy, answer: PopulationAnswer) -> str:
    """Return the finding in two sentences."""
    symbol, (words, times) = study.population.symbols[0], headline(study.population)
    quantity = symbol if words == symbol else f"the {words}"
    new, median = (Number(*estimate) for estimate in answer.estimates[:2])
    pooled = numbers_of(study.population.summary(unit=study.unit.name))[symbol, "complete pooling"]
    middle, low, high = (times * pooled[end] for end in ("median", *ENDS))
    complete = Number("complete pooling", middle, low, high)
    far = " ".join(
        f"{name} is {ratio:.2g} times as stiff as the others, which makes these intervals as wide as they are."
        for name, ratio in far_specimens(study.population).items()
    )
    return (
        f"The median of {quantity} in the population{patient_in_words(study.population, {})} is {median.text}; for a "
        f"specimen that has not been measured{patient_in_words(study.population)} it is {new.range} {new.unit} (95 %). "
        f"Taking all measurements for those of one specimen would say {complete.range} {new.unit}, which is no range "
        f"of specimens.{f' {far}' * bool(far)}"
    )
