"""What a linear model needs of its data: a triangle that measurements can be added to, whatever their number."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["CHUNK", "Statistics", "upper_triangle"]

FloatArray = NDArray[np.float64]

CHUNK = 16_384
"""Measurements taken in at once: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """The triangular factor R of the rows [X y]: all that a least-squares problem needs of n measurements.

    R'R is the matrix of their sums of squares and products, but R keeps the digits that squaring loses (Golub & Van
    Loan, Matrix Computations, 5.3). Statistics of two sets of measurements join into those of both.

    Attributes
    ----------
    count : int
        Number of measurements.
    triangle : (k + 1, k + 1) array
        R, the last column that of the stress.
    """

    count: int
    triangle: FloatArray

    @classmethod
    def of_rows(cls, blocks: Iterable[FloatArray]) -> Statistics:
        """Return the statistics of rows (m, k + 1), block by block."""
        total: Statistics | None = None
        for block in blocks:
            new = cls(len(block), upper_triangle(block))
            total = new if total is None else total.joined(new)
        if total is None:
            raise ValueError("no measurements")
        return total

    def joined(self, more: Statistics) -> Statistics:
        """Return the statistics of both sets of measurements."""
        return Statistics(self.count + more.count, upper_triangle(np.vstack([self.triangle, more.triangle])))


def upper_triangle(rows: FloatArray) -> FloatArray:
    """Return R of the QR factorisation, square even where there are few rows."""
    factor = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
    missing = rows.shape[1] - len(factor)
    return np.vstack([factor, np.zeros((missing, rows.shape[1]))]) if missing else factor
