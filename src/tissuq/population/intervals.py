"""Median and shortest interval of draws, as tables of a population have them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["INTERVAL_COLUMNS", "interval"]

FloatArray = NDArray[np.float64]

INTERVAL_COLUMNS = ["median", "hdi_low", "hdi_high"]


def interval(draws: FloatArray, prob: float) -> tuple[float, float, float]:
    """Return the median of draws and the ends of the shortest interval that holds a share of them."""
    values = np.sort(draws, axis=None)
    count = round(prob * len(values))
    start = int((values[count:] - values[: len(values) - count]).argmin())
    return float(np.median(values)), float(values[start]), float(values[start + count])
