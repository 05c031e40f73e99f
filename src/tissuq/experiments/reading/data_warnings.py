"""What is strange about measurements that can be read: each doubt is a function that says a sentence or nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.modes.mode import STRETCH
from tissuq.experiments.reading.columns import heading
from tissuq.experiments.reading.cycles import find_cycles
from tissuq.experiments.reading.experiment_file import Reading
from tissuq.experiments.reading.two_stresses import told_once
from tissuq.experiments.reading.units import stress_unit
from tissuq.experiments.reading.vocabulary import ROLES, on_axis

__all__ = ["doubts"]

MANY = 10_000
"""Rows from which thinning is worth a word."""
ROWS_OF_A_CYCLE = 10
"""Rows that a cycle has on average where cycles are meant, and not a table in any order."""
NOTABLE = 0.05
"""Share of the largest stress, or of the range of stretches, that is worth a word."""
PLAUSIBLE_STRESS = (1e-6, 1e3)
"""Largest stresses, MPa, between which units are hardly mistaken."""
LARGE_STRETCH = 10.0
SLACK_STRESS, SLACK_STRETCH = 0.01, 0.2
"""Share of the largest stress that a slack specimen stays below, over what share of the range of stretches."""


def doubts(reading: Reading) -> tuple[str, ...]:
    """Return what a person should look at before a fit; of two stresses each."""
    labels = [each.label for each in reading.stresses]
    found = (told_once(labels, [doubt(each) for each in reading.stresses]) for doubt in DOUBTS)
    return (*reading.warnings, *(text for texts in found for text in texts if text))


def _unit_assumed(reading: Reading) -> str:
    if "the file states no unit" not in reading.experiment.source:
        return ""
    return "the file states no unit of stress, so MPa was assumed; if it is another, give --stress-unit."


def _size(reading: Reading) -> str:
    largest, low, high = float(np.abs(reading.used.stress).max()), *PLAUSIBLE_STRESS
    if low <= largest <= high:
        return ""
    return f"the largest stress is {largest:.3g} MPa: check the units of force and area, or of stress."


def _stretch_size(reading: Reading) -> str:
    largest = float(reading.used.stretch.max())
    if largest <= LARGE_STRETCH:
        return ""
    return f"the largest stretch is {largest:.4g}: check the length of the specimen and the unit of the displacement."


def _cycles(reading: Reading) -> str:
    count = len(find_cycles(reading.used.table, reading.course))
    if count < 2 or len(reading.used) < ROWS_OF_A_CYCLE * count:
        return ""
    return f"all {count} cycles are used; to fit one, give --cycle last, first or a number."


def _hysteresis(reading: Reading) -> str:
    used, course = reading.used, reading.course
    cycle = find_cycles(used.table, course)[-1]
    branches = [cycle.rows("loading"), cycle.rows("unloading")]
    if min(map(len, branches)) < ROWS_OF_A_CYCLE / 2:
        return ""
    ordered = [rows[np.argsort(course[rows])] for rows in branches]
    low = max(course[rows[0]] for rows in ordered)
    high = min(course[rows[-1]] for rows in ordered)
    grid = np.linspace(low, high, 50)
    loading, unloading = (np.interp(grid, course[rows], used.stress[rows]) for rows in ordered)
    share = float(np.abs(loading - unloading).max() / np.abs(used.stress).max())
    if share < NOTABLE:
        return ""
    return (
        f"loading and unloading differ by up to {share:.0%} of the largest stress, and an elastic material has one "
        "curve; to fit one of them, give --branch loading or unloading."
    )


def _reference(reading: Reading) -> str:
    used, unit = reading.used, stress_unit(reading.experiment.stress_unit)
    mode, points = reading.experiment.mode, reading.experiment.stretch
    control = mode.controls[0] if len(mode.controls) == 1 else STRETCH
    change = np.abs((points - mode.reference).reshape(len(used), -1)).max(axis=1)
    nearest = int(np.argmin(change))
    gap, furthest = float(change[nearest]), float(change.max())
    if gap > NOTABLE * furthest:
        position = " If the file gives positions, not displacements, --preload sets their zero."
        begin = f"the measurements begin at {control.name} {used.stretch[nearest]:.4g}, not near {control.reference:g}."
        return begin + position * (reading.choice.measure == "displacement")
    stress = float(used.stress[nearest])
    if abs(stress) <= NOTABLE * np.abs(used.stress).max():
        return ""
    return (
        f"at {control.name} {used.stretch[nearest]:.4g} the stress is already {stress / unit.to_mpa:.3g} {unit.name}, "
        f"{abs(stress) / np.abs(used.stress).max():.0%} of the largest: a preload, or the zero of the load cell. "
        f"A hyperelastic material has no stress at {control.name} {control.reference:g}."
    )


def _slack(reading: Reading) -> str:
    used, course = reading.used, reading.course
    if any("the preload" in step for step in used.steps):
        return ""
    carries = np.abs(used.stress) > SLACK_STRESS * np.abs(used.stress).max()
    first = int(np.argmax(carries))
    share = abs(float(course[first] - course[0])) / max(float(np.ptp(course)), 1e-12)
    if share < SLACK_STRETCH:
        return ""
    return (
        f"over the first {share:.0%} of the stretches there is less than {SLACK_STRESS:.0%} of the largest stress: a "
        "soft toe, or slack; if the specimen hung slack, give --preload."
    )


def _many(reading: Reading) -> str:
    count = len(reading.used)
    if count < MANY:
        return ""
    return f"all {count} rows would be fitted; --every {count // 1000} would leave about a thousand."


def _other_axis(reading: Reading) -> str:
    """Tell of a biaxial test that is read as uniaxial."""
    table = reading.table
    axis, _ = on_axis(heading(table.names[reading.choice.deformation]).quantity)
    if not axis or not isinstance(reading.experiment.mode, Uniaxial):
        return ""
    names = [on_axis(heading(name).quantity) for name in table.names]
    others = [k for k, (other, name) in enumerate(names) if other not in ("", axis) and name in ROLES["force"]]
    if not others:
        return ""
    own, other = (float(np.abs(each).max()) for each in table.numbers([reading.choice.stress, others[0]]))
    if other < NOTABLE * own:
        return ""
    return (
        f"column {table.label(others[0])} carries force, too, so the test is not uniaxial: give --mode biaxial to read "
        "both axes, or equibiaxial with one of them if both were stretched alike."
    )


DOUBTS: tuple[Callable[[Reading], str], ...] = (
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
