"""Correlation matrices as a thin orthonormal factor: K = U diag(spectrum) U' to rounding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy import Discrepancy

__all__ = ["Spectrum", "correlation_spectrum"]

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-14
"""Share of the trace that the factor of many points may leave out."""
ROUNDING = 1e-17
"""Eigenvalue, relative to the trace, below which the decomposition of few points gives only rounding errors."""
FEW_POINTS = 128


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Leading eigenvectors (n, r), orthonormal, and eigenvalues (r,) of a correlation matrix."""

    vectors: FloatArray
    values: FloatArray


def correlation_spectrum(discrepancy: Discrepancy, points: FloatArray, shape: tuple[float, ...]) -> Spectrum:
    """Return the spectrum of a discrepancy's correlation on points (n,), at a cost of n r^2 for numerical rank r.

    Few points are decomposed directly, and remembered, because many data sets share their stretches. For many,
    pivoted Cholesky finds a root of the matrix without forming it, and its singular values give the rest. Smooth
    kernels have a small numerical rank: about ten for a squared exponential as wide as half the data's range.

    Parameters
    ----------
    discrepancy : Discrepancy
    points : (n,) array, dimensionless
        Stretches.
    shape : tuple of float
        Values of ``discrepancy.shape_symbols``.
    """
    if len(points) <= FEW_POINTS:
        return _remembered(discrepancy, points.tobytes(), shape)
    return _decompose(discrepancy, points, shape)


@lru_cache(maxsize=2048)
def _remembered(discrepancy: Discrepancy, points: bytes, shape: tuple[float, ...]) -> Spectrum:
    return _decompose(discrepancy, np.frombuffer(points), shape)


def _decompose(discrepancy: Discrepancy, points: FloatArray, shape: tuple[float, ...]) -> Spectrum:
    values = dict(zip(discrepancy.shape_symbols, shape, strict=True))
    if len(points) <= FEW_POINTS:
        spectrum, vectors = np.linalg.eigh(discrepancy.correlation(points, points, values))
        kept = spectrum > ROUNDING * len(points)
        return Spectrum(vectors[:, kept], spectrum[kept])
    root = _pivoted_root(lambda a, b: discrepancy.correlation(a, b, values), points)
    vectors, singular, _ = np.linalg.svd(root, full_matrices=False)
    return Spectrum(vectors, singular**2)


def _pivoted_root(correlation: Callable[[FloatArray, FloatArray], FloatArray], points: FloatArray) -> FloatArray:
    n = len(points)
    root = np.zeros((n, n if n <= 64 else 64))
    remaining = np.ones(n)
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
