"""Files with sheets of cells: a class for each format, known by the first bytes of its files; workbooks of Excel."""

from __future__ import annotations

import os
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date, time
from typing import Any, ClassVar

from tissuq.errors import InputError
from tissuq.experiments.reading.layout import find_layout
from tissuq.registry import plugins, variants

__all__ = ["FileFormat", "Workbook", "file_format", "sheet_lines"]

LONGEST_SIGNATURE = 64
"""First bytes of a file that are looked at."""


class FileFormat(ABC):
    """A format whose files hold sheets of cells; a new one is one subclass in one file.

    Files of no such format are read as text.
    """

    entry_point_group: ClassVar[str] = "tissuq.file_formats"
    name: ClassVar[str]
    signature: ClassVar[bytes]
    """First bytes of every file of this format."""

    @abstractmethod
    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        """Return the lines of every sheet by the sheet's name, with tabs between cells and decimal points.

        Raises
        ------
        InputError
            When the file cannot be opened, or a library that reads it is not installed.
        """


def file_format(path: str | os.PathLike[str]) -> FileFormat | None:
    """Return the format whose files begin like this one; None for a text, and for a file that cannot be read."""
    try:
        with open(path, "rb") as file:
            start = file.read(LONGEST_SIGNATURE)
    except (OSError, ValueError):
        return None
    kinds = dict.fromkeys([*variants(FileFormat).values(), *plugins(FileFormat)])
    return next((kind() for kind in kinds if start.startswith(kind.signature)), None)


def sheet_lines(
    path: str | os.PathLike[str], sheets: dict[str, list[str]], sheet: str | int | None
) -> tuple[str, list[str]]:
    """Return the name and the lines of a sheet; without a choice, of the only one that holds a table.

    Raises
    ------
    InputError
        When there is no such sheet, or none or several hold tables.
    """
    name = _sheet_named(path, list(sheets), sheet) if sheet is not None else _only_sheet_with_table(path, sheets)
    return name, sheets[name]


def _sheet_named(path: str | os.PathLike[str], names: list[str], sheet: str | int) -> str:
    text = str(sheet)
    if text in names:
        return text
    if text.isdecimal() and 1 <= int(text) <= len(names):
        return names[int(text) - 1]
    raise InputError(f"{path} has no sheet '{sheet}'. The sheets are: {', '.join(map(repr, names))}.")


def _only_sheet_with_table(path: str | os.PathLike[str], sheets: dict[str, list[str]]) -> str:
    tables = [name for name, lines in sheets.items() if find_layout([line for line in lines if line.strip()], "\t")]
    if not tables:
        raise InputError(
            f"{path} holds no sheet with a table of numbers (cells shown as percentages are not read as numbers). The "
            f"sheets are: {', '.join(map(repr, sheets))}."
        )
    if len(tables) > 1:
        raise InputError(
            f"{path}: several sheets hold tables: {', '.join(map(repr, tables))}. Say which: sheet='{tables[0]}' "
            f"(--sheet '{tables[0]}')."
        )
    return tables[0]


class Workbook(FileFormat):
    """Sheets of a workbook, numbers to the last digit; a cell that is shown as a percentage says so."""

    name = "xlsx"
    signature = b"PK\x03\x04"

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        with _explained(path, "an Excel workbook", "openpyxl", "export the table as CSV"), warnings.catch_warnings():
            import openpyxl

            warnings.simplefilter("ignore")  # of features such as drop-down lists, which are not read
            book = openpyxl.load_workbook(path, read_only=True, data_only=True)
            sheets = {page.title: _sheet_rows(page) for page in book.worksheets}
            book.close()
        return sheets


class OldWorkbook(FileFormat):
    """Sheets of a workbook of the old kind, as rheometers write it; a percentage is the ratio that is stored."""

    name = "xls"
    signature = bytes.fromhex("d0cf11e0a1b11ae1")

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        kind, cure = "an Excel workbook of the old kind", "save it as .xlsx or CSV"
        with _explained(path, kind, "python-calamine", cure):
            from python_calamine import CalamineWorkbook

            book = CalamineWorkbook.from_path(os.fspath(path))
            rows = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
        return {name: ["\t".join(map(_text, row)).rstrip("\t") for row in page] for name, page in rows.items()}


@contextmanager
def _explained(path: str | os.PathLike[str], kind: str, library: str, cure: str) -> Iterator[None]:
    """Turn whatever a library raises, or that it is missing, into what to do instead."""
    try:
        yield
    except ImportError as error:
        raise InputError(
            f"{path} is {kind}; reading it needs {library}: pip install 'tissuq[excel]'. Or {cure} and give that file."
        ) from error
    except Exception as error:  # openpyxl raises whatever zipfile and its parsers do, python-calamine what Rust does
        raise InputError(
            f"{path} seems to be {kind}, but it cannot be opened: {error}. {cure[0].upper()}{cure[1:]} and give that "
            "file."
        ) from error


def _sheet_rows(sheet: Any) -> list[str]:
    sheet.reset_dimensions()  # else one stray cell far to the right makes every row that long
    return ["\t".join(map(_cell_text, row)).rstrip("\t") for row in sheet.iter_rows()]


def _cell_text(cell: Any) -> str:
    """Return a cell as text; a number that is shown as a percentage says so."""
    value = cell.value
    is_percentage = isinstance(value, int | float) and "%" in str(cell.number_format)
    return f"{100 * value!r} %" if is_percentage else _text(value)


def _text(value: Any) -> str:
    """Return the value of a cell as text, numbers to the last digit."""
    if value is None:
        return ""
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, int | float):
        return repr(value)
    return " ".join(str(value).replace('"', "'").split())
