"""The distortional energy of a draw or a material, and its derivatives along the principal stretches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.ensemble import EnergyDraw
from tissuq.errors import ModelError
from tissuq.mechanics import Material
from tissuq.mechanics.pieces import PiecewiseEnergy
from tissuq.mechanics.stress import differentiator

__all__ = ["DistortionalEnergy", "distortional_energy"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DistortionalEnergy:
    """W(J^(-1/3) l1, J^(-1/3) l2, J^(-1/3) l3) of an isotropic material, J = l1 l2 l3.

    What is compiled serves all draws of one posterior, because their numbers are arguments of it.

    Attributes
    ----------
    materials : tuple of Material
        Those whose energies are added.
    values : tuple of tuple of float
        The parameters of each.
    discrepancy : PiecewiseEnergy or None
        A further energy.
    """

    materials: tuple[Material, ...]
    values: tuple[tuple[float, ...], ...]
    discrepancy: PiecewiseEnergy | None = None

    def derivatives(self, stretches: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gradient (3, n) and the Hessian (3, 3, n), MPa, at principal stretches (3, n)."""
        gradient, hessian = _derivatives(self.materials)(self.values, self.discrepancy, stretches)
        return np.asarray(gradient), np.asarray(hessian)

    def __call__(self, stretches: FloatArray) -> FloatArray:
        """Return the energy (n,), MPa, at principal stretches (3, n)."""
        own = tuple(np.asarray(stretches) / np.prod(stretches, axis=0) ** (1 / 3))
        found = sum(each.energy(own, given) for each, given in zip(self.materials, self.values, strict=True))
        return np.asarray(found if self.discrepancy is None else found + self.discrepancy(own))

    @property
    def initial_shear_modulus(self) -> float:
        """Half of what the energy's second derivative along l1 - l2 is at the reference, in MPa."""
        _, hessian = self.derivatives(np.ones((3, 1)))
        return float(hessian[0, 0, 0] - hessian[0, 1, 0]) / 2


def distortional_energy(material: Material, values: ArrayLike | None = None) -> DistortionalEnergy:
    """Return the energy of a draw of an ensemble, or of a material with values of its parameters.

    Raises
    ------
    ModelError
        When the material has fibres, or there is not one value for each parameter.
    """
    if isinstance(material, EnergyDraw):
        kinds, numbers = zip(*material.parts, strict=True)
        return DistortionalEnergy(kinds, numbers, material.discrepancy)
    if not material.is_isotropic:
        raise ModelError(
            f"material '{material.name}' has fibres, and the material for finite elements is of principal stretches: "
            "it takes isotropic materials only."
        )
    given = tuple(map(float, np.atleast_1d(np.asarray([] if values is None else values, dtype=np.float64))))
    if len(given) != len(material.parameters):
        symbols = ", ".join(each.symbol for each in material.parameters)
        raise ModelError(f"material '{material.name}' needs one value for each of {symbols}, and was given {given}.")
    return DistortionalEnergy((material,), (given,))


@lru_cache(maxsize=64)
def _derivatives(materials: tuple[Material, ...]) -> Any:
    """Return the compiled function of numbers and stretches (3, n) that gives gradients and Hessians."""
    jax = differentiator()

    def energy(point: Any, values: Sequence[Sequence[Any]], discrepancy: PiecewiseEnergy | None) -> Any:
        own = tuple(point / (point[0] * point[1] * point[2]) ** (1 / 3))
        found = sum(each.energy(own, given) for each, given in zip(materials, values, strict=True))
        return found if discrepancy is None else found + discrepancy(own)

    both = jax.vmap(lambda *given: (jax.grad(energy)(*given), jax.hessian(energy)(*given)), (1, None, None), (-1, -1))
    return jax.jit(lambda values, discrepancy, stretches: both(stretches, values, discrepancy))
