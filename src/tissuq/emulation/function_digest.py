"""A digest of a function of the user's: of its code, and of the values that it takes from where it was written."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from pathlib import PurePath
from types import CodeType, FunctionType, MethodType
from typing import Any

import numpy as np

PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic, PurePath)
"""Values that are what they look like."""
PLACES = 16
"""Digits of a digest."""


def function_digest(function: Callable[..., Any]) -> str:
    """Return a text that changes with what a function computes, as far as that can be seen.

    Its code, its defaults, the values around it (of a closure, of `functools.partial`, of an object that is called or
    whose method it is), and what it names of its module: numbers, texts, arrays, tuples, dictionaries, and functions
    and classes that are written there, with theirs. Not what it takes from other modules and files, nor lists, in which
    functions note their calls.

    Examples
    --------
    >>> def scaled(factor):
    ...     return lambda parameters: factor * parameters["mu"]
    >>> [function_digest(scaled(2.0)) == function_digest(scaled(factor)) for factor in (2.0, 3.0)]
    [True, False]
    """
    module = getattr(function, "__module__", None) or type(function).__module__
    if isinstance(function, partial):
        module = getattr(inspect.unwrap(function.func), "__module__", module)
    return sha256("\n".join(_lines(function, module, set())).encode()).hexdigest()[:PLACES]


def _lines(value: Any, module: str, seen: set[int]) -> Iterator[str]:
    """Yield what describes a value; of modules, and of functions and objects of others, no more than their names."""
    if isinstance(value, PLAIN):
        yield repr(value)
        return
    if id(value) in seen:
        return
    seen.add(id(value))
    yield type(value).__qualname__
    if isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}"
        return
    for part in _parts(value, module):
        yield from _lines(part, module, seen)


def _parts(value: Any, module: str) -> Iterator[Any]:
    """Yield what a value is made of."""
    if isinstance(value, dict):
        for pair in value.items():
            yield from pair
    elif isinstance(value, tuple):
        yield from value
    elif isinstance(value, frozenset):
        yield from sorted(map(repr, value))
    elif isinstance(value, partial):
        yield from (value.func, value.args, value.keywords)
    elif isinstance(value, MethodType):
        yield from (value.__func__, value.__self__)
    elif isinstance(value, FunctionType):
        yield value.__qualname__
        if value.__module__ == module:
            yield from _parts_of_function(value)
    elif isinstance(value, type):
        yield f"{value.__module__}.{value.__qualname__}"
        if value.__module__ == module:
            yield _source(value)
            yield from (method for method in vars(value).values() if isinstance(method, FunctionType))
    elif hasattr(value, "__wrapped__"):
        yield value.__wrapped__
    elif type(value).__module__ == module:
        yield type(value)
        yield object.__getstate__(value)


def _parts_of_function(function: FunctionType) -> Iterator[Any]:
    yield _source(function) or function.__code__.co_code
    yield function.__defaults__
    yield function.__kwdefaults__
    for cell in function.__closure__ or ():
        try:
            yield cell.cell_contents
        except ValueError:  # not yet bound
            continue
    for name in dict.fromkeys(_names(function.__code__)):
        if name in function.__globals__:
            yield name
            yield function.__globals__[name]


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that a function takes from its module, and those that functions within it do."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _source(written: Any) -> str:
    try:
        return inspect.getsource(written)
    except (OSError, TypeError):
        return ""
