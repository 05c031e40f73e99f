"""A table in a file: named columns of numbers, each row with its line in the file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.experiments.numbers import NUMBER
from tissuq.experiments.reading.headings import heading
from tissuq.experiments.reading.layout import MISSING, SPREADSHEET_ERRORS, WHITESPACE, joined, split
from tissuq.experiments.units import BRACKETS, looks_like_unit

Column = FloatArray
Lines = list[tuple[int, str]]

FEW_ROWS = 200
"""Rows that show whether a column is constant."""
CONSTANT_SHARE = 0.02
"""Range of numbers over the largest, up to which they are one: of the gap of a rheometer that holds it."""
ABSENT = MISSING - SPREADSHEET_ERRORS
"""What stands in a cell that was not measured."""
OVERFLOW = frozenset(["inf", "+inf", "-inf"])
"""What may stand there because too much was measured."""
FEW_MISSING = 0.05
"""Share of the rows up to which those are left out in which only some of the cells are missing."""
LEFT_OUT_AT_MOST = 0.5
"""Share of the rows up to which a message advises to leave them out."""


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
    other_lines : mapping
        Those of short other tables in its text or sheet, under an empty name, and of other short sheets by their names.
    counted : str
        What ``lines`` counts: lines, or the rows of a table in memory.
    other_tests : sequence of int
        The lines of rows that are of other tests in the same table.
    """

    file: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    separator: str
    rows: list[str]
    lines: Sequence[int]
    head: Sequence[tuple[int, str]] = ()
    block: FloatArray | None = None
    notes: tuple[str, ...] = ()
    sheet: str = ""
    number: int = 0
    title: str = ""
    counted: str = "line"
    other_lines: Mapping[str, Lines] = field(default_factory=dict)
    other_tests: Sequence[int] = ()

    @cached_property
    def quantities(self) -> list[str]:
        """What the names of the columns say they hold, without units."""
        return [heading(name).quantity for name in self.names]

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

    def taken(self, rows: IndexArray) -> Table:
        """Return the table with only some rows, in that order."""
        positions = rows.tolist()
        block = None if self.block is None else self.block[rows]
        return replace(
            self, rows=[self.rows[k] for k in positions], lines=[self.lines[k] for k in positions], block=block
        )

    def of_test(self, rows: IndexArray) -> Table:
        """Return the table with the rows of one of its tests."""
        test = self.taken(rows)
        return replace(test, other_tests=(*self.other_tests, *sorted(set(self.lines) - set(test.lines))))

    def some_rows(self, count: int) -> Table:
        """Return the table with rows at equal distances, about so many."""
        return self.taken(np.arange(0, len(self.rows), max(1, len(self.rows) // count)))

    def stated_units(self, column: int) -> tuple[str, str]:
        """Return the units in a column's name and in the row of units; empty texts where there is none."""
        return heading(self.names[column]).unit, self.units[column].strip(f"{BRACKETS} ")

    def unit(self, column: int) -> str:
        """Return the unit of a column: that beneath its name, or else the one in it."""
        in_heading, beneath = self.stated_units(column)
        return beneath or in_heading

    def is_constant(self, column: int) -> bool:
        """Tell whether a column (counted from 0) has the same cell, or no number, in some rows that are not empty."""
        cells = set(self.some_rows(FEW_ROWS).texts(column)) - {""}
        return len(cells) < 2 or not self.has_numbers(column)

    def has_numbers(self, column: int) -> bool:
        """Tell whether some of a column's cells (counted from 0) are numbers."""
        return any(NUMBER.fullmatch(cell) for cell in self.some_rows(FEW_ROWS).texts(column))

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

    def cells(self) -> list[tuple[str, ...]]:
        """Return the cells of every row as text, one for each column: empty ones where a row ends before it."""
        return [padded(split(row, self.separator), len(self.names)) for row in self.rows]

    def with_cells(self, cells: Iterable[Sequence[str]]) -> Table:
        """Return the table with other cells in its rows."""
        return replace(self, rows=[joined(row, self.separator) for row in cells])

    def noted(self, *notes: str) -> Table:
        """Return the table with more to know of how it was found."""
        return replace(self, notes=(*self.notes, *notes))

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

    def lines_of(self, rows: IndexArray) -> str:
        """Return the lines of the file in which rows stand, such as ``31,45:50``."""
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        spans = (f"{self.lines[run[0]]}:{self.lines[run[-1]]}" if len(run) > 1 else self.lines[run[0]] for run in runs)
        return ",".join(map(str, spans))

    def without_faulty(self, columns: Sequence[int], lines: str | None) -> Table:
        """Return the table without rows in some lines, of which columns (counted from 0) hold what is no number."""
        if lines is None:
            return self
        is_asked = rows_in(lines, [*self.lines, *self.other_tests], self.file)[: len(self.rows)]
        is_faulty = is_asked & self._is_faulty(columns)
        return self._without(is_faulty, "that cannot be read, to be left out as asked,")

    def without_missing(self, columns: Sequence[int]) -> Table:
        """Return the table without rows in which columns (counted from 0) are all empty, or marked as missing.

        One of the columns is enough in the last rows, for the test ended there, and where this leaves out few rows.
        """
        cells = list(zip(*(self.texts(column) for column in columns), strict=True))
        filled = [[cell for cell in row if cell.lower() not in ABSENT] for row in cells]
        is_missing = np.array([not row for row in filled])
        for row in reversed(range(len(filled))):
            if len(filled[row]) == len(columns) or not all(map(NUMBER.fullmatch, filled[row])):
                break
            is_missing[row] = True
        is_partly = ~is_missing & np.array(
            [
                len(row) < len(columns)
                and all(map(NUMBER.fullmatch, row))
                and OVERFLOW.isdisjoint(map(str.lower, cells_of_row))
                for row, cells_of_row in zip(filled, cells, strict=True)
            ]
        )
        table = self._without(is_missing, f"without values of {' and '.join(map(self.label, columns))} left out,")
        if np.count_nonzero(is_partly) > FEW_MISSING * len(is_partly):
            return table
        text = f"without a value of {' or '.join(map(self.label, columns))} left out,"
        return table._without(is_partly[~is_missing] if table is not self else is_partly, text)

    def _without(self, is_left_out: BoolArray, text: str) -> Table:
        """Return the table without some rows, unless these are none or all, with a note of why."""
        if not is_left_out.any() or is_left_out.all():
            return self
        count, first_line = np.count_nonzero(is_left_out), self.lines[int(np.argmax(is_left_out))]
        what, article = ("1 row", "") if count == 1 else (f"{count} rows", "the first ")
        note = f"{what} {text} {article}in {self.counted} {first_line}."
        return self.taken(np.flatnonzero(~is_left_out)).noted(note)

    def _how_to_leave_out(self, columns: Sequence[int]) -> str:
        """Return how to leave out the rows with a faulty cell in columns; nothing where these are most rows."""
        faulty = np.flatnonzero(self._is_faulty(columns))
        lines = self.lines_of(faulty)
        is_advised = len(faulty) <= LEFT_OUT_AT_MOST * len(self.rows)
        advice = f" To leave out all rows that cannot be read: --leave-out {lines} (leave_out='{lines}')."
        return advice if is_advised else ""

    def _is_faulty(self, columns: Sequence[int]) -> BoolArray:
        """Tell which rows have a cell in columns that is no finite number."""
        return np.array([any(map(_problem, row)) for row in zip(*map(self.texts, columns), strict=True)])

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
                    return InputError(f"{self.place(column, row)}: {problem}{self._how_to_leave_out(columns)}")
                for mark in set(cell) & {".", ","}:
                    marks.setdefault(mark, f"'{cell}' in {self.counted} {self.lines[row]}")
                if len(marks) == 2:
                    return InputError(
                        f"{self.place(column, row)}: decimal points and decimal commas are mixed: "
                        f"{marks['.']}, {marks[',']}. Write all numbers in one way, "
                        "without thousands separators."
                    )
        return InputError(f"{self.file}: columns {' and '.join(map(self.label, columns))} do not hold numbers.")


def _from_decimal_comma(text: str) -> float:
    if "." in text:
        raise ValueError
    return float(text.replace(",", "."))


def _problem(cell: str) -> str:
    """Say what is wrong with a cell; nothing when it is a finite number."""
    if not cell:
        return "the cell is empty. Fill in the value."
    if NUMBER.fullmatch(cell):
        finite = np.isfinite(float(cell.replace(",", ".")))
        return "" if finite else f"'{cell}' is too large for a number. Correct it."
    if "." in cell and "," in cell and NUMBER.fullmatch(cell.replace(",", "").replace(".", "")):
        return f"'{cell}' seems to have a thousands separator. Write numbers without one."
    if NUMBER.fullmatch(cell.rstrip(" %")):
        return f"'{cell}' is a percentage. Write plain numbers, and the unit % in the heading."
    unit = NUMBER.sub("", cell, count=1).strip() if NUMBER.match(cell) else ""
    if unit[:1].isalpha() and looks_like_unit(unit):
        return (
            f"'{cell}' is a number with its unit, which is read where all cells of a column have the same one, and its "
            "heading has no other. Write plain numbers, and the unit in the heading."
        )
    if cell.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return f"'{cell}' is not a finite number. Fill in the value."
    return f"'{cell}' is not a number. Correct it."


def padded(cells: list[str], width: int) -> tuple[str, ...]:
    """Return the cells of a row, so many, empty ones added."""
    return tuple([*cells, *[""] * width][:width])


def filled_on(cells: Sequence[str]) -> list[str]:
    """Return cells, of which each goes for the empty ones after it."""
    filled = list(cells[:1])
    for cell in cells[1:]:
        filled.append(cell or filled[-1])
    return filled


def rows_in(lines: str, numbers: Sequence[int], file: str) -> BoolArray:
    """Tell which rows, of which the lines are numbers, stand in lines such as ``31,45:50``.

    Raises
    ------
    InputError
        When this is not a list of lines, or some of them hold no row.
    """
    of_rows = np.array(numbers)
    is_in = np.zeros(len(of_rows), dtype=bool)
    for span in str(lines).split(","):
        ends = span.split(":")
        if len(ends) > 2 or not all(end.strip().isdecimal() for end in ends) or int(ends[0]) > int(ends[-1]):
            raise InputError(f"leave_out (--leave-out) must be lines of the file such as 31,45:50, not '{lines}'.")
        is_in_span = (of_rows >= int(ends[0])) & (of_rows <= int(ends[-1]))
        if not is_in_span.any():
            raise InputError(
                f"{file}: there is no row to leave out in line {span.strip()}; rows are in lines {of_rows.min()} to "
                f"{of_rows.max()}."
            )
        is_in |= is_in_span
    return is_in
