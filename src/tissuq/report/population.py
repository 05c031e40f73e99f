"""The run folder of a population: the converted data, tables, draws, figures and the report."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tissuq.drawing import pieces
from tissuq.drawing.panels import on_figure
from tissuq.drawing.style import BASE, TRUTH, new_figure
from tissuq.errors import ModelError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit
from tissuq.population.picture import height_of, numbers_of
from tissuq.report.run_folder import (
    INPUT,
    copied_laws,
    write_figures,
    write_page,
    write_posteriors,
    write_recipe,
)
from tissuq.report.tables import Row, interval, significant, with_named_units, write_csv
from tissuq.studies.population import PopulationStudy

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tissuq.population import Population

__all__ = [
    "HEADERS",
    "Bands",
    "patient_figure",
    "readable_population",
    "specimens_figure",
    "write_population_run",
]

FloatArray = NDArray[np.float64]
Bands: TypeAlias = "tuple[pd.DataFrame, pd.DataFrame]"
"""Stress of a new patient with the model error, and of the material alone."""


def specimens_figure(population: Population, unit: StressUnit) -> Figure:
    """Return `Population.plot` as a figure of the report, its panels side by side."""
    count = len(population.symbols)
    with new_figure(
        6.4 if count == 1 else min(3.6 * count + 0.6, 12.0), height_of(len(population.names)) + 0.7
    ) as figure:
        population.draw(on_figure(figure, count, count), unit)
    return figure


def patient_figure(population: Population, bands: Mapping[LoadingMode, Bands], unit: StressUnit) -> Figure:
    """Return the stress of a new patient, with and without the model error, over the curves of the specimens.

    Parameters
    ----------
    population : Population
    bands : mapping of LoadingMode to two pandas.DataFrame
        From `Population.new_patient`, with the discrepancy and without; a panel each.
    unit : StressUnit
    """
    with new_figure(6.6 if len(bands) == 1 else min(4.6 * len(bands), 13.8), 4.2) as figure:
        panels = figure.subplots(1, len(bands), squeeze=False)[0]
        for axis, (mode, mode_bands) in zip(panels, bands.items(), strict=True):
            _draw_patient(axis, population, mode, mode_bands, unit)
        panels[0].set_ylabel(f"engineering stress [{unit.name}]")
        panels[0].legend(fontsize=9)
        if len(bands) == 1:
            panels[0].set_title(f"Expected for a new patient: {next(iter(bands)).name}")
        else:
            figure.suptitle("Expected for a new patient")
    return figure


def _draw_patient(axis: Axes, population: Population, mode: LoadingMode, bands: Bands, unit: StressUnit) -> None:
    tests = [test for posterior in population.posteriors.values() for test in posterior.model.experiment.tests]
    for index, data in enumerate(test for test in tests if test.mode == mode):
        order = np.argsort(data.stretch, kind="stable")
        axis.plot(data.stretch[order], data.stress[order] / unit.to_mpa, color=BASE, lw=0.7, alpha=0.7,
                  label="" if index else "measured specimens")  # fmt: skip
    band, material_alone = bands
    low, high = band["low"] / unit.to_mpa, band["high"] / unit.to_mpa
    pieces.band(axis, band["stretch"], low, high, label="a new patient, 95 %")
    pieces.line(axis, band["stretch"], band["median"] / unit.to_mpa, width=1.8, label="median")
    for end in ("low", "high"):
        axis.plot(material_alone["stretch"], material_alone[end] / unit.to_mpa, ":", color=TRUTH, lw=1.4,
                  label="" if end == "high" else "95 % of the material alone")  # fmt: skip
    axis.set_xlabel(mode.controls[0].name)
    axis.set_title(mode.name)


PATIENT = "new-patient"
"""Name of the file with the posterior of a new patient, from which other commands start."""
POINTS = 81
"""Of the stress of a new patient."""
HEADERS = ["parameter", "unit", "quantity", "median", "95 % HPD"]
"""Of `readable_population`."""
QUANTITIES = {
    "median": "median of the population",
    "spread": "spread between specimens",
    "new patient": "a new patient",
    "complete pooling": "complete pooling",
}


def write_population_run(study: PopulationStudy, folder: Path, beside: Path = Path(), *, figures: bool = True) -> None:
    """Write everything that a population leaves behind into an empty folder.

    Parameters
    ----------
    study : PopulationStudy
    folder : Path
        Exists and is empty.
    beside : Path
        Where the files of the settings lie, unless they are absolute.
    figures : bool
        Draw them, too.
    """
    population, unit = study.population, study.unit
    (folder / INPUT).mkdir()
    relocated = {"files": _copied(study, folder, beside), "material": copied_laws(study.settings.material, folder)}
    named = f" --material {relocated['material']}" if relocated["material"] != study.settings.material else ""
    command = f"population{'' if figures else ' --no-figures'}{named}"
    write_recipe(folder, command, study.settings.model_copy(update=relocated))
    several = len(study.modes) > 1
    write_csv(folder / "data.csv", with_named_units(_data_rows(study, several), ["stress"], unit))
    summaries = {"population": population.summary(unit="MPa"), "specimens": population.specimen_summary(unit="MPa")}
    tables = {name: _in_units(study, table) for name, table in summaries.items()}
    tables |= {"correlations": population.correlations()} if len(population.symbols) > 1 else {}
    bands, not_predicted, drawn = *_bands(study), {}
    if bands:
        band_table = _band_table(bands, several) / unit.to_mpa
        tables["new_patient"] = band_table.rename(columns={name: f"{name} [{unit.name}]" for name in band_table})
        drawn = {"new_patient": patient_figure(population, bands, unit)} if figures else {}
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv")
    population.save(folder / "population.nc")
    write_posteriors(folder, {PATIENT: population.patient})
    if figures:
        write_figures(folder, drawn | {"specimens": specimens_figure(population, unit)})
    write_page(folder, "population.html", **_context(study), command=command, not_predicted=not_predicted)


def _data_rows(study: PopulationStudy, several: bool) -> list[Row]:
    """Return the measurements, with their loading mode where there are several."""
    rows: list[Row] = []
    for name, tests in study.tests.items():
        for test in tests:
            labels: Row = {"specimen": name} | ({"mode": test.mode.name} if several else {})
            pairs = zip(test.stretch, test.stress, strict=True)
            rows += [labels | {"stretch": float(stretch), "stress": float(stress)} for stretch, stress in pairs]
    return rows


def _bands(study: PopulationStudy) -> tuple[dict[LoadingMode, Bands], list[str]]:
    """Return the stress of a new patient in every mode, with the model error and without; and why in some not."""
    bands, not_predicted = {}, []
    for mode in study.modes:
        ranges = [test.stretch for tests in study.tests.values() for test in tests if test.mode == mode]
        reach = np.concatenate(ranges)
        stretch = np.linspace(reach.min(), reach.max(), POINTS)
        try:
            band, material_alone = (
                study.population.new_patient(stretch, mode=mode, discrepancy=with_discrepancy, unit="MPa")
                for with_discrepancy in (True, False)
            )
        except ModelError as error:  # some of the population's materials lock before the largest stretch
            not_predicted.append(f"{mode.name}: {error}")
        else:
            bands[mode] = (band, material_alone)
    return bands, not_predicted


def _band_table(bands: Mapping[LoadingMode, Bands], several: bool) -> pd.DataFrame:
    """Return the stresses of new patients, indexed by stretch, and by mode where there are several."""
    import pandas as pd

    tables = {
        mode.name: band.merge(material_alone, on="stretch", suffixes=("", "_material_alone")).set_index("stretch")
        for mode, (band, material_alone) in bands.items()
    }
    return pd.concat(tables, names=["mode"]) if several else next(iter(tables.values()))


def _copied(study: PopulationStudy, folder: Path, beside: Path) -> tuple[str, ...]:
    """Copy the user's files, so that the run can be repeated, and return what names them there."""
    for name, files in study.settings.sources(beside).items():
        is_folder = len(files) > 1 or files[0].stem != name
        target = folder / INPUT / name if is_folder else folder / INPUT
        target.mkdir(exist_ok=True)
        for file in files:
            shutil.copyfile(file, target / file.name)
    return (INPUT,) if study.settings.specimen is None else (f"{INPUT}/{Path(study.settings.files[0]).name}",)


def _in_units(study: PopulationStudy, table: pd.DataFrame) -> pd.DataFrame:
    """Return a table indexed by parameter, and perhaps quantity, in the unit of the files, with a column ``unit``."""
    is_log = dict(zip(study.population.symbols, study.population.coordinates.is_log, strict=True))
    scales = [
        (1.0, "") if row.get("quantity") == "spread" and is_log[row["parameter"]] else _scale(study, row["parameter"])
        for row in table.index.to_frame().to_dict("records")
    ]
    scaled = table.div([factor for factor, _ in scales], axis=0)
    scaled.insert(0, "unit", [name for _, name in scales])
    return scaled


def readable_population(study: PopulationStudy) -> list[list[str]]:
    """Return the rows of the summary as text, under `HEADERS`, in the unit of the files."""
    population, rows = study.population, []
    table = numbers_of(population.summary(unit="MPa"))
    for symbol, is_log in zip(population.symbols, population.coordinates.is_log, strict=True):
        factor, unit = _scale(study, symbol)
        for quantity, words in QUANTITIES.items():
            is_ratio = quantity == "spread" and is_log
            cells = _text(table[symbol, quantity], 1.0 if is_ratio else factor)
            rows.append([symbol, "sd of the log" if is_ratio else unit, words, *cells])
    return rows


def _readable_specimens(study: PopulationStudy) -> list[list[str]]:
    rows, table = [], numbers_of(study.population.specimen_summary(unit="MPa"))
    for name in study.population.names:
        for symbol in study.population.symbols:
            factor, unit = _scale(study, symbol)
            numbers = table[name, symbol]
            rows.append([name, symbol, unit, *_text(numbers, factor, "alone_"), *_text(numbers, factor)])
    return rows


def _scale(study: PopulationStudy, symbol: str) -> tuple[float, str]:
    """Return what one unit of a parameter is in MPa, and the unit's name."""
    unit = study.population.unit_of(symbol, study.unit)
    return unit.to_mpa, unit.name


def _text(numbers: Mapping[str, float], factor: float = 1.0, prefix: str = "") -> tuple[str, str]:
    """Return a median and an interval with the decimals that its width supports."""
    low, middle, high = (numbers[f"{prefix}{name}"] / factor for name in ("hdi_low", "median", "hdi_high"))
    width = (high - low) / 4
    return interval(middle, middle, width)[0], "[{}, {}]".format(*interval(low, high, width))


def _context(study: PopulationStudy) -> dict[str, Any]:
    population, diagnostics = study.population, study.population.diagnostics
    logs = [s for s, is_log in zip(population.symbols, population.coordinates.is_log, strict=True) if is_log]
    pairs = numbers_of(population.correlations())
    return {
        "settings": study.settings,
        "count": len(study.tests),
        "measurements": sum(len(test) for tests in study.tests.values() for test in tests),
        "is_one": len(population.symbols) == 1,
        "is_in_modes": len(study.modes) > 1,
        "mode": ", ".join(mode.name for mode in study.modes),
        "lead": _lead(study),
        "warnings": study.warnings,
        "headers": HEADERS,
        "summary": readable_population(study),
        "correlations": [[name, *_text(numbers)] for name, numbers in pairs.items()],
        "specimens": _readable_specimens(study),
        "verdict": diagnostics.verdict,
        "effective": f"{population.hierarchy.effective:.1%}",
        "seconds": f"{study.seconds:.0f}",
        "logs": logs,
        "linear_symbols": [symbol for symbol in population.symbols if symbol not in logs],
    }


def _lead(study: PopulationStudy) -> str:
    """Return the finding in two sentences."""
    symbol = study.population.symbols[0]
    factor, unit = _scale(study, symbol)
    table = numbers_of(study.population.summary(unit="MPa"))
    middle = significant(table[symbol, "median"]["median"] / factor)
    new, complete = (
        _text(table[symbol, name], factor)[1].strip("[]").replace(",", " to")
        for name in ("new patient", "complete pooling")
    )
    return (
        f"The median of {symbol} in the population is {middle} {unit}; for a patient who has not been measured it is "
        f"{new} {unit} (95 %). Taking all measurements for those of one specimen would say {complete} {unit}, which is "
        "no range of patients."
    )
