"""A Gaussian-process discrepancy in stress."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.discrepancy.kernels import squared_exponential
from tissuq.parameters import Parameter
from tissuq.priors import Uniform

__all__ = ["GaussianProcess", "c", "psi"]

c = Parameter.scale("c", "standard deviation of the process")
psi = Parameter("psi", "correlation length", "stretch", (0.0, float("inf")), False, Uniform(0.02, 3.0))


class GaussianProcess(Discrepancy):
    """Zero mean and covariance c^2 exp(-(l - l')^2 / (2 psi^2)) (eq. 25, 26).

    Differs from the source, which prints det for det^(1/2) and omits the noise variance in eq. 25.
    """

    name = "gp"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2))"
    source = "Zeraatpisheh et al. 2021, eq. 25 and 26"
    parameters = (c, psi)
    shape_symbols = ("psi",)
    caution = (
        "The process takes a share of the initial stiffness, and how much depends on the prior of its amplitude c."
    )

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        return values["c"] ** 2

    def correlation(self, first: Any, second: Any, values: Mapping[str, Any]) -> Any:
        return squared_exponential((first[:, None] - second[None, :]) / values["psi"])
