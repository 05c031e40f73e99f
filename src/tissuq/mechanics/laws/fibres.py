"""Laws of collagen fibres: the standard reinforcing model, Holzapfel-Gasser-Ogden, and that with dispersion."""

from __future__ import annotations

from math import inf, pi
from typing import Any

from tissuq.mechanics.arithmetic import expm1, positive_part
from tissuq.mechanics.fibres import FibreMaterial
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import LogUniform, Uniform

__all__ = ["DispersedFibres", "ExponentialFibres", "StandardFibres"]


def _stiffness(symbol: str, law: str) -> Parameter:
    return Parameter(symbol, f"stiffness of {law} fibres", support=(0.0, inf))


def _rate(law: str) -> Parameter:
    description = f"how fast {law} fibres stiffen"
    return Parameter("k2", description, "rate", (0.0, inf), is_linear=False, relative_prior=LogUniform(0.01, 10.0))


def _angle(law: str) -> Parameter:
    description = f"angle of {law} fibres from axis 1, radians"
    return Parameter("phi", description, "number", (0.0, pi / 2), is_linear=False, relative_prior=Uniform(0.0, pi / 2))


CAUTION = (
    "Fibres have no stiffness at rest, so they are added to a matrix, whose initial shear modulus is that of the sum; "
    "in tension the stiffness is higher. Compressed fibres have neither stress nor energy. The two families lie at phi "
    "and -phi from axis 1, in radians (degrees in FEBio). One stress of one test hardly tells their angle from their "
    "stiffness: give the angle where it is known, as in exponential-fibres@30."
)


class StandardFibres(FibreMaterial):
    """W = k/2 sum over families of <I4 - 1>^2, the standard reinforcing model; <x> is x where positive, else 0.

    Where a family is stretched the tangent along it is 4 k more than that of the matrix. The sum with neo-Hooke is
    ``standard-reinforcing``. Differs from the sources, where fibres bear compression, too.
    """

    name = "standard-fibres"
    formula = "k/2 sum over families of <I4 - 1>^2"
    source = "Triantafyllidis & Abeyaratne 1983; Qiu & Pence 1997"
    caution = CAUTION
    parameters = (_stiffness("k", "quadratic"), _angle("quadratic"))

    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        return 0.5 * values[0] * positive_part(I4 - 1) ** 2


class ExponentialFibres(FibreMaterial):
    """W = k1/(2 k2) sum over families of (exp(k2 <I4 - 1>^2) - 1); <x> is x where positive, else 0.

    With neo-Hooke, C10 = c/2, it is the law of Holzapfel, Gasser and Ogden, ``holzapfel-gasser-ogden``. As k2 goes to
    zero it becomes `standard-fibres` with k = k1.
    """

    name = "exponential-fibres"
    formula = "k1/(2 k2) sum over families of (exp(k2 <I4 - 1>^2) - 1)"
    source = "Holzapfel, Gasser & Ogden 2000"
    caution = CAUTION
    parameters = (_stiffness("k1", "exponential"), _rate("exponential"), _angle("exponential"))

    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        k1, k2 = values
        return 0.5 * k1 / k2 * expm1(k2 * positive_part(I4 - 1) ** 2)


class DispersedFibres(FibreMaterial):
    """W = k1/(2 k2) sum over families of (exp(k2 <E>^2) - 1), E = kappa (I1 - 3) + (1 - 3 kappa) (I4 - 1).

    With neo-Hooke, C10 = c/2, it is the law of Gasser, Ogden and Holzapfel, ``gasser-ogden-holzapfel``. Without
    dispersion, kappa = 0, it is `exponential-fibres`; with kappa = 1/3 it is isotropic. Differs from the source, where
    fibres are off below I4 = 1 and the energy jumps there: here they are off where E is negative, as in Abaqus.
    """

    name = "dispersed-fibres"
    formula = "k1/(2 k2) sum over families of (exp(k2 <kappa (I1 - 3) + (1 - 3 kappa) (I4 - 1)>^2) - 1)"
    source = "Gasser, Ogden & Holzapfel 2006"
    caution = CAUTION
    parameters = (
        _stiffness("k1", "dispersed"),
        _rate("dispersed"),
        Parameter("kappa", "dispersion of the fibres", "number", (0.0, 1 / 3), False, Uniform(0.0, 1 / 3)),
        _angle("dispersed"),
    )

    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        k1, k2, kappa = values
        strain = kappa * (I1 - 3) + (1 - 3 * kappa) * (I4 - 1)
        return 0.5 * k1 / k2 * expm1(k2 * positive_part(strain) ** 2)
