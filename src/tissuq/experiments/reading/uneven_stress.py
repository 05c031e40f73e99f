"""Bodies in which the stress is not even: the wall of a tube under pressure, and a disc that a rheometer twists."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from tissuq.errors import InputError

__all__ = ["Tube", "apparent_stress", "rim_stress"]

FloatArray = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Of Gauss quadrature through the wall."""
MOST_ROWS = 2000
"""Number of rows that a curve is fitted to: of more every second, third ..."""
THICKEST = 0.5
"""Thickness over radius up to which the accuracy of stresses is tested."""
MAX_DEGREE = 3
"""Degree of the polynomial."""
POINTS_OF_TERM = 4
"""Different measurements for each of its terms, at least."""
LARGEST_LOG = 50.0
SMALLEST_MISFIT = 1e-24
"""Mean square of the misfit over the largest measurement, below which a further term serves nothing."""


@dataclass(frozen=True)
class Tube:
    """An undeformed tube with a wall that keeps its volume, held at its length; its radii in mm.

    With the stretch l = r/R at an undeformed radius R, x = (l^2 - 1) is inversely proportional to R^2, and equilibrium
    is

        p = integral of W'(l)/(l^2 - 1) dl from the outer to the inner face = integral of S d(ln R),   S = W'(l)/l,

    so that p/ln(B/A) is the mean of the second Piola-Kirchhoff stress S over the logarithm of R. At the radius sqrt(AB)
    in the middle of that scale S is as large up to second order in the thickness.

    References
    ----------
    Haughton & Ogden (1979), J. Mech. Phys. Solids 27, 179 and 489.
    """

    inner: float
    outer: float

    @property
    def middle(self) -> float:
        """The radius of the middle of the wall, sqrt(AB)."""
        return sqrt(self.inner * self.outer)

    @property
    def relative_thickness(self) -> float:
        """The thickness over the radius of the middle of the wall."""
        return (self.outer - self.inner) / self.middle

    @property
    def note(self) -> str:
        """What to know of stresses in it."""
        text = (
            "the tube is taken as held at its undeformed length, and as free of stress without pressure; if it was "
            "stretched along its axis first, the parameters of a fit are not those of its wall."
        )
        if self.relative_thickness <= THICKEST:
            return text
        return (
            f"{text} Its wall is {self.relative_thickness:.2g} times as thick as the radius of its middle, beyond the "
            f"{THICKEST:g} up to which the stress there is known to be right within 1 %."
        )

    @property
    def log_ratio(self) -> float:
        """ln(B/A), what the pressure is divided by."""
        return log(self.outer / self.inner)

    def stretch(self, radius: FloatArray, undeformed: float) -> FloatArray:
        """Return the stretch (n,) of the middle of the wall for radii (n,) of the face with that undeformed radius.

        l^2 - 1 = (r^2 - R^2)/(AB) for either face, as the cross-section of the wall does not change.

        Raises
        ------
        InputError
            When the wall is thicker than such a tube.
        """
        square = (radius**2 - undeformed**2) / self.middle**2
        if (square <= -self.inner / self.outer).any():
            narrowest = 2 * float(radius.min())
            raise InputError(
                f"at a diameter of {narrowest:g} mm the inside of the tube would be closed: a wall of "
                f"{self.outer - self.inner:g} mm has the same cross-section at every diameter. Check the undeformed "
                "diameter and the thickness of the wall (--diameter, --thickness), and the unit of the column."
            )
        return np.sqrt(1 + square)

    def engineering_stress(self, stretch: FloatArray, mean: FloatArray) -> FloatArray:
        """Return the engineering stress (n,) in the middle of the wall for its stretch and mean stresses p/ln(B/A).

        The stress S through the wall is that of a smooth curve x (2 + x)/(1 + x)^2 exp(polynomial of x), whose mean
        over the wall is fitted to the mean stresses; the first factor is that of a neo-Hookean or Mooney-Rivlin wall,
        for which degree 0 is exact. The mean stresses are multiplied by what the curve is in the middle over its mean.

        Raises
        ------
        InputError
            When the pressure does not widen the tube.
        """
        middle = stretch**2 - 1
        through = middle[:, None] * np.exp(self.log_ratio * NODES)
        largest, size = np.abs(middle).max(), float(np.abs(mean).max())
        if mean @ middle <= 0:
            raise InputError("the tube is not wider where the pressure is larger: check which columns are read.")
        shape, weights = (2 + through) / (1 + through) ** 2, WEIGHTS / 2
        shape_in_wall = weights * through * shape
        thinned = slice(None, None, 1 + len(mean) // MOST_ROWS)
        coefficients = _log_coefficients(mean[thinned] / size, shape_in_wall[thinned], through[thinned] / largest)

        def curve(x: FloatArray) -> FloatArray:
            """Return the stress of the curve over x, which has a value at 0."""
            return np.asarray((2 + x) / (1 + x) ** 2 * np.exp(polyval(x / largest, coefficients)))

        correction = curve(middle) / (curve(through) * np.exp(self.log_ratio * NODES) @ weights)
        return np.asarray(mean * stretch * correction)


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
    squares = shares[:, None] ** 2
    coefficients = _log_coefficients(sizes, shares[:, None], squares)
    degrees = np.arange(len(coefficients))
    slope = 1 + squares**degrees @ (2 * degrees * coefficients)
    return np.asarray(apparent * (3 + slope) / 4)


def _log_coefficients(sizes: FloatArray, shape: FloatArray, variable: FloatArray) -> FloatArray:
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
    sums, fits = shape.sum(axis=1), []
    degrees = min(MAX_DEGREE, len(np.unique(np.abs(sums))) // POINTS_OF_TERM - 1)
    start = np.log([sums @ sizes / (sums @ sums)])
    for degree in range(max(degrees, 0) + 1):
        columns = powers[..., : degree + 1]
        start, misfit = _fitted(sizes, shape, columns, np.append(start, np.zeros(degree + 1 - len(start))))
        criterion = len(sizes) * np.log(max(misfit, SMALLEST_MISFIT)) + (degree + 1) * np.log(len(sizes))
        fits.append((criterion, start))
    return min(fits, key=lambda fit: fit[0])[1]


def _fitted(sizes: FloatArray, shape: FloatArray, columns: FloatArray, start: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients for powers (n, m, k) of the variable, and the mean square of the misfit."""
    from scipy.optimize import least_squares

    def curves(coefficients: Any) -> Any:
        return shape * np.exp(np.minimum(columns @ coefficients, LARGEST_LOG))

    result = least_squares(
        lambda coefficients: curves(coefficients).sum(axis=1) - sizes,
        start,
        jac=lambda coefficients: (curves(coefficients)[..., None] * columns).sum(axis=1),
    )
    return np.asarray(result.x), 2 * float(result.cost) / len(sizes)
