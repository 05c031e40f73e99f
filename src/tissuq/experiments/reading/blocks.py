"""Tables beneath one another: of which a time goes on in the next one, and blocks of one that each begin anew."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.numbers import NUMBER, number_in
from tissuq.experiments.reading.layout import FEWEST_ROWS
from tissuq.experiments.reading.table import Table

__all__ = ["blocks_of", "joined_in_time"]

SAME, FAR = 0.1, 0.5
"""Share of the range of a column within which all blocks begin, and by which one of them goes back at a blank line."""
TIME = re.compile(r"\b(time|zeit|temps|tiempo|tempo|время)|(zeit|time)$|时间|時間|시간")
"""Names of a column of times."""


def blocks_of(table: Table, filled: Collection[int]) -> list[Table]:
    """Return the tests in a table: one, unless it begins anew after a blank line in all columns that change.

    Parameters
    ----------
    table : Table
    filled : collection of int
        The lines of the file that are not blank.
    """
    gaps = [row for row, (line, later) in enumerate(pairwise(table.lines), start=1) if later > line + 1]
    gaps = [
        row for row in gaps if any(line not in filled for line in range(table.lines[row - 1] + 1, table.lines[row]))
    ]
    if not gaps:
        return [table]
    cells = table.cells()
    numbers = _numbers(cells)
    starts = [row for row in gaps if _begins_anew(numbers, row) and not _is_named(cells, row)]
    bounds = list(pairwise([0, *starts, len(table.rows)]))
    if not starts or any(stop - start < FEWEST_ROWS for start, stop in bounds):
        return [table]
    note = "tests are parted where the table begins anew after a blank line; --table chooses one."
    blocks = [table.taken(np.arange(start, stop)) for start, stop in bounds]
    return [block.noted(note) for block in blocks]


def _is_named(cells: Sequence[Sequence[str]], row: int) -> bool:
    """Tell whether words in a column name what begins at a row, and name something else above it."""
    rows = zip(*cells[row - 2 : row + 1], strict=True)
    return any(a == b != c and c and not NUMBER.fullmatch(c) for a, b, c in rows)


def _numbers(texts: Sequence[Sequence[str]]) -> NDArray[np.float64]:
    """Return the numbers (rows, columns) in columns that change; nan for cells without one."""
    cells = np.array([[number_in(cell) for cell in row] for row in texts])
    has_numbers = np.isfinite(cells[0])
    cells = cells[:, has_numbers]
    return np.asarray(cells[:, np.nanmax(cells, axis=0) > np.nanmin(cells, axis=0)])


def _begins_anew(numbers: NDArray[np.float64], row: int) -> bool:
    """Tell whether a row begins like the first, and in a column far from the row before it."""
    span = np.nanmax(numbers, axis=0) - np.nanmin(numbers, axis=0)
    is_same = np.abs(numbers[row] - numbers[0]) <= SAME * span
    return bool(len(span) and is_same.all() and (np.abs(numbers[row] - numbers[row - 1]) >= FAR * span).any())


def joined_in_time(tables: Sequence[Table]) -> list[Table]:
    """Return tables, those that go on from the one before as one with it."""
    joined = list(tables[:1])
    for table in tables[1:]:
        if _goes_on(joined[-1], table):
            note = f"{joined[-1].span} and {table.span}, in which time goes on, read as one table."
            rows, lines = [*joined[-1].rows, *table.rows], [*joined[-1].lines, *table.lines]
            joined[-1] = replace(joined[-1], rows=rows, lines=lines).noted(note)
        else:
            joined.append(table)
    return joined


def _goes_on(table: Table, later: Table) -> bool:
    """Tell whether a table has the names of the one before, and times that go on from there."""
    if (table.names, table.units) != (later.names, later.units):
        return False
    times = [column for column, quantity in enumerate(table.quantities) if TIME.search(quantity)]
    ends = table.taken(np.array([0, len(table.rows) - 1]))
    return bool(times) and all(
        earlier[0] < earlier[-1] <= continued[0]
        for earlier, continued in zip(ends.numbers(times), later.taken(np.array([0])).numbers(times), strict=True)
    )
