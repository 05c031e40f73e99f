"""A Gaussian-process discrepancy in stress that leaves the reference state alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from tissuq.discrepancy.conditioned import ConditionedProcess
from tissuq.discrepancy.kernels import pinned_squared_exponential
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.material import Material

__all__ = ["PinnedProcess"]


@dataclass(frozen=True)
class PinnedProcess(ConditionedProcess):
    """The squared exponential given M(1) = 0 and M'(1) = 0: no stress and no stiffness at the reference.

    With s = (l - 1) / psi, K = exp(-(s^2 + s'^2) / 2) (exp(s s') - 1 - s s'). Where nothing is
    deformed at 0, as in shear, the conditions are at 0.
    """

    reference: float = 1.0

    name = "gp-pinned"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)) given M(1) = M'(1) = 0"
    source = "a Gaussian process conditioned on the reference state"
    caution = (
        "The initial stiffness is the material's own, but the process is an error of the stress in one test, not an "
        "energy: it says nothing of other loading modes. Measured in campaigns, its intervals hold the initial modulus "
        "less often than they say (docs/rivals.md)."
    )

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        return replace(self, reference=float(experiment.mode.reference))

    def correlation(self, first: Any, second: Any, values: Mapping[str, Any]) -> Any:
        one, other = (first - self.reference) / values["psi"], (second - self.reference) / values["psi"]
        return pinned_squared_exponential(one[:, None], other[None, :], 1)

    def relative_variance(self, stretch: Any, values: Mapping[str, Any]) -> Any:
        score = (stretch - self.reference) / values["psi"]
        return pinned_squared_exponential(score, score, 1)
