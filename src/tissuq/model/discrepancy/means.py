"""Discrepancies with a mean, polynomial or the stress of further energy terms, and an independent error about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import States
from tissuq.mechanics.laws.polynomial import C01, C20, C30, MooneyRivlin, Yeoh
from tissuq.mechanics.material import Material
from tissuq.mechanics.stress import stress_basis
from tissuq.model.discrepancy.discrepancy import Discrepancy
from tissuq.parameters.parameter import Parameter

S = Parameter.scale("S", "standard deviation of the discrepancy about its mean")
M = tuple(Parameter(f"m{degree}", f"coefficient of stretch^{degree}") for degree in range(3))


class IndependentError(Discrepancy):
    """Any mean plus an error of variance S^2, independent at every point (covariance S^2 I)."""

    def independent_variance(self, values: Mapping[str, Any]) -> Any:
        return values["S"] ** 2


@dataclass(frozen=True)
class Polynomial(IndependentError):
    """The mean m0 + m1 l + ... of some degree, in stress: it carries stress and stiffness at stretch 1.

    Each of several curves has coefficients of its own (m0_1, m0_2, in their order); S is shared.
    """

    degree: ClassVar[int]
    caution = "Its mean takes a share of the initial stiffness, so the material's modulus may be far off."

    def __post_init__(self) -> None:
        if self.curves == 1:
            return
        coefficients = [
            replace(
                parameter, symbol=f"{parameter.symbol}_{number}", description=f"{parameter.description}, curve {number}"
            )
            for number in range(1, self.curves + 1)
            for parameter in M[: self.degree + 1]
        ]
        object.__setattr__(self, "parameters", (*coefficients, S))

    def mean_basis(self, states: States) -> FloatArray:
        powers = np.vander(states.abscissa, self.degree + 1, increasing=True)
        of_curves = [powers * np.reshape(states.in_curve(curve), (-1, 1)) for curve in range(self.curves)]
        return np.hstack(of_curves) if self.curves > 1 else of_curves[0]


class Constant(Polynomial):
    """Mean m0 (eq. 20)."""

    name = "constant"
    degree = 0
    formula = "m0 + S e"
    source = "Zeraatpisheh et al. 2021, eq. 20"
    parameters = (*M[:1], S)


class Linear(Polynomial):
    """Mean m0 + m1 l (eq. 21). Differs from the source, which prints the sign of m1 reversed."""

    name = "linear"
    degree = 1
    formula = "m0 + m1 l + S e"
    source = "Zeraatpisheh et al. 2021, eq. 21"
    parameters = (*M[:2], S)


class Quadratic(Polynomial):
    """Mean m0 + m1 l + m2 l^2 (eq. 22)."""

    name = "quadratic"
    degree = 2
    formula = "m0 + m1 l + m2 l^2 + S e"
    source = "Zeraatpisheh et al. 2021, eq. 22"
    parameters = (*M, S)


class HyperelasticTerms(IndependentError):
    """The stress of those terms of a richer material that the fitted one may lack."""

    material: ClassVar[Material]
    terms: ClassVar[tuple[Parameter, ...]]
    is_energy = True

    def mean_basis(self, states: States) -> FloatArray:
        columns = [self.material.parameters.index(term) for term in self.terms]
        return stress_basis(self.material, states)[:, columns]

    def material_part(self, values: Mapping[str, float]) -> tuple[Material, tuple[float, ...]]:
        return self.material, tuple(values[p.symbol] if p in self.terms else 0.0 for p in self.material.parameters)


class MooneyRivlinTerm(HyperelasticTerms):
    """Mean stress of C01 (I2 - 3): 2 C01 (1 - l^-3) in uniaxial loading (eq. 23)."""

    name = "mooney-rivlin"
    material = MooneyRivlin()
    terms = (C01,)
    formula = "stress of C01 (I2 - 3), + S e"
    source = "Zeraatpisheh et al. 2021, eq. 23"
    parameters = (*terms, S)
    caution = "C01 adds to the initial stiffness: the shear modulus is 2 (C10 + C01), so do not read C10 alone as it."


class YeohTerms(HyperelasticTerms):
    """Mean stress of C20 (I1 - 3)^2 + C30 (I1 - 3)^3 (eq. 24, garbled in print; its factors are 4 and 6)."""

    name = "yeoh"
    material = Yeoh()
    terms = (C20, C30)
    formula = "stress of C20 (I1 - 3)^2 + C30 (I1 - 3)^3, + S e"
    source = "Zeraatpisheh et al. 2021, eq. 24"
    parameters = (*terms, S)
