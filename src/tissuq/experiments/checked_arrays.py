"""Arrays of stretches and stresses as people give them, checked once, and tables of stresses in the unit they read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.numbers import number_and_unit
from tissuq.experiments.pint_units import is_quantity, unit_of
from tissuq.experiments.units import StressUnit, stress_unit

if TYPE_CHECKING:
    import pandas as pd

LARGE_STRETCH = 10.0
"""Stretch beyond which lengths are likely mistaken, or percent are meant."""
LEAST_PERCENT = 30.0
"""Beginning of a range of stretches or amounts of shear from which percent are meant."""
CONVERSION_ERROR = 1e-9
"""Largest difference, as a share of the largest value, between the same measurements converted from two units."""
FOUR_DIGITS = 5e-4
"""That between the same measurements in files of other digits: rounding to four, less than any machine resolves."""


def agree(values: FloatArray, others: FloatArray, share: float = CONVERSION_ERROR) -> bool:
    """Return whether two arrays are of one shape, and nowhere differ by more than a share of the largest value."""
    return values.shape == others.shape and bool(
        np.abs(values - others).max(initial=0.0) <= share * np.abs(values).max(initial=0.0)
    )


def check_no_percent(text: str, beginning: float, example: str) -> None:
    """Refuse a text about stretches or amounts of shear that begin where percent are meant."""
    if beginning >= LEAST_PERCENT:
        raise InputError(
            f"'{text}' begins at {beginning:g}: write stretches (or amounts of shear) as {example}, not in percent."
        )


def checked_points(mode: LoadingMode, points: ArrayLike) -> FloatArray:
    """Return points of a mode as an array (n,), or (n, c) where the mode has c controls.

    Raises
    ------
    InputError
        When it is not of this shape, or holds what is no value of a control.
    """
    values = checked("stretch", _magnitude(points, "dimensionless"), [control.name for control in mode.controls])
    for control, column in zip(mode.controls, values.reshape(len(values), -1).T, strict=True):
        low = np.flatnonzero(column <= control.above)
        if len(low):
            raise InputError(
                f"{control.name} {column[low[0]]:g} at position {low[0]} is not positive. "
                "A stretch is deformed over undeformed length; if this is a strain, add 1."
            )
    return values


def in_mpa(stress: Any, unit: str | None) -> tuple[Any, str]:
    """Return stresses in MPa, and the unit in which people want to read them."""
    if is_quantity(stress):
        return _magnitude(stress, "megapascal"), stress_unit(unit or unit_of(stress)).name
    shown = stress_unit(unit or "MPa")
    return _numbers("stress", stress) * shown.to_mpa, shown.name


def stress_in_mpa(stress: Any) -> Any:
    """Return a stress in MPa that is a text with its unit or a quantity of pint; anything else as it is.

    Raises
    ------
    InputError
        When a text is a number without a unit, or its unit or that of a quantity is none of stress.

    Examples
    --------
    >>> stress_in_mpa("0.02 kPa"), stress_in_mpa(0.5), stress_in_mpa("unknown")
    (2e-05, 0.5, 'unknown')
    """
    if is_quantity(stress):
        return stress.magnitude * stress_unit(unit_of(stress)).to_mpa
    number, unit = number_and_unit(stress) if isinstance(stress, str) else (None, "")
    if number is None:
        return stress
    if not unit:
        raise InputError(f"'{stress}' has no unit: write it with one, such as '{stress} kPa', or as a number of MPa.")
    return number * stress_unit(unit).to_mpa


def _magnitude(values: Any, unit: str) -> Any:
    """Return a quantity of pint as numbers in a unit; anything else as it is."""
    if not is_quantity(values):
        return values
    if not values.is_compatible_with(unit):
        raise InputError(f"values in '{values.units}' were given where {unit} was expected.")
    return values.to(unit).magnitude


def _numbers(name: str, values: Any) -> FloatArray:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error


def checked(name: str, values: Any, columns: Sequence[str]) -> FloatArray:
    """Return an array of finite numbers, (n,) or with several columns (n, k), that cannot be changed."""
    array = _numbers(name, values)
    count = len(columns)
    if array.ndim != min(count, 2) or not array.size or array.shape[1:] != (count,)[: array.ndim - 1]:
        form = f"an array with {count} columns ({', '.join(columns)})" if count > 1 else "a one-dimensional array"
        raise InputError(f"{name} must be {form} with values, not of shape {array.shape}.")
    for column, numbers in zip(columns, array.reshape(len(array), -1).T, strict=True):
        bad = np.flatnonzero(~np.isfinite(numbers))
        if len(bad):
            raise InputError(
                f"{column} is {numbers[bad[0]]} at position {bad[0]}; every value must be a finite number."
            )
    array.flags.writeable = False
    return array


def in_unit(table: pd.DataFrame, columns: Sequence[str], unit: str) -> pd.DataFrame:
    """Return a table whose columns in MPa are in another unit of stress, which stands at the head of the columns.

    Raises
    ------
    InputError
        When it is no unit of stress.

    Examples
    --------
    >>> import pandas as pd
    >>> print(in_unit(pd.DataFrame({"stretch": [1.1], "low": [0.002]}), ["low"], "kPa"))
    stresses in kPa  stretch  low
    0                    1.1  2.0
    """
    shown = stress_unit(unit)
    return headed(table.assign(**{name: table[name] / shown.to_mpa for name in columns}), shown)


def headed(table: pd.DataFrame, unit: StressUnit) -> pd.DataFrame:
    """Return a table with the unit of its stresses at the head of its columns, as their name."""
    return table.rename_axis(columns=f"stresses in {unit.name}")
