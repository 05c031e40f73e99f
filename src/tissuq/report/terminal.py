"""Prints a result in the terminal: the answer first, tables, at most three warnings, and where the report lies."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tissuq.experiments.numbers import wrapped
from tissuq.report.result import Record, TableRecord, UseRecord, few_and_others
from tissuq.result_warning import Severity, in_shell

TEXT_WIDTH = 96
"""Letters in a line of prose, and at least in one of a table."""
GAP = 2
"""Letters between columns."""
PROSE = 40
"""Letters of a cell from which it is prose, and how many of them a line has at least."""


def print_rows(title: str, headers: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table whose first column is text and whose others are numbers, in lines as wide as the terminal.

    Cells of prose are wrapped. Columns that do not fit beside one another stand beneath, each time with as many of the
    first ones as tell the rows apart.
    """
    from rich.box import SIMPLE_HEAD
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, emoji=False)  # names may hold brackets and colons
    available = max(console.width, TEXT_WIDTH)
    longest = [max(map(cell_len, map(str, cells))) for cells in zip(headers, *rows, strict=True)]
    is_prose = [length > PROSE for length in longest]
    widths = [PROSE if prose else length for length, prose in zip(longest, is_prose, strict=True)]
    for number, columns in enumerate(_side_by_side(widths, available, _telling_apart(rows))):
        table = Table(title=title * (not number), title_justify="left", title_style="bold", box=SIMPLE_HEAD,
                      padding=(0, 1, 0, 0), pad_edge=False)  # fmt: skip
        for index in columns:
            justify: Any = "right" if index and not is_prose[index] else "left"
            table.add_column(headers[index], justify=justify, no_wrap=not is_prose[index])
        for row in rows:
            table.add_row(*(str(row[index]) for index in columns))
        needed = sum(widths[index] + GAP for index in columns)
        console.width = max(available, needed)  # truncated numbers would mislead
        console.print(table)


def _telling_apart(rows: Sequence[Sequence[str]]) -> int:
    """Return how many of the first columns tell rows apart; one where not even all do."""
    counts = range(1, len(rows[0]) if rows else 1)
    return next((count for count in counts if len({tuple(row[:count]) for row in rows}) == len(rows)), 1)


def _side_by_side(widths: Sequence[int], available: int, first: int) -> list[list[int]]:
    """Return which columns stand beside one another where a line has so many letters, each time so many first ones."""
    start, filled_first = list(range(first)), sum(widths[:first]) + GAP * first
    blocks, filled = [start.copy()], filled_first
    for index, width in enumerate(widths[first:], first):
        if filled + width + GAP > available and len(blocks[-1]) > first:
            blocks.append(start.copy())
            filled = filled_first
        blocks[-1].append(index)
        filled += width + GAP
    return blocks


def print_warnings(warnings: Sequence[str], head: str = "Warning") -> None:
    """Print warnings about a result."""
    for text in map(in_shell, warnings):
        print(wrapped(text, TEXT_WIDTH, initial_indent=f"{head}: ", subsequent_indent="  ", break_on_hyphens=False))


def print_explanations(explanations: Sequence[str]) -> None:
    """Print how to read a table."""
    for text in explanations:
        print(wrapped(text, TEXT_WIDTH, initial_indent="- ", subsequent_indent="  "))


def print_result(record: Record, folder: Path | None = None, *, details: bool = False) -> None:
    """Print the record of a result.

    Parameters
    ----------
    record : Record
        Of `Result.record`, or of `read_record`.
    folder : Path, optional
        The run folder, where there is one.
    details : bool
        All warnings, and the sections that a page folds.
    """
    shown, folded = few_and_others(record)
    shown, folded = (shown + folded, []) if details else (shown, folded)
    print_warnings([warning["text"] for warning in shown if warning["severity"] == Severity.PROBLEM])
    print(f"\n{record['title']}")
    print(wrapped(record["subject"], TEXT_WIDTH, initial_indent="  ", subsequent_indent="  "))
    _print_numbers(record["numbers"])
    if record["finding"]:
        print(wrapped(_plain(record["finding"]), TEXT_WIDTH, initial_indent="  ", subsequent_indent="  "))
    if record["uses"]:
        print()
    print_uses(record["uses"])
    if record["next"]:
        print_next(record["next"], folder)
    for table in record["tables"]:
        _print_table(table)
    for warning in shown:
        if warning["severity"] != Severity.PROBLEM:
            print_warnings([warning["text"]], "Note" if warning["severity"] == Severity.NOTE else "Warning")
    for section in record["sections"] if details else ():
        print(f"\n{section['title']}")
        print_explanations(list(map(_plain, section["text"])))
        for table in section["tables"]:
            _print_table(table)
    if folder is None:
        return
    if not details and (folded or record["sections"]):
        titles = ", ".join(section["title"] for section in record["sections"])
        count = f"{titles and '; '}further warnings and notes ({len(folded)})" if folded else ""
        words = f"More: {titles}{count}: tissuq show {shlex.quote(str(folder))} --details"
        print(wrapped(words, TEXT_WIDTH, subsequent_indent="  ", break_on_hyphens=False))
    print(f"Report: {folder / 'report.html'}")


def _print_numbers(numbers: Sequence[Mapping[str, Any]]) -> None:
    """Print numbers, each with its ``name``, ``text`` and ``remark``."""
    width = max((len(number["name"]) for number in numbers), default=0)
    for number in numbers:
        remark, start = str(number["remark"]), f"  {number['name']:<{width}}  "
        if len(remark) <= max(TEXT_WIDTH - len(start), PROSE):
            remark = remark.replace(" ", "\u00a0")  # an interval in one line
        remark = f", {remark}" if remark else ""
        print(wrapped(f"{number['text']}{remark}", max(TEXT_WIDTH, len(start) + PROSE), initial_indent=start,
                      subsequent_indent=" " * len(start), break_on_hyphens=False))  # fmt: skip


def print_uses(uses: Sequence[UseRecord]) -> None:
    """Print for what a result can be used, with the verdict in front."""
    width = max((len(use["verdict"]) for use in uses), default=0)
    for use in uses:
        start = f"  {use['verdict'].upper():<{width}}  "
        print(wrapped(f"{use['purpose']}: {use['reason']}", TEXT_WIDTH, initial_indent=start,
                   subsequent_indent=" " * len(start)))  # fmt: skip


def print_next(step: str, folder: Path | None = None) -> None:
    """Print what to do next, with the folder of the run where the step names it."""
    words = _plain(step).replace("{run}", shlex.quote(str(folder)))
    print("\n" + wrapped(words, TEXT_WIDTH, initial_indent="Next: ", subsequent_indent="  ", break_on_hyphens=False))


def _print_table(table: TableRecord) -> None:
    print_rows(table["title"], table["headers"], table["rows"])
    if table["note"]:
        print(wrapped(_plain(table["note"]), TEXT_WIDTH))


def _plain(text: str) -> str:
    """Return prose without its marks."""
    return re.sub(r"\*\*(.+?)\*\*|`(.+?)`", lambda match: match[1] or match[2], text)
