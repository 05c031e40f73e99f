"""The energy of a draw: a discrepancy in smooth pieces, and all beyond the range of the data, along `rays`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.experiments.modes.path import STEP
from tissuq.mechanics.arithmetic import exp, library, log
from tissuq.mechanics.material import Material
from tissuq.mechanics.rays import DIRECTIONS, Range, Rays, direction_of, direction_of_angle, ends_of, log_growth

SHARES, WEIGHTS = 0.5 * (np.polynomial.legendre.leggauss(8) + np.array([[1.0], [0.0]]))
"""Nodes and weights of the integral over s, from 0 to 1."""
ANY_STRETCHES = (1.25, 1.0, 0.8)
"""Of which an energy is computed in place of those that are not asked for."""


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


class Continuation(NamedTuple):
    """W = W_c + the integral over x = I1 - 3 from x_c of V_c exp(a s + b s^2 / (s + d)), s = ln(x / x_c), for x > x_c.

    ln x_c, W_c, V_c, a and b are functions of the direction c of the Hencky strain (`rays.DIRECTIONS`). Arrays of
    NumPy (also complex ones) and of JAX pass through, which may trace the fields.

    Attributes
    ----------
    coefficients : (5, 4, g) array
        Of the five functions on equal pieces of c from -1 to 1, the highest power of the distance first.
    """

    coefficients: Any

    def __call__(self, energy: Callable[[tuple[Any, ...]], Any], stretches: tuple[Any, ...]) -> Any:
        """Return an energy (MPa) at principal stretches whose product is one, continued where they lie beyond."""
        arrays = library(stretches[0])
        invariant, direction = _invariant_and_direction(stretches)
        is_beyond = invariant.real > exp(self._functions(direction)[0]).real
        inside = tuple(arrays.where(is_beyond, 1.0, stretch) for stretch in stretches)
        pairs = zip(stretches, ANY_STRETCHES, strict=True)
        outside = tuple(arrays.where(is_beyond, stretch, any_stretch) for stretch, any_stretch in pairs)
        return arrays.where(is_beyond, self._beyond(*_invariant_and_direction(outside)), energy(inside))

    def stress(self, logs: FloatArray, rates: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Return which states (n, 3) lie beyond, and their stresses, which are the work on the rates (n, 3)."""
        invariant, direction = _invariant_and_direction(np.exp(logs).T)
        (outside,) = np.nonzero(invariant > np.exp(self._functions(direction)[0]))
        stretches = np.exp(logs[outside] + 1j * STEP * rates[outside]).T
        return outside, np.asarray(self._beyond(*_invariant_and_direction(stretches)).imag / STEP)

    def _beyond(self, invariant: Any, direction: Any) -> Any:
        log_end, energy, slope, exponent, error = self._functions(direction)
        distance = log(invariant) - log_end
        nodes = SHARES * distance[..., None]
        mean = (WEIGHTS * exp(nodes + log_growth(nodes, exponent[..., None], error[..., None]))).sum(-1)
        return energy + slope * exp(log_end) * distance * mean

    def _functions(self, direction: Any) -> tuple[Any, ...]:
        arrays, count = library(direction), self.coefficients.shape[-1]
        position = 0.5 * (direction.real + 1) * count
        piece = arrays.clip(arrays.floor(position), 0, count - 1).astype(int)
        u = direction - (-1 + piece * (2 / count))
        return tuple(
            ((a * u + b) * u + c) * u + d
            for a, b, c, d in ((arrays.asarray(power)[piece] for power in powers) for powers in self.coefficients)
        )


def _invariant_and_direction(stretches: Any) -> tuple[Any, Any]:
    """Return I1 - 3 and the c of the direction of the Hencky strain."""
    l1, l2, l3 = stretches
    return l1 * l1 + l2 * l2 + l3 * l3 - 3, direction_of(log(l1), log(l2), log(l3))


def sum_of_energies(
    materials: Sequence[Material],
    values: Sequence[Any],
    stretches: tuple[Any, ...],
    discrepancy: PiecewiseEnergy | None,
    continuation: Continuation | None,
) -> Any:
    """Return the energy (MPa) of materials and a discrepancy at principal stretches whose product is one."""

    def energy(state: tuple[Any, ...]) -> Any:
        total = sum(material.energy(state, numbers) for material, numbers in zip(materials, values, strict=True))
        return total if discrepancy is None else total + discrepancy(state)

    return energy(stretches) if continuation is None else continuation(energy, stretches)


def rays_to_ends(limits: Range) -> Rays:
    """Return rays in all directions, by c from -1 to 1, to the ends of a range."""
    ends = ends_of(limits)[:, None] * direction_of_angle(np.arccos(DIRECTIONS) / 3)
    return Rays(ends, ends)


def continuations(
    rays: Rays, energies: FloatArray, stresses: FloatArray, exponents: FloatArray, errors: FloatArray
) -> list[Continuation]:
    """Return the continuations of draws from what they have at the ends of `rays_to_ends`: (N, g) each.

    Energies, stresses along the rays, and the exponents with their errors.
    """
    from scipy.interpolate import Akima1DInterpolator

    log_invariant = np.broadcast_to(np.log(rays.end_invariant), energies.shape)
    values = np.stack([log_invariant, energies, stresses / rays.end_rate, exponents, errors], axis=1)
    functions = Akima1DInterpolator(DIRECTIONS, values, axis=2)
    return [Continuation(draw) for draw in functions.c.transpose(2, 3, 0, 1).copy()]
