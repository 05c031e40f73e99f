"""Texts about several tests or fits, each once with the names of those that it concerns."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["concerned", "each_once"]


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


def each_once(messages: Iterable[tuple[str, str]], count: int, everyone: str) -> list[str]:
    """Return every text once, after the names that it concerns, or after a word where these are all of so many.

    Examples
    --------
    >>> each_once([("A", "torn"), ("B", "torn"), ("B", "slack")], 2, "all tests")
    ['all tests: torn', 'B: slack']
    """
    return [
        f"{everyone if len(names) == count else ', '.join(names)}: {text}" if count > 1 else text
        for text, names in concerned(messages).items()
    ]
