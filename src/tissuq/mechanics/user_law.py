"""Code in a file that the user names, a law among it, and the checks that it and every material must pass."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from math import inf
from pathlib import Path
from traceback import extract_tb
from typing import Any, NamedTuple, Self

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import Path as StressPath
from tissuq.experiments.modes import loading_modes
from tissuq.mechanics.invariants import largest_invariants
from tissuq.mechanics.material import Material
from tissuq.mechanics.stress import (
    differentiator,
    engineering_stress,
    initial_shear_modulus,
    path_energy,
    traced_stress_basis,
)
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Prior

LAW = re.compile(r"(?P<path>.+\.py):(?P<name>\w+)")
"""The file and the name in it."""
ARGUMENTS = ("I1", "I2"), ("l1", "l2", "l3")
"""What the arguments of a function begin with: invariants, or principal stretches."""
HOW_TO_WRITE = (
    "Write a function W(I1, I2, mu, b=tissuq.Uniform(0.1, 20)), where b has a prior because the stress is not "
    "proportional to it, or a subclass of tissuq.Material"
)

CONTROL_CHANGES = np.array([-0.2, -0.1, -0.03, 0.04, 0.15, 0.3])
"""Of the first control of a mode, from the reference, at which a material is checked."""
DIFFERENCE_STEP = 1e-5
"""Step of the stretch for a difference quotient."""
CHECK_TOLERANCE = 1e-5
"""Relative difference beyond which a check fails."""


@dataclass(frozen=True)
class FunctionLaw(Material):
    """A strain energy that is written as a function W(I1, I2, ...) or W(l1, l2, l3, ...).

    Further arguments are its parameters. Without a default, the stress is proportional to them (MPa); with a
    prior as its default, a parameter is any other number without unit.

    Parameters
    ----------
    function : callable
        Plain arithmetic and the functions of `tissuq.mechanics.arithmetic`, zero at the reference. Those of jax.numpy
        serve, too, but have to be compiled.

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
        if not hasattr(self.function, "__name__"):
            raise InputError(f"a law is a function, not {self.function!r:.80}. {HOW_TO_WRITE}.")
        name, names = self.function.__name__, tuple(inspect.signature(self.function).parameters)
        if not any(names[: len(start)] == start and len(names) > len(start) for start in ARGUMENTS):
            raise InputError(f"the law '{name}' has the arguments {', '.join(names) or 'none'}. {HOW_TO_WRITE}.")
        for argument in self._parameter_arguments:
            is_named = argument.kind is argument.POSITIONAL_OR_KEYWORD
            if not is_named or not (argument.default is argument.empty or isinstance(argument.default, Prior)):
                raise InputError(
                    f"the law '{name}': its argument '{argument}' is not plain, nor has it a prior. {HOW_TO_WRITE}."
                )
        self._describe(
            name=name,
            formula=(inspect.getdoc(self.function) or "W, see its function").splitlines()[0],
            parameters=tuple(
                Parameter(argument.name, f"parameter of {name}")
                if (prior := argument.default) is argument.empty
                else Parameter(argument.name, f"parameter of {name}", "number", prior.support, False, prior)
                for argument in self._parameter_arguments
            ),
        )

    @property
    def source(self) -> str:  # type: ignore[override]  # of the object, not the class
        """The file of the function."""
        return Path(self.function.__code__.co_filename).name

    @property
    def _is_of_invariants(self) -> bool:
        return next(iter(inspect.signature(self.function).parameters)) == "I1"

    @property
    def _parameter_arguments(self) -> list[inspect.Parameter]:
        arguments = list(inspect.signature(self.function).parameters.values())
        return arguments[2 if self._is_of_invariants else 3 :]

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
    code = UserCode.named(law)
    if code is None:
        raise InputError(f"'{law}' does not name a law in a file: write path.py:Name.")
    path, name = code
    module = code.module(f"there is no file '{path}' for the material '{law}'.")
    if not hasattr(module, name):
        is_defined = {key: getattr(thing, "__module__", None) == module.__name__ for key, thing in vars(module).items()}
        names = [key for key, is_here in is_defined.items() if is_here]
        raise InputError(f"'{path}' has nothing named '{name}'; it defines {', '.join(names) or 'nothing'}.")
    with _failures_of(path):
        material = as_material(getattr(module, name), law)
        checks = checked(material)
    failed = [f"{check.claim} ({check.problem})" for check in checks if check.problem]
    if failed:
        raise InputError(f"the material '{law}' cannot be used, because this does not hold: {'; '.join(failed)}.")
    return material


def as_material(law: Any, source: str) -> Material:
    """Return the material that a class, an instance or a function is.

    Raises
    ------
    InputError
        When it is none of these, or lacks something.
    """
    if inspect.isfunction(law):
        return FunctionLaw(law)
    if not isinstance(law, Material) and not (inspect.isclass(law) and issubclass(law, Material)):
        raise InputError(f"'{source}' is no material (it is {law!r}). {HOW_TO_WRITE}.")
    lacking = [name for name in ("name", "parameters") if not hasattr(law, name)]
    if lacking:
        raise InputError(f"the material '{source}' lacks {', '.join(lacking)}.")
    if isinstance(law, Material):
        return law
    try:
        return law()
    except TypeError as error:
        raise InputError(f"the material '{source}' cannot be made without arguments: {error}.") from error


class UserCode(NamedTuple):
    """Something in a file of the user's, which is written ``path.py:Name``."""

    path: Path
    name: str

    @classmethod
    def named(cls, text: str) -> Self | None:
        """Return what a text names; None where that is nothing in a file."""
        match = LAW.fullmatch(text) if isinstance(text, str) else None
        return cls(Path(match["path"]), match["name"]) if match else None

    @property
    def digest(self) -> str:
        """A text that changes with the file."""
        return sha256(self.path.read_bytes()).hexdigest()[:16]

    def module(self, missing: str) -> Any:
        """Return the module that the file makes when it is run; an InputError, ``missing`` where there is no file."""
        if not self.path.is_file():
            raise InputError(missing)
        with _failures_of(self.path):
            return _run(self.path)

    def function(self, missing: str, advice: str) -> Callable[..., Any]:
        """Return the function of that name; an InputError, as of `module`, or with advice where there is none."""
        function = getattr(self.module(missing), self.name, None)
        if not callable(function):
            raise InputError(f"'{self.path}' has no function named '{self.name}'. {advice}.")
        return function  # type: ignore[no-any-return]


def _run(path: Path) -> Any:
    spec = spec_from_file_location(f"tissuq_law_{path.stem}", path)
    assert spec is not None  # noqa: S101 (a file that ends with .py has a loader)
    assert spec.loader is not None  # noqa: S101
    module = module_from_spec(spec)
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module


@contextmanager
def _failures_of(path: Path) -> Iterator[None]:
    """Raise in one sentence what failed in the user's file, and in which line."""
    try:
        yield
    except (InputError, ModelError):
        raise
    except SyntaxError as error:
        raise InputError(f"'{path}' is not Python, line {error.lineno}: {error.msg}.") from error
    except (Exception, SystemExit) as error:
        lines = [frame.lineno for frame in extract_tb(error.__traceback__) if Path(frame.filename).name == path.name]
        line = f", line {lines[-1]}" if lines else ""
        raise InputError(f"'{path}' fails{line}: {type(error).__name__}: {error}.") from error


@dataclass(frozen=True)
class Check:
    """One claim about a material; ``problem`` says why it does not hold, and is empty where it does."""

    claim: str
    problem: str = ""


def checked(material: Material) -> list[Check]:
    """Check a material at some values of its parameters, over moderate deformations in every loading mode."""
    paths, references = _paths(material, CONTROL_CHANGES), _paths(material, np.zeros(1))
    path, points = next(iter(paths.items()))
    values = values_within_reach(material, CONTROL_CHANGES)
    energy = np.array([_energy(material, *on_path, values) for on_path in paths.items()])
    at_reference = _energy(material, path, references[path], values)
    checks = [
        _check("the energy is finite", np.abs(np.where(np.isfinite(energy), 0.0, inf)), "it is not everywhere"),
        _check("the energy is zero at the reference", at_reference, "there it is {:.3g} MPa"),
    ]
    if any(check.problem for check in checks):
        return checks
    stress = np.array([engineering_stress(material, *on_path, values) for on_path in paths.items()])
    scale = np.abs(stress).max()
    if not np.isfinite(scale) or not scale:
        return [*checks, Check("it has a stress", "there is none, or one that is not finite")]
    resting = np.array([engineering_stress(material, *on_path, values) for on_path in references.items()])
    slope = np.array([_difference(material, *on_path, values) for on_path in paths.items()])
    modulus = initial_shear_modulus(material, values)
    checks += [
        _check("the stress is zero at the reference", resting / scale, "there it is {:.3g} of the largest"),
        _check("the stress is the derivative of the energy", (stress - slope) / scale, "they differ by {:.3g}"),
    ]
    if not material.needs_matrix:
        problem = "" if modulus > 0 else f"it is {modulus:.3g} MPa"
        checks.append(Check("the initial shear modulus is positive", problem))
    is_linear = material.linear_mask
    if is_linear.any():
        factors = np.where(is_linear, [2.0, *3.0 + np.arange(1, len(values))], 1.0)
        scaled = engineering_stress(material, path, points, factors * values)
        compiled = differentiator().jit(partial(traced_stress_basis, material, path.at(points)))
        basis = np.asarray(compiled(values[~is_linear]))
        symbols = ", ".join(parameter.symbol for parameter in material.parameters if parameter.is_linear)
        error = (scaled - basis @ (factors * values)[is_linear]) / np.abs(scaled).max()
        checks.append(_check(f"the stress is proportional to {symbols}", error, "it differs by {:.3g}"))
    return checks


def values_within_reach(material: Material, change: FloatArray) -> FloatArray:
    """Return values of a material's parameters for which it bears such changes of a mode's controls.

    They are one, or medians of priors.
    """
    largest = max(largest_invariants(path.at(points))[0] for path, points in _paths(material, change).items())
    return np.array([_value(parameter, largest) for parameter in material.parameters])


def _paths(material: Material, change: FloatArray) -> dict[StressPath, FloatArray]:
    """Return the path of every stress of every loading mode that the material takes, with points on it."""
    modes = [kind() for kind in loading_modes().values()]
    paths = {path: mode.excursion(change) for mode in modes for path in mode.paths}
    return {path: points for path, points in paths.items() if not material.why_not(path.moved(points, 0.0))}


def _value(parameter: Parameter, largest: float) -> float:
    if parameter.relative_prior is None:
        return 1.0
    unit = {"limit": max(largest, parameter.support[0]), "rate": 1 / largest}.get(parameter.dimension, 1.0)
    return float(parameter.relative_prior.scaled(unit).quantile(0.5))


def _energy(
    material: Material, path: StressPath, points: FloatArray, values: FloatArray, step: float = 0.0
) -> FloatArray:
    return np.array([path_energy(material, path, point, values, step) for point in points])


def _difference(material: Material, path: StressPath, points: FloatArray, values: FloatArray) -> FloatArray:
    forward, backward = (_energy(material, path, points, values, step) for step in (DIFFERENCE_STEP, -DIFFERENCE_STEP))
    return np.asarray((forward - backward) / (2 * DIFFERENCE_STEP) / path.loaded_axes)


def _check(claim: str, error: FloatArray | float, problem: str) -> Check:
    largest = float(np.abs(error).max())
    if np.isnan(largest):
        return Check(claim, "it is no number for some values of the parameters")
    return Check(claim, "" if largest <= CHECK_TOLERANCE else problem.format(largest))
