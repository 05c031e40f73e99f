"""A sheet of an Excel workbook as lines of cells separated by tabs, each line with the number of its row."""

from __future__ import annotations

import os
import warnings
from datetime import date, time
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.reading.layout import find_layout

__all__ = ["is_workbook", "sheet_lines"]

SIGNATURE = b"PK\x03\x04"


def is_workbook(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is an Excel workbook (.xlsx) by its first bytes; not when it cannot be read."""
    try:
        with open(path, "rb") as file:
            return file.read(len(SIGNATURE)) == SIGNATURE
    except (OSError, ValueError):
        return False


def sheet_lines(path: str | os.PathLike[str], sheet: str | int | None) -> tuple[str, list[str]]:
    """Return the name and the rows of a sheet; without a choice, of the only one that holds a table.

    Raises
    ------
    InputError
        When openpyxl is not installed, the file is no workbook, there is no such sheet, or several hold tables.
    """
    try:
        import openpyxl
    except ImportError as error:
        raise InputError(
            f"{path} is an Excel workbook; reading it needs openpyxl: pip install 'tissuq[excel]'. "
            "Or export the table as CSV and give that file."
        ) from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of features such as drop-down lists, which are not read
            book = openpyxl.load_workbook(path, read_only=True, data_only=True)
            sheets = {each.title: _lines(each) for each in book.worksheets}
            book.close()
    except Exception as error:  # openpyxl raises whatever zipfile and its parsers do
        raise InputError(
            f"{path} seems to be an Excel workbook, but it cannot be opened: {error}. Export the table as CSV and "
            "give that file."
        ) from error
    name = _named(path, list(sheets), sheet) if sheet is not None else _only_table(path, sheets)
    return name, sheets[name]


def _named(path: str | os.PathLike[str], names: list[str], sheet: str | int) -> str:
    text = str(sheet)
    if text in names:
        return text
    if text.isdecimal() and 1 <= int(text) <= len(names):
        return names[int(text) - 1]
    raise InputError(f"{path} has no sheet '{sheet}'. The sheets are: {', '.join(map(repr, names))}.")


def _only_table(path: str | os.PathLike[str], sheets: dict[str, list[str]]) -> str:
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


def _lines(sheet: Any) -> list[str]:
    sheet.reset_dimensions()  # else one stray cell far to the right makes every row that long
    return ["\t".join(map(_text, row)).rstrip("\t") for row in sheet.iter_rows()]


def _text(cell: Any) -> str:
    """Return a cell as text, numbers to the last digit; one shown as a percentage says so."""
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, int | float):
        is_percentage = "%" in str(cell.number_format)
        return f"{100 * value!r} %" if is_percentage else repr(value)
    return " ".join(str(value).replace('"', "'").split())
