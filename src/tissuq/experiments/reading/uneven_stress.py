"""Bodies in which the stress is not even: the wall of a tube under pressure, and a disc that a rheometer twists."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from tissuq.errors import InputError

__all__ = ["SAME_STRETCH", "Tube", "apparent_stress", "rim_stress", "rows_at_each_stretch"]

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
SAME_STRETCH = 0.01
"""Difference of axial stretches up to which they count as one."""
LARGEST_LOG = 50.0
SMALLEST_MISFIT = 1e-24
"""Mean square of the misfit over the largest measurement, below which a further term serves nothing."""


@dataclass(frozen=True)
class Tube:
    """An undeformed tube with a wall that keeps its volume, held at an axial stretch; its radii in mm.

    With the hoop stretch l = r/R at an undeformed radius R and the axial stretch l_z, x = l_z l^2 - 1 is inversely
    proportional to R^2, and equilibrium is

        p = integral of dW/dl / (l_z l^2 - 1) dl from the outer to the inner face = integral of S d(ln R) / l_z

    with S = (dW/dl)/l, so that l_z p/ln(B/A) is the mean of S over the logarithm of R. At the radius sqrt(AB) in the
    middle of that scale S is as large up to second order in the thickness.

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
        """What to know of stresses in a wall that is thicker than tested; an empty text of others."""
        if self.relative_thickness <= THICKEST:
            return ""
        return (
            f"The wall is {self.relative_thickness:.2g} times as thick as the radius of its middle, beyond the "
            f"{THICKEST:g} up to which the stress there is known to be right within 1 %."
        )

    @property
    def log_ratio(self) -> float:
        """ln(B/A), what the pressure is divided by."""
        return log(self.outer / self.inner)

    def stretch(self, radius: FloatArray, undeformed: float, axial_stretch: FloatArray | float = 1.0) -> FloatArray:
        """Return the hoop stretch (n,) of the middle of the wall for radii (n,) of the face of an undeformed radius.

        l_z l^2 - 1 = (l_z r^2 - R^2)/(AB) for either face, as the wall keeps its volume.

        Raises
        ------
        InputError
            When the wall is thicker than such a tube.
        """
        square = (axial_stretch * radius**2 - undeformed**2) / self.middle**2
        if (square <= -self.inner / self.outer).any():
            narrowest = 2 * float(radius[np.argmin(square)])
            is_stretched = bool(np.any(np.asarray(axial_stretch) != 1))
            raise InputError(
                f"at a diameter of {narrowest:g} mm the inside of the tube would be closed: a wall of "
                f"{self.outer - self.inner:g} mm has the same "
                f"{'volume' if is_stretched else 'cross-section'} at every diameter. Check the undeformed "
                "diameter and the thickness of the wall (--diameter, --thickness), "
                f"{'the axial stretch, ' * is_stretched}and the unit of the column."
            )
        return np.asarray(np.sqrt((1 + square) / axial_stretch))

    def engineering_stress(
        self, stretch: FloatArray, mean: FloatArray, axial_stretch: FloatArray | None = None
    ) -> FloatArray:
        """Return the engineering stress (n,) in the middle of the wall for its hoop stretch and p/ln(B/A).

        The stress S through the wall is that of a smooth curve of x, whose mean over the wall is fitted to
        l_z p/ln(B/A); the rows at each axial stretch have a curve of their own (`_stress_in_middle`). None is an axial
        stretch of one.

        Raises
        ------
        InputError
            When the pressure does not widen the tube, or the axial stretch changes from row to row.
        """
        if axial_stretch is None:
            return np.asarray(stretch * self._stress_in_middle(stretch**2 - 1, mean))
        stress = np.empty_like(mean)
        for rows in rows_at_each_stretch(axial_stretch):
            held, at_length = axial_stretch[rows], bool((axial_stretch[rows] == 1).all())
            middle = held * stretch[rows] ** 2 - 1
            second = self._stress_in_middle(middle, held * mean[rows], is_free_at_zero=at_length)
            stress[rows] = stretch[rows] * second
        return stress

    def _stress_in_middle(self, middle: FloatArray, mean: FloatArray, *, is_free_at_zero: bool = True) -> FloatArray:
        """Return S (n,) in the middle of the wall for x there and the means of S over the wall.

        The curve is S = x (2 + x)/(1 + x)^2 exp(polynomial of x); the factors before it are those of a neo-Hookean or
        Mooney-Rivlin wall, for which degree 0 is exact. The means are multiplied by what the curve is in the middle
        over its own mean. A stretched tube with fibres has no stress at another x than 0: unless ``is_free_at_zero``,
        curves with x - x0 for the first factor are fitted, too. Of all the Bayesian information criterion chooses one.
        With x0 its difference from its own mean is added to the means, which may be zero.
        """
        through = middle[:, None] * np.exp(self.log_ratio * NODES)
        largest, size = np.abs(middle).max(), float(np.abs(mean).max())
        is_wider = mean @ middle > 0 if is_free_at_zero else (mean - mean.mean()) @ middle > 0
        if not is_wider and not (len(mean) == 1 and mean @ middle >= 0):
            raise InputError("the tube is not wider where the pressure is larger: check which columns are read.")
        factor, weights = (2 + through) / (1 + through) ** 2, WEIGHTS / 2
        thinned = slice(None, None, 1 + len(mean) // MOST_ROWS)
        sizes, powers = mean[thinned] / size, through[thinned] / largest
        of_zero = weights * through * factor
        fits = _log_fits(sizes, of_zero[thinned], powers) if mean @ middle > 0 else []
        if not is_free_at_zero and len(np.unique(middle)) >= 2 * POINTS_OF_TERM:
            fits += _log_fits(sizes, of_zero[thinned], powers, (weights * factor)[thinned], fits)
        if not fits:
            raise InputError(
                f"of {len(mean)} rows at one axial stretch the stress in the wall does not follow: read more of them."
            )
        fit = min(fits, key=lambda fit: fit.criterion)

        def curve(x: FloatArray) -> FloatArray:
            """Return the stress of the curve over x - x0, which has a value where that is 0."""
            return np.asarray((2 + x) / (1 + x) ** 2 * np.exp(polyval(x / largest, fit.coefficients)))

        if fit.start is None:
            return np.asarray(mean * (curve(middle) / (curve(through) * np.exp(self.log_ratio * NODES) @ weights)))
        in_middle, in_wall = ((x - fit.start) * curve(x) for x in (middle, through))
        return np.asarray(mean + size * (in_middle - in_wall @ weights))


def rows_at_each_stretch(axial_stretch: FloatArray) -> list[NDArray[np.intp]]:
    """Return the rows at each axial stretch, of which those within a hundredth of one another are one.

    Raises
    ------
    InputError
        When it changes from row to row.
    """
    order = np.argsort(axial_stretch, kind="stable")
    groups = np.split(order, 1 + np.flatnonzero(np.diff(axial_stretch[order]) > SAME_STRETCH))
    for rows in groups:
        if np.ptp(axial_stretch[rows]) > 2 * SAME_STRETCH:
            raise InputError(
                f"the axial stretch changes from {axial_stretch[rows].min():.4g} to {axial_stretch[rows].max():.4g} "
                "while the tube is inflated. The stress in its wall follows from pressure and diameter only at an "
                "axial stretch that is held, at one or at several in turn: leave rows out with --leave-out."
            )
    return groups


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
    fits = _log_fits(sizes, shares[:, None], squares)
    coefficients = min(fits, key=lambda fit: fit.criterion).coefficients
    degrees = np.arange(len(coefficients))
    slope = 1 + squares**degrees @ (2 * degrees * coefficients)
    return np.asarray(apparent * (3 + slope) / 4)


class _LogFit(NamedTuple):
    """A curve through measurements: its Bayesian information criterion, its coefficients, and x0 where it has one."""

    criterion: float
    coefficients: FloatArray
    start: float | None = None


def _log_fits(
    sizes: FloatArray,
    shape: FloatArray,
    variable: FloatArray,
    slope: FloatArray | None = None,
    at_zero: Sequence[_LogFit] = (),
) -> list[_LogFit]:
    """Return curves sum over j of (shape_ij - x0 slope_ij) exp(sum over k of c_k variable_ij^k), of degree 0 to 3.

    Each is nearest to the measurements by least squares, with the criterion by which one is chosen.

    Parameters
    ----------
    sizes : (n,) array
        The measurements, the largest about one.
    shape : (n, m) array
        Whose sum over j is, where there is no slope, of the sign of the measurements, so that degree 0 is a factor.
    variable : (n, m) array
    slope : (n, m) array, optional
        What x0 is multiplied by; x0 is zero without it.
    at_zero : sequence of _LogFit
        Curves without it of the same measurements, degree by degree, from which the search begins a second time.
    """
    powers = variable[..., None] ** np.arange(MAX_DEGREE + 1)
    sums, fits, start = shape.sum(axis=1), list[_LogFit](), np.zeros(0)
    if slope is not None:
        # x0 and the factor by linear least squares: sums of the shape times the factor, less x0 times those of slopes.
        factor, shifted = np.linalg.lstsq(np.column_stack([sums, -slope.sum(axis=1)]), sizes, rcond=None)[0]
        if factor <= 0:
            return []
        start, sums = np.array([shifted / factor]), sums - shifted / factor * slope.sum(axis=1)
    coefficients = np.log([sums @ sizes / (sums @ sums)])
    degrees = min(MAX_DEGREE, len(np.unique(np.abs(sums))) // POINTS_OF_TERM - 1)
    for degree in range(max(degrees, 0) + 1):
        columns = powers[..., : degree + 1]
        first = np.concatenate([start, coefficients, np.zeros(degree + 1 - len(coefficients))])
        starts = [first, *(np.append(0.0, fit.coefficients) for fit in at_zero[degree : degree + 1])]
        results = [_fitted(sizes, shape, columns, values, slope) for values in starts]
        found, misfit = min(results, key=lambda result: result[1])
        start, coefficients = found[: len(start)], found[len(start) :]
        criterion = len(sizes) * np.log(max(misfit, SMALLEST_MISFIT)) + len(found) * np.log(len(sizes))
        fits.append(_LogFit(float(criterion), coefficients, float(start[0]) if len(start) else None))
    return fits


def _fitted(
    sizes: FloatArray, shape: FloatArray, columns: FloatArray, first: FloatArray, slope: FloatArray | None
) -> tuple[FloatArray, float]:
    """Return x0 where there is a slope, the coefficients for powers (n, m, k), and the mean square of the misfit."""
    from scipy.optimize import least_squares

    count = 0 if slope is None else 1

    def factors(values: Any) -> Any:
        return np.exp(np.minimum(columns @ values[count:], LARGEST_LOG))

    def shapes(values: Any) -> Any:
        return shape if slope is None else shape - values[0] * slope

    def jacobian(values: Any) -> Any:
        factor = factors(values)
        by_coefficients = ((shapes(values) * factor)[..., None] * columns).sum(axis=1)
        if slope is None:
            return by_coefficients
        return np.column_stack([-(slope * factor).sum(axis=1), by_coefficients])

    result = least_squares(lambda values: (shapes(values) * factors(values)).sum(axis=1) - sizes, first, jac=jacobian)
    return np.asarray(result.x), 2 * float(result.cost) / len(sizes)
