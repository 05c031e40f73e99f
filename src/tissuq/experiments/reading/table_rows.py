"""The rows of a table on their way to an experiment, and a sentence for every step that they took."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.table import Table

__all__ = ["Column", "Curve", "Dropped", "course"]

Column = NDArray[np.float64]


@dataclass(frozen=True)
class Dropped:
    """How many rows a step dropped, and why."""

    count: int
    reason: str


@dataclass(frozen=True, eq=False)
class Curve:
    """What is left of a table after some steps.

    Parameters
    ----------
    table : Table
        The remaining rows.
    rows : (n,) array of int
        Where they stand in the table of the file, counted from 0.
    stretch : (n,) array, dimensionless
    stress : (n,) array, MPa
    steps : tuple of str
        What was done so far.
    dropped : tuple of Dropped
    """

    table: Table
    rows: NDArray[np.intp]
    stretch: Column
    stress: Column
    steps: tuple[str, ...] = ()
    dropped: tuple[Dropped, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def told(self, sentence: str) -> Curve:
        """Return the curve with one more step told."""
        return replace(self, steps=(*self.steps, sentence))

    def kept(self, rows: NDArray[np.intp], reason: str) -> Curve:
        """Return the curve with only some of its rows, the others dropped for a reason."""
        if len(rows) == len(self):
            return self
        return replace(
            self,
            table=self.table.taken(rows),
            rows=self.rows[rows],
            stretch=self.stretch[rows],
            stress=self.stress[rows],
            dropped=(*self.dropped, Dropped(len(self) - len(rows), reason)),
        )


def course(curves: Sequence[Curve]) -> Column:
    """Return what tells how far a test has gone: its stretch, or the mean of the stretches of its axes."""
    return np.asarray(np.mean([curve.stretch for curve in curves], axis=0))
