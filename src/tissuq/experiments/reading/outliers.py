"""Outliers: single rows that lie far from where the rows before them, after them and on both sides put them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.load_cell import step_of
from tissuq.experiments.reading.table import Column

__all__ = ["find_outliers"]

FEWEST_ROWS, BLOCK = 12, 32
"""Rows that are needed, and rows over which the scatter is told."""
SCATTERS, LEAST = 7.0, 0.03
"""Standard deviations of the scatter, and share of the range, by which a row is off at least."""
STEPS = 1.5
"""Steps of the resolution by which it is."""
MOST_SHARE, FEW = 0.02, 3
"""Share of the rows, and number of them, up to which they are single ones, and not how these rows scatter."""


def find_outliers(values: Column) -> NDArray[np.intp]:
    """Return the rows whose value lies far off, on the same side of what three pairs of neighbours extrapolate to.

    A row at a sudden fall goes on from the rows before it, and one at a turning point from those on either side.
    """
    span = float(np.ptp(values))
    if len(values) < FEWEST_ROWS or not span:
        return np.array([], dtype=np.intp)
    before, after = 2 * values[1:-3] - values[:-4], 2 * values[3:-1] - values[4:]
    between = (values[1:-3] + values[3:-1]) / 2
    away = values[2:-2] - np.stack([before, after, between])
    is_off = np.abs(np.sign(away).sum(axis=0)) == len(away)
    least = max(LEAST * span, STEPS * (step_of(values) or 0.0))
    threshold = np.maximum(SCATTERS * _scatter(np.abs(away[2])), least)
    rows = np.flatnonzero(is_off & (np.abs(away).min(axis=0) > threshold)) + 2
    return rows if len(rows) <= max(FEW, MOST_SHARE * len(values)) else rows[:0]


def _scatter(away: Column) -> Column:
    """Return the standard deviation of a row, from how far rows nearby, and all rows, stray from their neighbours."""
    count = max(1, len(away) // BLOCK)
    medians = np.median(away[: len(away) // count * count].reshape(count, -1), axis=1)
    of_block = np.minimum(np.arange(len(away)) // (len(away) // count), count - 1)
    return np.asarray(1.4826 / np.sqrt(1.5) * np.maximum(medians[of_block], np.median(away)))
