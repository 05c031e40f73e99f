"""What a load cell, or a displacement, adds of its own: scatter, outliers, a largest load, a coarse step, and drift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.table import Column

__all__ = [
    "averaged",
    "find_drift",
    "find_outliers",
    "find_saturation",
    "scatter_of_neighbours",
    "staircase_of",
    "step_of",
]

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
SCATTERS, LEAST_JUMP = 7.0, 0.03
"""Standard deviations of the scatter, and share of the range, by which an outlier is off at least."""
STEPS = 1.5
"""Steps of the resolution by which it is."""
LARGEST_SHARE, SINGLE_ROWS = 0.02, 3
"""Share of the rows, and number of them, up to which outliers are single ones, and not how these rows scatter."""


def averaged(most_points: int, *columns: Column) -> tuple[NDArray[np.intp], list[Column]]:
    """Return the rows at which the points begin and the last one ends, and each column averaged to so many at most."""
    count = len(columns[0])
    ends = np.linspace(0, count, min(count, most_points) + 1).astype(np.intp)
    return ends, [np.add.reduceat(values, ends[:-1]) / np.diff(ends) for values in columns]


def scatter_of_neighbours(values: Column) -> float:
    """Return the standard deviation of a row, from how far rows stray from the middle of their neighbours.

    The median makes kinks and outliers harmless.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6) if len(values) > 2 else 0.0


def find_outliers(values: Column) -> NDArray[np.intp]:
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
    threshold = np.maximum(SCATTERS * _scatter(np.abs(away[2])), least_jump)
    rows = np.flatnonzero(is_off & (np.abs(away).min(axis=0) > threshold)) + 2
    return rows if len(rows) <= max(SINGLE_ROWS, LARGEST_SHARE * len(values)) else rows[:0]


def _scatter(away: Column) -> Column:
    """Return the standard deviation of a row, from how far rows nearby, and all rows, stray from their neighbours."""
    count = max(1, len(away) // BLOCK)
    medians = np.median(away[: len(away) // count * count].reshape(count, -1), axis=1)
    of_block = np.minimum(np.arange(len(away)) // (len(away) // count), count - 1)
    return np.asarray(1.4826 / np.sqrt(1.5) * np.maximum(medians[of_block], np.median(away)))


def find_saturation(load: Column) -> NDArray[np.intp]:
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
