"""What options of reading may be in Python: columns and dimensions by name, the unit of stress, quantities of pint."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.reading.headings import DIMENSION_NAMES
from tissuq.experiments.units import is_quantity, unit_of

__all__ = ["spelled_out"]

COLUMNS = ("stretch", "strain", "displacement", "shear", "twist", "rate", "stress", "torque", "force")
"""Roles of columns that are options by themselves; ``length`` is that of the specimen."""
PARTS = {name: "columns" for role in COLUMNS for name in (role, f"{role}2")} | dict.fromkeys(
    DIMENSION_NAMES, "dimensions"
)
"""Options that are entries of another one."""


def spelled_out(options: Mapping[str, Any], known: Collection[str], others: Collection[str] = ()) -> dict[str, Any]:
    """Return options of reading without those that are entries of others, and with quantities as texts.

    Parameters
    ----------
    options : mapping
        By name.
    known : collection of str
        Names of the options of reading.
    others : collection of str
        Names of other options of the same function.

    Raises
    ------
    InputError
        When there is no option of a name, or something is said twice.

    Examples
    --------
    >>> spelled_out({"force": "Fz", "length": "20 mm", "unit": "kPa"}, ["columns", "dimensions", "stress_unit"])
    {'columns': {'force': 'Fz'}, 'dimensions': {'length': '20 mm'}, 'stress_unit': 'kPa'}
    """
    result: dict[str, Any] = {}
    for name, value in options.items():
        whole = PARTS.get(name) or ("stress_unit" if name == "unit" else name)
        if whole not in known:
            names = [*known, *PARTS, "unit", *others]
            close = get_close_matches(name, names, n=1)
            hint = f" Did you mean '{close[0]}'?" if close else f" There are: {', '.join(names)}."
            raise InputError(f"there is no option '{name}'.{hint}")
        if name in PARTS and value is not None:
            entries = dict(options.get(whole) or {}) | dict(result.get(whole) or {})
            if entries.get(name) is not None:
                raise InputError(f"{name} is given by itself and in {whole}: give it once.")
            result[whole] = entries | {name: _plain(name, value)}
        elif name == "unit" and value is not None:
            if options.get(whole) is not None:
                raise InputError("unit and stress_unit are the same: give one of them.")
            result[whole] = value
        elif name not in PARTS and name != "unit":
            result.setdefault(name, _as_texts(value))
    return result


def _plain(name: str, value: Any) -> str | int:
    """Return what stands for a column (its name or number) or a dimension (a text with a unit)."""
    text = _as_texts(value)
    if not isinstance(text, str | int):
        what = "the name of a column, or its number from 1" if PARTS[name] == "columns" else "such as '10 mm'"
        raise InputError(f"{name} must be {what}, not of type {type(value).__name__}.")
    return text


def _as_texts(value: Any) -> Any:
    """Return a quantity of pint, or those in a mapping, as a text with a unit."""
    if isinstance(value, Mapping):
        return {name: _as_texts(entry) for name, entry in value.items()}
    return f"{float(value.magnitude)!r} {unit_of(value)}" if is_quantity(value) else value
