"""What a load cell, or a displacement, adds of its own: a largest load, a coarse step, and a zero that drifts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.averages import scatter_of_neighbours
from tissuq.experiments.reading.table import Column

__all__ = ["find_drift", "find_saturation", "staircase_of", "step_of"]

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


def find_saturation(load: Column) -> NDArray[np.intp]:
    """Return the rows at exactly the largest load where they are many: it was the most that the load cell reads."""
    size = np.abs(load)
    values, counts = np.unique(size, return_counts=True)
    others = counts[:-1][values[:-1] > 0.5 * values[-1]]
    is_saturated = (
        len(values) >= FEWEST_LEVELS
        and counts[-1] >= SATURATED_ROWS
        and counts[-1] > TIMES_OTHERS * others.max(initial=1)
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
    first, last = float(load[begin].mean()), float(load[end].mean())
    return (first, last) if abs(last - first) > allowed else None
