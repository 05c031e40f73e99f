"""A Gaussian-process discrepancy in stress whose size over the data is penalised (Gu & Wang 2018)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, Self

import numpy as np

from tissuq.discrepancy.conditioned import RangeProcess, nodes_over
from tissuq.discrepancy.kernels import squared_exponential
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.material import Material

__all__ = ["ScaledProcess"]


@dataclass(frozen=True)
class ScaledProcess(RangeProcess):
    """The squared exponential whose paths are weighted by exp(-lambda mean(M^2) / (2 c^2)), mean over the data's range.

    With points x_i and weights w_i of a rule for that mean, it is the process given M(x_i) + e_i = 0 with independent
    e_i of variance c^2 / (lambda w_i); for equal weights, K = R - R_x (R_xx + (m / lambda) I)^-1 R_x', the paper's
    discretised form. No direction of M keeps a root mean square of more than c / sqrt(lambda).

    Parameters
    ----------
    penalty : float
        lambda = penalty sqrt(n) for n measurements. Gu, Xie & Wang (arXiv:1807.03829) show that lambda proportional to
        sqrt(n) c / noise_sd finds the best-fitting material as n grows. The ratio of c to the noise is set to 10 here,
        where the authors' package RobustCalibration starts, so that lambda changes with neither.

    References
    ----------
    Gu & Wang (2018), Scaled Gaussian stochastic process for computer model calibration and prediction, SIAM/ASA Journal
    on Uncertainty Quantification 6, 1555-1583.
    """

    penalty: float = 10.0
    measurements: int = 0
    ends: tuple[float, float] | None = None

    name = "gp-scaled"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)), M weighted by exp(-5 sqrt(n) mean(M^2) / c^2)"
    source = "Gu & Wang 2018, with lambda = 10 sqrt(n)"
    is_best_fit = True
    caution = (
        "What is estimated is the material that best fits the stress over the range of the data, not the initial "
        "modulus: the discrepancy is kept small, whatever the material is. Do not read C10 as half the modulus of the "
        "tissue."
    )

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        ends = float(experiment.stretch.min()), float(experiment.stretch.max())
        return replace(self, measurements=len(experiment), ends=ends)

    def zeros(self, stretch: Any, length: Any) -> tuple[Any, Any]:
        assert self.ends is not None  # noqa: S101 (the caller has looked)
        nodes, weights = nodes_over(self.ends)
        root = np.sqrt(weights)
        among = root[:, None] * squared_exponential((nodes[:, None] - nodes) / length) * root
        cross = squared_exponential((stretch[:, None] - nodes) / length) * root
        return cross, among + np.eye(len(nodes)) / (self.penalty * sqrt(self.measurements))
