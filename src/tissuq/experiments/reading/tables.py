"""The tables in a file or in memory: where they begin and end, and which go on in a later one."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from io import StringIO
from itertools import pairwise
from typing import Any, Unpack

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.numbers import NUMBER
from tissuq.experiments.reading.arrangement import (
    blocks_of,
    joined_where_they_go_on,
    names_said_otherwise,
    title_of,
    transposed_table,
    with_names_above,
)
from tissuq.experiments.reading.data_frame import DataColumn, columns_of, is_data_frame, kind_of, lines_of
from tissuq.experiments.reading.file_format import SEPARATOR_OF_CELLS, file_format, sheets_with_tables
from tissuq.experiments.reading.layout import (
    WHITESPACE,
    column_names,
    find_layout,
    is_comment,
    is_units_row,
    later_tables,
    split,
)
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.plain_tables import with_plain_numbers, without_statements_beside, without_summary
from tissuq.experiments.reading.table import Lines, Table, padded
from tissuq.experiments.reading.text_file import read_lines

LONG_FILE = 10_000
"""Lines from which a file is first tried on a fast parser."""
HEAD_LINES = 1000
"""Lines of a long file that show its layout."""
SHORT = 500
"""Lines up to which a sheet or another table may hold the sizes of specimens."""
ALL_TESTS = "tissuq.read_tests and tissuq fit read all of them."
MOST_COLUMNS = 1000
"""Columns of a table that is read in seconds."""
CACHED_FILES = 2
"""Files whose tables are remembered: tests of one file are read one after another."""


def read_table(path: Any, **options: Unpack[ReadingOptions]) -> Table:
    """Return the table in a file, or in memory; as `read_tables`, where that is one.

    Raises
    ------
    InputError
        When there are several, with how to choose.
    """
    tables = read_tables(path, **options)
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


def read_tables(path: Any, **options: Unpack[ReadingOptions]) -> list[Table]:
    """Return the tables in a file, where lines above them, names, units and rows are recognised, or that in memory.

    Tables with the same names that go on from one to the next, in time or without one in every column, are one.

    Parameters
    ----------
    path : str or path, or table
        Comma-, semicolon-, tab- or blank-separated text, or a workbook; or a table in memory, such as a DataFrame of
        pandas (`tissuq.experiments.reading.data_frame`).
    options
        Of `tissuq.read`, of which ``skip_rows``, ``sheet`` and ``table`` are looked at; without these it is all tables.

    Raises
    ------
    InputError
        When the file cannot be read, holds no table of numbers, or its rows do not match its header.
    """
    skip_rows, sheet, number = options.get("skip_rows", 0), options.get("sheet"), options.get("table")
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
        every_sheet = workbook.lines_by_sheet(path)
        short = {name: list(enumerate(lines, 1)) for name, lines in every_sheet.items() if len(lines) <= SHORT}
        sheets = sheets_with_tables(path, every_sheet, sheet)
        tables = list[Table]()
        for name, lines in sheets.items():
            beside = {sheet: short[sheet] for sheet in short if sheet != name}
            of_sheet = _read_every_line(f"{path}, sheet '{name}'", lines, skip_rows, SEPARATOR_OF_CELLS, name)
            tables += [replace(table, other_lines={**table.other_lines, **beside}) for table in of_sheet]
        return tuple(tables)
    if sheet is not None:
        raise InputError(f"{path} is not an Excel workbook and has no sheets; leave sheet (--sheet) out.")
    lines = read_lines(path)
    long = _read_long(path, lines, skip_rows)
    return tuple(_read_every_line(path, lines, skip_rows)) if long is None else (long,)


def _of_data_frame(data: Any) -> Table:
    """Return the table in memory, with cells as they are in a file: numbers to the last digit."""
    columns = columns_of(data)
    rows = lines_of(columns)
    table = Table(
        file=kind_of(data),
        names=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns),
        separator=SEPARATOR_OF_CELLS,
        rows=rows,
        lines=range(len(rows)),
        counted="row",
    )
    if is_units_row(first_row := split(rows[0], SEPARATOR_OF_CELLS)) and not any(table.units):
        table = replace(table.taken(np.arange(1, len(rows))), units=tuple(first_row))
    if len(rows) >= LONG_FILE and (block := _block(columns)) is not None:
        return replace(table, block=block)
    return without_summary(with_plain_numbers(table))


def _block(columns: Sequence[DataColumn]) -> FloatArray | None:
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
        head, *later_tables = _read_every_line(file, lines[:HEAD_LINES], skip_rows)
    except InputError:
        return None
    if later_tables:
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
    content = _without_comments(filled)
    if (on_its_side := transposed_table(file, content, separator, sheet)) is not None:
        return [on_its_side]
    layout = find_layout([text for _, text in content], separator)
    if layout is None:
        raise _no_table(file, content)
    starts = [content[position][0] for position in later_tables(content, layout)]
    bounds = pairwise(bisect_left(filled, (start, "")) for start in (0, *starts, len(lines) + 1))
    spans = [filled[start:stop] for start, stop in bounds]
    tables = joined_where_they_go_on([_table_of(file, span, layout.separator, sheet) for span in spans])
    lines_with_text = {line for line, _ in filled}
    tables = [block for table in tables for block in blocks_of(table, lines_with_text)]
    if len(tables) == 1:
        return tables
    named = []
    for number, table in enumerate(tables, start=1):
        short = [neighbour for neighbour in tables if neighbour is not table and len(neighbour.rows) <= SHORT]
        beside = [line for near in short for line in (*near.head, *zip(near.lines, near.rows, strict=True))]
        named.append(replace(table, file=f"{file}, table {number}", number=number, other_lines={"": beside}))
    return named


def _without_comments(lines: Lines) -> Lines:
    return [(line, text) for line, text in lines if ("#" not in text and "//" not in text) or not is_comment(text)]


def _table_of(file: str, filled: Lines, separator: str, sheet: str) -> Table:
    """Return the table in numbered lines that are not blank."""
    content = _without_comments(filled)
    texts = [text for _, text in content]
    layout = find_layout(texts, separator)
    if layout is None:
        raise _no_table(file, content)
    first_line = content[layout.first_row][0]
    if layout.names is None:
        header_line, header = _comment_above(filled, first_line)
    else:
        header_line, header = content[layout.names]
    head, rows = filled[: bisect_left(filled, (first_line, ""))], texts[layout.first_row :]
    names = names_said_otherwise([text for _, text in head], rows, layout.separator, layout.width)
    names = names or column_names(header, layout.width, layout.separator, has_units=layout.units is not None)
    width = len(names) or layout.width
    if width > MOST_COLUMNS:
        raise InputError(
            f"{file}: a table of {width} columns; at most {MOST_COLUMNS} are read. Put those of the tests into a file "
            "of their own."
        )
    units = [] if layout.units is None else split(texts[layout.units], layout.separator)
    number = names[0] if names and NUMBER.fullmatch(names[0]) else ""
    table = Table(
        file=file,
        names=padded(names, width),
        units=padded(units, width),
        separator=layout.separator,
        rows=rows,
        lines=[line for line, _ in content[layout.first_row :]],
        head=head,
        sheet=sheet,
        title=number or title_of(texts[: layout.names or 0], separator),
    )
    table = without_statements_beside(table)
    _check_shape(table, f"line {header_line} with the column names" if names else "the table")
    if layout.names:
        table = with_names_above(table, texts[layout.names - 1])
    return without_summary(with_plain_numbers(table))


def _no_table(file: str, content: Lines) -> InputError:
    if not content:
        return InputError(f"{file} holds only comments and blank lines; expected a table of numbers.")
    line, text = content[-1]
    return InputError(
        f"{file} holds no rows of numbers: no line has numbers in two columns. The last line "
        f"with text ({line}) reads '{text.strip()[:80]}'. Expected two columns of numbers or more, such as stretches "
        "and stresses."
    )


def _comment_above(filled: Lines, first_line: int) -> tuple[int, str]:
    """Return the comment just above the data as a candidate for the names: numpy.savetxt writes them so."""
    line, text = next(((line, text) for line, text in reversed(filled) if line < first_line), (0, ""))
    return (line, text.lstrip("#/ \t")) if is_comment(text) else (0, "")


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
