"""Sizes that lines of a file state more than once: measured again, or of several specimens over their columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from tissuq.experiments.numbers import NUMBER, number_and_unit
from tissuq.experiments.reading.headings import dimensions_named, heading, is_of_specimens, plain
from tissuq.experiments.reading.layout import WHITESPACE, split
from tissuq.experiments.reading.side_by_side import columns_side_by_side
from tissuq.experiments.reading.table import Table
from tissuq.experiments.units import looks_like_unit

__all__ = ["Place", "SizesInLine", "TestBeside", "are_named", "numbered", "sizes_in_line", "test_beside"]

NUMBERED = re.compile(
    r"(?P<name>[^\d]*[^\W\d]{2}[^\d]*?)[\s_]*(?:(?:[#№]|\bn[or]\.?)\s*)?(?P<number>[1-9])\s*(?P<unit>[\[(][^\])]*[\])])?"
)
"""As in ``Width 2 (mm)`` and ``Thickness #1``; two letters at least, so not ``L0``."""
LONGEST_NAME = 80
"""Characters of the name of a size."""


class TestBeside(NamedTuple):
    """One of several tests side by side in a table: its name, its column of loads, and those of all tests."""

    name: str
    load: int
    names: Sequence[str]
    loads: Sequence[int]

    @property
    def number(self) -> str:
        """The digits in its name."""
        return re.sub(r"\D", "", self.name)

    @property
    def numbers(self) -> list[str]:
        """Those in the names of all tests."""
        return [re.sub(r"\D", "", name) for name in self.names]


class Place(NamedTuple):
    """A value in a line, and the column from which on what stands beneath it belongs to it."""

    text: str
    column: int


class SizesInLine(NamedTuple):
    """Values of one size in a line, in their order, under its name, with its unit."""

    name: str
    values: list[Place]

    def over(self, test: TestBeside) -> str | None:
        """Return the value over the columns of a test; None where not every test has one, and every value a test."""
        owners = [sum(value.column <= load for value in self.values) - 1 for load in test.loads]
        if sorted(owners) != list(range(len(self.values))):
            return None
        return self.values[owners[test.loads.index(test.load)]].text


def test_beside(table: Table, load: int, stress_type: str | None, *, is_shear: bool) -> TestBeside | None:
    """Return which of several tests in a table has a column of loads; None where the table holds one test."""
    tests = columns_side_by_side(table, stress_type, is_shear=is_shear)
    loads = [int(column) - 1 for test in tests for column in [*test.columns.values()][1:]]
    if load not in loads:
        return None
    names = [test.name for test in tests]
    return TestBeside(names[loads.index(load)], load, names, loads)


def numbered(name: str) -> tuple[str, str]:
    """Return the name of a size without the number of its measurement, and that number; others as they are.

    Examples
    --------
    >>> numbered("Width 2 (mm)"), numbered("Thickness #1"), numbered("thickness 3"), numbered("L0"), numbered("Step 2")
    (('Width (mm)', '2'), ('Thickness', '1'), ('thickness', '3'), ('L0', ''), ('Step 2', ''))
    """
    match = NUMBERED.fullmatch(name.strip()) if len(name) <= LONGEST_NAME else None
    if match and dimensions_named(plain(match["name"]), is_cylinder=True):
        return " ".join(filter(None, (match["name"].strip(), match["unit"]))), match["number"]
    return name, ""


def are_named(sizes: SizesInLine, table: Table) -> bool:
    """Tell whether another line above a table names what stands in the columns of values, as those of specimens."""
    columns = [value.column for value in sizes.values]
    for _, text in table.head:
        cells = split(text, table.separator)
        if set(table.names) & {*cells} - {""}:
            continue
        over = [cells[column] for column in columns if column < len(cells)]
        label = heading(cells[0]).quantity if cells else ""
        if is_of_specimens(label) and sum(map(bool, over)) > 1:
            return True
        words = [cell for cell in over if cell and number_and_unit(cell)[0] is None and not looks_like_unit(cell)]
        if len(words) > 1 and len(set(columns)) > 1:
            return True
    return False


def sizes_in_line(text: str, separator: str) -> list[SizesInLine]:
    """Return the sizes of which a line states more than one value, each in a cell."""
    if separator == WHITESPACE:
        return _after_words(text)
    label, of_label = "", -1
    values, labels = dict[str, list[tuple[str, int, int]]](), list[str]()
    cells = enumerate(split(text, separator))
    words = ((column, word.strip()) for column, cell in cells for word in re.split("[:=]", cell))
    for column, word in words:
        is_value = number_and_unit(word)[0] is not None
        if is_value and label:
            values.setdefault(label, []).append((word, column, of_label))
            of_label = column + 1
        elif word and not is_value and not looks_like_unit(word):
            label = word if dimensions_named(heading(word).quantity, is_cylinder=True) else ""
            of_label = column
            labels.append(label)
    several = {name: cells for name, cells in values.items() if len(cells) > 1}
    return [
        SizesInLine(name, [Place(cell, start if labels.count(name) > 1 else column) for cell, column, start in cells])
        for name, cells in several.items()
    ]


def _after_words(text: str) -> list[SizesInLine]:
    """Return the values at the end of a line without cells; where they belong is not told by their columns."""
    words = text.split()
    count = next((k for k, word in enumerate(reversed(words)) if not NUMBER.fullmatch(word)), len(words))
    name = " ".join(words[: len(words) - count]).rstrip(" :=")
    if count < 2 or not dimensions_named(heading(name).quantity, is_cylinder=True):
        return []
    return [SizesInLine(name, [Place(number, 0) for number in words[-count:]])]
