"""What a population depends on, and the tests in its files."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.errors import InputError
from tissuq.studies.measured_file import FittedSettings, ReadingSettings
from tissuq.studies.option import argument, option
from tissuq.studies.option_texts import pairs_of, share

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.experiments.reading.specimens_in_files import CovariateTable

__all__ = ["PopulationSettings"]


COVARIATES = "Covariates"


def known_of_patient(texts: Sequence[str]) -> dict[str, str]:
    """Return the covariates of a new patient from texts such as ``age=60,sex=f``."""
    pairs = pairs_of("--new-patient", "something known of a patient", "COVARIATE=VALUE, as in age=60,sex=f")
    return pairs([pair for text in texts for pair in text.split(",")])


class PopulationSettings(FittedSettings, ReadingSettings):
    """Everything that a population depends on; the noise in the files' unit of stress.

    Without a mode every test says its own, as for `tissuq.read_experiment`. Of a file of several tests each is of a
    specimen of its own.
    """

    files: tuple[str, ...] = argument(
        ...,
        "Files, a specimen each; or folders of them, in which a folder is a specimen with a file a test.",
        takes=list[Path],
        min_length=1,
    )
    specimen: str | None = option(None, "Column of a single file that names the specimens.", name="specimen-column")
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
        parse=share("--aim"),
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
            return find_tests([folder / file for file in self.files], but=self.covariates and folder / self.covariates)
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
        from tissuq.experiments.reading.tests_in_file import find_tests_in_file

        sources = self.sources(folder)
        if self.specimen is not None:
            (file,) = next(iter(sources.values()))
            return read_column(file, self.specimen, **self.reading_options)
        specimens: dict[str, list[Reading]] = {}
        for name, files in sources.items():
            is_one_of_several, options = len(files) > 1, self.reading_options
            tests = [
                test
                for file in files
                for test in find_tests_in_file(file, is_one_of_several=is_one_of_several, **options)
            ]
            for test in tests:
                is_one = len(files) > 1 or len(tests) == 1
                specimen = name if is_one else test.reading.experiment.specimen or test.name
                specimens.setdefault(specimen, []).append(of_specimen(test.reading, specimen))
        return specimens
