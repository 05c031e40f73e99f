"""The parameters of a law that come nearest to a draw, under the condition that the law is stable."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.export.draw_stresses import DrawStresses
from tissuq.export.stability_rows import Inequalities, StabilityRows

WEIGHTS_BEYOND = (1.0, 0.3, 0.1, 0.03, 0.01)
"""Weights of states beyond the measured ones, of which the heaviest is taken that costs little inside."""
WANTED_ERROR = 0.01
"""Largest relative error of a stress inside with which a card is content."""
MAX_RMS_RATIO = 1.1
"""Where that is out of reach: the root mean square error inside may be so many times the smallest."""
MIN_SINGULAR_VALUE = 1e-12
"""Singular values below that share of the largest count as zero."""
MAX_ROUNDS = 40
"""Largest number of times that inequalities are added."""


class Candidate(NamedTuple):
    """Values of the parameters that are not linear, and what unit values of the k others give.

    Attributes
    ----------
    setting : tuple of float
    columns : (n, k) array
        Stresses in the states.
    unit_moduli : (k,) array
        Initial shear moduli.
    """

    setting: tuple[float, ...]
    columns: FloatArray
    unit_moduli: FloatArray


def nearest_values(candidate: Candidate, stability: StabilityRows, draws: DrawStresses, number: int) -> FloatArray:
    """Return the linear parameters (k,) nearest to a draw that have its initial shear modulus.

    They are stable where the draw is. Of what was not measured the heaviest weight is taken that costs little inside.

    Parameters
    ----------
    candidate : Candidate
    stability : StabilityRows
        Of the same material with the same other parameters.
    draws : DrawStresses
    number : int
        Of the draw.
    """
    starts, free = _of_modulus(candidate.unit_moduli, draws.modulus[[number]])
    start = starts[:, 0]
    modulus, is_stable = float(draws.modulus[number]), bool(draws.stable[number])
    stress = draws.of_states.stress[number]
    is_borne = np.isfinite(stress)
    is_beyond, size = draws.shell[is_borne] > 0, draws.size_in_fits[number, is_borne]
    columns, stress = candidate.columns[is_borne] / size[:, None], stress[is_borne] / size

    def broken(solution: FloatArray) -> Inequalities:
        rows, bounds = stability.broken(start + free @ solution, modulus, draws.wanted_stiffness[number])
        return rows @ free, bounds - rows @ start

    def weighted(weight_beyond: float) -> FloatArray:
        weights = np.where(is_beyond, weight_beyond, 1.0)
        weighted_columns, wanted = weights[:, None] * (columns @ free), weights * (stress - columns @ start)
        solution = fit_within(weighted_columns, wanted, broken) if is_stable else None
        if solution is None:  # as near as it gets: that it is not stable is said
            solution = least_squares(weighted_columns, wanted)
        return np.asarray(start + free @ solution)

    candidates = [weighted(weight) for weight in WEIGHTS_BEYOND]
    errors = [np.abs(columns @ values - stress)[~is_beyond] for values in candidates]
    rms = [float(np.sqrt((error**2).mean())) for error in errors]
    is_good = [
        error.max() <= WANTED_ERROR or size <= MAX_RMS_RATIO * min(rms) for error, size in zip(errors, rms, strict=True)
    ]
    return candidates[is_good.index(True)]


def _of_modulus(unit_moduli: FloatArray, modulus: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return linear parameters (k, N) of these initial shear moduli (N,), and what they may change by: (k, k - 1)."""
    pivot = int(np.argmax(np.abs(unit_moduli)))
    start = np.zeros((len(unit_moduli), len(modulus)))
    start[pivot] = modulus / unit_moduli[pivot]
    free = np.delete(np.eye(len(unit_moduli)), pivot, axis=1)
    free[pivot] = -np.delete(unit_moduli, pivot) / unit_moduli[pivot]
    return start, free


def squared_distance(candidate: Candidate, weights: FloatArray, wanted: FloatArray, modulus: FloatArray) -> float:
    """Return the squared distance, by weights (n,), of stresses (n, N) from the nearest that have these moduli (N,)."""
    start, free = _of_modulus(candidate.unit_moduli, modulus)
    columns = weights[:, None] * (candidate.columns @ free)
    residual = weights[:, None] * (wanted - candidate.columns @ start)
    basis = np.linalg.qr(columns / np.maximum(np.abs(columns).max(axis=0, initial=0.0), 1e-300))[0]
    return float((residual**2).sum() - ((basis.T @ residual) ** 2).sum())


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
