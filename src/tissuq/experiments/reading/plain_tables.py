"""Tables of measurements alone, in plain numbers: no statements beside them, summaries beneath, or marks in numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from operator import methodcaller
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError
from tissuq.experiments.numbers import GROUPED, MEAN_WITH_SPREAD, NUMBER, number_in
from tissuq.experiments.reading.headings import heading, is_of_role, of_spread, plain
from tissuq.experiments.reading.layout import MISSING, WHITESPACE, joined, split
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import SPREADS
from tissuq.experiments.units import looks_like_unit

LARGEST_SHARE = 0.5
"""Share of the rows of a table beside which statements stand; a column of measurements goes on to its end."""
ROWS_OF_STATEMENT = 2
"""Rows from the first of the table to the last statement, over the number of statements, at most."""
MOST_ROWS, FEWEST_MEASUREMENTS = 8, 5
"""Rows that a summary has at most, and a table above it at least."""
JUMP, JUMP_OF_RANGE = 3.0, 0.02
"""Times the largest step in a column, and share of its range beyond that, by which a row does not go on from above."""
STATISTICS: dict[str, Callable[[FloatArray], Any]] = {
    "maximum": np.max,
    "minimum": np.min,
    "mean": np.mean,
    "median": np.median,
    "standard deviation": lambda values: np.std(values, ddof=1),
    "standard deviation of all": np.std,
    "standard error": lambda values: np.std(values, ddof=1) / np.sqrt(len(values)),
    "range": np.ptp,
    "sum": np.sum,
    "number of rows": len,
    "coefficient of variation": lambda values: np.std(values, ddof=1) / np.mean(values) if np.mean(values) else np.nan,
}
"""What a summary tells of the columns above it."""
ROUNDED = 1.01
"""Units of its last digit by which a statistic may differ: it and the measurements were rounded, half a unit each."""
FLOATING = 1e-9
"""Share of a statistic by which it may differ where all digits of a computer are written."""
OF_ONE_ROW = {"maximum", "minimum"}
"""Statistics that the last measurement, too, may be."""

MAY_BE_GROUPED = re.compile(r"\d[.,]\d{3}[.,]\d")
WITH_UNIT = re.compile(rf"({NUMBER.pattern})\s*(%|[^\W\d_]\S*)")
"""As in ``10 %`` and ``1.2 kPa``."""
ROWS_OF_LABEL = 5
"""Rows one after another that have the same cell, on average, where it is the name of a test and not measured."""
FIRST_ROWS = 10
"""Rows of which one holds a mean with its spread where others do."""
SPREAD_IN_NAME = re.compile(
    r"[\[(]?(,?\s*\bmean)?\s*(±|\+/?-)\s*(?P<kind>[^\W\d_][\w.]*([ .]*(dev|err)\w*\.?)?)?\s*[\])]?", re.IGNORECASE
)
"""As in ``Stress, mean ± SD (kPa)`` and ``Stress (kPa) ± SEM``."""


def without_statements_beside(table: Table) -> Table:
    """Return the table without statements such as ``Width (mm) | 5`` to its right, which are added to the lines above.

    They stand behind a column without name and cells, from the first rows on, and each begins with a word. A name may
    stand over them, or none.
    """
    gaps = [gap for gap in range(1, len(table.names) - 1) if not table.names[gap] and any(table.names[gap + 1 :])]
    longest = max(map(methodcaller("count", table.separator), table.rows))
    if table.separator != WHITESPACE and longest > len(table.names):
        gaps.append(len(table.names))
    for gap in gaps:
        cells = [split(row, table.separator) for row in table.rows]
        if any(row[gap] for row in cells if len(row) > gap):
            continue
        beside = [[cell for cell in row[gap + 1 :] if cell] for row in cells]
        if _are_statements(beside):
            statements = zip(table.lines, beside, strict=True)
            head = [(line, joined(statement, table.separator)) for line, statement in statements if statement]
            return replace(
                table,
                names=table.names[:gap],
                units=table.units[:gap],
                rows=[joined(row[:gap], table.separator) for row in cells],
                head=[*table.head, *head],
            )
    return table


def _are_statements(rows: Sequence[Sequence[str]]) -> bool:
    """Tell whether what stands beside the rows of a table are some words with what they state, numbers among them."""
    filled = [position for position, row in enumerate(rows) if row]
    if not filled or len(filled) > LARGEST_SHARE * len(rows) or filled[-1] >= ROWS_OF_STATEMENT * (len(filled) + 1):
        return False
    stated = [rows[position] for position in filled]
    begin_with_words = all(len(row) > 1 and not NUMBER.fullmatch(row[0]) for row in stated)
    return begin_with_words and any(NUMBER.fullmatch(row[1]) for row in stated)


def without_summary(table: Table) -> Table:
    """Return the table without the rows at its end that are no measurements, and that are noted.

    They stand beneath a blank line, or have a word where the rows above have numbers. They are a summary where each
    is a statistic of the columns above, or has such a word beneath a blank line. Rows right beneath the measurements
    are a summary where all are statistics.

    Raises
    ------
    InputError
        When rows stand apart that do not go on from the ones above, and are no summary that is known.
    """
    start = _start_beneath_gap(table.lines)
    is_apart = start is not None
    if start is None:
        start = _start_of_labels(table)
    if start is None:
        return _without_statistics(table)
    if start < max(FEWEST_MEASUREMENTS, len(table.rows) - start):
        return table
    numbers, beneath, of_numbers = _parted(table, start)
    names = [_statistic(row, numbers, of_numbers) for row in beneath]
    has_word = [_has_word(row, of_numbers) for row in beneath]
    if all(name or (is_apart and word) for name, word in zip(names, has_word, strict=True)):
        return _without_rows(table, start, names)
    if not _jumps(numbers, beneath, of_numbers):
        return table
    raise InputError(
        f"{table.file}, {_place(table, start)}: set apart at the end of the table, and not going on from "
        f"{table.counted} {table.lines[start - 1]}. Delete a summary; put measurements into a file of their own."
    )


def _without_statistics(table: Table) -> Table:
    """Return the table without last rows that are statistics of those above, unless a last measurement may be one."""
    earliest = max(FEWEST_MEASUREMENTS, len(table.rows) - MOST_ROWS)
    end = table.taken(np.arange(max(0, len(table.rows) - 3 * MOST_ROWS), len(table.rows)))
    if earliest >= len(table.rows) or not _jumps(*_parted(end, len(end.rows) - (len(table.rows) - earliest))):
        return table
    for start in range(earliest, len(table.rows)):
        numbers, beneath, of_numbers = _parted(table, start)
        names = [_statistic(row, numbers, of_numbers) for row in beneath]
        if all(names) and not OF_ONE_ROW.issuperset(names):
            return _without_rows(table, start, names)
    return table


def _without_rows(table: Table, start: int, statistics: Sequence[str]) -> Table:
    """Return the table up to a row, with a note of the statistics that are left out."""
    names = ", ".join(dict.fromkeys(filter(None, statistics)))
    what = f" with its {names}" if names else ""
    note = f"{_place(table, start)} at the end of the table, a summary{what}, left out: no measurements."
    return table.taken(np.arange(start)).noted(note)


def _place(table: Table, start: int) -> str:
    """Return the lines from a row to the last, in words."""
    top, bottom = table.lines[start], table.lines[-1]
    return f"{table.counted} {top}" if top == bottom else f"{table.counted}s {top} to {bottom}"


def _parted(table: Table, start: int) -> tuple[FloatArray, list[tuple[str, ...]], BoolArray]:
    """Return the numbers above a row, the cells from there on, and which columns above hold only numbers."""
    cells = table.cells()
    numbers = np.array([[number_in(cell) for cell in row] for row in cells[:start]])
    return numbers, cells[start:], np.isfinite(numbers).all(axis=0)


def _start_beneath_gap(lines: Sequence[int]) -> int | None:
    """Return the row beneath the only place where lines are blank, within the last rows of a table."""
    if lines[-1] - lines[0] == len(lines) - 1:
        return None
    row = int(np.flatnonzero(np.diff(lines) > 1)[0]) + 1
    return row if len(lines) - row <= MOST_ROWS else None


def _start_of_labels(table: Table) -> int | None:
    """Return the first of the last rows that have a word in a cell where the row before them has a number."""
    last = table.taken(np.arange(max(0, len(table.rows) - MOST_ROWS - 1), len(table.rows))).cells()
    for count, (row, row_above) in enumerate(pairwise(reversed(last)), start=1):
        words = [_is_word(cell) for cell in row]
        if not any(words):
            break
        if any(word and NUMBER.fullmatch(cell) for word, cell in zip(words, row_above, strict=False)):
            return len(table.rows) - count
    return None


def _statistic(row: Sequence[str], numbers: FloatArray, of_numbers: BoolArray) -> str:
    """Return which statistic all numbers of a row are, to their last digit; an empty text if none."""
    columns = [column for column in np.flatnonzero(of_numbers).tolist() if NUMBER.fullmatch(row[column])]
    if len(columns) < 2 and not (columns and _has_word(row, of_numbers)):
        return ""
    for name, statistic in STATISTICS.items():
        if all(abs(number_in(row[k]) - statistic(numbers[:, k])) <= _rounding(row[k]) for k in columns):
            return name
    return ""


def _jumps(numbers: FloatArray, beneath: Sequence[Sequence[str]], of_numbers: BoolArray) -> bool:
    """Tell whether rows do not go on from the ones above as those do among themselves."""
    values = np.array([[number_in(cell) for cell in row] for row in beneath])
    numbers, steps = (
        numbers[:, of_numbers],
        np.abs(np.diff(np.vstack([numbers[-1:], values])[:, of_numbers], axis=0)),
    )
    allowed = JUMP * np.abs(np.diff(numbers, axis=0)).max(axis=0) + JUMP_OF_RANGE * np.ptp(numbers, axis=0)
    return bool((np.nan_to_num(steps) > allowed).any())


def _has_word(row: Sequence[str], of_numbers: BoolArray) -> bool:
    return any(_is_word(row[column]) for column in np.flatnonzero(of_numbers).tolist())


def _is_word(cell: str) -> bool:
    return cell.lower() not in MISSING and not NUMBER.fullmatch(cell)


def _rounding(cell: str) -> float:
    """Return by how much a number may differ from the statistic that it was rounded from."""
    mantissa, _, exponent = cell.lower().replace(",", ".").partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    return float(ROUNDED * float(f"1e{-decimals}") + FLOATING * abs(number_in(cell)))


def with_plain_numbers(table: Table) -> Table:
    """Return the table with plain numbers in its cells, means and their spreads in columns of their own."""
    return _with_spreads_apart(_without_units(_without_thousands(table)))


def _without_thousands(table: Table) -> Table:
    """Return the table without thousands separators; as it is where there are none, or numbers contradict.

    Numbers with both marks, such as ``1,016.9``, tell which mark they are.
    """
    lines_of_cells = {
        cell: line
        for line, row in reversed(list(zip(table.lines, table.rows, strict=True)))
        if MAY_BE_GROUPED.search(row)
        for cell in split(row, table.separator)
        if not NUMBER.fullmatch(cell)
    }
    examples = {mark: cell for mark, grouped in GROUPED.items() for cell in lines_of_cells if grouped.fullmatch(cell)}
    if len(examples) != 1:
        return table
    ((mark, example),) = examples.items()
    grouped, rows = GROUPED[mark], table.cells()
    numbers_with_mark = (cell for row in rows for cell in row if mark in cell and NUMBER.fullmatch(cell))
    if not all(map(grouped.fullmatch, numbers_with_mark)):  # the mark is the decimal one of some
        return table
    without = [[cell.replace(mark, "") if grouped.fullmatch(cell) else cell for cell in row] for row in rows]
    position = f"{table.counted} {lines_of_cells[example]}"
    return table.with_cells(without).noted(
        f"'{mark}' was taken for a thousands separator, as in '{example}' in {position}."
    )


def _without_units(table: Table) -> Table:
    """Return the table with a unit for columns whose cells all have that unit, unless they state another one.

    Workbooks show ratios so, in %; other units are taken from measured columns of deformations and loads alone.
    """
    if not [row for row in table.rows if "%" in row] and not any(map(WITH_UNIT.search, table.rows[:FIRST_ROWS])):
        return table
    rows, unit_of = table.cells(), dict[int, str]()
    for column, cells in enumerate(zip(*rows, strict=True)):
        filled = [cell for cell in cells if cell.lower() not in MISSING]
        stated = {match[2] if match else "" for match in map(WITH_UNIT.fullmatch, filled)}
        unit = stated.pop() if len(stated) == 1 else ""
        is_measured = sum(cell != next_cell for cell, next_cell in pairwise(filled)) > len(filled) / ROWS_OF_LABEL
        is_known = unit == "%" or (is_measured and is_of_role(table.names[column]) and looks_like_unit(unit))
        if unit and is_known and set(table.stated_units(column)) <= {"", unit}:
            unit_of[column] = unit
    if not unit_of:
        return table
    units = [unit_of.get(column, unit) for column, unit in enumerate(table.units)]
    without = [
        [WITH_UNIT.sub(r"\1", cell) if column in unit_of else cell for column, cell in enumerate(row)] for row in rows
    ]
    notes = []
    for unit in dict.fromkeys(unit_of.values()):
        names = " and ".join(table.label(column) for column in unit_of if unit_of[column] == unit)
        what = "percentages" if unit == "%" else "numbers with their unit"
        notes.append(f"{names}: the cells are {what}, and were read as numbers in {unit}.")
    return replace(table.with_cells(without), units=tuple(units)).noted(*notes)


def _with_spreads_apart(table: Table) -> Table:
    """Return the table with two columns for each whose cells all hold a mean with its spread, as in ``17.0 ± 3.4``.

    The name of the second says which spread it is where that of the first does, as in ``Stress, mean ± SD (kPa)``.
    """
    if not any(map(MEAN_WITH_SPREAD.search, table.rows[:FIRST_ROWS])):
        return table
    names, units, columns, parted = list[str](), list[str](), list[Sequence[str]](), list[str]()
    for position, cells in enumerate(zip(*table.cells(), strict=True)):
        name, unit = table.names[position], table.units[position]
        pairs = [(MEAN_WITH_SPREAD.fullmatch(cell), cell) for cell in cells]
        is_parted = any(match for match, _ in pairs) and all(match or cell.lower() in MISSING for match, cell in pairs)
        if is_parted:
            parted.append(table.label(position))
            names += _names(name)
            columns += [[match[group] if match else cell for match, cell in pairs] for group in (1, 2)]
        else:
            names.append(name)
            columns.append(cells)
        units += [unit] * (1 + is_parted)
    if not parted:
        return table
    note = f"{' and '.join(parted)}: means with their spreads, read as a column of each."
    return replace(table.with_cells(zip(*columns, strict=True)), names=tuple(names), units=tuple(units)).noted(note)


def _names(name: str) -> tuple[str, str]:
    """Return the names of a mean and of its spread, both with the unit of their common name."""
    words = SPREAD_IN_NAME.search(name)
    kind, _ = of_spread(plain(words["kind"] or "")) if words else ("", "")
    of_mean = SPREAD_IN_NAME.sub(" ", name).strip()
    name_of_mean = heading(of_mean)
    return of_mean, name_of_mean.with_unit(f"{name_of_mean.quantity} {kind if kind in SPREADS else '±'}")
