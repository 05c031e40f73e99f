"""Rows of a summary at the end of a table, such as its largest values and means, which are no measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.numbers import NUMBER, number_in
from tissuq.experiments.reading.layout import MISSING

__all__ = ["Summary", "find_summary"]

MOST_ROWS, FEWEST_MEASUREMENTS = 8, 5
"""Rows that a summary has at most, and a table above it at least."""
JUMP, JUMP_OF_RANGE = 3.0, 0.02
"""Times the largest step in a column, and share of its range beyond that, by which a row does not go on from above."""
STATISTICS: dict[str, Callable[[NDArray[np.float64]], Any]] = {
    "maximum": np.max,
    "minimum": np.min,
    "mean": np.mean,
    "median": np.median,
    "standard deviation": lambda values: np.std(values, ddof=1),
    "standard deviation of all": np.std,
    "standard error": lambda values: np.std(values, ddof=1) / np.sqrt(len(values)),
    "range": np.ptp,
    "sum": np.sum,
    "number of rows": len,
    "coefficient of variation": lambda values: np.std(values, ddof=1) / np.mean(values) if np.mean(values) else np.nan,
}
"""What a summary tells of the columns above it."""
ROUNDED = 1.01
"""Units of its last digit by which a statistic may differ: it and the measurements were rounded, half a unit each."""
FLOATING = 1e-9
"""Share of a statistic by which it may differ where all digits of a computer are written."""
OF_ONE_ROW = {"maximum", "minimum"}
"""Statistics that the last measurement, too, may be."""


@dataclass(frozen=True)
class Summary:
    """Where rows begin that stand apart at the end of a table, and the statistics that they are of it.

    ``statistics`` is None where the rows do not go on from the ones above, and are no summary that is known.
    """

    start: int
    statistics: tuple[str, ...] | None


def find_summary(rows: Sequence[str], lines: Sequence[int], split: Callable[[str], list[str]]) -> Summary | None:
    """Return the rows at the end of a table that are no measurements; None where all are, or may be.

    They stand beneath a blank line, or have a word where the rows above have numbers. They are a summary where each
    is a statistic of the columns above, or has such a word beneath a blank line. Rows right beneath the measurements
    are a summary where all are statistics.

    Parameters
    ----------
    rows : sequence of str
    lines : sequence of int
        The line of each row in the file.
    split : callable
        Gives the cells of a row.
    """
    start = _start_beneath_gap(lines)
    is_apart = start is not None
    if start is None:
        start = _start_of_labels(rows, split)
    if start is None:
        return _summary_right_beneath(rows, split)
    if start < max(FEWEST_MEASUREMENTS, len(rows) - start):
        return None
    above, beneath, of_numbers = _parted(rows, start, split)
    names = [_statistic(row, above, of_numbers) for row in beneath]
    has_word = [_has_word(row, of_numbers) for row in beneath]
    if all(name or (is_apart and word) for name, word in zip(names, has_word, strict=True)):
        return Summary(start, tuple(dict.fromkeys(filter(None, names))))
    return Summary(start, None) if _jumps(above, beneath, of_numbers) else None


def _summary_right_beneath(rows: Sequence[str], split: Callable[[str], list[str]]) -> Summary | None:
    """Return the last rows that are statistics of those above, and not only what a last measurement may be."""
    first = max(FEWEST_MEASUREMENTS, len(rows) - MOST_ROWS)
    last = rows[-3 * MOST_ROWS :]
    if first >= len(rows) or not _jumps(*_parted(last, len(last) - (len(rows) - first), split)):
        return None
    for start in range(first, len(rows)):
        above, beneath, of_numbers = _parted(rows, start, split)
        names = [_statistic(row, above, of_numbers) for row in beneath]
        if all(names) and not OF_ONE_ROW.issuperset(names):
            return Summary(start, tuple(dict.fromkeys(names)))
    return None


def _parted(
    rows: Sequence[str], start: int, split: Callable[[str], list[str]]
) -> tuple[NDArray[np.float64], list[list[str]], NDArray[np.bool_]]:
    """Return the numbers above a row, the cells from there on, and which columns above hold only numbers."""
    above = np.array(_same_width([[number_in(cell) for cell in split(row)] for row in rows[:start]]))
    beneath = [(split(row) + [""] * above.shape[1])[: above.shape[1]] for row in rows[start:]]
    return above, beneath, np.isfinite(above).all(axis=0)


def _start_beneath_gap(lines: Sequence[int]) -> int | None:
    """Return the row beneath the only place where lines are blank, within the last rows of a table."""
    if lines[-1] - lines[0] == len(lines) - 1:
        return None
    first = int(np.flatnonzero(np.diff(lines) > 1)[0]) + 1
    return first if len(lines) - first <= MOST_ROWS else None


def _start_of_labels(rows: Sequence[str], split: Callable[[str], list[str]]) -> int | None:
    """Return the first of the last rows that have a word in a cell where the row before them has a number."""
    last = [split(row) for row in rows[-MOST_ROWS - 1 :]]
    for count, (row, above) in enumerate(pairwise(reversed(last)), start=1):
        words = [_is_word(cell) for cell in row]
        if not any(words):
            break
        if any(word and NUMBER.fullmatch(cell) for word, cell in zip(words, above, strict=False)):
            return len(rows) - count
    return None


def _statistic(row: Sequence[str], above: NDArray[np.float64], of_numbers: NDArray[np.bool_]) -> str:
    """Return which statistic all numbers of a row are, to their last digit; an empty text if none."""
    columns = [column for column in np.flatnonzero(of_numbers).tolist() if NUMBER.fullmatch(row[column])]
    if len(columns) < 2 and not (columns and _has_word(row, of_numbers)):
        return ""
    for name, statistic in STATISTICS.items():
        if all(abs(number_in(row[k]) - statistic(above[:, k])) <= _rounding(row[k]) for k in columns):
            return name
    return ""


def _jumps(above: NDArray[np.float64], beneath: Sequence[Sequence[str]], of_numbers: NDArray[np.bool_]) -> bool:
    """Tell whether rows do not go on from the ones above as those do among themselves."""
    values = np.array([[number_in(cell) for cell in row] for row in beneath])
    above, steps = above[:, of_numbers], np.abs(np.diff(np.vstack([above[-1:], values])[:, of_numbers], axis=0))
    allowed = JUMP * np.abs(np.diff(above, axis=0)).max(axis=0) + JUMP_OF_RANGE * np.ptp(above, axis=0)
    return bool((np.nan_to_num(steps) > allowed).any())


def _has_word(row: Sequence[str], of_numbers: NDArray[np.bool_]) -> bool:
    return any(_is_word(row[column]) for column in np.flatnonzero(of_numbers).tolist())


def _is_word(cell: str) -> bool:
    return cell.lower() not in MISSING and not NUMBER.fullmatch(cell)


def _rounding(cell: str) -> float:
    """Return by how much a number may differ from the statistic that it was rounded from."""
    mantissa, _, exponent = cell.lower().replace(",", ".").partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    return float(ROUNDED * float(f"1e{-decimals}") + FLOATING * abs(number_in(cell)))


def _same_width(rows: list[list[float]]) -> list[list[float]]:
    width = max(map(len, rows))
    return [row + [np.nan] * (width - len(row)) for row in rows]
