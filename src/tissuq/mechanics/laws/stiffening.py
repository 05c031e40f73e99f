"""Laws that stiffen by an exponential or a power: Demiray, Fung, Veronda and Westmann, Knowles."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import expm1, power
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import LogUniform


def _rate(law: str, highest: float = 20.0) -> Parameter:
    prior = LogUniform(0.01, highest)
    return Parameter("b", f"how fast {law} stiffens", "rate", (0.0, inf), is_linear=False, relative_prior=prior)


class Demiray(Material):
    """W = mu/(2 b) (exp(b (I1 - 3)) - 1); initial shear modulus mu.

    Written beta/(2 alpha) (...) by Demiray, beta = mu and alpha = b. As b goes to zero it becomes neo-Hookean with
    C10 = mu/2.
    """

    name = "demiray"
    formula = "mu/(2 b) (exp(b (I1 - 3)) - 1)"
    source = "Demiray 1972"
    parameters = (Parameter.shear_modulus("Demiray's law"), _rate("Demiray's law"))

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, rate = values
        return 0.5 * mu / rate * expm1(rate * (I1 - 3))


class Fung(Material):
    """W = mu/b (exp(b tr(E^2)) - 1) with Green's strain E, tr(E^2) = (I1^2 - 2 I1 - 2 I2 + 3)/4; shear modulus mu.

    The isotropic, incompressible case of W = c/2 (exp(Q) - 1), Q a quadratic form in E: c = 2 mu/b and Q = b tr(E^2).
    """

    name = "fung"
    formula = "mu/b (exp(b tr(E^2)) - 1), tr(E^2) = (I1^2 - 2 I1 - 2 I2 + 3)/4"
    source = "Fung, Fronek & Patitucci 1979, isotropic"
    parameters = (Parameter.shear_modulus("Fung's law"), _rate("Fung's law", 10.0))

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, rate = values
        x, y = I1 - 3, I2 - 3
        return mu / rate * expm1(rate * (0.25 * x * x + x - 0.5 * y))


class VerondaWestmann(Material):
    """W = mu/b (exp(b (I1 - 3)) - 1) - mu/2 (I2 - 3); initial shear modulus mu.

    Written C1 (exp(C2 (I1 - 3)) - 1) - C1 C2/2 (I2 - 3) in FEBio, C2 = b and C1 = mu/b. With a free coefficient of
    I2 - 3 it is the sum of `demiray` and a polynomial, ``demiray+rivlin:C01``.
    """

    name = "veronda-westmann"
    formula = "mu/b (exp(b (I1 - 3)) - 1) - mu/2 (I2 - 3)"
    source = "Veronda & Westmann 1970"
    parameters = (Parameter.shear_modulus("Veronda and Westmann's law"), _rate("Veronda and Westmann's law"))

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, rate = values
        return mu * (expm1(rate * (I1 - 3)) / rate - 0.5 * (I2 - 3))


class Knowles(Material):
    """W = mu/(2 b) ((1 + b (I1 - 3)/n)^n - 1); initial shear modulus mu.

    n = 1 is neo-Hookean; larger n hardens, smaller n softens, and below 1/2 it loses ellipticity in shear. As n grows
    it becomes Demiray's exponential with the same b.
    """

    name = "knowles"
    formula = "mu/(2 b) ((1 + b (I1 - 3)/n)^n - 1)"
    source = "Knowles 1977"
    parameters = (
        Parameter.shear_modulus("Knowles' law"),
        Parameter("b", "how fast Knowles' law changes", "rate", (0.0, inf), False, LogUniform(0.01, 20.0)),
        Parameter("n", "exponent: above one it hardens", "number", (0.0, inf), False, LogUniform(0.5, 10.0)),
    )

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, rate, exponent = values
        return 0.5 * mu / rate * (power(1 + rate * (I1 - 3) / exponent, exponent) - 1)
