"""Columns of several tests beside one another in a table: which of them belong to one test, and what it is called."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.arrangement import names_above
from tissuq.experiments.reading.headings import (
    AXES,
    is_of_mean,
    is_of_specimens,
    measure_in,
    of_spread,
    on_lettered_axis,
    plain,
    without_mean,
)
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import LENGTHENINGS, LOADS
from tissuq.experiments.reading.stated_mode import is_named_by_mode
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import ROLES, other_quantity
from tissuq.experiments.units import measured_in

PART_OF_MACHINE = re.compile(r"\b(cell|sensor|channel|kanal|aufnehmer|transducer|\d+ ?k?n)\b")
"""Words and capacities that tell one load cell from another, and not tests."""
BETWEEN_WORDS = re.compile(r"\s+|(?<=\w)\.(?=[^\W\d]{2})")
"""Blanks, or the points of R, as in ``S1.strain``."""
SEVERAL_COLUMNS = re.compile(r"(\d+)\s*:\s*(\d+)")
"""Numbers of the first and the last one, as in ``2:5``."""
OF_WAY = re.compile(rf"\(({'|'.join(map(re.escape, sorted(ROLES['displacement'])))})\)")
"""Over which displacement a strain was measured, as in ``Compressive strain (Extension) 1``."""
CLOCK = re.compile(r"(time|zeit|temps|tiempo|tempo|czas|время|时间|時間|시간) ?(?P<test>[^\W_]+)")
"""Name of the time of one test among several."""
TENSOR = frozenset(["11", "22", "33", "12", "13", "23", "21", "31", "32"])
"""Components, which are not numbers of tests."""
LETTERS_OF_STRESS = "spt "
"""What may stand before the numbers of axes and components in names of stresses."""


class ColumnsOfTest(NamedTuple):
    """The columns of one of several tests beside one another, by their roles and numbers from 1."""

    name: str
    columns: Mapping[str, str | int]


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


class _Role(NamedTuple):
    """What a column's name says that it holds, and of which test."""

    role: str
    test: str


def columns_side_by_side(table: Table, mode: LoadingMode, options: ReadingOptions) -> list[ColumnsOfTest]:
    """Return the columns of every test where a table has several beside one another; nothing where it has one.

    They are a stress or force for each test, and a deformation for each or one for all. Their names are the same, or
    differ in the number, letter or name of a specimen; the names of the tests may stand in the line above. Columns of
    loads that are known by their units alone are of specimens, or means of groups, beside one deformation of all.
    Numbers 1 and 2 are those of axes, unless the time is numbered, too.
    """
    deformations = ("shear",) if mode.controls == (SHEAR,) else LENGTHENINGS
    roles = [_role(name, (*deformations, *LOADS), options.get("stress_type")) for name in table.quantities]
    measure, measures = _columns_of_first(deformations, roles)
    is_by_unit = len(measures) == 1 and not any(role.role in LOADS for role in roles)
    if is_by_unit:
        roles = [role if role.role else _told_by_unit(table, column) for column, role in enumerate(roles)]
    load, loads = _columns_of_first(LOADS, roles)
    labels = [roles[column].test for column in loads]
    numbers_of_tests = {label.lstrip(LETTERS_OF_STRESS) if is_by_unit else label for label in labels}
    clocks = {clock["test"] for clock in map(CLOCK.fullmatch, table.quantities) if clock}
    is_of_axes = numbers_of_tests <= AXES.keys() and not any(map(is_of_mean, table.quantities))
    is_of_axes = is_of_axes and not numbers_of_tests <= clocks  # both axes of a machine have one time
    if len(loads) < 2 or not measures or numbers_of_tests <= TENSOR or is_of_axes:
        return []
    are_of_modes = {is_named_by_mode(label) for label in labels}
    is_named = len(set(labels)) == len(labels) and all(labels) and len(are_of_modes) == 1
    if is_named and (by_label := {roles[column].test: column for column in measures}).keys() == set(labels):
        pairs = [(by_label[label], column) for label, column in zip(labels, loads, strict=True)]
    elif len(measures) == 1 and (is_named or (not any(labels) and names_above(table, loads))):
        pairs = [(measures[0], column) for column in loads]
    elif len(measures) == len(loads) and not any(labels):
        pairs = list(zip(measures, loads, strict=True))
    else:
        return []
    numbers = [str(number) for number in range(1, len(pairs) + 1)]
    names = labels if is_named else names_above(table, loads) or numbers
    return [
        ColumnsOfTest(name, {measure: deformation + 1, load: stress + 1})
        for name, (deformation, stress) in zip(names, pairs, strict=True)
    ]


def test_beside(table: Table, load: int, mode: LoadingMode, options: ReadingOptions) -> TestBeside | None:
    """Return which of several tests in a table has a column of loads; None where the table holds one test."""
    tests = columns_side_by_side(table, mode, options)
    loads = [int(column) - 1 for test in tests for column in [*test.columns.values()][1:]]
    if load not in loads:
        return None
    names = [test.name for test in tests]
    return TestBeside(names[loads.index(load)], load, names, loads)


def columns_named_again(table: Table, columns: Mapping[str, str | int]) -> list[ColumnsOfTest]:
    """Return the columns of every test where what is given means several columns; nothing elsewhere.

    WebPlotDigitizer names all of a picture's curves X and Y, beneath the name of each; ``2:5`` are the columns from the
    second to the fifth. A column that stands there once is of all tests.
    """
    by_role = {role: _columns_meant(table, wanted) for role, wanted in columns.items()}
    counts = {len(numbers) for numbers in by_role.values()} - {1}
    loads = [number - 1 for role in LOADS for number in by_role.get(role, [])]
    if len(counts) != 1 or 0 in counts or len(loads) not in counts:
        return []
    headings, groups = [table.names[load] for load in loads], names_above(table, loads, are_distinct=False)
    in_groups = [" ".join(words) for words in zip(groups, headings, strict=False)]
    numbers_of_tests = [str(number) for number in range(1, len(loads) + 1)]
    options = (names_above(table, loads), headings if all(headings) else [], in_groups)
    names = next((names for names in options if names and len(set(names)) == len(names)), numbers_of_tests)
    return [
        ColumnsOfTest(name, {role: numbers[k % len(numbers)] for role, numbers in by_role.items()})
        for k, name in enumerate(names)
    ]


def _columns_meant(table: Table, wanted: str | int) -> list[int]:
    """Return the columns, from 1, that a name or numbers mean."""
    text = str(wanted).strip()
    if named := [number for number, name in enumerate(table.names, 1) if name == text]:
        return named
    several = SEVERAL_COLUMNS.fullmatch(text)
    first, last = map(int, several.groups() if several else (text, text)) if several or text.isdecimal() else (1, 0)
    if last > len(table.names) or (several and not 1 <= first < last):
        raise InputError(f"{table.file} has no columns {text}: it has {len(table.names)} columns, counted from 1.")
    return list(range(first, last + 1))


def _columns_of_first(candidates: Sequence[str], roles: Sequence[_Role]) -> tuple[str, list[int]]:
    """Return the first of some roles that columns have, and these."""
    for candidate in candidates:
        if columns := [column for column, of_column in enumerate(roles) if of_column.role == candidate]:
            return candidate, columns
    return "", []


def _role(quantity: str, roles: Sequence[str], stress_type: str | None) -> _Role:
    """Return which of some roles a column has by its name, and the test that the name tells."""
    if on_lettered_axis(quantity)[0]:
        return _Role("", "")
    for words, test in _parts(plain(OF_WAY.sub(" ", quantity))):
        quantity_alone, measure = measure_in(words)
        for role in roles:
            wanted = stress_type if role == "stress" else None
            if quantity_alone in ROLES[role] and measure in ("", wanted or "engineering"):
                return _Role(role, test)
    return _Role("", "")


def _told_by_unit(table: Table, column: int) -> _Role:
    """Return the load that a column has by its unit, and the test or the group that its whole name tells."""
    quantity = table.quantities[column]
    load, test = measured_in(table.unit(column)), without_mean(quantity)
    is_of_test = bool(test) and (_is_test(quantity) or is_of_mean(quantity)) and not of_spread(quantity)[0]
    is_of_test = is_of_test and not other_quantity(quantity, table.unit(column))
    return _Role(load, test) if load in LOADS and is_of_test else _Role("", "")


def _parts(quantity: str) -> Iterator[tuple[str, str]]:
    """Yield the name of a quantity and the test that stands after or before it: first the whole, and no test."""
    yield quantity, ""
    words = [word.strip(".:,()#") for word in BETWEEN_WORDS.split(quantity)]
    for count in range(1, len(words)):
        head, tail = " ".join(words[:count]), " ".join(words[count:])
        for name, test in ((head, tail), (tail, head)):
            if _is_test(test):
                yield name, test


def _is_test(text: str) -> bool:
    """Tell whether a part of a name is the number, the letter or the name of a specimen, or its loading mode."""
    words = text.split()
    return (
        bool(words)
        and not PART_OF_MACHINE.search(text)
        and (len(words[-1]) == 1 or any(map(str.isdigit, text)) or is_of_specimens(words[0]) or is_named_by_mode(text))
    )
