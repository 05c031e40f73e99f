"""Checks that numbers are what their columns are read as, and that the specimen kept its volume."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.recognition import SHEARS, ColumnChoice
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.units import ANGLE, strain_factor

PLAIN_STRAIN_LIMIT = 10.0
"""A strain without a unit beyond this (1000 %) is taken for percent and asked about."""
DOUBTFUL_STRAIN = 1.0
"""A strain without a unit beyond this (100 %) may be percent; it is taken for a plain ratio with a warning."""
RATIO_ASSUMED = "(a plain ratio assumed: the file states no unit)"
COMPRESSED_LIMIT = 0.5
"""Stretches that all lie below this, or that do in tension where its stress is least, are taken for strains."""
FIRST_ROW = "first"
"""What is given for a zero at the first row."""
ZERO_ASSUMED = "(its first row, assumed: there is little load)"
OFFSET, NEGLIGIBLE_OFFSET = 0.05, 0.01
"""Shares of their range by which displacements may begin away from 0, and by which that changes little."""
TOE_ROWS, TOE = 8, 0.1
"""Rows, and share of the range of displacements, over which the load begins on a line at least."""
STANDARD_ERRORS = 2.0
"""How clearly the load at the first row is nearer to 0 than to where that line would have come from 0, and how clearly
Poisson's ratio is less than that of constant volume."""
LITTLE_LOAD = 0.1
"""Share of the largest load up to which a specimen may be undeformed."""
LEAST_CHANGE = 1e-3
"""Relative change of the length of a specimen in a test of tension or compression."""

LATERAL = re.compile(r"transvers|\blateral|\bradial|\bquer|попереч|横向")
STRETCH = re.compile(r"stretch|lambda|λ|streckung")
STRAIN = re.compile(r"strain|dehnung|kontraktion|epsilon|ε|déformation|деформац|应变|ひずみ")
LEAST_RATIO = 0.45
"""Poisson's ratio below which a material is not taken as incompressible: its shear modulus is off by 3 % or more."""
LEAST_STRAIN = 0.02
"""Largest logarithmic strain that a specimen needs, for a ratio to be told."""
INDEPENDENT_ROWS = 10
"""Measurements for which the rows of a smooth curve are taken."""


def check_stretches(measured: MeasuredRows, choices: Sequence[ColumnChoice]) -> None:
    """Refuse columns of stretches that are not positive, or that are strains by their size."""
    table = measured.table
    for choice, stretch, stress in zip(choices, measured.stretch, measured.stress, strict=True):
        is_positive, is_strain = bool(stretch.min() > 0), choice.measure == "strain"
        at_rest, below_1 = stretch[np.argmin(np.abs(stress))], stretch < 1
        is_pulled = choice.measure == "stretch" and below_1.any() and np.median(stress[below_1]) > 0
        is_small = stretch.max() < COMPRESSED_LIMIT or (is_pulled and at_rest < COMPRESSED_LIMIT)
        if choice.measure in SHEARS or (is_positive and (is_strain or not is_small)):
            continue
        name = table.key(choice.deformation)
        if is_strain:
            advice = "A strain must be larger than -1 (-100 %); correct its values or its unit."
        else:
            advice = (
                "A stretch is deformed over undeformed length. If the column holds strain (stretch - 1), say so: "
                f'columns={{"strain": "{name}"}} or --column strain={_quoted(name)}; or call it so in the file.'
            )
        if is_positive:
            raise InputError(
                f"{table.place(choice.deformation)}: its values ({stretch.min():g} to {stretch.max():g}, and "
                f"{at_rest:g} where the stress is least) look like strain, not stretch. {advice}"
            )
        row = int(np.flatnonzero(stretch <= 0)[0])
        raise InputError(f"{table.place(choice.deformation, row)}: stretch {stretch[row]:g} is not positive. {advice}")


def check_strain(table: Table, choice: ColumnChoice, strain: Column, stress: Column, has_unit: bool) -> None:
    """Refuse a column of strains that are stretches by their values, or percent without saying so."""
    column = choice.deformation
    if not has_unit and np.abs(strain).max() > PLAIN_STRAIN_LIMIT:
        row = int(np.argmax(np.abs(strain)))
        raise InputError(
            f"{table.place(column, row)}: strain {strain[row]:g} without a unit would be {100 * strain[row]:.0f} %. "
            'Give strain_unit="%" (--strain-unit %) if it is percent, strain_unit="1" if it is a plain ratio.'
        )
    if (start := _rest_at_one(strain, stress)) is not None:
        name = table.key(column)
        raise InputError(
            f"{table.place(column, start)}: at strain {strain[start]:g} there is no stress, and the column "
            f'never comes near 0: it looks like a stretch. Say so: columns={{"stretch": "{name}"}} or '
            f"--column stretch={_quoted(name)}."
        )


def check_shear(table: Table, choice: ColumnChoice, shear: Column, stress: Column) -> None:
    """Refuse a column of amounts of shear that are 1 where there is no stress."""
    if (start := _rest_at_one(shear, stress)) is not None:
        raise InputError(
            f"{table.place(choice.deformation, start)}: at an amount of shear of {shear[start]:g} there is no stress, "
            "and the column never comes near 0. If 1 was added to it, take that off; if it is a stretch, give the mode "
            "in which the specimen was stretched, such as --mode planar, and the column as stretch."
        )


def _rest_at_one(deformation: Column, stress: Column) -> int | None:
    """Return the row of a deformation of 1 where that carries no stress, of one that never comes near 0."""
    start = int(np.argmin(np.abs(deformation - 1.0)))
    starts_at_one = abs(deformation[start] - 1.0) < 0.02 and abs(stress[start]) <= 0.02 * np.abs(stress).max()
    return start if starts_at_one and np.abs(deformation).min() > 0.2 else None


def _quoted(name: str) -> str:
    return f"'{name}'" if " " in name else name


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
    start, ends = float(displacement[0]), np.array([displacement.min(), displacement.max()]) / length
    from_first, from_zero, of_length = (
        f"(stretch {low:.4g} to {high:.4g})" for low, high in (ends + 1 - start / length, ends + 1, ends)
    )
    raise InputError(
        f"{table.place(choice.deformation, 0)}: begins at {start:g} mm with {100 * size[0]:.0f} % of the largest load, "
        f"so that nothing shows where the specimen is undeformed. If it is there, give --zero first {from_first}; if "
        f"at 0, --zero '0 mm' {from_zero}; if it is undeformed at first, and the load cell reads that without load, "
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


def volume_step(measured: MeasuredRows, *, is_taken: bool = False) -> str:
    """Return Poisson's ratio of a uniaxial test with lateral strains, as a step; an empty text without them.

    Raises
    ------
    InputError
        When they are clearly those of a material whose volume changes, which no law here describes, unless that
        ``is_taken`` as it is.
    """
    table = measured.table
    along = np.log(measured.stretch[0])
    columns = (_lateral(table, number, along) for number in range(len(table.names)))
    number, lateral = next(filter(None, columns), (0, np.zeros(1)))
    if np.abs(along).max() < LEAST_STRAIN or lateral.min() <= 0:
        return ""
    ratio, error = poisson_ratio(along, np.log(lateral))
    said = f"Poisson's ratio {ratio:.2f} ± {error:.2f}"
    if ratio + STANDARD_ERRORS * error >= LEAST_RATIO:
        return f"{said} by column {table.label(number)}"
    if is_taken:
        return f"taken as incompressible, though {said} by column {table.label(number)}"
    end = int(np.argmax(np.abs(along)))
    change = np.exp(along[end] * (1 - 2 * ratio)) - 1
    raise InputError(
        f"{table.place(number)}: the specimen does not keep its volume ({said}; at stretch "
        f"{np.exp(along[end]):.3g} it changes by {100 * change:+z.0f} %), while every material here is incompressible: "
        "its modulus would be wrong. Foams and lung need a compressible law in another tool. To fit it as one of "
        "constant volume all the same, give --incompressible."
    )


def poisson_ratio(along: Column, across: Column) -> tuple[float, float]:
    """Return the ratio of logarithmic strains (n,) by least squares, and its standard error.

    Examples
    --------
    >>> import numpy as np
    >>> strain = np.linspace(0, 0.2, 21)
    >>> [round(number, 6) for number in poisson_ratio(strain, -0.3 * strain)]
    [0.3, 0.0]
    """
    squares = float(along @ along)
    slope = float(along @ across) / squares
    scatter = float(((across - slope * along) ** 2).sum()) / max(len(along) - 1, 1)
    rows = min(len(along), INDEPENDENT_ROWS)
    return -slope, float(np.sqrt(scatter / squares * len(along) / rows))


def readable_shares(table: Table, number: int) -> Column | None:
    """Return a column (n,) of stretches, strains or angles as plain ratios; None of other units or faulty cells."""
    unit = table.unit(number)
    try:
        (values,) = table.numbers([number])
        return values * (ANGLE.factor_or_none(unit) or strain_factor(unit))
    except InputError:
        return None


def _lateral(table: Table, number: int, along: Column) -> tuple[int, Column] | None:
    """Return a column with the lateral stretches (n,) that it holds, if it is one; those with faulty cells are not.

    A contraction may be written as positive.
    """
    quantity, unit = table.quantities[number], table.unit(number)
    is_stretch, is_strain = bool(STRETCH.search(quantity)), bool(STRAIN.search(quantity))
    if not LATERAL.search(quantity) or not (is_stretch or is_strain) or unit not in ("", "1", "-", "%", "mm/mm"):
        return None
    values = readable_shares(table, number)
    if values is None:
        return None
    return number, values if is_stretch else 1 - np.sign(values @ along) * values
