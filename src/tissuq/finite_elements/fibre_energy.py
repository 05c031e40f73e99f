"""The energy of fibres at points of a body, and its derivatives by the deformation gradient (JAX)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import InputError
from tissuq.mechanics import FibreMaterial
from tissuq.mechanics.stress import differentiator

__all__ = ["FibreEnergy", "Fibres"]

FloatArray = NDArray[np.float64]
Fibres = tuple[tuple[FibreMaterial, tuple[float, ...]], ...]

UNIT_TOLERANCE = 1e-6
"""Largest error of the lengths of directions and of their scalar product: above the rounding of single precision."""


@dataclass(frozen=True, eq=False)
class FibreEnergy:
    """W(I1, C11, C22, C12) of fibres, of J^(-2/3) C, C = F'F: Cij = ai . C aj in the plane of the directions a1 and a2.

    What is compiled serves all draws of a posterior: parameters and directions are arguments.

    Attributes
    ----------
    fibres : tuple of (FibreMaterial, tuple of float)
        Materials whose energies are added, with their parameters.
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
