"""What the lines above a table say of it: its title, a specimen, and names that stand over its columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from tissuq.experiments.numbers import NUMBER, number_and_unit
from tissuq.experiments.reading.headings import (
    dimensions_named,
    heading,
    is_of_mean,
    is_of_role,
    is_of_specimens,
    of_spread,
    plain,
)
from tissuq.experiments.reading.layout import WHITESPACE, split
from tissuq.experiments.reading.table import Table, filled_on, padded
from tissuq.experiments.units import looks_like_unit, measured_in

__all__ = ["names_above", "number_before", "title_of", "with_names_above"]


def number_before(names: Sequence[str]) -> str:
    """Return the number of a table that stands before the names of its columns; an empty text where none does."""
    return names[0] if names and NUMBER.fullmatch(names[0]) else ""


def title_of(lines_above: Sequence[str], separator: str) -> str:
    """Return what the lines above the names call the table; an empty text where they do not.

    That is the specimen that they state, or else what stands alone in the last of them that states no size; sizes may
    stand beneath it.
    """
    lines = [[cell for cell in split(line, separator) if cell] for line in lines_above]
    if separator == WHITESPACE:
        lines = [[" ".join(cells)] for cells in lines]
    last = lines[-1] if lines else []
    while lines and (statement := _statement(lines[-1])):
        name, value = statement
        if is_of_specimens(heading(name).quantity):
            return value
        if number_and_unit(value)[0] is None:
            break
        lines.pop()
    cells = lines[-1] if lines else last
    if len(cells) != 1 or number_and_unit(cells[0])[0] is not None or all(map(NUMBER.fullmatch, cells[0].split())):
        return ""
    return cells[0]


def _statement(cells: Sequence[str]) -> tuple[str, str] | None:
    """Return the name and the value in a line such as ``Width: 5 mm``, in one cell or in several; None in others."""
    name, *values = [word.strip() for cell in cells for word in re.split(r"[:=]", cell)]
    return (name, " ".join(filter(None, values))) if any(values) and not NUMBER.fullmatch(name) else None


def with_names_above(table: Table, line: str) -> Table:
    """Return the table with the names of quantities in the line above its names, which are then those of specimens.

    Only where that line names quantities alone, the names do not, and one of them is over several columns. Names of
    means and of spreads are added to that of the quantity.
    """
    quantities = split(line, table.separator)
    if not all(is_of_role(name) for name in quantities if name) or len(quantities) > len(table.names):
        return table
    over = filled_on(padded(quantities, len(table.names)))
    is_unit = [not name or looks_like_unit(name) for name in table.names]
    specimens = [column for column, unit in enumerate(is_unit) if not unit]
    has_several = any([over[column] for column in specimens].count(name) > 1 for name in quantities if name)
    if not has_several or not all(over) or any(is_of_role(table.names[column]) for column in specimens):
        return table
    names = [
        name if unit else _joined(name, label) for name, label, unit in zip(over, table.names, is_unit, strict=True)
    ]
    units = [unit or name * beneath for unit, name, beneath in zip(table.units, table.names, is_unit, strict=True)]
    return replace(table, names=tuple(names), units=tuple(units))


def _joined(quantity: str, label: str) -> str:
    """Return the name of a quantity, with the unit that its label has, if any, and the words of a mean or a spread."""
    name, of_label = heading(quantity), heading(label)
    is_statistic = is_of_mean(of_label.quantity) or of_spread(of_label.quantity)[0]
    words = f"{name.quantity} {of_label.quantity}" if is_statistic else name.quantity
    unit = of_label.unit or name.unit
    return f"{words} ({unit})" if unit else words


def names_above(table: Table, columns: Sequence[int]) -> list[str]:
    """Return what the last line above the names of columns says over each of some; nothing where it says no names.

    What stands over the first of neighbouring columns goes for them all. A line of sizes says no names.
    """
    names = table.quantities
    for _, text in reversed(table.head):
        cells = split(text, table.separator)[: len(names)]
        if [heading(cell).quantity for cell in cells] == names[: len(cells)] or not any(cells):
            continue
        if any(map(_states_size, cells)):
            continue
        names_over = filled_on(cells + [""] * (len(names) - len(cells)))
        over = [names_over[column] for column in columns]
        if all(over) and len({plain(name) for name in over}) == len(over):
            return over
    return []


def _states_size(cell: str) -> bool:
    """Tell whether a cell names a size, or holds one with its unit."""
    name, unit = re.split("[:=]", cell)[0], number_and_unit(cell)[1].removesuffix("2").removesuffix("²")
    is_length = measured_in(unit) == "length" and len(unit) > 1  # one letter may be of months or minutes
    return bool(dimensions_named(heading(name).quantity, is_cylinder=True)) or is_length
