"""Units of columns: what the file states, what is given, and what may not be assumed."""

from __future__ import annotations

from collections.abc import Callable
from math import isclose
from typing import Literal

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import ColumnChoice
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.units import FORCE, Quantity

UnitOption = Literal["force_unit", "displacement_unit", "strain_unit", "stress_unit"]
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
    declared = declared_unit(table, column)
    proposed = units.MASSES.get(declared.lower(), quantity.unit) if quantity is FORCE else quantity.unit
    hint = f"give {option} (--{option.replace('_', '-')} {proposed})"
    unit, source = stated_unit(table, column, declared, quantity.factor, option, options, hint)
    if not unit:
        raise InputError(f"{table.place(column)}: the file states no unit of {quantity.name}; {hint}.")
    return quantity.factor(unit), f"{unit} ({source})"


def stated_unit(
    table: Table,
    column: int,
    declared: str,
    factor: Callable[[str], float],
    option: UnitOption,
    options: ReadingOptions,
    hint: str,
) -> tuple[str, str]:
    """Return the unit that an option states for a column, or else the declared one, and where it comes from.

    Raises
    ------
    InputError
        When the declared one is none of what the column holds, with how to say it, or an option states another one.
    """
    given, in_file = options.get(option), None
    try:
        in_file = factor(declared) if declared else None
    except InputError as error:
        if given is None:
            how = f" To say it yourself, {hint}." if hint else ""
            raise InputError(f"{table.place(column)}: {error}{how}") from error
    if given is None:
        return declared, "from the file"
    if in_file is not None and not isclose(in_file, factor(given), rel_tol=1e-9):
        raise InputError(
            f"{table.place(column)}: {option}='{given}' is given, but the file says '{declared}'. Leave {option} "
            f"(--{option.replace('_', '-')}) out, or correct the file."
        )
    return given, "as given"


def stress_unit_of(
    table: Table, choice: ColumnChoice, values: Column, options: ReadingOptions
) -> tuple[units.StressUnit, str]:
    """Return the unit of stresses, and the words for where it comes from."""
    column, declared, hint = choice.stress, declared_unit(table, choice.stress), "give stress_unit (--stress-unit)"
    name, source = stated_unit(
        table, column, declared, lambda text: units.stress_unit(text).to_mpa, "stress_unit", options, hint
    )
    if not name:
        _check_assumed_mpa(table, choice, float(np.abs(values).max()))
        return units.StressUnit("MPa", 1.0), MPA_ASSUMED
    unit = units.stress_unit(name)
    return unit, f"{unit.name} ({source})"


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
