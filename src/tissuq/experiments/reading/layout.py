"""How a text file lays out its table: separator, first row of data, names and units above it."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from tissuq.experiments.numbers import GROUPED, MEAN_WITH_SPREAD, NUMBER
from tissuq.experiments.reading.headings import is_of_role
from tissuq.experiments.units import looks_like_unit

WHITESPACE = " "
SEPARATORS = ("\t", ";", ",", "|", WHITESPACE)
SPREADSHEET_ERRORS = frozenset(
    ["#n/a", "#nv", "#ref!", "#bezug!", "#div/0!", "#value!", "#wert!", "#num!", "#zahl!", "#name?", "#null!", "#calc!",
     "#spill!", "#field!", "#getting_data"]
)  # fmt: skip
"""What Excel and its like write where a formula fails, in English and in German."""
MISSING = SPREADSHEET_ERRORS | frozenset(
    ["", "-", "--", "---", "n/a", "na", "nan", "null", "none", "inf", "+inf", "-inf"]
)
LINES_FOR_SEPARATOR = 500
"""Lines at the head of a file that show its separator."""
SHORT_TABLE, LENGTH_RATIO = 3, 10
"""Rows that a table passed over has at most, and how many times more the one beneath it has at least."""
FEWEST_ROWS = 5
"""Rows that a further table has at least."""
KNOWN_UNITS = 2
"""Units that show that what stands beside them is one as well."""
WORD = re.compile(r"[^\W\d_]{2}|%")
"""What a line of names or units holds, and a row of numbers does not."""
UNIT_IN_CELL = re.compile(rf"((?:^|[\t;,|])\s*{NUMBER.pattern})\s*([^\W\d_][^\s;,|]*)(?=\s*(?:$|[\t;,|]))")
"""As in ``1.2 kPa``."""

Split = Callable[[str], list[str]]


@dataclass(frozen=True)
class Layout:
    """Where the table is in a list of lines; all positions count from 0.

    Parameters
    ----------
    separator : str
        What stands between two cells; a space means any run of whitespace.
    first_row : int
        Position of the first row of data.
    width : int
        Number of cells in the first row of data without fault.
    names : int or None
        Position of the row of column names.
    units : int or None
        Position of the row of units beneath the names.
    """

    separator: str
    first_row: int
    width: int
    names: int | None
    units: int | None


def find_layout(lines: Sequence[str], separator: str | None = None) -> Layout | None:
    """Return the layout of the first table in lines without blanks and comments; None if there is none.

    A table of a few rows, such as a machine's table of results, is passed over for a far longer one beneath it with
    other names. Where there is none, numbers may have their units in the cells beneath names of deformations and loads.
    """
    if (layout := _layout_of(lines, separator)) is not None:
        return layout
    plain = [UNIT_IN_CELL.sub(lambda cell: cell[1] if looks_like_unit(cell[2]) else cell[0], line) for line in lines]
    layout = None if plain == list(lines) else _layout_of(plain, separator)
    if layout is None or layout.names is None:
        return None
    names = column_names(lines[layout.names], layout.width, layout.separator)
    return layout if any(map(is_of_role, names)) else None


def _layout_of(lines: Sequence[str], separator: str | None) -> Layout | None:
    """Return the layout of the first table of plain numbers."""
    separator = separator or likely_separator(lines[:LINES_FOR_SEPARATOR])
    cells = partial(split, separator=separator)
    confirmed = _main_row(lines, cells)
    if confirmed is None:
        return None
    first_row = _with_faulty_rows_above(lines, cells, confirmed)
    units_row = first_row - 1
    if _are_remarks(lines, cells, units_row, len(cells(lines[confirmed]))):
        units_row -= 1
    has_units = units_row > 0 and is_units_row(cells(lines[units_row]), cells(lines[units_row - 1]))
    has_units = has_units and _are_names(_without_number(cells(lines[units_row - 1])))
    names_row = units_row - has_units
    width = len(cells(lines[confirmed]))
    has_names = names_row >= 0 and bool(column_names(lines[names_row], width, separator, has_units=has_units))
    return Layout(separator, first_row, width, names_row if has_names else None, units_row if has_units else None)


def _are_remarks(lines: Sequence[str], cells: Split, row: int, width: int) -> bool:
    """Tell whether words above the data say more of columns that have names and units above them, as of Origin."""
    if row < 2:
        return False
    names, units, words = (cells(line) for line in lines[row - 2 : row + 1])
    is_units = is_units_row(units, names) and not is_units_row(words, units)
    return is_units and len(names) == width and _are_names(names) and not any(map(looks_like_unit, filter(None, words)))


def later_tables(lines: Sequence[tuple[int, str]], layout: Layout) -> list[int]:
    """Return the positions in numbered lines at which what belongs to each further table begins.

    Its names are those of the first table again, or stand apart from the rows above, or over a row of units.
    """
    texts = [text for _, text in lines]
    cells = partial(split, separator=layout.separator)
    header = None if layout.names is None else texts[layout.names].strip()
    numeric = [column for column, cell in enumerate(cells(texts[layout.first_row])) if NUMBER.fullmatch(cell)]
    starts, last_row = list[int](), layout.first_row
    for position in range(layout.first_row + 1, len(texts)):
        text = texts[position]
        row = cells(text) if WORD.search(text) else []
        is_row = all(column < len(row) and _are_values([row[column]]) for column in numeric) if row else True
        if position <= last_row or is_row:
            last_row = max(last_row, position)
            continue
        has_units = position + 1 < len(texts) and is_units_row(cells(texts[position + 1]), row)
        is_apart = lines[position][0] > lines[position - 1][0] + 1 or last_row < position - 1
        is_header = text.strip() == header
        if is_header or ((is_apart or has_units) and _are_names(row)):
            first_row, fewest = position + 1 + has_units, 1 if is_header else FEWEST_ROWS
            if _length(texts, cells, first_row, limit=fewest) == fewest:
                starts.append(last_row + 1)
                last_row = first_row
    return starts


def is_comment(line: str) -> bool:
    """Tell whether a line is a comment: it begins with two slashes, or a hash that is not of a spreadsheet's error."""
    text = line.lstrip(' \t"')
    if text.startswith("//"):
        return True
    return line.lstrip().startswith("#") and re.split(r'[\s;,"]', text)[0].lower() not in SPREADSHEET_ERRORS


def split(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without quotation marks and surrounding blanks."""
    if '"' not in line:
        return line.split() if separator == WHITESPACE else [cell.strip() for cell in line.split(separator)]
    if separator == WHITESPACE:
        return [cell.strip('"') for cell in re.findall(r'"[^"]*"|\S+', line)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]


def joined(cells: Sequence[str], separator: str) -> str:
    """Return the line that has these cells, so that `split` gives them back."""
    return separator.join(f'"{cell}"' if separator in cell else cell for cell in cells)


def column_names(line: str, width: int, separator: str, *, has_units: bool = False) -> list[str]:
    """Return the column names in a line above ``width`` columns of data; none when it holds no names.

    Above a row of units the first may be the number of a table.

    Columns separated by blanks may have blanks in their names when two or more stand between names.
    """
    names = split(line, separator)
    if separator == WHITESPACE and len(names) != width:
        names = re.split(r"\s{2,}|\t", line.strip())
        if len(names) != width:
            return []
    while names and not names[-1]:
        names.pop()
    if len(names) > width:
        names = _with_units_joined(names)
    return names if _are_names(_without_number(names) if has_units else names) else []


def _without_number(names: Sequence[str]) -> Sequence[str]:
    """Return names without a number that stands before them."""
    return names[1:] if names and NUMBER.fullmatch(names[0]) else names


def _with_units_joined(names: Sequence[str]) -> list[str]:
    """Return names of which some were split from their units by the separator, as in ``Stress, kPa``."""
    joined: list[str] = []
    for name in names:
        if joined and name and looks_like_unit(name):
            joined[-1] = f"{joined[-1]}, {name}"
        else:
            joined.append(name)
    return joined


def likely_separator(lines: Sequence[str]) -> str:
    """Return the separator between which most cells are numbers; in lines of names with tabs, blanks part words."""

    def share_of_numbers(line: str, separator: str) -> float:
        if separator == WHITESPACE and "\t" in line and WORD.search(line):
            separator = "\t"
        cells = [cell for cell in split(line, separator) if cell]
        numbers = _count_numbers(cells)
        return numbers / len(cells) if numbers >= 2 else 0.0

    return max(SEPARATORS, key=lambda separator: sum(share_of_numbers(line, separator) for line in lines))


def _main_row(lines: Sequence[str], cells: Split) -> int | None:
    """Find the first row of the first table that is not far shorter than a named one after it."""
    row = _first_numeric_row(lines, cells)
    if row is None:
        return None
    length = _length(lines, cells, row, limit=SHORT_TABLE + 1)
    if length > SHORT_TABLE:
        return row
    later = _first_numeric_row(lines, cells, row + length)
    headings = [] if later is None else lines[max(later - 2, row + length) : later]
    if later is None or not any(_are_names(cells(line)) and line not in lines[:row] for line in headings):
        return row
    long = LENGTH_RATIO * length
    return later if _length(lines, cells, later, limit=long) == long else row


def _length(lines: Sequence[str], cells: Split, row: int, limit: int) -> int:
    """Count the rows of data from one on, up to a limit."""
    rows = lines[row : row + limit]
    return next((count for count, line in enumerate(rows) if not _is_data(cells(line))), len(rows))


def _first_numeric_row(lines: Sequence[str], cells: Split, start: int = 0) -> int | None:
    """Find a row of numbers alone, or of two numbers before more data: metadata may hold numbers too."""
    for position, line in enumerate(lines[start:], start):
        row = cells(line)
        next_row = cells(lines[position + 1]) if position + 1 < len(lines) else []
        if _count_numbers(row) >= 2 and (_are_values(row) or _is_data(next_row)):
            return position
    return None


def _with_faulty_rows_above(lines: Sequence[str], cells: Split, row: int) -> int:
    """Take in rows above that hold a number or a mark for none: faulty data to report, not names."""
    width = len(cells(lines[row]))
    while row > 0:
        previous = cells(lines[row - 1])
        is_row = _are_values(previous) or (_is_data(previous) and len(previous) == width)
        is_beneath_names = row > 1 and _are_names(cells(lines[row - 2]))
        if not is_row or (is_beneath_names and is_units_row(previous, cells(lines[row - 2]))):
            break
        row -= 1
    return row


def _is_number(cell: str) -> bool:
    """Tell whether a cell is a number, with thousands separators, the sign of a percentage or a spread or without."""
    text = cell.removesuffix("%").rstrip()
    return any(number.fullmatch(text) for number in (NUMBER, *GROUPED.values(), MEAN_WITH_SPREAD))


def _count_numbers(cells: Sequence[str]) -> int:
    return sum(map(_is_number, cells))


def _are_values(cells: Sequence[str]) -> bool:
    return all(cell.lower() in MISSING or _is_number(cell) for cell in cells)


def _is_data(cells: Sequence[str]) -> bool:
    return _count_numbers(cells) > 0 or _are_values(cells)


def _are_names(cells: Sequence[str]) -> bool:
    words = [cell for cell in cells if cell.lower() not in MISSING and any(map(str.isalpha, cell))]
    return len(cells) >= 2 and len(words) >= 1 and _count_numbers(cells) == 0


def is_units_row(cells: Sequence[str], names: Sequence[str] = ()) -> bool:
    """Tell whether cells are units, at least one of them not empty; of which beneath names some may be unknown.

    Then two or more of them are known, none is a number, and a name stands over each.
    """
    count = sum(looks_like_unit(cell) and re.search(r"[^\W\d_]|%", cell) is not None for cell in cells)
    if all(map(looks_like_unit, cells)):
        return count > 0
    has_names = len(names) >= len(cells) and all(name for name, cell in zip(names, cells, strict=False) if cell)
    return count >= KNOWN_UNITS and has_names and not _count_numbers(cells)
