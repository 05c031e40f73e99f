"""The one stress function: the derivative of any strain energy along any loading mode."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import ModelError
from tissuq.experiments.modes import Path, SimpleShear
from tissuq.mechanics.complex_step import complex_step_stress
from tissuq.mechanics.material import Material

__all__ = ["engineering_stress", "initial_shear_modulus", "path_energy", "stress_basis", "traced_stress_basis"]


def path_energy(material: Material, mode: Path, stretch: Any, values: Any, step: Any = 0.0) -> Any:
    """Return the strain energy (MPa) of a material a step further than a stretch of a mode; JAX differentiates it."""
    return material.energy_of(mode.moved(stretch, step), values)


def engineering_stress(material: Material, mode: Path, stretch: ArrayLike, values: ArrayLike) -> NDArray[np.float64]:
    """Return the engineering stress, (1 / loaded axes) dW/dstretch.

    Parameters
    ----------
    material : Material
        The strain energy.
    mode : Path
        A loading mode with one stress, or one of a mode's channels.
    stretch : (n,) or (n, c) array, dimensionless
        Points of the mode.
    values : (k,) or (m, k) array
        Parameter values in the material's order; several rows give several curves.

    Returns
    -------
    (n,) or (m, n) array, MPa

    Raises
    ------
    ModelError
        When the material cannot be stretched so far with these parameters.

    References
    ----------
    Zeraatpisheh, Bordas & Beex (2021), eq. 3 to 11.
    """
    values, points = np.asarray(values, dtype=np.float64), np.asarray(stretch, dtype=np.float64)
    curves = complex_step_stress(material, mode, points, np.atleast_2d(values))
    if curves is None:
        with _explained(material):
            curves = np.asarray(_curves(material, mode)(points, np.atleast_2d(values)))
    is_borne = np.isfinite(curves).all(axis=0)
    if not is_borne.all():
        symbols = ", ".join(each.symbol for each in material.parameters)
        beyond = mode.abscissa(points)[~is_borne][0]
        raise ModelError(
            f"material '{material.name}' has no finite stress at a stretch of {beyond:g} with the "
            f"values of {symbols} that it was given: it has locked, or its energy is too large for a number."
        )
    return curves if values.ndim == 2 else np.asarray(curves[0])


def stress_basis(material: Material, mode: Path, stretch: ArrayLike, nonlinear: ArrayLike = ()) -> NDArray[np.float64]:
    """Return the stresses of unit linear parameters: the columns of a model linear in them.

    Parameters
    ----------
    material : Material
        The strain energy, proportional to its k linear parameters.
    mode : Path
        A loading mode with one stress, or one of a mode's channels.
    stretch : (n,) or (n, c) array, dimensionless
        Points of the mode.
    nonlinear : (s,) or (m, s) array
        Values of the other parameters in the material's order; several rows give several bases.

    Returns
    -------
    (n, k) or (m, n, k) array, MPa per unit of each linear parameter

    Raises
    ------
    ModelError
        When there is not one value for each nonlinear parameter.

    Examples
    --------
    >>> from tissuq.experiments.modes import Uniaxial
    >>> from tissuq.mechanics import Ogden1, stress_basis
    >>> stress_basis(Ogden1(), Uniaxial(), [0.5, 1.0, 2.0], nonlinear=[2.0]).ravel().round(12).tolist()
    [-3.5, 0.0, 1.75]
    """
    settings, points = np.asarray(nonlinear, dtype=np.float64), np.asarray(stretch, dtype=np.float64)
    rows = np.atleast_2d(settings)
    _check_nonlinear(material, rows.shape[1:])
    is_linear = np.array([parameter.is_linear for parameter in material.parameters])
    values = np.repeat(np.eye(is_linear.size)[is_linear][None], len(rows), axis=0)
    values[:, :, ~is_linear] = rows[:, None]
    found = complex_step_stress(material, mode, points, values.reshape(-1, is_linear.size))
    if found is not None:
        bases = np.ascontiguousarray(found.reshape(len(rows), -1, len(points)).swapaxes(1, 2))
    else:
        bases = np.asarray(_bases(material, mode)(points, rows))
    return bases if settings.ndim == 2 else np.asarray(bases[0])


def traced_stress_basis(material: Material, mode: Path, stretch: Any, nonlinear: Any) -> Any:
    """Return the (n, k) `stress_basis` at nonlinear values (s,) in JAX: to be differentiated, mapped and compiled."""
    _check_nonlinear(material, np.shape(nonlinear))
    jnp = differentiator().numpy
    is_linear = np.array([parameter.is_linear for parameter in material.parameters])
    unit = jnp.asarray(np.eye(is_linear.size)[is_linear])
    with _explained(material):
        return _stresses(material, mode)(jnp.asarray(stretch), unit.at[:, ~is_linear].set(nonlinear)).T


def _check_nonlinear(material: Material, shape: tuple[int, ...]) -> None:
    others = [parameter.symbol for parameter in material.parameters if not parameter.is_linear]
    if shape != (len(others),):
        raise ModelError(
            f"the stress of material '{material.name}' is linear in its parameters only at given values of "
            f"{', '.join(others) or 'nothing else'}, so its basis needs {len(others)} of them: "
            f"it was given the shape {shape}."
        )


def initial_shear_modulus(material: Material, values: ArrayLike) -> float:
    """Return the shear modulus at the reference, in MPa: the initial slope in simple shear."""
    with _explained(material):
        return float(_initial_slope(material)(np.asarray(values, dtype=np.float64)))


def _stresses(material: Material, mode: Path) -> Any:
    """Return the function of stretches (n,) and parameter values (m, k) that gives stresses (m, n)."""
    jax = differentiator()

    def stress(stretch: Any, values: Any) -> Any:
        slope = jax.grad(path_energy, argnums=4)(material, mode, stretch, values, 0.0)
        return slope / mode.loaded_axes

    return jax.vmap(jax.vmap(stress, (0, None)), (None, 0))


@lru_cache(maxsize=256)
def _curves(material: Material, mode: Path) -> Any:
    return differentiator().jit(_stresses(material, mode))


@lru_cache(maxsize=256)
def _bases(material: Material, mode: Path) -> Any:
    jax = differentiator()
    basis = partial(traced_stress_basis, material, mode)
    return jax.jit(jax.vmap(basis, (None, 0)))


@lru_cache(maxsize=256)
def _initial_slope(material: Material) -> Any:
    jax = differentiator()
    slope = jax.grad(jax.grad(path_energy, argnums=2), argnums=2)
    return jax.jit(lambda values: slope(material, SimpleShear(), 0.0, values))


@contextmanager
def _explained(material: Material) -> Iterator[None]:
    """Say in words that an energy is written with the wrong library."""
    try:
        yield
    except differentiator().errors.TracerArrayConversionError as error:
        raise ModelError(
            f"the strain energy of material '{material.name}' cannot be differentiated: write it with plain arithmetic "
            "and jax.numpy (jnp.exp, not np.exp)."
        ) from error


def differentiator() -> Any:
    """Return JAX in double precision, imported when it is first needed."""
    import jax

    jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]
    return jax
