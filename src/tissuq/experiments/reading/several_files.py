"""Several files, or many specimens in one: which specimen and which loading mode the measurements are of."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import loading_modes
from tissuq.experiments.reading.columns import find_column
from tissuq.experiments.reading.experiment_file import Reading, ReadingOptions, read_rows
from tissuq.experiments.reading.several_specimens import only_rows, row_names
from tissuq.experiments.reading.table import read_table

__all__ = ["SUFFIXES", "find_mode", "find_tests", "read_column", "stated_mode"]

SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".xls")
"""Of files in a folder that may hold measurements."""
MODE_WORDS = {"tension": "uniaxial", "compression": "uniaxial", "shear": "simple-shear"}
"""Words for loading modes beside their names."""
HEAD_LINES = 20
"""Lines of a file in which a comment may state its mode."""


def find_tests(paths: Sequence[str | os.PathLike[str]]) -> dict[str, list[Path]]:
    """Return the files of every specimen.

    A file is a specimen of its name. In a folder, every file is, and every folder is one specimen with a file for each
    test.

    Raises
    ------
    InputError
        When there is no file in a folder, or two specimens have one name.
    """
    specimens: dict[str, list[Path]] = {}
    for path in map(Path, paths):
        for source, files in (_in_folder(path) if path.is_dir() else {path: [path]}).items():
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
) -> dict[str, Reading]:
    """Return what is read of each specimen that a column of one file names, in the order of the file.

    Parameters
    ----------
    path : str or path
    specimen : str or int
        Name, or number from 1, of the column.
    options
        As for `tissuq.read_experiment`.
    """
    table = only_rows(read_table(path, options.get("skip_rows", 0), options.get("sheet")), options.get("only"))
    column = find_column(table, "specimen", specimen)
    labels = np.array(row_names(table, column))
    if (labels == "").any():
        row = int(np.argmax(labels == ""))
        raise InputError(f"{table.place(column, row)}: the name of the specimen is missing.")
    readings = {}
    for label in dict.fromkeys(labels.tolist()):
        named_options: ReadingOptions = {**options, "name": label}
        readings[label] = read_rows(table.taken(np.flatnonzero(labels == label)), path, **named_options)
    return readings


def stated_mode(file: Path) -> str | None:
    """Return the mode that a comment line such as ``# mode: planar`` at the head of a file states; None without one."""
    return _mode_in(_mode_comment(file))


def find_mode(file: Path, otherwise: str | None = None) -> str:
    """Return the mode that a comment line such as ``# mode: planar`` states, or else the name of the file.

    One that says none is of another mode, where that is given.

    Raises
    ------
    InputError
        When neither names one, and no other is given.

    Examples
    --------
    >>> find_mode(Path("liver-7-planar.csv")), find_mode(Path("simple_shear.csv")), find_mode(Path("tension.csv"))
    ('planar', 'simple-shear', 'uniaxial')
    """
    mode = stated_mode(file) or _mode_in(file.stem) or otherwise
    if mode:
        return mode
    raise InputError(
        f"neither '{file}' nor its name says in which loading mode it was measured: give --mode once for each file, "
        f"in their order ({', '.join(loading_modes())})."
    )


def _in_folder(folder: Path) -> dict[Path, list[Path]]:
    """Return the files of every specimen in a folder, by the file or the folder that names it."""
    folders = {child: _tables(child) for child in folder.iterdir() if child.is_dir()}
    sources = {child: files for child, files in folders.items() if files} | {file: [file] for file in _tables(folder)}
    if not sources:
        raise InputError(f"folder '{folder}' holds no files that end in {', '.join(SUFFIXES)}.")
    return dict(sorted(sources.items()))


def _tables(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES and file.is_file())


def _mode_in(text: str) -> str | None:
    words = "-".join(re.findall(r"[a-z]+", text.lower()))
    for name in sorted(loading_modes(), key=len, reverse=True):
        if re.search(rf"(^|-){name}($|-)", words):
            return name
    modes = {mode for word, mode in MODE_WORDS.items() if word in words.split("-")}
    return modes.pop() if len(modes) == 1 else None


def _mode_comment(file: Path) -> str:
    try:
        with file.open("rb") as content:
            head = [content.readline(1000).decode("latin-1") for _ in range(HEAD_LINES)]
    except OSError:
        return ""
    return next((line.split(":", 1)[1] for line in head if re.match(r"#\s*mode\s*:", line, re.IGNORECASE)), "")
