"""Estimates of errors that an earlier fit of the same data gave, and that a model takes as if they were known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["FittedErrors"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FittedErrors:
    """Estimates of the errors of the tests that are plugged in, not integrated; `tissuq.fit` makes them.

    Attributes
    ----------
    curve : (n,) array, MPa, optional
        About what stress the measurements have without errors: errors of whole tests act along it.
    level : float, MPa, optional
        The standard deviation of all independent errors (noise and S), to which errors of whole tests are relative.
    lag : float, optional
        Correlation of the noise of consecutive measurements.
    spread : float, optional
        Relative standard deviation of the stress between specimens, where these are enough to estimate it.
    fits : int
        How many fits of the same data the estimates took.
    """

    curve: FloatArray | None = None
    level: float | None = None
    lag: float | None = None
    spread: float | None = None
    fits: int = 0

    @property
    def account(self) -> str:
        """What was estimated and what it cost, in words; empty where nothing was."""
        estimates = [
            "the mean curve along which whole tests err" * (self.curve is not None),
            f"the spread of {self.spread:.3g} between specimens" if self.spread is not None else "",
            f"the lag-1 correlation of {self.lag:.3g}" if self.lag is not None else "",
        ]
        named = " and ".join(filter(None, estimates))
        return f"{named} estimated by {self.fits} further fits and then taken as known" if named else ""
