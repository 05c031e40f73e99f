"""From the numbers of a column to stress: of stresses, forces, torques and pressures, with their units and sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.numbers import number_and_unit
from tissuq.experiments.reading.column_units import factor_of, stress_unit_of
from tissuq.experiments.reading.dimensions import Dimensions, in_words
from tissuq.experiments.reading.measures import StressMeasure, measure_of_tube
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.plausibility import FIRST_ROW
from tissuq.experiments.reading.recognition import TOTAL_FORCE, ColumnChoice
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.twisted_disc import apparent_stress
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH
from tissuq.experiments.units import FORCE, FORCE_PER_WIDTH, PRESSURE, TORQUE, Quantity, measured_in

UNIT_OF_STRESSES_FROM_FORCES = "kPa"
"""The unit in which stresses from forces are shown unless another is asked for."""


@dataclass(frozen=True, eq=False)
class Load:
    """The stress (MPa), the unit in which people want to read it, and how it was obtained.

    ``divided`` is what was divided by a size of the specimen, ``by`` (mm² for forces, mm for those per width); None
    where the file gives stresses. ``scale`` is what one unit of the column is in MPa. ``measure`` is that of stresses
    whose conversion needs more than their columns, and ``note`` what to know of them.
    """

    stress: Column
    unit: units.StressUnit
    source: str
    divided: Quantity | None = None
    by: float = 1.0
    scale: float = 1.0
    measure: StressMeasure | None = None
    note: str = ""

    def stress_in(self, preload: str) -> float:
        """Return a preload, a force or a stress with its unit, as a stress in MPa.

        Raises
        ------
        InputError
            When it is no positive number with a unit of force or stress, or a force where the file gives stresses.

        Examples
        --------
        >>> forces = Load(np.array([0.1]), units.stress_unit("kPa"), "", divided=FORCE, by=10.0)
        >>> forces.stress_in("0.05 N"), forces.stress_in("2 kPa")
        (0.005, 0.002)
        """
        if self.measure is not None:
            raise InputError(
                f"preload '{preload}' (--preload) does not go with the pressure in a tube. Give the outer diameter "
                "that it has without pressure as --diameter, and leave rows out with --stretch or --leave-out."
            )
        number, unit = number_and_unit(str(preload))
        if number is None or number <= 0 or not unit:
            raise InputError(
                f"preload must be a positive force or stress with its unit, such as '0.05 N', not '{preload}'."
            )
        quantities = [self.divided] if self.divided else [FORCE, FORCE_PER_WIDTH]
        if unit.lower() not in units.MASSES and all(quantity.factor_or_none(unit) is None for quantity in quantities):
            return number * units.stress_unit(unit).to_mpa
        if self.divided is None:
            raise InputError(f"preload '{preload}' is a force, but the file gives stresses; give it as a stress.")
        return number * self.divided.factor(unit) / self.by


def stress_of(
    table: Table, choice: ColumnChoice, values: Column, dimensions: Dimensions, options: ReadingOptions
) -> Load:
    """Return the stresses, of the kind that the file gives, and how they were obtained.

    Raises
    ------
    InputError
        When units contradict each other or are missing, or the cross-section of the specimen is not known.
    """
    label = table.label(choice.stress)
    if choice.load == "torque":
        factor, unit_source = factor_of(table, choice.stress, TORQUE, "force_unit", options)
        radius = dimensions.radius
        source = f"apparent stress 2 T / (pi R^3): T = column {label} in {unit_source}, R = {in_words(radius)}"
        scale = float(apparent_stress(np.array(factor), radius.value))
        return Load(values * scale, _unit_shown(options), source, scale=scale)
    if choice.load == "pressure":
        factor, unit_source = factor_of(table, choice.stress, PRESSURE, "force_unit", options)
        tube, _ = dimensions.tube
        source = f"mean stress of the wall p / ln(B/A): p = column {label} in {unit_source}"
        scale = factor / tube.log_ratio
        return Load(values * scale, _unit_shown(options), source, scale=scale, measure=measure_of_tube(tube))
    if choice.measure == ROLE_OF_AXIAL_STRETCH:
        factor, unit_source = factor_of(table, choice.stress, FORCE, "force_unit", options)
        tube, _ = dimensions.tube
        source = f"mean stress of the wall f / (pi (B^2 - A^2)): f = column {label} in {unit_source}"
        scale = factor / tube.section
        return Load(values * scale, _unit_shown(options), source, divided=FORCE, by=tube.section, scale=scale)
    if choice.load == "force":
        if choice.stress_type != "engineering":
            raise InputError(
                f"{table.place(choice.stress)} holds forces, which over the undeformed cross-section are engineering "
                "stress. Leave stress_type (--stress-type) out."
            )
        divided = force_in(table, choice.stress, options)
        factor, unit_source = factor_of(table, choice.stress, divided, "force_unit", options)
        size, of_size = (dimensions.area, "mm2") if divided is FORCE else (dimensions.thickness, "mm")
        source = f"engineering stress = column {label} in {unit_source} / {size.value:g} {of_size} ({size.source})"
        return Load(
            values * factor / size.value, _unit_shown(options), source, divided, size.value, factor / size.value
        )
    sections = sorted(dimensions.set_by_user - {"length"})
    if sections or options.get("force_unit") is not None:
        unneeded = sections[0] if sections else "force_unit"
        raise InputError(
            f"{table.place(choice.stress)} is read as stress, which needs no {unneeded}. "
            "Leave it out, or name the column of forces: --column force=NAME."
        )
    unit, unit_source = stress_unit_of(table, choice, values, options)
    source = f"{choice.stress_type} stress from column {label} in {unit_source}"
    return Load(values * unit.to_mpa, unit, source, scale=unit.to_mpa)


def _unit_shown(options: ReadingOptions) -> units.StressUnit:
    """Return the unit in which people want to read stresses that the file does not state."""
    return units.stress_unit(options.get("stress_unit") or UNIT_OF_STRESSES_FROM_FORCES)


def force_in(table: Table, column: int, options: ReadingOptions) -> Quantity:
    """Return what a column of forces holds by its unit, or the one that is given: forces, or forces per width."""
    is_per_width = FORCE_PER_WIDTH.factor_or_none(options.get("force_unit") or table.unit(column)) is not None
    return FORCE_PER_WIDTH if is_per_width else FORCE


def meant_for(choice: ColumnChoice, choices: Sequence[ColumnChoice], options: ReadingOptions) -> ReadingOptions:
    """Return the options without the unit and the zero of a load that are meant for the other one of a tube.

    Raises
    ------
    InputError
        When nothing tells for which of both the zero is.
    """
    if len(choices) < 2 or choices[0].load != PRESSURE.name:
        return options
    own, zero = options.copy(), options.get("load_zero")
    if zero == FIRST_ROW:
        raise InputError(
            "load_zero='first' (--load-zero first) does not say whether it is of the pressure or of the axial force: "
            "give it as a number with its unit, such as --load-zero '0.02 N'."
        )
    of_pressure = choice.load == PRESSURE.name
    for option, unit in (("force_unit", options.get("force_unit")), ("load_zero", number_and_unit(str(zero))[1])):
        if unit and (PRESSURE.factor_or_none(unit) is not None) is not of_pressure:
            own |= {option: None}  # type: ignore[misc]  # the name of one of its options
    return own


def without_ends(load: Load, of_ends: Column) -> Load:
    """Return the stress of a reduced force for that of the whole one, less the force of pressure on the closed ends."""
    return replace(load, stress=load.stress - of_ends, source=f"{load.source}, less the pressure on the ends pi a^2 p")


def without_zero(table: Table, choice: ColumnChoice, values: Column, options: ReadingOptions) -> tuple[Column, str]:
    """Return the loads of a column, in its unit, less what the load cell reads without load, and words that say so.

    Raises
    ------
    InputError
        When that is not ``first``, or a number with a unit of what the column holds.
    """
    load_zero = options.get("load_zero")
    if load_zero is None:
        return values, ""
    if load_zero == FIRST_ROW:
        return values - values[0], f", counted from {values[0]:g} (its first row)"
    number, unit = number_and_unit(str(load_zero))
    quantities = {"force": force_in(table, choice.stress, options), "torque": TORQUE, "pressure": PRESSURE}
    quantities |= {TOTAL_FORCE: FORCE}
    quantity = quantities.get(choice.load)
    example = f"0.05 {quantity.unit if quantity else 'kPa'}"
    if number is None or not unit or measured_in(unit) not in (choice.load, "stress", "pressure", "force per width"):
        raise InputError(
            f"load_zero (--load-zero) must be 'first', or a {choice.load} with its unit such as '{example}', not "
            f"'{load_zero}'."
        )
    if quantity is None:
        of_column, _ = stress_unit_of(table, choice, values, options)
        offset = number * units.stress_unit(unit).to_mpa / of_column.to_mpa
    else:
        offset = number * quantity.factor(unit) / factor_of(table, choice.stress, quantity, "force_unit", options)[0]
    return values - offset, f", counted from {number:g} {unit} (as given)"
