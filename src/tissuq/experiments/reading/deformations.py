"""From the numbers of a column to stretch: of strains, displacements, lengths, twists, diameters and rates."""

from __future__ import annotations

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.numbers import number_and_unit
from tissuq.experiments.reading.column_units import UnitOption, declared_unit, factor_of, stated_unit
from tissuq.experiments.reading.dimensions import Dimension, Dimensions, in_words
from tissuq.experiments.reading.dimensions_of_table import initial_size
from tissuq.experiments.reading.measures import STRAIN_MEASURES
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.plausibility import (
    DOUBTFUL_STRAIN,
    FIRST_ROW,
    LITTLE_LOAD,
    RATIO_ASSUMED,
    ZERO_ASSUMED,
    check_lengths,
    check_positions,
    check_shear,
    check_strain,
)
from tissuq.experiments.reading.recognition import DIAMETERS, ColumnChoice
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.units import ANGLE, FORCE, LENGTH, PIXELS, RATE, TIME, Quantity, measured_in

NOTABLE_TWIST = 0.05
"""Share of its range by which a twist may begin away from 0."""


def stretch_of(
    table: Table, choice: ColumnChoice, values: Column, load: Column, dimensions: Dimensions, options: ReadingOptions
) -> tuple[Column, str]:
    """Return the stretches, or amounts of shear, and how they were obtained.

    Raises
    ------
    InputError
        When units contradict each other or are missing, or the length of the specimen is not known.
    """
    if choice.measure == "twist":
        return _from_twist(table, choice, values, dimensions, options)
    if choice.measure == "rate":
        return _from_rate(table, choice, values)
    if choice.measure in ("displacement", "sliding"):
        return _from_displacement(table, choice, values, load, dimensions, options)
    if (zero := options.get("zero")) is not None:
        raise InputError(
            f"{table.place(choice.deformation)} is read as {choice.measure}, but zero='{zero}' is given, which is for "
            "displacements. Leave zero (--zero) out, or give the column as displacement."
        )
    if choice.measure == "length":
        return _from_length(table, choice, values, load, dimensions, options)
    if choice.measure in DIAMETERS:
        return _from_diameter(table, choice, values, dimensions, options)
    return _from_ratio(table, choice, values, load, dimensions, options)


def _from_ratio(
    table: Table, choice: ColumnChoice, values: Column, load: Column, dimensions: Dimensions, options: ReadingOptions
) -> tuple[Column, str]:
    """Return stretches, or the stretches or amounts of shear that strains or angles tell, and how."""
    _refuse(table, choice, "displacement_unit", options)
    if "length" in dimensions.set_by_user:
        raise InputError(
            f"{table.place(choice.deformation)} is read as {choice.measure}, which needs no length. Leave --length "
            "out, or name the column of displacements: --column displacement=NAME."
        )
    is_strain = choice.measure == "strain"
    if not is_strain and choice.strain_type != "angle":
        _refuse(table, choice, "strain_unit", options)
    declared = declared_unit(table, choice.deformation)
    if not is_strain and not units.looks_like_unit(declared):
        declared = ""
    label, is_shear = table.label(choice.deformation), choice.measure == "shear"
    if choice.strain_type == "angle":
        factor, unit_source = factor_of(table, choice.deformation, ANGLE, "strain_unit", options)
        scaled = f" in {unit_source}"
    else:
        hint = "give strain_unit (--strain-unit)" * is_strain
        unit, _ = stated_unit(table, choice.deformation, declared, units.strain_factor, "strain_unit", options, hint)
        factor = units.strain_factor(unit)
        scaled = "" if factor == 1 else f" x {factor:g}"
    if is_strain:
        has_unit = bool(declared or options.get("strain_unit"))
        check_strain(table, choice, values * factor, load, has_unit=has_unit)
        is_doubtful = not has_unit and np.abs(values).max() > DOUBTFUL_STRAIN
        scaled += f" {RATIO_ASSUMED}" if is_doubtful else ""
    elif is_shear:
        check_shear(table, choice, values * factor, load)
    else:
        return values * factor, f"stretch = column {label}{scaled}"
    try:
        converted, formula = STRAIN_MEASURES[choice.strain_type].converted(values * factor, is_shear)
    except InputError as error:
        raise InputError(f"{table.place(choice.deformation)}: {error}") from error
    what = "amount of shear" if is_shear else "stretch"
    return converted, f"{what} = {formula.format(f'column {label}{scaled}')}"


def without_machine(
    table: Table, choice: ColumnChoice, displacement: Column, load: Column, options: ReadingOptions
) -> tuple[Column, str]:
    """Return displacements of the specimen alone, in the unit of the file, and how the machine's were taken off.

    The machine gives way in the direction of the force, that in which it moves the specimen, whatever signs both have.

    Raises
    ------
    InputError
        When the compliance is not a length over a force, or the file does not give displacement and force.
    """
    if (compliance := options.get("compliance")) is None:
        return displacement, ""
    if (choice.measure, choice.load) != ("displacement", "force"):
        raise InputError(
            f"compliance (--compliance) takes what the machine gives way under force off displacements, but "
            f"{table.file} is read as {choice.measure} and {choice.load}. Leave it out, or give the columns of "
            "displacement and force: --column displacement=NAME --column force=NAME."
        )
    number, unit = number_and_unit(compliance)
    length, slash, force = unit.partition("/")
    if number is None or number < 0 or not slash:
        raise InputError(f"compliance must be a length over a force such as '0.5 um/N', not '{compliance}'.")
    in_newtons, _ = factor_of(table, choice.stress, FORCE, "force_unit", options)
    in_mm, _ = factor_of(table, choice.deformation, LENGTH, "displacement_unit", options)
    per_newton = number * LENGTH.factor(length.strip()) / FORCE.factor(force.strip())
    away = displacement - displacement[0]
    direction = np.sign(away[np.argmax(np.abs(away))] * load[np.argmax(np.abs(load))])
    return (
        displacement - direction * per_newton * in_newtons * load / in_mm,
        f", less {number:g} {unit} of the machine's compliance times the force",
    )


def _from_displacement(
    table: Table, choice: ColumnChoice, values: Column, load: Column, dimensions: Dimensions, options: ReadingOptions
) -> tuple[Column, str]:
    """Return displacements over the length as stretches, or those of sheared planes over the height as shear."""
    factor, unit_source = factor_of(table, choice.deformation, LENGTH, "displacement_unit", options)
    in_column = initial_size(table, choice, values) if "length" not in dimensions.sizes else None
    length = in_column or dimensions.length
    displacement, label = values * factor, table.label(choice.deformation)
    start, counted = 0.0, ""
    if (zero := options.get("zero")) is not None:
        start, counted = _zero(zero, float(displacement[0]), LENGTH)
    elif in_column is None and check_positions(table, choice, displacement, load, length.value):
        start = float(displacement[0])
        counted = f", counted from {start:g} mm {ZERO_ASSUMED}"
    source = f"column {label} in {unit_source}{counted} / {length.value:g} mm (length {length.source})"
    stretch = 1 + (displacement - start) / length.value
    is_shear = choice.measure == "sliding"
    return (stretch - 1, f"amount of shear = {source}") if is_shear else (stretch, f"stretch = 1 + {source}")


def _from_twist(
    table: Table, choice: ColumnChoice, values: Column, dimensions: Dimensions, options: ReadingOptions
) -> tuple[Column, str]:
    """Return the amount of shear at the rim of a disc, and how it was obtained."""
    factor, unit_source = factor_of(table, choice.deformation, ANGLE, "strain_unit", options)
    radius, height, twist = dimensions.radius, dimensions.length, values * factor
    start, counted = 0.0, ""
    if (zero := options.get("zero")) is not None:
        start, counted = _zero(zero, float(twist[0]), ANGLE)
    elif abs(twist[0]) > NOTABLE_TWIST * float(np.ptp(twist)):
        raise InputError(
            f"{table.place(choice.deformation, 0)}: the twist begins at {values[0]:g}, not at 0. If the disc is "
            "undeformed there give --zero first, if at 0 --zero '0 rad'."
        )
    source = f"column {table.label(choice.deformation)} in {unit_source}{counted}"
    sizes = f"R = {in_words(radius)}, H = {in_words(height)}"
    return (twist - start) * radius.value / height.value, f"amount of shear at the rim = {source} x R / H: {sizes}"


def _from_rate(table: Table, choice: ColumnChoice, values: Column) -> tuple[Column, str]:
    """Return the amount of shear as the integral of its rate over time, by trapezoids, and how it was obtained."""
    from scipy.integrate import cumulative_trapezoid

    times = [column for column in range(len(table.names)) if measured_in(declared_unit(table, column)) == "time"]
    times = [column for column in times if not table.is_constant(column)]
    if len(times) != 1:
        raise InputError(
            f"{table.place(choice.deformation)} is a rate of shear, which over time makes the amount of shear, but "
            f"{len(times)} columns are times. Add a column of shear to the file (--column shear=NAME)."
        )
    rate, rate_source = factor_of(table, choice.deformation, RATE, "strain_unit", {})
    seconds, _ = factor_of(table, times[0], TIME, "strain_unit", {})
    (time,) = table.numbers(times)
    if (np.diff(time) < 0).any():
        row = int(np.argmax(np.diff(time) < 0)) + 1
        raise InputError(f"{table.place(times[0], row)}: the time goes back, so that no shear follows from its rate.")
    shear = cumulative_trapezoid(values * rate, time * seconds, initial=0.0)
    label, over = table.label(choice.deformation), table.label(times[0])
    return shear, f"amount of shear = integral of column {label} in {rate_source} over {over}, 0 in the first row"


def _from_length(
    table: Table, choice: ColumnChoice, values: Column, load: Column, dimensions: Dimensions, options: ReadingOptions
) -> tuple[Column, str]:
    """Return current lengths, heights or distances over the undeformed one, or the first, and how that was done."""
    if PIXELS.factor_or_none(options.get("displacement_unit") or declared_unit(table, choice.deformation)):
        return _from_distance(table, choice, values, load, dimensions)
    factor, unit_source = factor_of(table, choice.deformation, LENGTH, "displacement_unit", options)
    current = values * factor
    length = dimensions.length if "length" in dimensions.sizes else Dimension(float(current[0]), "in its first row")
    check_lengths(table, choice, current)
    label = table.label(choice.deformation)
    return (
        current / length.value,
        f"stretch = column {label} in {unit_source} / {length.value:g} mm (length {length.source})",
    )


def _from_distance(
    table: Table, choice: ColumnChoice, values: Column, load: Column, dimensions: Dimensions
) -> tuple[Column, str]:
    """Return distances in pixels over the undeformed one, which must be known, and how that was done."""
    distance = dimensions.distance(float(values[0]))
    check_lengths(table, choice, values, "px")
    share = abs(float(load[0])) / max(float(np.abs(load).max()), np.finfo(float).tiny)
    if "length" not in dimensions.set_by_user and share > LITTLE_LOAD:
        raise InputError(
            f"{table.place(choice.deformation, 0)}: the distance begins at {values[0]:g} px with {100 * share:.0f} % "
            f'of the largest load. Give the undeformed distance in pixels: --length "{values[0]:.4g} px" (in Python '
            f'length="{values[0]:.4g} px") if it is that, or the one it is.'
        )
    column = f"column {table.label(choice.deformation)} in px"
    return values / distance.value, f"stretch = {column} / {distance.value:g} px (undeformed: {distance.source})"


def _from_diameter(
    table: Table, choice: ColumnChoice, values: Column, dimensions: Dimensions, options: ReadingOptions
) -> tuple[Column, str]:
    """Return the hoop stretches in the middle of the wall of a tube, and how they were obtained."""
    factor, unit_source = factor_of(table, choice.deformation, LENGTH, "displacement_unit", options)
    tube, words = dimensions.tube
    is_outer = choice.measure == DIAMETERS[0]
    face, letter = (tube.outer, "B") if is_outer else (tube.inner, "A")
    try:
        stretch = tube.stretch(values * factor / 2, face, dimensions.axial_stretch)
    except InputError as error:
        raise InputError(f"{table.place(choice.deformation, int(np.argmin(values)))}: {error}") from error
    side = f"{choice.measure.replace('_', ' ')} d = column {table.label(choice.deformation)} in {unit_source}"
    square = f"1 + (d^2/4 - {letter}^2)/(A B)"
    if not isinstance(dimensions.axial_stretch, float):
        square = f"(1 + (axial stretch x d^2/4 - {letter}^2)/(A B)) / axial stretch"
    return stretch, f"hoop stretch in the middle of the wall = sqrt({square}): {side}, {words}"


def _zero(text: str, first_value: float, quantity: Quantity) -> tuple[float, str]:
    """Return the position from which displacements, or the angle from which twists are counted, and words for it."""
    if text == FIRST_ROW:
        return first_value, f", counted from {first_value:g} {quantity.unit} (its first row)"
    number, unit = number_and_unit(text)
    if number is None or not unit:
        raise InputError(
            f"zero must be 'first', or a {quantity.name} with its unit such as '35.2 {quantity.unit}', not '{text}'."
        )
    start = number * quantity.factor(unit)
    return start, f", counted from {start:g} {quantity.unit} (as given)"


def _refuse(table: Table, choice: ColumnChoice, option: UnitOption, options: ReadingOptions) -> None:
    if (value := options.get(option)) is not None:
        role = option.removesuffix("_unit")
        raise InputError(
            f"{table.place(choice.deformation)} is read as {choice.measure}, but {option}='{value}' is "
            f"given. Leave {option} (--{role}-unit) out, or give the column as {role}."
        )
