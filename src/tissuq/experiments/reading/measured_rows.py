"""The rows of one test on their way to an experiment, a sentence for every step: its cycles, and where it is taut."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from tissuq.arrays import IndexArray
from tissuq.errors import InputError
from tissuq.experiments.branches import REVERSAL, turning_points
from tissuq.experiments.reading.disturbances import ends_of_rests
from tissuq.experiments.reading.slack import Slack
from tissuq.experiments.reading.table import Column, Table, rows_in
from tissuq.experiments.reading.tube import SAME_STRETCH, rows_at_each_stretch
from tissuq.experiments.reading.vocabulary import CYCLE_NAMES, SET_NAMES
from tissuq.experiments.units import StressUnit

COUNTED_FROM = "stretch counted from"
"""How the step begins that says where the specimen is undeformed."""
STRETCH_MARGIN = 1e-5
"""Share by which a stretch may lie beyond those that are asked for: they are printed with six digits."""


@dataclass(frozen=True)
class Cycle:
    """Rows of one cycle, counted from 0: from ``start`` up to ``stop``, turning at ``peak``.

    Loading is the direction in which the cycle first goes, tension or compression.
    """

    label: str
    start: int
    peak: int
    stop: int

    def rows(self, branch: str | None = None) -> IndexArray:
        """Return its rows, or those of one branch; both branches have the turning point."""
        start = self.peak if branch == "unloading" else self.start
        stop = self.peak + 1 if branch == "loading" else self.stop
        return np.arange(start, stop)


@dataclass(frozen=True)
class Dropped:
    """How many rows a step dropped for the sake of each stress, and why."""

    counts: tuple[int, ...]
    reason: str


@dataclass(frozen=True, eq=False)
class MeasuredRows:
    """What is left of the rows of a test after some steps: a stress or several, each with what it is drawn against.

    Parameters
    ----------
    table : Table
        The remaining rows.
    rows : (n,) array of int
        Where they stand in the table of the file, counted from 0.
    stretch : (k, n) array, dimensionless
        That along the axis of each stress, or the amount of shear.
    stress : (k, n) array, MPa
    standard_error : (k, n) array, MPa
        Of stresses that are means of several specimens; zero of others.
    labels : tuple of k str
        What the stresses are called; an empty text where there is one.
    steps : tuple of str
        What was done so far.
    dropped : tuple of Dropped
    axial_stretch : (n,) array, optional
        That at which a tube is held, where the loading mode has it beside the hoop stretch.
    """

    table: Table
    rows: IndexArray
    stretch: Column
    stress: Column
    standard_error: Column
    labels: tuple[str, ...] = ("",)
    steps: tuple[str, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    axial_stretch: Column | None = None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def is_at_several_lengths(self) -> bool:
        """Whether a tube was at several axial stretches, in turn or one after the other: its cycles repeat nothing."""
        axial = self.axial_stretch
        return axial is not None and (len(rows_at_each_stretch(axial)) > 1 or float(np.ptp(axial)) > 2 * SAME_STRETCH)

    @property
    def course(self) -> Column:
        """What shows how far the test has gone (n,): its stretch, or the mean of the stretches of its axes."""
        return np.asarray(self.stretch.mean(axis=0))

    @property
    def reasons(self) -> list[str]:
        """How many rows were dropped and why, for each stress."""
        return [
            "; ".join(f"{step.counts[number]} dropped: {step.reason}" for step in self.dropped if step.counts[number])
            for number in range(len(self.labels))
        ]

    def with_step(self, *sentences: str) -> MeasuredRows:
        """Return the rows with a sentence about one more step, or one for each stress."""
        return replace(self, steps=(*self.steps, *labelled(self.labels, sentences)))

    def taken(self, rows: IndexArray) -> MeasuredRows:
        """Return some of the rows, in their order."""
        if len(rows) == len(self):
            return self
        columns = {name: getattr(self, name)[:, rows] for name in ("stretch", "stress", "standard_error")}
        axial_stretch = None if self.axial_stretch is None else self.axial_stretch[rows]
        return replace(self, table=self.table.taken(rows), rows=self.rows[rows], axial_stretch=axial_stretch, **columns)

    def kept(self, rows: IndexArray, reason: str) -> MeasuredRows:
        """Return some of the rows, the others dropped for a reason."""
        count = len(self) - len(rows)
        if not count:
            return self
        counts = (count,) * len(self.labels)
        return replace(self.taken(rows), dropped=(*self.dropped, Dropped(counts, reason)))

    def of_cycle(self, cycles: Sequence[Cycle], cycle: str | int | None, branch: str | None) -> MeasuredRows:
        """Return the rows of one cycle (``first``, ``last`` or its number from 1), one branch, or both.

        Raises
        ------
        InputError
            When there is no such cycle or branch.
        """
        if cycle is None and branch is None:
            return self
        wanted = list(cycles) if cycle is None else [cycles[_position(self.table.file, len(cycles), cycle)]]
        rows = np.unique(np.concatenate([wanted_cycle.rows(branch) for wanted_cycle in wanted]))
        if branch == "unloading" and len(rows) <= len(wanted):
            raise InputError(f"{self.table.file}: there is no unloading in {_words(wanted, cycles)}.")
        what = f"{branch} of {_words(wanted, cycles)}" if branch else _words(wanted, cycles)
        return self.kept(rows, f"not {what}").with_step(f"only {what}")

    def until_peak(self) -> MeasuredRows:
        """Return the rows up to the largest stress; of several, to where they are largest together."""
        size = np.abs(self.stress)
        peak = int(np.argmax((size / np.maximum(size.max(axis=1, keepdims=True), np.finfo(float).tiny)).sum(axis=0)))
        rows_to_peak = self.kept(np.arange(peak + 1), "after the largest stress")
        return rows_to_peak.with_step(
            f"only rows up to the largest stress, in {self.table.counted} {self.table.lines[peak]}"
        )

    def relaxed(self) -> MeasuredRows:
        """Return the last row of every rest: that of a test in steps, after each of which the stress relaxes.

        Raises
        ------
        InputError
            When the test rests nowhere.
        """
        ends = ends_of_rests(self.course)
        if not len(ends):
            raise InputError(
                f"{self.table.file}: the stretch rests nowhere, so there is no relaxed stress. Leave out relaxed=True "
                "(--relaxed)."
            )
        return self.kept(ends, "not the last of a rest").with_step(f"only the last row of each of {len(ends)} rests")

    def without_lines(self, lines: str, absent: Collection[int] = ()) -> MeasuredRows:
        """Return the rows but those of some lines of the file, such as ``31,45:50``; some may be absent already.

        Lines of other tests in the table are theirs to leave out.

        Raises
        ------
        InputError
            When this is not a list of lines, or some of them hold no row that is used.
        """
        of_test = [*self.table.lines, *absent]
        is_asked = rows_in(lines, [*of_test, *self.table.other_tests], self.table.file)[: len(of_test)]
        if not is_asked.any():
            return self
        is_left_out = is_asked[: len(self)]
        if is_left_out.all():
            raise InputError(f"{self.table.file}: no row is left without lines {lines}.")
        remaining = self.kept(np.flatnonzero(~is_left_out), "in lines to leave out")
        return remaining.with_step(f"without the rows in lines {lines}")

    def within(self, low: float, high: float) -> MeasuredRows:
        """Return the rows whose stretches, all of them, lie from one to another.

        Raises
        ------
        InputError
            When there is none.
        """
        margin = STRETCH_MARGIN * (1 + abs(high))
        is_within = ((self.stretch >= low - margin) & (self.stretch <= high + margin)).all(axis=0)
        if not is_within.any():
            raise InputError(
                f"{self.table.file}: no row has a stretch from {low:g} to {high:g}; they are from "
                f"{self.stretch.min():.6g} to {self.stretch.max():.6g}."
            )
        remaining = self.kept(np.flatnonzero(is_within), f"stretch not from {low:g} to {high:g}")
        return remaining.with_step(f"only rows at stretches from {low:g} to {high:g}")

    def loaded(self, slacks: Sequence[Slack | None], reference: float) -> MeasuredRows:
        """Return the rows from where load begins on every axis, with stretches counted from there.

        Parameters
        ----------
        slacks : sequence of Slack or None
            Where load begins; None where the file's own zero stays.
        reference : float
            The stretch of the undeformed specimen, or 0 for an amount of shear.
        """
        if not any(slacks):
            return self.with_step("no slack shows, so the stretch is counted as in the file")
        starts = np.array([[slack.stretch if slack else reference] for slack in slacks])
        way = np.sign(self.stretch[np.arange(len(slacks)), np.abs(self.stress).argmax(axis=1)][:, None] - starts)
        is_loaded = [way[k] * (self.stretch[k] - starts[k]) >= 0 if slack else True for k, slack in enumerate(slacks)]
        used = self.kept(np.flatnonzero(np.all(np.broadcast_arrays(*is_loaded), axis=0)), "before load begins")
        sentences = [
            f"{COUNTED_FROM} {slack.stretch:.6g}, where load begins (estimated; standard deviation {slack.sd:.2g}, "
            "which the tolerance slack includes)"
            if slack
            else "no slack shows"
            for slack in slacks
        ]
        return used._counted_from(starts, reference).with_step(*sentences)

    def _counted_from(self, starts: Column, reference: float) -> MeasuredRows:
        """Return the rows with stretches, or amounts of shear, counted from others (k, 1)."""
        return replace(self, stretch=self.stretch / starts if reference else self.stretch - starts)

    def taut(
        self, preload: str, thresholds: Sequence[float], begun: MeasuredRows, reference: float, unit: StressUnit
    ) -> MeasuredRows:
        """Return the rows in which every axis carries the preload, with stretches counted from where it first does.

        That is where the absolute stress last rises through its threshold (MPa) on the way to the first peak of the
        rows ``begun``, the same ones or, of unloading, with the loading before: interpolated between the rows on either
        side. There stretch 1 is, and the gauge length with it. Stresses stay as they are.

        Raises
        ------
        InputError
            When no row carries the preload.
        """
        peak = find_cycles(begun.table, begun.course, reference)[0].peak
        pairs = enumerate(thresholds)
        starts = [_taut_start(begun, number, preload, threshold, peak, unit) for number, threshold in pairs]
        if reference and (not_positive := next((start for start in starts if start.stretch <= 0), None)):
            raise InputError(
                f"{self.table.file}: where the preload {preload} is reached ({not_positive.lines}), the "
                f"stretch is {not_positive.stretch:g}, not positive. Check the length of the specimen and the column "
                "of displacements."
            )
        is_after = self.rows >= begun.rows[[[start.row] for start in starts]]
        carries = is_after & (np.abs(self.stress) >= np.array(thresholds)[:, None])
        is_taut = carries.all(axis=0)
        reason = f"carrying less than {preload}"
        elsewhere = f"{reason} on the other axis"
        if not is_taut.any():
            raise InputError(
                f"{self.table.file}: no row is left, for all are {elsewhere}. Give a lower --preload, or another "
                "--cycle."
            )
        dropped = [
            Dropped(tuple(rows.sum(axis=1).tolist()), why)
            for rows, why in ((~carries, reason), (carries & ~is_taut, elsewhere))
            if rows.any()
        ]
        used = self.taken(np.flatnonzero(is_taut))
        references = np.array([[start.stretch] for start in starts])
        used = replace(used._counted_from(references, reference), dropped=(*self.dropped, *dropped))
        reached = f"where the preload {preload} is reached"
        return used.with_step(*(f"{COUNTED_FROM} {start.stretch:.6g}, {reached} {start.lines}" for start in starts))


def labelled(labels: Sequence[str], texts: Sequence[str]) -> list[str]:
    """Return texts about every stress: once where it is the same for all, else each with what the stress is called."""
    if len(set(texts)) == 1:
        return [texts[0]]
    return [f"{label}: {text}" for label, text in zip(labels, texts, strict=True) if text]


class _TautStart(NamedTuple):
    """From which row on an axis is taut, the stretch there, and where that is in words."""

    row: int
    stretch: float
    lines: str


def _taut_start(
    measured: MeasuredRows, number: int, preload: str, threshold: float, peak: int, unit: StressUnit
) -> _TautStart:
    """Return where the stress of that number reaches a threshold on the way to a row."""
    table, stretch, size = measured.table, measured.stretch[number], np.abs(measured.stress[number])
    is_loaded = size[: peak + 1] >= threshold
    if not is_loaded.any():
        raise InputError(
            f"{table.file}: the preload {preload} is not reached: the largest stress is "
            f"{unit.written(size[: peak + 1].max())}, and the preload is {unit.written(threshold)}. Give a lower one, "
            "and check the units of force and area."
        )
    slack = np.flatnonzero(~is_loaded)
    slack = slack[slack < np.flatnonzero(is_loaded)[-1]]
    if not len(slack):
        words = f"in {table.counted} {table.lines[0]}, the first, where the stress is already {unit.written(size[0])}"
        return _TautStart(0, float(stretch[0]), words)
    row = int(slack[-1]) + 1
    share = (threshold - size[row - 1]) / (size[row] - size[row - 1])
    reference = stretch[row - 1] + share * (stretch[row] - stretch[row - 1])
    words = f"between {table.counted}s {table.lines[row - 1]} and {table.lines[row]}"
    return _TautStart(row, float(reference), words)


def find_cycles(table: Table, stretch: Column, rest: float) -> list[Cycle]:
    """Return the cycles of a test, by the file's column of cycles where it has several, else by turning points.

    Where a test goes to both sides of ``rest``, the way back to it at the end belongs to the last cycle.
    """
    labels = _cycle_labels(table)
    starts = [0, *(k for k in range(1, len(labels)) if labels[k] != labels[k - 1]), len(labels)]
    if len(starts) > 2:
        peaks = (
            start + int(np.argmax(np.abs(stretch[start:stop] - stretch[start]))) for start, stop in pairwise(starts)
        )
        return [Cycle(labels[s], s, p, t) for (s, t), p in zip(pairwise(starts), peaks, strict=True)]
    ends = [0, *turning_points(stretch), len(stretch) - 1]
    bounds = [*ends[0:-1:2], ends[-1]]
    margin = REVERSAL * np.ptp(stretch)
    is_reversed = rest - stretch.min() > margin and stretch.max() - rest > margin
    is_at_rest = np.abs(stretch[bounds[-2:]] - rest) <= margin
    if is_reversed and len(bounds) > 2 and len(ends) % 2 == 0 and is_at_rest.tolist() == [False, True]:
        bounds.pop(-2)
    return [
        Cycle(str(number), start, ends[2 * number - 1], stop + (stop == len(stretch) - 1))
        for number, (start, stop) in enumerate(pairwise(bounds), start=1)
    ]


def _words(wanted: Sequence[Cycle], cycles: Sequence[Cycle]) -> str:
    count = f"{len(cycles)} cycle{'s' * (len(cycles) != 1)}"
    if len(wanted) > 1:
        return f"all {count}"
    number = list(cycles).index(wanted[0]) + 1
    label = "" if wanted[0].label == str(number) else f" ('{wanted[0].label}')"
    return f"cycle {number}{label} of {len(cycles)}"


def _position(file: str, count: int, cycle: str | int) -> int:
    text = str(cycle).strip().lower()
    if text in ("first", "last"):
        return 0 if text == "first" else count - 1
    if text.isdecimal() and 1 <= int(text) <= count:
        return int(text) - 1
    if count == 1:
        raise InputError(f"{file} has one cycle, and no '{cycle}'. Leave cycle (--cycle) out.")
    raise InputError(f"{file} has {count} cycles; cycle must be first, last or 1 to {count}, not '{cycle}'.")


def _cycle_labels(table: Table) -> list[str]:
    """Return the set and the cycle of every row as in the file; nothing where it has no column of cycles.

    CellScale's machines write the phase beside the number (``2-Stretch``, ``2-Recover``), which is left out.
    """
    cycle = [column for column, name in enumerate(table.quantities) if name in CYCLE_NAMES]
    if len(cycle) != 1:
        return []
    numbers = [re.sub(r"^(\d+)-.*$", r"\1", text) for text in table.texts(cycle[0])]
    sets = [column for column, name in enumerate(table.quantities) if name in SET_NAMES]
    if not sets:
        return numbers
    return [f"{name} {number}" for name, number in zip(table.texts(sets[0]), numbers, strict=True)]
