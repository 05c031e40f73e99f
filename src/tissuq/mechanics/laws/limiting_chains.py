"""Laws of networks whose chains cannot be stretched without limit: Gent, van der Waals, eight chains, extended tube."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import expm1, library, log, log_left, sqrt
from tissuq.mechanics.material import Material, StretchMaterial
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import LogUniform, Uniform

LIMIT = Parameter(
    "Jm", "value of I1 - 3 at which the material locks", "limit", (0.0, inf), False, LogUniform(1.001, 100.0)
)
"""A specimen that was stretched so far has its limit beyond: the data set where its support begins."""


class Gent(Material):
    """W = -mu Jm/2 ln(1 - (I1 - 3)/Jm); initial shear modulus mu.

    Written with E instead (Gent's paper), E = 3 mu. As Jm grows it becomes neo-Hookean with C10 = mu/2. It locks
    at I1 = 3 + Jm, in uniaxial tension at a stretch of about sqrt(3 + Jm).
    """

    name = "gent"
    formula = "-mu Jm/2 ln(1 - (I1 - 3)/Jm)"
    source = "Gent 1996"
    parameters = (Parameter.shear_modulus("Gent's law"), LIMIT)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, limit = values
        return -0.5 * mu * limit * log_left((I1 - 3) / limit)


class GentGent(Material):
    """W = -mu1 Jm/2 ln(1 - (I1 - 3)/Jm) + 3 mu2/2 ln(I2/3); initial shear modulus mu1 + mu2.

    Written C1 and C2 elsewhere, for -C1 Jm ln(...) + C2 ln(I2/3), C1 = mu1/2 and C2 = 3 mu2/2.
    """

    name = "gent-gent"
    formula = "-mu1 Jm/2 ln(1 - (I1 - 3)/Jm) + 3 mu2/2 ln(I2/3)"
    source = "Gent 1999, Pucci & Saccomandi 2002"
    caution = "The initial shear modulus is mu1 + mu2, so do not read mu1 alone as it."
    parameters = (
        Parameter("mu1", "share of the locking term in the initial shear modulus", support=(0.0, inf)),
        Parameter("mu2", "share of the term in ln(I2) in the initial shear modulus"),
        LIMIT,
    )

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu1, mu2, limit = values
        return -0.5 * mu1 * limit * log_left((I1 - 3) / limit) + 1.5 * mu2 * log(I2 / 3)


SMALLEST = 1e-30
"""Where I1 - 3 is no more, its root has no derivative and is not needed."""
SERIES = 0.05
"""Of the relative extension, below which a series keeps the digits."""
TERMS = 13


class VanDerWaals(Material):
    """W = -mu Jm (ln(1 - h) + h) - 2/3 A ((I1 - 3)/2)^(3/2), h = sqrt((I1 - 3)/Jm); initial shear modulus mu.

    Written with lambda_m and a elsewhere (Kilian, Abaqus), Jm = lambda_m^2 - 3 and A = a mu; A is used here because the
    stress is proportional to it. Their mixed invariant (1 - beta) I1 + beta I2 is I1 here, beta = 0. As Jm grows at
    A = 0 it becomes neo-Hookean with C10 = mu/2.
    """

    name = "van-der-waals"
    formula = "-mu Jm (ln(1 - h) + h) - 2/3 A ((I1 - 3)/2)^(3/2), h = sqrt((I1 - 3)/Jm)"
    source = "Kilian 1981"
    caution = "A is a mu with the interaction parameter a of Kilian and Abaqus, and Jm is lambda_m^2 - 3; beta is zero."
    parameters = (
        Parameter.shear_modulus("the van der Waals network"),
        Parameter("A", "attraction: softening in proportion to sqrt(I1 - 3)", support=(0.0, inf)),
        LIMIT,
    )

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, attraction, limit = values
        x = I1 - 3
        arrays = library(x)
        root = sqrt(arrays.where(x.real > SMALLEST, x, SMALLEST))
        network = 0.5 * x * _stiffening(root / sqrt(limit))
        return mu * network - 2 / 3 * 0.5**1.5 * attraction * x * root


def _stiffening(h: Any) -> Any:
    """Return -2 (ln(1 - h) + h) / h^2, one at zero."""
    arrays = library(h)
    is_small = h.real < SERIES
    small, large = arrays.where(is_small, h, SERIES), arrays.where(is_small, SERIES, h)
    series = small * 0
    for power in range(TERMS, -1, -1):
        series = series * small + 2 / (power + 2)
    return arrays.where(is_small, series, -2 * (log_left(large) + large) / large**2)


class ArrudaBoyce(Material):
    """Eight chains of N = 1 + Jm/3 links each; initial shear modulus mu.

    W = 3 N mu (G(s) - G(1/N)) / (2 G'(1/N)), with s = I1/(3 N) the squared relative extension of a chain and
    G(s) = s - s^2/10 - 2 s^3/15 - 2 ln(1 - s), so that sqrt(s) G'(s) is Kröger's approximation of the inverse Langevin
    function, y (3 - (6 y^2 + y^4 - 2 y^6)/5) / (1 - y^2), right to 0.28 %.

    mu is the modulus at the reference. Arruda & Boyce give the chain density times k T instead, which they write C_R
    (mu in Abaqus, n k T elsewhere): mu = C_R G'(1/N) / 3, a little more than C_R. They write N,
    Abaqus lambda_m = sqrt(N). Abaqus, ANSYS and others cut a series for the inverse Langevin function after five terms,
    which does not lock; near the limit theirs is another law. As Jm grows it becomes neo-Hookean.
    """

    name = "arruda-boyce"
    formula = "3 N mu/(2 G'(1/N)) (G(I1/(3 N)) - G(1/N)), G(s) = s - s^2/10 - 2 s^3/15 - 2 ln(1 - s), N = 1 + Jm/3"
    source = "Arruda & Boyce 1993; inverse Langevin function after Kröger 2015"
    caution = (
        "mu is the modulus at the reference, not n k T; a chain has N = 1 + Jm/3 links. The inverse Langevin function "
        "is not the series of five terms of Abaqus and others, which does not lock."
    )
    parameters = (Parameter.shear_modulus("the eight-chain model"), LIMIT)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, limit = values
        links = 1 + limit / 3
        start, moved = 1 / links, (I1 - 3) / (3 * links)
        s = start + moved
        squares, cubes = moved * (s + start), moved * (s * s + s * start + start * start)
        slope = 1 - start / 5 - 0.4 * start**2 + 2 / (1 - start)
        gained = moved - squares / 10 - 2 / 15 * cubes - 2 * log_left((I1 - 3) / limit)
        return 1.5 * links * mu * gained / slope


class ExtendedTube(StretchMaterial):
    """W = Gc/2 ((1 - 1/Jm) x/(1 - x/Jm) + ln(1 - x/Jm)) + 2 Ge/beta^2 sum over k of (l_k^-beta - 1), x = I1 - 3.

    The initial shear modulus is Gc (1 - 2/Jm) + Ge. Kaliske & Heinrich write delta^2 for 1/Jm. At Jm = 2 the crosslinks
    would have no modulus at the reference and below it a negative one, so that Jm is more. Made for rubber: strains
    much smaller than that tell neither Gc nor Jm.
    """

    name = "extended-tube"
    formula = "Gc/2 ((1 - 1/Jm) x/(1 - x/Jm) + ln(1 - x/Jm)) + 2 Ge/beta^2 sum over k of (l_k^-beta - 1), x = I1 - 3"
    source = "Kaliske & Heinrich 1999"
    caution = "The initial shear modulus is Gc (1 - 2/Jm) + Ge; delta of the authors is 1/sqrt(Jm)."
    parameters = (
        Parameter("Gc", "modulus of the crosslinks", support=(0.0, inf)),
        Parameter("Ge", "modulus of the confinement", support=(0.0, inf)),
        Parameter(LIMIT.symbol, LIMIT.description, "limit", (2.0, inf), False, LIMIT.relative_prior),
        Parameter("beta", "release of the confinement", "number", (0.0, 1.0), False, Uniform(0.01, 1.0)),
    )

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        crosslinks, confinement, limit, beta = values
        x = sum(stretch * stretch for stretch in stretches) - 3
        chains = (1 - 1 / limit) * x / (1 - x / limit) + log_left(x / limit)
        tube = sum(expm1(-beta * log(stretch)) for stretch in stretches)
        return 0.5 * crosslinks * chains + 2 * confinement / beta**2 * tube
