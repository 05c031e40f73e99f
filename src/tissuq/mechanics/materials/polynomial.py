"""Rivlin polynomials: neo-Hookean, Mooney-Rivlin and Yeoh."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.material import Material
from tissuq.parameters import Parameter

__all__ = ["MooneyRivlin", "NeoHookean", "Yeoh"]

C10 = Parameter("C10", "half the initial shear modulus of the neo-Hookean term", support=(0.0, inf))
C01 = Parameter("C01", "coefficient of I2 - 3")
C20 = Parameter("C20", "coefficient of (I1 - 3)^2")
C30 = Parameter("C30", "coefficient of (I1 - 3)^3")


class NeoHookean(Material):
    """W = C10 (I1 - 3); initial shear modulus 2 C10 (Zeraatpisheh et al. 2021, eq. 6)."""

    name = "neo-hookean"
    formula = "C10 (I1 - 3)"
    source = "Treloar 1943"
    parameters = (C10,)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return values[0] * (I1 - 3)


class MooneyRivlin(Material):
    """W = C10 (I1 - 3) + C01 (I2 - 3); initial shear modulus 2 (C10 + C01), so C10 alone is not the modulus."""

    name = "mooney-rivlin"
    formula = "C10 (I1 - 3) + C01 (I2 - 3)"
    source = "Mooney 1940, Rivlin 1948"
    caution = "The initial shear modulus is 2 (C10 + C01), so do not read C10 alone as half of it."
    parameters = (C10, C01)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return values[0] * (I1 - 3) + values[1] * (I2 - 3)


class Yeoh(Material):
    """W = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3; initial shear modulus 2 C10."""

    name = "yeoh"
    formula = "C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3"
    source = "Yeoh 1993"
    parameters = (C10, C20, C30)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        x = I1 - 3
        return x * (values[0] + x * (values[1] + x * values[2]))
