"""What every material must fulfil, checked on one: for users' own laws and for those of the library."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode, loading_modes
from tissuq.mechanics.material import Material
from tissuq.mechanics.path import invariants
from tissuq.mechanics.stress import engineering_stress, initial_shear_modulus, path_energy, traced_stress_basis
from tissuq.parameters import Parameter

__all__ = ["Check", "checked", "some_values"]

FloatArray = NDArray[np.float64]

STRETCH = np.array([0.8, 0.9, 0.97, 1.04, 1.15, 1.3])
STEP = 1e-5
AGREEMENT = 1e-5


@dataclass(frozen=True)
class Check:
    """One claim about a material; ``problem`` says why it does not hold, and is empty where it does."""

    claim: str
    problem: str = ""


def checked(material: Material) -> list[Check]:
    """Check a material at some values of its parameters, over moderate stretches in every loading mode."""
    modes = [kind() for kind in loading_modes().values()]
    values = some_values(material, STRETCH)
    energy = np.array([[_energy(material, mode, each, values) for each in STRETCH] for mode in modes])
    checks = [
        _check("the energy is finite", np.abs(np.where(np.isfinite(energy), 0.0, inf)), "it is not everywhere"),
        _check(
            "the energy is zero at the reference", _energy(material, modes[0], 1.0, values), "there it is {:.3g} MPa"
        ),
    ]
    if any(each.problem for each in checks):
        return checks
    stress = np.array([engineering_stress(material, mode, STRETCH, values) for mode in modes])
    scale = np.abs(stress).max()
    if not np.isfinite(scale) or not scale:
        return [*checks, Check("it has a stress", "there is none, or one that is not finite")]
    rest = np.array([engineering_stress(material, mode, [1.0], values)[0] for mode in modes])
    slope = np.array([_difference(material, mode, values) for mode in modes])
    modulus = initial_shear_modulus(material, values)
    checks += [
        _check("the stress is zero at the reference", rest / scale, "there it is {:.3g} of the largest"),
        _check("the stress is the derivative of the energy", (stress - slope) / scale, "they differ by {:.3g}"),
        Check("the initial shear modulus is positive", "" if modulus > 0 else f"it is {modulus:.3g} MPa"),
    ]
    is_linear = np.array([each.is_linear for each in material.parameters])
    if is_linear.any():
        twice = np.where(is_linear, [2.0, *3.0 + np.arange(1, len(values))], 1.0) * values
        both = engineering_stress(material, modes[0], STRETCH, twice)
        basis = np.asarray(traced_stress_basis(material, modes[0], STRETCH, values[~is_linear]))
        symbols = ", ".join(each.symbol for each in material.parameters if each.is_linear)
        wrong = (both - basis @ twice[is_linear]) / np.abs(both).max()
        checks.append(_check(f"the stress is proportional to {symbols}", wrong, "it differs by {:.3g}"))
    return checks


def some_values(material: Material, stretch: FloatArray) -> FloatArray:
    """Return values of a material's parameters for which it can bear these stretches: one, or medians of priors."""
    modes = [kind() for kind in loading_modes().values()]
    largest = max(float(invariants(mode, stretch)[0].max()) for mode in modes)
    return np.array([_value(each, largest) for each in material.parameters])


def _value(parameter: Parameter, largest: float) -> float:
    if parameter.relative_prior is None:
        return 1.0
    unit = {"limit": max(largest, parameter.support[0]), "rate": 1 / largest}.get(parameter.dimension, 1.0)
    return float(parameter.relative_prior.scaled(unit).quantile(0.5))


def _energy(material: Material, mode: LoadingMode, stretch: float, values: FloatArray) -> float:
    return float(path_energy(material, mode, np.float64(stretch), values))


def _difference(material: Material, mode: LoadingMode, values: FloatArray) -> FloatArray:
    ends = [[_energy(material, mode, each + step, values) for each in STRETCH] for step in (STEP, -STEP)]
    return np.asarray((np.array(ends[0]) - ends[1]) / (2 * STEP) / mode.loaded_axes)


def _check(claim: str, wrong: FloatArray | float, problem: str) -> Check:
    largest = float(np.abs(wrong).max())
    if np.isnan(largest):
        return Check(claim, "it is no number for some values of the parameters")
    return Check(claim, "" if largest <= AGREEMENT else problem.format(largest))
