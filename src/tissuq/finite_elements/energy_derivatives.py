"""Derivatives of energies at points of a body: isotropic ones by principal stretches, those of fibres by gradients.

Isotropic energies are differentiated by complex steps of NumPy's arithmetic, for which nothing is compiled; one that is
no such arithmetic (written with jax.numpy) by JAX, as the energies of fibres are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.mechanics import FibreMaterial
from tissuq.mechanics.stress import differentiator

IsochoricEnergy = Callable[[tuple[Any, Any, Any]], Any]
"""An energy (n,) of three principal stretches (n,) whose product is one."""
Fibres = tuple[tuple[FibreMaterial, tuple[float, ...]], ...]
"""Materials whose energies are added, with their parameters."""

AXES = np.array([[1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]]) / np.sqrt([[2.0], [6.0]])
"""Orthonormal logarithmic strains without change of volume, along which an isochoric energy changes."""
STEP = 1e-30
"""Imaginary step: its square is nothing."""
NUDGE = 4e-6
"""Real step of logarithmic strains, in which gradients change by far more than their rounding errors."""
SAMPLE = np.log([[1.02, 1.0, 0.99], [0.97, 1.01, 1.03], [1.05, 0.98, 1.01]])
"""Stretches at which it is seen whether complex steps give derivatives."""
AGREEMENT = 1e-4
"""Largest difference to a real difference quotient, relative to the largest slope."""
UNIT_TOLERANCE = 1e-6
"""Largest error of the lengths of directions and of their scalar product: above the rounding of single precision."""


def gradient(energy: IsochoricEnergy, stretches: FloatArray) -> FloatArray:
    """Return dW/dl_i (3, n) of W(J^(-1/3) l) at principal stretches (3, n), J = l1 l2 l3.

    Examples
    --------
    >>> import numpy as np
    >>> gradient(lambda l: 0.5 * (l[0]**2 + l[1]**2 + l[2]**2 - 3), np.array([[2.0], [0.5], [1.0]])).ravel().round(9)
    array([ 1.125, -3.   , -0.75 ])
    """
    along = AXES.T @ _slopes(energy, _isochoric_logs(stretches))
    return np.asarray(along / stretches)  # not a number where a stretch is none


def gradient_and_hessian(energy: IsochoricEnergy, stretches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return dW/dl_i (3, n) and d2W/dl_i dl_j (3, 3, n) of W(J^(-1/3) l) at principal stretches (3, n)."""
    logs = _isochoric_logs(stretches)
    along = AXES.T @ _slopes(energy, logs)
    ends = [[_slopes(energy, logs + sign * NUDGE * axis[:, None]) for sign in (1, -1)] for axis in AXES]
    rates = np.stack([(high - low) / (2 * NUDGE) for high, low in ends])
    symmetric = (rates + np.swapaxes(rates, 0, 1)) / 2
    hessian = np.einsum("ai,abn,bj->ijn", AXES, symmetric, AXES)
    hessian[np.arange(3), np.arange(3)] -= along
    return along / stretches, hessian / (stretches[:, None] * stretches[None])


def is_arithmetic(energy: IsochoricEnergy) -> bool:
    """Return whether complex steps differentiate an energy, as a real difference quotient shows."""
    logs = (SAMPLE - SAMPLE.mean(axis=1, keepdims=True)).T
    try:
        with np.errstate(all="ignore"):
            slopes = _slopes(energy, logs)
            ends = [[energy(tuple(np.exp(logs + sign * NUDGE * axis[:, None]))) for sign in (1, -1)] for axis in AXES]
    except (TypeError, ValueError):
        return False
    if not all(isinstance(value, np.ndarray) for pair in ends for value in pair):
        return False
    wanted = np.array([(high - low) / (2 * NUDGE) for high, low in ends])
    return bool((np.abs(slopes - wanted) <= AGREEMENT * np.abs(wanted).max()).all())


def _isochoric_logs(stretches: FloatArray) -> FloatArray:
    """Return the logarithms (3, n) without change of volume, zero where a stretch is no number."""
    logs = np.log(stretches)
    return np.asarray(np.where(np.isfinite(logs).all(axis=0), logs - logs.mean(axis=0), 0.0))


def _slopes(energy: IsochoricEnergy, logs: FloatArray) -> FloatArray:
    """Return the slopes (2, n) of an energy along `AXES` at logarithmic strains (3, n)."""
    with np.errstate(all="ignore"):  # a solver's step may have gone too far
        values = [energy(tuple(np.exp(logs + 1j * STEP * axis[:, None]))) for axis in AXES]
    return np.array([np.broadcast_to(np.imag(value) / STEP, logs.shape[1]) for value in values])


@dataclass(frozen=True, eq=False)
class FibreEnergy:
    """W(I1, C11, C22, C12) of fibres, of J^(-2/3) C, C = F'F: Cij = ai . C aj in the plane of the directions a1 and a2.

    What is compiled serves all draws of a posterior: parameters and directions are arguments.

    Attributes
    ----------
    fibres : tuple of (FibreMaterial, tuple of float)
        As `Fibres`.
    directions : (2, 3, ...) array
        Axes 1 and 2 of the test in the undeformed body: the same everywhere, or at every point.

    Raises
    ------
    InputError
        When the directions are no two unit vectors at a right angle.
    """

    fibres: Fibres
    directions: FloatArray

    def __post_init__(self) -> None:
        shape, error = self.directions.shape, np.inf
        if shape[:2] == (2, 3):
            products = np.einsum("ai...,bi...->...ab", self.directions, self.directions)
            error = float(np.abs(products - np.eye(2)).max())
        if not error < UNIT_TOLERANCE:
            raise InputError(
                "directions are axis 1 and axis 2 of the test in the body, two unit vectors at a right angle "
                f"(to {UNIT_TOLERANCE:g}) such as [[1, 0, 0], [0, 1, 0]], (2, 3) or (2, 3, quadrature points, "
                f"cells); these are of the shape {shape}, and their scalar products are off by {error:.2g}."
            )

    def derivative(self, order: int, gradients: ArrayLike) -> FloatArray:
        """Return the energy (n,), MPa, its gradient (3, 3, n) or its Hessian (3, 3, 3, 3, n) at gradients (3, 3, ...).

        Raises
        ------
        InputError
            When the directions are not those of so many points.
        """
        F = np.asarray(gradients, dtype=np.float64)
        spare = (1,) * (F.ndim - self.directions.ndim)
        try:
            directions = np.broadcast_to(self.directions.reshape(*self.directions.shape, *spare), (2, *F.shape[1:]))
        except ValueError as error:
            raise InputError(
                f"the directions are those of (quadrature points, cells) = {self.directions.shape[2:]}, and the body "
                f"has {F.shape[2:]}."
            ) from error
        materials, values = zip(*self.fibres, strict=True)
        points = (tensors.reshape(*tensors.shape[:2], -1) for tensors in (F, directions))
        return np.asarray(_compiled(materials)[order](*points, values))


@lru_cache(maxsize=64)
def _compiled(materials: tuple[FibreMaterial, ...]) -> tuple[Any, Any, Any]:
    """Return compiled functions of gradients (3, 3, n), directions (2, 3, n) and values: energy, gradient, Hessian."""
    jax = differentiator()

    def energy(F: Any, directions: Any, values: Any) -> Any:
        isochoric = F * jax.numpy.linalg.det(F) ** (-1 / 3)  # not a number where the volume is not positive
        fibre_1, fibre_2 = directions @ isochoric.T
        plane = fibre_1 @ fibre_1, fibre_2 @ fibre_2, fibre_1 @ fibre_2
        I1 = (isochoric * isochoric).sum()
        pairs = zip(materials, values, strict=True)
        return sum(material.energy_in_plane(I1, plane, numbers) for material, numbers in pairs)

    slopes = jax.grad(energy)
    functions = energy, slopes, jax.jacfwd(slopes)
    return tuple(jax.jit(jax.vmap(function, (-1, -1, None), -1)) for function in functions)
