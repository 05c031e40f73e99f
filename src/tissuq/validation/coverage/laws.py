"""Stresses of true materials in any loading mode, by closed forms: independent of the materials that are fitted.

Every law has C10 = 1: the stress of a material with another C10 is so many times as large.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode
from tissuq.mechanics.invariants import invariant_rates, invariants

__all__ = [
    "Law",
    "arruda_boyce",
    "carroll",
    "coupled",
    "demiray",
    "exp_ln",
    "gent",
    "gent_gent",
    "hart_smith",
    "knowles",
    "lopez_pamies",
    "mooney_rivlin",
    "neo_hookean",
    "ogden",
    "recruitment",
    "veronda_westmann",
    "yeoh",
]

FloatArray = NDArray[np.float64]
Law = Callable[[LoadingMode, FloatArray], FloatArray]
"""The engineering stress (n,) at stretches (n,) in a loading mode, in units of C10."""
Derivatives = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""dW/dI1 and dW/dI2 as functions of I1 - 3 and I2 - 3; at the reference their sum is one."""

SERIES = 1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750
"""Coefficients of Arruda & Boyce's energy."""


def neo_hookean() -> Law:
    """I1 - 3."""
    return _of_invariants(lambda x, y: (np.ones_like(x), np.zeros_like(x)))


def mooney_rivlin(share: float) -> Law:
    """(1 - share) (I1 - 3) + share (I2 - 3)."""
    return _of_invariants(lambda x, y: ((1 - share) + 0 * x, share + 0 * x))


def yeoh(c2: float, c3: float) -> Law:
    """(I1 - 3) + second (I1 - 3)^2 + third (I1 - 3)^3."""
    return _of_invariants(lambda x, y: (1 + 2 * c2 * x + 3 * c3 * x**2, 0 * x))


def ogden(*terms: tuple[float, float]) -> Law:
    """Sum of 4 share / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3), for shares of C10 and exponents (Ogden 1972)."""

    def stress(mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        logs, rates = mode.at(stretch).log_stretches
        stresses = [4 * share / alpha * (np.exp(alpha * logs) * rates).sum(axis=1) for share, alpha in terms]
        return np.asarray(sum(stresses))

    return stress


def gent(limit: float) -> Law:
    """-limit log(1 - (I1 - 3) / limit) (Gent 1996)."""
    return _of_invariants(lambda x, y: (limit / (limit - x), 0 * x))


def demiray(rate: float) -> Law:
    """(exp(rate (I1 - 3)) - 1) / rate (Demiray 1972)."""
    return _of_invariants(lambda x, y: (np.exp(rate * x), 0 * x))


def knowles(exponent: float, b: float) -> Law:
    """((1 + b (I1 - 3) / exponent)^exponent - 1) / b (Knowles 1977)."""
    return _of_invariants(lambda x, y: ((1 + b / exponent * x) ** (exponent - 1), 0 * x))


def arruda_boyce(links: float) -> Law:
    """Five terms of the chain model with so many links (Arruda & Boyce 1993)."""

    def slope(x: FloatArray) -> FloatArray:
        terms = [k * c / links ** (k - 1) * (x + 3) ** (k - 1) for k, c in enumerate(SERIES, start=1)]
        return np.asarray(sum(terms))

    return _of_invariants(lambda x, y: (slope(x) / slope(np.zeros(1)), 0 * x))


def veronda_westmann(rate: float) -> Law:
    """2 (exp(rate (I1 - 3)) - 1) / rate - (I2 - 3) (Veronda & Westmann 1970)."""
    return _of_invariants(lambda x, y: (2 * np.exp(rate * x), -np.ones_like(x)))


def coupled(b: float) -> Law:
    """I1 - 3 + b (I1 - 3) (I2 - 3), an energy that does not separate."""
    return _of_invariants(lambda x, y: (1 + b * y, b * x))


def gent_gent(limit: float, share: float) -> Law:
    """Gent's law and 3 share log(I2 / 3) (Pucci & Saccomandi 2002)."""
    return _of_invariants(lambda x, y: ((1 - share) * limit / (limit - x), share * 3 / (y + 3)))


def carroll(share: float, root_share: float) -> Law:
    """I1, share of I1^4 and a root of I2 (Carroll 2011)."""
    return _of_invariants(
        lambda x, y: (1 - share - root_share + share * (1 + x / 3) ** 3, root_share * (1 + y / 3) ** -0.5)
    )


def exp_ln(rate: float, share: float) -> Law:
    """W1 = exp(rate (I1 - 3)) - share log(I1 - 2): softening before it stiffens (Khajehsaeid et al. 2013)."""
    return _of_invariants(lambda x, y: (np.exp(rate * x) - share * np.log1p(x), 0 * x))


def hart_smith(rate: float, share: float) -> Law:
    """W1 = (1 - share) exp(rate (I1 - 3)^2), and 3 share log(I2 / 3) (Hart-Smith 1966)."""
    return _of_invariants(lambda x, y: ((1 - share) * np.exp(rate * x**2), share * 3 / (y + 3)))


def lopez_pamies(exponent1: float, exponent2: float, share: float) -> Law:
    """Two powers of I1 (Lopez-Pamies 2010)."""
    return _of_invariants(
        lambda x, y: ((1 - share) * (1 + x / 3) ** (exponent1 - 1) + share * (1 + x / 3) ** (exponent2 - 1), 0 * x)
    )


def recruitment(gain: float, half_load: float) -> Law:
    """W1 = 1 + gain x / (x + place), x = I1 - 3: fibres that take up load one after another."""
    return _of_invariants(lambda x, y: (1 + gain * x / (x + half_load), 0 * x))


def _of_invariants(derivatives: Derivatives) -> Law:
    def stress(mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        states = mode.at(stretch)
        W1, W2 = derivatives(*invariants(states))
        rates = invariant_rates(states)
        return np.asarray(rates[0] * W1 + rates[1] * W2)

    return stress
