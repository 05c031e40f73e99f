"""Columns of percentages, each with its sign, as workbooks show ratios: numbers in the unit %."""

from __future__ import annotations

import re
from dataclasses import replace

from tissuq.experiments.numbers import NUMBER
from tissuq.experiments.reading.layout import MISSING, joined, split
from tissuq.experiments.reading.table import Table, padded

__all__ = ["without_percent_signs"]

PERCENTAGE = re.compile(rf"({NUMBER.pattern})\s*%")


def without_percent_signs(table: Table) -> Table:
    """Return the table with the unit % for columns whose cells all have that sign, unless they state another unit."""
    if not [row for row in table.rows if "%" in row]:
        return table
    rows = [padded(split(row, table.separator), len(table.names)) for row in table.rows]
    columns = [column for column in range(len(table.names)) if _are_percentages([row[column] for row in rows])]
    columns = [column for column in columns if set(table.stated_units(column)) <= {"", "%"}]
    if not columns:
        return table
    units = ["%" if column in columns else unit for column, unit in enumerate(table.units)]
    plain = [[_number(cell) if column in columns else cell for column, cell in enumerate(row)] for row in rows]
    names = " and ".join(map(table.label, columns))
    note = f"{names}: the cells are percentages, and were read as numbers in %."
    lines = [joined(row, table.separator) for row in plain]
    return replace(table, rows=lines, units=tuple(units), notes=(*table.notes, note))


def _are_percentages(cells: list[str]) -> bool:
    measured = [cell for cell in cells if cell.lower() not in MISSING]
    return bool(measured) and all(map(PERCENTAGE.fullmatch, measured))


def _number(cell: str) -> str:
    match = PERCENTAGE.fullmatch(cell)
    return match[1] if match else cell
