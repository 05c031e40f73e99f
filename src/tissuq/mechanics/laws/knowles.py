"""Knowles' power law."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import LogUniform

__all__ = ["Knowles"]


class Knowles(Material):
    """W = mu/(2 b) ((1 + b (I1 - 3)/n)^n - 1); initial shear modulus mu.

    n = 1 is neo-Hookean; larger n hardens, smaller n softens, and below 1/2 it loses ellipticity in shear. As n grows
    it becomes Demiray's exponential with the same b.
    """

    name = "knowles"
    formula = "mu/(2 b) ((1 + b (I1 - 3)/n)^n - 1)"
    source = "Knowles 1977"
    parameters = (
        Parameter("mu", "initial shear modulus of Knowles' law", support=(0.0, inf)),
        Parameter("b", "how fast Knowles' law changes", "rate", (0.0, inf), False, LogUniform(0.01, 20.0)),
        Parameter("n", "exponent: above one it hardens", "number", (0.0, inf), False, LogUniform(0.5, 10.0)),
    )

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, rate, exponent = values
        return 0.5 * mu / rate * ((1 + rate * (I1 - 3) / exponent) ** exponent - 1)
