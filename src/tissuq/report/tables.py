"""Rows as numbers in files, and numbers as text: digits that count, units, percentages."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from math import floor, inf, isfinite, log10
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tissuq.arrays import FloatArray
from tissuq.experiments.units import StressUnit

Row = dict[str, Any]

MAX_DIGITS = 5
"""Of the ends of an interval: of what is measured, no number is known better."""
SMALLEST_PLAIN = 1e-4
"""Below it numbers have an exponent, as `significant` writes them: leading zeros cannot be counted."""
UNIT = "unit"
"""What rows call the unit of their stresses; without it these are in MPa."""


def in_unit_of(rows: Sequence[Row], columns: Sequence[str], unit: StressUnit) -> list[Row]:
    """Return rows whose columns in MPa are in another unit, which stands among them."""
    return [
        {name: value / unit.to_mpa if name in columns and value is not None else value for name, value in row.items()}
        | {UNIT: unit.name}
        for row in rows
    ]


def with_named_units(rows: Sequence[Row], columns: Sequence[str], unit: StressUnit) -> list[Row]:
    """Return rows whose columns in MPa are in another unit, which stands in the names of these columns."""
    names = {name: f"{name} [{unit.name}]" for name in columns}
    return [
        {names.get(name, name): value for name, value in row.items() if name != UNIT}
        for row in in_unit_of(rows, columns, unit)
    ]


def table_files(name: str, rows: Sequence[Row], columns: Sequence[str], unit: StressUnit) -> dict[str, list[Row]]:
    """Return rows whose columns are in MPa as files in another unit: CSV with it in the heads, and JSON with it."""
    return {f"{name}.csv": with_named_units(rows, columns, unit), f"{name}.json": in_unit_of(rows, columns, unit)}


def rows_of(columns: Mapping[str, FloatArray], labels: Mapping[str, Any] = MappingProxyType({})) -> list[Row]:
    """Return columns of numbers as rows, each with labels before them; None for numbers that are missing."""
    values = zip(*(map(known_number, column.tolist()) for column in columns.values()), strict=True)
    return [{**labels, **dict(zip(columns, row, strict=True))} for row in values]


def known_number(number: float) -> float | None:
    """Return a number, None for one that is missing."""
    return None if number != number else float(number)


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write rows as CSV; floats in full, nothing for None."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write_json(path: Path, content: Sequence[Row] | Mapping[str, Any]) -> None:
    """Write rows, or one record, as JSON, which knows neither nan nor infinity: null stands for both."""
    path.write_text(json.dumps(_finite(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number for people: some significant digits, an exponent from a million and below 0.0001."""
    if value is None:
        return ""
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e6 else text


def interval(low: float, high: float, sd: float) -> tuple[str, str]:
    """Return the ends of an interval with the decimals that its width supports, and at most five digits."""
    largest = max(abs(low), abs(high))
    if 0 < largest < SMALLEST_PLAIN and not sd > 0:
        sd = largest / 10  # three digits, where no width says how many
    decimals = max(0, 1 - floor(log10(sd))) if sd > 0 else 3
    if 0 < largest < inf:
        decimals = min(decimals, MAX_DIGITS - 1 - floor(log10(largest)))
    low, high = (round(end, decimals) + 0.0 for end in (low, high))  # no minus before a zero
    if 0 < largest < SMALLEST_PLAIN and sd < SMALLEST_PLAIN:
        return _with_exponent(low, decimals), _with_exponent(high, decimals)
    shown = max(0, decimals)
    return f"{low:.{shown}f}", f"{high:.{shown}f}"


def _with_exponent(number: float, decimals: int) -> str:
    return f"{number:.{max(0, decimals + floor(log10(abs(number))))}e}" if number else "0"


def percent(probability: float | None) -> str:
    """Return a share as a percentage; nothing for one that is missing."""
    return "" if probability is None else f"{100 * probability:.0f} %"


def stretch_in_words(median: float | None, low: float | None, high: float | None) -> str:
    """Return a stretch with its interval."""
    return "" if median is None else f"{median:#.3g} [{low:#.3g}, {high:#.3g}]"
