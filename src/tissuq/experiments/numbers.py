"""Numbers as laboratories write them, alone, with a spread and with a unit, and on one line with their percent sign."""

from __future__ import annotations

import re
from math import isfinite, nan
from textwrap import fill
from typing import Any

NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*|,\d+)?|[.,]\d+)(?:[eE][+-]?\d+)?")
GROUPED = {
    ",": re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?"),
    ".": re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+(?:,\d+)?"),
}
"""Numbers with a mark between thousands, by that mark; with one mark in all they may be decimal numbers as well."""
MEAN_WITH_SPREAD = re.compile(rf"({NUMBER.pattern})\s*(?:±|\+/?[-−])\s*({NUMBER.pattern})")
MARKED = re.compile(r"(?<![\w.,'’])([+-]?\d{1,3})((?:[\u00a0\u202f\u2009'’]\d{3})+)(?=[.,\s;|\"<]|$)")
"""Digits with marks between thousands that are never decimal marks."""
MARKS = re.compile("[\u00a0\u202f\u2009'’]")
BEFORE_PERCENT = re.compile(r"(?<=\d) (?=%)")
CROSS = r"\s*[x×*X]\s*"
"""Between the sides of something."""
SIDE = rf"{NUMBER.pattern}(?:\s*[^\W\dxX×_]+)?"
PRODUCT = re.compile(rf"{SIDE}(?:{CROSS}{SIDE})+")
"""Two sides or more, as in ``5 x 2 mm``."""


def unbroken(text: str) -> str:
    r"""Return a text in which no line ends between a number and its % or its ±.

    Examples
    --------
    >>> unbroken("a 95 % interval, stress=10%")
    'a 95\xa0% interval, stress=10%'
    >>> unbroken("± 5 %")
    '±\xa05\xa0%'
    """
    return BEFORE_PERCENT.sub("\u00a0", text).replace("± ", "±\u00a0")


def wrapped(text: str, width: int, **indents: Any) -> str:
    """Return a text in lines of some width, with the indents of `textwrap.fill`, numbers with their %."""
    return fill(unbroken(text), width, **indents).replace("\u00a0", " ")


def number_in(cell: str) -> float:
    """Return the number in a cell, written with a decimal point or comma; nan where it holds none, or no finite one."""
    number = float(cell.replace(",", ".")) if NUMBER.fullmatch(cell) else nan
    return number if isfinite(number) else nan


def without_marks(text: str) -> str:
    """Return a text without apostrophes, no-break spaces and thin spaces between the thousands of its numbers.

    Examples
    --------
    >>> without_marks("1'364.3;0.5"), without_marks("12\u00a0345,6"), without_marks("the 5' end")
    ('1364.3;0.5', '12345,6', "the 5' end")
    """
    if not MARKS.search(text):
        return text
    return MARKED.sub(lambda match: match[1] + MARKS.sub("", match[2]), text)


def number_and_unit(text: str) -> tuple[float | None, str]:
    """Return the number at the head of a text, if there is one, and what follows it."""
    match = re.fullmatch(rf"\s*({NUMBER.pattern})\s*\[?\(?([^\d\s\[\]()][^\s\[\]()]*)?[\])]?\s*", text)
    return (float(match[1].replace(",", ".")), match[2] or "") if match else (None, "")


def sides_and_unit(text: str) -> tuple[list[float], str]:
    """Return the numbers in a product such as ``5 x 2 mm``, and their unit; no numbers for any other text.

    Examples
    --------
    >>> sides_and_unit("5 x 2 mm"), sides_and_unit("5mm × 2,5mm"), sides_and_unit("5 mm x 2 cm"), sides_and_unit("5 mm")
    (([5.0, 2.0], 'mm'), ([5.0, 2.5], 'mm'), ([], ''), ([], ''))
    """
    if not PRODUCT.fullmatch(text.strip(" \t()[]")):
        return [], ""
    pairs = [number_and_unit(side) for side in re.split(CROSS, text.strip(" \t()[]"))]
    units = {unit for _, unit in pairs} - {""}
    sides = [number for number, _ in pairs if number is not None]
    return (sides, "".join(units)) if len(units) < 2 and len(sides) == len(pairs) else ([], "")
