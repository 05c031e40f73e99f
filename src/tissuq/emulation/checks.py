"""How far an emulator is off, where the model itself is known."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["EmulatorCheck"]

FloatArray = NDArray[np.float64]

INSIDE = 1.959963984540054
"""Standard deviations within which 95 % of normal errors lie."""
ROUNDING = 1e-9
"""Of the largest output: below it an error is rounding."""


@dataclass(frozen=True, eq=False)
class EmulatorCheck:
    """Runs of a model beside what the emulator says of them.

    Parameters
    ----------
    kind : str
        How the runs were kept from the emulator.
    points : (N, d) array
    computed, predicted : (N, n) array
        By the model, and by the emulator.
    covariance : (N, n, n) array
        Of the emulator's error.
    """

    kind: str
    points: FloatArray
    computed: FloatArray
    predicted: FloatArray
    covariance: FloatArray

    @cached_property
    def sd(self) -> FloatArray:
        """Standard deviations (N, n) of the emulator's error."""
        rounding = ROUNDING * np.abs(self.computed).max()
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2) + rounding**2))

    @property
    def standardised(self) -> FloatArray:
        """Errors (N, n) over their standard deviations: about standard normal."""
        return np.asarray((self.computed - self.predicted) / self.sd)

    @property
    def share_inside(self) -> float:
        """Share of the outputs within 1.96 standard deviations: about 0.95."""
        return float((np.abs(self.standardised) < INSIDE).mean())

    @property
    def rms_standardised(self) -> float:
        """Root mean square of the standardised errors: about one; more where the emulator is too sure."""
        return float(np.sqrt((self.standardised**2).mean()))

    @property
    def log_density(self) -> float:
        """Mean over the outputs of the log of their density, each by itself."""
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
