"""Random strain energies without initial modulus: what an energy discrepancy is built of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.kernels import pinned_squared_exponential
from tissuq.experiments.modes import Path
from tissuq.mechanics.path import invariant_rates, invariants, log_stretches

__all__ = [
    "Coordinates",
    "EnergyBlock",
    "HenckyBlock",
    "LogBlock",
    "SecondInvariantBlock",
    "SplineBlock",
    "TaylorBlock",
    "ValanisLandelBlock",
    "ZeroModulusBlock",
]

FloatArray = NDArray[np.float64]

LARGEST_EXPONENT = 200.0
"""So far beyond the data that nothing is known there."""
GRID = 400
"""Points over the data's range among which the pivots of a process are chosen."""


class Coordinates(NamedTuple):
    """What belongs to I1 - 3, to I2 - 3 and to the logarithms of the stretches."""

    first: FloatArray
    second: FloatArray
    logarithm: FloatArray

    def nothing(self, terms: int) -> Coordinates:
        """Return zeros for so many terms at each of these coordinates."""
        return Coordinates(*(np.zeros((len(each), terms)) for each in self))


@dataclass(frozen=True)
class EnergyBlock(ABC):
    """A random strain energy dW = c sum_k u_k dW_k with independent standard normal weights u.

    Energy, stress and shear modulus of every dW_k vanish at the reference, so that the initial modulus stays the
    material's own. A block says what stress its terms have in any loading mode. Where it has a length scale, that
    is a multiple of the range of the data, with equal prior probability for each of ``lengths``.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    lengths: ClassVar[tuple[float, ...]] = (1.0,)

    @abstractmethod
    def reach(self, mode: Path, stretch: FloatArray) -> tuple[float, float]:
        """Return the range of the block's coordinate over stretches (n,); the reference, zero, is in it."""

    @abstractmethod
    def stress_features(self, mode: Path, stretch: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        """Return the engineering stresses (n, r) of the terms dW_k (c = 1) at stretches (n,).

        They are terms enough for stretches within the reach; `stress_variance` is that of all there are.
        """

    @abstractmethod
    def stress_variance(self, mode: Path, stretch: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        """Return the variance (n,) of the stress for c = 1."""

    @abstractmethod
    def count(self, reach: tuple[float, float], length: float) -> int:
        """Return the number r of the terms that serve the data."""

    @abstractmethod
    def slopes(self, at: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        """Return A'(x) (a, q), B'(y) (b, q) and w'(e) (c, q) of the terms dW_k = A(I1 - 3) + B(I2 - 3) + sum w(ln l_i).

        For c = 1, at x = I1 - 3 (a,), y = I2 - 3 (b,) and e = ln l (c,). Where these lie beyond the reach, the r terms
        that serve the data are followed by others, of which the data know nothing.
        """


class ZeroModulusBlock(EnergyBlock):
    """dW = c u ((I2 - 3) - (I1 - 3)): the Mooney-Rivlin term with its initial modulus taken out."""

    name = "zero-modulus"
    formula = "c u (I2 - I1)"

    def reach(self, mode: Path, stretch: FloatArray) -> tuple[float, float]:
        return 0.0, 1.0

    def stress_features(self, mode: Path, stretch: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        first, second = invariant_rates(mode, stretch)
        return (second - first)[:, None]

    def stress_variance(self, mode: Path, stretch: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        return self.stress_features(mode, stretch, reach, length)[:, 0] ** 2

    def count(self, reach: tuple[float, float], length: float) -> int:
        return 1

    def slopes(self, at: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        one = [np.ones((len(each), 1)) for each in at]
        return Coordinates(-one[0], one[1], 0 * one[2])


class ProcessBlock(EnergyBlock):
    """A block whose stress is sum_k q(z_k) v_k with a Gaussian process q of a coordinate z, zero at the reference.

    It is reduced to the r directions that matter within the reach, by pivoted Cholesky.
    """

    tolerance: ClassVar[float] = 1e-11
    """Variance, relative to the largest, that may be left out."""

    @abstractmethod
    def coordinates(self, mode: Path, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z and v, (n, m) each."""

    @abstractmethod
    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        """Return cov(q(z), q(z')) for c = 1; arrays broadcast."""

    def reach(self, mode: Path, stretch: FloatArray) -> tuple[float, float]:
        z, _ = self.coordinates(mode, stretch)
        return min(0.0, float(z.min())), max(0.0, float(z.max()))

    def stress_features(self, mode: Path, stretch: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        z, v = self.coordinates(mode, stretch)
        values = self.terms(z.ravel(), reach, length)
        return np.asarray(np.einsum("nmr,nm->nr", values.reshape(*z.shape, -1), v))

    def count(self, reach: tuple[float, float], length: float) -> int:
        return len(_pivots(self, reach, length * (reach[1] - reach[0]))[0])

    def terms(
        self, z: FloatArray, reach: tuple[float, float], length: float, wider: tuple[float, float] | None = None
    ) -> FloatArray:
        """Return the directions (n, q) of the process at coordinates (n,): those within a wider reach come last."""
        scale = length * (reach[1] - reach[0])
        pivots, triangle = _pivots(self, reach, scale, wider)
        return np.asarray(np.linalg.solve(triangle, self.covariance(pivots[:, None], z[None], scale)).T)

    def stress_variance(self, mode: Path, stretch: FloatArray, reach: tuple[float, float], length: float) -> FloatArray:
        z, v = self.coordinates(mode, stretch)
        with np.errstate(over="ignore"):
            covariance = self.covariance(z[:, :, None], z[:, None, :], length * (reach[1] - reach[0]))
        return np.asarray(np.einsum("nm,nmk,nk->n", v, covariance, v))


@lru_cache(maxsize=256)
def _pivots(
    block: ProcessBlock, reach: tuple[float, float], scale: float, wider: tuple[float, float] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return q pivots and the lower triangle (q, q) of their covariance's Cholesky decomposition.

    Those of the reach come first, where there is a wider one. Remembered, because every sum of which the block is a
    part asks for the same.
    """
    before, triangle = (np.zeros(0), np.zeros((0, 0))) if wider is None else _pivots(block, reach, scale)
    low, high = wider or reach
    grid = np.concatenate([before, low + (high - low) * 0.5 * (1 - np.cos(np.linspace(0, np.pi, GRID)))])
    columns = np.linalg.solve(triangle, block.covariance(before[:, None], grid[None], scale)).T
    variance = block.covariance(grid, grid, scale)
    remaining, least = variance - (columns**2).sum(axis=1), block.tolerance * variance.max()
    remaining[: len(before)] = 0.0
    chosen = list(range(len(before)))
    while (pivot := int(remaining.argmax())) not in chosen and remaining[pivot] > least:
        own = block.covariance(grid, grid[pivot], scale) - columns @ columns[pivot]
        columns = np.column_stack([columns, own / np.sqrt(remaining[pivot])])
        remaining = remaining - columns[:, -1] ** 2
        chosen.append(pivot)
    return grid[chosen], np.tril(columns[chosen])


class InvariantBlock(ProcessBlock):
    """dW(I1), with W1 = dW/dI1 a process in a coordinate of x = I1 - 3."""

    def coordinates(self, mode: Path, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, _ = invariants(mode, stretch)
        first, _ = invariant_rates(mode, stretch)
        return self.coordinate(np.maximum(x, 0.0))[:, None], first[:, None]

    def slopes(self, at: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        z = self.coordinate(at.first)
        values = self.terms(z, reach, length, _joined(reach, z))
        return at.nothing(values.shape[1])._replace(first=values)

    @abstractmethod
    def coordinate(self, x: FloatArray) -> FloatArray:
        """Return the coordinate of x = I1 - 3."""


class TaylorBlock(InvariantBlock):
    """W1 = c g(x), cov(g, g') = exp(x x' / L^2) - 1: independent normal Taylor coefficients, an infinite Yeoh."""

    name = "taylor"
    formula = "W1 = c g(x), cov g = exp(x x' / L^2) - 1, x = I1 - 3"
    lengths = (0.4, 0.8, 1.6, 3.2)

    def coordinate(self, x: FloatArray) -> FloatArray:
        return x

    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        return np.asarray(np.expm1(np.minimum(first * second / length**2, LARGEST_EXPONENT)))


class LogBlock(InvariantBlock):
    """W1 = c g(t), t = log(1 + x): a squared exponential conditioned on g(0) = 0; fast change near the reference."""

    name = "log"
    formula = "W1 = c g(log(1 + x)), cov g squared exponential given g(0) = 0, x = I1 - 3"
    lengths = (0.15, 0.36, 0.83, 2.0)

    def coordinate(self, x: FloatArray) -> FloatArray:
        return np.log1p(x)

    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        return np.asarray(pinned_squared_exponential(first / length, second / length, 0))


class SplineBlock(InvariantBlock):
    """W1 = c g(x / L): an integrated Wiener process with a random slope, pinned at g(0) = 0."""

    name = "spline"
    formula = "W1 = c g(x), g an integrated Wiener process with g(0) = 0, x = I1 - 3"
    tolerance = 1e-7

    def coordinate(self, x: FloatArray) -> FloatArray:
        return x

    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        one, other = first / length, second / length
        least = np.minimum(one, other)
        return np.asarray(one * other + least**3 + 1.5 * np.abs(one - other) * least**2)


class SecondInvariantBlock(ProcessBlock):
    """dW(I2), its initial modulus taken out by I1: W2 = c g(y), W1 = -c g(0) with independent Taylor coefficients of g.

    The zero-modulus Mooney-Rivlin term is its limit for a large length scale.
    """

    name = "second-invariant"
    formula = "W2 = c g(y), W1 = -c g(0), cov g = exp(y y' / L^2), y = I2 - 3"
    lengths = (0.7, 1.6, 3.7)

    def coordinates(self, mode: Path, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
        _, y = invariants(mode, stretch)
        first, second = invariant_rates(mode, stretch)
        return np.stack([np.maximum(y, 0.0), np.zeros_like(y)], axis=1), np.stack([second, -first], axis=1)

    def slopes(self, at: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        wider = _joined(reach, at.second)
        values, start = (self.terms(y, reach, length, wider) for y in (at.second, np.zeros(1)))
        nothing = at.nothing(values.shape[1])
        return nothing._replace(first=nothing.first - start, second=values)

    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        return np.asarray(np.exp(np.minimum(first * second / length**2, LARGEST_EXPONENT)))


class SeparableBlock(ProcessBlock):
    """dW = sum_k w(l_k) with l w'(l) = c q(ln l), where q(0) = q'(0) = 0."""

    def coordinates(self, mode: Path, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
        return log_stretches(mode, stretch)

    def slopes(self, at: Coordinates, reach: tuple[float, float], length: float) -> Coordinates:
        values = self.terms(at.logarithm, reach, length, _joined(reach, at.logarithm))
        return at.nothing(values.shape[1])._replace(logarithm=values)


class HenckyBlock(SeparableBlock):
    """q has independent normal Taylor coefficients in the logarithmic (Hencky) strain: an infinite Ogden."""

    name = "hencky"
    formula = "sum_k w(l_k), l w'(l) = c q(e), cov q = exp(e e' / L^2) - 1 - e e' / L^2, e = ln l"
    lengths = (0.3, 0.65, 1.4)

    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        exponent = np.minimum(first * second / length**2, LARGEST_EXPONENT)
        return np.asarray(np.where(np.abs(exponent) < 1e-3, _series(exponent), np.expm1(exponent) - exponent))


class ValanisLandelBlock(SeparableBlock):
    """q is a squared exponential conditioned on q(0) = q'(0) = 0."""

    name = "valanis-landel"
    formula = "sum_k w(l_k), l w'(l) = c q(ln l), cov q squared exponential given q(0) = q'(0) = 0"
    lengths = (0.2, 0.35, 0.6, 1.0, 1.7)

    def covariance(self, first: FloatArray, second: FloatArray, length: float) -> FloatArray:
        return np.asarray(pinned_squared_exponential(first / length, second / length, 1))


def _joined(reach: tuple[float, float], z: FloatArray) -> tuple[float, float]:
    """Return the range of a reach and of coordinates (n,) together."""
    return min(reach[0], float(z.min())), max(reach[1], float(z.max()))


def _series(exponent: FloatArray) -> FloatArray:
    """Return exp(x) - 1 - x for small x, with its digits."""
    return exponent**2 / 2 * (1 + exponent / 3 * (1 + exponent / 4))
