"""Correlation matrices as a thin orthonormal factor: K = U diag(spectrum) U' to rounding."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import States
from tissuq.inference.threads import one_thread
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["FEW_POINTS", "Spectrum", "correlation_spectrum", "scaled_spectrum"]

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-14
"""Share of the process's variance at all points that the factor of many may leave out."""
ROUNDING = 1e-17
"""Eigenvalue, relative to that, below which the decomposition of few points gives only rounding errors."""
FEW_POINTS = 128


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Leading eigenvectors (n, r), orthonormal, and eigenvalues (r,) of a correlation matrix."""

    vectors: FloatArray
    values: FloatArray


def correlation_spectrum(model: StatisticalModel, shape: tuple[float, ...]) -> Spectrum:
    """Return the spectrum of a model's correlation at its measurements, at a cost of n r^2 for numerical rank r.

    Few points are decomposed directly, and remembered, because many data sets share their stretches. For many,
    pivoted Cholesky finds a root of the matrix without forming it, and its singular values give the rest. Smooth
    kernels have a small numerical rank: about ten for a squared exponential as wide as half the data's range.

    Parameters
    ----------
    model : StatisticalModel
    shape : tuple of float
        Values of the parameters on which the correlation depends.
    """
    states = model.experiment.states
    if model.is_repeated:
        return _of_repeats(states.abscissa)
    if model.whitening is None and len(states) <= FEW_POINTS:
        return _remembered(model.discrepancy, states, shape)
    return _decompose(model.discrepancy, states, shape, model.white)


def scaled_spectrum(model: StatisticalModel, shape: Mapping[str, float], scale: FloatArray) -> Spectrum:
    """Return the spectrum of a model's correlation at its measurements, rows and columns divided by a scale (n,)."""
    states = model.experiment.states
    correlation = model.white(model.white(model.correlation(states, states, shape)).T)
    correlation = correlation / np.multiply.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    is_positive = values > ROUNDING * np.trace(correlation)
    return Spectrum(vectors[:, is_positive], values[is_positive])


def _of_repeats(stretch: FloatArray) -> Spectrum:
    """Return the spectrum of the correlation that is one at equal stretches (n,) and zero elsewhere."""
    _, group, count = np.unique(stretch, return_inverse=True, return_counts=True)
    vectors = np.zeros((len(stretch), len(count)))
    vectors[np.arange(len(stretch)), group] = 1 / np.sqrt(count[group])
    return Spectrum(vectors, count.astype(np.float64))


@lru_cache(maxsize=512)
def _remembered(discrepancy: Discrepancy, states: States, shape: tuple[float, ...]) -> Spectrum:
    return _decompose(discrepancy, states, shape)


def _decompose(
    discrepancy: Discrepancy,
    states: States,
    shape: tuple[float, ...],
    white: Callable[[FloatArray], FloatArray] = lambda columns: columns,
) -> Spectrum:
    values = dict(zip(discrepancy.shape_symbols, shape, strict=True))
    if len(states) <= FEW_POINTS:
        with one_thread():
            spectrum, vectors = np.linalg.eigh(white(white(discrepancy.correlation(states, states, values)).T))
        is_positive = spectrum > ROUNDING * spectrum.sum()
        return Spectrum(vectors[:, is_positive], spectrum[is_positive])
    variance = np.asarray(discrepancy.relative_variance(states, values))
    root = _pivoted_root(lambda a, b: discrepancy.correlation(a, b, values), states, variance)
    vectors, singular, _ = np.linalg.svd(white(root), full_matrices=False)
    return Spectrum(vectors, singular**2)


def _pivoted_root(
    correlation: Callable[[States, States], FloatArray], states: States, remaining: FloatArray
) -> FloatArray:
    n = len(states)
    root = np.zeros((n, n if n <= 64 else 64))
    for rank in range(n):
        pivot = int(remaining.argmax())
        if remaining.sum() <= TOLERANCE * n or remaining[pivot] <= 0:
            return root[:, :rank]
        if rank == root.shape[1]:
            root = np.hstack([root, np.zeros((n, min(rank, n - rank)))])
        column = correlation(states, states.one(pivot))[:, 0] - root[:, :rank] @ root[pivot, :rank]
        root[:, rank] = column / np.sqrt(remaining[pivot])
        remaining = np.maximum(remaining - root[:, rank] ** 2, 0.0)
        remaining[pivot] = 0.0
    return root
