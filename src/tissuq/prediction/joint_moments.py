"""Stresses in any loading modes as one Gaussian together with the parameters, for every component of a posterior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode, States
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.mechanics.stress import MAX_COMPLEX_STEP_VALUES
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import (
    basis_of,
    borne,
    coefficients,
    conditioned,
    conditioned_jointly,
    correlated_groups,
)

__all__ = ["joint_stresses", "states_of"]

FloatArray = NDArray[np.float64]


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
    what the data leave of a discrepancy beside its terms: of a process, and of an energy beyond the range of the data.
    Scatter that is independent from point to point (S, noise) is left out.
    """
    mean_b, root_b = coefficients(model, components)
    basis = borne(model, states.abscissa, _basis(model, components, states), components.weights)
    mean, root = (basis @ mean_b[:, :, None])[:, :, 0], basis @ root_b
    unexplained_root = np.zeros((*mean.shape, 0))
    if model.is_correlated:
        unexplained_root = np.zeros((*mean.shape, len(states)))
        for group in correlated_groups(model, components.settings):
            rows = group.components
            _, pull, _ = conditioned(model, group, states, mean_b[rows])
            shift, covariance = conditioned_jointly(model, group, states, mean_b[rows])
            mean[rows] += shift
            root[rows] -= pull @ root_b[rows]
            values, vectors = np.linalg.eigh(covariance)
            unexplained_root[rows] = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    if components.member is not None:
        unexplained_root = _add_energies(model, components, states, mean, root)
    return mean, np.concatenate([root, unexplained_root], axis=2)


def _basis(model: StatisticalModel, components: GaussianMixture, states: States) -> FloatArray:
    """Return the basis of the mean stress; where it depends on settings, few of these at once, without a compiler."""
    if not model.bent_symbols:
        return basis_of(model, states, components.settings)
    count = max(1, MAX_COMPLEX_STEP_VALUES // (len(states) * len(model.column_symbols)))
    starts = range(0, len(components.settings), count)
    return np.concatenate([basis_of(model, states, components.settings[start : start + count]) for start in starts])


def _add_energies(
    model: StatisticalModel, components: GaussianMixture, states: States, mean: FloatArray, root: FloatArray
) -> FloatArray:
    """Add energy discrepancies to means and roots, and return the roots (M, g, q) of what the data know nothing of."""
    assert components.member is not None  # noqa: S101 (the caller has looked)
    unexplained, start = [], len(model.linear)
    for index in np.unique(components.member):
        member, rows, column = model.energy_members[index], np.flatnonzero(components.member == index), start
        unexplained_terms = []
        for amplitude_index, (terms, count) in zip(member.amplitude_indices, member.wide_features(states), strict=True):
            weights = slice(column, column + count)
            mean[rows] += components.mean[rows, weights] @ terms[:, :count].T
            root[rows] += terms[:, :count] @ components.root[rows, weights]
            amplitude = components.settings[rows, model.nonlinear.index(model.energy_symbols[amplitude_index])]
            unexplained_terms.append(amplitude[:, None, None] * terms[:, count:])
            column += count
        unexplained.append((rows, np.concatenate([np.zeros((len(rows), len(states), 0)), *unexplained_terms], axis=2)))
    unexplained_root = np.zeros((*mean.shape, max(terms_root.shape[2] for _, terms_root in unexplained)))
    for rows, terms_root in unexplained:
        unexplained_root[rows, :, : terms_root.shape[2]] = terms_root
    return unexplained_root
