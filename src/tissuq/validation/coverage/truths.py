"""True materials of a campaign: closed forms of their stresses, random members of families, and fixed ones.

Every law has C10 = 1: the stress of a material with another C10 is so many times as large.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import LoadingMode
from tissuq.mechanics.invariants import invariant_rates, invariants

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


def hyperbolic_softening(loss: float, decay: float) -> Law:
    """W1 = 1 - loss x / (x + decay), x = I1 - 3: bonds that give way one after another."""
    return recruitment(-loss, decay)


def exponential_softening(loss: float, decay: float) -> Law:
    """W1 = 1 - loss (1 - exp(-x / decay)), x = I1 - 3."""
    return _of_invariants(lambda x, y: (1 + loss * np.expm1(-x / decay), 0 * x))


def power_softening(exponent: float, decay: float) -> Law:
    """W1 = (1 + x / decay)^-exponent, x = I1 - 3."""
    return _of_invariants(lambda x, y: ((1 + x / decay) ** -exponent, 0 * x))


def _of_invariants(derivatives: Derivatives) -> Law:
    def stress(mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        states = mode.at(stretch)
        W1, W2 = derivatives(*invariants(states))
        rates = invariant_rates(states)
        return np.asarray(rates[0] * W1 + rates[1] * W2)

    return stress


Generator = np.random.Generator

MIN_LOCKING_LIMIT = 20.0
"""The smallest I1 - 3 at which a Gent material locks."""


def _random_ogden_of_two_terms(generator: Generator) -> Law:
    share = generator.uniform(0.2, 0.8)
    return ogden((share, generator.uniform(1, 5)), (1 - share, -generator.uniform(1, 4)))


def _decay(generator: Generator) -> float:
    """Return I1 - 3 within which a material softens, from 0.02 (a strain of 8 %) to 2."""
    return float(np.exp(generator.uniform(*np.log([0.02, 2.0]))))


FAMILIES: dict[str, Callable[[Generator], Law]] = {
    "neo-hookean": lambda generator: neo_hookean(),
    "mooney-rivlin": lambda generator: mooney_rivlin(generator.uniform(0, 1)),
    "yeoh": lambda generator: yeoh(0.05 * generator.standard_normal(), 0.005 * abs(generator.standard_normal())),
    "ogden": lambda generator: ogden((1.0, generator.uniform(1, 6))),
    "ogden-negative": lambda generator: ogden((1.0, -generator.uniform(1, 6))),
    "ogden-two": _random_ogden_of_two_terms,
    "gent": lambda generator: gent(generator.uniform(MIN_LOCKING_LIMIT, 60)),
    "demiray": lambda generator: demiray(generator.uniform(0.02, 0.25)),
    "knowles": lambda generator: knowles(generator.uniform(0.6, 1.6), generator.uniform(0.1, 1)),
    "arruda-boyce": lambda generator: arruda_boyce(generator.uniform(8, 30)),
    "veronda-westmann": lambda generator: veronda_westmann(generator.uniform(0.02, 0.2)),
    "coupled": lambda generator: coupled(0.05 * abs(generator.standard_normal())),
}
"""Laws with random parameters, by name."""

FURTHER: dict[str, Callable[[Generator], Law]] = {
    "gent-gent": lambda generator: gent_gent(generator.uniform(MIN_LOCKING_LIMIT, 60), generator.uniform(0, 0.5)),
    "carroll": lambda generator: carroll(generator.uniform(0, 0.1), generator.uniform(0, 0.4)),
    "exp-ln": lambda generator: exp_ln(generator.uniform(0.02, 0.15), generator.uniform(0, 0.3)),
    "hart-smith": lambda generator: hart_smith(generator.uniform(5e-4, 5e-3), generator.uniform(0, 0.5)),
    "lopez-pamies": lambda generator: lopez_pamies(*generator.uniform([0.6, 1.5, 0.0], [1.2, 4.0, 0.3])),
}
"""Families on which no default was chosen."""

SMALL_STRAINS: dict[str, Callable[[Generator], Law]] = {
    "hyperbolic-softening": lambda generator: hyperbolic_softening(generator.uniform(0.2, 0.9), _decay(generator)),
    "exponential-softening": lambda generator: exponential_softening(generator.uniform(0.2, 0.9), _decay(generator)),
    "power-softening": lambda generator: power_softening(generator.uniform(0.1, 0.6), _decay(generator)),
    "recruitment": lambda generator: recruitment(generator.uniform(0.2, 2), generator.uniform(0.2, 2)),
}
"""Families whose modulus changes at small strains; the block for these and its odds were chosen on them."""

C10_SPREAD = 0.5
"""Standard deviation of log C10 (MPa), where no scale is given."""

FIXED: dict[str, tuple[float, Law]] = {
    "paper-yeoh": (1.2, yeoh(-0.057 / 1.2, 0.004 / 1.2)),
    "fixed-neo-hookean": (1.0, neo_hookean()),
    "fixed-mooney-rivlin": (1.0, mooney_rivlin(0.3)),
    "fixed-ogden": (1.0, ogden((1.0, 3.0))),
    "fixed-gent": (1.0, gent(30.0)),
    "fixed-demiray": (1.0, demiray(0.1)),
    "fixed-knowles": (1.0, knowles(0.75, 0.5)),
}
"""C10 (MPa) and law of materials of which there is one each; the first is that of Zeraatpisheh et al. (2021)."""

TRUTHS = (*FAMILIES, *FIXED, *FURTHER, *SMALL_STRAINS)
"""The names of all families and fixed materials."""


@dataclass(frozen=True, eq=False)
class Truth:
    """A material: C10 (half its initial shear modulus, MPa), and its law."""

    C10: float
    law: Law

    def stress(self, mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        """Return the engineering stress (n,), MPa."""
        return self.C10 * self.law(mode, stretch)

    def nearer(self, strength: float) -> Truth:
        """Return the material between the neo-Hookean one with the same C10 (strength zero) and this one (one)."""
        law, plain = self.law, neo_hookean()
        return Truth(self.C10, lambda mode, points: strength * law(mode, points) + (1 - strength) * plain(mode, points))


def draw_truth(name: str, seed: tuple[int, ...], scale: Sequence[float] = ()) -> Truth:
    """Return the member of a family that a seed fixes, or a fixed material.

    C10 of a random member is log-normal about 1 MPa, or log-uniform between the ends of a scale (MPa).
    """
    if name in FIXED:
        return Truth(*FIXED[name])
    generator = np.random.default_rng(seed)
    log_C10 = generator.uniform(*np.log(scale)) if scale else C10_SPREAD * generator.standard_normal()
    return Truth(float(np.exp(log_C10)), (FAMILIES | FURTHER | SMALL_STRAINS)[name](generator))
