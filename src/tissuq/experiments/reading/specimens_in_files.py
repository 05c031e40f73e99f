"""Which specimen measurements are of, in several files or in a column of one, and the covariates of specimens."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.file_format import SUFFIXES
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import find_column
from tissuq.experiments.reading.rows_of_tests import only_rows, row_names
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.table_of_specimens import TableOfSizes, table_of_specimens
from tissuq.experiments.reading.tables import read_table
from tissuq.experiments.reading.tests_in_file import find_tests_in_file

BESIDE_TABLES = ("~$", "._", ".~")
"""How names of files begin that are there while a workbook is open, or that macOS leaves on other disks."""


def find_tests(
    paths: Sequence[str | os.PathLike[str]], but: Collection[str | os.PathLike[str]] = ()
) -> dict[str, list[Path]]:
    """Return the files of every specimen, but for files that are none.

    A file is a specimen of its name. In a folder, every file is, and every folder is one specimen with a file for each
    test.

    Raises
    ------
    InputError
        When there is no file in a folder, or two specimens have one name.
    """
    specimens: dict[str, list[Path]] = {}
    left_out = {Path(file).resolve() for file in but}
    for path in map(Path, paths):
        for source, files in (_in_folder(path) if path.is_dir() else {path: [path]}).items():
            if source.resolve() in left_out:
                continue
            name = source.name if source.is_dir() else source.stem
            if name in specimens:
                raise InputError(
                    f"'{specimens[name][0]}' and '{files[0]}' are both named '{name}': rename one, or put the tests "
                    "of one specimen into a folder of its own within the folder of all."
                )
            specimens[name] = files
    return specimens


def read_column(
    path: str | os.PathLike[str],
    specimen: str | int,
    sizes: TableOfSizes | None = None,
    **options: Unpack[ReadingOptions],
) -> dict[str, list[Reading]]:
    """Return what is read of the tests of each specimen that a column of one file names, in the order of the file.

    Parameters
    ----------
    path : str or path
    specimen : str or int
        Name, or number from 1, of the column.
    sizes : TableOfSizes, optional
        Those of the specimens.
    options
        As for `tissuq.read_experiment`.
    """
    only = options.get("only") or {}
    table = only_rows(read_table(path, **options), only)
    column = find_column(table, "specimen", specimen)
    labels = np.array(row_names(table, column))
    if (labels == "").any():
        row = int(np.argmax(labels == ""))
        raise InputError(f"{table.place(column, row)}: the name of the specimen is missing.")
    readings = {}
    for label in dict.fromkeys(labels.tolist()):
        of_label: ReadingOptions = {**options, "only": {**only, table.key(column): label}}
        if sizes is not None:
            of_label["dimensions"] = sizes.dimensions([label], label, options.get("dimensions"))
        tests = find_tests_in_file(path, is_one_of_several=True, **of_label)
        readings[label] = [of_specimen(test.reading, label) for test in tests]
    return readings


def of_specimen(reading: Reading, specimen: str) -> Reading:
    """Return what was read of a test, named after its specimen."""
    return replace(reading, experiment=reading.experiment.labelled(name=specimen, specimen=specimen))


def _in_folder(folder: Path) -> dict[Path, list[Path]]:
    """Return the files of every specimen in a folder, by the file or the folder that names it."""
    folders = {child: tables_in(child) for child in folder.iterdir() if child.is_dir()}
    sources = {child: files for child, files in folders.items() if files} | {file: [file] for file in tables_in(folder)}
    if not sources:
        raise InputError(f"folder '{folder}' holds no files that end in {', '.join(SUFFIXES)}.")
    return dict(sorted(sources.items()))


def tables_in(folder: Path) -> list[Path]:
    """Return the files in a folder that may hold measurements, without those that Excel and macOS put beside them."""
    files = (file for file in folder.iterdir() if not file.name.startswith(BESIDE_TABLES))
    return sorted(file for file in files if file.suffix.lower() in SUFFIXES and file.is_file())


@dataclass(frozen=True, eq=False)
class CovariateTable:
    """A table with the covariates of specimens as text.

    Attributes
    ----------
    table : Table
    specimens : list of str
        The specimen that each row is of.
    column : int
        The column that names them.
    columns : dict of str to int
        Those of the covariates.
    """

    table: Table
    specimens: list[str]
    column: int
    columns: dict[str, int]

    @cached_property
    def _rows(self) -> dict[str, int]:
        """The first row of every specimen."""
        return {name: self.specimens.index(name) for name in dict.fromkeys(self.specimens)}

    def values(self) -> dict[str, dict[str, str]]:
        """Return the values of every specimen: those of its rows that have one.

        Raises
        ------
        InputError
            When rows of one specimen differ.
        """
        by_specimen: dict[str, dict[str, str]] = {specimen: {} for specimen in self._rows}
        for name, column in self.columns.items():
            texts, rows = self.table.texts(column), dict[str, int]()
            for row, (specimen, cell) in enumerate(zip(self.specimens, texts, strict=True)):
                filled_row = rows.setdefault(specimen, row) if cell else row
                if texts[filled_row] != cell:
                    raise InputError(
                        f"{self.table.place(column, row)}: '{cell}' for specimen '{specimen}', which has "
                        f"'{texts[filled_row]}' in {self.table.counted} {self.table.lines[filled_row]}. "
                        "A covariate is the same in all rows of a specimen."
                    )
            for specimen, values in by_specimen.items():
                values[name] = texts[rows[specimen]] if specimen in rows else ""
        return by_specimen

    def place(self, specimen: str, covariate: str) -> str:
        """Return where the value of a specimen, and of a covariate, stands."""
        row = self._rows.get(specimen)
        column = self.columns.get(covariate, self.column if row is not None else None)
        return self.table.file if column is None else self.table.place(column, row)


def covariate_columns(
    path: str | os.PathLike[str], specimen: str, names: Sequence[str], **options: Unpack[ReadingOptions]
) -> CovariateTable:
    """Return columns of a file of measurements that say something of the specimens, which another column names."""
    table = only_rows(read_table(path, **options), options.get("only"))
    column = find_column(table, "specimen", specimen)
    columns = {name: find_column(table, "covariate", name) for name in names}
    return CovariateTable(table, row_names(table, column), column, columns)


def read_covariates(path: str | os.PathLike[str], specimens: Collection[str]) -> CovariateTable:
    """Return a table of covariates: its first column names the specimens, perhaps as files, and the others have names.

    Raises
    ------
    InputError
        When there is no such table in the file.
    """
    table, labels = table_of_specimens(path, specimens, "covariates", "specimen,age,sex")
    return CovariateTable(table, labels, 0, {name: column for column, name in enumerate(table.names) if column})
