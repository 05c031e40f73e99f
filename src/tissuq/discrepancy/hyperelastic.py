"""Discrepancies whose mean is the stress of further strain-energy terms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.polynomial import IndependentError, S
from tissuq.experiments.modes import Path
from tissuq.mechanics.material import Material
from tissuq.mechanics.materials.polynomial import C01, C20, C30, MooneyRivlin, Yeoh
from tissuq.mechanics.stress import stress_basis
from tissuq.parameters import Parameter

__all__ = ["MooneyRivlinTerm", "YeohTerms"]


class HyperelasticTerms(IndependentError):
    """The stress of those terms of a richer material that the fitted one may lack."""

    material: ClassVar[Material]
    terms: ClassVar[tuple[Parameter, ...]]
    is_energy = True

    def mean_basis(self, mode: Path, stretch: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = [self.material.parameters.index(term) for term in self.terms]
        return stress_basis(self.material, mode, stretch)[:, columns]

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
