"""Variants by name: every concrete subclass with a ``name`` is listed, wherever it was defined."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from inspect import isabstract
from typing import TypeVar

from tissuq.errors import ModelError, TissuqError

__all__ = ["find", "variants"]

T = TypeVar("T")


def variants(base: type[T]) -> dict[str, type[T]]:
    """Return the concrete subclasses of a base class by their ``name``, in the order of definition.

    A class that is defined again under the same module and class name (as in a notebook) replaces the earlier one.

    Raises
    ------
    ModelError
        When two different classes have the same name.
    """
    found: dict[str, type[T]] = {}
    for subclass in _descendants(base):
        name = vars(subclass)["name"]
        if name in found and _origin(found[name]) != _origin(subclass):
            raise ModelError(
                f"two classes are named '{name}': {' and '.join(map(_origin, (found[name], subclass)))}. "
                "Give yours another name."
            )
        found[name] = subclass
    return found


def _descendants(base: type[T]) -> Iterator[type[T]]:
    level = base.__subclasses__()
    while level:
        yield from (kind for kind in level if not isabstract(kind) and isinstance(vars(kind).get("name"), str))
        level = [child for kind in level for child in kind.__subclasses__()]


def _origin(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def find(base: type[T], kind: str, name: str, error: type[TissuqError]) -> type[T]:
    """Return the variant of that name, or raise ``error`` that lists the names there are."""
    known = variants(base)
    if name in known:
        return known[name]
    close = get_close_matches(str(name).lower(), known, n=1)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    raise error(f"there is no {kind} named '{name}'.{hint} Choose one of: {', '.join(known)}.")
