"""Random strain energies without initial modulus, of which energy discrepancies are composed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import States
from tissuq.mechanics.invariants import invariant_rates, invariants
from tissuq.mechanics.rays import Range, dispersed
from tissuq.model.discrepancy.processes import pinned_squared_exponential

MAX_EXPONENT = 200.0
"""Largest exponent of a kernel; it is reached only far beyond the data."""
SIGN_SHARE = 0.1
"""Strain along an axis over the largest one, to which tests in tension count for compression, and the reverse."""
TINY = 1e-8
"""Strain at which a process stands for its slope at the reference."""
LOG_CORRELATION = 4.0
"""Correlation length of a process in the logarithm of I1 - 3: it changes little between strains of one size."""
GRID_POINTS = 400
"""Number of points over the data's range among which the pivots of a process are chosen."""


class Coordinates(NamedTuple):
    """Values that belong to I1 - 3, to I2 - 3 and to the logarithms of the stretches."""

    invariant_1: FloatArray
    invariant_2: FloatArray
    logarithm: FloatArray

    def nothing(self, terms: int) -> Coordinates:
        """Return zeros for so many terms at each of these coordinates."""
        return Coordinates(*(np.zeros((len(values), terms)) for values in self))


@dataclass(frozen=True)
class EnergyBlock(ABC):
    """A random strain energy dW = c sum_k u_k dW_k with independent standard normal weights u.

    Energy, stress and shear modulus of every dW_k vanish at the reference (where there is a direction, the mean of the
    modulus over all directions), so that the initial modulus stays the material's own. A block says what stress its
    terms have in any loading mode. Where it has a length scale, that is a multiple of the range of the data, with equal
    prior probability for each of ``lengths``.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    lengths: ClassVar[tuple[float, ...]] = (1.0,)
    is_isotropic: ClassVar[bool] = True
    """Whether it is the same in all directions; only then has it `slopes`."""

    @abstractmethod
    def reach(self, states: States) -> tuple[float, float]:
        """Return the range of the block's coordinate over states (n,); the reference, zero, is in it."""

    @abstractmethod
    def limits(self, reach: tuple[float, float]) -> Range:
        """Return between which states the coordinate is within the reach."""

    @abstractmethod
    def stress_features(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        """Return the engineering stresses (n, r) of the terms dW_k (c = 1) at states (n,).

        They are terms enough for states within the reach; `stress_variance` is that of all there are.
        """

    @abstractmethod
    def stress_variance(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        """Return the variance (n,) of the stress for c = 1."""

    def slopes(self, coordinates: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        """Return A'(x) (a, r), B'(y) (b, r) and w'(e) (c, r) of the terms dW_k = A(I1 - 3) + B(I2 - 3) + sum w(ln l_i).

        For c = 1, at x = I1 - 3 (a,), y = I2 - 3 (b,) and e = ln l (c,).
        """
        raise NotImplementedError(f"the energy '{self.name}' is not one of the principal stretches alone")


class ZeroModulusBlock(EnergyBlock):
    """dW = c u ((I2 - 3) - (I1 - 3)): the Mooney-Rivlin term with its initial modulus taken out."""

    name = "zero-modulus"
    formula = "c u (I2 - I1)"

    def reach(self, states: States) -> tuple[float, float]:
        return 0.0, 1.0

    def limits(self, reach: tuple[float, float]) -> Range:
        return Range()

    def stress_features(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        rate_1, rate_2 = invariant_rates(states)
        return (rate_2 - rate_1)[:, None]

    def stress_variance(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        return self.stress_features(states, reach, length)[:, 0] ** 2

    def slopes(self, coordinates: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        ones = [np.ones((len(values), 1)) for values in coordinates]
        return Coordinates(-ones[0], ones[1], 0 * ones[2])


class ProcessBlock(EnergyBlock):
    """A block whose stress is sum_k q(z_k) v_k with a Gaussian process q of a coordinate z, zero at the reference.

    It is reduced to the r directions that matter within the reach, by pivoted Cholesky.
    """

    tolerance: ClassVar[float] = 1e-11
    """Largest truncated variance, relative to the largest one."""

    @abstractmethod
    def coordinates(self, states: States) -> tuple[FloatArray, FloatArray]:
        """Return z and v, (n, m) each."""

    @abstractmethod
    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        """Return cov(q(z), q(z')) for c = 1; arrays broadcast."""

    def reach(self, states: States) -> tuple[float, float]:
        z, _ = self.coordinates(states)
        return min(0.0, float(z.min())), max(0.0, float(z.max()))

    def stress_features(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        z, v = self.coordinates(states)
        values = self.terms(z.ravel(), reach, length)
        return np.asarray(np.einsum("nmr,nm->nr", values.reshape(*z.shape, -1), v))

    def terms(self, z: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        """Return the directions (n, r) of the process at coordinates (n,)."""
        scale = length * (reach[1] - reach[0])
        pivots, triangle = _pivots(self, reach, scale)
        return np.asarray(np.linalg.solve(triangle, self.covariance(pivots[:, None], z[None], scale)).T)

    def stress_variance(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        z, v = self.coordinates(states)
        with np.errstate(over="ignore"):
            covariance = self.covariance(z[:, :, None], z[:, None, :], length * (reach[1] - reach[0]))
        return np.asarray(np.einsum("nm,nmk,nk->n", v, covariance, v))


@lru_cache(maxsize=256)
def _pivots(block: ProcessBlock, reach: tuple[float, float], scale: float) -> tuple[FloatArray, FloatArray]:
    """Return r pivots and the lower triangle (r, r) of their covariance's Cholesky decomposition.

    Remembered, because every sum of which the block is a part asks for the same.
    """
    low, high = reach
    grid = low + (high - low) * 0.5 * (1 - np.cos(np.linspace(0, np.pi, GRID_POINTS)))
    variance = block.covariance(grid, grid, scale)
    remaining, smallest = variance.copy(), block.tolerance * variance.max()
    columns, indices = np.zeros((len(grid), 0)), list[int]()
    while (pivot := int(remaining.argmax())) not in indices and remaining[pivot] > smallest:
        column = block.covariance(grid, grid[pivot], scale) - columns @ columns[pivot]
        columns = np.column_stack([columns, column / np.sqrt(remaining[pivot])])
        remaining = remaining - columns[:, -1] ** 2
        indices.append(pivot)
    return grid[indices], np.tril(columns[indices])


class InvariantBlock(ProcessBlock):
    """dW(I1), with W1 = dW/dI1 a process in a coordinate of x = I1 - 3."""

    def coordinates(self, states: States) -> tuple[FloatArray, FloatArray]:
        (x, _), (rate_1, _) = invariants(states), invariant_rates(states)
        return self.coordinate(np.maximum(x, 0.0))[:, None], rate_1[:, None]

    def slopes(self, coordinates: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        z = self.coordinate(coordinates.invariant_1)
        values = self.terms(z, reach, length)
        return coordinates.nothing(values.shape[1])._replace(invariant_1=values)

    def limits(self, reach: tuple[float, float]) -> Range:
        return Range(invariant_1=reach[1])

    def coordinate(self, x: FloatArray) -> FloatArray:
        """Return the coordinate of x = I1 - 3; here itself."""
        return x


def _taylor(z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
    """Return the covariance of functions with independent normal Taylor coefficients, zero at zero."""
    return np.asarray(np.expm1(np.minimum(z * z_prime / length**2, MAX_EXPONENT)))


class TaylorBlock(InvariantBlock):
    """W1 = c g(x), cov(g, g') = exp(x x' / L^2) - 1: independent normal Taylor coefficients, an infinite Yeoh."""

    name = "taylor"
    formula = "W1 = c g(x), cov g = exp(x x' / L^2) - 1, x = I1 - 3"
    lengths = (1.4, 2.8)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        return _taylor(z, z_prime, length)


class LogBlock(InvariantBlock):
    """W1 = c g(t), t = log(1 + x): a squared exponential conditioned on g(0) = 0; fast change near the reference."""

    name = "log"
    formula = "W1 = c g(log(1 + x)), cov g squared exponential given g(0) = 0, x = I1 - 3"
    lengths = (0.15, 0.36, 0.83, 2.0)

    def limits(self, reach: tuple[float, float]) -> Range:
        return Range(invariant_1=float(np.expm1(reach[1])))

    def coordinate(self, x: FloatArray) -> FloatArray:
        return np.log1p(x)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        return np.asarray(pinned_squared_exponential(z / length, z_prime / length, 0))


class SmallStrainBlock(InvariantBlock):
    """W1 = c g(t), t = log(1 + x / L): what changes at small strains may be as large as what changes at large ones.

    A length of 0.004 is a sixteenth of the range of strain, from which the process changes with the logarithm of x.
    """

    name = "small-strain"
    formula = "W1 = c g(log(1 + x / L)), cov g squared exponential given g(0) = 0, x = I1 - 3"
    lengths = (0.001, 0.004, 0.016)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        score, score_prime = (np.log1p(x / length) / LOG_CORRELATION for x in (z, z_prime))
        return np.asarray(pinned_squared_exponential(score, score_prime, 0))


class SplineBlock(InvariantBlock):
    """W1 = c g(x / L): an integrated Wiener process with a random slope, pinned at g(0) = 0."""

    name = "spline"
    formula = "W1 = c g(x), g an integrated Wiener process with g(0) = 0, x = I1 - 3"
    tolerance = 1e-7

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        s, s_prime = z / length, z_prime / length
        smaller = np.minimum(s, s_prime)
        return np.asarray(s * s_prime + smaller**3 + 1.5 * np.abs(s - s_prime) * smaller**2)


class SecondInvariantBlock(ProcessBlock):
    """dW(I2), its initial modulus taken out by I1: W2 = c g(y), W1 = -c g(0) with independent Taylor coefficients of g.

    The zero-modulus Mooney-Rivlin term is its limit for a large length scale.
    """

    name = "second-invariant"
    formula = "W2 = c g(y), W1 = -c g(0), cov g = exp(y y' / L^2), y = I2 - 3"
    lengths = (0.7, 1.6, 3.7)

    def coordinates(self, states: States) -> tuple[FloatArray, FloatArray]:
        (_, y), (rate_1, rate_2) = invariants(states), invariant_rates(states)
        return np.stack([np.maximum(y, 0.0), np.zeros_like(y)], axis=1), np.stack([rate_2, -rate_1], axis=1)

    def limits(self, reach: tuple[float, float]) -> Range:
        return Range(invariant_2=reach[1])

    def slopes(self, coordinates: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        values, start = (self.terms(y, reach, length) for y in (coordinates.invariant_2, np.zeros(1)))
        nothing = coordinates.nothing(values.shape[1])
        return nothing._replace(invariant_1=nothing.invariant_1 - start, invariant_2=values)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        return np.asarray(np.exp(np.minimum(z * z_prime / length**2, MAX_EXPONENT)))


class SeparableBlock(ProcessBlock):
    """dW = sum_k w(l_k) with l w'(l) = c q(ln l), where q(0) = q'(0) = 0."""

    def coordinates(self, states: States) -> tuple[FloatArray, FloatArray]:
        return states.log_stretches

    def limits(self, reach: tuple[float, float]) -> Range:
        return Range(logarithms=reach)

    def slopes(self, coordinates: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        values = self.terms(coordinates.logarithm, reach, length)
        return coordinates.nothing(values.shape[1])._replace(logarithm=values)


class HenckyBlock(SeparableBlock):
    """q has independent normal Taylor coefficients in the logarithmic (Hencky) strain: an infinite Ogden."""

    name = "hencky"
    formula = "sum_k w(l_k), l w'(l) = c q(e), cov q = exp(e e' / L^2) - 1 - e e' / L^2, e = ln l"
    lengths = (0.3, 0.65, 1.4)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        exponent = np.minimum(z * z_prime / length**2, MAX_EXPONENT)
        series = exponent**2 / 2 * (1 + exponent / 3 * (1 + exponent / 4))  # keeps the digits of a small exponent
        return np.asarray(np.where(np.abs(exponent) < 1e-3, series, np.expm1(exponent) - exponent))


class ValanisLandelBlock(SeparableBlock):
    """q is a squared exponential conditioned on q(0) = q'(0) = 0."""

    name = "valanis-landel"
    formula = "sum_k w(l_k), l w'(l) = c q(ln l), cov q squared exponential given q(0) = q'(0) = 0"
    lengths = (0.2, 0.35, 0.6, 1.0, 1.7)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        return np.asarray(pinned_squared_exponential(z / length, z_prime / length, 1))


@dataclass(frozen=True)
class DirectionBlock(ProcessBlock):
    """Another energy of the strain along each axis of the test: a preferred direction, or two, in the plane of a sheet.

    With the strain z_i of a structure tensor about axis i (`tissuq.mechanics.rays.dispersed`), whose fibres have a
    dispersion between 0 (all along the axis) and 1/3 (in all directions alike), dW = G_1(z_1) + G_2(z_2) less its mean
    modulus, G_i' = c g_i(z_i) with independent processes g_i, g_i(0) = 0. Energy and stress vanish at the reference;
    the modulus does not, but its mean over all directions of the body: (4/15) (1 - 3 k)^2 G''(0) |e|^2 is that of
    G(z_1) over all rotations of a small strain e, and I1 - 3 = 2 |e|^2.

    References
    ----------
    Gasser, Ogden & Holzapfel (2006), Journal of the Royal Society Interface 3, 15-35.
    """

    dispersion: float = 0.0

    name = "direction"
    formula = "G1(z1) + G2(z2) less their mean modulus, G' = c g(z), cov g = exp(z z' / L^2) - 1"
    lengths = (0.3, 0.65, 1.4)
    is_isotropic = False

    def coordinates(self, states: States) -> tuple[FloatArray, FloatArray]:
        strains, rates = states.axis_strains
        (x, _), (rate_1, _) = invariants(states), invariant_rates(states)
        return dispersed(x, strains, self.dispersion), dispersed(rate_1, rates, self.dispersion)

    def covariance(self, z: FloatArray, z_prime: FloatArray, length: float) -> FloatArray:
        return _taylor(z, z_prime, length)

    def limits(self, reach: tuple[float, float]) -> Range:
        smallest = SIGN_SHARE * max(map(abs, reach))  # what one sign tells of the other
        return Range(along_axes=((self.dispersion, min(reach[0], -smallest), max(reach[1], smallest)),))

    def stress_features(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        (z, v), (isotropic, _) = self.coordinates(states), invariant_rates(states)
        initial_slope = self.terms(np.array([TINY]), reach, length)[0] / TINY
        mean = np.multiply.outer(isotropic, self._mean_modulus * initial_slope)
        return np.hstack([self.terms(z[:, axis], reach, length) * v[:, axis, None] - mean for axis in range(2)])

    def stress_variance(self, states: States, reach: tuple[float, float], length: float) -> FloatArray:
        (z, v), (isotropic, _) = self.coordinates(states), invariant_rates(states)
        scale, mean = length * (reach[1] - reach[0]), self._mean_modulus * isotropic[:, None]
        with np.errstate(over="ignore"):
            variances = v**2 * self.covariance(z, z, scale) + (mean**2 - 2 * mean * v * z) / scale**2
        return np.asarray(variances.sum(axis=1))

    @property
    def _mean_modulus(self) -> float:
        """That of G(z_1) over G''(0), as a multiple of I1 - 3."""
        return 2 / 15 * (1 - 3 * self.dispersion) ** 2
