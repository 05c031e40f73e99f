"""States of deformation that a calibration has seen, and those around them that a model may visit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.assessment.stability import stability_modes, stable_draws
from tissuq.experiments.modes import Deformation, Path, SimpleShear
from tissuq.export.laws import matrix_and_fibres
from tissuq.mechanics.arithmetic import exp, library
from tissuq.posterior.ensemble import Ensemble

ANGLES = (1.0, 7.5, 15.0, 22.5, 30.0, 37.5, 45.0, 52.5, 59.0)
"""Lode angles in degrees: from uniaxial tension, 0, by planar tension, 30, to equibiaxial tension, 60.

At 0 and 60 two stretches are equal, and the difference of their stresses carries no information; nearby it gives the
stiffness against making them differ.
"""
POINTS_PER_PATH = 30
"""Points of a mode, in equal steps, and of a ray of states, denser towards the end of the measured range."""
MAX_LOG_STRAIN = 5.0
"""Largest logarithmic strain of a state."""
PAIRS = np.array([[1.0, -1.0, 0.0], [1.0, 0.0, -1.0], [0.0, 1.0, -1.0]])
SHEARS = np.array([1e-3, 2e-3])
"""Amounts of simple shear, from which the initial modulus follows."""


class PrincipalStates(Path):
    """States of some principal stretches, each with three stresses.

    The stress at a point is a difference of two principal Cauchy stresses, the work per logarithmic strain of one axis
    against the other; of the three of a state each is 2 (l_i^2 - l_j^2) (W1 + l_k^2 W2), so that relative errors of
    these are relative errors of every stress in any test, and of the stiffness against leaving its path.

    Parameters
    ----------
    logs : (n, 3) array
        Logarithmic strains, without change of volume.
    """

    def __init__(self, logs: FloatArray) -> None:
        self.logs = logs
        self.base = np.tile(np.exp(logs.T), 3)
        self.direction = np.repeat(PAIRS.T, len(logs), axis=1)

    @cached_property
    def points(self) -> FloatArray:
        """Indices of the states, three times, once for each difference of stresses."""
        return np.arange(float(self.base.shape[1]))

    @cached_property
    def of_unit_modulus(self) -> FloatArray:
        """The sizes of the stresses of a neo-Hookean material with unit modulus, |l_i^2 - l_j^2|."""
        return np.asarray(np.abs((self.direction * self.base**2).sum(axis=0)))

    def moved(self, point: Any, step: Any) -> Deformation:
        arrays, index = library(point), point.astype(int)
        base, direction = arrays.asarray(self.base)[:, index], arrays.asarray(self.direction)[:, index]
        l1, l2, l3 = base * exp(direction * step)
        return Deformation.along_axes((l1, l2, l3))


class SeenStates(PrincipalStates):
    """All states between uniaxial and equibiaxial tension whose I1 and I2 were measured.

    Of an isotropic, incompressible material these are all states there are (compression along one axis is equibiaxial
    tension).

    Parameters
    ----------
    max_invariants : (float, float)
        The largest I1 - 3 and I2 - 3.
    angles : sequence of float
        Lode angles, degrees.
    """

    def __init__(self, max_invariants: tuple[float, float], angles: Sequence[float] = ANGLES) -> None:
        super().__init__(np.concatenate([_ray(max_invariants, np.radians(angle)) for angle in angles]))


def states_between(max_invariants: tuple[float, float], factors: tuple[float, float]) -> PrincipalStates:
    """Return states in which an invariant is between two factors, at least one, of the largest that were measured."""
    low, high = factors
    logs = SeenStates((high * max_invariants[0], high * max_invariants[1])).logs
    largest = np.stack([np.exp(sign * 2 * logs).sum(axis=1) - 3 for sign in (1, -1)], axis=1) / max_invariants
    return PrincipalStates(logs[largest.max(axis=1) > low * (1 + 1e-9)])


def mode_stretches(low: float, high: float) -> FloatArray:
    """Return the stretches at which a mode is compared: in equal steps on either side of the reference, without it."""
    ends = (np.linspace(1.0, end, POINTS_PER_PATH + 1)[1:] for end in (low, high) if end != 1.0)
    return np.sort(np.concatenate([*ends]))


def moduli(ensemble: Ensemble) -> FloatArray:
    """Return the initial shear moduli (N,) of draws, MPa, to which energy discrepancies and fibres add nothing."""
    matrix, _ = matrix_and_fibres(ensemble)
    without_discrepancy = tuple(replace(draw, discrepancy=None, continuation=None) for draw in matrix)
    return initial_slope(replace(ensemble, draws=without_discrepancy).stress(SimpleShear(), SHEARS).T)


def initial_slope(stress: FloatArray) -> FloatArray:
    """Return the slopes at no shear of shear stresses (2, k) at `SHEARS`, which are odd functions."""
    near, far = stress / SHEARS[:, None]
    return np.asarray((4 * near - far) / 3)


def are_stable(ensemble: Ensemble, reach: float = 1.0) -> BoolArray:
    """Return whether draws (N,) are stable in every mode of one stretch, to so many times the measured invariants."""

    def curves_of(indices: IndexArray) -> Any:
        selected = replace(ensemble, draws=tuple(ensemble[int(index)] for index in indices))
        return selected.stresses_at

    are_isotropic = np.full(len(ensemble), ensemble[0].is_isotropic)
    return stable_draws(curves_of, are_isotropic, ensemble.model.experiment, stability_modes(ensemble[0]), reach)


def _ray(max_invariants: tuple[float, float], angle: float) -> FloatArray:
    """Return the logarithmic strains (n, 3) of a Lode angle, to where an invariant is the largest that was measured."""
    direction = np.cos(angle - 2 * np.pi / 3 * np.array([0.0, 1.0, -1.0]))
    low, high = 0.0, MAX_LOG_STRAIN
    for _ in range(60):
        middle = 0.5 * (low + high)
        logs = 2 * middle * direction
        is_inside = np.expm1(logs).sum() <= max_invariants[0] and np.expm1(-logs).sum() <= max_invariants[1]
        low, high = (middle, high) if is_inside else (low, middle)
    return np.outer(low * np.sin(np.linspace(0.0, np.pi / 2, POINTS_PER_PATH + 1)[1:]), direction)
