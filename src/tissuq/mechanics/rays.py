"""Rays of deformation, whose logarithmic (Hencky) strains differ by a factor, and how an energy goes on along them.

Uniaxial, equibiaxial and planar tension and simple shear each follow one ray. With x = I1 - 3 along a ray and
V = dW/dx, which of a neo-Hookean material is constant, an energy that is known up to x_c goes on with
V = V_c exp(a s + b s^2 / (s + d)), s = ln(x / x_c). That is a power of x whose exponent is at first a, that of the last
part of the ray, and beyond a distance d becomes a + b, with an error b that the data do not tell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.experiments.modes import Deformation, Path, States
from tissuq.mechanics.arithmetic import cos, exp, sin

DIRECTIONS = np.linspace(-1, 1, 801)
"""Of rays: c = 3 sqrt(6) e1 e2 e3 / |e|^3; 1 in uniaxial tension, 0 in planar, -1 in equibiaxial tension."""
ANGLES = 1920
"""Lode angles between uniaxial and equibiaxial tension at which the end of a range is sought."""
MAX_CORNER_WIDTH, MAX_CORNER_EXCESS = 0.2, 0.075
"""Of a rounded corner of a range: the radius of curvature of the logarithm of the Hencky strain over the angle in
radians, and by how much that logarithm is too large beside the corner, at the most."""
DIRECTIONS_AT_ONCE = 20
"""For which corners are rounded together, so that the processor's cache holds them."""
FAR = 3.0
"""Hencky strain at which rays end that never leave the range."""
TINY = 1e-30
"""Keeps the direction of no strain a number."""
NEWTON_STEPS = 60
"""Most steps to the end of a range along rays; few are needed."""
BISECTIONS = 40
"""Of a ray, to its end along the axes."""
ROUNDING = 1e-9
"""Relative excess over a range that still counts as within it."""
INNER_SHARE = 0.9
"""Hencky strain over that at the end of the range, from which on the exponent is found."""
MEDIAN_ERROR, ERROR_SCALE = 0.2, 0.25
"""Of b over 1 + |a|, which has Student's t distribution with two degrees of freedom; most materials stiffen."""
TRANSITION = 0.5
"""The distance d in the logarithm of I1 - 3."""
TAIL_PROBABILITY = 1e-3
"""On either side, that is left out of that distribution."""
MIN_EXPONENT, MAX_EXPONENT = -0.5, 3.0
"""At the least one, the stress at small strains does not fall along a ray; no tissue here needs the largest one."""


class Range(NamedTuple):
    """Limits of I1 - 3, of I2 - 3, of the logarithms of the principal stretches and of strains along the axes.

    The latter are a dispersion, and the least and the largest of `dispersed` strains with it, for each dispersion.
    """

    invariant_1: float = np.inf
    invariant_2: float = np.inf
    logarithms: tuple[float, float] = (-np.inf, np.inf)
    along_axes: tuple[tuple[float, float, float], ...] = ()

    def within(self, limits: Range) -> Range:
        """Return what lies in both."""
        (low, high), (other_low, other_high) = self.logarithms, limits.logarithms
        return Range(
            min(self.invariant_1, limits.invariant_1),
            min(self.invariant_2, limits.invariant_2),
            (max(low, other_low), min(high, other_high)),
            (*self.along_axes, *limits.along_axes),
        )

    @property
    def isotropic(self) -> Range:
        """The same without limits along the axes."""
        return self._replace(along_axes=())


def share_within(logs: FloatArray, limits: Range) -> FloatArray:
    """Return by which factor (n,), one at most, the logarithmic stretches (n, 3) of states stay within limits."""
    low, high = limits.logarithms
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(logs > 0, high / logs, np.where(logs < 0, low / logs, np.inf))
    shares = np.minimum(1.0, ratios.min(axis=1))
    for sign, limit in ((2.0, limits.invariant_1), (-2.0, limits.invariant_2)):
        for _ in range(NEWTON_STEPS):  # the invariant is convex along the ray: from outside, steps end on its limit
            excess = np.expm1(sign * shares[:, None] * logs).sum(axis=1) - limit
            is_beyond = excess > ROUNDING * limit
            if not is_beyond.any():
                break
            rate = (sign * logs * np.exp(sign * shares[:, None] * logs)).sum(axis=1)
            shares = np.where(is_beyond, shares - excess / np.where(is_beyond, rate, 1.0), shares)
    return np.where(shares > 1 - ROUNDING, 1.0, shares)


def dispersed(invariant_1: FloatArray, axis_strains: FloatArray, dispersion: float) -> FloatArray:
    """Return the strains (n, 2) of structure tensors about the axes of the test (Gasser, Ogden & Holzapfel 2006).

    From I1 - 3 (n,) and C11 - 1 and C22 - 1 (n, 2), or from the rates of these: k (I1 - 3) + (1 - 3 k) (Cii - 1).
    """
    return np.asarray(dispersion * invariant_1[:, None] + (1 - 3 * dispersion) * axis_strains)


def _share_along_axes(logs: FloatArray, tilt: FloatArray, limits: Range) -> FloatArray:
    """Return by which factor (n,), one at most, logarithmic stretches (n, 3) stay within limits along the axes."""
    share, low, high = np.ones(len(logs)), np.zeros(len(logs)), np.ones(len(logs))
    turned = np.sin(tilt) ** 2
    for _ in range(BISECTIONS):
        strains = np.expm1(2 * share[:, None] * logs)
        change = turned * (strains[:, 1] - strains[:, 0])
        along = np.stack([strains[:, 0] + change, strains[:, 1] - change], axis=1)
        is_within = np.ones(len(logs), dtype=bool)
        for dispersion, smallest, largest in limits.along_axes:
            z = dispersed(strains.sum(axis=1), along, dispersion)
            is_within &= (np.maximum(z / largest, z / smallest) <= 1 + ROUNDING).all(axis=1)
        low, high = np.where(is_within, share, low), np.where(is_within, high, share)
        share = 0.5 * (low + high)
    return low


@lru_cache(maxsize=64)
def ends_of(limits: Range) -> FloatArray:
    """Return the Hencky strains (g,) at which rays of directions `DIRECTIONS` leave a range, its corners rounded.

    Corners, where two limits meet, are usual: a test in one mode ends in one. Parabolas of the angle round them from
    outside, so that an energy that goes on from there has no ridge along the ray of the test.
    """
    angles = np.pi / 3 * np.linspace(-1, 2, 1 + 3 * ANGLES)
    logs = np.log(FAR * share_within(FAR * direction_of_angle(angles), limits))
    steepest = np.abs(np.gradient(logs, angles)).max()
    width = min(MAX_CORNER_WIDTH, 2 * MAX_CORNER_EXCESS / max(steepest, TINY) ** 2)
    highest = []
    for block in np.array_split(np.arccos(DIRECTIONS) / 3, 1 + len(DIRECTIONS) // DIRECTIONS_AT_ONCE):
        distances = block[:, None] - angles
        highest.append((logs - distances**2 / (2 * width)).max(axis=1))
    return np.asarray(np.exp(np.concatenate(highest)))


def share_to_end(logs: FloatArray, limits: Range, tilt: FloatArray | None = None) -> FloatArray:
    """Return by which factor (n,), one at most, logarithmic stretches (n, 3) stay within `ends_of` limits.

    The angles (n,) of the first principal axis from axis 1 of the test are zero unless given.
    """
    isotropic, shares = limits.isotropic, np.ones(len(logs))
    if isotropic != Range():
        direction = np.clip(direction_of(*logs.T), -1, 1)
        shares = _interpolated_ends(isotropic)(direction) / np.maximum(np.linalg.norm(logs, axis=1), TINY)
    if limits.along_axes:
        tilt = np.zeros(len(logs)) if tilt is None else tilt
        shares = np.minimum(shares, _share_along_axes(logs, tilt, limits))
    return np.where(shares > 1 - ROUNDING, 1.0, shares)


@lru_cache(maxsize=64)
def _interpolated_ends(limits: Range) -> Any:
    """Return the function of directions that interpolates `ends_of`."""
    from scipy.interpolate import Akima1DInterpolator

    return Akima1DInterpolator(DIRECTIONS, ends_of(limits))


def direction_of(e1: Any, e2: Any, e3: Any) -> Any:
    """Return the direction c of logarithmic stretches (see `DIRECTIONS`), arrays of NumPy (also complex) or of JAX."""
    return 3 * 6**0.5 * e1 * e2 * e3 / (e1 * e1 + e2 * e2 + e3 * e3 + TINY) ** 1.5


def direction_of_angle(angle: FloatArray) -> FloatArray:
    """Return the logarithmic stretches (n, 3) of unit Hencky strain at Lode angles (n,), zero in uniaxial tension."""
    return np.asarray(np.sqrt(2 / 3) * np.cos(angle[:, None] + 2 * np.pi / 3 * np.array([0, -1, 1])))


@dataclass(frozen=True)
class _Through(Path):
    """Deformations of given logarithmic stretches that change at given rates: its points are both, (n, 6)."""

    def moved(self, point: Any, step: Any) -> Deformation:
        stretches = exp(point[..., :3] + point[..., 3:6] * step)
        return Deformation.along_axes((stretches[..., 0], stretches[..., 1], stretches[..., 2]))

    def abscissa(self, points: Any) -> Any:
        return exp(points[..., 0])


@dataclass(frozen=True)
class _Tilted(_Through):
    """The same with principal axes 1 and 2 at given angles to those of the test, which change, too: points (n, 8)."""

    def moved(self, point: Any, step: Any) -> Deformation:
        stretches = super().moved(point, step).stretches
        (x, y), angle = (stretch**2 for stretch in stretches[:2]), 2 * (point[..., 6] + point[..., 7] * step)
        mean, half = 0.5 * (x + y), 0.5 * (x - y)
        return Deformation(stretches, (mean + half * cos(angle), mean - half * cos(angle), half * sin(angle)))


def through(logs: FloatArray, rates: FloatArray, tilt: tuple[FloatArray, FloatArray] | None = None) -> States:
    """Return states of logarithmic stretches (n, 3), the stress of each being the work on these rates (n, 3).

    Where principal axes are not those of the test, ``tilt`` is as `States.tilt`.
    """
    if tilt is None or not np.any(tilt):
        return _Through().at(np.hstack([logs, rates]))
    return _Tilted().at(np.hstack([logs, rates, np.stack(tilt, axis=1)]))


def drawn_back(states: States, share: FloatArray) -> States:
    """Return states at shares (n,) of the Hencky strain, which change at the same rates."""
    logs, rates = states.log_stretches
    return through(share[:, None] * logs, rates, states.tilt)


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays to states beyond a range.

    Attributes
    ----------
    ends : (g, 3) array
        Logarithmic stretches where the rays leave the range.
    logs : (g, 3) array
        Those of the states.
    tilt : (g,) array or float
        Angle of the first principal axis from axis 1 of the test.
    """

    ends: FloatArray
    logs: FloatArray
    tilt: FloatArray | float = 0.0

    @classmethod
    def leaving(cls, states: States, limits: Range) -> tuple[IndexArray, Rays, States]:
        """Return which states (g,) lie beyond a range, the rays to these, and all states drawn back to the range."""
        (logs, _), (tilt, _) = states.log_stretches, states.tilt
        share = share_to_end(logs, limits, tilt)
        (outside,) = np.nonzero(share < 1)
        rays = cls(share[outside, None] * logs[outside], logs[outside], tilt[outside])
        return outside, rays, drawn_back(states, share) if len(outside) else states

    @property
    def last_states(self) -> States:
        """States (2 g,) at the ends and farther in, the stress being the work on the Hencky strain along the rays."""
        last, tilt = np.concatenate([self.ends, INNER_SHARE * self.ends]), np.broadcast_to(self.tilt, len(self.ends))
        motion = np.tile(tilt, 2), np.zeros(len(last))
        return through(last, last / np.linalg.norm(last, axis=1, keepdims=True), motion)

    @property
    def end_rate(self) -> FloatArray:
        """How I1 (g,) changes at the ends with the Hencky strain along the rays."""
        return _rate(self.ends)

    @property
    def end_invariant(self) -> FloatArray:
        """I1 - 3 (g,) at the ends."""
        return _invariant(self.ends)

    @property
    def distance(self) -> FloatArray:
        """The logarithms (g,) of I1 - 3 at the ends over that farther in."""
        return np.asarray(np.log(self.end_invariant / _invariant(INNER_SHARE * self.ends)))

    def last_exponents(self, at_end: FloatArray, farther_in: FloatArray) -> FloatArray:
        """Return exponents (..., g) before the ends, from stresses there and farther in; 0 unless they are positive."""
        is_positive = (at_end > 0) & (farther_in > 0)
        ratio = np.where(is_positive, at_end, 1.0) / np.where(is_positive, farther_in, 1.0)
        exponent = np.log(ratio * _rate(INNER_SHARE * self.ends) / self.end_rate) / self.distance
        return np.where(is_positive, exponent, 0.0)

    @property
    def log_distance(self) -> FloatArray:
        """The logarithms (g,) of I1 - 3 at the states over that at the ends."""
        return np.asarray(np.log(_invariant(self.logs) / self.end_invariant))

    def growth(self, exponent: FloatArray, error: FloatArray) -> FloatArray:
        """Return the stress at the states over that at the ends (..., g), for exponents and their errors (..., g)."""
        return np.asarray(np.exp(log_growth(self.log_distance, exponent, error)) * _rate(self.logs) / self.end_rate)


def log_growth(log_distance: Any, exponent: Any, error: Any) -> Any:
    """Return ln(V / V_c), at distances s."""
    return log_distance * (exponent + error * log_distance / (log_distance + TRANSITION))


def with_errors(last: FloatArray, score: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return exponents and their errors beyond a range, from the last exponents within and the scores of the errors."""
    exponent = np.clip(last, MIN_EXPONENT, MAX_EXPONENT)
    erroneous = exponent + (MEDIAN_ERROR + ERROR_SCALE * score) * (1 + np.abs(exponent))
    return exponent, np.clip(erroneous, MIN_EXPONENT, MAX_EXPONENT) - exponent


def scores(probability: FloatArray) -> FloatArray:
    """Return quantiles of Student's t with two degrees of freedom, without its outermost tails."""
    p = TAIL_PROBABILITY + (1 - 2 * TAIL_PROBABILITY) * probability
    return np.asarray((2 * p - 1) / np.sqrt(2 * p * (1 - p)))


def _invariant(logs: FloatArray) -> FloatArray:
    """Return I1 - 3 (g,) of logarithmic stretches (g, 3)."""
    return np.asarray(np.expm1(2 * logs).sum(axis=1))


def _rate(logs: FloatArray) -> FloatArray:
    """Return how I1 (g,) changes with the Hencky strain along rays through logarithmic stretches (g, 3)."""
    return np.asarray((2 * logs * np.exp(2 * logs)).sum(axis=1) / np.linalg.norm(logs, axis=1))
