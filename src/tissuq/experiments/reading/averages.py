"""Neighbouring rows: averaged to fewer points, so that long files take no longer, and how far they scatter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.table import Column

__all__ = ["averaged", "scatter_of_neighbours"]


def averaged(most: int, *columns: Column) -> tuple[NDArray[np.intp], list[Column]]:
    """Return the rows at which the points begin and the last one ends, and each column averaged to so many at most."""
    count = len(columns[0])
    ends = np.linspace(0, count, min(count, most) + 1).astype(np.intp)
    return ends, [np.add.reduceat(values, ends[:-1]) / np.diff(ends) for values in columns]


def scatter_of_neighbours(values: Column) -> float:
    """Return the standard deviation of a row, from how far rows stray from the middle of their neighbours.

    The median makes kinks and outliers harmless.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6) if len(values) > 2 else 0.0
