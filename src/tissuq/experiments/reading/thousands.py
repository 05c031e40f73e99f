"""Thousands separators in a table, where numbers with both marks, such as ``1,016.9``, tell which mark they are."""

from __future__ import annotations

import re
from dataclasses import replace

from tissuq.experiments.numbers import GROUPED, NUMBER
from tissuq.experiments.reading.layout import joined, split
from tissuq.experiments.reading.table import Table

__all__ = ["without_thousands"]

MAY_BE_GROUPED = re.compile(r"\d[.,]\d{3}[.,]\d")


def without_thousands(table: Table) -> Table:
    """Return the table without thousands separators; as it is where there are none, or numbers contradict."""
    cells = {
        cell: line
        for line, row in reversed(list(zip(table.lines, table.rows, strict=True)))
        if MAY_BE_GROUPED.search(row)
        for cell in split(row, table.separator)
        if not NUMBER.fullmatch(cell)
    }
    found = {mark: cell for mark, grouped in GROUPED.items() for cell in cells if grouped.fullmatch(cell)}
    if len(found) != 1:
        return table
    ((mark, example),) = found.items()
    rows = [split(row, table.separator) for row in table.rows]
    if any(_is_decimal(cell, mark) for row in rows for cell in row):
        return table
    plain = [[cell.replace(mark, "") if GROUPED[mark].fullmatch(cell) else cell for cell in row] for row in rows]
    note = f"'{mark}' was taken for a thousands separator, as in '{example}' in {table.counted} {cells[example]}."
    return replace(table, rows=[joined(row, table.separator) for row in plain], notes=(*table.notes, note))


def _is_decimal(cell: str, mark: str) -> bool:
    """Tell whether a cell is a number in which a mark is the decimal one."""
    return mark in cell and NUMBER.fullmatch(cell) is not None and not GROUPED[mark].fullmatch(cell)
