"""Correlation matrices as a thin orthonormal factor: K = U diag(spectrum) U' to rounding."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy import Discrepancy
from tissuq.inference.threads import one_thread
from tissuq.model import StatisticalModel

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
    points = model.experiment.stretch
    if model.is_repeated:
        return _of_repeats(points)
    if model.is_joint:
        return _decompose(model.discrepancy, points, shape, model.white)
    if len(points) <= FEW_POINTS:
        return _remembered(model.discrepancy, points.tobytes(), shape)
    return _decompose(model.discrepancy, points, shape)


def scaled_spectrum(model: StatisticalModel, shape: Mapping[str, float], scale: FloatArray) -> Spectrum:
    """Return the spectrum of a model's correlation at its measurements, rows and columns divided by a scale (n,)."""
    points = model.experiment.stretch
    correlation = model.white(model.white(model.correlation(points, points, shape)).T)
    correlation = correlation / np.multiply.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    kept = values > ROUNDING * np.trace(correlation)
    return Spectrum(vectors[:, kept], values[kept])


def _of_repeats(points: FloatArray) -> Spectrum:
    """Return the spectrum of the correlation that is one at equal points and zero elsewhere."""
    _, place, count = np.unique(points, return_inverse=True, return_counts=True)
    vectors = np.zeros((len(points), len(count)))
    vectors[np.arange(len(points)), place] = 1 / np.sqrt(count[place])
    return Spectrum(vectors, count.astype(np.float64))


@lru_cache(maxsize=512)
def _remembered(discrepancy: Discrepancy, points: bytes, shape: tuple[float, ...]) -> Spectrum:
    return _decompose(discrepancy, np.frombuffer(points), shape)


def _decompose(
    discrepancy: Discrepancy,
    points: FloatArray,
    shape: tuple[float, ...],
    white: Callable[[FloatArray], FloatArray] = lambda columns: columns,
) -> Spectrum:
    values = dict(zip(discrepancy.shape_symbols, shape, strict=True))
    if len(points) <= FEW_POINTS:
        with one_thread():
            spectrum, vectors = np.linalg.eigh(white(white(discrepancy.correlation(points, points, values)).T))
        kept = spectrum > ROUNDING * spectrum.sum()
        return Spectrum(vectors[:, kept], spectrum[kept])
    variance = np.asarray(discrepancy.relative_variance(points, values))
    root = _pivoted_root(lambda a, b: discrepancy.correlation(a, b, values), points, variance)
    vectors, singular, _ = np.linalg.svd(white(root), full_matrices=False)
    return Spectrum(vectors, singular**2)


def _pivoted_root(
    correlation: Callable[[FloatArray, FloatArray], FloatArray], points: FloatArray, remaining: FloatArray
) -> FloatArray:
    n = len(points)
    root = np.zeros((n, n if n <= 64 else 64))
    for rank in range(n):
        pivot = int(remaining.argmax())
        if remaining.sum() <= TOLERANCE * n or remaining[pivot] <= 0:
            return root[:, :rank]
        if rank == root.shape[1]:
            root = np.hstack([root, np.zeros((n, min(rank, n - rank)))])
        column = correlation(points, points[pivot : pivot + 1])[:, 0] - root[:, :rank] @ root[pivot, :rank]
        root[:, rank] = column / np.sqrt(remaining[pivot])
        remaining = np.maximum(remaining - root[:, rank] ** 2, 0.0)
        remaining[pivot] = 0.0
    return root
