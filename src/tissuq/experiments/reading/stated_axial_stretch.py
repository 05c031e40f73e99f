"""The axial stretch of a tube that is given, or that a line above its table states, in whatever words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from tissuq.errors import InputError
from tissuq.experiments.numbers import NUMBER, number_in
from tissuq.experiments.reading.file_format import SEPARATOR_OF_CELLS
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.tube import SAME_STRETCH
from tissuq.experiments.reading.vocabulary import AXIAL_STRAIN, AXIAL_STRETCH

LEAST, LARGEST = 0.9, 4.0
"""Axial stretches beyond which a number is hardly one: a strain below them, percent above."""
BETWEEN_LETTERS = re.compile(r"(?<=[^\W\d])[-_](?=[^\W\d])")
STATEMENT = re.compile(
    rf"(?<!\w)(?:(?P<stretch>{AXIAL_STRETCH.pattern})|(?P<strain>{AXIAL_STRAIN.pattern}))"
    rf"( (λ|lambda) ?z?)?\s*([\[(](?P<unit>[^\])]*)[\])])?[\s:=;|,{SEPARATOR_OF_CELLS}]*((of|is|was)\s+)?"
    rf"(?P<number>{NUMBER.pattern})\s*(?P<percent>%)?(\s*(±|\+/-)\s*{NUMBER.pattern}\s*%?)?\s*(mm/mm)?"
    rf"\s*(?=\.?$|[()]|\.\s|[;|,\t{SEPARATOR_OF_CELLS}](?!\s*[.\d]))"
)
"""As in ``Axial stretch (lambda_z): 1.5`` and ``axial strain = 50 %``, and no list of them, or a range."""


@dataclass(frozen=True)
class StatedAxialStretch:
    """An axial stretch of all rows, what says it, and where that stands after the name of the file: ``, line 2``."""

    value: float
    source: str
    place: str = ""


def stated_axial_stretch(table: Table, options: ReadingOptions) -> StatedAxialStretch | None:
    """Return the axial stretch of all rows of a tube that the options or the lines above its table say.

    Raises
    ------
    InputError
        When these contradict each other, or a line states what is hardly one.
    """
    in_lines, given = [*_in_lines(table)], options.get("axial_stretch")
    others = [one for one in in_lines if given is not None and abs(one.value - given) > SAME_STRETCH]
    if given is not None and others:
        raise InputError(
            f"{table.file}{others[0].place}: the axial stretch is {others[0].value:g} by {others[0].source}, and "
            f"--axial-stretch says {given:g}. Leave that out, or the line out of the file."
        )
    if given is not None:
        return StatedAxialStretch(float(given), "as given")
    if any(abs(one.value - in_lines[0].value) > SAME_STRETCH for one in in_lines):
        raise InputError(
            f"{table.file}: the axial stretch of the tube is {in_lines[0].source}, and another by "
            f"{in_lines[-1].source}: say which it is, such as --axial-stretch 1.5."
        )
    return in_lines[0] if in_lines else None


def _in_lines(table: Table) -> Iterator[StatedAxialStretch]:
    for line, text in table.head:
        match = STATEMENT.search(BETWEEN_LETTERS.sub(" ", text.replace('"', "")).lower())
        if not match:
            continue
        shown = f"'{' '.join(text.strip('# ,;').replace(SEPARATOR_OF_CELLS, ' ').split())}'"
        is_percent = bool(match["percent"]) or (match["unit"] or "").strip() == "%"
        number = number_in(match["number"]) * (0.01 if is_percent else 1.0)
        value = 1 + number if match["strain"] else number
        if not LEAST <= value <= LARGEST:
            raise InputError(
                f"{table.file}, line {line}: {shown} is {value:g} times the undeformed length of the tube, which is "
                "hardly its axial stretch. Write that there as a deformed over an undeformed length, such as 1.5."
            )
        yield StatedAxialStretch(value, f"line {line}, {shown}", f", line {line}")
