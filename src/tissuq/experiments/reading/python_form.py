"""Messages of functions that read propose what a person types in Python: arguments, not options of the shell."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from json import dumps
from typing import Any

from tissuq.errors import InputError
from tissuq.experiments.reading.data_frame import is_data_frame
from tissuq.experiments.reading.options import PARTS

SWITCHES = {
    "compression-positive": "compression_positive=True",
    "tension-positive": "compression_positive=False",
    "until-peak": "until_peak=True",
    "relaxed": "relaxed=True",
    "incompressible": "incompressible=True",
}
"""Options without a value."""
NUMBERS = ("every", "table", "mean-of", "cycle", "axial-stretch", "skip-rows", "sheet")
"""Options whose values are numbers in Python, where they are numbers."""
STRESS_AT_REST = "zero"
"""The error of a test, of those that messages propose, whose size is a stress."""
OTHER_NAMES = {"stretch": "stretch_range"}
"""Arguments that are not called as their options are."""
WORDS = frozenset(["or", "and", "for", "to", "with", "of", "as", "in", "where", "if", "once", "out", "instead", "is"])
"""What may follow an option in a sentence, and is no value."""
COMMAND = r"(?P<command>tissuq [a-z]+(?: (?:[A-Z][\w.#*]*|'[^']*'|--[a-z-]+(?: (?:'[^']*'|\"[^\"]*\"))?))+)"
OPTION = (
    r"""--(?P<name>[a-z]+(?:-[a-z]+)*)(?: (?P<value>(?:[\w.]+=)?(?:'[^']*'|"[^"]*"|[^\s;,()'"]+(?:,\d[\d:]*)*)))?"""
)
EITHER = re.compile(f"{COMMAND}|{OPTION}")
BESIDE = re.compile(r"(; in Python [^()]*(?=\)))|( \(in Python [^();]*(?:; (?P<rest>[^()]*))?\))")
"""The Python form that some messages have beside that of the shell."""
VALUE = r"""=(?:"[^"]*"|'[^']*'|[^\s()]+)"""
AGAIN = re.compile(rf"\b(?P<name>\w+)(?P<value>{VALUE})? \((?P=name)(?P<again>{VALUE})?\)")
"""An argument that is said twice, as in ``area (area="10 mm2")``."""


def in_python(text: str, stress_unit: str = "MPa") -> str:
    """Return a message with what it proposes as arguments of `tissuq.read` and its like; commands stay as they are.

    What is a stress without a unit in the message is in ``stress_unit``.

    Examples
    --------
    >>> in_python('say which it is: --column stress=NAME (or force=), with --leave-out 40:59.')
    'say which it is: stress="NAME" (or force=), with leave_out="40:59".'
    >>> in_python('give the cross-section: area (--area "10 mm2"), or --width "5 mm" --thickness "2 mm".')
    'give the cross-section: area="10 mm2", or width="5 mm", thickness="2 mm".'
    >>> in_python("for a zero that is not sure give --tolerance zero=0.7.", "kPa")
    'for a zero that is not sure give tolerances={"zero": "0.7 kPa"}.'
    """
    text = BESIDE.sub(lambda match: f" ({match['rest']})" if match["rest"] else "", text)
    pieces, end, is_argument = list[str](), 0, False
    for match in EITHER.finditer(text):
        between = text[end : match.start()]
        is_next = is_argument and between == " "
        written, is_argument = (
            (match[0], False) if match["command"] else _argument(match["name"], match["value"] or "", stress_unit)
        )
        pieces += [", " if is_next and match["name"] else between, written]
        end = match.end()
    return AGAIN.sub(
        lambda match: match["name"] + (match["value"] or match["again"] or ""), "".join([*pieces, text[end:]])
    )


def _argument(option: str, typed: str, stress_unit: str) -> tuple[str, bool]:
    """Return an option as an argument, and whether it has a value."""
    value = typed.rstrip(".:")
    rest = typed[len(value) :]
    if option in SWITCHES:
        return SWITCHES[option] + (f" {typed}" if typed else ""), not typed
    name = OTHER_NAMES.get(option, option.replace("-", "_"))
    if not value or value in WORDS:
        return name + (f" {typed}" if typed else ""), False
    quoted = value[1:-1] if value[0] in "'\"" else value
    if option in ("column", "only"):
        role, _, column = quoted.partition("=")
        column = column.strip("'\"")
        shown = column if column.isdecimal() else dumps(column, ensure_ascii=False)
        if option == "only" or PARTS.get(role) != "columns":
            return (
                f"{'only' if option == 'only' else 'columns'}={{{dumps(role, ensure_ascii=False)}: {shown}}}{rest}",
                True,
            )
        return f"{role}={shown}{rest}", True
    if option == "tolerance" and "=" in quoted:
        error, _, size = quoted.partition("=")
        shown = dumps(f"{size} {stress_unit}") if error == STRESS_AT_REST else size
        return f"tolerances={{{dumps(error)}: {shown}}}{rest}", True
    if option == "stretch":
        return f"{name}=({', '.join(quoted.split(':'))}){rest}", True
    is_number = option in NUMBERS and re.fullmatch(r"[\d.]+", quoted)
    return f"{name}={quoted if is_number else dumps(quoted, ensure_ascii=False)}{rest}", True


def is_to_be_read(data: Any) -> bool:
    """Tell whether measurements are still to be read: a file, or a table."""
    return isinstance(data, str | os.PathLike) or is_data_frame(data)


@contextmanager
def refusals_in_python(data: Any) -> Iterator[None]:
    """Refuse what is neither file nor table, and word other refusals for Python."""
    if not is_to_be_read(data):
        raise InputError(
            f"a file ('test.csv') or a table (a DataFrame, a Dataset of xarray) is needed, not {data!r:.80}."
        )
    try:
        yield
    except InputError as refusal:
        refusal.args = (in_python(str(refusal)),)
        raise
