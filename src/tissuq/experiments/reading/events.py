"""What disturbs an elastic test: rupture and slips, where the load falls on the way on, and holds, where it relaxes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.load_cell import averaged, scatter_of_neighbours
from tissuq.experiments.reading.table import Column

__all__ = ["Event", "ends_of_rests", "find_holds", "find_rupture", "find_slips"]

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
STILL, TIMES_PASSING, REST_ROWS = 4e-3, 3.0, 4
"""Share of the range of stretches by which a row at rest is off its level; times as many rows at a level as where the
test passes on, and rows at least, that make a rest."""
RESOLUTION = 1e-3
"""Share of the largest stress to which lines between points are right."""
SCATTERS = 4.0
"""Times the median step between rows by which the stress must fall in a hold."""
WINDOWS, GAPS = (3, 4, 6, 9, 14, 20), (1, 2, 3)
"""Points on either side of a slip from which lines are drawn up to it, and points that it takes."""
FEWEST_ROWS = 24
"""Rows in which a slip shows."""
SLIP, SLIP_SCATTERS, LOCAL = 0.015, 6.0, 0.5
"""Share of the largest stress, and standard errors, by which it falls in a slip; share of that in the slip itself."""
STEPS, UNIFORM_SD = 1.5, 12**-0.5
"""Steps of the load, where they are coarse, by which it falls at least; standard deviation of an error that is even
over one."""
SLIP_ADVANCE = 0.25
"""Share of the median step of the stretch by which it goes on in a slip at least."""
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
    least_fall = max(RUPTURE_FALL, SCATTERS_OF_RUPTURE * float(np.median(np.abs(np.diff(load)))))
    peaks = np.maximum.accumulate(load)
    at_peak = np.maximum.accumulate(np.where(load == peaks, np.arange(len(load)), 0))
    fall, way = peaks - load, course - reference
    advance = (way - way[at_peak]) * np.sign(way[at_peak])
    goes_on = (fall > least_fall) & (advance > FURTHER * span)
    earlier_load = np.concatenate([np.full(SUDDEN_ROWS, load[0]), load[:-SUDDEN_ROWS]])[: len(load)]
    sudden = max(SUDDEN_FALL, least_fall)
    is_sudden = (fall > sudden) & (earlier_load - load > sudden) & (advance > -FURTHER * span)
    for row in np.flatnonzero(goes_on | is_sudden).tolist():
        lasting = fall[row : row + LASTING_ROWS]
        if len(lasting) == LASTING_ROWS and (lasting > RUPTURE_FALL).all():
            return Event(int(ends[at_peak[row] + 1]), len(stretch), float(fall[row:].max()))
    return None


def find_slips(stretch: Column, stress: Column, step: float = 0.0) -> list[Event]:
    """Return where the stress falls suddenly, by how much it then lies below where it was going, on a loading branch.

    Lines through the points before and after are drawn up to the fall from both sides. At a kink, which is none, one of
    them lies beyond the points on the other side. Stresses are multiples of a step, where that is coarse.
    """
    if len(stretch) < FEWEST_ROWS or not np.abs(stress).max() > 0:
        return []
    step_of_load = step / float(np.abs(stress).max())
    ends, (course, load) = averaged(MOST_POINTS, stretch, stress / stress[np.argmax(np.abs(stress))])
    course = np.abs(course - course[0])
    count, advance_of_point = len(load), float(np.median(np.diff(course)))
    scatter = max(scatter_of_neighbours(load), RESOLUTION, UNIFORM_SD * step_of_load)
    least_drop = max(SLIP, STEPS * step_of_load)
    clarity, fall, width = np.zeros(count), np.zeros(count), np.ones(count, dtype=np.intp)
    for points in [points for points in WINDOWS if points <= max(WINDOWS[2], count // 10)]:
        for gap in GAPS:
            last = np.arange(points - 1, count - gap - points + 1)  # the last point before the fall
            following, advance = last + gap, course[last + gap] - course[last]
            middle = (course[last] + course[following]) / 2
            line, next_line = (_lines(course, load, points, starts) for starts in (last - points + 1, following))
            drop = line.at(middle) - next_line.at(middle)
            error = scatter * np.hypot(line.error(middle), next_line.error(middle))
            local = load[last] + np.minimum(line.slope, next_line.slope) * advance - load[following]
            is_no_kink = (next_line.mean < line.at(next_line.centre)) & (line.mean > next_line.at(line.centre))
            is_slip = (drop > least_drop) & (local > LOCAL * drop) & (load[following] < load[last]) & is_no_kink
            is_slip &= advance > SLIP_ADVANCE * gap * advance_of_point
            is_clearer = is_slip & (drop > error * np.maximum(clarity[last], SLIP_SCATTERS))
            clearer = last[is_clearer]
            clarity[clearer], fall[clearer], width[clearer] = (drop / error)[is_clearer], drop[is_clearer], gap
    slips = []
    while (peak := int(np.argmax(clarity))) and clarity[peak]:
        slips.append(Event(int(ends[peak + 1]), int(ends[peak + width[peak]]) + 1, float(fall[peak])))
        clarity[max(0, peak - WINDOWS[-1]) : peak + WINDOWS[-1] + 1] = 0.0
    return sorted(slips, key=lambda slip: slip.start)


class _Lines(NamedTuple):
    """Lines through points: where these lie in the mean, their slopes, and the size of the course that gives these."""

    centre: Column
    mean: Column
    slope: Column
    size: Column
    points: int

    def at(self, course: Column) -> Column:
        """Return their values."""
        return np.asarray(self.mean + self.slope * (course - self.centre))

    def error(self, course: Column) -> Column:
        """Return the standard errors of these, for noise of one."""
        return np.sqrt(1 / self.points + (course - self.centre) ** 2 / self.size)


def _lines(course: Column, load: Column, points: int, starts: NDArray[np.intp]) -> _Lines:
    """Return the lines through so many points each, from starts on."""
    windows = np.lib.stride_tricks.sliding_window_view
    ways, loads = windows(course, points)[starts], windows(load, points)[starts]
    centre, mean = ways.mean(axis=1), loads.mean(axis=1)
    away = ways - centre[:, None]
    size = np.maximum((away**2).sum(axis=1), np.finfo(float).tiny)
    return _Lines(centre, mean, (away * (loads - mean[:, None])).sum(axis=1) / size, size, points)


def find_holds(stretch: Column, stress: Column) -> list[Event]:
    """Return the rows in which the stretch rests while the size of the stress falls: relaxation."""
    ends, (course, load) = averaged(MOST_POINTS, stretch, np.abs(stress))
    count, load = len(course), load / max(float(load.max()), np.finfo(float).tiny)
    band, fewest = REST * float(np.ptp(course)), max(HOLD_ROWS, int(np.ceil(HOLD_SHARE * count)))
    holds, start = [], 0
    while start + fewest <= count:
        low, high = (np.asarray(limit.accumulate(course[start:])) for limit in (np.minimum, np.maximum))
        length = int(np.count_nonzero(high - low <= band))
        fall = _fall(course[start : start + length], load[start : start + length], band) if length >= fewest else 0.0
        if fall:
            holds.append(Event(int(ends[start]), int(ends[start + length]), fall))
        start += length if fall else 1
    return holds


def _fall(course: Column, load: Column, band: float) -> float:
    """Return by how much the load falls while the course rests; 0 where it does not clearly, or the course turns."""
    third = len(course) // 3
    outer = np.concatenate([course[:third], course[-third:]])
    if abs(course[third:-third].mean() - outer.mean()) > BEND * band:
        return 0.0
    fall = float(load[:2].mean() - load[-third:].mean())
    scatter = float(np.median(np.abs(np.diff(load[-third:])))) if third > 2 else 0.0
    return fall if fall > max(HOLD_FALL, SCATTERS * scatter) else 0.0


def ends_of_rests(stretch: Column) -> NDArray[np.intp]:
    """Return the last row of every rest: where a test stands still for longer than it takes to pass a level.

    Rows at a level are counted; their median over all levels is that of a test that passes on.
    """
    band, levels = STILL * float(np.ptp(stretch)), np.sort(stretch)

    def rows_at(level: Column) -> NDArray[np.intp]:
        return np.searchsorted(levels, level + band, "right") - np.searchsorted(levels, level - band, "left")

    passing = float(np.median(rows_at(np.linspace(levels[0], levels[-1], int(0.5 / STILL)))))
    at_rest = np.flatnonzero(rows_at(stretch) > max(REST_ROWS, TIMES_PASSING * passing))
    is_next = (np.diff(at_rest) == 1) & (np.abs(np.diff(stretch[at_rest])) <= 2 * band)
    ends = []
    for rest in np.split(at_rest, np.flatnonzero(~is_next) + 1):
        if len(rest) >= max(REST_ROWS, TIMES_PASSING * passing / 2):
            away = np.abs(stretch[rest] - np.median(stretch[rest]))
            ends.append(rest[away <= max(band / 2, float(np.median(away)))][-1])
    return np.array(ends, dtype=np.intp)
