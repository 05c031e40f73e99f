"""Numbers that cells write with thousands separators, with the sign of a percentage, or as a mean with its spread."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from tissuq.experiments.numbers import GROUPED, MEAN_WITH_SPREAD, NUMBER
from tissuq.experiments.reading.headings import heading, of_spread, plain
from tissuq.experiments.reading.layout import MISSING, split
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import SPREADS

__all__ = ["with_plain_numbers"]

MAY_BE_GROUPED = re.compile(r"\d[.,]\d{3}[.,]\d")
PERCENTAGE = re.compile(rf"({NUMBER.pattern})\s*%")
FIRST_ROWS = 10
"""Rows of which one holds a mean with its spread where others do."""
SPREAD_IN_NAME = re.compile(
    r"[\[(]?(,?\s*\bmean)?\s*(±|\+/?-)\s*(?P<kind>[^\W\d_][\w.]*([ .]*(dev|err)\w*\.?)?)?\s*[\])]?", re.IGNORECASE
)
"""As in ``Stress, mean ± SD (kPa)`` and ``Stress (kPa) ± SEM``."""


def with_plain_numbers(table: Table) -> Table:
    """Return the table with plain numbers in its cells, means and their spreads in columns of their own."""
    return _with_spreads_apart(_without_percent_signs(_without_thousands(table)))


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


def _without_percent_signs(table: Table) -> Table:
    """Return the table with the unit % for columns whose cells all have that sign, unless they state another unit.

    Workbooks show ratios so.
    """
    if not [row for row in table.rows if "%" in row]:  # a generator is called for every row
        return table
    rows = table.cells()
    columns = [
        column
        for column, cells in enumerate(zip(*rows, strict=True))
        if _are_percentages(cells) and set(table.stated_units(column)) <= {"", "%"}
    ]
    if not columns:
        return table
    units = ["%" if column in columns else unit for column, unit in enumerate(table.units)]
    without = [
        [PERCENTAGE.sub(r"\1", cell) if column in columns else cell for column, cell in enumerate(row)] for row in rows
    ]
    names = " and ".join(map(table.label, columns))
    note = f"{names}: the cells are percentages, and were read as numbers in %."
    return replace(table.with_cells(without), units=tuple(units)).noted(note)


def _are_percentages(cells: Sequence[str]) -> bool:
    measured = [cell for cell in cells if cell.lower() not in MISSING]
    return bool(measured) and all(map(PERCENTAGE.fullmatch, measured))


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
    of_spreads = f"{name_of_mean.quantity} {kind if kind in SPREADS else '±'}"
    return of_mean, f"{of_spreads} ({name_of_mean.unit})" if name_of_mean.unit else of_spreads
