"""The table in a file: named columns of numbers, each row with its line in the file."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from io import StringIO
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.reading.data_frame import DataColumn, columns_of, is_data_frame, kind_of
from tissuq.experiments.reading.file_format import SEPARATOR_OF_CELLS, file_format, sheets_with_tables
from tissuq.experiments.reading.headings import heading
from tissuq.experiments.reading.layout import (
    MISSING,
    SPREADSHEET_ERRORS,
    WHITESPACE,
    column_names,
    find_layout,
    is_comment,
    is_units_row,
    later_tables,
    split,
)
from tissuq.experiments.reading.summary import find_summary
from tissuq.experiments.reading.text_file import read_lines
from tissuq.experiments.units import BRACKETS, NUMBER

__all__ = ["Column", "Table", "read_table", "read_tables"]

Column = NDArray[np.float64]
Lines = list[tuple[int, str]]

LONG_FILE = 10_000
"""Lines from which a file is first tried on a fast parser."""
FEW_ROWS = 200
"""Rows that show whether a column is constant."""
HEAD_LINES = 1000
"""Lines of a long file that show its layout."""
ALL_TESTS = "tissuq.read_tests and tissuq fit read all of them."
CONSTANT_SHARE = 0.02
"""Range of numbers over the largest, up to which they are one: of the gap of a rheometer that holds it."""
MOST_COLUMNS = 1000
"""Columns of a table that is read in seconds."""
CACHED_FILES = 2
"""Files whose tables are remembered: tests of one file are read one after another."""
TIME = re.compile(r"\b(time|zeit|temps|tiempo|tempo)|(zeit|time)$")
"""Names of a column of times."""


@dataclass(frozen=True)
class Table:
    """A table found in a file, or in memory; a row of an Excel sheet is a line.

    Parameters
    ----------
    file : str
        The file as the user named it.
    names : tuple of str
        Column names, one for every column; empty texts when the file names none.
    units : tuple of str
        Cells of the units row, one for every column; empty texts when there is no such row.
    separator : str
        What stands between two cells; a space means any run of whitespace.
    rows : list of str
        The rows of data as text.
    lines : sequence of int
        The line in the file of every row, counted from 1; of a table in memory its rows, counted from 0.
    head : sequence of (int, str)
        The lines above the rows, with their numbers.
    block : (rows, columns) array, optional
        All cells, where they have been read as numbers already.
    notes : tuple of str
        What a person should know of how the table was found.
    sheet : str
        The sheet of a workbook that it is in.
    number : int
        Which of the tables of a text or sheet it is, from 1; 0 for the only one.
    title : str
        What stands alone in the line above the names, such as the name of a step.
    counted : str
        What ``lines`` counts: lines, or the rows of a table in memory.
    """

    file: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    separator: str
    rows: list[str]
    lines: Sequence[int]
    head: Sequence[tuple[int, str]] = ()
    block: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    sheet: str = ""
    number: int = 0
    title: str = ""
    counted: str = "line"

    @property
    def span(self) -> str:
        """Return the lines of its rows, in words."""
        return f"{self.counted}s {self.lines[0]} to {self.lines[-1]}"

    def label(self, column: int) -> str:
        """Return how messages name a column (counted from 0)."""
        return f"'{self.names[column]}'" if self.names[column] else f"number {column + 1}"

    def key(self, column: int) -> str:
        """Return how options name a column: by its name, or by its number from 1."""
        return self.names[column] or str(column + 1)

    def place(self, column: int, row: int | None = None) -> str:
        """Return the place of a column, or of its cell in a row, as an editor shows it."""
        line = "" if row is None else f", {self.counted} {self.lines[row]}"
        return f"{self.file}{line}, column {self.label(column)}"

    def taken(self, rows: NDArray[np.intp]) -> Table:
        """Return the table with only some rows, in that order."""
        positions = rows.tolist()
        block = None if self.block is None else self.block[rows]
        return replace(
            self, rows=[self.rows[k] for k in positions], lines=[self.lines[k] for k in positions], block=block
        )

    def some_rows(self, count: int) -> Table:
        """Return the table with rows at equal distances, about so many."""
        return self.taken(np.arange(0, len(self.rows), max(1, len(self.rows) // count)))

    def stated_units(self, column: int) -> tuple[str, str]:
        """Return the units in a column's name and in the row of units; empty texts where there is none."""
        return heading(self.names[column]).unit, self.units[column].strip(f"{BRACKETS} ")

    def is_constant(self, column: int) -> bool:
        """Tell whether a column (counted from 0) has the same cell, or no number, in some rows all along."""
        cells = set(self.some_rows(FEW_ROWS).texts(column))
        return len(cells) < 2 or not any(NUMBER.fullmatch(cell) for cell in cells)

    def varies(self, column: int) -> bool:
        """Tell whether the numbers in a column (counted from 0) differ by more than a sensor's own error."""
        try:
            (numbers,) = self.numbers([column])
        except InputError:
            return False
        return bool(np.ptp(numbers) > CONSTANT_SHARE * np.abs(numbers).max())

    def texts(self, column: int) -> list[str]:
        """Return the cells of a column (counted from 0) as text, empty ones where a row ends before it."""
        cells = (split(row, self.separator) for row in self.rows)
        return [row[column] if column < len(row) else "" for row in cells]

    def texts_of_all(self) -> list[tuple[str, ...]]:
        """Return the cells of every column as text, as `texts` does of one."""
        return list(zip(*(_padded(split(row, self.separator), len(self.names)) for row in self.rows), strict=True))

    def numbers(self, columns: Sequence[int]) -> list[Column]:
        """Return columns (counted from 0) as finite numbers, written with decimal points or decimal commas.

        Raises
        ------
        InputError
            When a cell is empty, not a number or not finite, naming its line and column.
        """
        if self.block is not None and max(columns) < self.block.shape[1]:
            return [np.ascontiguousarray(self.block[:, column]) for column in columns]
        for rows, converter in self._readings():
            try:
                block = np.loadtxt(
                    rows,
                    delimiter=None if self.separator == WHITESPACE else self.separator,
                    usecols=columns,
                    quotechar='"',
                    comments=None,
                    ndmin=2,
                    converters=converter,
                )
            except ValueError:
                continue
            if np.isfinite(block).all():
                return list(block.T)
        raise self._bad_cell(columns)

    def without_missing(self, columns: Sequence[int]) -> Table:
        """Return the table without rows in which columns (counted from 0) are all empty, or marked as missing.

        Of the last rows, one of the columns is enough: the test ended there.
        """
        cells = list(zip(*(self.texts(column) for column in columns), strict=True))
        absent = MISSING - SPREADSHEET_ERRORS
        filled = [[cell for cell in row if cell.lower() not in absent] for row in cells]
        is_missing = np.array([not row for row in filled])
        for row in reversed(range(len(filled))):
            if len(filled[row]) == len(columns) or not all(map(NUMBER.fullmatch, filled[row])):
                break
            is_missing[row] = True
        if not is_missing.any() or is_missing.all():
            return self
        count, first = np.count_nonzero(is_missing), self.lines[int(np.argmax(is_missing))]
        what = "1 row" if count == 1 else f"{count} rows"
        names = " and ".join(map(self.label, columns))
        where = f"{'' if count == 1 else 'the first '}in {self.counted} {first}"
        note = f"{what} without values of {names} left out, {where}."
        return replace(self.taken(np.flatnonzero(~is_missing)), notes=(*self.notes, note))

    def _readings(self) -> Iterator[tuple[list[str], Callable[[str], float] | None]]:
        """Yield the rows and what converts their cells, the fastest first: points, commas, both by column."""
        yield self.rows, None
        if self.separator != "," and not any("." in row for row in self.rows):
            yield [row.replace(",", ".") for row in self.rows], None
        yield self.rows, _from_decimal_comma

    def _bad_cell(self, columns: Sequence[int]) -> InputError:
        marks: dict[str, str] = {}
        for row, text in enumerate(self.rows):
            cells = split(text, self.separator)
            for column in columns:
                cell = cells[column] if column < len(cells) else ""
                problem = _problem(cell)
                if problem:
                    return InputError(f"{self.place(column, row)}: {problem}")
                for mark in set(cell) & {".", ","}:
                    marks.setdefault(mark, f"'{cell}' in {self.counted} {self.lines[row]}")
                if len(marks) == 2:
                    return InputError(
                        f"{self.place(column, row)}: decimal points and decimal commas are mixed: "
                        f"{marks['.']}, {marks[',']}. Write all numbers in one way, "
                        "without thousands separators."
                    )
        return InputError(f"{self.file}: columns {' and '.join(map(self.label, columns))} do not hold numbers.")


def read_table(path: Any, skip_rows: int = 0, sheet: str | int | None = None, number: int | None = None) -> Table:
    """Return the table in a file, or in memory; as `read_tables`, where that is one.

    Raises
    ------
    InputError
        When there are several, with how to choose.
    """
    tables = read_tables(path, skip_rows, sheet, number)
    if len(tables) == 1:
        return tables[0]
    sheets = list(dict.fromkeys(table.sheet for table in tables))
    if len(sheets) > 1:
        raise InputError(
            f"{path}: several sheets hold tables: {', '.join(map(repr, sheets))}. Say which: sheet='{sheets[0]}' "
            f"(--sheet '{sheets[0]}'). {ALL_TESTS}"
        )
    of_file = ", ".join(f"{table.number} in {table.span}" for table in tables)
    raise InputError(f"{path} holds several tables: {of_file}. Say which: table=1 (--table 1). {ALL_TESTS}")


def read_tables(
    path: Any, skip_rows: int = 0, sheet: str | int | None = None, number: int | None = None
) -> list[Table]:
    """Return the tables in a file, where lines above them, names, units and rows are recognised, or that in memory.

    Tables with the same names, in which a time goes on from one to the next, are one.

    Parameters
    ----------
    path : str or path, or table
        Comma-, semicolon-, tab- or blank-separated text, or a workbook; or a table in memory, such as a DataFrame of
        pandas (`tissuq.experiments.reading.data_frame`).
    skip_rows : int
        Number of lines at the top of the file to pass over unseen.
    sheet : str or int, optional
        Name or number (from 1) of a workbook's sheet; without it all that hold tables.
    number : int, optional
        Which of several tables in a text or sheet, from 1; without it all.

    Raises
    ------
    InputError
        When the file cannot be read, holds no table of numbers, or its rows do not match its header.
    """
    if not isinstance(skip_rows, int) or skip_rows < 0:
        raise InputError(f"skip_rows must be a number of lines, 0 or more, not {skip_rows!r}.")
    if is_data_frame(path):
        if skip_rows or sheet is not None or number is not None:
            raise InputError(f"{kind_of(path)} is no file: leave sheet, table and skip_rows out.")
        return [_of_data_frame(path)]
    try:
        status = os.stat(path)
        stamp = status.st_mtime_ns, status.st_size
    except (OSError, ValueError):
        stamp = 0, 0
    tables = _tables_in(os.fspath(path), stamp, skip_rows, sheet)
    if number is None:
        return list(tables)
    of_number = [table for table in tables if number == (table.number or 1)]
    if not of_number:
        raise InputError(f"{path} has no table {number!r}; its tables are numbered from 1 to {len(tables)}.")
    return of_number


@lru_cache(maxsize=CACHED_FILES)
def _tables_in(path: str, stamp: tuple[int, int], skip_rows: int, sheet: str | int | None) -> tuple[Table, ...]:
    """Return the tables in a file, which a time of change and a size (bytes) stand for."""
    if (workbook := file_format(path)) is not None:
        sheets = sheets_with_tables(path, workbook.sheets(path), sheet)
        parts = [
            _read_every_line(f"{path}, sheet '{name}'", lines, skip_rows, SEPARATOR_OF_CELLS, name)
            for name, lines in sheets.items()
        ]
        return tuple(table for tables in parts for table in tables)
    if sheet is not None:
        raise InputError(f"{path} is not an Excel workbook and has no sheets; leave sheet (--sheet) out.")
    lines = read_lines(path)
    long = _read_long(path, lines, skip_rows)
    return tuple(_read_every_line(path, lines, skip_rows)) if long is None else (long,)


def _of_data_frame(data: Any) -> Table:
    """Return the table in memory, with cells as they are in a file: numbers to the last digit."""
    columns = columns_of(data)
    cells = zip(*(column.texts() for column in columns), strict=True)
    rows = [SEPARATOR_OF_CELLS.join(row) for row in cells]
    table = Table(
        file=kind_of(data),
        names=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns),
        separator=SEPARATOR_OF_CELLS,
        rows=rows,
        lines=range(len(rows)),
        counted="row",
    )
    if is_units_row(first := split(rows[0], SEPARATOR_OF_CELLS)) and not any(table.units):
        table = replace(table.taken(np.arange(1, len(rows))), units=tuple(first))
    if len(rows) >= LONG_FILE and (block := _block(columns)) is not None:
        return replace(table, block=block)
    return _without_summary(table)


def _block(columns: Sequence[DataColumn]) -> NDArray[np.float64] | None:
    """Return all cells of columns, where they are finite numbers."""
    try:
        block = np.column_stack([column.cells.astype(np.float64) for column in columns])
    except (TypeError, ValueError):
        return None
    return block if np.isfinite(block).all() else None


def _read_long(file: str, lines: list[str], skip_rows: int) -> Table | None:
    """Return the table of a long and regular file, whose cells a fast parser takes; None for any other.

    The layout is found in the first lines, and all below the first row must be numbers in as many columns.
    """
    if len(lines) < LONG_FILE:
        return None
    try:
        head, *others = _read_every_line(file, lines[:HEAD_LINES], skip_rows)
    except InputError:
        return None
    if others:
        return None
    rows = lines[head.lines[0] - 1 :]
    while rows and not rows[-1].strip():
        rows.pop()
    text = "\n".join(rows)
    if "#" in text or '"' in text:
        return None
    import pandas as pd

    separator = r"\s+" if head.separator == WHITESPACE else head.separator
    try:
        table = pd.read_csv(
            StringIO(text), sep=separator, header=None, dtype=np.float64, skip_blank_lines=False, na_filter=False
        )
    except (ValueError, pd.errors.ParserError):
        return None
    block = table.to_numpy()
    if block.shape != (len(rows), len(head.names)) or not np.isfinite(block).all():
        return None
    numbers = range(head.lines[0], head.lines[0] + len(rows))
    return replace(head, rows=rows, lines=numbers, block=block)


def _read_every_line(
    file: str, lines: list[str], skip_rows: int, separator: str | None = None, sheet: str = ""
) -> list[Table]:
    """Return the tables of any text or sheet, looking at every line."""
    every_line = list(enumerate(lines, start=1))[skip_rows:]
    filled = [(line, text) for line, text in every_line if text.strip(' \t;,"')]
    content = [(line, text) for line, text in filled if "#" not in text or not is_comment(text)]
    layout = find_layout([text for _, text in content], separator)
    if layout is None:
        raise _no_table(file, content)
    starts = [content[position][0] for position in later_tables(content, layout)]
    bounds = pairwise([0, *starts, len(lines) + 1])
    parts = [[(line, text) for line, text in filled if start <= line < stop] for start, stop in bounds]
    tables = _joined([_table_of(file, part, layout.separator, sheet) for part in parts])
    if len(tables) == 1:
        return tables
    return [
        replace(table, file=f"{file}, table {number}", number=number) for number, table in enumerate(tables, start=1)
    ]


def _table_of(file: str, filled: Lines, separator: str, sheet: str) -> Table:
    """Return the table in numbered lines that are not blank."""
    content = [(line, text) for line, text in filled if "#" not in text or not is_comment(text)]
    texts = [text for _, text in content]
    layout = find_layout(texts, separator)
    if layout is None:
        raise _no_table(file, content)
    first_line = content[layout.first_row][0]
    if layout.names is None:
        header_line, header = _comment_above(filled, first_line)
    else:
        header_line, header = content[layout.names]
    names = column_names(header, layout.width, layout.separator, has_units=layout.units is not None)
    width = len(names) or layout.width
    if width > MOST_COLUMNS:
        raise InputError(
            f"{file}: a table of {width} columns; at most {MOST_COLUMNS} are read. Put those of the tests into a file "
            "of their own."
        )
    units = [] if layout.units is None else split(texts[layout.units], layout.separator)
    table = Table(
        file=file,
        names=_padded(names, width),
        units=_padded(units, width),
        separator=layout.separator,
        rows=texts[layout.first_row :],
        lines=[line for line, _ in content[layout.first_row :]],
        head=[(line, text) for line, text in filled if line < first_line],
        sheet=sheet,
        title=_title(texts[: layout.names or 0], separator),
    )
    _check_shape(table, f"line {header_line} with the column names" if names else "the table")
    return _without_summary(table)


def _title(above: Sequence[str], separator: str) -> str:
    """Return what stands alone in the last of the lines above the names; an empty text where more or nothing does."""
    cells = [cell for cell in split(above[-1], separator) if cell] if above else []
    is_alone = len(cells) == 1 or separator == WHITESPACE
    return " ".join(cells) if is_alone and not any(map(NUMBER.fullmatch, cells[:1])) else ""


def _joined(tables: Sequence[Table]) -> list[Table]:
    """Return tables, those that go on from the one before as one with it."""
    joined = list(tables[:1])
    for table in tables[1:]:
        if _goes_on(joined[-1], table):
            note = f"{joined[-1].span} and {table.span}, in which time goes on, read as one table."
            rows, lines = [*joined[-1].rows, *table.rows], [*joined[-1].lines, *table.lines]
            joined[-1] = replace(joined[-1], rows=rows, lines=lines, notes=(*joined[-1].notes, note))
        else:
            joined.append(table)
    return joined


def _goes_on(table: Table, later: Table) -> bool:
    """Tell whether a table has the names of the one before, and times that go on from there."""
    if (table.names, table.units) != (later.names, later.units):
        return False
    times = [column for column, name in enumerate(table.names) if TIME.search(heading(name).quantity)]
    ends = table.taken(np.array([0, len(table.rows) - 1]))
    return bool(times) and all(
        before[0] < before[-1] <= after[0]
        for before, after in zip(ends.numbers(times), later.taken(np.array([0])).numbers(times), strict=True)
    )


def _without_summary(table: Table) -> Table:
    """Return the table without the rows of a summary at its end."""
    summary = find_summary(table.rows, table.lines, partial(split, separator=table.separator))
    if summary is None:
        return table
    first, last = table.lines[summary.start], table.lines[-1]
    counted = table.counted
    where = f"{counted} {first}" if first == last else f"{counted}s {first} to {last}"
    if summary.statistics is None:
        raise InputError(
            f"{table.file}, {where}: set apart at the end of the table, and not going on from {counted} "
            f"{table.lines[summary.start - 1]}. Delete a summary; put measurements into a file of their own."
        )
    what = f" with its {', '.join(summary.statistics)}" if summary.statistics else ""
    note = f"{where} at the end of the table, a summary{what}, left out: no measurements."
    return replace(table.taken(np.arange(summary.start)), notes=(note,))


def _no_table(file: str, content: Lines) -> InputError:
    if not content:
        return InputError(f"{file} holds only comments and blank lines; expected a table of numbers.")
    line, text = content[-1]
    return InputError(
        f"{file} holds no rows of numbers: no line has numbers in two columns. The last line "
        f"with text ({line}) reads '{text.strip()[:80]}'. Expected a column of stretches and one of stresses."
    )


def _comment_above(filled: Lines, first_line: int) -> tuple[int, str]:
    """Return the comment just above the data as a candidate for the names: numpy.savetxt writes them so."""
    line, text = next(((line, text) for line, text in reversed(filled) if line < first_line), (0, ""))
    return (line, text.lstrip("# \t")) if is_comment(text) else (0, "")


def _padded(cells: list[str], width: int) -> tuple[str, ...]:
    return tuple([*cells, *[""] * width][:width])


def _check_shape(table: Table, header: str) -> None:
    width = len(table.names)
    hint = (
        " If its commas are decimal commas, separate the columns by semicolons or tabs."
        if table.separator == ","
        else ""
    )
    for line, row in zip(table.lines, table.rows, strict=True):
        if '"' in row and row.count('"') % 2:
            raise InputError(f"{table.file}, line {line}: a quotation mark has no partner: {row.strip()[:80]}")
        may_be_long = len(row.split()) > width if table.separator == WHITESPACE else row.count(table.separator) >= width
        if may_be_long:
            cells = split(row, table.separator)
            if any(cells[width:]):
                raise InputError(f"{table.file}, line {line} has {len(cells)} cells, but {header} has {width}.{hint}")
    if table.separator == "," and not any(table.names) and not any("." in row or '"' in row for row in table.rows):
        raise InputError(
            f"{table.file} has no column names and no decimal points, so its commas may be decimal commas or "
            f"separators (line {table.lines[0]}: {table.rows[0].strip()[:80]}). Separate the columns by "
            "semicolons or tabs, or add a line of column names."
        )


def _from_decimal_comma(text: str) -> float:
    if "." in text:
        raise ValueError
    return float(text.replace(",", "."))


def _problem(cell: str) -> str:
    """Say what is wrong with a cell; nothing when it is a finite number."""
    if not cell:
        return "the cell is empty. Fill in the value or delete the whole row."
    if NUMBER.fullmatch(cell):
        finite = np.isfinite(float(cell.replace(",", ".")))
        return "" if finite else f"'{cell}' is too large for a number. Correct the value or delete the row."
    if "." in cell and "," in cell and NUMBER.fullmatch(cell.replace(",", "").replace(".", "")):
        return f"'{cell}' seems to have a thousands separator. Write numbers without one."
    if NUMBER.fullmatch(cell.rstrip(" %")):
        return f"'{cell}' is a percentage. Write plain numbers, and the unit % in the heading."
    if cell.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return f"'{cell}' is not a finite number. Fill in the value or delete the row."
    return f"'{cell}' is not a number. Correct the value or delete the row."
