"""What every material must fulfil, checked on one: for users' own laws and for those of the library."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import Path, loading_modes
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

__all__ = ["Check", "checked", "some_values"]

FloatArray = NDArray[np.float64]

CHANGE = np.array([-0.2, -0.1, -0.03, 0.04, 0.15, 0.3])
"""Of the first control of a mode, from the reference."""
STEP = 1e-5
AGREEMENT = 1e-5


@dataclass(frozen=True)
class Check:
    """One claim about a material; ``problem`` says why it does not hold, and is empty where it does."""

    claim: str
    problem: str = ""


def checked(material: Material) -> list[Check]:
    """Check a material at some values of its parameters, over moderate deformations in every loading mode."""
    paths = _paths(material, CHANGE)
    first, points = next(iter(paths.items()))
    values = some_values(material, CHANGE)
    energy = np.array([_energy(material, path, at, values) for path, at in paths.items()])
    rest = _paths(material, np.zeros(1))
    checks = [
        _check("the energy is finite", np.abs(np.where(np.isfinite(energy), 0.0, inf)), "it is not everywhere"),
        _check(
            "the energy is zero at the reference",
            _energy(material, first, rest[first], values),
            "there it is {:.3g} MPa",
        ),
    ]
    if any(each.problem for each in checks):
        return checks
    stress = np.array([engineering_stress(material, path, at, values) for path, at in paths.items()])
    scale = np.abs(stress).max()
    if not np.isfinite(scale) or not scale:
        return [*checks, Check("it has a stress", "there is none, or one that is not finite")]
    resting = np.array([engineering_stress(material, path, at, values) for path, at in rest.items()])
    slope = np.array([_difference(material, path, at, values) for path, at in paths.items()])
    modulus = initial_shear_modulus(material, values)
    checks += [
        _check("the stress is zero at the reference", resting / scale, "there it is {:.3g} of the largest"),
        _check("the stress is the derivative of the energy", (stress - slope) / scale, "they differ by {:.3g}"),
    ]
    if not material.needs_matrix:
        problem = "" if modulus > 0 else f"it is {modulus:.3g} MPa"
        checks.append(Check("the initial shear modulus is positive", problem))
    is_linear = np.array([each.is_linear for each in material.parameters])
    if is_linear.any():
        twice = np.where(is_linear, [2.0, *3.0 + np.arange(1, len(values))], 1.0) * values
        both = engineering_stress(material, first, points, twice)
        compiled = differentiator().jit(partial(traced_stress_basis, material, first.at(points)))
        basis = np.asarray(compiled(values[~is_linear]))
        symbols = ", ".join(each.symbol for each in material.parameters if each.is_linear)
        wrong = (both - basis @ twice[is_linear]) / np.abs(both).max()
        checks.append(_check(f"the stress is proportional to {symbols}", wrong, "it differs by {:.3g}"))
    return checks


def some_values(material: Material, change: FloatArray) -> FloatArray:
    """Return values of a material's parameters for which it bears such changes of a mode's controls.

    They are one, or medians of priors.
    """
    largest = max(largest_invariants(path.at(points))[0] for path, points in _paths(material, change).items())
    return np.array([_value(each, largest) for each in material.parameters])


def _paths(material: Material, change: FloatArray) -> dict[Path, FloatArray]:
    """Return the path of every stress of every loading mode that the material takes, with points on it."""
    modes = [kind() for kind in loading_modes().values()]
    paths = {path: mode.excursion(change) for mode in modes for path in mode.paths}
    return {path: points for path, points in paths.items() if not material.why_not(path.moved(points, 0.0))}


def _value(parameter: Parameter, largest: float) -> float:
    if parameter.relative_prior is None:
        return 1.0
    unit = {"limit": max(largest, parameter.support[0]), "rate": 1 / largest}.get(parameter.dimension, 1.0)
    return float(parameter.relative_prior.scaled(unit).quantile(0.5))


def _energy(material: Material, path: Path, points: FloatArray, values: FloatArray, step: float = 0.0) -> FloatArray:
    return np.array([path_energy(material, path, point, values, step) for point in points])


def _difference(material: Material, path: Path, points: FloatArray, values: FloatArray) -> FloatArray:
    after, before = (_energy(material, path, points, values, step) for step in (STEP, -STEP))
    return np.asarray((after - before) / (2 * STEP) / path.loaded_axes)


def _check(claim: str, wrong: FloatArray | float, problem: str) -> Check:
    largest = float(np.abs(wrong).max())
    if np.isnan(largest):
        return Check(claim, "it is no number for some values of the parameters")
    return Check(claim, "" if largest <= AGREEMENT else problem.format(largest))
