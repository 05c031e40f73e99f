"""Units of columns: what the file states, what is given, and what may not be assumed."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import ColumnChoice
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.units import FORCE, Quantity

UnitOption = Literal["force_unit", "displacement_unit", "strain_unit"]
"""Options of reading that state the unit of a column."""
MPA_ASSUMED = "MPa (assumed: the file states no unit)"
LARGEST_ASSUMED_STRESS = 100.0
"""Largest stress, MPa, of a soft material: numbers beyond it that have no unit are not taken as MPa."""


def declared_unit(table: Table, column: int) -> str:
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


def factor_of(
    table: Table, column: int, quantity: Quantity, option: UnitOption, options: ReadingOptions
) -> tuple[float, str]:
    """Return the factor from a column's unit, which an option may state, and the words for where it comes from."""
    unit, declared = options.get(option), declared_unit(table, column)
    if unit is not None:
        factor, in_file = quantity.factor(unit), quantity.factor_or_none(declared)
        if in_file is not None and in_file != factor:
            raise _says_another(table, column, option, unit, declared)
        return factor, f"{unit} (as given)"
    proposed = units.MASSES.get(declared.lower(), quantity.unit) if quantity is FORCE else quantity.unit
    hint = f"give {option} (--{option.replace('_', '-')} {proposed})"
    if not declared:
        raise InputError(f"{table.place(column)}: the file states no unit of {quantity.name}; {hint}.")
    try:
        return quantity.factor(declared), f"{declared} (from the file)"
    except InputError as error:
        raise InputError(f"{table.place(column)}: {error} To say it yourself, {hint}.") from error


def strain_factor_of(table: Table, choice: ColumnChoice, declared: str, options: ReadingOptions) -> float:
    """Return what one unit of a column of strains is as a plain ratio."""
    strain_unit = options.get("strain_unit")
    try:
        in_file = units.strain_factor(declared)
    except InputError as error:
        if strain_unit is None:
            hint = " To say it yourself, give strain_unit (--strain-unit)." if choice.measure == "strain" else ""
            raise InputError(f"{table.place(choice.deformation)}: {error}{hint}") from error
        declared, in_file = "", 1.0
    if strain_unit is None:
        return in_file
    factor = units.strain_factor(strain_unit)
    if declared and in_file != factor:
        raise _says_another(table, choice.deformation, "strain_unit", strain_unit, declared)
    return factor


def stress_unit_of(
    table: Table, choice: ColumnChoice, values: Column, options: ReadingOptions
) -> tuple[units.StressUnit, str]:
    """Return the unit of stresses, and the words for where it comes from."""
    declared, stress_unit = declared_unit(table, choice.stress), options.get("stress_unit")
    if stress_unit is None and not declared:
        _check_assumed_mpa(table, choice, float(np.abs(values).max()))
        return units.StressUnit("MPa", 1.0), MPA_ASSUMED
    try:
        in_file = units.stress_unit(declared)
    except InputError as error:
        if stress_unit is None:
            hint = "To say it yourself, give stress_unit (--stress-unit)."
            raise InputError(f"{table.place(choice.stress)}: {error} {hint}") from error
        return (unit := units.stress_unit(stress_unit)), f"{unit.name} (as given)"
    if stress_unit is None:
        return in_file, f"{in_file.name} (from the file)"
    unit = units.stress_unit(stress_unit)
    if not np.isclose(in_file.to_mpa, unit.to_mpa, rtol=1e-9, atol=0):
        raise _says_another(table, choice.stress, "stress_unit", stress_unit, declared)
    return unit, f"{unit.name} (as given)"


def _says_another(table: Table, column: int, option: str, unit: str, declared: str) -> InputError:
    """Return that an option states another unit of a column than the file."""
    flag = f"--{option.replace('_', '-')}"
    return InputError(
        f"{table.place(column)}: {option}='{unit}' is given, but the file says '{declared}'. Leave {option} ({flag}) "
        "out, or correct the file."
    )


def _check_assumed_mpa(table: Table, choice: ColumnChoice, largest: float) -> None:
    """Refuse to take stresses without a unit as MPa where the file speaks of another one, or by their size."""
    texts = {"the name": table.names[choice.stress], "the row of units": " ".join(table.units)}
    texts |= {f"line {line}": text for line, text in table.head}
    mentions = ((source, unit) for source, text in texts.items() for unit in units.stress_units_in(text))
    source, unit = next((mention for mention in mentions if units.stress_unit(mention[1]).to_mpa != 1.0), ("", ""))
    if unit:
        reason, likely = f"but {source} speaks of {unit}", unit
    elif largest > LARGEST_ASSUMED_STRESS:
        reason = f"and {largest:g} MPa would be more than soft materials bear"
        likely = "kPa" if largest <= 1e3 * LARGEST_ASSUMED_STRESS else "Pa"
    else:
        return
    raise InputError(
        f"{table.place(choice.stress)}: no unit of stress is stated for it, {reason}. Give stress_unit={likely!r} "
        f"(--stress-unit {likely}), or whichever it is."
    )
