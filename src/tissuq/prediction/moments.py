"""Mean and variance of the stress at any stretch, for every component of a posterior."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.lowrank import Spectrum, correlation_spectrum
from tissuq.inference.solution import Components
from tissuq.model import StatisticalModel

__all__ = ["CorrelatedPart", "coefficients", "correlated_parts", "stress_moments"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CorrelatedPart:
    """The components that share one correlation, and what it takes to solve with their covariance of the data.

    The covariance of the data is white I + U diag(kernel) U'; all arrays have one row for each chosen component.
    """

    chosen: NDArray[np.intp]
    correlation: Spectrum
    shape: dict[str, float]
    amplitude: FloatArray
    white: FloatArray

    @property
    def kernel(self) -> FloatArray:
        """Variances (N, r) of the correlated discrepancy along the eigenvectors."""
        return self.amplitude[:, None] * self.correlation.values


def coefficients(model: StatisticalModel, components: Components) -> tuple[FloatArray, FloatArray]:
    """Return means (M, k) and roots (M, k, p) of the parameters in which the mean stress is linear."""
    mean = np.empty((len(components.weights), len(model.column_symbols)))
    root = np.zeros((*mean.shape, components.root.shape[2]))
    for column, symbol in enumerate(model.column_symbols):
        if symbol in model.linear:
            mean[:, column] = components.mean[:, model.linear.index(symbol)]
            root[:, column] = components.root[:, model.linear.index(symbol)]
        else:
            mean[:, column] = components.settings[:, model.nonlinear.index(symbol)]
    return mean, root


def correlated_parts(model: StatisticalModel, settings: FloatArray) -> Iterator[CorrelatedPart]:
    """Group settings (M, d) of the nonlinear parameters by the correlation they imply."""
    discrepancy, stretch = model.discrepancy, model.experiment.stretch
    values = dict(zip(model.nonlinear, settings.T, strict=True))
    white = np.broadcast_to(model.white_variance(values), len(settings))
    amplitude = np.broadcast_to(discrepancy.correlated_variance(values), len(settings))
    shapes = np.column_stack([values[symbol] for symbol in discrepancy.shape_symbols])
    distinct, group = np.unique(shapes, axis=0, return_inverse=True)
    for index, row in enumerate(distinct):
        shape = dict(zip(discrepancy.shape_symbols, row, strict=True))
        chosen = np.flatnonzero(group.ravel() == index)
        factor = correlation_spectrum(discrepancy, stretch, tuple(map(float, row)))
        yield CorrelatedPart(chosen, factor, shape, amplitude[chosen], white[chosen])


def stress_moments(
    model: StatisticalModel, components: Components, stretch: FloatArray, *, discrepancy: bool, noise: bool
) -> tuple[FloatArray, FloatArray]:
    """Return mean (M, g) and variance (M, g) of the stress at stretches (g,), for every component.

    Without the discrepancy it is the model alone (eq. 28); with it, a correlated discrepancy is conditioned on
    the data (eq. 27; differs from the source, whose GP is drawn from its prior).
    """
    values = dict(zip(model.nonlinear, components.settings.T, strict=True))
    mean_b, root_b = coefficients(model, components)
    basis = model.basis(stretch)
    if not discrepancy:
        basis = basis * np.isin(model.column_symbols, model.material_symbols)
    mean = mean_b @ basis.T
    root = np.einsum("gk,mkp->mgp", basis, root_b)
    extra = np.zeros_like(mean)
    if discrepancy:
        extra += np.reshape(model.discrepancy.independent_variance(values), (-1, 1))
        if model.discrepancy.is_correlated:
            for part in correlated_parts(model, components.settings):
                shift, pull, variance = _condition(model, part, stretch, mean_b[part.chosen])
                mean[part.chosen] += shift
                root[part.chosen] -= np.einsum("mgk,mkp->mgp", pull, root_b[part.chosen])
                extra[part.chosen] += variance
    if noise:
        extra += np.reshape(model.noise_variance(values), (-1, 1))
    return mean, extra + (root**2).sum(axis=2)


def _condition(
    model: StatisticalModel, part: CorrelatedPart, stretch: FloatArray, mean_b: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Condition the correlated discrepancy at new stretches on the data, given coefficients b (N, k).

    Returns its mean (N, g), the sensitivity (N, g, k) of minus that mean to b, and its variance (N, g) given b.
    """
    data = model.experiment
    cross = model.discrepancy.correlation(stretch, data.stretch, part.shape)
    vectors = part.correlation.vectors
    inside = cross @ vectors
    gain = part.amplitude[:, None] / (part.white[:, None] + part.kernel)
    columns = np.column_stack([model.design, data.stress])
    smoothed = np.einsum("gr,nr,rk->ngk", inside, gain, vectors.T @ columns)
    pull, of_data = smoothed[:, :, :-1], smoothed[:, :, -1]
    explained = gain @ (inside**2).T
    variance = np.maximum(part.amplitude[:, None] * (1 - explained), 0.0)
    return of_data - np.einsum("ngk,nk->ng", pull, mean_b), pull, variance
