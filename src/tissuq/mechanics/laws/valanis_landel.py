"""Sums of one function of each principal stretch (Valanis and Landel) that have no exponents."""

from __future__ import annotations

from math import inf
from typing import Any

from tissuq.mechanics.arithmetic import log
from tissuq.mechanics.material import StretchMaterial
from tissuq.parameters.parameter import Parameter

__all__ = ["Hencky", "PengLandel", "ValanisLandel"]


def _modulus(law: str) -> tuple[Parameter]:
    return (Parameter("mu", f"initial shear modulus of {law}", support=(0.0, inf)),)


class ValanisLandel(StretchMaterial):
    """W = 2 mu sum over k of (l_k ln(l_k) - l_k + 1), so that w'(l) = 2 mu ln(l); initial shear modulus mu."""

    name = "valanis-landel"
    formula = "2 mu sum over k of (l_k ln(l_k) - l_k + 1)"
    source = "Valanis & Landel 1967"
    parameters = _modulus("Valanis and Landel's law")

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return 2 * values[0] * sum(stretch * log(stretch) - stretch + 1 for stretch in stretches)


class PengLandel(StretchMaterial):
    """W = 3 mu sum over k of (l_k - 1 - e - e^2/6 + e^3/18 - e^4/216), e = ln(l_k); initial shear modulus mu.

    Written with E instead of 3 mu elsewhere.
    """

    name = "peng-landel"
    formula = "3 mu sum over k of (l_k - 1 - e - e^2/6 + e^3/18 - e^4/216), e = ln(l_k)"
    source = "Peng & Landel 1972"
    parameters = _modulus("Peng and Landel's law")

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        logs = [log(stretch) for stretch in stretches]
        return 3 * values[0] * (sum(stretches) - 3 - sum(e * (1 + e * (1 / 6 - e * (1 / 18 - e / 216))) for e in logs))


class Hencky(StretchMaterial):
    """W = mu (ln(l1)^2 + ln(l2)^2 + ln(l3)^2); initial shear modulus mu."""

    name = "hencky"
    formula = "mu (ln(l1)^2 + ln(l2)^2 + ln(l3)^2)"
    source = "Hencky 1931"
    parameters = _modulus("Hencky's law")

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        return values[0] * sum(log(stretch) ** 2 for stretch in stretches)
