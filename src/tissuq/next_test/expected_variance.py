"""Stresses and targets as one Gaussian in every component of a posterior, and their variances expected after a test.

Given a component everything is linear and Gaussian, so that the variance after the measurements does not depend on
their outcome: it is exact. The outcome changes the weights of the components; the variance between components is
averaged over outcomes drawn from the posterior predictive distribution.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import LoadingMode, States
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.mechanics.rays import Range, Rays, log_growth, with_errors
from tissuq.mechanics.stress import MAX_COMPLEX_STEP_VALUES
from tissuq.model.discrepancy import side_by_side
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import (
    basis_of,
    borne,
    coefficients,
    conditioned,
    conditioned_jointly,
    correlated_groups,
    energy_terms,
)


def states_of(model: StatisticalModel, stresses: Sequence[tuple[LoadingMode, FloatArray]]) -> States:
    """Return the states at points of several modes: for all stresses of the first mode, then for those of the next."""
    return States.joined(
        [
            model.experiment.states_at(points, mode, channel)
            for mode, points in stresses
            for channel in range(len(mode.stresses))
        ]
    )


def joint_stresses(
    model: StatisticalModel, components: GaussianMixture, states: States
) -> tuple[FloatArray, FloatArray]:
    """Return means (M, g) and roots (M, g, r) of the stresses at states (g,), discrepancy included.

    The first p columns of the roots are those of the components' own linear parameters (`GaussianMixture.root`), so
    that covariances of stresses, with each other and with parameters, are products of roots. The further columns are
    what the data leave of a process, and of an energy beyond the range of the data, where it goes on along rays: to
    first order, with one error of the exponent in all directions. Scatter that is independent from point to point
    (S, noise) is left out.
    """
    if components.member is None:
        return _within(model, components, states)
    count = len(states)
    ranges = list(model.by_limits(components.member)) or [(Range(), np.arange(len(components)))]
    p = components.root.shape[2]
    mean, root = np.empty((len(components), len(states))), np.zeros((len(components), len(states), p + 1))
    for limits, rows in ranges:
        outside, rays, inside = Rays.leaving(states, limits)
        wanted = States.joined([inside, rays.last_states]) if len(outside) else states
        means, roots = _within(model, components[rows], wanted)
        mean[rows], root[rows, :, :p] = means[:, :count], roots[:, :count]
        if len(outside):
            index, last = np.ix_(rows, outside), (means[:, count:], roots[:, count:])
            mean[index], root[index] = _beyond(rays, (mean[index], root[index]), last)
    return mean, root


def _beyond(
    rays: Rays, ends: tuple[FloatArray, FloatArray], last: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return means (M, g) and roots (M, g, p + 1) of stresses beyond the range of the data, to first order.

    From those at its end (`ends`) and at the `Rays.last_states` (M, 2 g). The last column is the error of the exponent.
    """
    (mean, root), count = ends, len(rays.logs)
    stresses, roots = ((block[:, :count], block[:, count:]) for block in last)
    exponent = rays.last_exponents(*stresses)

    def log_of_growth(change: float, score: float) -> FloatArray:
        exponents = with_errors(exponent + change, np.asarray(score))
        return np.asarray(log_growth(rays.log_distance, *exponents))

    is_positive = (stresses[0] > 0) & (stresses[1] > 0)
    at_end, farther_in = (
        block[..., : root.shape[2] - 1] / np.where(is_positive, stress, np.inf)[..., None]
        for block, stress in zip(roots, stresses, strict=True)
    )
    slope = (log_of_growth(STEP, 0.0) - log_of_growth(-STEP, 0.0)) / (2 * STEP * rays.distance)
    relative = np.zeros_like(root)
    relative[..., :-1] = slope[..., None] * (at_end - farther_in)
    relative[..., -1] = log_of_growth(0.0, SCORE_SD) - log_of_growth(0.0, 0.0)
    growth = rays.growth(*with_errors(exponent, np.zeros(())))
    return mean * growth, growth[..., None] * (root + mean[..., None] * relative)


def _within(model: StatisticalModel, components: GaussianMixture, states: States) -> tuple[FloatArray, FloatArray]:
    """Return `joint_stresses` in the range of the data."""
    mean_b, root_b = coefficients(model, components)
    basis = borne(model, states.abscissa, _basis(model, components, states), components.weights)
    mean, root = (basis @ mean_b[:, :, None])[:, :, 0], basis @ root_b
    if components.member is not None:
        for _, rows, features, weights in energy_terms(model, components, states):
            terms = side_by_side(features, len(states))
            mean[rows] += components.mean[rows, weights] @ terms.T
            root[rows] += terms @ components.root[rows, weights]
    if not model.is_correlated:
        return mean, root
    unexplained_root = np.zeros((*mean.shape, len(states)))
    for group in correlated_groups(model, components.settings):
        rows = group.components
        _, pull, _ = conditioned(model, group, states, mean_b[rows])
        shift, covariance = conditioned_jointly(model, group, states, mean_b[rows])
        mean[rows] += shift
        root[rows] -= pull @ root_b[rows]
        values, vectors = np.linalg.eigh(covariance)
        unexplained_root[rows] = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    return mean, np.concatenate([root, unexplained_root], axis=2)


def _basis(model: StatisticalModel, components: GaussianMixture, states: States) -> FloatArray:
    """Return the basis of the mean stress; where it depends on settings, few of these at once, without a compiler."""
    if not model.bent_symbols:
        return basis_of(model, states, components.settings)
    count = max(1, MAX_COMPLEX_STEP_VALUES // (len(states) * len(model.column_symbols)))
    starts = range(0, len(components.settings), count)
    return np.concatenate([basis_of(model, states, components.settings[start : start + count]) for start in starts])


STEP = 1e-6
"""Step of an exponent for a derivative."""
SCORE_SD = 2.2
"""Standard deviation of a Gaussian error of an exponent with the 95 % interval of Student's t."""
MAX_ARRAY_VALUES = 4_000_000
"""Largest number of values in an array over components, outcomes and measurements, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class Variances:
    """Variances of targets (t,) before and after measurements, and the effective number of components after them.

    Those within and between components add up to ``expected``; the former is exact.
    """

    prior: FloatArray
    within_components: FloatArray
    between_components: FloatArray
    effective: float

    @property
    def expected(self) -> FloatArray:
        """The expected variances after the measurements."""
        return self.within_components + self.between_components


def expected_variances(mixture: GaussianMixture, noise_sd: FloatArray, uniforms: FloatArray) -> Variances:
    """Return the variances of targets that are expected after measurements.

    Parameters
    ----------
    mixture : GaussianMixture
        The n stresses to be measured, without the errors of single measurements, followed by the t targets.
    noise_sd : (M, n) array
        Standard deviations of these errors in each component.
    uniforms : (S, 1 + r + n) array
        Evenly spread points of the unit cube, from which S outcomes follow; unused where there is one component.
    """
    # Whitened, with T'T = I + B'B, the Gaussian given an outcome has the root T^-1 in the coordinates of the mixture's.
    count, n = noise_sd.shape
    (mean, target_mean), (root, target_root) = ((array[:, :n], array[:, n:]) for array in (mixture.mean, mixture.root))
    r = root.shape[2]
    scaled = root / noise_sd[:, :, None]
    stacked = np.concatenate([scaled, np.broadcast_to(np.eye(r), (count, r, r))], axis=1)
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    posterior_root = np.linalg.solve(triangle.swapaxes(1, 2), target_root.swapaxes(1, 2))
    within_components = mixture.weights @ (posterior_root**2).sum(axis=1)
    prior = np.diag(mixture.moments()[1])[n:]
    if count == 1:
        return Variances(prior, within_components, np.zeros_like(within_components), 1.0)
    outcomes = _outcomes(mixture.weights, mean, root, noise_sd, uniforms)
    log_density, shift = np.empty((count, len(outcomes))), np.empty((count, len(outcomes), posterior_root.shape[2]))
    for block in _blocks(count, len(outcomes) * max(scaled.shape[1:])):
        residual = (outcomes - mean[block, None]) / noise_sd[block, None]
        projected = np.linalg.solve(triangle[block].swapaxes(1, 2), (residual @ scaled[block]).swapaxes(1, 2))
        square = (residual**2).sum(axis=2) - (projected**2).sum(axis=1)
        size = np.log(np.abs(np.einsum("mrr->mr", triangle[block]))).sum(axis=1)
        size += np.log(noise_sd[block]).sum(axis=1)
        log_density[block] = -0.5 * square - size[:, None]
        shift[block] = projected.swapaxes(1, 2) @ posterior_root[block]
    with np.errstate(divide="ignore"):  # a component may have no weight
        log_weights = np.log(mixture.weights)[:, None] + log_density
    weights = np.exp(log_weights - log_weights.max(axis=0))
    weights /= weights.sum(axis=0)
    centres = target_mean[:, None] + shift
    mean_of_outcome = np.einsum("ms,mst->st", weights, centres)
    between_components = np.einsum("ms,mst->t", weights, (centres - mean_of_outcome) ** 2) / len(outcomes)
    return Variances(prior, within_components, between_components, float((1 / (weights**2).sum(axis=0)).mean()))


def _outcomes(
    weights: FloatArray, mean: FloatArray, root: FloatArray, noise_sd: FloatArray, uniforms: FloatArray
) -> FloatArray:
    """Return measurements (S, n) as the mixture predicts them."""
    from scipy.special import ndtri

    r = root.shape[2]
    edges = np.cumsum(weights)
    component = np.minimum(np.searchsorted(edges, uniforms[:, 0] * edges[-1], side="right"), len(edges) - 1)
    scores = ndtri(np.clip(uniforms[:, 1:], 1e-12, 1 - 1e-12))
    signal = np.einsum("snr,sr->sn", root[component], scores[:, :r])
    return np.asarray(mean[component] + signal + noise_sd[component] * scores[:, r:])


def _blocks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of so many components, of a size each, that fit into memory together."""
    step = max(1, MAX_ARRAY_VALUES // size)
    for start in range(0, count, step):
        yield slice(start, start + step)
