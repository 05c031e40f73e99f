"""Least squares under linear inequalities, some of which are found only where a solution breaks them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["Inequalities", "constrained_least_squares", "fit_within", "least_squares"]

FloatArray = NDArray[np.float64]
Inequalities = tuple[FloatArray, FloatArray]
"""Rows (m, k) and bounds (m,): rows x >= bounds."""

MIN_SINGULAR_VALUE = 1e-12
"""Singular values below that share of the largest count as zero."""
MAX_ROUNDS = 40
"""Largest number of times that inequalities are added."""


def constrained_least_squares(columns: FloatArray, wanted: FloatArray, inequalities: Inequalities) -> FloatArray | None:
    """Return the x (k,) that minimises |columns x - wanted| among those with rows x >= bounds, or None.

    Parameters
    ----------
    columns : (n, k) array
    wanted : (n,) array
    inequalities : ((m, k) array, (m,) array)

    Returns
    -------
    (k,) array or None
        None where none exists, or none is found.

    References
    ----------
    Lawson & Hanson (1974), Solving least squares problems, chapter 23: least distance programming by nonnegative least
    squares.

    Examples
    --------
    >>> import numpy as np
    >>> nearest = constrained_least_squares(np.eye(2), np.array([1.0, -1.0]), (np.eye(2), np.zeros(2)))
    >>> np.allclose(nearest, [1, 0])
    True
    """
    from scipy.optimize import nnls

    rows, bounds = inequalities
    basis, free = _orthonormal(columns, wanted)
    transformed = rows @ basis
    missing = bounds - transformed @ free
    length = np.linalg.norm(transformed, axis=1)
    if ((length == 0) & (missing > 0)).any():
        return None
    length[length == 0] = 1.0
    transformed, missing = transformed / length[:, None], missing / length
    scale = missing.max()
    if scale <= 0:
        return np.asarray(basis @ free)
    dual = np.vstack([transformed.T, missing / scale])
    target = np.zeros(len(dual))
    target[-1] = 1.0
    try:
        multipliers, _ = nnls(dual, target, maxiter=10 * dual.shape[1] + 100)
    except RuntimeError:  # it has not converged
        return None
    residual = dual @ multipliers - target
    if -residual[-1] < 1e-12:
        return None
    return np.asarray(basis @ (free - scale * residual[:-1] / residual[-1]))


def least_squares(columns: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the x (k,) that minimises |columns x - wanted|, of columns (n, k) of any sizes."""
    basis, free = _orthonormal(columns, wanted)
    return np.asarray(basis @ free)


def _orthonormal(columns: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a basis (k, r) whose columns have orthonormal images, and the coordinates (r,) of what is wanted."""
    size = np.abs(columns).max(axis=0, initial=0.0)
    size[size == 0] = 1.0
    left_vectors, singular, right_vectors = np.linalg.svd(columns / size, full_matrices=False)
    used = singular > MIN_SINGULAR_VALUE * singular.max(initial=0.0)
    return right_vectors[used].T / singular[used] / size[:, None], left_vectors[:, used].T @ wanted


def fit_within(
    columns: FloatArray, wanted: FloatArray, broken: Callable[[FloatArray], Inequalities]
) -> FloatArray | None:
    """Return the least-squares solution (k,) that breaks no inequality, or None where that is not found.

    Parameters
    ----------
    columns : (n, k) array
    wanted : (n,) array
    broken : callable
        From a solution the inequalities that it breaks, none where it is good. They are added until there are none,
        which also finds the solution of convex conditions that are no finite number of inequalities (Kelley's cutting
        planes).
    """
    rows, bounds = np.zeros((0, columns.shape[1])), np.zeros(0)
    solution: FloatArray | None = least_squares(columns, wanted)
    for _ in range(MAX_ROUNDS):
        if solution is None:
            return None
        new_rows, new_bounds = broken(solution)
        if not len(new_rows):
            return solution
        rows, bounds = np.vstack([rows, new_rows]), np.concatenate([bounds, new_bounds])
        solution = constrained_least_squares(columns, wanted, (rows, bounds))
    return None
