"""What a population depends on, and the tests in its files."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.errors import InputError
from tissuq.studies.measured_file import FittedSettings, ReadingSettings
from tissuq.studies.option import argument, option

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading

__all__ = ["PopulationSettings"]


class PopulationSettings(FittedSettings, ReadingSettings):
    """Everything that a population depends on; the noise in the files' unit of stress.

    Without a mode every test says its own, as for `tissuq.read_experiment`. Of a file of several tests each is of a
    specimen of its own.
    """

    files: tuple[str, ...] = argument(
        ...,
        "Files, a specimen each; or folders of them, in which a folder is a specimen with a file a test.",
        takes=list[Path],
        parse=lambda paths: tuple(map(str, paths)),
        min_length=1,
    )
    specimen: str | None = option(None, "Column of a single file that names the specimens.", name="specimen-column")
    parameters: tuple[str, ...] | None = option(
        None, "Parameter to pool; repeat for more [all of the material].", name="parameter"
    )
    spread: float = option(1.0, "Sd of the half-normal prior of the spread of the logarithms.", gt=0, lt=inf)
    discrepancy: str = option("auto", "Discrepancy of every specimen.")
    mode: str | None = option(None, "Loading mode of all files [as they or their names say, or uniaxial].")

    def sources(self, folder: Path = Path()) -> dict[str, list[Path]]:
        """Return the files of every specimen; one file alone where a column in it names them."""
        from tissuq.experiments.reading.several_files import find_tests

        if self.specimen is None:
            return find_tests([folder / file for file in self.files])
        if len(self.files) > 1 or (folder / self.files[0]).is_dir():
            raise InputError(
                "--specimen-column names a column of a single file: give one FILE, or leave --specimen-column out."
            )
        return {Path(self.files[0]).stem: [folder / self.files[0]]}

    def readings(self, folder: Path = Path()) -> dict[str, list[Reading]]:
        """Read the tests of every specimen; relative files lie in ``folder``."""
        from tissuq.experiments.reading.several_files import read_column
        from tissuq.experiments.reading.tests_in_file import find_tests_in_file

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
