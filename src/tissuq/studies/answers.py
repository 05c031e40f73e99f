"""What a message proposes to type, as answers: options in its text, and the columns that they may name."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.numbers import number_in
from tissuq.studies.measured_file import ReadingSettings
from tissuq.studies.option import slots_of, stated
from tissuq.studies.option_texts import columns_in, one_or_list
from tissuq.studies.settings import imported

READING = {slot.typed.removeprefix("--"): slot for slot in slots_of(ReadingSettings)}
"""How every option of reading is taken, by its name; that which says no stands for the same setting."""
READING |= {slot.option.negative: slot for slot in READING.values() if slot.option.negative}
SWITCHES = {name: name != slot.option.negative for name, slot in READING.items() if slot.reads is bool}
"""Options without a value, and what they say."""
DIMENSIONS = tuple(name for name, slot in READING.items() if slot.path[0] == "dimensions")
"""Options that are sizes."""
TYPED = (*DIMENSIONS, "axial-stretch")
"""Options whose values a person must type: of which messages show examples."""
OTHER_ROLES = re.compile(r"\(or ((?:\w+=(?:, | or )?)+)\)")
"""As in ``--column stress=NAME (or force=)``."""
PLACEHOLDERS = ("NAME", "NUMBER")
CHOICES = {
    "mode": "tissuq.experiments.modes:loading_modes",
    "strain-type": "tissuq.experiments.reading.measures:STRAIN_MEASURES",
    "stress-type": "tissuq.experiments.reading.measures:STRESS_MEASURES",
}
"""Options of which there is a list of values, and what has or returns it."""


@dataclass(frozen=True)
class Answer:
    """Options that a person may choose, as they are typed: with their values, or without where these are asked for.

    ``leaves_out`` is the setting that the answer takes away.
    """

    options: tuple[tuple[str, str], ...]
    leaves_out: str = ""

    @property
    def asked_for(self) -> tuple[str, ...]:
        """The options whose values a person must type."""
        return tuple(name for name, _ in self.options if name in TYPED)

    @property
    def text(self) -> str:
        """The options as they are typed."""
        if self.leaves_out:
            return f"leave {self.options[0][0]} out"
        words = [f"--{name}" if name in TYPED or not value else f"--{name} {shlex.quote(value)}"
                 for name, value in self.options]  # fmt: skip
        return " ".join(words)


def answers_in(message: str, columns: Sequence[str], settings: Mapping[str, Any]) -> list[Answer]:
    """Return what a message proposes, in its order, each once.

    Parameters
    ----------
    message : str
    columns : sequence of str
        Names of the columns of the file, which stand for the placeholder NAME.
    settings : mapping
        Those that are given already, which a message may propose to leave out.

    Examples
    --------
    >>> found = answers_in("Say which: --stress-unit kPa, or --stress-unit MPa.", [], {})
    >>> [answer.text for answer in found]
    ['--stress-unit kPa', '--stress-unit MPa']
    """
    from tissuq.experiments.reading.python_form import OPTION, WORDS

    answers: list[Answer] = []
    end = -1
    for match in re.finditer(OPTION, message):
        name, value = match["name"], (match["value"] or "").rstrip(".:")
        if name not in READING:
            continue
        value = "" if name in SWITCHES else "".join(shlex.split(value)) if value.count("'") % 2 == 0 else value
        value = "" if value in WORDS else value
        is_joined = match.start() == end + 1 and answers and not answers[-1].leaves_out
        end = match.start() + len(f"--{name}") if name in SWITCHES else match.end()
        if not value and "eave" in message[: match.start()].rpartition(". ")[2]:
            setting = READING[name].path[-1]
            if {**settings, **(settings.get("dimensions") or {})}.get(setting) is not None:
                answers.append(Answer(((f"--{name}", ""),), setting))
        elif name == "column":
            others = OTHER_ROLES.match(message[match.end() :].lstrip())
            roles = [value.partition("=")[0], *re.findall(r"(\w+)=", others[1] if others else "")]
            names = list(filter(None, columns)) if value.partition("=")[2] in PLACEHOLDERS else []
            pairs = [f"{role}={column}" for role in roles for column in names] if names else [value]
            before = answers.pop().options if is_joined and pairs == [value] else ()
            answers += [Answer((*before, ("column", pair))) for pair in pairs]
        elif name in CHOICES and not value:
            choices = imported(CHOICES[name])
            answers += [Answer(((name, choice),)) for choice in (choices() if callable(choices) else choices)]
        elif value or name in SWITCHES or name in TYPED:
            if is_joined:
                answers[-1] = Answer((*answers[-1].options, (name, value)))
            else:
                answers.append(Answer(((name, value),)))
    return list(dict.fromkeys(answers))


def options_in(text: str) -> tuple[tuple[str, str], ...]:
    """Return the options that a person has typed, with their values.

    Raises
    ------
    InputError
        When there is something else than options of reading, or a value is missing.

    Examples
    --------
    >>> options_in("--length '20 mm' --compression-positive")
    (('length', '20 mm'), ('compression-positive', ''))
    """
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise InputError(f"'{text}' cannot be understood: {error}.") from error
    options: list[tuple[str, str]] = []
    while words:
        name = words.pop(0)
        plain = name.removeprefix("--")
        if plain == name or plain not in READING:
            raise InputError(f"'{name}' is no option of reading; write one such as --length '20 mm'.")
        if plain not in SWITCHES and not words:
            raise InputError(f"{name} needs a value.")
        options.append((plain, "" if plain in SWITCHES else words.pop(0)))
    return tuple(options)


def with_options(settings: Mapping[str, Any], answer: Answer, columns: Sequence[str] = ()) -> dict[str, Any]:
    """Return settings of reading with those of an answer, added to columns, sizes and rows that are given already.

    An answer for a file with some ``columns`` replaces what was said of a role there, and not what of other files.
    """
    if answer.leaves_out:
        sizes = {name: size for name, size in (settings.get("dimensions") or {}).items() if name != answer.leaves_out}
        remaining = {name: value for name, value in settings.items() if name != answer.leaves_out}
        return {**remaining, "dimensions": sizes or None}
    values: dict[str, Any] = {}
    for name, value in answer.options:
        slot = READING[name]
        if slot.reads is int and value.isdecimal():
            values[slot.name] = int(value)
        elif slot.reads is float:
            if isnan(number := number_in(value)):
                raise InputError(f"--{name} needs a number such as 1.5, not '{value}'.")
            values[slot.name] = number
        elif slot.reads in (str, int):
            values[slot.name] = value
        else:
            values[slot.name] = SWITCHES[name] if name in SWITCHES else [*values.get(slot.name, []), value]
    merged = dict(settings)
    for setting, value in stated(READING.values(), values)[0].items():
        earlier = merged.get(setting)
        if setting == "columns" and columns:
            added = {role: one_or_list([*_elsewhere(earlier, role, columns), name]) for role, name in value.items()}
            merged[setting] = {**(earlier or {}), **added}
            continue
        merged[setting] = {**earlier, **value} if isinstance(value, dict) and isinstance(earlier, dict) else value
    return merged


def _elsewhere(said: Mapping[str, Any] | None, role: str, columns: Sequence[str]) -> list[str | int]:
    """Return the columns that are said of a role, but for those in a file with some columns."""
    return [name for name in columns_in((said or {}).get(role)) if isinstance(name, str) and name not in columns]
