"""The initial shear modulus of a fitted material: what an energy discrepancy leaves alone, whatever the material."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import loading_mode
from tissuq.inference.marginal import Marginal, blended, marginal_of_mixture, marginal_of_points, widened
from tissuq.inference.solution import Components, Solution
from tissuq.mechanics import Material, initial_shear_modulus, stress_basis
from tissuq.model import StatisticalModel
from tissuq.prediction.moments import coefficients

__all__ = ["modulus", "modulus_moments", "modulus_symbols"]

FloatArray = NDArray[np.float64]

STEP = 1e-3
"""Of the stretch, for the initial slope."""


def modulus(solution: Solution) -> Marginal:
    """Return the marginal posterior of the material's initial shear modulus, MPa.

    It is linear in the moduli given the exponents, so that it is a mixture of Gaussians as they are.
    """
    model, parts = solution.model, solution.components
    symbols = modulus_symbols(model)
    moduli = _moduli(model, _bent(model, parts))
    if len(symbols) == 1 and not np.ptp(moduli, axis=0).any():
        factor = float(moduli[0, model.column_symbols.index(symbols[0])])
        return _scaled(solution.marginals[symbols[0]], factor)
    bounds = (0.0 if solution.stable_in else -np.inf, np.inf)
    means, root = modulus_moments(model, parts)
    sds = np.linalg.norm(root, axis=1)
    is_wide = sds > 0
    found = []
    if is_wide.any():
        own = marginal_of_mixture(parts.weights[is_wide], means[is_wide], sds[is_wide])
        found.append((float(parts.weights[is_wide].sum()), own))
    if not is_wide.all():
        own = marginal_of_points(means[~is_wide], parts.weights[~is_wide], bounds)
        found.append((float(parts.weights[~is_wide].sum()), own))
    return widened(blended(found, bounds), model.common_error)


def modulus_moments(model: StatisticalModel, parts: Components) -> tuple[FloatArray, FloatArray]:
    """Return means (M,) and roots (M, p) of the initial shear modulus in every component, MPa."""
    moduli, (mean, root) = _moduli(model, _bent(model, parts)), coefficients(model, parts)
    return (moduli * mean).sum(axis=1), np.einsum("mk,mkp->mp", moduli, root)


def modulus_symbols(model: StatisticalModel) -> tuple[str, ...]:
    """Return the parameters that the initial shear modulus is made of."""
    moduli = np.abs(_moduli(model, np.array([model.usual_bent])))[0]
    return tuple(s for s, size in zip(model.column_symbols, moduli, strict=True) if size > 1e-6 * moduli.max())


def _bent(model: StatisticalModel, parts: Components) -> FloatArray:
    """Return the parameters (M, s) in which the material's stress is not linear."""
    return parts.settings[:, [model.nonlinear.index(symbol) for symbol in model.bent_symbols]]


def _moduli(model: StatisticalModel, bent: FloatArray) -> FloatArray:
    """Return the initial shear moduli (M, k) of unit `column_symbols` at exponents (M, s); zero for a discrepancy's."""
    distinct, group = np.unique(bent, axis=0, return_inverse=True)
    own = (_slopes if model.material.is_isotropic else _derivatives)(model.material, distinct)
    found = np.zeros((len(bent), len(model.column_symbols)))
    found[:, : own.shape[1]] = own[group.ravel()]
    return found


def _slopes(material: Material, bent: FloatArray) -> FloatArray:
    """Return initial shear moduli by differences of the stress, which need no compiler."""
    near = 1 + STEP * np.array([-2, -1, 1, 2])
    basis = stress_basis(material, loading_mode("uniaxial"), near, bent)
    basis = np.broadcast_to(basis, (len(bent), *basis.shape[-2:]))
    return np.asarray(np.einsum("s,msk->mk", np.array([1, -8, 8, -1]) / (12 * STEP), basis) / 3)


def _derivatives(material: Material, bent: FloatArray) -> FloatArray:
    """Return initial shear moduli of a material with fibres: of its matrix, as fibres at rest bear nothing."""
    is_linear = np.array([parameter.is_linear for parameter in material.parameters])
    values = np.repeat(np.eye(is_linear.size)[is_linear][None], len(bent), axis=0)
    values[:, :, ~is_linear] = bent[:, None]
    return np.array([[initial_shear_modulus(material, each) for each in unit] for unit in values])


def _scaled(marginal: Marginal, factor: float) -> Marginal:
    return replace(
        marginal,
        mean=marginal.mean * factor,
        sd=marginal.sd * factor,
        points=marginal.points * factor,
        density=marginal.density / factor,
    )
