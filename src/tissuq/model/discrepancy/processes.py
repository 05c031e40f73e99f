"""Gaussian-process discrepancies in stress: free, and given zeros at the reference state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from tissuq.errors import ModelError
from tissuq.experiments.experiment import Curve, Experiment
from tissuq.mechanics.material import Material
from tissuq.model.discrepancy.discrepancy import Discrepancy
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Uniform

__all__ = [
    "ConditionedProcess",
    "GaussianProcess",
    "PinnedProcess",
    "pinned_squared_exponential",
    "squared_exponential",
]

MAX_SERIES_EXPONENT = 40.0
"""Product of scores beyond which the first terms of the exponential's series are less than rounding."""
c = Parameter.scale("c", "standard deviation of the process")
psi = Parameter("psi", "correlation length", "stretch", (0.0, float("inf")), False, Uniform(0.02, 3.0))


def squared_exponential(score: Any) -> Any:
    """Return exp(-score^2 / 2)."""
    exponent = -0.5 * score**2
    return exponent.__array_namespace__().exp(exponent)


def pinned_squared_exponential(score: Any, score_prime: Any, derivatives: int) -> Any:
    """Return the squared exponential of scores, given that the process (and its derivative) are zero at zero.

    It is the product of both with zero, times exp(one other) without the first terms of its series, where that
    exponent is large, what is left out is less than rounding.
    """
    product = score * score_prime
    arrays = product.__array_namespace__()
    bounded = arrays.minimum(product, MAX_SERIES_EXPONENT)
    series = arrays.expm1(bounded) - (bounded if derivatives else 0.0)
    pinned = series * arrays.exp(-0.5 * (score**2 + score_prime**2))
    return arrays.where(product < MAX_SERIES_EXPONENT, pinned, squared_exponential(score - score_prime))


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

    def kernel(self, curve: int, at_rows: Any, at_columns: Any, values: Mapping[str, Any]) -> Any:
        return squared_exponential((at_rows[:, None] - at_columns[None, :]) / values["psi"])


class ConditionedProcess(Discrepancy):
    """Zero mean and covariance c^2 K, K the squared exponential (psi) given that something of the process is zero.

    ``c`` stays the standard deviation of the process before that; what is left of it is smaller, the more so the longer
    ``psi`` is.
    """

    parameters = (c, psi)
    shape_symbols = ("psi",)

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        return values["c"] ** 2

    def curves_of_one_stretch(self, experiment: Experiment) -> tuple[Curve, ...]:
        """Return the curves of an experiment, each of which must be one stress against one control.

        Raises
        ------
        ModelError
            When a test has several controls or stresses.
        """
        for curve in experiment.curves:
            if len(curve.mode.controls) > 1 or len(curve.mode.stresses) > 1:
                raise ModelError(
                    f"discrepancy '{self.name}' is defined over the range of one stretch, and mode '{curve.mode.name}' "
                    f"of experiment '{curve.name}' has several controls or stresses: choose another one, such as "
                    "'auto'."
                )
        return experiment.curves


@dataclass(frozen=True)
class PinnedProcess(ConditionedProcess):
    """The squared exponential given M(1) = 0 and M'(1) = 0: no stress and no stiffness at the reference.

    With s = (l - 1) / psi, K = exp(-(s^2 + s'^2) / 2) (exp(s s') - 1 - s s'). Where nothing is
    deformed at 0, as in shear, the conditions are at 0.
    """

    references: tuple[float, ...] = (1.0,)

    name = "gp-pinned"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)) given M(1) = M'(1) = 0"
    source = "a Gaussian process conditioned on the reference state"
    caution = (
        "The initial stiffness is the material's own, but the process is an error of the stress in one test, not an "
        "energy: it says nothing of other loading modes. Measured in campaigns, its intervals hold the initial modulus "
        "less often than they say (docs/rivals.md)."
    )

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        references = tuple(float(curve.mode.reference) for curve in self.curves_of_one_stretch(experiment))
        return replace(self, references=references, curves=len(references))

    def kernel(self, curve: int, at_rows: Any, at_columns: Any, values: Mapping[str, Any]) -> Any:
        rows, columns = ((abscissa - self.references[curve]) / values["psi"] for abscissa in (at_rows, at_columns))
        return pinned_squared_exponential(rows[:, None], columns[None, :], 1)

    def kernel_diagonal(self, curve: int, abscissa: Any, values: Mapping[str, Any]) -> Any:
        score = (abscissa - self.references[curve]) / values["psi"]
        return pinned_squared_exponential(score, score, 1)
