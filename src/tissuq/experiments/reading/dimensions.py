"""Cross-section and length of a specimen: as the user gives them, or from the lines above the table."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import isclose, pi, prod

from tissuq.errors import InputError
from tissuq.experiments.reading.columns import heading
from tissuq.experiments.reading.layout import WHITESPACE, split
from tissuq.experiments.reading.quantities import AREA, LENGTH, Kind, number_and_unit
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import DIMENSION_NAMES

__all__ = ["Dimension", "Dimensions", "dimensions_of"]

SAME = 0.01
"""Relative difference from which two statements of one dimension contradict each other."""
SECTIONS = {"area": ("area",), "rectangle": ("width", "thickness"), "circle": ("diameter",)}


@dataclass(frozen=True)
class Dimension:
    """One dimension in mm or mm², and the words that tell where it comes from."""

    value: float
    source: str


@dataclass(frozen=True)
class Dimensions:
    """What is known of a specimen's dimensions, what the file states in two ways, and what it contradicts."""

    file: str
    known: Mapping[str, Dimension]
    given: frozenset[str]
    unclear: Mapping[str, str]
    warnings: tuple[str, ...] = ()

    @property
    def length(self) -> Dimension:
        """The undeformed length.

        Raises
        ------
        InputError
            When it is not known.
        """
        self._refuse_unclear("length")
        if "length" not in self.known:
            raise InputError(
                f"{self.file}: to turn displacements into stretches give the undeformed length: length '20 mm' "
                '(--length "20 mm"; in Python dimensions={"length": "20 mm"}). The lines above the table state none.'
            )
        return self.known["length"]

    @property
    def area(self) -> Dimension:
        """The undeformed cross-section.

        Raises
        ------
        InputError
            When it is not known, or follows in two ways that contradict each other.
        """
        areas = _sections(self.known)
        own = {name: area for name, area in areas.items() if self.given & set(SECTIONS[name])}
        if not own:
            self._refuse_unclear("area", "width", "thickness", "diameter")
        areas = own or areas
        if not areas:
            raise InputError(
                f"{self.file}: to turn forces into stresses give the undeformed cross-section: area "
                '(--area "10 mm2"), or width and thickness (--width "5 mm" --thickness "2 mm"), or diameter '
                f'(--diameter "4 mm"). {self._found()}'
            )
        first, *others = areas.values()
        if any(not isclose(first.value, other.value, rel_tol=SAME) for other in others):
            found = " or ".join(f"{each.value:g} mm2 ({each.source})" for each in areas.values())
            raise InputError(
                f"{self.file}: the cross-section could be {found}. "
                'Say which: --area "10 mm2", and leave out the others.'
            )
        return first

    def _refuse_unclear(self, *names: str) -> None:
        for name in names:
            if name in self.unclear:
                raise InputError(
                    f"{self.file}: the file states two {name}s: {self.unclear[name]}. Say which: --{name} "
                    f'"NUMBER {_kind(name).unit}".'
                )

    def _found(self) -> str:
        parts = [name for name in ("width", "thickness") if name in self.known]
        return f"Known is only the {parts[0]}." if parts else "The lines above the table state none."


def dimensions_of(table: Table, given: Mapping[str, str] | None) -> Dimensions:
    """Return the dimensions that the user gives, and those of the file where the user gives none.

    Raises
    ------
    InputError
        When a dimension is unknown or has no unit.
    """
    given = dict(given or {})
    unknown = [name for name in given if name not in DIMENSION_NAMES]
    if unknown:
        raise InputError(f"there is no dimension '{unknown[0]}'; give {', '.join(DIMENSION_NAMES)}.")
    if len([name for name in ("area", "diameter", "width") if name in given]) > 1:
        raise InputError("give the cross-section in one way: area, or width and thickness, or diameter.")
    found = {name: _stated(table, name) for name in DIMENSION_NAMES}
    unclear = {
        name: " and ".join(f"{each.value:g} {_kind(name).unit} {each.source}" for each in several)
        for name, several in found.items()
        if name not in given and any(not isclose(each.value, several[0].value, rel_tol=SAME) for each in several)
    }
    stated = {name: several[0] for name, several in found.items() if several and name not in unclear}
    own = {name: Dimension(_kind(name).value(str(text)), "as given") for name, text in given.items()}
    dimensions = Dimensions(table.file, stated | own, frozenset(given), unclear)
    return replace(dimensions, warnings=tuple(_contradictions(dimensions, stated)))


def _sections(known: Mapping[str, Dimension]) -> dict[str, Dimension]:
    """Return the cross-section in every way in which it follows from what is known."""
    found = {}
    for name, parts in SECTIONS.items():
        if all(part in known for part in parts):
            sizes = [known[part] for part in parts]
            words = (f"{part} {size.value:g} mm {size.source}" for part, size in zip(parts, sizes, strict=True))
            value = pi / 4 * sizes[0].value ** 2 if name == "circle" else prod(size.value for size in sizes)
            found[name] = sizes[0] if name == "area" else Dimension(value, " and ".join(words))
    return found


def _contradictions(dimensions: Dimensions, stated: Mapping[str, Dimension]) -> Iterator[str]:
    """Tell where the file states another length or cross-section than the user."""
    pairs = []
    if "length" in dimensions.given and "length" in stated:
        pairs.append(("length", "mm", dimensions.length, stated["length"]))
    uses_given = any(dimensions.given & set(SECTIONS[name]) for name in _sections(dimensions.known))
    if uses_given and _sections(stated):
        pairs.append(("cross-section", "mm2", dimensions.area, next(iter(_sections(stated).values()))))
    for what, unit, own, theirs in pairs:
        if not isclose(own.value, theirs.value, rel_tol=SAME):
            yield (
                f"the {what} is {own.value:g} {unit} ({own.source}), but the file says {theirs.value:g} {unit} "
                f"({theirs.source})."
            )


def _stated(table: Table, name: str) -> list[Dimension]:
    """Return what the lines above the table state of one dimension."""
    return [each for line, text in table.above for each in _read(line, text, table.separator, name)]


def _read(line: int, text: str, separator: str, name: str) -> Iterator[Dimension]:
    """Give what a line like ``Width : 5 mm`` or ``"Probendicke";1,55;"mm"`` states of one dimension."""
    text = text.lstrip("# ")
    cells = [text] if separator == WHITESPACE else split(text, separator)
    words = [word.strip(' "') for cell in cells for word in re.split(r"[:=\t]|\s{2,}", cell)]
    words = [word for word in words if word]
    for place, word in enumerate(words):
        label = heading(word)
        if label.quantity not in DIMENSION_NAMES[name]:
            continue
        for texts in (words[place + 1 : place + 3], words[place + 1 : place + 2]):
            number, unit = number_and_unit(" ".join(texts))
            factor = _kind(name).known(unit or label.unit)
            if number and number > 0 and factor:
                yield Dimension(number * factor, f"in line {line}")
                break


def _kind(name: str) -> Kind:
    return AREA if name == "area" else LENGTH
