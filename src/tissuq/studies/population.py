"""The study of several specimens: read, fitted by themselves, and put together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import perf_counter

from pydantic import Field

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.specimens import find_tests, read_specimens, read_specimens_in
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material, material_named
from tissuq.population import Population, fit_population
from tissuq.studies.measured import MeasuredSettings

__all__ = ["PopulationSettings", "PopulationStudy", "run_population"]


class PopulationSettings(MeasuredSettings):
    """Everything that a population depends on; the noise in the files' unit of stress."""

    files: tuple[str, ...] = Field(min_length=1)
    specimen: str | None = None
    discrepancy: str = "auto"
    parameters: tuple[str, ...] | None = None
    spread: float = Field(1.0, gt=0, lt=inf)

    def tests(self, folder: Path = Path()) -> dict[str, list[Path]]:
        """Return the files of every specimen; one file alone where a column in it names them."""
        if self.specimen is None:
            return find_tests([folder / file for file in self.files])
        if len(self.files) > 1 or (folder / self.files[0]).is_dir():
            raise InputError("a column names the specimens of one file: give one FILE, or leave --specimen out.")
        return {Path(self.files[0]).stem: [folder / self.files[0]]}

    def experiments(self, folder: Path = Path()) -> dict[str, Experiment]:
        """Read the measurements of every specimen; relative files lie in ``folder``."""
        tests = self.tests(folder)
        if self.specimen is None:
            return read_specimens(tests, **self.reading)
        return read_specimens_in(next(iter(tests.values()))[0], self.specimen, **self.reading)


@dataclass(frozen=True)
class PopulationStudy:
    """What was found."""

    settings: PopulationSettings
    experiments: dict[str, Experiment]
    population: Population
    seconds: float

    @property
    def unit(self) -> StressUnit:
        """The unit in which the files give stresses; MPa where they differ."""
        return _unit(self.experiments)

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
        found = list(self.population.warnings)
        if any("the file states no unit" in each.source for each in self.experiments.values()):
            found.insert(
                0, "a file states no unit of stress, so MPa was assumed; if it is another, give --stress-unit."
            )
        return found


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
    experiments = settings.experiments(folder)
    units = {each.stress_unit for each in experiments.values()}
    if settings.noise_sd != "unknown" and len(units) > 1:
        raise InputError(
            f"the files give stresses in different units ({', '.join(sorted(units))}), so that it is not clear which "
            "one the noise is in: leave --noise-sd out, or convert the files."
        )
    step(f"{len(experiments)} specimens")
    start = perf_counter()
    population = fit_population(
        experiments,
        parameters=settings.parameters,
        spread=settings.spread,
        material=law or material_named(settings.material),
        discrepancy=settings.discrepancy,
        noise=settings.noise_in(_unit(experiments)),
        method=settings.method,
        seed=settings.seed,
    )
    return PopulationStudy(settings, experiments, population, perf_counter() - start)


def _unit(experiments: dict[str, Experiment]) -> StressUnit:
    units = {each.stress_unit for each in experiments.values()}
    return stress_unit(units.pop() if len(units) == 1 else "MPa")
