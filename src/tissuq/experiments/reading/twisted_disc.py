"""The stress at the rim of a disc that a rheometer twists, which is not even, from torques and amounts of shear."""

from __future__ import annotations

from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError

MAX_DEGREE = 3
"""Degree of the polynomial."""
POINTS_OF_TERM = 4
"""Different measurements for each of its terms, at least."""
LARGEST_LOG = 50.0
SMALLEST_MISFIT = 1e-24
"""Mean square of the misfit over the largest measurement, below which a further term serves nothing."""


def apparent_stress(torque: FloatArray, radius: float) -> FloatArray:
    """Return the stress (n,) in MPa at the rim of a linear material, 2 T / (pi R^3), for T in N mm and R in mm."""
    return np.asarray(2 * torque / (np.pi * radius**3))


def rim_stress(shear: FloatArray, apparent: FloatArray) -> FloatArray:
    """Return the shear stress (n,) at the rim for amounts of shear there and apparent stresses 2 T / (pi R^3).

    The shear at the radius r is that of the rim times r/R, so that T = 2 pi (R/g)^3 times the integral of tau(x) x^2
    from 0 to the amount of shear g at the rim. Its derivative by g gives

        tau = (3 T + g dT/dg) / (2 pi R^3) = apparent stress (3 + d ln T / d ln g) / 4,

    exactly, for every isotropic material without volume change. The slope d ln T / d ln g is that of the curve
    T = g exp(polynomial of g^2), odd as the torque of such a material is, which is fitted to all torques by least
    squares; its degree (0, a linear material, to 3) is chosen by the Bayesian information criterion.

    Raises
    ------
    InputError
        When the torque does not go with the twist.

    References
    ----------
    Nadai (1950), Theory of Flow and Fracture of Solids, chapter 21; Rabinowitsch (1929) for flow in tubes.
    """
    shares, sizes = shear / np.abs(shear).max(), apparent / max(float(np.abs(apparent).max()), np.finfo(float).tiny)
    if shares @ sizes <= 0:
        raise InputError("the torque does not have the sign of the twist: change one of the signs in the file.")
    coefficients = _coefficients(shares, sizes)
    degrees = np.arange(len(coefficients))
    slope = 1 + (shares**2)[:, None] ** degrees @ (2 * degrees * coefficients)
    return np.asarray(apparent * (3 + slope) / 4)


def _coefficients(shares: FloatArray, sizes: FloatArray) -> FloatArray:
    """Return c of the curve s exp(sum over k of c_k s^2k) of shares s (n,) that is nearest to sizes (n,) of about one.

    Of the curves of degree 0 to 3 it is that of the least criterion.
    """
    powers, fits = (shares**2)[:, None] ** np.arange(MAX_DEGREE + 1), dict[float, FloatArray]()
    coefficients = np.log([shares @ sizes / (shares @ shares)])
    degrees = min(MAX_DEGREE, len(np.unique(np.abs(shares))) // POINTS_OF_TERM - 1)
    for degree in range(max(degrees, 0) + 1):
        first = np.append(coefficients, np.zeros(degree + 1 - len(coefficients)))
        coefficients, misfit = _fitted(sizes, shares, powers[:, : degree + 1], first)
        criterion = len(sizes) * np.log(max(misfit, SMALLEST_MISFIT)) + len(coefficients) * np.log(len(sizes))
        fits.setdefault(float(criterion), coefficients)
    return fits[min(fits)]


def _fitted(sizes: FloatArray, shares: FloatArray, columns: FloatArray, first: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients for powers (n, k), and the mean square of the misfit."""
    from scipy.optimize import least_squares

    def curve(coefficients: Any) -> Any:
        return shares * np.exp(np.minimum(columns @ coefficients, LARGEST_LOG))

    result = least_squares(
        lambda coefficients: curve(coefficients) - sizes,
        first,
        jac=lambda coefficients: curve(coefficients)[:, None] * columns,
    )
    return np.asarray(result.x), 2 * float(result.cost) / len(sizes)
