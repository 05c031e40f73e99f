"""Errors of an emulator at runs of the model itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["EmulatorCheck"]

FloatArray = NDArray[np.float64]

NORMAL_QUANTILE_975 = 1.959963984540054
"""Standard deviations within which 95 % of normal errors lie."""
ROUNDING_SHARE = 1e-9
"""Share of the largest output below which an error is rounding."""


@dataclass(frozen=True, eq=False)
class EmulatorCheck:
    """Runs of a model beside the emulator's predictions of them.

    Parameters
    ----------
    kind : str
        How the runs were withheld from the emulator.
    points : (N, d) array
    computed, predicted : (N, n) array
        Outputs of the model, and of the emulator.
    covariance : (N, n, n) array
        Covariance of the emulator's error.
    """

    kind: str
    points: FloatArray
    computed: FloatArray
    predicted: FloatArray
    covariance: FloatArray

    @cached_property
    def sd(self) -> FloatArray:
        """Standard deviations (N, n) of the emulator's error."""
        rounding = ROUNDING_SHARE * np.abs(self.computed).max()
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2) + rounding**2))

    @property
    def standardised(self) -> FloatArray:
        """Errors (N, n) over their standard deviations: about standard normal."""
        return np.asarray((self.computed - self.predicted) / self.sd)

    @property
    def share_inside(self) -> float:
        """Share of the outputs within 1.96 standard deviations: about 0.95."""
        return float((np.abs(self.standardised) < NORMAL_QUANTILE_975).mean())

    @property
    def rms_standardised(self) -> float:
        """Root mean square of the standardised errors: about one; more where the emulator is over-confident."""
        return float(np.sqrt((self.standardised**2).mean()))

    @property
    def log_density(self) -> float:
        """Mean over the outputs of the log of their marginal densities."""
        return float((-0.5 * self.standardised**2 - np.log(self.sd)).mean() - 0.5 * np.log(2 * np.pi))

    @property
    def relative_error(self) -> float:
        """Root mean square of the errors over that of the outputs."""
        return float(np.sqrt(((self.computed - self.predicted) ** 2).sum() / (self.computed**2).sum()))

    def __str__(self) -> str:
        return (
            f"{self.kind}: {len(self.points)} runs, relative error {self.relative_error:.2g} (root mean square), "
            f"{self.share_inside:.0%} of the outputs inside 95 %, standardised errors {self.rms_standardised:.2g} (1)"
        )
