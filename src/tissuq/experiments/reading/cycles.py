"""Cycles of loading and unloading: where each begins and turns, and which of them is wanted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.branches import REVERSAL, turning_points
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.vocabulary import CYCLE_NAMES, SET_NAMES

__all__ = ["BRANCHES", "Cycle", "find_cycles", "of_cycle"]

BRANCHES = ("loading", "unloading")


@dataclass(frozen=True)
class Cycle:
    """Rows of one cycle, counted from 0: from ``start`` up to ``stop``, turning at ``peak``.

    Loading is the direction in which the cycle first goes, tension or compression.
    """

    label: str
    start: int
    peak: int
    stop: int

    def rows(self, branch: str | None = None) -> NDArray[np.intp]:
        """Return its rows, or those of one branch; both branches have the turning point."""
        start = self.peak if branch == "unloading" else self.start
        stop = self.peak + 1 if branch == "loading" else self.stop
        return np.arange(start, stop)


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
    is_at_rest = np.abs(stretch[bounds[-2:]] - rest) <= REVERSAL * np.ptp(stretch)
    if len(bounds) > 2 and len(ends) % 2 == 0 and is_at_rest.tolist() == [False, True]:
        bounds.pop(-2)
    return [
        Cycle(str(number), start, ends[2 * number - 1], stop + (stop == len(stretch) - 1))
        for number, (start, stop) in enumerate(pairwise(bounds), start=1)
    ]


def of_cycle(
    measured: MeasuredRows, cycles: Sequence[Cycle], cycle: str | int | None, branch: str | None
) -> MeasuredRows:
    """Return the rows of one cycle (``first``, ``last`` or its number from 1), one branch, or both.

    Raises
    ------
    InputError
        When there is no such cycle or branch.
    """
    if branch is not None and branch not in BRANCHES:
        raise InputError(f"branch must be one of {', '.join(BRANCHES)}, not '{branch}'.")
    if cycle is None and branch is None:
        return measured
    wanted = list(cycles) if cycle is None else [cycles[_position(measured.table.file, len(cycles), cycle)]]
    rows = np.unique(np.concatenate([wanted_cycle.rows(branch) for wanted_cycle in wanted]))
    if branch == "unloading" and len(rows) <= len(wanted):
        raise InputError(f"{measured.table.file}: there is no unloading in {_words(wanted, cycles)}.")
    what = f"{branch} of {_words(wanted, cycles)}" if branch else _words(wanted, cycles)
    return measured.kept(rows, f"not {what}").with_step(f"only {what}")


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
