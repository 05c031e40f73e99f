"""The one stress function: the derivative of any strain energy along any path, by an imaginary step or by JAX."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import LoadingMode, Path, SimpleShear, States
from tissuq.experiments.modes.path import STEP, UNMEASURED, Deformation
from tissuq.mechanics.equilibrium import energy_in_equilibrium, has_free_axis
from tissuq.mechanics.material import Addends, Material

MAX_COMPLEX_STEP_VALUES, VALUES_AT_ONCE = 400_000, 10_000
"""Number of stresses from which compiling their derivatives takes less time, and of those that are computed at once."""
REAL_STEPS = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
"""Steps of the stretch for difference quotients: shorter ones where an energy bends more, and rounding matters less.

The shortest is for fibres at rest, whose stiffness jumps where they begin to be stretched.
"""
CHECKED_PLACES = 5
"""Of many parameter values, at how many places some are taken, of which the difference quotient is formed."""
AGREEMENT = 1e-5
"""Relative difference from a real difference quotient beyond which an energy is not differentiable this way."""


def path_energy(material: Material, path: Path, point: Any, values: Any, step: Any = 0.0) -> Any:
    """Return the strain energy (MPa) of a material a step further than a point of a path; JAX differentiates it."""
    return energy_in_equilibrium(material, path.moved(point, step), values)


def engineering_stress(
    material: Material, mode: LoadingMode | Path, stretch: ArrayLike, values: ArrayLike
) -> FloatArray:
    """Return the engineering stress, (1 / loaded axes) dW/dstretch.

    Parameters
    ----------
    material : Material
        The strain energy.
    mode : LoadingMode or Path
        A loading mode with one stress, or one of a mode's paths.
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
        When the material cannot be stretched so far with these parameters, or the mode has several stresses.

    References
    ----------
    Zeraatpisheh, Bordas & Beex (2021), eq. 3 to 11.
    """
    _check_kinds(material=material, loading_mode=mode)
    return stresses_at(material, mode.at(stretch), values)


def _check_kinds(**objects: object) -> None:
    for what, value in objects.items():
        if isinstance(value, str):
            made = f"tissuq.{what}s()['{value}']()"
            raise InputError(f"{what} must be an object, not a name: {made}. tissuq.simulate takes names.")
        if not isinstance(value, Material if what == "material" else LoadingMode | Path):
            raise InputError(f"{what} must be an object, such as one of tissuq.{what}s(), not {value!r:.80}.")


def stresses_at(material: Material, states: States, values: ArrayLike) -> FloatArray:
    """Return the `engineering_stress` at states (n,) of any paths."""
    values = np.asarray(values, dtype=np.float64)
    rows = np.atleast_2d(values)
    curves = _any_stresses(material, states, rows)
    is_borne = np.isfinite(curves).all(axis=0)
    if not is_borne.all():
        symbols = ", ".join(parameter.symbol for parameter in material.parameters)
        stretch = states.abscissa[~is_borne][0]
        reason = _why_none(material, states.among(np.flatnonzero(~is_borne)), rows)
        raise ModelError(
            f"material '{material.name}' has no finite stress at a stretch of {stretch:g} with the "
            f"values of {symbols} that it was given: {reason}."
        )
    return curves if values.ndim == 2 else np.asarray(curves[0])


def _any_stresses(material: Material, states: States, rows: FloatArray) -> FloatArray:
    """Return stresses (m, n) at states (n,) for parameter values (m, k), not finite where there are none."""
    curves = complex_step_stress(material, states, rows)
    if curves is None:
        with _explained(material):
            curves = _scattered(states, lambda path, points: _curves(material, path)(points, rows))
    return curves


NEARLY_ZERO = 1e-3
"""In place of a parameter of zero that an energy divides by."""


def _why_none(material: Material, states: States, rows: FloatArray) -> str:
    """Return why there is no stress at states (n,) with the values (m, k), as a sentence ends."""
    parameters = material.parameters
    zero = (rows == 0) & [not parameter.is_linear and parameter.dimension != "limit" for parameter in parameters]
    if zero.any() and np.isfinite(_any_stresses(material, states, np.where(zero, NEARLY_ZERO, rows))).all():
        named = " and ".join(f"{parameters[column].symbol} = 0" for column in np.flatnonzero(zero.any(axis=0)))
        return f"its formula divides zero by zero where {named}. Give a small number instead ({NEARLY_ZERO:g})"
    if any(parameter.dimension == "limit" for parameter in parameters):
        return "it has locked, or its energy is too large for a number"
    return "its energy is too large for a number"


def stress_basis(material: Material, states: States, nonlinear: ArrayLike = ()) -> FloatArray:
    """Return the stresses of unit linear parameters: the columns of a model linear in them.

    Parameters
    ----------
    material : Material
        The strain energy, proportional to its k linear parameters.
    states : States
        n of them, on any paths.
    nonlinear : (s,) or (m, s) array
        Values of the other parameters in the material's order; several rows give several bases.

    Returns
    -------
    (n, k) or (m, n, k) array, MPa per unit of each linear parameter

    Raises
    ------
    ModelError
        When there is not one value for each nonlinear parameter, or the stress is not linear in the others.

    Examples
    --------
    >>> from tissuq.experiments.modes import Uniaxial
    >>> from tissuq.mechanics import Ogden1, stress_basis
    >>> stress_basis(Ogden1(), Uniaxial().at([0.5, 1.0, 2.0]), nonlinear=[2.0]).ravel().round(12).tolist()
    [-3.5, 0.0, 1.75]
    """
    settings = np.asarray(nonlinear, dtype=np.float64)
    rows = np.atleast_2d(settings)
    _check_nonlinear(material, rows.shape[1:])
    _check_deformations(material, states)
    if len(addends := material.addends) > 1 and not has_free_axis(material, states):
        bases = _bases_of_addends(addends, material.linear_mask, states, rows)
        return bases if settings.ndim == 2 else np.asarray(bases[0])
    curves = complex_step_stress(material, states, material.unit_values(rows).reshape(-1, len(material.parameters)))
    if curves is None:
        curves = _scattered(states, lambda path, points: _bases(material, path)(points, rows))
    bases = np.ascontiguousarray(curves.reshape(len(rows), -1, len(states)).swapaxes(1, 2))
    return bases if settings.ndim == 2 else np.asarray(bases[0])


def _bases_of_addends(addends: Addends, is_linear: BoolArray, states: States, rows: FloatArray) -> FloatArray:
    """Return `stress_basis` (m, n, k) of their sum at values (m, s), the columns of each by themselves."""
    column = np.where(is_linear, np.cumsum(is_linear), np.cumsum(~is_linear)) - 1  # of the basis, or of the rows
    bases = np.empty((len(rows), len(states), int(is_linear.sum())))
    for addend, places in addends:
        linear, nonlinear = column[places][addend.linear_mask], column[places][~addend.linear_mask]
        bases[:, :, linear] = stress_basis(addend, states, rows[:, nonlinear] if len(nonlinear) else ())
    return bases


def stresses_by_basis(material: Material, states: States, values: FloatArray) -> FloatArray:
    """Return the stresses (m, n) at states (n,) for parameter values (m, k), not finite where there are none.

    As sums over `stress_basis`, of a few values at a time, as derivatives like them, where these are linear.
    """
    is_linear = material.linear_mask
    if is_linear.sum() > 1 and has_free_axis(material, states):
        return _any_stresses(material, states, values)
    if is_linear.all():
        return np.asarray(values @ stress_basis(material, states).T)
    count = max(1, MAX_COMPLEX_STEP_VALUES // (len(states) * int(is_linear.sum())))
    blocks = [values[start : start + count] for start in range(0, len(values), count)]
    bases = (stress_basis(material, states, block[:, ~is_linear]) for block in blocks)
    pairs = zip(bases, blocks, strict=True)
    return np.concatenate([np.einsum("nsk,nk->ns", basis, block[:, is_linear]) for basis, block in pairs])


def traced_stress_basis(material: Material, states: States, nonlinear: Any) -> Any:
    """Return the (n, k) `stress_basis` at nonlinear values (s,) in JAX: to be differentiated, mapped and compiled."""
    _check_nonlinear(material, np.shape(nonlinear))
    _check_deformations(material, states)
    jnp = differentiator().numpy
    is_linear = material.linear_mask
    values = jnp.asarray(np.eye(is_linear.size)[is_linear]).at[:, ~is_linear].set(nonlinear)
    with _explained(material):
        columns = [
            (numbers, _stresses(material, path)(jnp.asarray(points), values).T)
            for path, points, numbers in states.by_path()
        ]
    order = np.argsort(np.concatenate([numbers for numbers, _ in columns]))
    return jnp.concatenate([column for _, column in columns])[order] if len(columns) > 1 else columns[0][1]


def complex_step_stress(material: Material, states: States, values: FloatArray) -> FloatArray | None:
    """Return engineering stresses (m, n) at states (n,) for parameter values (m, k), or None.

    None where there are many, or where the energy is not analytic arithmetic of NumPy arrays: written with jax.numpy,
    or with absolute values, branches or the like, which a real difference quotient shows.
    """
    if len(states) * len(values) > MAX_COMPLEX_STEP_VALUES:
        return None
    together = max(1, VALUES_AT_ONCE // max(1, len(states)))
    blocks = [values[start : start + together] for start in range(0, max(1, len(values)), together)]
    try:
        with np.errstate(all="ignore"):
            slopes: list[FloatArray] = []
            for block in blocks:
                if (of_block := _complex_step_slopes(material, states, block)) is None:
                    return None
                slopes.append(of_block)
            stacked = np.concatenate(slopes)
            rows = np.arange(len(values))
            columns = values.shape[1]  # of a basis at most, whose rows follow one another: all of them are checked
            if np.isfinite(stacked).all() and len(rows) > CHECKED_PLACES * columns:
                starts = np.linspace(0, len(rows) - columns, CHECKED_PLACES).astype(int)
                rows = np.unique(starts[:, None] + np.arange(columns))
            checks = (rows[start : start + together] for start in range(0, len(rows), together))
            if all(_are_slopes(material, states, values[check], stacked[check]) for check in checks):
                return np.asarray(stacked / states.loaded_axes)
    except (TypeError, ValueError):
        pass
    return None


def _energy_at(material: Material, states: States, step: Any, values: FloatArray) -> Any:
    moved = _moved if len(states) <= VALUES_AT_ONCE else States.moved
    return energy_in_equilibrium(material, moved(states, step), values.T[:, :, None])


def _complex_step_slopes(material: Material, states: States, values: FloatArray) -> FloatArray | None:
    """Return the slopes (m, n) of an energy by an imaginary step; None where the step is lost."""
    at_step = _energy_at(material, states, 1j * STEP, values)
    if not isinstance(at_step, np.ndarray) or not np.iscomplexobj(at_step):
        return None
    return np.broadcast_to(at_step.imag / STEP, (len(values), len(states)))


def _are_slopes(material: Material, states: States, values: FloatArray, slopes: FloatArray) -> bool:
    """Return whether slopes (m, n) are those of real difference quotients, too."""
    size = np.maximum(np.abs(slopes), np.abs(slopes).max(axis=1, keepdims=True, initial=0.0) * 1e-2)
    agrees = np.zeros(slopes.shape, dtype=bool)
    for step in REAL_STEPS:
        ends = [_energy_at(material, states, sign * step, values) for sign in (1, -1)]
        agrees |= np.abs(slopes - (ends[0] - ends[1]) / (2 * step)) <= AGREEMENT * size + 1e-300
        if agrees.all():
            return True
    return False


@lru_cache(maxsize=32)
def _moved(states: States, step: complex) -> Deformation:
    """Return `States.moved`, which no energy may write to, as others get it, too."""
    deformation = states.moved(step)
    stretches, plane = (tuple(map(_read_only, part)) for part in (deformation.stretches, deformation.plane))
    return Deformation(stretches, plane)


def _read_only(component: Any) -> Any:
    if not isinstance(component, np.ndarray):
        return component
    view = component.view()
    view.flags.writeable = False
    return view


def _check_deformations(material: Material, states: States) -> None:
    """Refuse states at which the stress is no sum over parameters."""
    if not material.felt_axes:
        return
    for path, points in zip(states.paths, states.points, strict=True):
        if problem := material.why_not(path.moved(points[:1], 0.0)):
            raise ModelError(problem)


def _check_nonlinear(material: Material, shape: tuple[int, ...]) -> None:
    symbols = [parameter.symbol for parameter in material.parameters if not parameter.is_linear]
    if shape != (len(symbols),):
        raise ModelError(
            f"the stress of material '{material.name}' is linear in its parameters only at given values of "
            f"{', '.join(symbols) or 'nothing else'}, so its basis needs {len(symbols)} of them: "
            f"it was given the shape {shape}."
        )


def initial_shear_modulus(material: Material, values: ArrayLike) -> float:
    """Return the shear modulus at the reference, in MPa: the initial slope in simple shear."""
    _check_kinds(material=material)
    with _explained(material):
        return float(_initial_slope(material)(np.asarray(values, dtype=np.float64)))


def _stresses(material: Material, path: Path) -> Any:
    """Return the function of points (n,) and parameter values (m, k) that gives stresses (m, n)."""
    jax = differentiator()

    def stress(point: Any, values: Any) -> Any:
        slope = jax.grad(path_energy, argnums=4)(material, path, point, values, 0.0)
        return slope / path.loaded_axes

    return jax.vmap(jax.vmap(stress, (0, None)), (None, 0))


@lru_cache(maxsize=256)
def _curves(material: Material, path: Path) -> Any:
    return differentiator().jit(_stresses(material, path))


@lru_cache(maxsize=256)
def _bases(material: Material, path: Path) -> Any:
    """Return the compiled function of points (n,) and nonlinear values (m, s) that gives bases (m, k, n)."""
    jax = differentiator()

    def basis(points: Any, nonlinear: Any) -> Any:
        return traced_stress_basis(material, States((path,), (points,), (UNMEASURED,)), nonlinear).T

    return jax.jit(jax.vmap(basis, (None, 0)))


def _scattered(states: States, function: Callable[[Path, FloatArray], Any]) -> FloatArray:
    """Return what a function of a path and points (g,) gives, (..., g), for all states (..., n)."""
    columns = [(numbers, np.asarray(function(path, points))) for path, points, numbers in states.by_path()]
    if len(columns) == 1:
        return columns[0][1]
    order = np.argsort(np.concatenate([numbers for numbers, _ in columns]))
    return np.concatenate([column for _, column in columns], axis=-1)[..., order]


@lru_cache(maxsize=256)
def _initial_slope(material: Material) -> Any:
    jax = differentiator()
    slope = jax.grad(jax.grad(path_energy, argnums=2), argnums=2)
    return jax.jit(lambda values: slope(material, SimpleShear().path, 0.0, values))


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
