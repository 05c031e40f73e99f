"""Workbooks of spreadsheets: of Excel, of the old and the binary kind, and OpenDocument."""

from __future__ import annotations

import os
import warnings
import zipfile
from typing import Any, ClassVar

from tissuq.experiments.reading.file_format import FileFormat, explained, line_of

ZIP = b"PK\x03\x04"


def _members(path: str | os.PathLike[str]) -> set[str]:
    """Return the names of the files in an archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            return set(archive.namelist())
    except (OSError, ValueError, zipfile.BadZipFile):
        return set()


class Workbook(FileFormat):
    """Sheets of a workbook, numbers to the last digit; a cell that is shown as a percentage says so."""

    name = "xlsx"
    signature = ZIP

    @classmethod
    def recognises(cls, path: str | os.PathLike[str], start: bytes) -> bool:
        return start.startswith(ZIP) and not _members(path) & {OpenDocument.member, BinaryWorkbook.member}

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        with explained(path, "an Excel workbook", "openpyxl", "export the table as CSV"), warnings.catch_warnings():
            import openpyxl

            warnings.simplefilter("ignore")  # of features such as drop-down lists, which are not read
            book = openpyxl.load_workbook(path, read_only=True, data_only=True)
            for page in book.worksheets:
                page.reset_dimensions()  # else one stray cell far to the right makes every row that long
            sheets = {page.title: [line_of(map(_shown, row)) for row in page.iter_rows()] for page in book.worksheets}
            book.close()
        return sheets


class OldWorkbook(FileFormat):
    """Sheets of a workbook of the old kind, as rheometers write it; a percentage is the ratio that is stored."""

    name = "xls"
    signature = bytes.fromhex("d0cf11e0a1b11ae1")
    kind: ClassVar[str] = "an Excel workbook of the old kind"

    def sheets(self, path: str | os.PathLike[str]) -> dict[str, list[str]]:
        with explained(path, self.kind, "python-calamine", "save it as .xlsx or CSV"):
            from python_calamine import CalamineWorkbook

            book = CalamineWorkbook.from_path(os.fspath(path))
            rows = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
        return {name: list(map(line_of, page)) for name, page in rows.items()}


class OpenDocument(OldWorkbook):
    """Sheets of LibreOffice and the like; a percentage is the ratio that is stored."""

    name = "ods"
    signature = ZIP
    kind = "an OpenDocument spreadsheet"
    member: ClassVar[str] = "content.xml"

    @classmethod
    def recognises(cls, path: str | os.PathLike[str], start: bytes) -> bool:
        return start.startswith(ZIP) and cls.member in _members(path)


class BinaryWorkbook(OpenDocument):
    """Sheets of a binary workbook of Excel; a percentage is the ratio that is stored."""

    name = "xlsb"
    kind = "a binary Excel workbook"
    member = "xl/workbook.bin"


def _shown(cell: Any) -> Any:
    """Return the value of a cell; a number that is shown as a percentage as a text that says so."""
    is_percentage = isinstance(cell.value, int | float) and "%" in str(cell.number_format)
    return f"{100 * cell.value!r} %" if is_percentage else cell.value
