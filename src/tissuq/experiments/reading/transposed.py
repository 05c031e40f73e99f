"""Tables that lie on their side: the names of columns in the first cells of lines, and their values after them."""

from __future__ import annotations

from collections.abc import Sequence

from tissuq.experiments.numbers import NUMBER
from tissuq.experiments.reading.headings import is_of_role
from tissuq.experiments.reading.layout import MISSING, joined, likely_separator, split
from tissuq.experiments.reading.table import Lines, Table
from tissuq.experiments.units import looks_like_unit

__all__ = ["transposed_table"]

FEWEST_VALUES = 4
"""Of each column."""
MOST_LINES = 200
"""Of a file, or a sheet, that is such a table."""


def transposed_table(file: str, content: Lines, separator: str | None, sheet: str) -> Table | None:
    """Return the table in numbered lines where its columns are lines; None where it stands upright.

    Two or more lines after one another begin with names, of which two or more are those of deformations and loads, and
    go on with values, all as many; units may stand between them. What stands above are lines above the table.
    """
    if len(content) > MOST_LINES:
        return None
    separator = separator or likely_separator([text for _, text in content])
    rows = [(line, _column(split(text, separator))) for line, text in content]
    first_column = next((k for k, (_, column) in enumerate(rows) if column), len(rows))
    columns = [column for _, column in rows[first_column:] if column]
    is_whole = len(columns) == len(rows) - first_column and len({len(values) for _, _, values in columns}) == 1
    if not is_whole or sum(is_of_role(name) for name, _, _ in columns) < 2:
        return None
    names, units, values = zip(*columns, strict=True)
    cells = list(zip(*values, strict=True))
    start = 1 + any(units)
    return Table(
        file=file,
        names=tuple(names),
        units=tuple(units),
        separator=separator,
        rows=[joined(row, separator) for row in cells],
        lines=range(start + 1, start + 1 + len(cells)),
        head=content[:first_column],
        sheet=sheet,
        counted="column",
        notes=("its columns are lines of the file, each with its name first; it was read turned upright.",),
    )


def _column(cells: Sequence[str]) -> tuple[str, str, tuple[str, ...]] | None:
    """Return the name, the unit, if there is one, and the values in the cells of a line; None where it is no column."""
    while cells and not cells[-1]:
        cells = cells[:-1]
    if len(cells) <= FEWEST_VALUES or not cells[0] or NUMBER.fullmatch(cells[0]):
        return None
    has_unit = not NUMBER.fullmatch(cells[1]) and cells[1] and looks_like_unit(cells[1])
    values = cells[1 + bool(has_unit) :]
    are_values = all(cell.lower() in MISSING or NUMBER.fullmatch(cell) for cell in values)
    is_column = are_values and sum(NUMBER.fullmatch(cell) is not None for cell in values) >= FEWEST_VALUES
    return (cells[0], cells[1] if has_unit else "", tuple(values)) if is_column else None
