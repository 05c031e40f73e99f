"""Sums of one function of each principal stretch: Ogden's powers, and Valanis and Landel's laws without exponents."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from tissuq.errors import ModelError
from tissuq.mechanics.arithmetic import log, power
from tissuq.mechanics.material import Addends, StretchMaterial
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Uniform

LARGEST_EXPONENT = 40.0
"""Reported for soft tissue: about 10 to 25 for skin and fat, about -20 for brain."""
SMALLEST_EXPONENT = 0.5
"""An exponent of zero divides zero by zero."""

MAX_TERMS = 20
"""Far more than measurements tell apart."""

POSITIVE = (SMALLEST_EXPONENT, LARGEST_EXPONENT)
NEGATIVE = (-LARGEST_EXPONENT, -SMALLEST_EXPONENT)
SMALL, LARGE = (SMALLEST_EXPONENT, 3.0), (3.0, LARGEST_EXPONENT)

CAUTION = (
    "Here W has factors 2 mu/alpha^2 (as in Abaqus, FElupe), so the initial shear modulus is the sum of mu. Other "
    "programs mean other numbers by the same names: with factors mu/alpha (ANSYS, LS-DYNA) theirs is 2 mu/alpha; with "
    "c/m^2 (FEBio), m = alpha and c = 2 mu."
)


def _moduli_and_exponents(*ranges: tuple[float, float]) -> tuple[Parameter, ...]:
    terms = list(enumerate(ranges, start=1))
    moduli = [Parameter(f"mu{i}", f"share of term {i} in the initial shear modulus") for i, _ in terms]
    exponents = [
        Parameter(f"alpha{i}", f"exponent of term {i}", "number", is_linear=False, relative_prior=Uniform(*between))
        for i, between in terms
    ]
    return (*moduli, *exponents)


class _Ogden(StretchMaterial):
    """W = sum of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)."""

    source = "Ogden 1972"

    @property
    def addends(self) -> Addends:
        """Laws of one term each."""
        count = len(self.parameters) // 2
        return tuple((Ogden1(), [number, count + number]) for number in range(count))

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        l1, l2, l3 = stretches
        terms = len(self.parameters) // 2
        return sum(
            2 * mu / alpha**2 * (power(l1, alpha) + power(l2, alpha) + power(l3, alpha) - 3)
            for mu, alpha in zip(values[:terms], values[terms:], strict=True)
        )


class Ogden1(_Ogden):
    """W = 2 mu1/alpha1^2 (l1^alpha1 + l2^alpha1 + l3^alpha1 - 3); initial shear modulus mu1.

    Written mu/alpha (...) elsewhere, mu is 2 mu1/alpha1 (ANSYS, LS-DYNA); written c/m^2 (...), c is 2 mu1 (FEBio).
    alpha1 = 2 is neo-Hookean with mu1 = 2 C10. As alpha1 goes to zero, where the formula has no value, the law becomes
    Hencky's, with mu = mu1.

    The default prior of alpha1 is uniform from 0.5 to 40. Uniaxial tension alone can hardly tell an exponent a from
    about -2 a, which would be a second mode, so the sign is settled beforehand: for brain, say uniform(-40, -0.5).
    """

    name = "ogden-1"
    formula = "2 mu1/alpha1^2 (l1^alpha1 + l2^alpha1 + l3^alpha1 - 3)"
    parameters = _moduli_and_exponents(POSITIVE)
    caution = (
        f"{CAUTION} The default prior makes alpha1 positive; for a tissue that stiffens more in compression, such as "
        "brain, give alpha1 a uniform prior from -40 to -0.5."
    )


class Ogden2(_Ogden):
    """W = sum over i = 1, 2 of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3); modulus mu1 + mu2.

    Written mu/alpha (...) elsewhere, mu is 2 mu_i/alpha_i (ANSYS, LS-DYNA); written c/m^2 (...), c is 2 mu_i (FEBio).
    alpha = (2, -2) is Mooney-Rivlin with mu1 = 2 C10 and mu2 = 2 C01.

    By default alpha1 is uniform from 0.5 to 40 and alpha2 from -40 to -0.5: away from zero, and disjoint, so that
    exchanging the terms gives no second mode.
    """

    name = "ogden-2"
    formula = "sum over i = 1, 2 of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)"
    parameters = _moduli_and_exponents(POSITIVE, NEGATIVE)
    caution = CAUTION


class Ogden3(_Ogden):
    """W = sum over i = 1 to 3 of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3); modulus sum of mu_i.

    Written mu/alpha (...) elsewhere, mu is 2 mu_i/alpha_i (ANSYS, LS-DYNA); written c/m^2 (...), c is 2 mu_i (FEBio).

    By default alpha1 is uniform from 0.5 to 3, alpha2 from 3 to 40 and alpha3 from -40 to -0.5: away from zero, and
    disjoint, so that exchanging terms gives no second mode. Ogden's own values for rubber, (1.3, 5, -2), lie inside.
    """

    name = "ogden-3"
    formula = "sum over i = 1 to 3 of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3)"
    parameters = _moduli_and_exponents(SMALL, LARGE, NEGATIVE)
    caution = CAUTION


@dataclass(frozen=True)
class Ogden(_Ogden):
    """W = sum over i = 1 to some number of terms of 2 mu_i/alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3).

    The initial shear modulus is the sum of mu_i. By default the first half of the exponents (of an odd number one more)
    is positive, the others negative, in disjoint intervals of equal ratio between 0.5 and 40 in size.

    Parameters
    ----------
    terms : int
        How many, up to 20, or ``ogden-4`` by name. With up to three, `Ogden1`, `Ogden2` and `Ogden3` have the default
        priors of those names.

    Raises
    ------
    ModelError
        When there is no term, or more than can be told apart.
    """

    terms: int

    form = f"ogden-4 (up to {MAX_TERMS} terms)"
    caution = CAUTION

    def __post_init__(self) -> None:
        if not 1 <= self.terms <= MAX_TERMS:
            raise ModelError(f"an Ogden material has 1 to {MAX_TERMS} terms, not {self.terms}.")
        negative = [(-high, -low) for low, high in _intervals(self.terms // 2)]
        self._describe(
            name=f"ogden-{self.terms}",
            formula=Ogden3.formula.replace("1 to 3", f"1 to {self.terms}"),
            parameters=_moduli_and_exponents(*_intervals(self.terms - self.terms // 2), *negative),
        )

    @classmethod
    def named(cls, name: str) -> _Ogden | None:
        """Return the material of a name such as ``ogden-4``; None for other names, and for those with own classes."""
        match = re.fullmatch(r"ogden-(\d+)", name)
        return cls(int(match[1][:9])) if match and not 1 <= int(match[1][:9]) <= 3 else None


def _intervals(count: int) -> list[tuple[float, float]]:
    """Return intervals of equal ratio from the smallest to the largest exponent."""
    ratio = LARGEST_EXPONENT / SMALLEST_EXPONENT
    return list(pairwise(SMALLEST_EXPONENT * ratio ** (end / count) for end in range(count + 1))) if count else []


class ValanisLandel(StretchMaterial):
    """W = 2 mu sum over k of (l_k ln(l_k) - l_k + 1), so that w'(l) = 2 mu ln(l); initial shear modulus mu."""

    name = "valanis-landel"
    formula = "2 mu sum over k of (l_k ln(l_k) - l_k + 1)"
    source = "Valanis & Landel 1967"
    parameters = (Parameter.shear_modulus("Valanis and Landel's law"),)

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return 2 * values[0] * sum(stretch * log(stretch) - stretch + 1 for stretch in stretches)


class PengLandel(StretchMaterial):
    """W = 3 mu sum over k of (l_k - 1 - e - e^2/6 + e^3/18 - e^4/216), e = ln(l_k); initial shear modulus mu.

    Written with E instead of 3 mu elsewhere.
    """

    name = "peng-landel"
    formula = "3 mu sum over k of (l_k - 1 - e - e^2/6 + e^3/18 - e^4/216), e = ln(l_k)"
    source = "Peng & Landel 1972"
    parameters = (Parameter.shear_modulus("Peng and Landel's law"),)

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        logs = [log(stretch) for stretch in stretches]
        return 3 * values[0] * (sum(stretches) - 3 - sum(e * (1 + e * (1 / 6 - e * (1 / 18 - e / 216))) for e in logs))


class Hencky(StretchMaterial):
    """W = mu (ln(l1)^2 + ln(l2)^2 + ln(l3)^2); initial shear modulus mu."""

    name = "hencky"
    formula = "mu (ln(l1)^2 + ln(l2)^2 + ln(l3)^2)"
    source = "Hencky 1931"
    parameters = (Parameter.shear_modulus("Hencky's law"),)

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return values[0] * sum(log(stretch) ** 2 for stretch in stretches)
