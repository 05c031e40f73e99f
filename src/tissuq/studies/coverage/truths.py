"""True materials of a campaign: random members of families, half of which the library cannot fit.

A family draws the parameters of a material with C10 = 1 from a random generator and returns the material as its
stress in any loading mode; the campaign scales it. Everything follows from the seed, so that every worker draws the
same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode
from tissuq.mechanics.path import invariant_rates, invariants, log_stretches

__all__ = ["FAMILIES", "Truth", "draw_truth"]

FloatArray = NDArray[np.float64]
Generator = np.random.Generator
Derivatives = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""dW/dI1 and dW/dI2 as functions of I1 - 3 and I2 - 3; together one half at the reference, times two C10."""

ARRUDA_BOYCE = 1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750
LEAST_LIMIT = 20.0
"""The smallest I1 - 3 at which a Gent material locks."""
C10_SPREAD = 0.5
"""Standard deviation of log C10 (MPa)."""


@dataclass(frozen=True, eq=False)
class Truth:
    """A material: its family, C10 (half its initial shear modulus, MPa), and its stress for C10 = 1."""

    family: str
    C10: float
    unit_stress: Callable[[LoadingMode, FloatArray], FloatArray]

    def stress(self, mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        """Return the engineering stress (n,), MPa."""
        return self.C10 * self.unit_stress(mode, stretch)


def draw_truth(family: str, seed: tuple[int, ...]) -> Truth:
    """Return the member of a family that a seed fixes."""
    generator = np.random.default_rng(seed)
    C10 = float(np.exp(C10_SPREAD * generator.standard_normal()))
    return Truth(family, C10, FAMILIES[family](generator))


def _of_invariants(derivatives: Derivatives) -> Callable[[LoadingMode, FloatArray], FloatArray]:
    def stress(mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        first, second = derivatives(*invariants(mode, stretch))
        rates = invariant_rates(mode, stretch)
        return np.asarray(rates[0] * first + rates[1] * second)

    return stress


def _of_powers(terms: list[tuple[float, float]]) -> Callable[[LoadingMode, FloatArray], FloatArray]:
    """Ogden's energy, sum of 4 share / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) for shares of C10 = 1."""

    def stress(mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        logs, rates = log_stretches(mode, stretch)
        parts = [4 * share / alpha * (np.exp(alpha * logs) * rates).sum(axis=1) for share, alpha in terms]
        return np.asarray(sum(parts))

    return stress


def _neo_hookean(generator: Generator) -> Callable[..., FloatArray]:
    return _of_invariants(lambda x, y: (np.ones_like(x), np.zeros_like(x)))


def _mooney_rivlin(generator: Generator) -> Callable[..., FloatArray]:
    share = generator.uniform(0, 1)
    return _of_invariants(lambda x, y: ((1 - share) + 0 * x, share + 0 * x))


def _yeoh(generator: Generator) -> Callable[..., FloatArray]:
    second, third = 0.05 * generator.standard_normal(), 0.005 * abs(generator.standard_normal())
    return _of_invariants(lambda x, y: (1 + 2 * second * x + 3 * third * x**2, 0 * x))


def _ogden(generator: Generator) -> Callable[..., FloatArray]:
    return _of_powers([(1.0, generator.uniform(1, 6))])


def _ogden_negative(generator: Generator) -> Callable[..., FloatArray]:
    return _of_powers([(1.0, -generator.uniform(1, 6))])


def _ogden_two(generator: Generator) -> Callable[..., FloatArray]:
    share = generator.uniform(0.2, 0.8)
    return _of_powers([(share, generator.uniform(1, 5)), (1 - share, -generator.uniform(1, 4))])


def _gent(generator: Generator) -> Callable[..., FloatArray]:
    limit = generator.uniform(LEAST_LIMIT, 60)
    return _of_invariants(lambda x, y: (limit / (limit - x), 0 * x))


def _demiray(generator: Generator) -> Callable[..., FloatArray]:
    rate = generator.uniform(0.02, 0.25)
    return _of_invariants(lambda x, y: (np.exp(rate * x), 0 * x))


def _knowles(generator: Generator) -> Callable[..., FloatArray]:
    exponent, b = generator.uniform(0.6, 1.6), generator.uniform(0.1, 1)
    return _of_invariants(lambda x, y: ((1 + b / exponent * x) ** (exponent - 1), 0 * x))


def _arruda_boyce(generator: Generator) -> Callable[..., FloatArray]:
    links = generator.uniform(8, 30)

    def slope(x: FloatArray) -> FloatArray:
        terms = [k * c / links ** (k - 1) * (x + 3) ** (k - 1) for k, c in enumerate(ARRUDA_BOYCE, start=1)]
        return np.asarray(sum(terms))

    return _of_invariants(lambda x, y: (slope(x) / slope(np.zeros(1)), 0 * x))


def _veronda_westmann(generator: Generator) -> Callable[..., FloatArray]:
    """Return the stress of C1 (exp(b (I1 - 3)) - 1) - C1 b / 2 (I2 - 3): half of its modulus is C1 b / 2."""
    rate = generator.uniform(0.02, 0.2)
    return _of_invariants(lambda x, y: (2 * np.exp(rate * x), -np.ones_like(x)))


def _coupled(generator: Generator) -> Callable[..., FloatArray]:
    """Return the stress of an energy with a term (I1 - 3) (I2 - 3), which does not separate."""
    b = 0.05 * abs(generator.standard_normal())
    return _of_invariants(lambda x, y: (1 + b * y, b * x))


FAMILIES: dict[str, Callable[[Generator], Callable[[LoadingMode, FloatArray], FloatArray]]] = {
    "neo-hookean": _neo_hookean,
    "mooney-rivlin": _mooney_rivlin,
    "yeoh": _yeoh,
    "ogden": _ogden,
    "ogden-negative": _ogden_negative,
    "ogden-two": _ogden_two,
    "gent": _gent,
    "demiray": _demiray,
    "knowles": _knowles,
    "arruda-boyce": _arruda_boyce,
    "veronda-westmann": _veronda_westmann,
    "coupled": _coupled,
}
"""Families by name: Gent 1996, Demiray 1972, Knowles 1977, Arruda & Boyce 1993, Veronda & Westmann 1970, Ogden 1972."""
