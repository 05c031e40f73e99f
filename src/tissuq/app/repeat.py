"""What repeats a step of the page: a command of the shell, and lines of Python."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from tissuq.studies.measured_file import ReadingSettings
from tissuq.studies.option import slots_of
from tissuq.studies.option_texts import columns_in

Repeat = dict[str, str]
"""A ``shell`` command and lines of ``python``."""
OF_FILES = ("file", "name", "specimen", "direction", "condition", "noise_sd")
"""Settings of a test that are no options of reading."""
FIT_OPTIONS = ("material", "laws", "discrepancies", "noise_sd", "noise", "estimand", "stable_in", "method", "seed")
IN_SHELL = {"laws": "material", "discrepancies": "discrepancy", "stretch": "at", "stretch2": "at2"}
"""Names of options that are not those of settings."""


def command(verb: str, words: Iterable[str], options: Mapping[str, Any]) -> str:
    """Return a command of the shell; a list is an option that is repeated, and nothing, or false, one left out.

    Examples
    --------
    >>> command("fit", ["a b.csv"], {"mode": "uniaxial", "discrepancies": ["none"], "estimand": None})
    "tissuq fit 'a b.csv' --mode uniaxial --discrepancy none"
    """
    tokens = ["tissuq", verb, *words]
    for name, value in options.items():
        option = f"--{IN_SHELL.get(name, name).replace('_', '-')}"
        values = value if isinstance(value, list | tuple) else [value]
        for item in values:
            if item is not None and item is not False and item != "":
                tokens += [option] if item is True else [option, f"{item}"]
    return shlex.join(tokens)


def reading_words(reading: Mapping[str, Any]) -> list[str]:
    """Return the options of the shell that say how files are read.

    Examples
    --------
    >>> reading_words({"columns": {"stress": "P"}, "dimensions": {"length": "20 mm"}, "stretch_range": (1, 1.2)})
    ['--column', 'stress=P', '--length', '20 mm', '--stretch', '1:1.2']
    """
    words: list[str] = []
    for slot in slots_of(ReadingSettings):
        value = reading.get(slot.path[0])
        value = (value or {}).get(slot.path[1]) if slot.path[1:] else value
        if isinstance(value, bool):
            words += [slot.typed] if value else [f"--{slot.option.negative}"] * bool(slot.option.negative)
        elif isinstance(value, Mapping):
            pairs = [(key, item) for key, items in value.items() for item in columns_in(items)]
            words += [word for key, item in pairs for word in (slot.typed, f"{key}={item}")]
        elif isinstance(value, tuple | list):
            words += [slot.typed, ":".join(f"{end:.12g}" for end in value)]
        elif value is not None:
            words += [slot.typed, str(value)]
    return words


def fit_lines(settings: Mapping[str, Any], unit: str) -> str:
    """Return the Python that fits what the settings of a fit, or of a comparison of laws, say.

    Parameters
    ----------
    settings : mapping
        Of `tissuq.studies.specimen.SpecimenSettings` or `LawSettings`, without what is left to the default.
    unit : str
        Unit of stress of the first test, in which the settings are.
    """
    tests = settings.get("tests") or [{name: settings[name] for name in settings if name not in FIT_OPTIONS}]
    reads = list(map(_read, tests))
    data = reads[0] if len(reads) == 1 else "[\n" + "".join(f"    {read},\n" for read in reads) + "]"
    options = ", ".join(f"{name}={value}" for name, value in _fit_options(settings, unit))
    lines = ["import tissuq as tq", "", f"data = {data}"]
    if "laws" in settings:
        laws = list(settings["laws"])
        named = "all" if laws == ["all"] else laws
        call = f"tq.fit_laws(data, {named!r}{', ' * bool(options)}{options})"
        return "\n".join([*lines, f"comparison = {call}", "print(comparison.table)"])
    return "\n".join([*lines, f"posterior = tq.fit(data{', ' * bool(options)}{options})", "print(posterior.answer)"])


def _fit_options(settings: Mapping[str, Any], unit: str) -> Iterator[tuple[str, str]]:
    for name in FIT_OPTIONS:
        value = settings.get(name)
        if name == "laws" or value is None:
            continue
        if name == "noise_sd":
            yield name, repr(value if value == "unknown" else f"{value:.12g} {unit}")
        elif name == "discrepancies":
            yield "discrepancy", repr(value[0])
        elif name == "estimand":
            yield "tolerances", repr(value)
        else:
            yield name, repr(list(value) if isinstance(value, tuple) else value)


def _read(test: Mapping[str, Any]) -> str:
    """Return the Python that reads a test."""
    options = [
        f"{name}={_plain(value)!r}" for name, value in test.items() if name not in OF_FILES and value not in (None, {})
    ]
    labels = [f"{name}={test[name]!r}" for name in ("specimen", "direction", "condition") if test.get(name)]
    read = f"tq.read({', '.join([repr(test['file']), *options])})"
    return f"{read}.labelled({', '.join(labels)})" if labels else read


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
