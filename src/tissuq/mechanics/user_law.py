"""A law of the user's own: a class, an instance or a plain function in a file that the user names."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from typing import Any

from tissuq.errors import InputError, ModelError
from tissuq.mechanics.contract import checked
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Prior

__all__ = ["LAW", "FunctionLaw", "as_material", "failures_of", "load_material", "run_file"]

LAW = re.compile(r"(?P<path>.+\.py):(?P<name>\w+)")
"""The file and the name in it."""
ARGUMENTS = ("I1", "I2"), ("l1", "l2", "l3")
WRITE = (
    "Write a function W(I1, I2, mu, b=tissuq.Uniform(0.1, 20)), where b has a prior because the stress is not "
    "proportional to it, or a subclass of tissuq.Material"
)


@dataclass(frozen=True)
class FunctionLaw(Material):
    """A strain energy that is written as a function W(I1, I2, ...) or W(l1, l2, l3, ...).

    Further arguments are its parameters. Without a default, the stress is proportional to them (MPa); with a
    prior as its default, a parameter is any other number without unit.

    Parameters
    ----------
    function : callable
        Plain arithmetic and the functions of `tissuq.mechanics.arithmetic`, zero at the reference. Those of jax.numpy
        serve, too, but not where stability is asked for.

    Raises
    ------
    InputError
        When its arguments are not these.

    Examples
    --------
    >>> from tissuq import FunctionLaw, Uniform
    >>> from tissuq.mechanics.arithmetic import expm1
    >>> def demirays(I1, I2, mu, b=Uniform(0.1, 20)):
    ...     return mu / (2 * b) * expm1(b * (I1 - 3))
    >>> [(p.symbol, p.unit, p.is_linear) for p in FunctionLaw(demirays).parameters]
    [('mu', 'MPa', True), ('b', '', False)]
    """

    function: Callable[..., Any]

    def __post_init__(self) -> None:
        names = tuple(inspect.signature(self.function).parameters)
        if not any(names[: len(first)] == first and len(names) > len(first) for first in ARGUMENTS):
            raise InputError(f"the law '{self.name}' has the arguments {', '.join(names) or 'none'}. {WRITE}.")
        for argument in self._own:
            is_named = argument.kind is argument.POSITIONAL_OR_KEYWORD
            if not is_named or not (argument.default is argument.empty or isinstance(argument.default, Prior)):
                raise InputError(
                    f"the law '{self.name}': its argument '{argument}' is not plain, nor has it a prior. {WRITE}."
                )

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The name of the function."""
        return self.function.__name__

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The first line of its documentation."""
        return (inspect.getdoc(self.function) or "W, see its function").splitlines()[0]

    @property
    def source(self) -> str:  # type: ignore[override]
        """The file of the function."""
        return Path(self.function.__code__.co_filename).name

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """The further arguments of the function."""
        return tuple(
            Parameter(each.name, f"parameter of {self.name}")
            if each.default is each.empty
            else Parameter(each.name, f"parameter of {self.name}", "number", each.default.support, False, each.default)
            for each in self._own
        )

    @property
    def _is_of_invariants(self) -> bool:
        return next(iter(inspect.signature(self.function).parameters)) == "I1"

    @property
    def _own(self) -> list[inspect.Parameter]:
        every = list(inspect.signature(self.function).parameters.values())
        return every[2 if self._is_of_invariants else 3 :]

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        if not self._is_of_invariants:
            raise ModelError(f"the law '{self.name}' is written in principal stretches, not in invariants.")
        return self.function(I1, I2, *values)

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        if self._is_of_invariants:
            return super().energy(stretches, values)
        return self.function(*stretches, *values)


def load_material(law: str) -> Material:
    """Return the material ``path.py:Name``: runs that file, and checks the law before anything is fitted.

    Parameters
    ----------
    law : str
        A subclass of `Material`, an instance of one, or a function as `FunctionLaw` describes it.

    Raises
    ------
    InputError
        When there is no such file or name, or what it names fails or is no material.
    """
    match = LAW.fullmatch(law)
    if match is None:
        raise InputError(f"'{law}' does not name a law in a file: write path.py:Name.")
    path, name = Path(match["path"]), match["name"]
    if not path.is_file():
        raise InputError(f"there is no file '{path}' for the material '{law}'.")
    with failures_of(path):
        module = run_file(path)
    if not hasattr(module, name):
        own = [key for key, each in vars(module).items() if getattr(each, "__module__", None) == module.__name__]
        raise InputError(f"'{path}' has nothing named '{name}'; it defines {', '.join(own) or 'nothing'}.")
    with failures_of(path):
        material = as_material(getattr(module, name), law)
        checks = checked(material)
    failed = [f"{each.claim} ({each.problem})" for each in checks if each.problem]
    if failed:
        raise InputError(f"the material '{law}' cannot be used, because this does not hold: {'; '.join(failed)}.")
    return material


def as_material(law: Any, place: str) -> Material:
    """Return the material that a class, an instance or a function is.

    Raises
    ------
    InputError
        When it is none of these, or lacks something.
    """
    if inspect.isfunction(law):
        return FunctionLaw(law)
    if not isinstance(law, Material) and not (inspect.isclass(law) and issubclass(law, Material)):
        raise InputError(f"'{place}' is no material (it is {law!r}). {WRITE}.")
    lacking = [each for each in ("name", "formula", "source", "parameters") if not hasattr(law, each)]
    if lacking:
        raise InputError(f"the material '{place}' lacks {', '.join(lacking)}.")
    if isinstance(law, Material):
        return law
    try:
        return law()
    except TypeError as error:
        raise InputError(f"the material '{place}' cannot be made without arguments: {error}.") from error


def run_file(path: Path) -> Any:
    """Return the module that a user's file makes when it is run."""
    spec = spec_from_file_location(f"tissuq_law_{path.stem}", path)
    assert spec is not None  # noqa: S101 (a file that ends with .py has a loader)
    assert spec.loader is not None  # noqa: S101
    module = module_from_spec(spec)
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module


@contextmanager
def failures_of(path: Path) -> Iterator[None]:
    """Say in one sentence what failed in the user's file, and in which line."""
    try:
        yield
    except (InputError, ModelError):
        raise
    except SyntaxError as error:
        raise InputError(f"'{path}' is not Python, line {error.lineno}: {error.msg}.") from error
    except (Exception, SystemExit) as error:
        lines = [each.lineno for each in extract_tb(error.__traceback__) if Path(each.filename).name == path.name]
        place = f", line {lines[-1]}" if lines else ""
        raise InputError(f"'{path}' fails{place}: {type(error).__name__}: {error}.") from error
