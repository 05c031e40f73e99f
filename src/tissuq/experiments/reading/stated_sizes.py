"""Sizes of specimens that a file states: in lines above its table, in columns of it, and in tables of specimens."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod

from tissuq.experiments.numbers import NUMBER, PRODUCT, number_and_unit, number_in, sides_and_unit
from tissuq.experiments.reading.columns import ColumnChoice
from tissuq.experiments.reading.headings import Heading, dimensions_named, heading, is_of_specimens, plain
from tissuq.experiments.reading.layout import MISSING, WHITESPACE, split
from tissuq.experiments.reading.side_by_side import names_above
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import CYCLE_NAMES, SET_NAMES
from tissuq.experiments.units import AREA, LENGTH, Quantity

__all__ = ["UNIT_ASSUMED", "StatedSize", "names_of_specimen", "stated_sizes"]

UNIT_ASSUMED = "as of displacements)"
"""What follows the unit of a size that a table of specimens states without one."""
UNIT = r"(?:mm|cm|um|µm|мм|см|мкм|毫米|厘米)[2²]?"
UNITS = rf"(?P<unit>{UNIT})"
"""Of sizes, where they stand among other words."""
BETWEEN_STATEMENTS = re.compile(rf";|,\s+(?=[^\W\d])(?!{UNIT}\s*[:=])")
"""As in ``Width 5 mm; thickness 2 mm``, but not in ``Width, mm: 5``."""
BETWEEN_WORDS = re.compile(
    rf"[:=\t]|\s{{2,}}|(?<=\w)(?<! x)\s+(?={NUMBER.pattern}\s*[\[(]?{UNIT}|{PRODUCT.pattern}\s*(?:{UNIT}|$))"
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
    """

    name: str
    kind: Quantity
    value: float
    source: str
    text: str

    def is_of(self, dimension: str, *, is_cylinder: bool) -> bool:
        """Tell whether it is a dimension of the specimen; a height is the length of a cylinder."""
        is_kind = (self.kind is AREA) == (dimension == "area")
        return is_kind and dimension in dimensions_named(self.name, is_cylinder=is_cylinder)


def stated_sizes(table: Table, specimens: Collection[str]) -> list[StatedSize]:
    """Return the lengths and areas that a file states of the specimen in a table, which it calls by some names."""
    sizes = [*_in_lines(table), *_in_columns(table), *_of_specimens(table, "", table.head, specimens)]
    for sheet, lines in table.other_lines.items():
        sizes += _of_specimens(table, sheet, lines, specimens)
    return sizes


def names_of_specimen(
    table: Table, choices: Sequence[ColumnChoice], only: Mapping[str, str | int] | None
) -> frozenset[str]:
    """Return what a file calls the specimen in a table: its sheet, title, name above the columns, and cells."""
    columns = [k for k, name in enumerate(table.names) if is_of_specimens(heading(name).quantity)]
    cells = [set(table.texts(column)) - {""} for column in columns]
    asked = [str(value) for name, value in (only or {}).items() if plain(name) not in CYCLE_NAMES | SET_NAMES]
    names = [table.sheet, table.title, *asked, *(cell for values in cells if len(values) == 1 for cell in values)]
    loads = [k for k, name in enumerate(table.names) if name == table.names[choices[0].stress]]
    if len(loads) > 1 and (above := names_above(table, loads)):
        names.append(above[loads.index(choices[0].stress)])
    return frozenset(filter(None, map(plain, names)))


def _in_lines(table: Table) -> Iterator[StatedSize]:
    """Yield what lines above the table state: ``Width : 5 mm``, ``"Probendicke";1,55;"mm"``, or less clear ones."""
    for line, text in table.head:
        text = text.lstrip("# ")
        cells = [text] if table.separator == WHITESPACE else split(text, table.separator)
        statements = [statement for cell in cells for statement in BETWEEN_STATEMENTS.split(cell)]
        words = [word.strip(' "') for statement in statements for word in BETWEEN_WORDS.split(statement)]
        words = [word for word in words if word]
        pairs = list(zip(words, words[1:], [*words[2:], ""], strict=False))
        clear = [size for pair in pairs for size in _of_words(*pair, f"in line {line}")]
        yield from clear if clear else _among_words(text, f"in line {line}")


def _of_words(name: str, number: str, unit: str, source: str) -> list[StatedSize]:
    """Return the sizes that a name, and what follows it, state; the unit is with one of them, or comes next."""
    for text in (f"{number} {unit}", number):
        value = DEVIATION.sub("", text)
        if sizes := _sizes(heading(name), value, source, f"{name}: {text.strip()}"):
            return sizes
    return []


def _among_words(text: str, source: str) -> Iterator[StatedSize]:
    """Yield a length or an area among other words, which is a size without a name."""
    for match in filter(None, (pattern.search(text) for pattern in UNCLEAR)):
        shown = " ".join(text.split())[:LONGEST_QUOTE]
        if sizes := _sizes(Heading("", match["unit"]), match["number"], source, shown):
            yield from sizes
            return


def _in_columns(table: Table) -> Iterator[StatedSize]:
    """Yield the sizes in columns of them that hold one number all along."""
    for column, name in enumerate(table.names):
        if not dimensions_named(heading(name).quantity, is_cylinder=True):
            continue
        cells = {cell for cell in table.texts(column) if cell.lower() not in MISSING}
        if not all(map(NUMBER.fullmatch, cells)) or len(set(map(number_in, cells))) != 1:
            continue
        value, source = next(iter(cells)), f"in column {table.label(column)}"
        named = (Heading(heading(name).quantity, unit) for unit in table.stated_units(column))
        for of_unit in named:
            yield from _sizes(of_unit, value, source, f"{name}: {value}")


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
            found = {k: heading(cell) for k, cell in enumerate(cells) if k and dimensions_named(heading(cell).quantity)}
            units = {k: cells[k].strip("[]()") for k in names if k < len(cells)}
            if not found and any(kind.factor_or_none(unit) for unit in units.values() for kind in (LENGTH, AREA)):
                names = {k: Heading(name.quantity, units.get(k) or name.unit) for k, name in names.items()}
            else:
                names = found
        elif plain(cells[0]) in specimens:
            place = f"in sheet '{sheet}', line {line}" if sheet else f"in line {line}"
            for column in [column for column in names if column < len(cells)]:
                name, where = names[column], place
                if not name.unit and len(in_table) == 1:
                    name = Heading(name.quantity, *in_table)
                    where = f"{place} ({name.unit} {UNIT_ASSUMED}"
                yield from _sizes(name, cells[column], where, f"{name.quantity}: {cells[column]}")


def _sizes(name: Heading, text: str, source: str, shown: str) -> list[StatedSize]:
    """Return the length or the area that a text states, in the unit there or beside the name; nothing for others.

    Of a product such as ``5 x 2 mm`` they are the sizes that the name has for its factors, or else the area of two.
    """
    sides, unit = sides_and_unit(text)
    if sides and min(sides) > 0 and (factor := LENGTH.factor_or_none(unit or name.unit)):
        names = [NAMES_OF_SIDES.get(side, side) for side in re.split(CROSS_OF_NAMES, name.quantity)]
        if len(names) == len(sides):
            pairs = zip(names, sides, strict=True)
            return [StatedSize(side, LENGTH, number * factor, source, shown) for side, number in pairs]
        is_area = len(sides) == 2
        return [StatedSize(name.quantity, AREA, prod(sides) * factor**2, source, shown)] if is_area else []
    number, unit = number_and_unit(text)
    for kind in (LENGTH, AREA):
        factor = kind.factor_or_none(unit or name.unit)
        if number and number > 0 and factor:
            return [StatedSize(name.quantity, kind, number * factor, source, shown)]
    return []
