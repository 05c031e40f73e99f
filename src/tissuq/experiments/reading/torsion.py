"""A disc that a rheometer twists: the amount of shear and the stress at its rim, from twist and torque."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError

__all__ = ["apparent_stress", "rim_stress"]

FloatArray = NDArray[np.float64]

MAX_DEGREE = 3
"""Degree, in the square of the shear, of the polynomial that the logarithm of the apparent modulus is fitted by."""
POINTS_OF_TERM = 4
"""Different amounts of shear for each of its terms, at least."""
LARGEST_LOG = 50.0
SMALLEST_MISFIT = 1e-24
"""Mean square of the misfit over the largest stress, below which a further term serves nothing."""


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
    places, sizes = shear / np.abs(shear).max(), apparent / max(float(np.abs(apparent).max()), np.finfo(float).tiny)
    if places @ sizes <= 0:
        raise InputError("the torque does not have the sign of the twist: change one of the signs in the file.")
    powers = places[:, None] ** (2 * np.arange(MAX_DEGREE + 1))
    degrees = min(MAX_DEGREE, len(np.unique(np.abs(places))) // POINTS_OF_TERM - 1)
    start, fits = np.log([places @ sizes / (places @ places)]), []
    for degree in range(max(degrees, 0) + 1):
        columns = powers[:, : degree + 1]
        start, misfit = _fitted(places, sizes, columns, np.append(start, np.zeros(degree + 1 - len(start))))
        criterion = len(sizes) * np.log(max(misfit, SMALLEST_MISFIT)) + (degree + 1) * np.log(len(sizes))
        fits.append((criterion, 1 + columns @ (2 * np.arange(degree + 1) * start)))
    _, slope = min(fits, key=lambda fit: fit[0])
    return np.asarray(apparent * (3 + slope) / 4)


def _fitted(places: FloatArray, sizes: FloatArray, columns: FloatArray, start: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients with which places exp(columns coefficients) are nearest to sizes, and the mean square."""
    from scipy.optimize import least_squares

    def curve(coefficients: Any) -> Any:
        return places * np.exp(np.minimum(columns @ coefficients, LARGEST_LOG))

    result = least_squares(
        lambda coefficients: curve(coefficients) - sizes,
        start,
        jac=lambda coefficients: curve(coefficients)[:, None] * columns,
    )
    return np.asarray(result.x), 2 * float(result.cost) / len(sizes)
