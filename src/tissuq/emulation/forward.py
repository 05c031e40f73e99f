"""Forward models, which compute the measured quantity from parameters in minutes or hours a run."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.emulation.function_digest import function_digest
from tissuq.errors import ConvergenceError, InputError
from tissuq.mechanics.user_law import UserCode

ADVICE = (
    "Write a function forward(parameters) of a dictionary of parameters by name, or forward(parameters, control), that "
    "returns an output for every measurement"
)


class UnreadableError(InputError):
    """What cannot be read, such as a quantity that the model does not write: after the first run none is made."""


class Forward(ABC):
    """An expensive model.

    A new kind is one subclass: how it is run, and its identity. It is sent to other processes.
    """

    @abstractmethod
    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        """Return the outputs (n,) at the measured controls (n,)."""

    @property
    @abstractmethod
    def identity(self) -> str:
        """A text that identifies the model, so that runs of another one are not taken for its own."""

    @property
    def name(self) -> str:
        """The name in reports."""
        return self.identity.partition(" ")[0]

    def of_quantities(self, ends: Mapping[str, tuple[int, int]]) -> Forward:
        """Return the model whose outputs are those of several quantities one after the other."""
        return self if len(ends) == 1 else SeveralQuantities(self, tuple((name, *pair) for name, pair in ends.items()))

    def check(self, symbols: Sequence[str]) -> None:  # noqa: B027  (most kinds have nothing to check)
        """Raise an InputError where no run with these parameters is possible."""

    def prepared_in(self, folder: Path) -> Forward:
        """Return the model as it runs with files in a folder, which exists and keeps its runs."""
        return self

    def clear(self, parameters: Mapping[str, float]) -> None:  # noqa: B027  (most kinds leave no files)
        """Delete the files of a run that has succeeded; until then what is stopped can go on from them."""


@dataclass(frozen=True)
class CallableForward(Forward):
    """A function of a mapping of parameters by name and, where it has a second argument, of the controls (n,)."""

    function: Callable[..., Any]

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        return _called(self.function, parameters, control)

    def check(self, symbols: Sequence[str]) -> None:
        _check_arguments(self.function, symbols)

    @property
    def identity(self) -> str:
        name = getattr(self.function, "__qualname__", type(self.function).__qualname__)
        return f"{getattr(self.function, '__module__', '')}.{name} {function_digest(self.function)}"


@dataclass(frozen=True)
class FileForward(Forward):
    """A function in a file that the user names, ``path.py:function``, or in a module, ``package.module:function``.

    The file is run where the model is, in every process anew.
    """

    location: str

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        return _called(_function_at(self.location), parameters, control)

    @property
    def identity(self) -> str:
        code = UserCode.named(self.location)
        if code is None:
            return f"{self.location} {function_digest(_function_at(self.location))}"
        return f"{code.path.name}:{code.name} {code.digest}"

    @property
    def file(self) -> Path | None:
        """The user's file, where it is one."""
        code = UserCode.named(self.location)
        return code.path if code else None

    def check(self, symbols: Sequence[str]) -> None:
        _check_arguments(_function_at(self.location), symbols)


@dataclass(frozen=True)
class SeveralQuantities(Forward):
    """A model that takes the controls, and returns the outputs, as mappings by the name of what was measured."""

    model: Forward
    quantities: tuple[tuple[str, int, int], ...]

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        controls = {name: control[start:stop] for name, start, stop in self.quantities}
        outputs = self.model.run(parameters, controls)  # type: ignore[arg-type]  # by name
        names = [name for name, _, _ in self.quantities]
        if not isinstance(outputs, Mapping) or set(outputs) != set(names):
            raise InputError(f"the forward model must return a dictionary of outputs for {', '.join(names)}.")
        for name, start, stop in self.quantities:
            if np.shape(outputs[name]) != (stop - start,):
                raise InputError(
                    f"the forward model returns outputs of {name} of shape {np.shape(outputs[name])}; there are "
                    f"{stop - start} measurements of it."
                )
        return np.concatenate([np.asarray(outputs[name], dtype=np.float64) for name in names])

    @property
    def identity(self) -> str:
        return f"{self.model.identity} of {', '.join(name for name, _, _ in self.quantities)}"

    def check(self, symbols: Sequence[str]) -> None:
        self.model.check(symbols)

    def prepared_in(self, folder: Path) -> Forward:
        return replace(self, model=self.model.prepared_in(folder))

    def clear(self, parameters: Mapping[str, float]) -> None:
        self.model.clear(parameters)


@dataclass(frozen=True)
class SeveralModels(Forward):
    """Models of several experiments, which share their parameters: each gives some of what was measured.

    Parameters
    ----------
    models : tuple of (tuple of str, Forward)
        Each with the names of what it gives.
    """

    models: tuple[tuple[tuple[str, ...], Forward], ...]

    def run(self, parameters: Mapping[str, float], control: Any) -> Any:
        outputs: dict[str, Any] = {}
        for names, model in self.models:
            controls = {name: control[name] for name in names}
            try:
                if len(names) == 1:
                    outputs[names[0]] = model.run(parameters, controls[names[0]])
                else:
                    outputs |= model.run(parameters, controls)  # type: ignore[arg-type]  # by name
            except (ConvergenceError, UnreadableError) as error:
                raise type(error)(f"{model.name}: {error}") from error
        return outputs

    @property
    def identity(self) -> str:
        return "; ".join(f"{model.identity} of {', '.join(names)}" for names, model in self.models)

    @property
    def name(self) -> str:
        return " and ".join(model.name for _, model in self.models)

    def of_quantities(self, ends: Mapping[str, tuple[int, int]]) -> Forward:
        modelled = [name for names, _ in self.models for name in names]
        if sorted(modelled) != sorted(ends):
            raise InputError(f"the models give {', '.join(modelled)}; what was measured is {', '.join(ends)}.")
        for names, model in self.models:
            model.of_quantities({name: ends[name] for name in names} if len(names) > 1 else {"": ends[names[0]]})
        return SeveralQuantities(self, tuple((name, *pair) for name, pair in ends.items()))

    def check(self, symbols: Sequence[str]) -> None:
        for _, model in self.models:
            model.check(symbols)

    def prepared_in(self, folder: Path) -> Forward:
        prepared = []
        for number, (names, model) in enumerate(self.models, start=1):
            (own_folder := folder / f"model-{number}").mkdir(exist_ok=True)
            prepared.append((names, model.prepared_in(own_folder)))
        return SeveralModels(tuple(prepared))

    def clear(self, parameters: Mapping[str, float]) -> None:
        for _, model in self.models:
            model.clear(parameters)


def as_forward(forward: Forward | Callable[..., Any] | Mapping[Any, Any]) -> Forward:
    """Return a model for a function, or for several models by the names of what they give; a model as it is.

    Raises
    ------
    InputError
        When it is none of these.
    """
    if isinstance(forward, Forward):
        return forward
    if isinstance(forward, Mapping):
        pairs = [((names,) if isinstance(names, str) else tuple(names), model) for names, model in forward.items()]
        return SeveralModels(tuple((names, as_forward(model)) for names, model in pairs))
    if not callable(forward):
        raise InputError(f"the forward model must be a function, not {forward!r}. {ADVICE}.")
    return CallableForward(forward)


def _called(function: Callable[..., Any], parameters: Mapping[str, float], control: FloatArray) -> Any:
    return function(dict(parameters), control) if _takes_control(function) else function(dict(parameters))


def _takes_control(function: Callable[..., Any]) -> bool:
    """Return whether a function has a second argument without default, or one that is called control."""
    second_argument = _arguments(function)[1:2]
    return any(argument.default is argument.empty or argument.name == "control" for argument in second_argument)


def _check_arguments(function: Callable[..., Any], symbols: Sequence[str]) -> None:
    """Refuse a function that takes every parameter by itself, as fits of curves elsewhere ask for.

    Raises
    ------
    InputError
        With what it takes, and what it is given.
    """
    needed = [argument for argument in _arguments(function) if argument.default is argument.empty]
    if len(needed) > 2 or any(argument.name in symbols for argument in needed[1:]):
        names = ", ".join(argument.name for argument in needed)
        raise InputError(f"the forward model takes {names}, each by itself. {ADVICE}.")


def _arguments(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """Return the arguments that a function takes by position; none where these cannot be known."""
    try:
        arguments = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return []
    plain = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return [argument for argument in arguments if argument.kind in plain]


@lru_cache
def _function_at(location: str) -> Callable[..., Any]:
    """Return the function that the user named; runs its file."""
    code = UserCode.named(location)
    if code is None:
        return _function_of_module(location)
    return code.function(f"there is no file '{code.path}' for the forward model '{location}'.", ADVICE)


def _function_of_module(location: str) -> Callable[..., Any]:
    module, _, name = location.partition(":")
    if not name or not module.replace(".", "_").isidentifier():
        raise InputError(
            f"'{location}' does not name a function: write path.py:function or package.module:function. A program "
            "is run by such a function, with subprocess.run."
        )
    try:
        function = getattr(import_module(module), name, None)
    except ImportError as error:
        raise InputError(f"the forward model '{location}' cannot be imported: {error}.") from error
    if not callable(function):
        raise InputError(f"module '{module}' has no function named '{name}'. {ADVICE}.")
    return function  # type: ignore[no-any-return]


DEFAULT_URL = "http://localhost:4242"


@dataclass(frozen=True)
class UmbridgeForward(Forward):
    """A model that an UM-Bridge server offers.

    The parameters are sent in the order of their priors, as one input vector or as several that together are as long;
    all output vectors together are the outputs at the measured controls. The controls are sent, too, as the entry
    ``control`` of the configuration: a server may compute there, and ignores it otherwise.

    Parameters
    ----------
    url : str
        Address of the server.
    model : str
        Name of the model on the server.

    References
    ----------
    Seelinger et al. (2023), Journal of Open Source Software 8(83), 4748.
    """

    url: str = DEFAULT_URL
    model: str = "forward"

    def run(self, parameters: Mapping[str, float], control: FloatArray) -> Any:
        settings, values = {"control": control.tolist()}, iter(parameters.values())
        client, sizes = _client(self.url, self.model)
        inputs = [list(islice(values, size)) for size in sizes]
        return np.concatenate([np.asarray(vector, dtype=np.float64) for vector in client(inputs, settings)])

    def of_quantities(self, ends: Mapping[str, tuple[int, int]]) -> Forward:
        return self  # its output vectors already are one after the other

    @property
    def identity(self) -> str:
        return f"{self.model} at {self.url}"

    name = identity

    def check(self, symbols: Sequence[str]) -> None:
        _, sizes = _client(self.url, self.model)
        if sum(sizes) != len(symbols):
            raise InputError(
                f"the model '{self.model}' at {self.url} takes {sum(sizes)} parameters; {len(symbols)} have priors "
                f"({', '.join(symbols)})."
            )


@lru_cache
def _client(url: str, model: str) -> tuple[Any, tuple[int, ...]]:
    """Return the client of a model, and the lengths of its input vectors."""
    try:
        import umbridge
    except ImportError as error:
        raise InputError("an UM-Bridge model needs its client: install tissuq with its extra 'umbridge'.") from error
    try:
        models = umbridge.supported_models(url)
    except Exception as error:  # whatever the network, the server and its answer do
        raise InputError(f"no UM-Bridge server answers at {url} ({type(error).__name__}). Start it first.") from error
    if model not in models:
        raise InputError(f"the server at {url} has no model '{model}'; it has {', '.join(models)}.")
    try:
        client = umbridge.HTTPModel(url, model)
        return client, tuple(map(int, client.get_input_sizes()))
    except Exception as error:  # whatever the server answers
        answer = f"{type(error).__name__}: {error}"
        raise InputError(f"the server at {url} does not say what '{model}' takes ({answer}): see its log.") from error
