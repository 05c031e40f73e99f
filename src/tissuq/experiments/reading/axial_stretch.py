"""The axial stretch at which a tube is held: given for all rows or in a column, and what it means for the stress."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import InflatedTube, LoadingMode
from tissuq.experiments.reading.columns import find_column
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import HOW_TO_READ_TUBE, PRESSURE, ColumnChoice
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.tube import SAME_STRETCH, Tube, rows_at_each_stretch
from tissuq.experiments.reading.vocabulary import AXIAL_STRETCH, ROLE_OF_AXIAL_STRETCH
from tissuq.experiments.units import strain_factor

__all__ = [
    "AxialStretch",
    "axial_stretch_of",
    "column_of_axial_stretch",
    "note_of_stretched_tube",
    "note_of_tube",
    "stretches_held",
]

LARGEST = 4.0
"""Axial stretch beyond which a number is hardly one, but percent."""
AT_ITS_LENGTH = (
    "the tube is taken as held at its undeformed length, and as free of stress without pressure; if it was stretched "
    "along its axis first, the parameters of a fit are not those of its wall: then give --mode "
    "inflated-tube and --axial-stretch."
)


@dataclass(frozen=True, eq=False)
class AxialStretch:
    """The axial stretch (n,) of every row, and where it comes from."""

    values: Column
    source: str


def column_of_axial_stretch(table: Table, options: ReadingOptions) -> int | None:
    """Return the column of the axial stretch, in its role or by its name; None where there is none.

    Raises
    ------
    InputError
        When several may be it.
    """
    wanted = (options.get("columns") or {}).get(ROLE_OF_AXIAL_STRETCH)
    if wanted is not None:
        return find_column(table, ROLE_OF_AXIAL_STRETCH, wanted)
    columns = [column for column, quantity in enumerate(table.quantities) if AXIAL_STRETCH.fullmatch(quantity)]
    if len(columns) > 1:
        labels = " and ".join(map(table.label, columns))
        raise InputError(
            f"{table.file}: columns {labels} may each be the axial stretch of a tube. Say which it is: --column "
            f"{ROLE_OF_AXIAL_STRETCH}=NAME."
        )
    return columns[0] if columns else None


def axial_stretch_of(
    table: Table, mode: LoadingMode, choices: Sequence[ColumnChoice], options: ReadingOptions
) -> AxialStretch | None:
    """Return the axial stretch of every row in the mode of an inflated tube; None in other modes.

    Raises
    ------
    InputError
        When nothing says it, when the file contradicts what is given, or in another mode when a tube was stretched.
    """
    given, is_tube = options.get("axial_stretch"), choices[0].load == PRESSURE
    if isinstance(mode, InflatedTube):
        axial = _required(table, given, options)
        _check_held(table, axial.values)
        return axial
    if not is_tube:
        if given is not None or ROLE_OF_AXIAL_STRETCH in (options.get("columns") or {}):
            raise InputError(
                f"{table.file}: an axial stretch is given, which is of a tube under pressure: give --mode "
                "inflated-tube, or leave it out."
            )
        return None
    column = column_of_axial_stretch(table, options)
    if given is not None and abs(given - 1) > SAME_STRETCH:
        raise _not_at_its_length(table.file, given)
    if given is None and column is not None:
        values = _numbers(table, column)
        row = int(np.argmax(np.abs(values - 1)))
        if abs(values[row] - 1) > SAME_STRETCH:
            raise _not_at_its_length(table.place(column, row), float(values[row]))
    return None


def _required(table: Table, given: float | None, options: ReadingOptions) -> AxialStretch:
    column = column_of_axial_stretch(table, options)
    if given is None and column is None:
        raise InputError(
            f"{table.file}: say at which axial stretch the tube was held, its length over that when it is neither "
            "stretched nor inflated: --axial-stretch 1.5 (in Python axial_stretch=1.5), or --column "
            f"{ROLE_OF_AXIAL_STRETCH}=NAME for a column of it."
        )
    if given is not None and not 0 < given <= LARGEST:
        raise InputError(
            f"axial_stretch (--axial-stretch) must be a deformed over an undeformed length such as 1.5, not {given:g}."
        )
    if column is None:
        return AxialStretch(np.full(len(table.rows), float(given or 1.0)), f"axial stretch {given:g} (as given)")
    values, label = _numbers(table, column), table.label(column)
    is_off = ~((values > 0) & (values <= LARGEST))
    if is_off.any():
        row = int(np.argmax(is_off))
        raise InputError(
            f"{table.place(column, row)}: {values[row]:g} is no axial stretch, a deformed over an undeformed length "
            "such as 1.5. If the column is in percent, write % in its heading; or give the stretch as --axial-stretch."
        )
    if given is None:
        return AxialStretch(values, f"axial stretch = column {label}")
    row = int(np.argmax(np.abs(values - given)))
    if abs(values[row] - given) > SAME_STRETCH:
        raise InputError(
            f"{table.place(column, row)}: the axial stretch is {values[row]:g} there, and --axial-stretch says "
            f"{given:g}. Leave that out, or the column out of the file."
        )
    return AxialStretch(np.full(len(values), float(given)), f"axial stretch {given:g} (as given)")


def _check_held(table: Table, axial_stretch: Column) -> None:
    """Refuse an axial stretch that goes on during an inflation of which pressure and diameter are all that is known."""
    for rows in rows_at_each_stretch(axial_stretch):
        if np.ptp(axial_stretch[rows]) > 2 * SAME_STRETCH:
            raise InputError(
                f"{table.file}: the axial stretch changes from {axial_stretch[rows].min():.4g} to "
                f"{axial_stretch[rows].max():.4g} while the tube is inflated. Without the axial force the stress in "
                "its wall follows only at an axial stretch that is held, at one or at several in turn: leave rows out "
                "with --leave-out."
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


def note_of_stretched_tube(axial_stretch: Column) -> str:
    """Return what is taken of a tube that was stretched along its axis, and what its test leaves open."""
    return (
        f"the tube is taken as held at {stretches_held(axial_stretch)} times its undeformed length, and as free of "
        "stress when it is neither stretched nor inflated, the state that --diameter and --thickness are of. Its axial "
        "stress is not read, so that a fit knows what the material does along the axis only as far as the hoop stress "
        "shows it."
    )


def stretches_held(axial_stretch: Column) -> str:
    """Return the axial stretches at which a tube was held, in words.

    Examples
    --------
    >>> stretches_held(np.array([1.3, 1.3, 1.5, 1.502]))
    '1.3 and 1.501'
    """
    *others, last = (f"{axial_stretch[rows].mean():.4g}" for rows in rows_at_each_stretch(axial_stretch))
    return f"{', '.join(others)} and {last}" if others else last
