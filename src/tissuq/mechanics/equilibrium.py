"""Lateral stretches that a test leaves to the material: those at which no lateral stress acts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tissuq.errors import ModelError
from tissuq.experiments.modes import Deformation, States
from tissuq.experiments.modes.path import STEP
from tissuq.mechanics.arithmetic import exp, library, log, sqrt
from tissuq.mechanics.material import Material

WIDEST = 4.0
"""Largest distance of the logarithm of the lateral stretch from that of an isotropic material."""
HALVINGS, NEWTON_STEPS = 16, 3
"""Steps of the search: halves of that distance, then steps that double the digits."""
NEWTON_STEP = 1e-6
"""Step of the logarithm for the slope of the lateral stress, which sets the speed of the search and not its end."""


def energy_in_equilibrium(material: Material, deformation: Deformation, values: Any) -> Any:
    """Return the energy (MPa) of a deformation `in_equilibrium`.

    It is the least over the free lateral stretch, and its derivative along the loaded axis the stress of that axis.
    """
    return material.energy_of(in_equilibrium(material, deformation, values), values)


def has_free_axis(material: Material, states: States) -> bool:
    """Return whether a material feels an axis of the plane along which some states leave the stretch to it."""
    if not material.felt_axes:
        return False
    moved = (path.moved(points[:1], 0.0) for path, points in zip(states.paths, states.points, strict=True))
    return any(deformation.plane[axis] is None for deformation in moved for axis in material.felt_axes)


def why_no_equilibrium(material: Material, deformation: Deformation) -> str:
    """Return why a material does not deform as a test says that leaves an axis to it; an empty text where it does."""
    problem = material.why_not(deformation)
    return "" if deformation.has_free_axis and not material.shears and not material.needs_matrix else problem


def in_equilibrium(material: Material, deformation: Deformation, values: Any) -> Deformation:
    """Return a deformation with the lateral stretch that a material has where a test leaves it free.

    It is the one without lateral stress, of least energy, and sought where the material feels it: the energy is a
    convex function of its logarithm. Of an imaginary step of the loaded axis the lateral stretch needs none, as the
    energy does not change with it.

    Parameters
    ----------
    material : Material
    deformation : Deformation
        With None or NaN where the test does not say how the plane is stretched.
    values : (k,) array, or k arrays that the stretches are broadcast against

    Raises
    ------
    ModelError
        When the material does not deform as the mode says.
    """
    is_open = [_is_open(component) for component in deformation.plane[:2]]
    if not any(np.any(is_open[axis]) for axis in material.felt_axes):
        return deformation
    if np.all(np.logical_and(*is_open)) or material.shears or material.needs_matrix:
        raise ModelError(material.why_not(deformation))
    is_traced = np not in (library(deformation.stretches[0]), library(values))
    find = _logarithm_in_jax if is_traced else _logarithm_in_numpy
    return _completed(deformation, is_open, find(material, deformation, is_open, values))


def _is_open(component: Any) -> Any:
    """Return where a component of C is left to the material."""
    return True if component is None else np.isnan(np.real(component)) if isinstance(component, np.ndarray) else False


def _completed(deformation: Deformation, is_open: list[Any], logarithm: Any) -> Deformation:
    """Return a deformation with a lateral stretch of that logarithm where one axis of the plane is open."""
    where, lateral = library(logarithm).where, exp(logarithm)
    c11, c22, c12 = (0.0 if component is None else component for component in deformation.plane)
    is_free = np.logical_or(*is_open)
    along = sqrt(where(is_open[0], c22, c11))
    free = along, lateral, 1 / (along * lateral)
    pairs = zip(free, deformation.stretches, strict=True)
    stretches = tuple(where(is_free, *pair) for pair in pairs)
    plane = where(is_open[0], lateral**2, c11), where(is_open[1], lateral**2, c22), where(is_free, 0.0, c12)
    return Deformation((*stretches,), plane)


def _logarithm_in_numpy(material: Material, deformation: Deformation, is_open: list[Any], values: Any) -> Any:
    real = Deformation(*(tuple(_real(c) for c in part) for part in (deformation.stretches, deformation.plane)))

    def lateral_stress(logarithm: Any) -> Any:
        energy = material.energy_of(_completed(real, is_open, logarithm + 1j * STEP), values)
        return energy.imag / STEP

    with np.errstate(all="ignore"):
        isotropic = _isotropic(real, is_open)
        low, high = isotropic - WIDEST, isotropic + WIDEST
        for _ in range(HALVINGS):
            low, high, _ = _halved(low, high, isotropic, lateral_stress)
        return _refined(low, high, lateral_stress)


def _logarithm_in_jax(material: Material, deformation: Deformation, is_open: list[Any], values: Any) -> Any:
    """Return the logarithm with its first derivatives by the parameters and by the loaded stretch."""
    from jax import jvp, lax

    def lateral_stress(logarithm: Any, still: bool = True) -> Any:
        parts = deformation.stretches, deformation.plane, values
        stretches, plane, constants = lax.stop_gradient(parts) if still else parts

        def energy(logarithm: Any) -> Any:
            return material.energy_of(_completed(Deformation(stretches, plane), is_open, logarithm), constants)

        return jvp(energy, (logarithm,), (library(logarithm).ones_like(logarithm),))[1]

    isotropic = lax.stop_gradient(_isotropic(deformation, is_open))
    ends = isotropic - WIDEST, isotropic + WIDEST, isotropic
    low, high, _ = lax.fori_loop(0, HALVINGS, lambda _, ends: _halved(ends[0], ends[1], ends[2], lateral_stress), ends)
    logarithm = lax.stop_gradient(_refined(low, high, lateral_stress))
    slope = (lateral_stress(logarithm + NEWTON_STEP) - lateral_stress(logarithm)) / NEWTON_STEP
    return logarithm - lateral_stress(logarithm, still=False) / slope


def _real(component: Any) -> Any:
    return component if component is None else np.real(component)


def _isotropic(deformation: Deformation, is_open: list[Any]) -> Any:
    """Return the logarithm of the lateral stretch that an isotropic material has."""
    c11, c22, _ = (0.0 if component is None else component for component in deformation.plane)
    return -0.25 * log(library(c11 + c22).where(is_open[0], c22, c11))


def _halved(low: Any, high: Any, isotropic: Any, lateral_stress: Callable[[Any], Any]) -> tuple[Any, Any, Any]:
    """Return the half of an interval in which the lateral stress, which rises, changes its sign, or where it is zero.

    Where there is none the material has locked, or its energy is too large: farther away than it can be.
    """
    middle, arrays = 0.5 * (low + high), library(low)
    stress = lateral_stress(middle)
    stress = arrays.where(arrays.isnan(stress), arrays.where(middle < isotropic, -1.0, 1.0), stress)
    return arrays.where(stress <= 0, middle, low), arrays.where(stress < 0, high, middle), isotropic


def _refined(low: Any, high: Any, lateral_stress: Callable[[Any], Any]) -> Any:
    arrays, logarithm = library(low), 0.5 * (low + high)
    for _ in range(NEWTON_STEPS):
        stress = lateral_stress(logarithm)
        step = stress * NEWTON_STEP / (lateral_stress(logarithm + NEWTON_STEP) - stress)
        logarithm = arrays.clip(logarithm - arrays.where(arrays.isfinite(step), step, 0.0), low, high)
    return logarithm
