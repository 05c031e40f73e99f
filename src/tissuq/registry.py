"""Variants by name: every concrete subclass with a ``name`` is listed, wherever it was defined."""

from __future__ import annotations

from difflib import get_close_matches
from inspect import isabstract
from typing import TypeVar

from tissuq.errors import TissuqError

__all__ = ["find", "variants"]

T = TypeVar("T")


def variants(base: type[T]) -> dict[str, type[T]]:
    """Return the concrete subclasses of a base class by their ``name``, in the order of definition."""
    found: dict[str, type[T]] = {}
    for subclass in base.__subclasses__():
        if not isabstract(subclass) and "name" in vars(subclass):
            found[vars(subclass)["name"]] = subclass
        found |= variants(subclass)
    return found


def find(base: type[T], kind: str, name: str, error: type[TissuqError]) -> type[T]:
    """Return the variant of that name, or raise ``error`` that lists the names there are."""
    known = variants(base)
    if name in known:
        return known[name]
    close = get_close_matches(str(name), known, n=1)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    raise error(f"there is no {kind} named '{name}'.{hint} Choose one of: {', '.join(known)}.")
