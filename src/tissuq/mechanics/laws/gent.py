"""Gent's material, which locks at a finite stretch, and with a term in the second invariant (Gent-Gent)."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import LIMIT, log, log_left
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter

__all__ = ["Gent", "GentGent"]


class Gent(Material):
    """W = -mu Jm/2 ln(1 - (I1 - 3)/Jm); initial shear modulus mu.

    Written with E instead (Gent's paper), E = 3 mu. As Jm grows it becomes neo-Hookean with C10 = mu/2. It locks
    at I1 = 3 + Jm, in uniaxial tension at a stretch of about sqrt(3 + Jm).
    """

    name = "gent"
    formula = "-mu Jm/2 ln(1 - (I1 - 3)/Jm)"
    source = "Gent 1996"
    parameters = (Parameter("mu", "initial shear modulus of Gent's law", support=(0.0, inf)), LIMIT)

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
