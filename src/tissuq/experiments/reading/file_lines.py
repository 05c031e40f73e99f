"""A user's file as lines: a text whatever its encoding, or a sheet of a workbook with tabs between cells."""

from __future__ import annotations

import os
import re
import warnings
from datetime import date, time
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.reading.layout import find_layout

__all__ = ["is_workbook", "read_lines", "sheet_lines"]

BYTE_ORDER_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
NOT_TEXT = {
    b"\xd0\xcf\x11\xe0": "an Excel workbook of the old kind",
    b"%PDF": "a PDF document",
    b"\x89HDF": "an HDF5 file",
}
LONGEST_LINE = 100_000
"""Characters of a line of text."""
WORKBOOK_SIGNATURE = b"PK\x03\x04"
"""First bytes of a workbook (.xlsx)."""


def read_lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a text file, numbered as an editor shows them, without their ends.

    UTF-8 (with or without byte order mark), UTF-16 and Windows/Latin-1 are told apart by their bytes.

    Raises
    ------
    InputError
        When there is no such file, it cannot be read, is empty, or is not text.
    """
    text = _decoded(path, _content(Path(path)))
    lines = text.replace("\u2212", "-").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(max(lines, key=len)) > LONGEST_LINE:
        raise InputError(f"{path}: a line is longer than {LONGEST_LINE} characters; this is not a table in text form.")
    return lines


def is_workbook(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is an Excel workbook (.xlsx) by its first bytes; not when it cannot be read."""
    try:
        with open(path, "rb") as file:
            return file.read(len(WORKBOOK_SIGNATURE)) == WORKBOOK_SIGNATURE
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
            sheets = {page.title: _sheet_rows(page) for page in book.worksheets}
            book.close()
    except Exception as error:  # openpyxl raises whatever zipfile and its parsers do
        raise InputError(
            f"{path} seems to be an Excel workbook, but it cannot be opened: {error}. Export the table as CSV and "
            "give that file."
        ) from error
    name = _sheet_named(path, list(sheets), sheet) if sheet is not None else _only_sheet_with_table(path, sheets)
    return name, sheets[name]


def _content(path: Path) -> bytes:
    if path.is_dir():
        raise InputError(f"{path} is a folder; give one of the files in it.")
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file.{_close_file(path)}") from error
    except PermissionError as error:
        raise InputError(f"{path} cannot be opened: you have no permission to read it.") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}.") from error
    if not content.strip():
        raise InputError(f"{path} is empty; expected a table with a column of stretches and one of stresses.")
    return content


def _close_file(path: Path) -> str:
    neighbours = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
    close = get_close_matches(path.name, neighbours, n=1)
    return f" Did you mean '{path.parent / close[0]}'?" if close else " Check the name and the folder."


def _decoded(path: str | os.PathLike[str], content: bytes) -> str:
    for signature, kind in NOT_TEXT.items():
        if content.startswith(signature):
            raise InputError(f"{path} is {kind}, not text; save it as .xlsx or CSV and give that file.")
    for encoding in _encodings(content):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        text = re.sub("\0(?=\r?\n)", "", text)  # some machines (WinTest) end their first line with a NUL
        if "\0" not in text:
            return text
    raise InputError(f"{path} is a binary file, not text; export the table as CSV and give that file.")


def _encodings(content: bytes) -> list[str]:
    for mark, encoding in BYTE_ORDER_MARKS.items():
        if content.startswith(mark):
            return [encoding]
    if b"\0" in content[:2]:
        return ["utf-16-be" if content[0] == 0 else "utf-16-le"]
    return ["utf-8", "cp1252", "latin-1"]


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


def _sheet_rows(sheet: Any) -> list[str]:
    sheet.reset_dimensions()  # else one stray cell far to the right makes every row that long
    return ["\t".join(map(_cell_text, row)).rstrip("\t") for row in sheet.iter_rows()]


def _cell_text(cell: Any) -> str:
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
