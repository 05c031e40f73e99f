"""The axial stretch of a tube: given, in a line above its table or in a column, and what it means for the stress."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import InflatedTube, LoadingMode, ThinTube
from tissuq.experiments.numbers import NUMBER, number_in
from tissuq.experiments.reading.column_units import factor_of
from tissuq.experiments.reading.file_format import SEPARATOR_OF_CELLS
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import PRESSURE, TOTAL_FORCE, ColumnChoice, find_column
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.tube import SAME_STRETCH, Tube, rows_at_each_stretch
from tissuq.experiments.reading.vocabulary import (
    AXIAL_STRAIN,
    AXIAL_STRETCH,
    LENGTH_OF_TUBE,
    ROLE_OF_AXIAL_STRETCH,
    ROLES,
)
from tissuq.experiments.units import LENGTH, measured_in, strain_factor

if TYPE_CHECKING:
    from tissuq.experiments.reading.dimensions import Dimensions

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
ROWS_AT_EACH = 3
"""Rows at each axial stretch, on average at least, where it is held."""
NOTABLE_STRETCH = 0.1
"""Strain along the axis from which it matters at which one the wall was measured: 5 % of the stress."""
MOST_LISTED = 6
"""Number of axial stretches that a text lists."""
AT_ITS_LENGTH = (
    "the tube is taken as held at its undeformed length, and as free of stress without pressure; if it was stretched "
    "along its axis first, the parameters of a fit are not those of its wall: then give --mode "
    "inflated-tube and --axial-stretch."
)


HOW_TO_SAY_AXIAL_STRETCH = (
    "its length over that when it is neither stretched nor inflated: --axial-stretch 1.5 (in Python "
    f"axial_stretch=1.5), or --column {ROLE_OF_AXIAL_STRETCH}=NAME for a column of it, or of the length or the axial "
    'displacement, with --length "8 mm" for the undeformed length.'
)
HOW_TO_READ_TUBE = (
    'If it was held at its undeformed length, give --mode planar --diameter "3 mm" --thickness "0.5 mm": its '
    "undeformed outer diameter and the thickness of its wall. If it was stretched along its axis first, give these and "
    "--mode inflated-tube --axial-stretch 1.5, where the file has no column of it. Where the axial force was measured, "
    "too, give --mode thin-tube and --column force=NAME."
)
"""How a tube is read."""

WHICH_FORCE = {
    "": "Its axial stress is not read, so that a fit knows what the material does along the axis only as far as the "
    "hoop stress shows it.",
    "force": "The force is taken as the reduced one, what the machine pulls with in addition to the pressure on the "
    "closed ends; if that is in it, give --column total_force=NAME.",
    TOTAL_FORCE: "The force is taken as that of the whole wall, with the pressure on the closed ends in it; if the "
    "machine pulls with it in addition to that, give --column force=NAME.",
}
"""What is to know of the axial force, by the role of its column, or without one."""


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


def column_of_axial_stretch(table: Table, options: ReadingOptions) -> int | None:
    """Return the column of the axial stretch, or of the length, in its role or by its name; None where there is none.

    A length that is the same in all rows may be the undeformed one, unless that is given. With it a displacement of the
    machine tells the length, too.

    Raises
    ------
    InputError
        When several may be it.
    """
    columns_given = options.get("columns") or {}
    for role in (ROLE_OF_AXIAL_STRETCH, "length"):
        if (wanted := columns_given.get(role)) is not None:
            return find_column(table, role, wanted)
    columns = [column for column, quantity in enumerate(table.quantities) if AXIAL_STRETCH.fullmatch(quantity)]
    if not columns and stated_axial_stretch(table, options) is None:
        is_known = "length" in (options.get("dimensions") or {})
        columns = [
            column
            for column, quantity in enumerate(table.quantities)
            if is_of_length(table, column)
            and (
                (LENGTH_OF_TUBE.fullmatch(quantity) and (is_known or not table.is_constant(column)))
                or (is_known and is_axial_displacement(table, column))
            )
        ]
    if len(columns) > 1:
        labels = " and ".join(map(table.label, columns))
        raise InputError(
            f"{table.file}: columns {labels} may each be the axial stretch of a tube, or its length. Say which it is: "
            f"--column {ROLE_OF_AXIAL_STRETCH}=NAME."
        )
    return columns[0] if columns else None


def is_of_length(table: Table, column: int) -> bool:
    """Tell whether a column has a unit of length."""
    return measured_in(table.unit(column)) == "length"


def is_axial_displacement(table: Table, column: int) -> bool:
    """Tell whether a column of lengths holds what a tube is longer by, by its name."""
    return table.quantities[column] in ROLES["displacement"]


@dataclass(frozen=True, eq=False)
class AxialStretch:
    """The axial stretch (n,) of every row, where it comes from, and whether from lengths."""

    values: Column
    source: str
    is_of_length: bool = False


def axial_stretch_of(
    table: Table,
    mode: LoadingMode,
    choices: Sequence[ColumnChoice],
    dimensions: Dimensions,
    options: ReadingOptions,
) -> AxialStretch | None:
    """Return the axial stretch of every row of a tube that is read in a mode with one; None in other modes.

    Raises
    ------
    InputError
        When nothing says it, when the file contradicts what is given, or in another mode when a tube was stretched.
    """
    given, is_tube = options.get("axial_stretch"), choices[0].load == PRESSURE
    if isinstance(mode, InflatedTube | ThinTube) and (is_tube or not isinstance(mode, ThinTube)):
        axial = _required(table, given, dimensions, options)
        if len(choices) == 1:
            _check_held(table, axial.values)
        return axial
    if not is_tube:
        if given is not None or ROLE_OF_AXIAL_STRETCH in (options.get("columns") or {}):
            raise InputError(
                f"{table.file}: an axial stretch is given, which is of a tube under pressure: give --mode "
                "inflated-tube (or thin-tube, where the axial force was measured, too), or leave it out."
            )
        return None
    column, stated = column_of_axial_stretch(table, options), stated_axial_stretch(table, options)
    if stated is not None and abs(stated.value - 1) > SAME_STRETCH:
        raise _not_at_its_length(f"{table.file}{stated.place}", stated.value)
    if given is None and column is not None:
        values = _numbers(table, column)
        row = int(np.argmax(np.abs(values - 1)))
        if abs(values[row] - 1) > SAME_STRETCH:
            raise _not_at_its_length(table.place(column, row), float(values[row]))
    return None


def _required(table: Table, given: float | None, dimensions: Dimensions, options: ReadingOptions) -> AxialStretch:
    column, stated = column_of_axial_stretch(table, options), stated_axial_stretch(table, options)
    if given is not None and not 0 < given <= LARGEST:
        raise InputError(
            f"axial_stretch (--axial-stretch) must be a deformed over an undeformed length such as 1.5, not {given:g}."
        )
    if column is None:
        if stated is None:
            raise InputError(f"{table.file}: say at which axial stretch the tube was held, {HOW_TO_SAY_AXIAL_STRETCH}")
        return AxialStretch(np.full(len(table.rows), stated.value), f"axial stretch {stated.value:g} ({stated.source})")
    label = table.label(column)
    if is_of_length(table, column):
        values, source = _from_length(table, column, dimensions, options)
    else:
        values, source = _numbers(table, column), f"axial stretch = column {label}"
    is_off = ~((values > 0) & (values <= LARGEST))
    if is_off.any():
        row = int(np.argmax(is_off))
        raise InputError(
            f"{table.place(column, row)}: {values[row]:g} is no axial stretch, a deformed over an undeformed length "
            "such as 1.5. If the column is in percent, write % in its heading; of lengths check the unit and --length."
        )
    if given is None:
        return AxialStretch(values, source, is_of_length(table, column))
    row = int(np.argmax(np.abs(values - given)))
    if abs(values[row] - given) > SAME_STRETCH:
        raise InputError(
            f"{table.place(column, row)}: the axial stretch is {values[row]:g} there, and --axial-stretch says "
            f"{given:g}. Leave that out, or the column out of the file."
        )
    return AxialStretch(np.full(len(values), float(given)), f"axial stretch {given:g} (as given)")


def _from_length(table: Table, column: int, dimensions: Dimensions, options: ReadingOptions) -> tuple[Column, str]:
    """Return the axial stretches that lengths of the tube are, and how they were obtained."""
    if "length" not in dimensions.sizes and "length" not in dimensions.ambiguous:
        what = "axial displacement" if is_axial_displacement(table, column) else "length"
        raise InputError(
            f"{table.place(column)} is the {what} of a tube, and its length when it is neither stretched nor inflated "
            'is not known: give it as --length "8 mm" (in Python length="8 mm"), or the axial stretch as '
            "--axial-stretch 1.5."
        )
    length = dimensions.length
    factor, unit_source = factor_of(table, column, LENGTH, "displacement_unit", options)
    (values,) = table.numbers([column])
    before = "1 + " if is_axial_displacement(table, column) else ""
    source = f"{before}column {table.label(column)} in {unit_source} / {length.value:g} mm (length {length.source})"
    return values * factor / length.value + bool(before), f"axial stretch = {source}"


def _check_held(table: Table, axial_stretch: Column) -> None:
    """Refuse an axial stretch that goes on during an inflation of which pressure and diameter are all that is known."""
    at_each = [axial_stretch[rows] for rows in rows_at_each_stretch(axial_stretch)]
    moved = next((held for held in at_each if np.ptp(held) > 2 * SAME_STRETCH), None)
    if moved is None and len(at_each) > 1 and len(axial_stretch) < ROWS_AT_EACH * len(at_each):
        moved = axial_stretch
    if moved is not None:
        raise InputError(
            f"{table.file}: the axial stretch changes from {moved.min():.4g} to {moved.max():.4g} while the tube is "
            "inflated. Without the axial force the stress in its wall follows only at an axial stretch that is held, "
            "at one or at several in turn: leave rows out with --leave-out, or read the force, too (--mode thin-tube)."
        )


def _numbers(table: Table, column: int) -> Column:
    (values,) = table.numbers([column])
    return values * strain_factor(table.unit(column))


def _not_at_its_length(place: str, stretch: float) -> InputError:
    return InputError(
        f"{place}: the axial stretch is {stretch:g}, and in loading mode 'planar' a tube keeps its undeformed length. "
        f"{HOW_TO_READ_TUBE}"
    )


def note_of_tube(tube: Tube, axial: AxialStretch | None) -> str:
    """Return what to know of stresses that are read from pressure and diameter of a tube."""
    return f"{AT_ITS_LENGTH} {tube.note}".rstrip() if axial is None else tube.note


def note_of_stretched_tube(axial_stretch: Column, load: str = "") -> str:
    """Return what is taken of a tube that was stretched along its axis, and of its axial force, if that is read."""
    what, largest = WHICH_FORCE[load], float(np.max(axial_stretch))
    measured_stretched = (
        f" A wall that was measured at {largest:.3g} times its length, without pressure, is about "
        f"{np.sqrt(largest):.3g} times as thick undeformed, and its stresses are less by that factor."
    )
    return (
        f"the tube is taken as held at {stretches_held(axial_stretch)} times its undeformed length, and as free of "
        "stress when it is neither stretched nor inflated, the state that --diameter and --thickness are of."
        f"{measured_stretched * (abs(largest - 1) > NOTABLE_STRETCH)} {what}"
    )


def stretches_held(axial_stretch: Column) -> str:
    """Return the axial stretches at which a tube was held, in words.

    Examples
    --------
    >>> stretches_held(np.array([1.3, 1.3, 1.5, 1.502]))
    '1.3 and 1.501'
    >>> stretches_held(np.linspace(1.1, 1.5, 50))
    '1.1 to 1.5'
    """
    at_each = [axial_stretch[rows] for rows in rows_at_each_stretch(axial_stretch)]
    if len(at_each) > MOST_LISTED or any(np.ptp(held) > 2 * SAME_STRETCH for held in at_each):
        return f"{axial_stretch.min():.4g} to {axial_stretch.max():.4g}"
    *others, last = (f"{held.mean():.4g}" for held in at_each)
    return f"{', '.join(others)} and {last}" if others else last
