"""How tables stand in a file: upright or on their side, beneath one another, and what the lines above them say."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.numbers import NUMBER, number_and_unit, number_in
from tissuq.experiments.reading.headings import (
    dimensions_named,
    heading,
    is_of_mean,
    is_of_role,
    is_of_specimens,
    of_spread,
    plain,
)
from tissuq.experiments.reading.layout import FEWEST_ROWS, MISSING, WHITESPACE, joined, likely_separator, split
from tissuq.experiments.reading.table import Lines, Table, filled_on, padded
from tissuq.experiments.units import looks_like_unit, measured_in

SAME, FAR = 0.1, 0.5
"""Share of the range of a column within which all blocks begin, and by which one of them goes back at a blank line."""
MOST_STEPS = 2
"""Largest steps of a column by which a table goes on from the one before at most."""
TIME = re.compile(r"\b(time|zeit|temps|tiempo|tempo|время)|(zeit|time)$|时间|時間|시간")
"""Names of a column of times."""
NAME_BY_NUMBER = re.compile(
    r"\W*(?:sig|column|col|spalte)\s*(?P<number>\d+)\s*[:=\t]\s*(?P<name>\S.*?)\s*", re.IGNORECASE
)
"""As in ``Sig3<tab>Strain (%)`` and ``# column 2: stress``."""
FEWEST_VALUES = 4
"""Of each column of a table that lies on its side."""
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
    are_different = len({name for name, _, _ in columns}) == len(columns)  # and not labels of rows, such as Stretch
    if not is_whole or not are_different or sum(is_of_role(name) for name, _, _ in columns) < 2:
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


def blocks_of(table: Table, filled: Collection[int]) -> list[Table]:
    """Return the tests in a table: one, unless it begins anew after a blank line in all columns that change.

    Parameters
    ----------
    table : Table
    filled : collection of int
        The lines of the file that are not blank.
    """
    gaps = [row for row, (line, later) in enumerate(pairwise(table.lines), start=1) if later > line + 1]
    gaps = [
        row for row in gaps if any(line not in filled for line in range(table.lines[row - 1] + 1, table.lines[row]))
    ]
    if not gaps:
        return [table]
    cells = table.cells()
    numbers = _numbers(cells)
    starts = [row for row in gaps if _begins_anew(numbers, row) and not _is_named(cells, row)]
    bounds = list(pairwise([0, *starts, len(table.rows)]))
    if not starts or any(stop - start < FEWEST_ROWS for start, stop in bounds):
        return [table]
    note = "tests are parted where the table begins anew after a blank line; --table chooses one."
    blocks = [table.taken(np.arange(start, stop)) for start, stop in bounds]
    return [block.noted(note) for block in blocks]


def _is_named(cells: Sequence[Sequence[str]], row: int) -> bool:
    """Tell whether words in a column name what begins at a row, and name something else above it."""
    rows = zip(*cells[row - 2 : row + 1], strict=True)
    return any(a == b != c and c and not NUMBER.fullmatch(c) for a, b, c in rows)


def _numbers(texts: Sequence[Sequence[str]]) -> FloatArray:
    """Return the numbers (rows, columns) in columns that change; nan for cells without one."""
    cells = np.array([[number_in(cell) for cell in row] for row in texts])
    has_numbers = np.isfinite(cells[0])
    cells = cells[:, has_numbers]
    return np.asarray(cells[:, np.nanmax(cells, axis=0) > np.nanmin(cells, axis=0)])


def _begins_anew(numbers: FloatArray, row: int) -> bool:
    """Tell whether a row begins like the first, and in a column far from the row before it."""
    span = np.nanmax(numbers, axis=0) - np.nanmin(numbers, axis=0)
    is_same = np.abs(numbers[row] - numbers[0]) <= SAME * span
    return bool(len(span) and is_same.all() and (np.abs(numbers[row] - numbers[row - 1]) >= FAR * span).any())


def joined_where_they_go_on(tables: Sequence[Table]) -> list[Table]:
    """Return tables, those that go on from the one before as one with it, such as the pages of a printed one."""
    runs: list[list[Table]] = []
    for table in tables:
        if runs and _goes_on(runs[-1][0].rows[0], runs[-1][-1], table):
            runs[-1].append(table)
        else:
            runs.append([table])
    return [run[0] if len(run) == 1 else _as_one(run) for run in runs]


def _as_one(tables: Sequence[Table]) -> Table:
    """Return tables beneath one another as one, with a note."""
    rows = [*chain.from_iterable(table.rows for table in tables)]
    lines = [*chain.from_iterable(table.lines for table in tables)]
    single_table = replace(tables[0], rows=rows, lines=lines)
    return single_table.noted(
        f"{len(tables)} tables in {single_table.span} go on from one another, and are read as one."
    )


def _goes_on(first_row: str, table: Table, later: Table) -> bool:
    """Tell whether a table has the names of the one before, and goes on from there: in time, or in every column.

    The one before may itself go on from others, of which the first row is given.
    """
    if (table.names, table.units) != (later.names, later.units):
        return False
    times = [column for column, quantity in enumerate(table.quantities) if TIME.search(quantity)]
    if not times:
        return not later.title and _goes_on_evenly(first_row, table, later)
    ends = replace(table, rows=[first_row, table.rows[-1]], lines=[table.lines[0], table.lines[-1]])
    return all(
        earlier[0] < earlier[-1] <= continued[0]
        for earlier, continued in zip(ends.numbers(times), later.taken(np.array([0])).numbers(times), strict=True)
    )


def _goes_on_evenly(first_row: str, table: Table, later: Table) -> bool:
    """Tell whether a table begins within a step of the rows of the one before, and not as the first row."""
    cells = [*replace(table, rows=[first_row]).cells(), *table.cells(), *later.cells()]
    numbers, seam = _numbers(cells), len(table.rows)
    if not numbers.size or not np.isfinite(numbers).all():
        return False
    steps = np.abs(np.diff(numbers[1:], axis=0))
    largest = np.delete(steps, seam - 1, axis=0).max(axis=0, initial=0)
    begins_alike = np.abs(numbers[seam + 1] - numbers[0]) <= SAME * np.ptp(numbers, axis=0)
    return bool((steps[seam - 1] <= MOST_STEPS * largest).all() and not begins_alike.all())


def names_said_otherwise(lines_above: Sequence[str], rows: Sequence[str], separator: str, width: int) -> list[str]:
    r"""Return the names of columns that do not stand over each of them; nothing where they are not said.

    R writes none over the numbers of rows, which it quotes, and thermal analysers write a line for each column.

    Examples
    --------
    >>> names_said_otherwise(['"strain" "stress"'], ['"1" 0 0', '"2" 0.1 5'], " ", 3)
    ['row', 'strain', 'stress']
    >>> names_said_otherwise(["Sig1\tStrain (%)", "Sig2\tStress (kPa)", "StartOfData"], ["0\t0", "1\t5"], "\t", 2)
    ['Strain (%)', 'Stress (kPa)']
    """
    header = split(lines_above[-1], separator) if lines_above else []
    are_numbered = [row.startswith(f'"{number}"') for number, row in enumerate(rows[:FEWEST_VALUES], 1)]
    if len(header) == width - 1 and all(are_numbered) and not any(map(NUMBER.fullmatch, header)):
        return ["row", *header]
    numbered = {int(match["number"]): match["name"] for match in map(NAME_BY_NUMBER.fullmatch, lines_above) if match}
    return [numbered[number] for number in range(1, width + 1)] if {*range(1, width + 1)} == numbered.keys() else []


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
    return (of_label if of_label.unit else name).with_unit(words)


def names_above(table: Table, columns: Sequence[int], *, are_distinct: bool = True) -> list[str]:
    """Return what the last line above the names of columns says over each of some; nothing where it says no names.

    What stands over the first of neighbouring columns goes for them all: of those asked for each has another, unless
    they may be of groups. A line of sizes says no names.
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
        count = len({plain(name) for name in over})
        if all(over) and (count == len(over) or (count > 1 and not are_distinct)):
            return over
    return []


def _states_size(cell: str) -> bool:
    """Tell whether a cell names a size, or holds one with its unit."""
    name, unit = re.split("[:=]", cell)[0], number_and_unit(cell)[1].removesuffix("2").removesuffix("²")
    is_length = measured_in(unit) == "length" and len(unit) > 1  # one letter may be of months or minutes
    return bool(dimensions_named(heading(name).quantity, is_cylinder=True)) or is_length
