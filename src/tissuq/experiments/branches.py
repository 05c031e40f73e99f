"""Branches of a test: where it turns back, and which of its measurements are of unloading."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray

REVERSAL = 0.1
"""Share of the range of stretches by which a test must go back for a new branch to begin."""
FEWEST = 4
"""Measurements of the way there, and of that back, that make it unloading: rows may be in any order, and another test
may begin at rest."""


def turning_points(stretch: ArrayLike) -> list[int]:
    """Return the rows where the test turns back by a notable share of its range."""
    values = np.asarray(stretch, dtype=np.float64)
    reversal = REVERSAL * float(np.ptp(values))
    turns: list[int] = []
    low = high = direction = 0
    directions = np.sign(np.diff(values))
    turning = np.flatnonzero(directions[1:] != directions[:-1]) + 1  # between them nothing is highest or lowest
    for row in [*turning.tolist(), len(values) - 1]:
        value = values[row]
        high = row if value > values[high] else high
        low = row if value < values[low] else low
        rises, falls = bool(value - values[low] > reversal), bool(values[high] - value > reversal)
        if direction == 0:
            direction = rises - falls
        elif falls if direction > 0 else rises:
            turns.append(high if direction > 0 else low)
            direction, low, high = -direction, row, row
    return turns


def unloading(points: ArrayLike, reference: ArrayLike) -> BoolArray:
    """Return which measurements (n,) were made on the way back to rest, after a way there.

    None of a test with several controls, and of one that only ever goes on.

    Examples
    --------
    >>> unloading([1.0, 1.1, 1.2, 1.3, 1.2, 1.1, 1.05, 1.0], 1.0).tolist()
    [False, False, False, False, True, True, True, True]
    """
    values = np.asarray(points, dtype=np.float64)
    is_back = np.zeros(len(values), dtype=bool)
    if values.ndim > 1 or len(values) < 2 * FEWEST:
        return is_back
    bounds = [-1, *turning_points(values), len(values) - 1]
    for previous, start, stop in zip(bounds, bounds[1:], bounds[2:], strict=False):
        if start - previous >= FEWEST and stop - start >= FEWEST:
            rows = np.arange(start + 1, stop + 1)
            way = np.sign(values[stop] - values[start])
            goes_back = way * (values[rows] - float(np.asarray(reference))) <= 0
            is_back[rows] = goes_back & (goes_back.sum() >= FEWEST)
    return is_back
