"""Stresses in any loading modes as one Gaussian together with the parameters, for every component of a posterior."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode, Path
from tissuq.inference.solution import Components
from tissuq.mechanics.complex_step import MOST_VALUES
from tissuq.mechanics.joint import JointExperiment, Rows, rows_along
from tissuq.model import StatisticalModel
from tissuq.prediction.moments import (
    basis_of,
    borne,
    coefficients,
    conditioned,
    conditioned_jointly,
    correlated_parts,
)

__all__ = ["joint_stresses", "points_together"]

FloatArray = NDArray[np.float64]


def points_together(
    model: StatisticalModel, every: Sequence[tuple[LoadingMode, FloatArray]]
) -> tuple[Path, FloatArray]:
    """Return one path, and its points, for points of several modes: all stresses of the first mode, then of the next.

    The mode of the data where all are of it, or rows as those of several tests are.
    """
    data = model.experiment
    if not isinstance(data, JointExperiment) and all(mode == data.mode for mode, _ in every):
        return data.mode, np.concatenate([points for _, points in every])
    rows = [
        data.along(mode, points, channel)[1] if isinstance(data, JointExperiment) else rows_along(path, points, -1)
        for mode, points in every
        for channel, path in enumerate(mode.channels)
    ]
    return Rows(), np.concatenate(rows)


def joint_stresses(
    model: StatisticalModel, components: Components, path: Path, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return means (M, g) and roots (M, g, r) of the stresses at points of a path, discrepancy included.

    The first p columns of the roots are those of the components' own linear parameters (`Components.root`), so that
    covariances of stresses, with each other and with parameters, are products of roots. The further columns are what
    the data leave of a discrepancy beside its terms: of a process, and of an energy beyond the range of the data.
    Scatter that is independent from point to point (S, noise) is left out.
    """
    mean_b, root_b = coefficients(model, components)
    basis = borne(model, path.abscissa(points), _basis(model, components, path, points), components.weights)
    mean, root = (basis @ mean_b[:, :, None])[:, :, 0], basis @ root_b
    further = np.zeros((*mean.shape, 0))
    if model.is_correlated:
        further = np.zeros((*mean.shape, len(points)))
        for part in correlated_parts(model, components.settings):
            own = part.chosen
            _, pull, _ = conditioned(model, part, points, mean_b[own])
            shift, covariance = conditioned_jointly(model, part, points, mean_b[own])
            mean[own] += shift
            root[own] -= pull @ root_b[own]
            values, vectors = np.linalg.eigh(covariance)
            further[own] = vectors * np.sqrt(np.maximum(values, 0.0))[:, None]
    if components.member is not None:
        further = _add_energies(model, components, path, points, mean, root)
    return mean, np.concatenate([root, further], axis=2)


def _basis(model: StatisticalModel, components: Components, path: Path, points: FloatArray) -> FloatArray:
    """Return the basis of the mean stress; where it depends on settings, few of these at once, without a compiler."""
    if not model.bent_symbols:
        return basis_of(model, points, components.settings, path)
    count = max(1, MOST_VALUES // (len(points) * len(model.column_symbols)))
    starts = range(0, len(components.settings), count)
    return np.concatenate([basis_of(model, points, components.settings[at : at + count], path) for at in starts])


def _add_energies(
    model: StatisticalModel, components: Components, path: Path, points: FloatArray, mean: FloatArray, root: FloatArray
) -> FloatArray:
    """Add energy discrepancies to means and roots, and return the roots (M, g, q) of what the data know nothing of."""
    assert components.member is not None  # noqa: S101 (the caller has looked)
    beyond, start = [], len(model.linear)
    for place in np.unique(components.member):
        member, own, column = model.energy_members[place], np.flatnonzero(components.member == place), start
        parts = []
        for which, (terms, count) in zip(member.places, member.wide_features(path, points), strict=True):
            weights = slice(column, column + count)
            mean[own] += components.mean[own, weights] @ terms[:, :count].T
            root[own] += terms[:, :count] @ components.root[own, weights]
            amplitude = components.settings[own, model.nonlinear.index(model.energy_symbols[which])]
            parts.append(amplitude[:, None, None] * terms[:, count:])
            column += count
        beyond.append((own, np.concatenate([np.zeros((len(own), len(points), 0)), *parts], axis=2)))
    further = np.zeros((*mean.shape, max(each.shape[2] for _, each in beyond)))
    for own, each in beyond:
        further[own, :, : each.shape[2]] = each
    return further
