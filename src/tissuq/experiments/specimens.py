"""Many specimens in files: a file each, a folder of repeated tests each, or a column that names them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.columns import find_column
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.layout import split
from tissuq.experiments.reading import experiment_of, read_experiment
from tissuq.experiments.table import read_table

__all__ = ["find_tests", "read_specimens", "read_specimens_in"]

SUFFIXES = frozenset([".csv", ".tsv", ".txt", ".dat"])


def find_tests(paths: Sequence[str | os.PathLike[str]]) -> dict[str, list[Path]]:
    """Return the files of every specimen.

    A file is a specimen of its name. In a folder, every file is, and every folder is one specimen with a file for each
    test.

    Raises
    ------
    InputError
        When there is no file in a folder, or two specimens have one name.
    """
    found: dict[str, list[Path]] = {}
    for path in map(Path, paths):
        for place, files in (_in_folder(path) if path.is_dir() else {path: [path]}).items():
            name = place.name if place.is_dir() else place.stem
            if name in found:
                raise InputError(
                    f"'{found[name][0]}' and '{files[0]}' are both named '{name}': rename one, or put the tests of one "
                    "specimen into a folder of its own within the folder of all."
                )
            found[name] = files
    return found


def read_specimens(tests: dict[str, list[Path]], **options: Any) -> dict[str, Experiment]:
    """Return one experiment for each specimen, repeated tests joined; the options are those of `read_experiment`."""
    return {
        name: reduce(Experiment.joined, (read_experiment(file, name=name, **options) for file in files))
        for name, files in tests.items()
    }


def read_specimens_in(
    path: str | os.PathLike[str], specimen: str | int, skip_rows: int = 0, **options: Any
) -> dict[str, Experiment]:
    """Return one experiment for each specimen that a column of one file names, in the order of the file.

    Parameters
    ----------
    path : str or path
    specimen : str or int
        Name, or number from 1, of the column.
    skip_rows, options
        As for `read_experiment`.
    """
    table = read_table(path, skip_rows)
    column = find_column(table, "specimen", specimen)
    cells = [split(row, table.separator) for row in table.rows]
    labels = np.array([row[column] if column < len(row) else "" for row in cells])
    if (labels == "").any():
        row = int(np.argmax(labels == ""))
        raise InputError(f"{table.place(column, row)}: the name of the specimen is missing.")
    lines, found = np.asarray(table.lines), {}
    for label in dict.fromkeys(labels.tolist()):
        own = np.flatnonzero(labels == label)
        block = None if table.block is None else table.block[own]
        rows = replace(table, rows=[table.rows[k] for k in own], lines=lines[own].tolist(), block=block)
        found[label] = experiment_of(rows, label, **options)
    return found


def _in_folder(folder: Path) -> dict[Path, list[Path]]:
    """Return the files of every specimen in a folder, by the file or the folder that names it."""
    found = {child: _tables(child) for child in sorted(folder.iterdir()) if child.is_dir()}
    found = {child: files for child, files in found.items() if files} | {file: [file] for file in _tables(folder)}
    if not found:
        raise InputError(f"folder '{folder}' holds no files that end in {', '.join(sorted(SUFFIXES))}.")
    return dict(sorted(found.items()))


def _tables(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES and file.is_file())
