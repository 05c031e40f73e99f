"""A forward model: what computes the measured quantity from parameters, at the price of minutes or hours a run."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.mechanics.user_law import LAW, failures_of, run_file

__all__ = ["CallableForward", "FileForward", "Forward", "as_forward"]

FloatArray = NDArray[np.float64]

WRITE = (
    "Write a function forward(parameters) of a dictionary of parameters by name, or forward(parameters, control), that "
    "returns an output for every measurement"
)


class Forward(ABC):
    """An expensive model.

    A new kind is one subclass: how it is run, and what tells it from others. It travels to other processes.
    """

    @abstractmethod
    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        """Return the outputs (n,) at the measured controls (n,)."""

    @property
    @abstractmethod
    def identity(self) -> str:
        """What tells this model from others, so that runs of another one are not taken for its own."""

    @property
    def name(self) -> str:
        """What it is called in reports."""
        return self.identity.partition(" ")[0]

    def check(self, symbols: Sequence[str]) -> None:  # noqa: B027  (most kinds have nothing to check)
        """Raise an InputError where it can be seen that no run with these parameters is possible."""


@dataclass(frozen=True)
class CallableForward(Forward):
    """A function of a mapping of parameters by name and, where it has a second argument, of the controls (n,)."""

    function: Callable[..., Any]

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        return _called(self.function, parameters, control)

    @property
    def identity(self) -> str:
        own = getattr(self.function, "__qualname__", type(self.function).__qualname__)
        try:
            text = inspect.getsource(self.function)
        except (OSError, TypeError):
            text = ""
        return f"{getattr(self.function, '__module__', '')}.{own} {_digest(text.encode())}"


@dataclass(frozen=True)
class FileForward(Forward):
    """A function in a file that the user names, ``path.py:function``, or in a module, ``package.module:function``.

    The file is run where the model is, in every process anew.
    """

    place: str

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        return _called(_function_at(self.place), parameters, control)

    @property
    def identity(self) -> str:
        match = LAW.fullmatch(self.place)
        if match is None:
            return self.place
        path = Path(match["path"])
        return f"{path.name}:{match['name']} {_digest(path.read_bytes())}"

    @property
    def file(self) -> Path | None:
        """The user's file, where it is one."""
        match = LAW.fullmatch(self.place)
        return Path(match["path"]) if match else None

    def check(self, symbols: Sequence[str]) -> None:
        _function_at(self.place)


def as_forward(forward: Forward | Callable[..., Any]) -> Forward:
    """Return a model for a function; a model is returned as it is.

    Raises
    ------
    InputError
        When it is neither.
    """
    if isinstance(forward, Forward):
        return forward
    if not callable(forward):
        raise InputError(f"the forward model must be a function, not {forward!r}. {WRITE}.")
    return CallableForward(forward)


def _called(function: Callable[..., Any], parameters: Mapping[str, float], control: FloatArray) -> Any:
    return function(dict(parameters), control) if _takes_control(function) else function(dict(parameters))


def _takes_control(function: Callable[..., Any]) -> bool:
    """Return whether a function has a second argument without default, or one that is called control."""
    try:
        arguments = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        return False
    plain = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    second = [each for each in arguments if each.kind in plain][1:2]
    return any(each.default is each.empty or each.name == "control" for each in second)


@lru_cache
def _function_at(place: str) -> Callable[..., Any]:
    """Return the function that the user named; runs its file."""
    match = LAW.fullmatch(place)
    if match is None:
        return _function_of_module(place)
    path, name = Path(match["path"]), match["name"]
    if not path.is_file():
        raise InputError(f"there is no file '{path}' for the forward model '{place}'.")
    with failures_of(path):
        found = getattr(run_file(path), name, None)
    if not callable(found):
        raise InputError(f"'{path}' has no function named '{name}'. {WRITE}.")
    return found  # type: ignore[no-any-return]


def _function_of_module(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    if not name or not module.replace(".", "_").isidentifier():
        raise InputError(f"'{place}' does not name a function: write path.py:function or package.module:function.")
    try:
        found = getattr(import_module(module), name, None)
    except ImportError as error:
        raise InputError(f"the forward model '{place}' cannot be imported: {error}.") from error
    if not callable(found):
        raise InputError(f"module '{module}' has no function named '{name}'. {WRITE}.")
    return found  # type: ignore[no-any-return]


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()[:16]
