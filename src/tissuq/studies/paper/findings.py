"""What one data set says about one formulation: the numbers on which the paper's claims rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tissuq.posterior import Posterior
from tissuq.prediction.bands import Band, predict_band

__all__ = ["Finding", "Findings", "find", "passes"]


@dataclass(frozen=True)
class Finding:
    """The posterior of C10 and the predictive checks of one formulation on one data set."""

    low: float
    high: float
    holds_truth: bool
    measurements: int
    inside: float
    inside_model_only: float
    band_width: float
    mean_shift: float
    """Largest distance of the predicted mean from that of no discrepancy, relative to the largest stress."""
    log_evidence: float | None

    @property
    def passes(self) -> bool:
        """Whether the data pass the predictive check with the discrepancy (eq. 27)."""
        return passes(self.inside, self.measurements)

    @property
    def passes_model_only(self) -> bool:
        """Whether the data pass the predictive check of the model alone (eq. 28)."""
        return passes(self.inside_model_only, self.measurements)


Findings = Mapping[str, Finding]
"""What one data set says about every formulation."""


def find(posterior: Posterior, truth: float, base: Band | None = None) -> Finding:
    """Return the finding of a posterior; ``base`` is the predictive band without discrepancy."""
    data = posterior.model.experiment
    low, high = posterior.solution.marginals["C10"].hdi()
    band = predict_band(posterior.solution, data.stretch)
    shift = np.abs(band.mean - base.mean).max() / np.abs(data.stress).max() if base else 0.0
    return Finding(
        low=low,
        high=high,
        holds_truth=low <= truth <= high,
        measurements=len(data),
        inside=posterior.predictive_coverage(),
        inside_model_only=posterior.predictive_coverage(discrepancy=False),
        band_width=float(np.mean(band.high - band.low)),
        mean_shift=float(shift),
        log_evidence=posterior.log_evidence,
    )


def passes(share: float, measurements: int, prob: float = 0.95) -> bool:
    """Return whether a share inside a 95 % band is what chance allows: not in the lowest 2.5 % of a binomial law."""
    from scipy.special import bdtr

    return bool(bdtr(round(share * measurements), measurements, prob) > 0.025)
