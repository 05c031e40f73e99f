"""The study of several specimens: read, fitted by themselves, and put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from time import perf_counter

from pydantic import Field

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.findings import data_warnings
from tissuq.experiments.reading.notes import each_once
from tissuq.experiments.reading.several_files import find_tests, read_column
from tissuq.experiments.reading.tests_in_file import find_tests_in_file
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material, material_named
from tissuq.population import Population, fit_population
from tissuq.studies.measured_file import FittedSettings, ReadingSettings

__all__ = ["PopulationSettings", "PopulationStudy", "run_population"]

MAX_DATA_WARNINGS = 8
"""Number of different warnings about the data that are shown."""


class PopulationSettings(FittedSettings, ReadingSettings):
    """Everything that a population depends on; the noise in the files' unit of stress.

    Without a mode every test says its own, as for `tissuq.read_experiment`. Of a file of several tests each is of a
    specimen of its own.
    """

    files: tuple[str, ...] = Field(min_length=1)
    specimen: str | None = None
    discrepancy: str = "auto"
    parameters: tuple[str, ...] | None = None
    spread: float = Field(1.0, gt=0, lt=inf)

    def sources(self, folder: Path = Path()) -> dict[str, list[Path]]:
        """Return the files of every specimen; one file alone where a column in it names them."""
        if self.specimen is None:
            return find_tests([folder / file for file in self.files])
        if len(self.files) > 1 or (folder / self.files[0]).is_dir():
            raise InputError(
                "--specimen-column names a column of a single file: give one FILE, or leave --specimen-column out."
            )
        return {Path(self.files[0]).stem: [folder / self.files[0]]}

    def readings(self, folder: Path = Path()) -> dict[str, list[Reading]]:
        """Read the tests of every specimen; relative files lie in ``folder``."""
        sources = self.sources(folder)
        if self.specimen is not None:
            (file,) = next(iter(sources.values()))
            readings = read_column(file, self.specimen, **self.reading_options)
            return {name: [reading] for name, reading in readings.items()}
        specimens: dict[str, list[Reading]] = {}
        for name, files in sources.items():
            tests = [test for file in files for test in find_tests_in_file(file, **self.reading_options)]
            for test in tests:
                is_one = len(files) > 1 or len(tests) == 1
                specimen = name if is_one else test.reading.experiment.specimen or test.name
                experiment = test.reading.experiment.labelled(name=specimen, specimen=specimen)
                specimens.setdefault(specimen, []).append(replace(test.reading, experiment=experiment))
        return specimens


@dataclass(frozen=True)
class PopulationStudy:
    """Results of a population study."""

    settings: PopulationSettings
    tests: dict[str, list[Experiment]]
    population: Population
    seconds: float
    data_warnings: tuple[str, ...] = ()
    """What is implausible in the measurements."""

    @property
    def unit(self) -> StressUnit:
        """The unit in which the files give stresses; MPa where they differ."""
        return _unit(self.tests)

    @property
    def modes(self) -> tuple[LoadingMode, ...]:
        """The different loading modes of the tests."""
        return self.population.complete.model.experiment.modes

    @property
    def warnings(self) -> list[str]:
        """Warnings about data and fit."""
        return [*self.data_warnings, *self.population.warnings]


def run_population(
    settings: PopulationSettings,
    folder: Path = Path(),
    step: Callable[[str], None] = lambda text: None,
    law: Material | None = None,
) -> PopulationStudy:
    """Read the files and find the population of the specimens in them.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When files or settings cannot be used.
    """
    step("reading")
    readings = settings.readings(folder)
    tests = {
        name: [reading.experiment for reading in specimen_readings] for name, specimen_readings in readings.items()
    }
    units = _units(tests)
    if settings.noise_sd != "unknown" and len(units) > 1:
        raise InputError(
            f"the files give stresses in different units ({', '.join(sorted(units))}), so the unit of the "
            "noise is ambiguous: leave --noise-sd out, or convert the files."
        )
    step(f"{len(tests)} specimens")
    start = perf_counter()
    population = fit_population(
        tests,
        parameters=settings.parameters,
        spread=settings.spread,
        material=law or material_named(settings.material),
        discrepancy=settings.discrepancy,
        noise=settings.noise_in(_unit(tests)),
        method=settings.method,
        seed=settings.seed,
    )
    return PopulationStudy(settings, tests, population, perf_counter() - start, _data_warnings(readings))


def _units(tests: Mapping[str, Sequence[Experiment]]) -> set[str]:
    return {test.stress_unit for specimen_tests in tests.values() for test in specimen_tests}


def _unit(tests: Mapping[str, Sequence[Experiment]]) -> StressUnit:
    units = _units(tests)
    return stress_unit(units.pop() if len(units) == 1 else "MPa")


def _data_warnings(readings: Mapping[str, Sequence[Reading]]) -> tuple[str, ...]:
    """Return the warnings about the files, each once with the specimens that it concerns."""
    pairs = ((name, text) for name, of_one in readings.items() for reading in of_one for text in data_warnings(reading))
    messages = each_once(pairs, len(readings), "all specimens")
    omitted = len(messages) - MAX_DATA_WARNINGS
    return (
        *messages[:MAX_DATA_WARNINGS],
        *([f"{omitted} more warnings about the data; see tissuq inspect FILE."] if omitted > 0 else []),
    )
