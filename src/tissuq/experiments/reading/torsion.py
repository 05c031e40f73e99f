"""A disc that a rheometer twists: the amount of shear and the stress at its rim, from twist and torque."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.reading.smooth_curve import log_coefficients

__all__ = ["apparent_stress", "rim_stress"]

FloatArray = NDArray[np.float64]


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
    squares = places[:, None] ** 2
    coefficients = log_coefficients(sizes, places[:, None], squares)
    degrees = np.arange(len(coefficients))
    slope = 1 + squares**degrees @ (2 * degrees * coefficients)
    return np.asarray(apparent * (3 + slope) / 4)
