"""A digest of a function of the user's: of its code, and of the values that it takes from where it was written."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from hashlib import sha256
from pathlib import PurePath
from textwrap import dedent
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
    and classes that are written there, with theirs. Not what it takes from other modules and files, nor lists and
    dictionaries in which it notes its calls: lists, and dictionaries in which it writes under keys that it computes.

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
    return sha256("\n".join(_lines(function, module, {})).encode()).hexdigest()[:PLACES]


def _lines(value: Any, module: str, seen: dict[int, Any]) -> Iterator[str]:
    """Yield what describes a value; of modules, and of functions and objects of others, no more than their names.

    What was seen is kept, so that nothing else takes its place in the memory.
    """
    if isinstance(value, PLAIN):
        yield repr(value)
        return
    if id(value) in seen:
        return
    seen[id(value)] = value
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
        methods = (method for base in type(value).__mro__ for method in vars(base).values())
        yield _without_notes(object.__getstate__(value), filter(inspect.isfunction, methods))


def _parts_of_function(function: FunctionType) -> Iterator[Any]:
    yield _source(function) or function.__code__.co_code
    yield function.__defaults__
    yield function.__kwdefaults__
    around = dict[str, Any]()
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        with suppress(ValueError):  # not yet bound
            around[name] = cell.cell_contents
    yield from _without_notes(around, [function]).values()
    used = {name: function.__globals__[name] for name in _names(function.__code__) if name in function.__globals__}
    for pair in _without_notes(used, [function]).items():
        yield from pair


def _without_notes(values: Any, functions: Iterable[FunctionType]) -> Any:
    """Return values by name without dictionaries in which functions note what they have computed."""
    if not isinstance(values, dict):
        return values
    notes = {name for function in functions for name in _written(function)}
    return {name: value for name, value in values.items() if not (isinstance(value, dict) and name in notes)}


def _written(function: FunctionType) -> Iterator[str]:
    """Yield the names of what a function writes into under keys that it computes."""
    try:
        tree = ast.parse(dedent(_source(function)))
    except SyntaxError:  # a part of an expression
        return
    for node in ast.walk(tree):
        if not isinstance(node, ast.Subscript) or not isinstance(node.ctx, ast.Store):
            continue
        if not isinstance(node.slice, ast.Constant) and isinstance(node.value, ast.Name | ast.Attribute):
            yield node.value.id if isinstance(node.value, ast.Name) else node.value.attr


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
