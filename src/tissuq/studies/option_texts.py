"""What is typed as the value of an option: pairs, priors, ranges, numbers, columns and tolerances."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, fields
from math import isnan, nan
from typing import Any

from tissuq.errors import InputError


def once_each(option: str, pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return the pairs of a repeatable option as a dictionary, each name given once."""
    values_by_name: dict[str, Any] = {}
    for name, value in pairs:
        if name in values_by_name:
            raise InputError(f"{option} is given twice for '{name}'; give it once.")
        values_by_name[name] = value
    return values_by_name


def pairs_of(
    option: str, what: str, form: str, value: Callable[[str], Any] = str, *, divided_last: bool = False
) -> Callable[[Sequence[str]], dict[str, Any]]:
    """Return what makes a dictionary of texts like NAME=VALUE.

    ``what`` and ``form`` say in a message what a text is not, and what to write. With ``divided_last`` names may hold
    an equals sign.
    """

    def parse(texts: Sequence[str]) -> dict[str, Any]:
        pairs = []
        for text in texts:
            name, _, of_name = (
                piece.strip() for piece in (text.rpartition("=") if divided_last else text.partition("="))
            )
            if not (name and of_name):
                raise InputError(f"'{text}' is not {what} ({option}); write {form}.")
            pairs.append((name, value(of_name)))
        return once_each(option, pairs)

    return parse


def column(text: str) -> str | int:
    """Return the name of a column or sheet, or its number."""
    return int(text) if text.isdecimal() else text


def columns_by_role(texts: Sequence[str]) -> dict[str, Any]:
    """Return the column of every role; of a role that is given again, for another file, the list of its columns."""
    columns: dict[str, Any] = {}
    parse = pairs_of("--column", "a column", "ROLE=COLUMN, such as stress='Stress (kPa)'", column)
    for text in texts:
        for role, name in parse([text]).items():
            columns[role] = one_or_list([*columns_in(columns.get(role)), name])
    return columns


def columns_in(value: Any) -> list[str | int]:
    """Return the columns of a role as a list: none, one or several."""
    return list(value) if isinstance(value, list | tuple) else [] if value is None else [value]


def one_or_list(names: Iterable[str | int]) -> Any:
    """Return different columns of a role: the only one, or their list."""
    different = list(dict.fromkeys(names))
    return different[0] if len(different) == 1 else different


def number_or_text(text: str) -> float | str:
    """Return a number, or what is none as it is."""
    try:
        return float(text)
    except ValueError:
        return text


def sd_or_unknown(text: str) -> float | str | dict[str, float | str]:
    """Return a standard deviation, or 'unknown'; of several quantities by their names."""
    if "=" in text:
        pairs = (entry.partition("=") for entry in text.split(","))
        return once_each("--noise-sd", ((name.strip(), number_or_text(value.strip())) for name, _, value in pairs))
    value = number_or_text(text)
    if isinstance(value, str) and value != "unknown":
        raise InputError(f"--noise-sd must be a number or unknown, not '{text}'.{_without_unit(text)}")
    return value


def noises(text: str) -> list[float | str]:
    """Return the standard deviations of the noise of every file, with commas, or 'unknown'."""
    if text == "unknown":
        return [text]
    try:
        return [float(number) for number in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"--noise-sd needs a number in the file's stress unit, or 'unknown', not '{text}'.{_without_unit(text)} "
            "For several files, one for each with commas."
        ) from error


def _without_unit(text: str) -> str:
    """Return how a number with a unit is typed where the unit is that of the file; nothing for other texts."""
    from tissuq.experiments.numbers import number_and_unit

    number, unit = number_and_unit(text)
    if unit == "%":
        return " Noise that grows with the stress is --noise proportional, and how much is estimated."
    return f" If the file's stresses are in {unit}, type --noise-sd {number:g}." if unit else ""


def aimed_share(text: str) -> float:
    """Return the share that --aim asks for in a text like 10% or 0.1."""
    number, is_percent = _number_or_percent(text)
    if isnan(number) or (number > 1.0 and not is_percent):  # whoever writes 10 means 10 %
        raise InputError(f"--aim needs a share such as 10% or 0.1, not '{text}'.")
    return number


def _number_or_percent(text: str) -> tuple[float, bool]:
    """Return the number of a text like 10% or 0.1, nan where it is none, and whether it is in percent."""
    is_percent = text.strip().endswith("%")
    number = number_or_text(text.strip().removesuffix("%"))
    return nan if isinstance(number, str) else number * (0.01 if is_percent else 1.0), is_percent


def range_of(option: str, example: str) -> Callable[[str], tuple[float, float]]:
    """Return what makes two numbers of a text like 1:1.2."""

    def parse(text: str) -> tuple[float, float]:
        try:
            low, high = (float(end) for end in text.split(":"))
        except ValueError as error:
            raise InputError(f"{option} needs LOW:HIGH, such as {example}, not '{text}'.") from error
        return low, high

    return parse


def priors(texts: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return priors by parameter, of texts like ``C10=uniform(0, 5)``."""
    return once_each("--prior", map(_prior, texts))


def _prior(text: str) -> tuple[str, dict[str, Any]]:
    from tissuq.parameters.priors import Prior
    from tissuq.registry import find

    match = re.fullmatch(r"\s*(\w+)\s*=\s*([\w-]+)\s*\(([^()]*)\)\s*", text)
    if match is None:
        raise InputError(f"'{text}' is not a prior; write PARAMETER=DISTRIBUTION(NUMBERS), as in C10=uniform(0, 5).")
    symbol, distribution, numbers = match.groups()
    arguments = fields(find(Prior, "prior distribution", distribution, InputError))
    names, needed = [field.name for field in arguments], sum(field.default is MISSING for field in arguments)
    pairs = [number.rpartition("=")[::2] for number in numbers.split(",")] if numbers.strip() else []
    try:
        numbers_by_name = {
            name.strip() or "".join(names[position : position + 1]): float(number)
            for position, (name, number) in enumerate(pairs)
        }
    except ValueError as error:
        raise InputError(f"prior '{text}': the arguments must be numbers, with a decimal point.") from error
    if len(numbers_by_name) < len(pairs) or not {*names[:needed]} <= {*numbers_by_name} <= {*names}:
        optional = f" (and may have {', '.join(names[needed:])})" if names[needed:] else ""
        raise InputError(f"prior '{text}': {distribution} needs {', '.join(names[:needed])}{optional}.")
    return symbol, {"distribution": distribution, **numbers_by_name}


def tolerances(texts: Sequence[str]) -> dict[str, float]:
    """Return tolerances from texts such as ``stress=10%``; an empty one from ``none``."""
    return {} if list(texts) == ["none"] else once_each("--tolerance", map(_tolerance, texts))


def _tolerance(text: str) -> tuple[str, float]:
    from tissuq.model.measurement_errors import measurement_errors

    name, _, number = text.partition("=")
    value, is_percent = _number_or_percent(number)
    name, errors = name.strip(), measurement_errors()
    is_share = name not in errors or not errors[name].is_stress
    if name not in errors or not value >= 0 or (is_share and value > 1) or (not is_share and is_percent):
        names = ", ".join(errors)
        raise InputError(
            f"'{text}' is not a tolerance; write stress=10%, length=2%, slack=0.01, smooth=2%, zero=0.1 or "
            f"stretch=0.001 (the errors are {names}; zero is in the unit of stress of the file)."
        )
    return name, value
