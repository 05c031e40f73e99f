"""A smooth curve through measurements: a known one times the exponential of a polynomial, of the degree that serves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["log_coefficients"]

FloatArray = NDArray[np.float64]

MAX_DEGREE = 3
"""Degree of the polynomial."""
POINTS_OF_TERM = 4
"""Different measurements for each of its terms, at least."""
LARGEST_LOG = 50.0
SMALLEST_MISFIT = 1e-24
"""Mean square of the misfit over the largest measurement, below which a further term serves nothing."""


def log_coefficients(sizes: FloatArray, known: FloatArray, variable: FloatArray) -> FloatArray:
    """Return the coefficients c of the curve sum over j of known_ij exp(sum over k of c_k variable_ij^k).

    It is nearest to the measurements by least squares; the degree (0 to 3) is chosen by the Bayesian information
    criterion.

    Parameters
    ----------
    sizes : (n,) array
        The measurements, the largest about one.
    known : (n, m) array
        Whose sum over j is of the sign of the measurements, so that degree 0 is a factor.
    variable : (n, m) array
    """
    powers = variable[..., None] ** np.arange(MAX_DEGREE + 1)
    sums, fits = known.sum(axis=1), []
    degrees = min(MAX_DEGREE, len(np.unique(np.abs(sums))) // POINTS_OF_TERM - 1)
    start = np.log([sums @ sizes / (sums @ sums)])
    for degree in range(max(degrees, 0) + 1):
        columns = powers[..., : degree + 1]
        start, misfit = _fitted(sizes, known, columns, np.append(start, np.zeros(degree + 1 - len(start))))
        criterion = len(sizes) * np.log(max(misfit, SMALLEST_MISFIT)) + (degree + 1) * np.log(len(sizes))
        fits.append((criterion, start))
    return min(fits, key=lambda fit: fit[0])[1]


def _fitted(sizes: FloatArray, known: FloatArray, columns: FloatArray, start: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients for powers (n, m, k) of the variable, and the mean square of the misfit."""
    from scipy.optimize import least_squares

    def curves(coefficients: Any) -> Any:
        return known * np.exp(np.minimum(columns @ coefficients, LARGEST_LOG))

    result = least_squares(
        lambda coefficients: curves(coefficients).sum(axis=1) - sizes,
        start,
        jac=lambda coefficients: (curves(coefficients)[..., None] * columns).sum(axis=1),
    )
    return np.asarray(result.x), 2 * float(result.cost) / len(sizes)
