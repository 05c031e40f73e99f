"""Excel workbooks (.xlsx), by openpyxl."""

from __future__ import annotations

import os
import warnings
from datetime import date, time
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.reading.file_format import FileFormat

__all__ = ["Workbook"]


class Workbook(FileFormat):
    """Sheets of a workbook, numbers to the last digit; a cell that is shown as a percentage says so."""

    name = "xlsx"
    signature = b"PK\x03\x04"

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
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
        return sheets


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
