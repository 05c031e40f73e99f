"""Ogden's sums of powers of the principal stretches, with one, two or three terms."""

from __future__ import annotations

from typing import Any

from tissuq.mechanics.material import StretchMaterial
from tissuq.parameters import Parameter
from tissuq.priors import Uniform

__all__ = ["Ogden1", "Ogden2", "Ogden3"]

LARGEST = 40.0
"""Reported for soft tissue: about 10 to 25 for skin and fat, about -20 for brain."""
SMALLEST = 0.5
"""An exponent of zero divides zero by zero."""

POSITIVE = (SMALLEST, LARGEST)
NEGATIVE = (-LARGEST, -SMALLEST)
SMALL, LARGE = (SMALLEST, 3.0), (3.0, LARGEST)

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

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        l1, l2, l3 = stretches
        terms = len(self.parameters) // 2
        return sum(
            2 * mu / alpha**2 * (l1**alpha + l2**alpha + l3**alpha - 3)
            for mu, alpha in zip(values[:terms], values[terms:], strict=True)
        )


class Ogden1(_Ogden):
    """W = 2 mu1/alpha1^2 (l1^alpha1 + l2^alpha1 + l3^alpha1 - 3); initial shear modulus mu1.

    Written mu/alpha (...) elsewhere, mu is 2 mu1/alpha1 (ANSYS, LS-DYNA); written c/m^2 (...), c is 2 mu1 (FEBio).
    alpha1 = 2 is neo-Hookean with mu1 = 2 C10.

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
