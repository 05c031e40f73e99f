"""Kilian's van der Waals law of a network that attracts itself."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import LIMIT, library, log_left, sqrt
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter

__all__ = ["VanDerWaals"]

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
        Parameter("mu", "initial shear modulus of the van der Waals network", support=(0.0, inf)),
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
