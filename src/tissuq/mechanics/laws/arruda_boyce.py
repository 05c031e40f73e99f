"""The eight-chain model of Arruda and Boyce."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import LIMIT, log_left
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter

__all__ = ["ArrudaBoyce"]


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
    parameters = (Parameter("mu", "initial shear modulus of the eight-chain model", support=(0.0, inf)), LIMIT)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        mu, limit = values
        links = 1 + limit / 3
        start, moved = 1 / links, (I1 - 3) / (3 * links)
        s = start + moved
        squares, cubes = moved * (s + start), moved * (s * s + s * start + start * start)
        slope = 1 - start / 5 - 0.4 * start**2 + 2 / (1 - start)
        gained = moved - squares / 10 - 2 / 15 * cubes - 2 * log_left((I1 - 3) / limit)
        return 1.5 * links * mu * gained / slope
