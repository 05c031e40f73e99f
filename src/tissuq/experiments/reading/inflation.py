"""A tube under pressure: the hoop stretch and the stress in the middle of its wall, from diameter and pressure."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.reading.smooth_curve import log_coefficients

__all__ = ["Tube"]

FloatArray = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Of Gauss quadrature through the wall."""
MOST_ROWS = 2000
"""Number of rows that a curve is fitted to: of more every second, third ..."""
THICKEST = 0.5
"""Thickness over radius up to which the accuracy of stresses is tested."""


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
        known = weights * through * shape
        some = slice(None, None, 1 + len(mean) // MOST_ROWS)
        coefficients = log_coefficients(mean[some] / size, known[some], through[some] / largest)

        def curve(x: FloatArray) -> FloatArray:
            """Return the stress of the curve over x, which has a value at 0."""
            return np.asarray((2 + x) / (1 + x) ** 2 * np.exp(polyval(x / largest, coefficients)))

        correction = curve(middle) / (curve(through) * np.exp(self.log_ratio * NODES) @ weights)
        return np.asarray(mean * stretch * correction)
