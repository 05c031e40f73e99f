"""What disturbs an elastic test: rupture, slips and holds, and what a load cell or a displacement adds of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tissuq.arrays import IndexArray
from tissuq.experiments.reading.table import Column

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
"""Steps of the load, where they are coarse, by which it falls, or an outlier is off, at least; standard deviation of an
error that is even over one."""
SLIP_ADVANCE = 0.25
"""Share of the median step of the stretch by which it goes on in a slip at least."""
MOST_POINTS = 400
"""Points into which the rows are averaged at most."""

FEWEST_LEVELS, SATURATED_ROWS, TIMES_OTHERS = 8, 4, 3.0
"""Different loads; rows at the largest one, and times as many as at any other above half of it: it is saturated."""
EQUAL, WHOLE = 1e-7, 0.06
"""Share of the range by which numbers differ that are not equal, and part of a step by which multiples of it miss."""
EVEN = 0.9
"""Share of the rows that differ, and of steps that are the smallest, from which a curve is a line at even points."""
FEWEST_STEPS, SHARE_OF_MULTIPLES = 6, 0.98
"""Steps from which their size is told, and share of them that are whole multiples of the smallest."""
ROWS_A_STEP, CLIMB = 1.5, 0.2
"""Rows at one position on average, and share of the range of loads gone through at rest, where positions are coarse."""
RETURNED, TOE, HALF_WAY = 0.03, 0.1, 0.5
"""Shares of the range of stretches: within which a test is back where it began, over which its slope there is taken,
and by which it has been away."""
DRIFT, DRIFT_SCATTERS, END_ROWS, FEWEST_END_ROWS = 0.03, 4.5, 0.03, 4
"""Share of the largest load, and standard errors, of a drift; share of the rows at an end, or number."""
ROWS_OF_OUTLIER, BLOCK = 12, 32
"""Rows in which outliers show at least, and rows over which the scatter beside them is told."""
SCATTERS_OF_OUTLIER, LEAST_JUMP = 7.0, 0.03
"""Standard deviations of the scatter, and share of the range, by which an outlier is off at least."""
LARGEST_SHARE, SINGLE_ROWS = 0.02, 3
"""Share of the rows, and number of them, up to which outliers are single ones, and not how these rows scatter."""


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


def _lines(course: Column, load: Column, points: int, starts: IndexArray) -> _Lines:
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


def ends_of_rests(stretch: Column) -> IndexArray:
    """Return the last row of every rest: where a test stands still for longer than it takes to pass a level.

    Rows at a level are counted; their median over all levels is that of a test that passes on.
    """
    band, levels = STILL * float(np.ptp(stretch)), np.sort(stretch)

    def rows_at(level: Column) -> IndexArray:
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


def averaged(most_points: int, *columns: Column) -> tuple[IndexArray, list[Column]]:
    """Return the rows at which the points begin and the last one ends, and each column averaged to so many at most."""
    count = len(columns[0])
    ends = np.linspace(0, count, min(count, most_points) + 1).astype(np.intp)
    return ends, [np.add.reduceat(values, ends[:-1]) / np.diff(ends) for values in columns]


def scatter_of_neighbours(values: Column) -> float:
    """Return the standard deviation of a row, from how far rows stray from the middle of their neighbours.

    The median makes kinks and outliers harmless.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6) if len(values) > 2 else 0.0


def find_outliers(values: Column) -> IndexArray:
    """Return the rows whose value lies far off, on the same side of what three pairs of neighbours extrapolate to.

    A row at a sudden fall goes on from the rows before it, and one at a turning point from those on either side.
    """
    span = float(np.ptp(values))
    if len(values) < ROWS_OF_OUTLIER or not span:
        return np.array([], dtype=np.intp)
    extrapolated_forward, extrapolated_back = 2 * values[1:-3] - values[:-4], 2 * values[3:-1] - values[4:]
    between = (values[1:-3] + values[3:-1]) / 2
    away = values[2:-2] - np.stack([extrapolated_forward, extrapolated_back, between])
    is_off = np.abs(np.sign(away).sum(axis=0)) == len(away)
    least_jump = max(LEAST_JUMP * span, STEPS * (step_of(values) or 0.0))
    threshold = np.maximum(SCATTERS_OF_OUTLIER * _scatter(np.abs(away[2])), least_jump)
    rows = np.flatnonzero(is_off & (np.abs(away).min(axis=0) > threshold)) + 2
    return rows if len(rows) <= max(SINGLE_ROWS, LARGEST_SHARE * len(values)) else rows[:0]


def _scatter(away: Column) -> Column:
    """Return the standard deviation of a row, from how far rows nearby, and all rows, stray from their neighbours."""
    count = max(1, len(away) // BLOCK)
    medians = np.median(away[: len(away) // count * count].reshape(count, -1), axis=1)
    of_block = np.minimum(np.arange(len(away)) // (len(away) // count), count - 1)
    return np.asarray(1.4826 / np.sqrt(1.5) * np.maximum(medians[of_block], np.median(away)))


def find_saturation(load: Column) -> IndexArray:
    """Return the rows at exactly the largest load where they are many: it was the most that the load cell reads."""
    size = np.abs(load)
    values, counts = np.unique(size, return_counts=True)
    lower_counts = counts[:-1][values[:-1] > 0.5 * values[-1]]
    is_saturated = (
        len(values) >= FEWEST_LEVELS
        and counts[-1] >= SATURATED_ROWS
        and counts[-1] > TIMES_OTHERS * lower_counts.max(initial=1)
    )
    return np.flatnonzero(size == values[-1]) if is_saturated else np.array([], dtype=np.intp)


def step_of(values: Column) -> float | None:
    """Return the step of which all values are multiples, away from one of them; None where there is none."""
    levels = np.unique(values)
    steps = np.diff(levels)
    steps = steps[steps > EQUAL * np.ptp(levels)]
    if len(steps) < FEWEST_STEPS:
        return None
    multiples = steps / steps.min()
    is_whole = np.abs(multiples - np.rint(multiples)) < WHOLE
    if len(levels) > EVEN * len(values) and (np.rint(multiples) == 1).mean() > EVEN:  # even points, not rounded ones
        return None
    return float(steps.sum() / np.rint(multiples).sum()) if is_whole.mean() >= SHARE_OF_MULTIPLES else None


def staircase_of(position: Column, load: Column) -> float | None:
    """Return the step of a position that several rows share while the load goes on; None where it goes on, too."""
    step = step_of(position)
    if step is None or len(position) < ROWS_A_STEP * len(np.unique(position)):
        return None
    is_at_rest, change = np.diff(position) == 0, np.diff(load)
    return step if change[is_at_rest].sum() * np.sign(load[np.argmax(np.abs(load))]) > CLIMB * np.ptp(load) else None


def find_drift(course: Column, load: Column) -> tuple[float, float] | None:
    """Return the loads at the beginning and at the end of a test that goes back; None where they hardly differ.

    They are compared in rows near the first stretch, as far as the slope there does not make them differ.
    """
    count = max(FEWEST_END_ROWS, int(END_ROWS * len(course)))
    way, largest = (
        np.abs(course - course[0]) / max(float(np.ptp(course)), np.finfo(float).tiny),
        float(np.abs(load).max()),
    )
    near, far = np.flatnonzero(way <= RETURNED), np.flatnonzero(way > HALF_WAY)
    begin, end = near[near < count], near[near >= len(way) - count]
    if not len(far) or len(end) == 0 or end[0] < far[0] or not largest:
        return None
    rows = way <= TOE
    slope = abs(float(np.polyfit(way[rows], load[rows], 1)[0])) if len(np.unique(way[rows])) > 1 else 0.0
    error = scatter_of_neighbours(load) * np.hypot(len(begin) ** -0.5, len(end) ** -0.5)
    allowed = max(DRIFT * largest, DRIFT_SCATTERS * error) + slope * abs(way[begin].mean() - way[end].mean())
    load_at_begin, load_at_end = float(load[begin].mean()), float(load[end].mean())
    return (load_at_begin, load_at_end) if abs(load_at_end - load_at_begin) > allowed else None
