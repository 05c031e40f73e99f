"""The extended tube model: chains of finite length, confined by their neighbours."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import LIMIT, log_left
from tissuq.mechanics.material import StretchMaterial
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Uniform

__all__ = ["ExtendedTube"]


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
        tube = sum(stretch**-beta for stretch in stretches) - 3
        return 0.5 * crosslinks * chains + 2 * confinement / beta**2 * tube
