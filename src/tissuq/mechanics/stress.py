"""The one stress function: the derivative of any strain energy along any loading mode."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import ModelError
from tissuq.experiments.modes import LoadingMode
from tissuq.mechanics.material import Material

__all__ = ["engineering_stress", "initial_shear_modulus", "path_energy", "stress_basis"]


def path_energy(material: Material, mode: LoadingMode, stretch: Any, values: Any) -> Any:
    """Return the strain energy (MPa) of a material at one stretch of a loading mode; JAX differentiates it."""
    squares = [principal * principal for principal in mode.principal_stretches(stretch)]
    I1 = squares[0] + squares[1] + squares[2]
    I2 = squares[0] * squares[1] + squares[1] * squares[2] + squares[2] * squares[0]
    return material.strain_energy(I1, I2, values)


def engineering_stress(
    material: Material, mode: LoadingMode, stretch: ArrayLike, values: ArrayLike
) -> NDArray[np.float64]:
    """Return the engineering stress, (1 / loaded axes) dW/dstretch.

    Parameters
    ----------
    material : Material
        The strain energy.
    mode : LoadingMode
        The deformation path.
    stretch : (n,) array, dimensionless
        Stretches along the path.
    values : (k,) or (m, k) array
        Parameter values in the material's order; several rows give several curves.

    Returns
    -------
    (n,) or (m, n) array, MPa

    References
    ----------
    Zeraatpisheh, Bordas & Beex (2021), eq. 3 to 11.
    """
    values = np.asarray(values, dtype=np.float64)
    jax = differentiator()
    try:
        curves = _curves(material, mode)(np.asarray(stretch, dtype=np.float64), np.atleast_2d(values))
    except jax.errors.TracerArrayConversionError as error:
        raise ModelError(
            f"the strain energy of material '{material.name}' cannot be differentiated: write it with plain arithmetic "
            "and jax.numpy (jnp.exp, not np.exp)."
        ) from error
    return np.asarray(curves if values.ndim == 2 else curves[0])


def stress_basis(material: Material, mode: LoadingMode, stretch: ArrayLike) -> NDArray[np.float64]:
    """Return the (n, k) stresses of unit parameters: the columns of a model linear in its k parameters."""
    return engineering_stress(material, mode, stretch, np.eye(len(material.parameters))).T


def initial_shear_modulus(material: Material, values: ArrayLike) -> float:
    """Return 2 (dW/dI1 + dW/dI2) at the reference, in MPa."""
    jax = differentiator()
    given = np.asarray(values, dtype=np.float64)
    slope = jax.grad(lambda invariants: material.strain_energy(invariants[0], invariants[1], given))
    return float(2 * slope(np.array([3.0, 3.0])).sum())


@lru_cache(maxsize=256)
def _curves(material: Material, mode: LoadingMode) -> Any:
    jax = differentiator()

    def stress(stretch: Any, values: Any) -> Any:
        slope = jax.grad(path_energy, argnums=2)(material, mode, stretch, values)
        return slope / mode.loaded_axes

    return jax.jit(jax.vmap(jax.vmap(stress, (0, None)), (None, 0)))


def differentiator() -> Any:
    """Return JAX in double precision, imported when it is first needed."""
    import jax

    jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]
    return jax
