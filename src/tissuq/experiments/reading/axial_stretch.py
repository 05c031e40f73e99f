"""The axial stretch at which a tube is held: given for all rows or in a column, and what it means for the stress."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import InflatedTube, LoadingMode, ThinTube
from tissuq.experiments.reading.column_units import factor_of
from tissuq.experiments.reading.columns_of_tube import (
    HOW_TO_READ_TUBE,
    HOW_TO_SAY_AXIAL_STRETCH,
    column_of_axial_stretch,
    is_axial_displacement,
    is_of_length,
)
from tissuq.experiments.reading.dimensions import Dimensions
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import PRESSURE, TOTAL_FORCE, ColumnChoice
from tissuq.experiments.reading.stated_axial_stretch import LARGEST, stated_axial_stretch
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.tube import SAME_STRETCH, Tube, rows_at_each_stretch
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH
from tissuq.experiments.units import LENGTH, strain_factor

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


WHICH_FORCE = {
    "": "Its axial stress is not read, so that a fit knows what the material does along the axis only as far as the "
    "hoop stress shows it.",
    "force": "The force is taken as the reduced one, what the machine pulls with in addition to the pressure on the "
    "closed ends; if that is in it, give --column total_force=NAME.",
    TOTAL_FORCE: "The force is taken as that of the whole wall, with the pressure on the closed ends in it; if the "
    "machine pulls with it in addition to that, give --column force=NAME.",
}
"""What is to know of the axial force, by the role of its column, or without one."""


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
