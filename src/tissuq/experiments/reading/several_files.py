"""Several files, or many specimens in one: which specimen the measurements are of."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.columns import find_column
from tissuq.experiments.reading.experiment_file import Reading, table_of
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.several_specimens import only_rows, row_names
from tissuq.experiments.reading.tests_in_file import find_tests_in_file

__all__ = ["SUFFIXES", "find_tests", "of_specimen", "read_column"]

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".xls", ".xlsb", ".ods", ".mat", ".parquet")
"""Of files in a folder that may hold measurements."""


def find_tests(
    paths: Sequence[str | os.PathLike[str]], but: str | os.PathLike[str] | None = None
) -> dict[str, list[Path]]:
    """Return the files of every specimen, but for a file that is none.

    A file is a specimen of its name. In a folder, every file is, and every folder is one specimen with a file for each
    test.

    Raises
    ------
    InputError
        When there is no file in a folder, or two specimens have one name.
    """
    specimens: dict[str, list[Path]] = {}
    left_out = None if but is None else Path(but).resolve()
    for path in map(Path, paths):
        for source, files in (_in_folder(path) if path.is_dir() else {path: [path]}).items():
            if source.resolve() == left_out:
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
    path: str | os.PathLike[str], specimen: str | int, **options: Unpack[ReadingOptions]
) -> dict[str, list[Reading]]:
    """Return what is read of the tests of each specimen that a column of one file names, in the order of the file.

    Parameters
    ----------
    path : str or path
    specimen : str or int
        Name, or number from 1, of the column.
    options
        As for `tissuq.read_experiment`.
    """
    only = options.get("only") or {}
    table = only_rows(table_of(path, options), only)
    column = find_column(table, "specimen", specimen)
    labels = np.array(row_names(table, column))
    if (labels == "").any():
        row = int(np.argmax(labels == ""))
        raise InputError(f"{table.place(column, row)}: the name of the specimen is missing.")
    readings = {}
    for label in dict.fromkeys(labels.tolist()):
        of_label: ReadingOptions = {**options, "only": {**only, table.key(column): label}}
        tests = find_tests_in_file(path, is_one_of_several=True, **of_label)
        readings[label] = [of_specimen(test.reading, label) for test in tests]
    return readings


def of_specimen(reading: Reading, specimen: str) -> Reading:
    """Return what was read of a test, named after its specimen."""
    return replace(reading, experiment=reading.experiment.labelled(name=specimen, specimen=specimen))


def _in_folder(folder: Path) -> dict[Path, list[Path]]:
    """Return the files of every specimen in a folder, by the file or the folder that names it."""
    folders = {child: _tables(child) for child in folder.iterdir() if child.is_dir()}
    sources = {child: files for child, files in folders.items() if files} | {file: [file] for file in _tables(folder)}
    if not sources:
        raise InputError(f"folder '{folder}' holds no files that end in {', '.join(SUFFIXES)}.")
    return dict(sorted(sources.items()))


def _tables(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES and file.is_file())
