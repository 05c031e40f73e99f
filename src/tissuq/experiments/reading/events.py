"""What ends an elastic test: rupture, where the load falls on the way on, and holds, where it relaxes at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tissuq.experiments.reading.averages import averaged
from tissuq.experiments.reading.table import Column

__all__ = ["Event", "find_holds", "find_rupture"]

RUPTURE_FALL, SUDDEN_FALL = 0.2, 0.5
"""Shares of the largest stress by which it falls at a rupture: while the test goes on, and within a few rows."""
SUDDEN_ROWS, LASTING_ROWS = 3, 2
"""Rows within which a fall is sudden, and for which it lasts at least, so that an outlier is none."""
SCATTERS_OF_RUPTURE = 8.0
"""Times the median step between points by which the stress must fall in a rupture."""
FURTHER = 0.01
"""Share of the range of stretches by which a test has gone on."""
REST, BEND = 0.01, 0.2
"""Share of the range of stretches within which a test rests, and share of that by which it may turn meanwhile."""
HOLD_FALL, HOLD_ROWS, HOLD_SHARE = 0.04, 8, 0.04
"""Share of the largest stress that is lost in a hold, and rows and share of all rows that it has at least."""
SCATTERS = 4.0
"""Times the median step between rows by which the stress must fall in a hold."""
MOST_POINTS = 400
"""Points into which the rows are averaged at most."""


@dataclass(frozen=True)
class Event:
    """Rows from ``start`` up to ``stop`` in which the stress falls, by a share of the largest."""

    start: int
    stop: int
    fall: float


def find_rupture(stretch: Column, stress: Column, reference: float = 1.0) -> Event | None:
    """Return from where on the load has fallen for good on a branch of loading; None where it has not.

    That is while the stretch goes further from that of the undeformed specimen, or suddenly while it does not go back.
    """
    if len(stretch) <= LASTING_ROWS or not np.abs(stress).max() > 0:
        return None
    ends, (course, load) = averaged(MOST_POINTS, stretch, stress)
    span, load = float(np.ptp(course)), load / load[np.argmax(np.abs(load))]
    least = max(RUPTURE_FALL, SCATTERS_OF_RUPTURE * float(np.median(np.abs(np.diff(load)))))
    peaks = np.maximum.accumulate(load)
    at_peak = np.maximum.accumulate(np.where(load == peaks, np.arange(len(load)), 0))
    fall, way = peaks - load, course - reference
    further = (way - way[at_peak]) * np.sign(way[at_peak])
    goes_on = (fall > least) & (further > FURTHER * span)
    before = np.concatenate([np.full(SUDDEN_ROWS, load[0]), load[:-SUDDEN_ROWS]])[: len(load)]
    sudden = max(SUDDEN_FALL, least)
    is_sudden = (fall > sudden) & (before - load > sudden) & (further > -FURTHER * span)
    for row in np.flatnonzero(goes_on | is_sudden).tolist():
        lasting = fall[row : row + LASTING_ROWS]
        if len(lasting) == LASTING_ROWS and (lasting > RUPTURE_FALL).all():
            return Event(int(ends[at_peak[row] + 1]), len(stretch), float(fall[row:].max()))
    return None


def find_holds(stretch: Column, stress: Column) -> list[Event]:
    """Return the rows in which the stretch rests while the size of the stress falls: relaxation."""
    ends, (course, load) = averaged(MOST_POINTS, stretch, np.abs(stress))
    count, load = len(course), load / max(float(load.max()), np.finfo(float).tiny)
    rest, least = REST * float(np.ptp(course)), max(HOLD_ROWS, int(np.ceil(HOLD_SHARE * count)))
    holds, start = [], 0
    while start + least <= count:
        low, high = (np.asarray(limit.accumulate(course[start:])) for limit in (np.minimum, np.maximum))
        length = int(np.count_nonzero(high - low <= rest))
        fall = _fall(course[start : start + length], load[start : start + length], rest) if length >= least else 0.0
        if fall:
            holds.append(Event(int(ends[start]), int(ends[start + length]), fall))
        start += length if fall else 1
    return holds


def _fall(course: Column, load: Column, rest: float) -> float:
    """Return by how much the load falls while the course rests; 0 where it does not clearly, or the course turns."""
    third = len(course) // 3
    outer = np.concatenate([course[:third], course[-third:]])
    if abs(course[third:-third].mean() - outer.mean()) > BEND * rest:
        return 0.0
    fall = float(load[:2].mean() - load[-third:].mean())
    scatter = float(np.median(np.abs(np.diff(load[-third:])))) if third > 2 else 0.0
    return fall if fall > max(HOLD_FALL, SCATTERS * scatter) else 0.0
