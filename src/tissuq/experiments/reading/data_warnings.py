"""What is strange about measurements that can be read: each check is a function that returns a sentence or nothing."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain

import numpy as np

from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.modes.mode import STRETCH
from tissuq.experiments.reading.cycles import find_cycles
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.headings import ROLES, heading, on_axis
from tissuq.experiments.reading.measured_rows import labelled
from tissuq.experiments.reading.units import stress_unit

__all__ = ["data_warnings"]

MANY_ROWS = 10_000
"""Rows from which thinning is worth a word."""
MIN_ROWS_PER_CYCLE = 10
"""Number of rows that a cycle has on average where cycles are meant, and not a table in any order."""
NOTABLE_SHARE = 0.05
"""Share of the largest stress, or of the range of stretches, that is worth a word."""
PLAUSIBLE_STRESS = (1e-6, 1e3)
"""Largest stresses, MPa, between which units are hardly mistaken."""
LARGE_STRETCH = 10.0
"""Stretch beyond which lengths are likely mistaken."""
SLACK_STRESS, SLACK_STRETCH = 0.01, 0.2
"""Share of the largest stress that a slack specimen stays below, over what share of the range of stretches."""


def data_warnings(reading: Reading) -> tuple[str, ...]:
    """Return what a person should look at before a fit, of each stress."""
    labels = reading.used.labels
    texts = (labelled(labels, [check(reading, number) for number in range(len(labels))]) for check in CHECKS)
    return (*reading.warnings, *filter(None, chain.from_iterable(texts)))


def _unit_assumed(reading: Reading, number: int) -> str:
    if "the file states no unit" not in reading.experiment.source:
        return ""
    return "the file states no unit of stress, so MPa was assumed; if it is another, give --stress-unit."


def _size(reading: Reading, number: int) -> str:
    largest, low, high = float(np.abs(reading.used.stress[number]).max()), *PLAUSIBLE_STRESS
    if low <= largest <= high:
        return ""
    return f"the largest stress is {largest:.3g} MPa: check the units of force and area, or of stress."


def _stretch_size(reading: Reading, number: int) -> str:
    largest = float(reading.used.stretch[number].max())
    if largest <= LARGE_STRETCH:
        return ""
    return f"the largest stretch is {largest:.4g}: check the length of the specimen and the unit of the displacement."


def _cycles(reading: Reading, number: int) -> str:
    count = len(find_cycles(reading.used.table, reading.used.course))
    if count < 2 or len(reading.used) < MIN_ROWS_PER_CYCLE * count:
        return ""
    return f"all {count} cycles are used; to fit one, give --cycle last, first or a number."


def _hysteresis(reading: Reading, number: int) -> str:
    used, course, stress = reading.used, reading.used.course, reading.used.stress[number]
    cycle = find_cycles(used.table, course)[-1]
    branches = [cycle.rows("loading"), cycle.rows("unloading")]
    if min(map(len, branches)) < MIN_ROWS_PER_CYCLE / 2:
        return ""
    ordered = [rows[np.argsort(course[rows])] for rows in branches]
    low = max(course[rows[0]] for rows in ordered)
    high = min(course[rows[-1]] for rows in ordered)
    grid = np.linspace(low, high, 50)
    loading, unloading = (np.interp(grid, course[rows], stress[rows]) for rows in ordered)
    share = float(np.abs(loading - unloading).max() / np.abs(stress).max())
    if share < NOTABLE_SHARE:
        return ""
    return (
        f"loading and unloading differ by up to {share:.0%} of the largest stress, and an elastic material has one "
        "curve; to fit one of them, give --branch loading or unloading."
    )


def _reference(reading: Reading, number: int) -> str:
    stretch, stress = reading.used.stretch[number], reading.used.stress[number]
    unit = stress_unit(reading.experiment.stress_unit)
    mode, points = reading.experiment.mode, reading.experiment.stretch
    control = mode.controls[0] if len(mode.controls) == 1 else STRETCH
    change = np.abs((points - mode.reference).reshape(len(stress), -1)).max(axis=1)
    nearest = int(np.argmin(change))
    gap, furthest = float(change[nearest]), float(change.max())
    if gap > NOTABLE_SHARE * furthest:
        position = " If the file gives positions, not displacements, --preload sets their zero."
        begin = f"the measurements begin at {control.name} {stretch[nearest]:.4g}, not near {control.reference:g}."
        return begin + position * (reading.choices[number].measure == "displacement")
    at_reference, largest = float(stress[nearest]), float(np.abs(stress).max())
    if abs(at_reference) <= NOTABLE_SHARE * largest:
        return ""
    return (
        f"at {control.name} {stretch[nearest]:.4g} the stress is already {at_reference / unit.to_mpa:.3g} {unit.name}, "
        f"{abs(at_reference) / largest:.0%} of the largest: a preload, or the zero of the load cell. "
        f"A hyperelastic material has no stress at {control.name} {control.reference:g}."
    )


def _slack(reading: Reading, number: int) -> str:
    course, size = reading.used.course, np.abs(reading.used.stress[number])
    if any("the preload" in step for step in reading.used.steps):
        return ""
    row = int(np.argmax(size > SLACK_STRESS * size.max()))
    share = abs(float(course[row] - course[0])) / max(float(np.ptp(course)), 1e-12)
    if share < SLACK_STRETCH:
        return ""
    return (
        f"over the first {share:.0%} of the stretches there is less than {SLACK_STRESS:.0%} of the largest stress: a "
        "soft toe, or slack; if the specimen hung slack, give --preload."
    )


def _many(reading: Reading, number: int) -> str:
    count = len(reading.used)
    if count < MANY_ROWS:
        return ""
    return f"all {count} rows would be fitted; --every {count // 1000} would leave about a thousand."


def _other_axis(reading: Reading, number: int) -> str:
    """Return a sentence about a biaxial test that is read as uniaxial."""
    table = reading.table
    choice = reading.choices[number]
    axis, _ = on_axis(heading(table.names[choice.deformation]).quantity)
    if not axis or not isinstance(reading.experiment.mode, Uniaxial):
        return ""
    names = [on_axis(heading(name).quantity) for name in table.names]
    is_across = [name_axis not in ("", axis) and name in ROLES["force"] for name_axis, name in names]
    if not any(is_across):
        return ""
    column = is_across.index(True)
    along, across = (float(np.abs(numbers).max()) for numbers in table.numbers([choice.stress, column]))
    if across < NOTABLE_SHARE * along:
        return ""
    return (
        f"column {table.label(column)} carries force, too, so the test is not uniaxial: give --mode biaxial to read "
        "both axes, or equibiaxial with one of them if both were stretched alike."
    )


CHECKS: tuple[Callable[[Reading, int], str], ...] = (
    _unit_assumed,
    _size,
    _stretch_size,
    _cycles,
    _hysteresis,
    _reference,
    _slack,
    _many,
    _other_axis,
)
