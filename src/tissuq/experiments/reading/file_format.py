"""Files with sheets of cells: a class for each format, known by the first bytes of its files."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import date, time
from itertools import chain
from typing import Any, ClassVar

from tissuq.errors import InputError
from tissuq.experiments.reading.layout import find_layout
from tissuq.registry import plugins, variants

LONGEST_SIGNATURE = 64
"""First bytes of a file that are looked at."""
SEPARATOR_OF_CELLS = "\t"
"""What stands between the cells of a line of a sheet."""
SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".xls", ".xlsb", ".ods", ".mat", ".parquet", ".json")
"""Of files in a folder that may hold measurements."""


class FileFormat(ABC):
    """A format whose files hold sheets of cells; a new one is one subclass in one file.

    Files of no such format are read as text.
    """

    entry_point_group: ClassVar[str] = "tissuq.file_formats"
    name: ClassVar[str]
    signature: ClassVar[bytes]
    """First bytes of every file of this format."""

    @classmethod
    def recognises(cls, path: str | os.PathLike[str], start: bytes) -> bool:
        """Tell whether a file that begins so is of this format."""
        return start.startswith(cls.signature)

    @abstractmethod
    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        """Return the lines of every sheet by the sheet's name, with tabs between cells and decimal points.

        Raises
        ------
        InputError
            When the file cannot be opened, or a library that reads it is not installed.
        """

    def lines_by_sheet(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        """Return `sheets`; whatever else a format of another package raises or returns is an error in words.

        Raises
        ------
        InputError
            As `sheets` does, and when it fails or does not return lines of text by sheet.
        """
        format_name = f"the format '{self.name}' ({type(self).__module__}.{type(self).__qualname__})"
        try:
            sheets = self.sheets(path)
        except InputError:
            raise
        except Exception as error:  # of code that is not from here
            raise InputError(f"{path}: {format_name} cannot read it: {type(error).__name__}: {error}.") from error
        if not isinstance(sheets, dict) or not all(isinstance(line, str) for line in chain(*sheets.values())):
            raise InputError(f"{path}: {format_name} must return the lines of every sheet as texts, by its name.")
        return sheets


def file_format(path: str | os.PathLike[str]) -> FileFormat | None:
    """Return the format whose files begin like this one; None for a text, and for a file that cannot be read."""
    try:
        with open(path, "rb") as file:
            start = file.read(LONGEST_SIGNATURE)
    except (OSError, ValueError):
        return None
    kinds = dict.fromkeys([*variants(FileFormat).values(), *plugins(FileFormat)])
    return next((kind() for kind in kinds if kind.recognises(path, start)), None)


def sheets_with_tables(
    path: str | os.PathLike[str], sheets: dict[str, list[str]], sheet: str | int | None
) -> dict[str, list[str]]:
    """Return the lines of the sheets that hold tables, by their names; of one sheet where it is asked for.

    Raises
    ------
    InputError
        When there is no such sheet, or none with a table.
    """
    if sheet is not None:
        names, text = list(sheets), str(sheet)
        if text not in names and text.isdecimal() and 1 <= int(text) <= len(names):
            text = names[int(text) - 1]
        if text not in names:
            raise InputError(f"{path} has no sheet '{sheet}'. The sheets are: {', '.join(map(repr, names))}.")
        return {text: sheets[text]}
    tables = {
        name: lines
        for name, lines in sheets.items()
        if find_layout([line for line in lines if line.strip()], SEPARATOR_OF_CELLS)
    }
    if not tables:
        raise InputError(
            f"{path} holds no sheet with a table of numbers. The sheets are: {', '.join(map(repr, sheets)) or 'none'}."
        )
    return tables


@contextmanager
def explained(path: str | os.PathLike[str], kind: str, library: str, cure: str, extra: str = "excel") -> Iterator[None]:
    """Turn whatever a library raises, or that it is missing, into what to do instead."""
    try:
        yield
    except ImportError as error:
        raise InputError(
            f"{path} is {kind}; reading it needs {library}: pip install 'tissuq[{extra}]'. Or {cure} and give that "
            "file."
        ) from error
    except Exception as error:  # libraries raise whatever their parsers do
        raise InputError(
            f"{path} seems to be {kind}, but it cannot be opened: {error}. {cure[0].upper()}{cure[1:]} and give that "
            "file."
        ) from error


def line_of(cells: Iterable[Any]) -> str:
    """Return the line of a row of cells: numbers to the last digit, and nothing after the last one."""
    return SEPARATOR_OF_CELLS.join(map(as_text, cells)).rstrip(SEPARATOR_OF_CELLS)


def as_text(value: Any) -> str:
    """Return the value of a cell as text, numbers to the last digit."""
    if value is None:
        return ""
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, float):
        return float.__repr__(value)  # not that of numpy's numbers
    return " ".join(str(value).replace('"', "'").split())
