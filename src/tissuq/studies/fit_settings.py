"""What a fit depends on: of a material with several discrepancies, of several laws, or of a population."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import chain, repeat
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, Self

from pydantic import Field, field_validator, model_validator

from tissuq.errors import InputError
from tissuq.studies.measured_file import (
    HELP_ON_AXIAL_STRETCH,
    READING,
    FittedSettings,
    MeasuredFile,
    MeasuredTest,
    ReadingSettings,
)
from tissuq.studies.option import argument, option, table_of_sizes
from tissuq.studies.option_texts import aimed_share, noises, pairs_of, priors
from tissuq.studies.settings import looked_up

if TYPE_CHECKING:
    from tissuq.experiments.experiment import Experiment
    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.experiments.reading.options import ReadingOptions
    from tissuq.experiments.reading.specimens_in_files import CovariateTable
    from tissuq.experiments.units import StressUnit
    from tissuq.mechanics import Material
    from tissuq.model.noise import Noise

ALL = "all"
"""In place of discrepancies: the paper's and the average of energies, where they apply; in place of laws: all."""


class SpecimenSettings(FittedSettings, MeasuredFile):
    """Everything that a fit depends on; stresses (noise, priors) in the unit of stress of the file, or the first one.

    It is of one ``file``, or of several ``tests`` together.
    """

    file: str = argument(
        "",
        "CSV, Excel or other file, or the name of a built-in data set (tissuq datasets); several files, a folder of "
        "them, or several tests in a file are fitted together; FILE#NAME is one of these. Or STUDY.toml, as tissuq "
        "inspect --write makes it.",
        takes=list[Path],
    )
    tests: tuple[MeasuredTest, ...] = ()
    material: str = option(
        "neo-hookean",
        "Material, a sum (gent+mooney-rivlin), or your own law.py:Name [neo-hookean]; see tissuq materials. Repeat for "
        "more, or 'all', to compare laws.",
        takes=list[str],
    )
    discrepancies: tuple[str, ...] = option(
        ("auto",),
        "Discrepancy; repeat for more; 'all' fits the paper's seven and auto [auto].",
        name="discrepancy",
        min_length=1,
    )
    noise_sd: float | Literal["unknown"] = option(
        "unknown",
        "Sd of the noise of the engineering stress, in the file's stress unit, or unknown [unknown]; for several files "
        "also one for each, with commas.",
        takes=str,
        parse=noises,
    )
    priors: dict[str, dict[str, float | str]] = option(
        help="A prior in the file's stress unit, such as C10=uniform(0,5); repeat for more.",
        default_factory=dict,
        name="prior",
        parse=priors,
    )
    mode: str | None = option(
        None, "Loading mode [uniaxial]; once for each of several files [as they or their names say].", takes=list[str]
    )
    axial_stretch: float | None = option(None, HELP_ON_AXIAL_STRETCH, group=READING, gt=0, takes=list[float])
    stable_in: tuple[str, ...] = option((), "Require stability in this loading mode, or in all; repeat for more.")
    held_out: bool = option(False, "Also predict each of several tests from the others.")

    @field_validator("discrepancies")
    @classmethod
    def _all_or_named(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if ALL in names and names != (ALL,):
            raise ValueError(f"'{ALL}' cannot be combined with other names; give '{ALL}', or names")
        from tissuq.model.discrepancy import discrepancy_named

        for name in names:
            if name != ALL:
                looked_up(discrepancy_named, name)
        return names

    @field_validator("stable_in")
    @classmethod
    def _modes_there_are(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        from tissuq.assessment.stable_posterior import modes_named

        looked_up(modes_named, names)
        return names

    @model_validator(mode="after")
    def _measured(self) -> Self:
        if bool(self.file) == bool(self.tests):
            raise ValueError("give one file, or several tests with a file each")
        reading = {"name", *ReadingSettings.model_fields}
        if self.tests and self.model_fields_set & reading:
            misplaced = ", ".join(sorted(self.model_fields_set & reading))
            raise ValueError(f"reading options belong in each of the tests, not beside them ({misplaced})")
        has_noise_sd = [test.noise_sd is not None for test in self.tests]
        if any(has_noise_sd) and (not all(has_noise_sd) or self.noise or self.noise_sd != "unknown"):
            raise ValueError("give noise_sd for each of the tests, or once for all of them")
        if self.held_out and (len(self.tests) < 2 or any(has_noise_sd)):
            raise ValueError("held_out needs two or more tests, and one noise_sd for all of them or an unknown one")
        return self

    def sources(self, folder: Path) -> list[Path]:
        """Return the file, or those of all tests."""
        return [folder / test.file for test in self.tests or (self,)]

    def readings(self, folder: Path = Path(), found: Sequence[Reading | None] = ()) -> list[Reading]:
        """Return what is read from the file, or those of all tests, unless that is found."""
        tests = self.tests or (self,)
        of_tests = found or repeat(None, len(tests))
        return [test.reading(folder, of_test) for test, of_test in zip(tests, of_tests, strict=True)]

    def fitted_laws(self, own: Mapping[str, Material] = MappingProxyType({})) -> dict[str, Material]:
        """Return the laws that are fitted, by name; those in files of the user are given as ``own``."""
        from tissuq.mechanics import material_named

        return {self.material: own.get(self.material) or material_named(self.material)}

    def experiment(self, folder: Path = Path(), found: Sequence[Reading | None] = ()) -> Experiment:
        """Read the measurements, of all tests together, unless they are found.

        Raises
        ------
        InputError
            When they cannot be read, or have several units of stress where the settings state a stress in "the" unit.
        """
        from tissuq.experiments.experiment import Experiment
        from tissuq.experiments.reading.findings import experiment_of
        from tissuq.experiments.units import stress_unit
        from tissuq.model.tolerances import Tolerances

        tests = list(map(experiment_of, self.readings(folder, found)))
        units = {stress_unit(test.stress_unit).to_mpa: test.stress_unit for test in tests}
        stated = {
            "noise, unless each test has its own,": self.noise_sd != "unknown",
            "priors": bool(self.priors),
            "tolerances": any(error.is_stress for error, _ in Tolerances(**(self.tolerances or {}))),
        }
        if len(units) > 1 and any(stated.values()):
            raise InputError(
                f"the files give stresses in different units ({', '.join(units.values())}), so that the unit of the "
                f"{' and '.join(name for name, is_stated in stated.items() if is_stated)} is ambiguous: convert the "
                "files to one unit."
            )
        return Experiment.of(tests)

    def noise_in(self, *units: StressUnit) -> Noise:
        """Return the noise, known standard deviations converted to MPa from the unit of each test, or that of all."""
        from tissuq.model.noise import noise_named

        values = [test.noise_sd for test in self.tests if test.noise_sd is not None]
        if values:
            of_tests = units if len(units) > 1 else units * len(values)
            return noise_named([value * unit.to_mpa for value, unit in zip(values, of_tests, strict=True)])
        return super().noise_in(*units)


class LawSettings(SpecimenSettings):
    """Everything that a comparison of laws depends on: as of a fit, but for the material."""

    laws: tuple[str, ...] = Field((ALL,), min_length=1)

    @model_validator(mode="after")
    def _one_discrepancy(self) -> Self:
        if len(self.discrepancies) > 1 or self.discrepancies == (ALL,):
            raise ValueError("laws are compared with one discrepancy: give one, or one material")
        if self.held_out:
            raise ValueError("held_out is for one material: give one")
        if ALL in self.laws and self.laws != (ALL,):
            raise ValueError(f"'{ALL}' cannot be combined with other materials; give '{ALL}', or names")
        return self

    def fitted_laws(self, own: Mapping[str, Material] = MappingProxyType({})) -> dict[str, Material]:
        from tissuq.posterior.laws import laws_named

        return laws_named(ALL if self.laws == (ALL,) else [own.get(name, name) for name in self.laws])


COVARIATES = "Covariates"


def known_of_patient(texts: Sequence[str]) -> dict[str, str]:
    """Return the covariates of a new patient from texts such as ``age=60,sex=f``."""
    pairs = pairs_of("--new-patient", "something known of a patient", "COVARIATE=VALUE, as in age=60,sex=f")
    return pairs([pair for text in texts for pair in text.split(",")])


class PopulationSettings(FittedSettings, ReadingSettings):
    """Everything that a population depends on; the noise in the files' unit of stress.

    Without a mode every test says its own, as for `tissuq.read_experiment`. Of a file of several tests each is of a
    specimen of its own; files that name the same specimen are tests of it.
    """

    files: tuple[str, ...] = argument(
        ...,
        "Files, a specimen each, or tests of one that they name; or folders of them, in which a folder is a specimen.",
        takes=list[Path],
        min_length=1,
    )
    specimen: str | None = option(None, "Column of a single file that names the specimens.", name="specimen-column")
    sizes: str | None = table_of_sizes(READING, takes=Path)
    parameters: tuple[str, ...] | None = option(
        None, "Parameter to pool; repeat for more [all of the material].", name="parameter"
    )
    spread: float = option(1.0, "Sd of the half-normal prior of the spread of the logarithms.", gt=0, lt=inf)
    covariates: str | None = option(
        None,
        "Table of what is known of the specimens: their names in the first column, then one each for age, sex and the "
        "like, with names; 'age [year]' states a unit.",
        takes=Path,
        group=COVARIATES,
    )
    covariate: tuple[str, ...] = option(
        (), "Instead, with --specimen-column: a column of that file that is one; repeat for more.", group=COVARIATES
    )
    new_patient: dict[str, str] = option(
        default_factory=dict,
        help="What is known of the new specimen, such as age=60,sex=f [mean of numbers, most frequent word].",
        parse=known_of_patient,
        group=COVARIATES,
    )
    aim: float | None = option(
        None,
        "Also say how many specimens like these it takes until half the 95 % interval of the population's median, and "
        "that of a new specimen, is this share of the median, such as 10%.",
        takes=str,
        parse=aimed_share,
        gt=0,
        lt=inf,
    )
    estimand: str | None = option(
        None,
        "Errors of every specimen's own tests: those of the specimen as-tested (none), or of the specimen (of a "
        "careful laboratory) [as-tested].",
    )
    discrepancy: str = option("auto", "Discrepancy of every specimen.")
    shared_discrepancy: bool = option(
        False, "Take the model error to be the same in all specimens: it does not average out."
    )
    without: tuple[str, ...] = option(
        (), "Specimen to leave out, by its name in the table of specimens; repeat for more."
    )

    def sources(self, folder: Path = Path()) -> dict[str, list[Path]]:
        """Return the files of every specimen; one file alone where a column in it names them."""
        from tissuq.experiments.reading.specimens_in_files import find_tests

        if self.specimen is None:
            tables = [folder / table for table in (self.covariates, self.sizes) if table is not None]
            return find_tests([folder / file for file in self.files], but=tables)
        if len(self.files) > 1 or (folder / self.files[0]).is_dir():
            raise InputError(
                "--specimen-column names a column of a single file: give one FILE, or leave --specimen-column out."
            )
        return {Path(self.files[0]).stem: [folder / self.files[0]]}

    def covariate_table(self, specimens: Collection[str], folder: Path = Path()) -> CovariateTable | None:
        """Read the covariates of specimens, if there are any; relative files lie in ``folder``."""
        from tissuq.experiments.reading.specimens_in_files import covariate_columns, read_covariates

        if self.covariates is not None and self.covariate:
            raise InputError("give --covariates TABLE, or --covariate for columns of the one FILE, not both.")
        if self.covariates is not None:
            return read_covariates(folder / self.covariates, specimens)
        if not self.covariate:
            return None
        if self.specimen is None:
            raise InputError(
                "--covariate names a column of the single FILE whose specimens --specimen-column names; for several "
                "files give a table of the covariates, --covariates TABLE."
            )
        return covariate_columns(folder / self.files[0], self.specimen, self.covariate, **self.reading_options)

    def readings(self, folder: Path = Path()) -> dict[str, list[Reading]]:
        """Read the tests of every specimen but those that are left out; relative files lie in ``folder``."""
        readings = self._all_readings(folder)
        if unknown := [name for name in self.without if name not in readings]:
            raise InputError(
                f"--without {unknown[0]}: there is no such specimen; the specimens are {', '.join(readings)}."
            )
        return {name: of_one for name, of_one in readings.items() if name not in self.without}

    def _all_readings(self, folder: Path) -> dict[str, list[Reading]]:
        from tissuq.experiments.reading.specimens_in_files import of_specimen, read_column
        from tissuq.experiments.reading.table_of_specimens import TableOfSizes
        from tissuq.experiments.reading.tests_in_file import TestInFile, find_tests_in_file
        from tissuq.studies.files_of_tests import names_of

        sources, options = self.sources(folder), self.reading_options
        sizes = None if self.sizes is None else TableOfSizes.read(folder / self.sizes)
        if self.specimen is not None:
            (file,) = next(iter(sources.values()))
            return read_column(file, self.specimen, sizes, **options)
        tests_of = dict[str, list[TestInFile]]()
        for name, files in sources.items():
            for file in files:
                of_file: ReadingOptions = {**options}
                if sizes is not None:
                    of_file["dimensions"] = sizes.dimensions([name, *names_of(file)], str(file), self.dimensions)
                tests_of.setdefault(name, []).extend(
                    find_tests_in_file(file, is_one_of_several=len(files) > 1, **of_file)
                )
        single_files = [tests for name, tests in tests_of.items() if len(sources[name]) == 1]
        stated = ({test.reading.experiment.specimen for test in tests} - {""} for tests in single_files)
        files_of = Counter(chain.from_iterable(stated))
        specimens: dict[str, list[Reading]] = {}
        for name, tests in tests_of.items():
            for test in tests:
                specimen = test.reading.experiment.specimen
                if len(sources[name]) > 1 or (len(tests) == 1 and files_of[specimen] < 2):
                    specimen = name
                label = specimen or test.name
                specimens.setdefault(label, []).append(of_specimen(test.reading, label))
        return specimens
