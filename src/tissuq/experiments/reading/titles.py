"""What the lines above a table call it: a number before its names, a specimen, or what stands alone."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tissuq.experiments.numbers import NUMBER, number_and_unit
from tissuq.experiments.reading.headings import heading, is_of_specimens
from tissuq.experiments.reading.layout import WHITESPACE, split

__all__ = ["number_before", "title_of"]


def number_before(names: Sequence[str]) -> str:
    """Return the number of a table that stands before the names of its columns; an empty text where none does."""
    return names[0] if names and NUMBER.fullmatch(names[0]) else ""


def title_of(above: Sequence[str], separator: str) -> str:
    """Return what the lines above the names call the table; an empty text where they do not.

    That is the specimen that they state, or else what stands alone in the last of them that states no size; sizes may
    stand beneath it.
    """
    lines = [[cell for cell in split(line, separator) if cell] for line in above]
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
