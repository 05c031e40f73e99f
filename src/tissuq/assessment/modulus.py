"""Moduli that follow from the parameters of a fit: the initial shear modulus, and stiffnesses that were ratios."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import loading_mode
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal, blended, marginal_of_mixture, marginal_of_points, widened
from tissuq.inference.solution import Solution
from tissuq.mechanics import Material, initial_shear_modulus, stress_basis
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import coefficients, values_of

STRETCH_STEP = 1e-3
"""Step of the stretch for the initial slope."""
LEAST_BANDWIDTH = 1e-6
"""Of a single value without width, relative to it."""


def modulus(solution: Solution) -> Marginal:
    """Return the marginal posterior of the material's initial shear modulus, MPa.

    It is linear in the moduli given the exponents, so that it is a mixture of Gaussians as they are.
    """
    model, mixture = solution.model, solution.mixture
    symbols = modulus_symbols(model)
    moduli = _moduli(model, values_of(model, mixture, model.bent_symbols)[0])
    if len(symbols) == 1 and not np.ptp(moduli, axis=0).any():
        factor = float(moduli[0, model.column_symbols.index(symbols[0])])
        return _scaled(solution.marginals[symbols[0]], factor)
    return _marginal(solution, *modulus_moments(model, mixture), (0.0 if solution.stable_in else -np.inf, np.inf))


def derived_marginal(solution: Solution, symbol: str) -> Marginal:
    """Return the marginal posterior of one of the model's `derived_parameters`, a ratio times a linear parameter."""
    model, mixture = solution.model, solution.mixture
    number = [parameter.symbol for parameter in model.material.plain.parameters].index(symbol)
    units = model.material.unit_values(values_of(model, mixture, model.bent_symbols)[0])
    factors = model.material.plain_values(np.moveaxis(units, -1, 0))[number]
    columns = [model.column_symbols.index(p.symbol) for p in model.material.parameters if p.is_linear]
    mean, root = coefficients(model, mixture)
    means = (factors * mean[:, columns]).sum(axis=1)
    return _marginal(solution, means, np.einsum("mk,mkp->mp", factors, root[:, columns]), (0.0, np.inf))


def _marginal(solution: Solution, means: FloatArray, root: FloatArray, bounds: tuple[float, float]) -> Marginal:
    """Return the marginal posterior of a quantity with means (M,) and roots (M, p) in every component, MPa."""
    model, mixture = solution.model, solution.mixture
    sds = np.linalg.norm(root, axis=1)
    is_wide = sds > 0
    marginals = []
    if is_wide.any():
        marginal = marginal_of_mixture(mixture.weights[is_wide], means[is_wide], sds[is_wide])
        marginals.append((float(mixture.weights[is_wide].sum()), marginal))
    if not is_wide.all():
        bandwidth = None if np.ptp(means[~is_wide]) else float(sds.max() or LEAST_BANDWIDTH * abs(means[0]))
        marginal = marginal_of_points(means[~is_wide], mixture.weights[~is_wide], bounds, bandwidth)
        marginals.append((float(mixture.weights[~is_wide].sum()), marginal))
    return widened(blended(marginals, bounds), model.common_error)


def modulus_moments(model: StatisticalModel, mixture: GaussianMixture) -> tuple[FloatArray, FloatArray]:
    """Return means (M,) and roots (M, p) of the initial shear modulus in every component, MPa."""
    moduli = _moduli(model, values_of(model, mixture, model.bent_symbols)[0])
    mean, root = coefficients(model, mixture)
    return (moduli * mean).sum(axis=1), np.einsum("mk,mkp->mp", moduli, root)


def modulus_symbols(model: StatisticalModel) -> tuple[str, ...]:
    """Return the parameters on which the initial shear modulus depends."""
    moduli = np.abs(_moduli(model, np.array([model.usual_bent])))[0]
    return tuple(s for s, size in zip(model.column_symbols, moduli, strict=True) if size > 1e-6 * moduli.max())


def positive_symbols(model: StatisticalModel) -> tuple[str, ...]:
    """Return the parameters of the material that are positive: of a population and as priors, their logarithms count.

    A parameter that alone is the initial shear modulus (mu1 of one Ogden term, negative beside others at times) is
    taken to be one.
    """
    alone = modulus_symbols(model)
    return tuple(
        parameter.symbol
        for parameter in model.material.plain.parameters
        if (parameter.support[0] >= 0 and np.isinf(parameter.support[1])) or alone == (parameter.symbol,)
    )


def _moduli(model: StatisticalModel, bent: FloatArray) -> FloatArray:
    """Return the initial shear moduli (M, k) of unit `column_symbols` at exponents (M, s); zero for a discrepancy's."""
    distinct, group = np.unique(bent, axis=0, return_inverse=True)
    material_moduli = (_slopes if model.material.is_isotropic else _derivatives)(model.material, distinct)
    moduli = np.zeros((len(bent), len(model.column_symbols)))
    moduli[:, : material_moduli.shape[1]] = material_moduli[group.ravel()]
    return moduli


def _slopes(material: Material, bent: FloatArray) -> FloatArray:
    """Return initial shear moduli by differences of the stress, which need no compiler."""
    stretch = 1 + STRETCH_STEP * np.array([-2, -1, 1, 2])
    basis = stress_basis(material, loading_mode("uniaxial").at(stretch), bent)
    basis = np.broadcast_to(basis, (len(bent), *basis.shape[-2:]))
    return np.asarray(np.einsum("s,msk->mk", np.array([1, -8, 8, -1]) / (12 * STRETCH_STEP), basis) / 3)


def _derivatives(material: Material, bent: FloatArray) -> FloatArray:
    """Return initial shear moduli of a material with fibres: of its matrix, as unstretched fibres bear no load."""
    values = material.unit_values(bent)
    return np.array([[initial_shear_modulus(material, parameters) for parameters in unit] for unit in values])


def _scaled(marginal: Marginal, factor: float) -> Marginal:
    return replace(
        marginal,
        mean=marginal.mean * factor,
        sd=marginal.sd * factor,
        points=marginal.points * factor,
        density=marginal.density / factor,
    )
