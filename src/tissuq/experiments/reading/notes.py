"""Texts about several tests, with the names of those that they concern."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["concerned"]


def concerned(messages: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names that every text concerns, of pairs of a name and a text, both in the order of the first.

    Examples
    --------
    >>> concerned([("A", "torn"), ("B", "torn"), ("B", "slack")])
    {'torn': ['A', 'B'], 'slack': ['B']}
    """
    names: dict[str, list[str]] = {}
    for name, text in messages:
        of_text = names.setdefault(text, [])
        if name not in of_text:
            of_text.append(name)
    return names
