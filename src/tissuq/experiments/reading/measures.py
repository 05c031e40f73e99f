"""From the numbers of two columns to stretch and stress: units, strains, displacements and forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.reading.columns import ColumnChoice
from tissuq.experiments.reading.dimensions import Dimension, Dimensions, initial_size
from tissuq.experiments.reading.inflation import Tube
from tissuq.experiments.reading.plausibility import DOUBTFUL_STRAIN, RATIO_ASSUMED, check_strain
from tissuq.experiments.reading.positions import FIRST_ROW, ZERO_ASSUMED, check_lengths, check_positions
from tissuq.experiments.reading.strain_measures import STRAIN_MEASURES
from tissuq.experiments.reading.stress_measures import StressMeasure, measure_of_tube
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.torsion import apparent_stress
from tissuq.experiments.reading.tube_columns import DIAMETERS
from tissuq.experiments.units import (
    ANGLE,
    FORCE,
    LENGTH,
    PRESSURE,
    RATE,
    TIME,
    TORQUE,
    Quantity,
    measured_in,
    number_and_unit,
)

__all__ = ["MPA_ASSUMED", "Load", "stress_of", "stretch_of", "without_machine"]

UNIT_OF_STRESSES_FROM_FORCES = "kPa"
"""The unit in which stresses from forces are shown unless another is asked for."""
MPA_ASSUMED = "MPa (assumed: the file states no unit)"
NOTABLE_TWIST = 0.05
"""Share of its range by which a twist may begin away from 0."""
LARGEST_ASSUMED_STRESS = 100.0
"""Largest stress, MPa, of a soft material: numbers beyond it that have no unit are not taken as MPa."""


@dataclass(frozen=True, eq=False)
class Load:
    """The stress (MPa), the unit in which people want to read it, and how it was obtained.

    ``area`` (mm²) is that by which forces were divided; None where the file gives stresses. ``scale`` is what one unit
    of the column is in MPa. ``measure`` is that of stresses whose conversion needs more than their columns,
    and ``note`` what to know of them.
    """

    stress: Column
    unit: units.StressUnit
    source: str
    area: float | None = None
    scale: float = 1.0
    measure: StressMeasure | None = None
    note: str = ""


def stretch_of(
    table: Table,
    choice: ColumnChoice,
    values: Column,
    load: Column,
    dimensions: Dimensions,
    strain_unit: str | None,
    displacement_unit: str | None,
    zero: str | None,
) -> tuple[Column, str]:
    """Return the stretches and how they were obtained; `zero` is where displacements are counted from.

    Raises
    ------
    InputError
        When units contradict each other or are missing, or the length of the specimen is not known.
    """
    if choice.measure == "twist":
        return _from_twist(table, choice, values, dimensions, strain_unit, zero)
    if choice.measure == "rate":
        return _from_rate(table, choice, values)
    if choice.measure == "sliding":
        stretch, step = _from_displacement(table, choice, values, load, dimensions, displacement_unit, zero)
        return stretch - 1, step.replace("stretch = 1 +", "amount of shear =")
    if choice.measure == "displacement":
        return _from_displacement(table, choice, values, load, dimensions, displacement_unit, zero)
    if zero is not None:
        raise InputError(
            f"{table.place(choice.deformation)} is read as {choice.measure}, but zero='{zero}' is given, which is for "
            "displacements. Leave zero (--zero) out, or give the column as displacement."
        )
    if choice.measure == "length":
        return _from_length(table, choice, values, dimensions, displacement_unit)
    if choice.measure in DIAMETERS:
        return _from_diameter(table, choice, values, dimensions, displacement_unit)
    _refuse(table, choice, "displacement_unit", displacement_unit)
    if "length" in dimensions.set_by_user:
        raise InputError(
            f"{table.place(choice.deformation)} is read as {choice.measure}, which needs no length. Leave --length "
            "out, or name the column of displacements: --column displacement=NAME."
        )
    is_strain = choice.measure == "strain"
    if not is_strain and choice.strain_type != "angle":
        _refuse(table, choice, "strain_unit", strain_unit)
    declared = _declared_unit(table, choice.deformation)
    if not is_strain and not units.looks_like_unit(declared):
        declared = ""
    label, is_shear = table.label(choice.deformation), choice.measure == "shear"
    if choice.strain_type == "angle":
        factor, unit_source = _factor(table, choice.deformation, ANGLE, "strain_unit", strain_unit)
        scaled = f" in {unit_source}"
    else:
        factor = _strain_factor(table, choice, declared, strain_unit)
        scaled = "" if factor == 1 else f" x {factor:g}"
    if is_strain:
        has_unit = bool(declared or strain_unit)
        check_strain(table, choice, values * factor, load, has_unit=has_unit)
        is_doubtful = not has_unit and np.abs(values).max() > DOUBTFUL_STRAIN
        scaled += f" {RATIO_ASSUMED}" if is_doubtful else ""
    elif not is_shear:
        return values * factor, f"stretch = column {label}{scaled}"
    try:
        converted, formula = STRAIN_MEASURES[choice.strain_type].converted(values * factor, is_shear)
    except InputError as error:
        raise InputError(f"{table.place(choice.deformation)}: {error}") from error
    what = "amount of shear" if is_shear else "stretch"
    return converted, f"{what} = {formula.format(f'column {label}{scaled}')}"


def without_machine(
    table: Table,
    choice: ColumnChoice,
    displacement: Column,
    load: Column,
    displacement_unit: str | None,
    compliance: str | None,
    force_unit: str | None,
) -> tuple[Column, str]:
    """Return displacements of the specimen alone, in the unit of the file, and how the machine's were taken off.

    The machine gives way in the direction of the force, that in which it moves the specimen, whatever signs both have.

    Raises
    ------
    InputError
        When the compliance is not a length over a force, or the file does not give displacement and force.
    """
    if compliance is None:
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
    in_newtons, _ = _factor(table, choice.stress, FORCE, "force_unit", force_unit)
    in_mm, _ = _factor(table, choice.deformation, LENGTH, "displacement_unit", displacement_unit)
    per_newton = number * LENGTH.factor(length.strip()) / FORCE.factor(force.strip())
    away = displacement - displacement[0]
    direction = np.sign(away[np.argmax(np.abs(away))] * load[np.argmax(np.abs(load))])
    return (
        displacement - direction * per_newton * in_newtons * load / in_mm,
        f", less {number:g} {unit} of the machine's compliance times the force",
    )


def stress_of(
    table: Table,
    choice: ColumnChoice,
    values: Column,
    dimensions: Dimensions,
    stress_unit: str | None,
    force_unit: str | None,
) -> Load:
    """Return the stresses, of the kind that the file gives, and how they were obtained.

    Raises
    ------
    InputError
        When units contradict each other or are missing, or the cross-section of the specimen is not known.
    """
    label = table.label(choice.stress)
    if choice.load == "torque":
        factor, unit_source = _factor(table, choice.stress, TORQUE, "force_unit", force_unit)
        radius = dimensions.radius
        source = f"apparent stress 2 T / (pi R^3): T = column {label} in {unit_source}, R = {_in_words(radius)}"
        scale = float(apparent_stress(np.array(factor), radius.value))
        return Load(values * scale, units.stress_unit(stress_unit or UNIT_OF_STRESSES_FROM_FORCES), source, scale=scale)
    if choice.load == "pressure":
        factor, unit_source = _factor(table, choice.stress, PRESSURE, "force_unit", force_unit)
        tube, _ = _tube(dimensions)
        source = f"mean stress of the wall p / ln(B/A): p = column {label} in {unit_source}"
        shown, scale = units.stress_unit(stress_unit or UNIT_OF_STRESSES_FROM_FORCES), factor / tube.log_ratio
        return Load(values * scale, shown, source, scale=scale, measure=measure_of_tube(tube), note=tube.note)
    if choice.load == "force":
        if choice.stress_type != "engineering":
            raise InputError(
                f"{table.place(choice.stress)} holds forces, which over the undeformed cross-section are engineering "
                "stress. Leave stress_type (--stress-type) out."
            )
        factor, unit_source = _factor(table, choice.stress, FORCE, "force_unit", force_unit)
        area = dimensions.area
        source = f"engineering stress = column {label} in {unit_source} / {area.value:g} mm2 ({area.source})"
        shown = units.stress_unit(stress_unit or UNIT_OF_STRESSES_FROM_FORCES)
        return Load(values * factor / area.value, shown, source, area.value, factor / area.value)
    sections = sorted(dimensions.set_by_user - {"length"})
    if sections or force_unit is not None:
        unneeded = sections[0] if sections else "force_unit"
        raise InputError(
            f"{table.place(choice.stress)} is read as stress, which needs no {unneeded}. "
            "Leave it out, or name the column of forces: --column force=NAME."
        )
    unit, unit_source = _stress_unit(table, choice, stress_unit, float(np.abs(values).max()))
    source = f"{choice.stress_type} stress from column {label} in {unit_source}"
    return Load(values * unit.to_mpa, unit, source, scale=unit.to_mpa)


def _from_displacement(
    table: Table,
    choice: ColumnChoice,
    values: Column,
    load: Column,
    dimensions: Dimensions,
    unit: str | None,
    zero: str | None,
) -> tuple[Column, str]:
    factor, unit_source = _factor(table, choice.deformation, LENGTH, "displacement_unit", unit)
    in_column = initial_size(table, choice, values) if "length" not in dimensions.sizes else None
    length = in_column or dimensions.length
    displacement, label = values * factor, table.label(choice.deformation)
    start, counted = 0.0, ""
    if zero is not None:
        start = float(displacement[0]) if zero == FIRST_ROW else _position(zero, LENGTH)
        counted = f", counted from {start:g} mm ({'its first row' if zero == FIRST_ROW else 'as given'})"
    elif in_column is None and check_positions(table, choice, displacement, load, length.value):
        start = float(displacement[0])
        counted = f", counted from {start:g} mm {ZERO_ASSUMED}"
    source = f"column {label} in {unit_source}{counted} / {length.value:g} mm (length {length.source})"
    return 1 + (displacement - start) / length.value, f"stretch = 1 + {source}"


def _from_twist(
    table: Table, choice: ColumnChoice, values: Column, dimensions: Dimensions, unit: str | None, zero: str | None
) -> tuple[Column, str]:
    """Return the amount of shear at the rim of a disc, and how it was obtained."""
    factor, unit_source = _factor(table, choice.deformation, ANGLE, "strain_unit", unit)
    radius, height, twist = dimensions.radius, dimensions.length, values * factor
    start, counted = 0.0, ""
    if zero is not None:
        start = float(twist[0]) if zero == FIRST_ROW else _position(zero, ANGLE)
        counted = f", counted from {start:g} rad ({'its first row' if zero == FIRST_ROW else 'as given'})"
    elif abs(twist[0]) > NOTABLE_TWIST * float(np.ptp(twist)):
        raise InputError(
            f"{table.place(choice.deformation, 0)}: the twist begins at {values[0]:g}, not at 0. If the disc is "
            "undeformed there give --zero first, if at 0 --zero '0 rad'."
        )
    source = f"column {table.label(choice.deformation)} in {unit_source}{counted}"
    sizes = f"R = {_in_words(radius)}, H = {_in_words(height)}"
    return (twist - start) * radius.value / height.value, f"amount of shear at the rim = {source} x R / H: {sizes}"


def _from_rate(table: Table, choice: ColumnChoice, values: Column) -> tuple[Column, str]:
    """Return the amount of shear as the integral of its rate over time, by trapezoids, and how it was obtained."""
    from scipy.integrate import cumulative_trapezoid

    times = [column for column in range(len(table.names)) if measured_in(_declared_unit(table, column)) == "time"]
    times = [column for column in times if not table.is_constant(column)]
    if len(times) != 1:
        raise InputError(
            f"{table.place(choice.deformation)} is a rate of shear, which over time makes the amount of shear, but "
            f"{len(times)} columns are times. Add a column of shear to the file (--column shear=NAME)."
        )
    rate, rate_source = _factor(table, choice.deformation, RATE, "strain_unit", None)
    second, _ = _factor(table, times[0], TIME, "strain_unit", None)
    (time,) = table.numbers(times)
    if (np.diff(time) < 0).any():
        row = int(np.argmax(np.diff(time) < 0)) + 1
        raise InputError(f"{table.place(times[0], row)}: the time goes back, so that no shear follows from its rate.")
    shear = cumulative_trapezoid(values * rate, time * second, initial=0.0)
    label, over = table.label(choice.deformation), table.label(times[0])
    return shear, f"amount of shear = integral of column {label} in {rate_source} over {over}, 0 in the first row"


def _in_words(dimension: Dimension) -> str:
    return f"{dimension.value:g} mm ({dimension.source})"


def _from_length(
    table: Table, choice: ColumnChoice, values: Column, dimensions: Dimensions, unit: str | None
) -> tuple[Column, str]:
    """Return current lengths or heights over the undeformed one, or that of the first row, and how that was done."""
    factor, unit_source = _factor(table, choice.deformation, LENGTH, "displacement_unit", unit)
    current = values * factor
    length = dimensions.length if "length" in dimensions.sizes else Dimension(float(current[0]), "in its first row")
    check_lengths(table, choice, current)
    label = table.label(choice.deformation)
    return (
        current / length.value,
        f"stretch = column {label} in {unit_source} / {length.value:g} mm (length {length.source})",
    )


def _from_diameter(
    table: Table, choice: ColumnChoice, values: Column, dimensions: Dimensions, unit: str | None
) -> tuple[Column, str]:
    """Return the hoop stretches in the middle of the wall of a tube, and how they were obtained."""
    factor, unit_source = _factor(table, choice.deformation, LENGTH, "displacement_unit", unit)
    tube, words = _tube(dimensions)
    is_outer = choice.measure == DIAMETERS[0]
    face, letter = (tube.outer, "B") if is_outer else (tube.inner, "A")
    try:
        stretch = tube.stretch(values * factor / 2, face)
    except InputError as error:
        raise InputError(f"{table.place(choice.deformation, int(np.argmin(values)))}: {error}") from error
    side = f"{choice.measure.replace('_', ' ')} d = column {table.label(choice.deformation)} in {unit_source}"
    return stretch, f"hoop stretch in the middle of the wall = sqrt(1 + (d^2/4 - {letter}^2)/(A B)): {side}, {words}"


def _tube(dimensions: Dimensions) -> tuple[Tube, str]:
    """Return the undeformed tube, and its radii in words."""
    diameter, thickness = dimensions.wall_of_tube
    tube = Tube(diameter.value / 2 - thickness.value, diameter.value / 2)
    words = f"A = {tube.inner:g} mm and B = {tube.outer:g} mm (undeformed radii; diameter {diameter.source}, "
    return tube, f"{words}thickness {thickness.source})"


def _position(text: str, quantity: Quantity) -> float:
    """Return the position from which displacements, or the angle from which twists are counted."""
    number, unit = number_and_unit(text)
    if number is None or not unit:
        raise InputError(
            f"zero must be 'first', or a {quantity.name} with its unit such as '35.2 {quantity.unit}', not '{text}'."
        )
    return number * quantity.factor(unit)


def _declared_unit(table: Table, column: int) -> str:
    """Return the unit that the heading or the units row states for a column; empty when neither does.

    Raises
    ------
    InputError
        When both state one and they differ.
    """
    in_heading, beneath = table.stated_units(column)
    if in_heading and beneath and in_heading != beneath and units.looks_like_unit(in_heading):
        raise InputError(
            f"{table.place(column)}: the name says '{in_heading}' but the row of units beneath it says "
            f"'{beneath}'. Correct the file."
        )
    return table.unit(column)


def _factor(table: Table, column: int, quantity: Quantity, option: str, unit: str | None) -> tuple[float, str]:
    """Return the factor from a column's unit of force or length, and the words for where it comes from."""
    declared = _declared_unit(table, column)
    proposed = f"{declared}f" if quantity is FORCE and declared in units.MASSES else quantity.unit
    hint = f"give {option} (--{option.replace('_', '-')} {proposed})"
    if unit is None:
        if not declared:
            raise InputError(f"{table.place(column)}: the file states no unit of {quantity.name}; {hint}.")
        try:
            return quantity.factor(declared), f"{declared} (from the file)"
        except InputError as error:
            raise InputError(f"{table.place(column)}: {error} To say it yourself, {hint}.") from error
    factor = quantity.factor(unit)
    in_file = quantity.factor_or_none(declared)
    if in_file is not None and in_file != factor:
        raise InputError(
            f"{table.place(column)}: {option}='{unit}' is given, but the file says '{declared}'. Leave {option} out, "
            "or correct the file."
        )
    return factor, f"{unit} (as given)"


def _refuse(table: Table, choice: ColumnChoice, option: str, value: str | None) -> None:
    if value is not None:
        role = option.removesuffix("_unit")
        raise InputError(
            f"{table.place(choice.deformation)} is read as {choice.measure}, but {option}='{value}' is "
            f"given. Leave {option} (--{role}-unit) out, or give the column as {role}."
        )


def _strain_factor(table: Table, choice: ColumnChoice, declared: str, strain_unit: str | None) -> float:
    column = table.place(choice.deformation)
    try:
        in_file = units.strain_factor(declared)
    except InputError as error:
        if strain_unit is None:
            hint = " To say it yourself, give strain_unit (--strain-unit)." if choice.measure == "strain" else ""
            raise InputError(f"{column}: {error}{hint}") from error
        declared, in_file = "", 1.0
    if strain_unit is None:
        return in_file
    factor = units.strain_factor(strain_unit)
    if declared and in_file != factor:
        raise InputError(
            f"{column}: strain_unit='{strain_unit}' is given, but the file says '{declared}'. Leave strain_unit "
            "(--strain-unit) out, or correct the file."
        )
    return factor


def _stress_unit(
    table: Table, choice: ColumnChoice, stress_unit: str | None, largest: float
) -> tuple[units.StressUnit, str]:
    """Return the unit of the stresses, the largest of which is given, and the words for where it comes from."""
    declared = _declared_unit(table, choice.stress)
    if stress_unit is not None:
        unit = units.stress_unit(stress_unit)
        in_file = _unit_or_none(declared)
        if in_file and not np.isclose(in_file.to_mpa, unit.to_mpa, rtol=1e-9, atol=0):
            raise InputError(
                f"{table.place(choice.stress)}: stress_unit='{stress_unit}' is given, but the file says "
                f"'{declared}'. Leave stress_unit (--stress-unit) out, or correct the file."
            )
        return unit, f"{unit.name} (as given)"
    if not declared:
        _check_assumed_mpa(table, choice, largest)
        return units.StressUnit("MPa", 1.0), MPA_ASSUMED
    try:
        unit = units.stress_unit(declared)
    except InputError as error:
        raise InputError(
            f"{table.place(choice.stress)}: {error} To say it yourself, give stress_unit (--stress-unit)."
        ) from error
    return unit, f"{unit.name} (from the file)"


def _check_assumed_mpa(table: Table, choice: ColumnChoice, largest: float) -> None:
    """Refuse to take stresses without a unit as MPa where the file speaks of another one, or by their size."""
    texts = {"the name": table.names[choice.stress], "the row of units": " ".join(table.units)}
    texts |= {f"line {line}": text for line, text in table.head}
    mentions = ((where, unit) for where, text in texts.items() for unit in units.stress_units_in(text))
    where, unit = next((mention for mention in mentions if units.stress_unit(mention[1]).to_mpa != 1.0), ("", ""))
    if unit:
        found, likely = f"but {where} speaks of {unit}", unit
    elif largest > LARGEST_ASSUMED_STRESS:
        found, likely = f"and {largest:g} MPa would be more than soft materials bear", "kPa"
    else:
        return
    raise InputError(
        f"{table.place(choice.stress)}: no unit of stress is stated for it, {found}. Give stress_unit={likely!r} "
        f"(--stress-unit {likely}), or whichever it is."
    )


def _unit_or_none(text: str) -> units.StressUnit | None:
    try:
        return units.stress_unit(text) if text else None
    except InputError:
        return None
