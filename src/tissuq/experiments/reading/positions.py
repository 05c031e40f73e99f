"""Columns of positions or lengths where displacements are expected: told by where they begin, and by the load there."""

from __future__ import annotations

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.recognition import ColumnChoice
from tissuq.experiments.reading.table import Column, Table

__all__ = ["FIRST_ROW", "LITTLE_LOAD", "ZERO_ASSUMED", "check_lengths", "check_positions"]

FIRST_ROW = "first"
"""What is given for a zero at the first row."""
ZERO_ASSUMED = "(its first row, assumed: there is little load)"
OFFSET, NEGLIGIBLE_OFFSET = 0.05, 0.01
"""Shares of their range by which displacements may begin away from 0, and by which that changes little."""
TOE_ROWS, TOE = 8, 0.1
"""Rows, and share of the range of displacements, over which the load begins on a line at least."""
STANDARD_ERRORS = 2.0
"""How clearly the load at the first row is nearer to 0 than to where that line would have come from 0."""
LITTLE_LOAD = 0.1
"""Share of the largest load up to which a specimen may be undeformed."""
LEAST_CHANGE = 1e-3
"""Relative change of the length of a specimen in a test of tension or compression."""


def check_positions(table: Table, choice: ColumnChoice, displacement: Column, load: Column, length: float) -> bool:
    """Return whether displacements (mm) are positions, to be counted from their first row.

    They are where the first row is far from 0 and carries little load, or is near 0 and the load begins there all the
    same. Displacements carry little load at 0.

    Raises
    ------
    InputError
        When neither does, so that nothing shows where to count from.
    """
    span = float(np.ptp(displacement))
    if abs(displacement[0]) <= OFFSET * span or not span:
        return abs(displacement[0]) > NEGLIGIBLE_OFFSET * span and _begins_unloaded(displacement, load)
    size = np.abs(load) / max(float(np.abs(load).max()), np.finfo(float).tiny)
    if size[0] <= LITTLE_LOAD:
        return True
    nearest = int(np.argmin(np.abs(displacement)))
    if abs(displacement[nearest]) <= OFFSET * span and size[nearest] <= LITTLE_LOAD:
        return False
    first, ends = float(displacement[0]), np.array([displacement.min(), displacement.max()]) / length
    from_first, from_zero, of_length = (
        f"(stretch {low:.4g} to {high:.4g})" for low, high in (ends + 1 - first / length, ends + 1, ends)
    )
    raise InputError(
        f"{table.place(choice.deformation, 0)}: begins at {first:g} mm with {size[0]:.0%} of the largest load, so that "
        f"nothing shows where the specimen is undeformed. If it is there, give --zero first {from_first}; if at 0, "
        f"--zero '0 mm' {from_zero}; if it is undeformed at first, and the load cell reads that without load, "
        "--load-zero first; if the column holds the length or height of the specimen, --column "
        f"'length={table.key(choice.deformation)}' {of_length}."
    )


def _begins_unloaded(displacement: Column, load: Column) -> bool:
    """Tell whether the load at the first row is clearly nearer to 0 than to what it has grown to on the way from 0."""
    is_beyond = np.abs(displacement - displacement[0]) > TOE * np.ptp(displacement)
    count = max(TOE_ROWS, int(np.argmax(is_beyond)))
    way, first_loads = displacement[:count] - displacement[0], load[:count]
    if len(way) < TOE_ROWS or not np.ptp(way):
        return False
    (slope, start), covariance = np.polyfit(way, first_loads, 1, cov=True)
    slope_error, start_error = STANDARD_ERRORS * np.sqrt(np.diag(covariance))
    return bool(abs(start) + start_error < 0.5 * (abs(slope) - slope_error) * abs(displacement[0]))


def check_lengths(table: Table, choice: ColumnChoice, length: Column, unit: str = "mm") -> None:
    """Refuse current lengths that are not positive, or do not change."""
    row = int(np.argmin(length))
    if length[row] <= 0:
        raise InputError(
            f"{table.place(choice.deformation, row)}: a specimen cannot be {length[row]:g} {unit} long. If these are "
            "displacements, give the column so: --column displacement=NAME."
        )
    if np.ptp(length) < LEAST_CHANGE * length.max():
        raise InputError(
            f"{table.place(choice.deformation)}: the specimen stays {length[0]:g} {unit} long, so this is no test of "
            "tension or compression. Give the columns of the deformation and of its load, and --mode."
        )
