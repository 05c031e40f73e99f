"""A strain energy known by its slopes along the invariants and the logarithms of the stretches, in smooth pieces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.mechanics.arithmetic import library, log

__all__ = ["Pieces", "PiecewiseEnergy", "pieces"]

FloatArray = NDArray[np.float64]


class Pieces(NamedTuple):
    """A function in quartic pieces between knots, continued with the slope it has at its ends.

    Its slope is a cubic spline, so that its second derivative is smooth, too. Arrays of NumPy (also complex ones) and
    of JAX pass through, which may trace the fields.

    Attributes
    ----------
    knots : (g + 1,) array
    coefficients : (5, g) array
        Of every piece, the highest power of the distance from its first knot first.
    """

    knots: Any
    coefficients: Any

    def __call__(self, coordinate: Any) -> Any:
        """Return the function's values."""
        arrays = library(coordinate)
        knots = arrays.asarray(self.knots)
        inside = arrays.where(coordinate.real > knots[-1], knots[-1], coordinate)
        inside = arrays.where(coordinate.real < knots[0], knots[0], inside)
        piece = arrays.searchsorted(knots[1:-1], inside.real, side="right")
        u = inside - knots[piece]
        a, b, c, d, e = (arrays.asarray(power)[piece] for power in self.coefficients)
        value = (((a * u + b) * u + c) * u + d) * u + e
        slope = ((4 * a * u + 3 * b) * u + 2 * c) * u + d
        return value + slope * (coordinate - inside)

    def slope(self, coordinate: FloatArray) -> FloatArray:
        """Return the function's slope at coordinates (n,)."""
        inside = np.clip(coordinate, self.knots[0], self.knots[-1])
        piece = np.searchsorted(self.knots[1:-1], inside, side="right")
        u = inside - self.knots[piece]
        a, b, c, d, _ = self.coefficients[:, piece]
        return np.asarray(((4 * a * u + 3 * b) * u + 2 * c) * u + d)


def pieces(knots: FloatArray, slopes: FloatArray) -> list[Pieces]:
    """Return functions that vanish at zero from their slopes (g, N) at knots (g,) around zero."""
    from scipy.interpolate import CubicSpline

    functions = CubicSpline(knots, slopes).antiderivative()
    coefficients = functions.c.transpose(2, 0, 1).copy()  # of a function together in memory, which is searched often
    coefficients[:, -1] -= functions(0.0)[:, None]
    return [Pieces(knots, of_draw) for of_draw in coefficients]


class PiecewiseEnergy(NamedTuple):
    """W = A(I1 - 3) + B(I2 - 3) + w(ln l1) + w(ln l2) + w(ln l3)."""

    of_i1: Pieces
    of_i2: Pieces
    logarithm: Pieces

    def __call__(self, stretches: tuple[Any, Any, Any]) -> Any:
        """Return the energy (MPa) of principal stretches whose product is one."""
        x, y, z = (stretch * stretch for stretch in stretches)
        of_invariants = self.of_i1(x + y + z - 3) + self.of_i2(x * y + y * z + z * x - 3)
        return of_invariants + sum(self.logarithm(log(stretch)) for stretch in stretches)
