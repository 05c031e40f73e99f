"""What happened in a test besides elastic loading, a kind each: where, what was seen, and the option that cures it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tissuq.arrays import IndexArray
from tissuq.experiments.modes.mode import Control, LoadingMode
from tissuq.experiments.reading.disturbances import (
    UNIFORM_SD,
    Event,
    find_drift,
    find_holds,
    find_outliers,
    find_rupture,
    find_saturation,
    find_slips,
    staircase_of,
    step_of,
)
from tissuq.experiments.reading.measured_rows import COUNTED_FROM, Cycle, MeasuredRows, find_cycles
from tissuq.experiments.reading.slack import Slack, find_slack
from tissuq.experiments.reading.table import Column
from tissuq.experiments.units import StressUnit

AUTO = "auto"
"""What is given for a preload where load begins."""
UNTIL_PEAK = "to leave out what follows the largest stress give --until-peak."
LARGE_DRIFT = 0.15
"""Share of the largest stress by which a drift takes the modulus out of its interval: with 0.1 it is in it, with 0.2
not."""
COARSE_STEP = 0.007
"""Share of the largest load from which its step is worth a word: its error is then that of a careful laboratory."""
FEWEST_COPIED_ROWS = 5
"""Rows after one another that measure, to the last digit, what others after one another did."""
RESTART = 0.5
"""Share of a cycle's range from which the step to the next one is no unloading: the test begins anew."""
FEWEST_RELAXED = 3
"""Holds from which their ends are a test by themselves."""


@dataclass(frozen=True, eq=False)
class Region:
    """Rows of a test, of those that are used, in which something happened; what, and a sentence with what to do.

    ``code`` is that of the warning, where it is not that of the kind.
    """

    kind: str
    rows: IndexArray
    text: str
    code: str = ""


@dataclass(frozen=True, eq=False)
class TestedStress:
    """One stress of the rows that are used, with the cycles in which it was measured."""

    used: MeasuredRows
    number: int
    cycles: Sequence[Cycle]
    mode: LoadingMode
    unit: StressUnit

    @property
    def course(self) -> Column:
        """What shows how far the test has gone (n,)."""
        return self.used.course

    @cached_property
    def stress(self) -> Column:
        """The stress (n,), MPa."""
        return np.asarray(self.used.stress[self.number])

    @property
    def control(self) -> Control:
        """What the course is of: the mode's control, or the mean stretch where there are several."""
        return self.mode.abscissa_control

    @cached_property
    def peak(self) -> int:
        """The row of the largest stress."""
        return int(np.argmax(np.abs(self.stress)))

    @cached_property
    def branches(self) -> list[IndexArray]:
        """The rows of loading of every cycle, without outliers."""
        return [np.setdiff1d(cycle.rows("loading"), self.outliers, assume_unique=True) for cycle in self.cycles]

    @cached_property
    def outliers(self) -> IndexArray:
        """Single rows far from their neighbours, in stress or course; not those at which a test begins anew."""
        outliers = np.union1d(find_outliers(self.stress), find_outliers(self.course))
        restarts = [
            cycle.stop
            for cycle in self.cycles[:-1]
            if abs(self.course[cycle.stop] - self.course[cycle.stop - 1])
            > RESTART * np.ptp(self.course[cycle.start : cycle.stop])
        ]
        return np.setdiff1d(outliers, [row for stop in restarts for row in (stop - 1, stop)])

    @cached_property
    def rupture(self) -> Event | None:
        """The first rupture, in rows that are used."""
        for rows in self.branches:
            rupture = find_rupture(self.course[rows], self.stress[rows], self.control.reference)
            if rupture is not None:
                return Event(int(rows[rupture.start]), int(rows[-1]) + 1, rupture.fall)
        return None

    @cached_property
    def holds(self) -> list[Event]:
        """Where the test rests and the stress relaxes."""
        return [] if self.rupture else find_holds(self.course, self.stress)

    @cached_property
    def slips(self) -> list[Event]:
        """Where the stress falls by a few per cent while the test goes on, before any rupture or hold."""
        end = min(event.start for event in (self.rupture, *self.holds, Event(len(self.stress), 0, 0.0)) if event)
        events = []
        saturated = find_saturation(self.stress)  # equal loads hide the scatter of the others
        for rows in self._away_from_reference(end):
            rows = np.setdiff1d(rows, saturated, assume_unique=True)
            slips = find_slips(self.course[rows], self.stress[rows], self.load_step or 0.0)
            events += [Event(int(rows[slip.start]), int(rows[slip.stop - 1]) + 1, slip.fall) for slip in slips]
        return events

    def _away_from_reference(self, end: int) -> Iterator[IndexArray]:
        """Iterate over the rows before one in which a branch goes away from the undeformed specimen, to either side."""
        away = self.course - self.control.reference
        for rows in (branch[branch < end] for branch in self.branches):
            for rows_of_side in (rows[away[rows] >= 0], rows[away[rows] < 0]):
                if len(rows_of_side) and abs(away[rows_of_side[-1]]) > abs(away[rows_of_side[0]]):
                    yield rows_of_side

    @cached_property
    def slack(self) -> Slack | None:
        """The slack at the beginning of the first loading, from the rows before it is disturbed.

        None of a tube that was stretched first, which is free of stress at no stretch of its own.
        """
        if self.used.axial_stretch is not None:
            return None
        end = min(event.start for event in (self.rupture, *self.slips, Event(len(self.stress), 0, 0.0)) if event)
        rows = self.branches[0]
        rows = rows[rows < end]
        if not len(rows):
            return None
        rows = rows[: int(np.argmax(np.abs(self.stress[rows]))) + 1]
        return find_slack(self.used.stretch[self.number][rows], self.stress[rows])

    @cached_property
    def load_step(self) -> float | None:
        """The step of the stress (MPa) where that is coarse."""
        step = step_of(self.stress)
        return step if step and step > COARSE_STEP * np.abs(self.stress).max() else None

    @cached_property
    def stretch_step(self) -> float | None:
        """The step of the stretch where rows share it while the stress goes on."""
        rows = self.branches[0]
        return staircase_of(self.used.stretch[self.number][rows], self.stress[rows])

    @cached_property
    def regions(self) -> list[Region]:
        """What happened besides elastic loading, kind by kind."""
        return [region for check in CHECKS for region in check(self)]

    def lines(self, rows: IndexArray) -> str:
        """Return the lines of the file in which rows stand, as one gives them to ``--leave-out``."""
        return self.used.table.lines_of(rows)

    def place(self, rows: IndexArray) -> str:
        """Return where rows stand in the file, in words."""
        return f"{self.used.table.counted}{'s' * (len(rows) > 1)} {self.lines(rows)}"


def tested_stresses(used: MeasuredRows, mode: LoadingMode, unit: StressUnit) -> tuple[TestedStress, ...]:
    """Return every stress of the rows that are used; ``unit`` is that in which people want to read them."""
    cycles = find_cycles(used.table, used.course, mode.controls[0].reference)
    return tuple(TestedStress(used, number, cycles, mode, unit) for number in range(len(used.labels)))


def least_errors(tests: Sequence[TestedStress]) -> dict[str, float]:
    """Return the standard deviations of errors of a test that its load cell and displacement have at least, by name."""
    load = [test.load_step / np.abs(test.stress).max() for test in tests if test.load_step]
    stretch = [test.stretch_step for test in tests if test.stretch_step]
    steps = {"resolution": max(load, default=0.0), "stretch": max(stretch, default=0.0)}
    return {name: float(UNIFORM_SD * step) for name, step in steps.items() if step}


def _rupture(tested: TestedStress) -> Iterator[Region]:
    if rupture := tested.rupture:
        row, rows = rupture.start - 1, np.arange(rupture.start, rupture.stop)
        is_before_peak = tested.peak >= rupture.start
        advice = _leave_out(tested, np.arange(rupture.start, len(tested.used))) if is_before_peak else UNTIL_PEAK
        yield Region(
            "rupture",
            rows,
            f"after {tested.place(np.array([row]))} ({tested.control.name} {tested.course[row]:.4g}) the stress falls "
            f"by {100 * rupture.fall:.0f} % of the largest while the test goes on: the specimen tore, or slipped; "
            f"{advice}",
        )


def _holds(tested: TestedStress) -> Iterator[Region]:
    if holds := tested.holds:
        rows = np.concatenate([np.arange(hold.start, hold.stop) for hold in holds])
        is_before_peak = any(hold.stop <= tested.peak for hold in holds)
        relaxed = "to use the relaxed stress of each step give --relaxed; " * (len(holds) >= FEWEST_RELAXED)
        yield Region(
            "hold",
            rows,
            f"in {tested.place(rows)} the stretch rests while the stress falls by up to "
            f"{100 * max(hold.fall for hold in holds):.0f} % of the largest: it relaxes, as no elastic material does; "
            f"{relaxed}{_leave_out(tested, rows) if is_before_peak else UNTIL_PEAK}",
        )


def _slips(tested: TestedStress) -> Iterator[Region]:
    if slips := tested.slips:
        rows = np.array([row for slip in slips for row in range(slip.start, slip.stop)])
        yield Region(
            "slip",
            rows,
            f"in {tested.place(rows)} the stress suddenly falls, by up to "
            f"{100 * max(slip.fall for slip in slips):.1f} % of the largest, and the test goes on: the specimen "
            f"slipped in the grips, or tore a little, and stretches from there on are too large; "
            f"{_leave_out(tested, np.arange(slips[0].start, len(tested.used)))}",
        )


def _saturation(tested: TestedStress) -> Iterator[Region]:
    rows = find_saturation(tested.stress)
    if len(rows):
        largest = abs(tested.stress[rows[0]]) / tested.unit.to_mpa
        yield Region(
            "saturation",
            rows,
            f"{len(rows)} rows carry exactly the largest stress, {largest:.5g} {tested.unit.name}: the load cell reads "
            f"no more than that; {_leave_out(tested, rows)}",
        )


def _outliers(tested: TestedStress) -> Iterator[Region]:
    if len(rows := tested.outliers):
        yield Region(
            "outlier",
            rows,
            f"{'rows lie' if len(rows) > 1 else 'a row lies'} far off the ones before and after, in "
            f"{tested.place(rows)}; {_leave_out(tested, rows)}",
        )


def _copies(tested: TestedStress) -> Iterator[Region]:
    """Yield rows that are those from further above once more: no second cycle is equal to the last digit."""
    measured = np.vstack([tested.used.stretch, tested.used.stress])
    if (np.diff(np.sort(measured[-1])) == 0).sum() < FEWEST_COPIED_ROWS:
        return  # hardly two stresses are equal
    _, first_rows, number = np.unique(measured, axis=1, return_index=True, return_inverse=True)
    origin = first_rows[number.ravel()]
    is_next = (origin[1:] < np.arange(1, len(origin))) & (np.diff(origin) == 1) & (np.diff(measured[-1]) != 0)
    runs = np.split(np.arange(1, len(origin)), np.flatnonzero(np.diff(is_next)) + 1)
    runs = [np.append(run[0] - 1, run) for run in runs if len(run) >= FEWEST_COPIED_ROWS - 1 and is_next[run[0] - 1]]
    if runs:
        rows = np.concatenate(runs)
        yield Region(
            "copies",
            rows,
            f"{tested.place(rows)} repeat {tested.lines(origin[rows])} to the last digit, as a copy does and no "
            f"measurement: {_leave_out(tested, rows)}",
        )


def _repeated(tested: TestedStress) -> Iterator[Region]:
    """Yield the repetitions where every row is there as often, one after the other: of a hold only some rows are."""
    measured = np.vstack([tested.used.stretch, tested.used.stress])
    first_rows = np.flatnonzero(np.append(True, (np.diff(measured, axis=1) != 0).any(axis=0)))
    counts = np.diff(np.append(first_rows, measured.shape[1]))
    if len(counts) >= FEWEST_COPIED_ROWS and counts[0] > 1 and (counts == counts[0]).all():
        yield Region(
            "copies",
            np.setdiff1d(np.arange(measured.shape[1]), first_rows),
            f"every row is there {counts[0]} times, one after the other, as in a copy and no measurement: to leave the "
            f"copies out give --every {counts[0]}.",
        )


def _drift(tested: TestedStress) -> Iterator[Region]:
    if tested.rupture or tested.holds or tested.slips:
        return
    course, stress = tested.course, tested.stress
    if drift := find_drift(course, stress):
        share = abs(drift[1] - drift[0]) / np.abs(stress).max()
        begin, end = (f"{value / tested.unit.to_mpa:.3g}" for value in drift)
        yield Region(
            "drift",
            np.array([0, len(stress) - 1]),
            f"the stress is {begin} {tested.unit.name} at the beginning and {end} {tested.unit.name} at the end, back "
            f"at {tested.control.name} {course[-1]:.4g}, {100 * share:.0f} % "
            "of the largest apart: the zero of the load cell drifts, or the specimen has changed for good; to fit one "
            "branch give --branch loading, and for a zero that is not sure --tolerance "
            f"zero={abs(drift[1] - drift[0]) / 2 / tested.unit.to_mpa:.2g}.",
            "large-drift" if share > LARGE_DRIFT else "",
        )


def _load_step(tested: TestedStress) -> Iterator[Region]:
    if step := tested.load_step:
        share = step / np.abs(tested.stress).max()
        yield Region(
            "resolution",
            np.array([], dtype=np.intp),
            f"the stresses are multiples of {step / tested.unit.to_mpa:.3g} {tested.unit.name}, {100 * share:.1f} % of "
            f"the largest: the resolution of the load cell, or few digits in the file. A fit allows for an error of "
            f"{UNIFORM_SD * share:.2g} of the largest in each; to state another one give --tolerance "
            f"resolution={UNIFORM_SD * share:.2g}.",
        )


def _stretch_step(tested: TestedStress) -> Iterator[Region]:
    if step := tested.stretch_step:
        yield Region(
            "resolution",
            np.array([], dtype=np.intp),
            f"the {tested.control.name} goes on in steps of {step:.3g} while the stress goes on evenly: the resolution "
            f"of the displacement. A fit allows for an error of {UNIFORM_SD * step:.2g} in each; to state another one "
            f"give --tolerance stretch={UNIFORM_SD * step:.2g}.",
        )


def _slack(tested: TestedStress) -> Iterator[Region]:
    if any(COUNTED_FROM in step for step in tested.used.steps) or not (slack := tested.slack):
        return
    if len(tested.mode.stresses) == 1 or tested.mode.machine_axes:
        preload = f"{_rounded_up(slack.preload / tested.unit.to_mpa):g} {tested.unit.name}"
        advice = (
            f"to count from where load begins give --preload auto, or from where it carries a load --preload "
            f'"{preload}"; both drop these rows.'
        )
    else:
        advice = "count stretches in the file from where it is taut."
    yield Region(
        "slack",
        tested.branches[0][: slack.rows],
        f"the first {slack.rows} rows carry no load that shows, until the {tested.mode.controls[0].name} "
        f"is {slack.stretch:.4g} (standard deviation {slack.sd:.2g}): slack, or a toe too soft to measure; {advice}",
    )


def _leave_out(tested: TestedStress, rows: IndexArray) -> str:
    return f"to leave {'them' if len(rows) > 1 else 'it'} out give --leave-out {tested.lines(rows)}."


def _rounded_up(value: float) -> float:
    """Return a positive number with two digits that is not smaller."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(1.02 * value / digit) * digit)


CHECKS: tuple[Callable[[TestedStress], Iterator[Region]], ...] = (
    _rupture,
    _holds,
    _slips,
    _saturation,
    _outliers,
    _copies,
    _repeated,
    _drift,
    _load_step,
    _stretch_step,
    _slack,
)
