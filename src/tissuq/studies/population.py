"""The study of several specimens: read, fitted by themselves, and put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, cast

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.findings import experiment_of
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material, material_named
from tissuq.population import Population, fit_population
from tissuq.population.covariates import covariates_of
from tissuq.population.pooling import MIN_SPECIMENS
from tissuq.studies.fit_settings import PopulationSettings

if TYPE_CHECKING:
    from tissuq.posterior.solver import Method


@dataclass(frozen=True)
class PopulationStudy:
    """Results of a population study."""

    settings: PopulationSettings
    tests: dict[str, list[Experiment]]
    population: Population
    seconds: float

    @property
    def unit(self) -> StressUnit:
        """The unit in which stresses are shown: that of the files, MPa where they differ, or a smaller one."""
        largest = max(abs(test.measured).max() for of_one in self.tests.values() for test in of_one)
        return _unit(self.tests).readable(float(largest))

    @property
    def modes(self) -> tuple[LoadingMode, ...]:
        """The different loading modes of the tests."""
        return self.population.complete.model.experiment.modes

    @property
    def measurements(self) -> int:
        """How many measurements there are of all specimens."""
        return sum(len(test) for tests in self.tests.values() for test in tests)


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
    tests = {name: [*map(experiment_of, readings)] for name, readings in settings.readings(folder).items()}
    if len(tests) < MIN_SPECIMENS:
        raise InputError(
            f"a population needs {MIN_SPECIMENS} specimens or more; there are {len(tests)} ({', '.join(tests)}). Give "
            "files of more, or use tissuq fit. Files that name the same specimen are tests of it; where they are of "
            "others all the same, put each into a folder named after its specimen, and give the folder of all."
        )
    units = _units(tests)
    if settings.noise_sd != "unknown" and len(units) > 1:
        raise InputError(
            f"the files give stresses in different units ({', '.join(sorted(units))}), so the unit of the "
            "noise is ambiguous: leave --noise-sd out, or convert the files."
        )
    table = settings.covariate_table(tests, folder)
    values = {name: row for name, row in table.values().items() if name not in settings.without} if table else None
    covariates = covariates_of(values, list(tests), table.place if table else None)
    covariates.row(settings.new_patient)  # raises where there is no such patient, before specimens are fitted
    unit, noise_sd = _unit(tests), None
    if isinstance(settings.noise_sd, dict):
        noise_sd = {name: sd if sd == "unknown" else sd * unit.to_mpa for name, sd in settings.noise_sd.items()}
    step(f"{len(tests)} specimens")
    start = perf_counter()
    population = fit_population(
        tests,
        parameters=settings.parameters,
        spread=settings.spread,
        covariates=covariates,
        shared_discrepancy=settings.shared_discrepancy,
        material=law or material_named(settings.material),
        discrepancy=settings.discrepancy,
        noise=settings.noise_in(unit) if noise_sd is None else None,
        noise_sd=noise_sd,
        tolerances=settings.tolerances_in(unit),
        method=cast("Method", settings.method),
        seed=settings.seed,
    ).given(settings.new_patient)
    return PopulationStudy(settings, tests, population, perf_counter() - start)


def _units(tests: Mapping[str, Sequence[Experiment]]) -> set[str]:
    return {test.stress_unit for specimen_tests in tests.values() for test in specimen_tests}


def _unit(tests: Mapping[str, Sequence[Experiment]]) -> StressUnit:
    units = _units(tests)
    return stress_unit(units.pop() if len(units) == 1 else "MPa")
