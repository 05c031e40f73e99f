"""The loading mode of a file by what it says itself: a comment line, or its name."""

from __future__ import annotations

import re
from pathlib import Path

from tissuq.errors import InputError
from tissuq.experiments.modes import loading_modes

__all__ = ["said_mode", "told_mode"]

OTHER_WORDS = {"tension": "uniaxial", "compression": "uniaxial", "shear": "simple-shear"}
LINES = 20


def said_mode(file: Path) -> str | None:
    """Return the mode that a comment line such as ``# mode: planar`` at the head of a file says; None without one."""
    return _named(_in_comments(file))


def told_mode(file: Path, otherwise: str | None = None) -> str:
    """Return the mode that a comment line such as ``# mode: planar`` says, or else the name of the file.

    One that says none is of another mode, where that is given.

    Raises
    ------
    InputError
        When neither names one, and no other is given.

    Examples
    --------
    >>> told_mode(Path("liver-7-planar.csv")), told_mode(Path("simple_shear.csv")), told_mode(Path("tension.csv"))
    ('planar', 'simple-shear', 'uniaxial')
    """
    found = said_mode(file) or _named(file.stem) or otherwise
    if found:
        return found
    raise InputError(
        f"neither '{file}' nor its name says in which loading mode it was measured: give --mode once for each file, "
        f"in their order ({', '.join(loading_modes())})."
    )


def _named(text: str) -> str | None:
    words = "-".join(re.findall(r"[a-z]+", text.lower()))
    for name in sorted(loading_modes(), key=len, reverse=True):
        if re.search(rf"(^|-){name}($|-)", words):
            return name
    found = {mode for word, mode in OTHER_WORDS.items() if word in words.split("-")}
    return found.pop() if len(found) == 1 else None


def _in_comments(file: Path) -> str:
    try:
        with file.open("rb") as content:
            head = [content.readline(1000).decode("latin-1") for _ in range(LINES)]
    except OSError:
        return ""
    return next((line.split(":", 1)[1] for line in head if re.match(r"#\s*mode\s*:", line, re.IGNORECASE)), "")
