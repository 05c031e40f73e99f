"""Sizes of specimens that a file states: in lines above its table, in columns of it, and in tables of specimens."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod

from tissuq.experiments.numbers import NUMBER, PRODUCT, number_and_unit, number_in, sides_and_unit
from tissuq.experiments.reading.arrangement import names_above
from tissuq.experiments.reading.headings import Heading, dimensions_named, heading, is_of_specimens, plain
from tissuq.experiments.reading.layout import MISSING, WHITESPACE, split
from tissuq.experiments.reading.recognition import ColumnChoice
from tissuq.experiments.reading.side_by_side import TestBeside
from tissuq.experiments.reading.table import Table, padded
from tissuq.experiments.reading.vocabulary import CYCLE_NAMES, SET_NAMES
from tissuq.experiments.units import AREA, LENGTH, Quantity, looks_like_unit

UNIT_ASSUMED = "as of displacements)"
"""What follows the unit of a size that a table of specimens states without one."""
UNIT = r"(?:mm|cm|um|µm|мм|см|мкм|毫米|厘米)[2²]?"
UNITS = rf"(?P<unit>{UNIT})"
"""Of sizes, where they stand among other words."""
BETWEEN_STATEMENTS = re.compile(rf";|(?<!age length)(?<!auge length),\s+(?=[^\W\d])(?!{UNIT}\s*[:=])")
"""As in ``Width 5 mm; thickness 2 mm``, but not in ``Width, mm: 5`` and ``Gage length, standard travel``."""
ASSIGNMENT = r"[:=\t]"
BETWEEN_WORDS = re.compile(
    rf"{ASSIGNMENT}|\s{{2,}}|(?<=\w)(?<! x)\s+(?={NUMBER.pattern}\s*[\[(]?{UNIT}|{PRODUCT.pattern}\s*(?:{UNIT}|$))"
)
"""What stands between the name of a size and its value, as in ``Width : 5 mm`` and ``Width 5 mm``."""
DEVIATION = re.compile(rf"\s*(?:±|\+/?-)\s*{NUMBER.pattern}")
"""As in ``Width (mm): 5.0 ± 0.2``."""
UNCLEAR = (
    re.compile(rf"(?<![\w.,×*])(?<![x×*] )(?P<number>{NUMBER.pattern})\s*[\[(]?{UNITS}(?![\w/²^]|\s*[x×*]\s*\d)"),
    re.compile(rf"[\[(]{UNITS}[\])]\W*(?P<number>{NUMBER.pattern})"),
)
"""Numbers with a unit of a size among other words, but for products such as ``5 x 2 mm``."""
CROSS_OF_NAMES = re.compile(r"\s+[x*]\s+|\s*×\s*")
NAMES_OF_SIDES = {"l": "length", "b": "width", "w": "width", "h": "thickness", "t": "thickness"}
"""Symbols of the sides of a specimen in a product, as in ``b x h: 5 x 2 mm``."""
LONGEST_QUOTE = 60
"""Characters of a line that a message shows."""

NUMBERED = re.compile(
    r"(?P<name>[^\d]*[^\W\d]{2}[^\d]*?)[\s_]*(?:(?:[#№]|\bn[or]\.?)\s*)?(?P<number>[1-9])\s*(?P<unit>[\[(][^\])]*[\])])?"
)
"""As in ``Width 2 (mm)`` and ``Thickness #1``; two letters at least, so not ``L0``."""
LONGEST_NAME = 80
"""Characters of the name of a size."""
SizesInLine = Sequence[tuple[str, int]]
"""Values of one size in a line, each with the column from which on what stands beneath it belongs to it."""


@dataclass(frozen=True)
class StatedSize:
    """A length or an area in a file.

    Parameters
    ----------
    name : str
        What the file calls it, as `heading` writes it; empty where that is unclear.
    kind : Quantity
    value : float
        In mm or mm².
    source : str
        Words that tell where it stands.
    text : str
        What stands there.
    measurement : str
        Which of several measurements of it this is, by its number; empty where it is the only one.
    """

    name: str
    kind: Quantity
    value: float
    source: str
    text: str
    measurement: str = ""

    def is_of(self, dimension: str, *, is_cylinder: bool) -> bool:
        """Tell whether it is a dimension of the specimen; a height is the length of a cylinder."""
        is_kind = (self.kind is AREA) == (dimension == "area")
        return is_kind and dimension in dimensions_named(self.name, is_cylinder=is_cylinder)


def stated_sizes(table: Table, specimens: Collection[str], test: TestBeside | None = None) -> list[StatedSize]:
    """Return the lengths and areas that a file states of the specimen in a table, which it calls by some names.

    Of several tests side by side in it they are those over the columns of one, or that have its number.
    """
    if test is None and not table.number:
        specimens = {*specimens, *_only_specimen(table)}
    sizes = [*_in_lines(table, test), *_in_columns(table), *_of_specimens(table, "", table.head, specimens)]
    for sheet, lines in table.other_lines.items():
        sizes += _of_specimens(table, sheet, lines, specimens)
    if test is None:
        return sizes
    return [size for size in (_of_test(size, sizes, test) for size in sizes) if size]


def _of_test(size: StatedSize, sizes: Sequence[StatedSize], test: TestBeside) -> StatedSize | None:
    """Return a size that may be that of one of several tests, by its number or name; None where it is that of another.

    As many as there are tests are no measurements of one specimen, whatever their numbers.
    """
    if not dimensions_named(size.name, is_cylinder=True):
        for name in test.names:
            name_of_size = plain(re.sub(rf"(?<!\w){re.escape(plain(name))}(?!\w)", " ", size.name))
            if name_of_size != size.name and dimensions_named(name_of_size, is_cylinder=True):
                return replace(size, name=name_of_size) if name == test.name else None
    numbers = {same.measurement for same in sizes if (same.name, same.kind) == (size.name, size.kind)}
    if not size.measurement or len(numbers) < len(test.loads):
        return size
    if numbers == set(test.numbers) and size.measurement != test.number:
        return None
    return replace(size, measurement="")


def names_of_specimen(
    table: Table, choices: Sequence[ColumnChoice], only: Mapping[str, str | int] | None
) -> frozenset[str]:
    """Return what a file calls the specimen in a table: its sheet, title, name above the columns, and cells."""
    columns = [k for k, quantity in enumerate(table.quantities) if is_of_specimens(quantity)]
    cells = [set(table.texts(column)) - {""} for column in columns]
    wanted = [str(value) for name, value in (only or {}).items() if plain(name) not in CYCLE_NAMES | SET_NAMES]
    names = [table.sheet, table.title, *wanted, *(cell for values in cells if len(values) == 1 for cell in values)]
    loads = [k for k, name in enumerate(table.names) if name == table.names[choices[0].stress]]
    if len(loads) > 1 and (names_over := names_above(table, loads)):
        names.append(names_over[loads.index(choices[0].stress)])
    words = [plain(name).partition(" ") for name in names]
    names += [number for specimen, _, number in words if is_of_specimens(specimen)]  # of 'Specimen A1' also 'A1'
    return frozenset(filter(None, map(plain, names)))


def _in_lines(table: Table, test: TestBeside | None) -> Iterator[StatedSize]:
    """Yield what lines above the table state: ``Width : 5 mm``, ``"Probendicke";1,55;"mm"``, or less clear ones."""
    is_of_one = not table.number and not any(map(is_of_specimens, table.quantities))
    for position, (line, text) in enumerate(table.head):
        text, source = text.lstrip("# "), f"in line {line}"
        beneath = (split(later.lstrip("# "), table.separator) for _, later in table.head[position + 1 : position + 3])
        if any(_are_names_of(row, split(text, table.separator)) for row in beneath):
            continue
        if several := _sizes_in_line(text, table.separator):
            for name, values in several.items():
                are_measured_again = is_of_one and not test and not _are_named(values, table)
                yield from _of_several(name, values, test, source, are_measured_again=are_measured_again)
            continue
        clear = [
            size
            for (name, measurement), (number, _), (unit, _) in _statements(text, table.separator)
            for size in _of_words(name, number, unit, source, measurement if is_of_one or test else "")
        ]
        yield from clear if clear else _among_words(text, source)


def sizes_without_unit(table: Table) -> tuple[str, ...]:
    """Return what lines above the table state of sizes by name and number alone, and where."""
    return tuple(
        f"in line {line} '{name}: {number}'"
        for line, text in table.head
        for (name, _), (number, _), (unit, _) in _statements(text.lstrip("# "), table.separator)
        if dimensions_named(heading(name).quantity, is_cylinder=True)
        and NUMBER.fullmatch(number)
        and not _of_words(name, number, unit, "", "")
    )


def _statements(text: str, separator: str) -> Iterator[tuple[tuple[str, str], ...]]:
    """Yield consecutive words of a line, three at a time: the name of a size, its number, and its unit may be these."""
    cells = [text] if separator == WHITESPACE else split(text, separator)
    statements = [statement for cell in cells for statement in BETWEEN_STATEMENTS.split(cell)]
    words = list(_words(statements))
    yield from zip(words, words[1:], [*words[2:], ("", "")], strict=False)


def _words(statements: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield names and values in statements; names of sizes without the number of their measurement, and that number."""
    words = [word_or_value.strip(' "') for statement in statements for word_or_value in re.split(ASSIGNMENT, statement)]
    words = [word_or_value for word_or_value in words if word_or_value]
    for word_or_value, next_word in zip(words, [*words[1:], ""], strict=True):
        name, measurement = numbered(word_or_value)
        if measurement and NUMBER.match(next_word):
            yield name, measurement
        else:
            yield from ((word.strip(' "'), "") for word in BETWEEN_WORDS.split(word_or_value) if word.strip(' "'))


def _of_several(
    name: str, values: SizesInLine, test: TestBeside | None, source: str, *, are_measured_again: bool
) -> Iterator[StatedSize]:
    """Yield the value of a test of several that a line states, or all: of one specimen they are its measurements."""
    if test and (text := _over(values, test)) is not None:
        yield from sizes_of_text(heading(name), text, f"{source}, over its columns", f"{name}: {text}")
        return
    for number, (text, _) in enumerate(values, 1):
        yield from sizes_of_text(
            heading(name), text, source, f"{name}: {text}", str(number) if are_measured_again else ""
        )


def _of_words(name: str, number: str, unit: str, source: str, measurement: str) -> list[StatedSize]:
    """Return the sizes that a name, and what follows it, state; the unit is with one of them, or beside the number."""
    for text in (f"{number} {unit}", number, f"{unit} {number}"):
        value = DEVIATION.sub("", text)
        if sizes := sizes_of_text(heading(name), value, source, f"{name}: {text.strip()}", measurement):
            return sizes
    return []


def _among_words(text: str, source: str) -> Iterator[StatedSize]:
    """Yield a length or an area among other words, which is a size without a name."""
    for match in filter(None, (pattern.search(text) for pattern in UNCLEAR)):
        shown = " ".join(text.split())[:LONGEST_QUOTE]
        if sizes := sizes_of_text(Heading("", match["unit"]), match["number"], source, shown):
            yield from sizes
            return


def _in_columns(table: Table) -> Iterator[StatedSize]:
    """Yield the sizes in columns of them that hold one number all along."""
    for column, name in enumerate(table.names):
        quantity, measurement = numbered(table.quantities[column])
        if not dimensions_named(quantity, is_cylinder=True):
            continue
        cells = {cell for cell in table.texts(column) if cell.lower() not in MISSING}
        if not all(map(NUMBER.fullmatch, cells)) or len(set(map(number_in, cells))) != 1:
            continue
        value, source = next(iter(cells)), f"in column {table.label(column)}"
        for unit in table.stated_units(column):
            yield from sizes_of_text(Heading(quantity, unit), value, source, f"{name}: {value}", measurement)


def _is_size(name: Heading) -> bool:
    """Tell whether a heading is of a size of specimens, or of one of its measurements."""
    return bool(dimensions_named(numbered(name.quantity)[0]))


def _are_names_of(row: list[str], cells: Sequence[str]) -> bool:
    """Tell whether cells name sizes, each over a number in a row beneath them: ``Width 1 (mm)`` states none there."""
    sizes = [column for column, cell in enumerate(cells) if _is_size(heading(cell))]
    return bool(sizes) and all(map(NUMBER.fullmatch, padded(row, len(cells))[sizes[0] : sizes[-1] + 1]))


def _only_specimen(table: Table) -> set[str]:
    """Return the name of the specimen in a table of one row above the measurements; nothing where there are more."""
    is_beneath, names = False, set[str]()
    for _, text in table.head:
        cells = split(text.lstrip("# "), table.separator)
        if any(map(NUMBER.fullmatch, cells)):
            names |= {plain(cells[0])} if is_beneath else set()
        elif any(map(_is_size, map(heading, cells[1:]))):
            is_beneath = True
    return names if len(names) == 1 else set()


def _of_specimens(
    table: Table, sheet: str, lines: Sequence[tuple[int, str]], specimens: Collection[str]
) -> Iterator[StatedSize]:
    """Yield the sizes in a row that begins with the name of the specimen, beneath a row of names of sizes.

    A row of units may stand between them; without units they are in that of the lengths in the table, where it has one.
    """
    in_table = {unit for k in range(len(table.names)) for unit in table.stated_units(k) if LENGTH.factor_or_none(unit)}
    names = dict[int, Heading]()
    for line, text in lines:
        cells = split(text.lstrip("# "), table.separator)
        if not any(map(NUMBER.fullmatch, cells)):
            headings = {k: name for k, name in enumerate(map(heading, cells)) if _is_size(name)}
            units = {k: cells[k].strip("[]()") for k in names if k < len(cells)}
            if not headings and any(kind.factor_or_none(unit) for unit in units.values() for kind in (LENGTH, AREA)):
                names = {k: Heading(name.quantity, units.get(k) or name.unit) for k, name in names.items()}
            else:
                names = headings
        elif plain(cells[0]) in specimens:
            stated_in = f"in sheet '{sheet}', line {line}" if sheet else f"in line {line}"
            for column in [column for column in names if column < len(cells)]:
                name, source = names[column], stated_in
                if not name.unit and len(in_table) == 1:
                    name = Heading(name.quantity, *in_table)
                    source = f"{stated_in} ({name.unit} {UNIT_ASSUMED}"
                quantity, measurement = numbered(name.quantity)
                shown = f"{name.quantity}: {cells[column]}"
                yield from sizes_of_text(Heading(quantity, name.unit), cells[column], source, shown, measurement)


def sizes_of_text(name: Heading, text: str, source: str, shown: str, measurement: str = "") -> list[StatedSize]:
    """Return the length or the area that a text states, in the unit there or beside the name; nothing for others.

    Of a product such as ``5 x 2 mm`` they are the sizes that the name has for its factors, or else the area of two.
    """
    values = list[tuple[str, Quantity, float]]()
    sides, unit = sides_and_unit(text)
    if sides and min(sides) > 0 and (factor := LENGTH.factor_or_none(unit or name.unit)):
        names = [NAMES_OF_SIDES.get(side, side) for side in re.split(CROSS_OF_NAMES, name.quantity)]
        if len(names) == len(sides):
            values = [(side, LENGTH, number * factor) for side, number in zip(names, sides, strict=True)]
        elif len(sides) == 2:
            values = [(name.quantity, AREA, prod(sides) * factor**2)]
    else:
        number, unit = number_and_unit(text)
        factors = [(kind, kind.factor_or_none(unit or name.unit)) for kind in (LENGTH, AREA)]
        values = [(name.quantity, kind, (number or 0.0) * factor) for kind, factor in factors if factor]
    return [StatedSize(*value, source, shown, measurement) for value in values if value[2] > 0]


def _over(values: SizesInLine, test: TestBeside) -> str | None:
    """Return the value over the columns of a test; None where not every test has one, and every value a test."""
    owners = [sum(column <= load for _, column in values) - 1 for load in test.loads]
    if sorted(owners) != list(range(len(values))):
        return None
    return values[owners[test.loads.index(test.load)]][0]


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


def _are_named(values: SizesInLine, table: Table) -> bool:
    """Tell whether another line above a table names what stands in the columns of values, as those of specimens."""
    columns = [column for _, column in values]
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


def _sizes_in_line(text: str, separator: str) -> dict[str, SizesInLine]:
    """Return the sizes of which a line states more than one value, each in a cell, by their names.

    Where those at the end of a line without cells belong is not told by their columns.
    """
    if separator == WHITESPACE:
        words = text.split()
        count = next((k for k, word in enumerate(reversed(words)) if not NUMBER.fullmatch(word)), len(words))
        name = " ".join(words[: len(words) - count]).rstrip(" :=")
        is_size = bool(dimensions_named(heading(name).quantity, is_cylinder=True))
        return {name: [(number, 0) for number in words[-count:]]} if count > 1 and is_size else {}
    label, of_label = "", -1
    values, labels = dict[str, list[tuple[str, int, int]]](), list[str]()
    cells = enumerate(split(text, separator))
    for column, word in ((column, word.strip()) for column, cell in cells for word in re.split("[:=]", cell)):
        is_value = number_and_unit(word)[0] is not None
        if is_value and label:
            values.setdefault(label, []).append((word, column, of_label))
            of_label = column + 1
        elif word and not is_value and not looks_like_unit(word):
            label = word if dimensions_named(heading(word).quantity, is_cylinder=True) else ""
            of_label = column
            labels.append(label)
    return {
        name: [(cell, start if labels.count(name) > 1 else column) for cell, column, start in cells]
        for name, cells in values.items()
        if len(cells) > 1
    }
