"""Cells that hold a mean with its spread, as in ``17.0 ± 3.4``: a column of each."""

from __future__ import annotations

import re
from dataclasses import replace

from tissuq.experiments.numbers import MEAN_WITH_SPREAD
from tissuq.experiments.reading.headings import heading, of_spread, plain
from tissuq.experiments.reading.layout import MISSING, joined, split
from tissuq.experiments.reading.table import Table, padded
from tissuq.experiments.reading.vocabulary import SPREADS

__all__ = ["with_spreads_apart"]

FIRST_ROWS = 10
"""Rows of which one holds a mean with its spread where others do."""
SPREAD_IN_NAME = re.compile(
    r"[\[(]?(,?\s*\bmean)?\s*(±|\+/?-)\s*(?P<kind>[^\W\d_][\w.]*([ .]*(dev|err)\w*\.?)?)?\s*[\])]?", re.IGNORECASE
)
"""As in ``Stress, mean ± SD (kPa)`` and ``Stress (kPa) ± SEM``."""


def with_spreads_apart(table: Table) -> Table:
    """Return the table with two columns for each whose cells all hold a mean with its spread.

    The name of the second says which spread it is where that of the first does, as in ``Stress, mean ± SD (kPa)``.
    """
    if not any(map(MEAN_WITH_SPREAD.search, table.rows[:FIRST_ROWS])):
        return table
    columns = list(zip(*(padded(split(row, table.separator), len(table.names)) for row in table.rows), strict=True))
    names, units, cells, parted = list[str](), list[str](), list[list[str]](), list[str]()
    for position, (name, unit, column) in enumerate(zip(table.names, table.units, columns, strict=True)):
        matches = [MEAN_WITH_SPREAD.fullmatch(cell) for cell in column]
        if not any(matches) or not all(map(_may_be, matches, column)):
            names, units, cells = [*names, name], [*units, unit], [*cells, list(column)]
            continue
        parted.append(table.label(position))
        names, units = [*names, *_names(name)], [*units, unit, unit]
        cells += [
            [match[part] if match else cell for match, cell in zip(matches, column, strict=True)] for part in (1, 2)
        ]
    if not parted:
        return table
    rows = [joined(row, table.separator) for row in zip(*cells, strict=True)]
    note = f"{' and '.join(parted)}: means with their spreads, read as a column of each."
    return replace(table, names=tuple(names), units=tuple(units), rows=rows, notes=(*table.notes, note))


def _may_be(match: object, cell: str) -> bool:
    return match is not None or cell.lower() in MISSING


def _names(name: str) -> tuple[str, str]:
    """Return the names of a mean and of its spread, both with the unit of their common name."""
    words = SPREAD_IN_NAME.search(name)
    kind, _ = of_spread(plain(words["kind"] or "")) if words else ("", "")
    of_mean = SPREAD_IN_NAME.sub(" ", name).strip()
    parts = heading(of_mean)
    of_spreads = f"{parts.quantity} {kind if kind in SPREADS else '±'}"
    return of_mean, f"{of_spreads} ({parts.unit})" if parts.unit else of_spreads
