"""What a table holds beside its columns: statements about the specimen, or results, behind an empty column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import methodcaller

from tissuq.experiments.numbers import NUMBER
from tissuq.experiments.reading.layout import WHITESPACE, joined, split
from tissuq.experiments.reading.table import Table

__all__ = ["without_statements_beside"]

LARGEST_SHARE = 0.5
"""Share of the rows of a table beside which statements stand; a column of measurements goes on to its end."""
GAPS = 2
"""Rows from the first of the table to the last statement, over the number of statements, at most."""


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
        beside = [(line, _filled(row[gap + 1 :])) for line, row in zip(table.lines, cells, strict=True)]
        statements = [(line, row) for line, row in beside if row]
        if _are_statements([row for _, row in beside]):
            head = [(line, joined(row, table.separator)) for line, row in statements]
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
    if not filled or len(filled) > LARGEST_SHARE * len(rows) or filled[-1] >= GAPS * len(filled) + GAPS:
        return False
    stated = [rows[position] for position in filled]
    begin_with_words = all(len(row) > 1 and not NUMBER.fullmatch(row[0]) for row in stated)
    return begin_with_words and any(NUMBER.fullmatch(row[1]) for row in stated)


def _filled(cells: Sequence[str]) -> list[str]:
    return [cell for cell in cells if cell]
