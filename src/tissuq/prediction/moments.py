"""Mean and variance of the stress at any stretch, for every component of a posterior."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import ModelError
from tissuq.experiments.modes import States
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.linear import SpectralCovariance
from tissuq.inference.reduction import correlation_spectrum, scaled_spectrum
from tissuq.inference.solution import Solution
from tissuq.inference.threads import one_thread
from tissuq.mechanics.rays import Rays, scores, with_errors
from tissuq.model.discrepancy import Member, side_by_side
from tissuq.model.statistical_model import StatisticalModel

MAX_LOCKED_PROBABILITY = 1e-6
"""Probability that the material locks before a stretch, below which a stress there is predicted."""
STRETCH_STEP = 1e-5
"""Step of the stretch, or of the amount of shear, for the slope of a curve."""
MAX_STRESSES_AT_ONCE = 1_000_000
"""Number of stresses computed at once: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class CorrelatedGroup:
    """Components of a posterior that share one structure, by their indices, and the covariances of their data."""

    components: IndexArray
    shape: dict[str, float]
    design: FloatArray
    covariance: SpectralCovariance


def values_by_symbol(model: StatisticalModel, settings: FloatArray) -> dict[str, FloatArray]:
    """Return the nonlinear parameters as columns (M, 1) by symbol, for settings (M, d)."""
    return {symbol: column[:, None] for symbol, column in zip(model.nonlinear, settings.T, strict=True)}


def values_of(
    model: StatisticalModel, components: GaussianMixture, symbols: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Return means (M, k) and roots (M, k, p) of parameters in every component of a posterior."""
    mean = np.empty((len(components.weights), len(symbols)))
    root = np.zeros((*mean.shape, components.root.shape[2]))
    for column, symbol in enumerate(symbols):
        if symbol in model.linear:
            mean[:, column] = components.mean[:, model.linear.index(symbol)]
            root[:, column] = components.root[:, model.linear.index(symbol)]
        else:
            mean[:, column] = components.settings[:, model.nonlinear.index(symbol)]
    return mean, root


def coefficients(model: StatisticalModel, components: GaussianMixture) -> tuple[FloatArray, FloatArray]:
    """Return means (M, k) and roots (M, k, p) of the parameters in which the mean stress is linear."""
    return values_of(model, components, model.column_symbols)


def basis_of(model: StatisticalModel, states: States, settings: FloatArray) -> FloatArray:
    """Return the mean stresses of unit coefficients: (g, k), or (M, g, k) where they depend on settings (M, d)."""
    if not model.bent_symbols:
        return model.basis(states)
    return model.basis(states, settings[:, [model.nonlinear.index(symbol) for symbol in model.bent_symbols]])


def borne(model: StatisticalModel, stretch: FloatArray, basis: FloatArray, weights: FloatArray) -> FloatArray:
    """Return a basis without the components, of next to no weight, in which the material has locked.

    Raises
    ------
    ModelError
        When they have weight, so that there is no stress to predict.
    """
    is_borne = np.asarray(np.isfinite(basis).all(axis=-1))
    if is_borne.all():
        return basis
    locked = 1 - weights @ np.broadcast_to(is_borne, (len(weights), len(stretch)))
    if locked.max() > MAX_LOCKED_PROBABILITY:
        bent = ", ".join(model.bent_symbols)
        why = f"its {bent} may be such that it locks before" if bent else "it is too large for a number"
        refused = np.flatnonzero(locked > MAX_LOCKED_PROBABILITY)
        nearest = min(refused, key=lambda index: (locked[index], abs(stretch[index] - 1)))
        raise ModelError(
            f"material '{model.material.name}' has no stress at a stretch (amount of shear) of {stretch[nearest]:g}: "
            f"{why} (with a probability of {locked[nearest]:.2g}). Predict at stretches nearer to those of the data."
        )
    return np.where(is_borne[..., None], basis, 0.0)


def mean_stress(model: StatisticalModel, coefficients: FloatArray, settings: FloatArray) -> FloatArray:
    """Return the mean stress (M, m) at the model's `states`, whitened, for coefficients (M, k) and settings (M, d)."""
    states = model.states
    if not model.bent_symbols:
        design = model.design if model.condensed is None else model.basis(states)
        return np.asarray(coefficients @ design.T)
    blocks = np.array_split(np.arange(len(settings)), max(1, settings.shape[0] * len(states) // MAX_STRESSES_AT_ONCE))
    curves = [basis_of(model, states, settings[block]) @ coefficients[block][:, :, None] for block in blocks]
    return np.asarray(model.white(np.concatenate(curves)[:, :, 0].T).T)


def correlated_groups(model: StatisticalModel, settings: FloatArray) -> Iterator[CorrelatedGroup]:
    """Group settings (M, d) of the nonlinear parameters by the structure they imply."""
    values = dict(zip(model.nonlinear, settings.T, strict=True))
    amplitude = np.broadcast_to(model.correlated_variance(values), len(settings))
    shared = model.nonlinear if model.noise.depends_on_level else model.structure
    keys = np.column_stack([np.zeros(len(settings)), *(values[symbol] for symbol in shared)])
    distinct, group = np.unique(keys, axis=0, return_inverse=True)
    unit_size = np.ones(model.experiment.size)
    bent = distinct[:, [1 + shared.index(symbol) for symbol in model.bent_symbols]]
    for index, (row, design) in enumerate(zip(distinct, _designs(model, bent), strict=True)):
        shared_values = dict(zip(shared, map(float, row[1:]), strict=True))
        members = np.flatnonzero(group.ravel() == index)
        shape = {symbol: shared_values[symbol] for symbol in model.discrepancy.shape_symbols}
        if model.noise.depends_on_level:
            scale = np.sqrt(model.white_variance(shared_values, model.levels))
            spectrum, white = scaled_spectrum(model, shape, scale), np.ones(len(members))
        else:
            scale, spectrum = unit_size, correlation_spectrum(model, tuple(shape.values()))
            member_values = {symbol: column[members] for symbol, column in values.items()}
            white = np.broadcast_to(model.white_variance(member_values), len(members)).astype(float)
        yield CorrelatedGroup(members, shape, design, SpectralCovariance(spectrum, scale, amplitude[members], white))


def _designs(model: StatisticalModel, bent: FloatArray) -> Iterator[FloatArray]:
    """Yield the rows of the model's basis at values (M, s) of `bent_symbols`, a few of which are computed together."""
    for block in np.array_split(bent, max(1, bent.shape[0] * len(model.states) // MAX_STRESSES_AT_ONCE)):
        yield from model.designs_at(block) if bent.shape[1] else [model.design] * len(block)


def stress_moments(
    model: StatisticalModel,
    components: GaussianMixture,
    states: States,
    *,
    discrepancy: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """Return mean (M, g) and variance (M, g) of the stress at states (g,), for every component; without noise.

    Without the discrepancy it is the model alone (eq. 28); with it, a correlated discrepancy is conditioned on
    the data (eq. 27; differs from the source, whose GP is drawn from its prior). At states of no measured curve only
    a discrepancy that is an energy has a meaning.
    """
    mean_b, root_b = coefficients(model, components)
    basis = borne(model, states.abscissa, basis_of(model, states, components.settings), components.weights)
    if not discrepancy:
        basis = basis * np.isin(model.column_symbols, model.material_symbols)
    mean = (basis @ mean_b[:, :, None])[:, :, 0]
    root = basis @ root_b
    extra = np.zeros_like(mean)
    if discrepancy and model.is_correlated:
        for group in correlated_groups(model, components.settings):
            shift, pull, variance = conditioned(model, group, states, mean_b[group.components])
            mean[group.components] += shift
            root[group.components] -= np.einsum("mgk,mkp->mgp", pull, root_b[group.components])
            extra[group.components] += variance
    if discrepancy and components.member is not None:
        for shift, spread, variance, rows in _energies(model, components, states):
            mean[rows] += shift
            root[rows, :, : spread.shape[2]] += spread
            extra[rows] += variance
    if discrepancy:
        extra += model.independent_variance(values_by_symbol(model, components.settings))
    return mean, extra + np.einsum("mgp,mgp->mg", root, root)


def variance_of_noise(
    model: StatisticalModel, components: GaussianMixture, relative: Any, mean: FloatArray
) -> FloatArray:
    """Return the variance (M, g) of a noise that is ``relative`` to noise_sd where the mean stress is (M, g)."""
    values = values_by_symbol(model, components.settings)
    return np.asarray(model.noise_variance(values, np.abs(mean)) * relative**2)


def mean_curve(solution: Solution, thinned: int | None = None) -> FloatArray:
    """Return the posterior mean of the stress (n,) at the measurements, without noise and errors of whole tests.

    With a number, from so many components that stand for all.
    """
    return mean_curve_and_slopes(solution, thinned, with_slopes=False)[0]


def mean_curve_and_slopes(
    solution: Solution, thinned: int | None = None, *, with_slopes: bool = True
) -> tuple[FloatArray, FloatArray | None]:
    """Return `mean_curve` (n,), and its slopes (n, c) along the controls of every test, MPa."""
    model = solution.model
    components = solution.mixture if thinned is None else solution.thinned(thinned)
    mean, _ = stress_moments(model, components, model.states)
    curve = model.at_measurements(components.weights @ mean)
    if not with_slopes:
        return curve, None
    slopes = slopes_of(lambda states: stress_moments(model, components, states)[0], model.states, mean)
    return curve, model.at_measurements(np.einsum("m,mgc->gc", components.weights, slopes))


def slopes_of(stress: Callable[[States], FloatArray], states: States, mean: FloatArray) -> FloatArray:
    """Return the slopes (M, g, c) of a stress (M, g) of states along the controls of their paths, MPa; zero beyond."""
    moved = [stress(states.displaced(control, STRETCH_STEP)) for control in range(states.controls)]
    return (np.stack(moved, axis=-1) - mean[:, :, None]) / STRETCH_STEP


def level_of_errors(solution: Solution) -> float:
    """Return the root of the posterior mean variance of all independent errors, whitened, MPa."""
    model, components = solution.model, solution.mixture
    values = dict(zip(model.nonlinear, components.settings.T, strict=True))
    variance = np.broadcast_to(model.white_variance(values), len(components.weights))
    return float(np.sqrt(components.weights @ variance))


def drawn_curves(
    model: StatisticalModel, components: GaussianMixture, states: States, seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Return stresses (M, g) of the material alone and of the discrepancy, one joint draw for every component.

    Scatter that is independent from point to point is no curve, and left out. At states of no measured curve, so is a
    discrepancy that is no energy.
    """
    generator = np.random.default_rng([seed, 11])
    score = generator.standard_normal(components.mean.shape)
    linear = components.mean + np.einsum("mpq,mq->mp", components.root, score)
    drawn = replace(components, mean=linear)
    material_stress, discrepancy_stress = _drawn_within(model, drawn, states)
    if components.member is not None:
        for index, stress in stresses_beyond(model, drawn, states, generator.random(len(linear))):
            discrepancy_stress[index] = stress - material_stress[index]
    if model.is_correlated and states.is_measured:
        coefficients_drawn, _ = coefficients(model, drawn)
        for group in correlated_groups(model, components.settings):
            shift, covariance = conditioned_jointly(model, group, states, coefficients_drawn[group.components])
            values, vectors = np.linalg.eigh(covariance)
            score = generator.standard_normal(shift.shape)
            discrepancy_stress[group.components] += shift + np.einsum(
                "ngk,nk->ng", vectors * np.sqrt(np.maximum(values, 0))[:, None], score
            )
    return material_stress, discrepancy_stress


def drawn_stress(
    model: StatisticalModel, drawn: GaussianMixture, states: States, probability: FloatArray
) -> FloatArray:
    """Return the stress (M, g) of draws, within the range of the data and beyond (`stresses_beyond`)."""
    with np.errstate(over="ignore", invalid="ignore"):  # of what is replaced
        total = np.sum(_drawn_within(model, drawn, states), axis=0)
    for index, stress in stresses_beyond(model, drawn, states, probability):
        total[index] = stress
    return np.asarray(total)


def stresses_beyond(
    model: StatisticalModel, drawn: GaussianMixture, states: States, probability: FloatArray
) -> Iterator[tuple[tuple[IndexArray, ...], FloatArray]]:
    """Yield indices of draws and states (g,) beyond the range of the data, and the stresses there.

    They go on along rays (`tissuq.mechanics.rays`), their exponents with errors at probabilities (M,). The draws of
    the linear parameters are the means of the components, which have members.
    """
    assert drawn.member is not None  # noqa: S101 (the caller has looked)
    score = scores(probability)
    for limits, rows in model.by_limits(drawn.member):
        outside, rays, inside = Rays.leaving(states, limits)
        if len(outside):
            last = States.joined([inside.among(outside), rays.last_states])
            material_stress, discrepancy_stress = _drawn_within(model, drawn[rows], last)
            stress, at_end, farther_in = np.split(material_stress + discrepancy_stress, 3, axis=1)
            exponents = with_errors(rays.last_exponents(at_end, farther_in), score[rows, None])
            yield np.ix_(rows, outside), stress * rays.growth(*exponents)


def _drawn_within(model: StatisticalModel, drawn: GaussianMixture, states: States) -> tuple[FloatArray, FloatArray]:
    """Return stresses (M, g) of the material and of discrepancies that are means or energies, in the range of the data.

    The linear parameters are the means of the components.
    """
    values, _ = coefficients(model, drawn)
    terms = basis_of(model, states, drawn.settings) * values[:, None, :]
    is_material = np.isin(model.column_symbols, model.material_symbols)
    material_stress, discrepancy_stress = terms[..., is_material].sum(axis=2), terms[..., ~is_material].sum(axis=2)
    if drawn.member is not None:
        with one_thread():
            for _, rows, features, weights in energy_terms(model, drawn, states):
                discrepancy_stress[rows] += drawn.mean[rows, weights] @ side_by_side(features, len(states)).T
    return material_stress, discrepancy_stress


def conditioned_jointly(
    model: StatisticalModel, group: CorrelatedGroup, states: States, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return means (N, g) and covariances (N, g, g) of the correlated discrepancy given the data and coefficients b."""
    shift, _, _ = conditioned(model, group, states, b)
    inside = _with_data(model, group, states) @ group.covariance.spectrum.vectors
    gain = group.covariance.amplitude[:, None] / (group.covariance.white[:, None] + group.covariance.correlated)
    explained = np.einsum("gr,nr,hr->ngh", inside, gain, inside)
    prior_covariance = model.correlation(states, states, group.shape)
    return shift, group.covariance.amplitude[:, None, None] * (prior_covariance - explained)


def _energies(
    model: StatisticalModel, components: GaussianMixture, states: States
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, IndexArray]]:
    """Yield means (N, g), roots (N, g, q) and further variances (N, g) of energy discrepancies, and whose they are.

    Beyond q the roots are zero. What the terms that serve the data leave of the discrepancy elsewhere is independent of
    the data.
    """
    variance_of_block = cache(lambda block, reach, length: block.stress_variance(states, reach, length))
    for member, rows, features, weights in energy_terms(model, components, states):
        unexplained = [
            np.maximum(variance_of_block(*scaled_block) - (terms**2).sum(axis=1), 0.0)
            for scaled_block, terms in zip(member.scaled_blocks, features, strict=True)
        ]
        symbols = [model.nonlinear.index(model.energy_symbols[k]) for k in member.amplitude_indices]
        all_terms = side_by_side(features, len(states))
        variance = components.settings[rows][:, symbols] ** 2 @ np.reshape(unexplained, (-1, len(states)))
        root = components.root[rows, weights]
        width = int(np.flatnonzero(root.any(axis=(0, 1))).max(initial=-1)) + 1
        yield components.mean[rows, weights] @ all_terms.T, all_terms @ root[:, :, :width], variance, rows


def energy_terms(
    model: StatisticalModel, components: GaussianMixture, states: States
) -> Iterator[tuple[Member, IndexArray, list[FloatArray], slice]]:
    """Yield energy discrepancies, whose they are, the stresses of their terms, and where the weights of these are."""
    start = len(model.linear)
    assert components.member is not None  # noqa: S101 (the caller has looked)
    features_of_block = cache(lambda block, reach, length: block.stress_features(states, reach, length))
    for index in np.unique(components.member):
        member, rows = model.energy_members[index], np.flatnonzero(components.member == index)
        features = [features_of_block(*scaled_block) for scaled_block in member.scaled_blocks]
        yield member, rows, features, slice(start, start + sum(terms.shape[1] for terms in features))


def _with_data(model: StatisticalModel, group: CorrelatedGroup, states: States) -> FloatArray:
    """Return the correlation (g, n) of the discrepancy at states with that at the measurements, whitened."""
    cross = model.white(model.correlation(model.experiment.states, states, group.shape)).T
    return np.asarray(cross / group.covariance.size)


def conditioned(
    model: StatisticalModel, group: CorrelatedGroup, states: States, mean_b: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Condition the correlated discrepancy at new states on the data, given coefficients b (N, k).

    Returns its mean (N, g), the sensitivity (N, g, k) of minus that mean to b, and its variance (N, g) given b.
    """
    vectors = group.covariance.spectrum.vectors
    inside = _with_data(model, group, states) @ vectors
    gain = group.covariance.amplitude[:, None] / (group.covariance.white[:, None] + group.covariance.correlated)
    columns = np.column_stack([group.design, model.stress]) / group.covariance.size[:, None]
    smoothed = np.einsum("gr,nr,rk->ngk", inside, gain, vectors.T @ columns)
    pull, of_data = smoothed[:, :, :-1], smoothed[:, :, -1]
    explained = gain @ (inside**2).T
    prior_variance = model.relative_variance(states, group.shape)
    variance = np.maximum(group.covariance.amplitude[:, None] * (prior_variance - explained), 0.0)
    return of_data - np.einsum("ngk,nk->ng", pull, mean_b), pull, variance
