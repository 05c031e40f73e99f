"""`Result`: what a command has to say, from which `write_result` makes the run folder and `print_result` the terminal.

A study becomes a result by one function, such as `design_result`, and is then written, printed and shown the same way::

    result = design_result(study, recipe, run)
    with run_folder(target, "design") as folder:
        write_result(result, folder, figures=figures)    # tables, figures, run.toml, result.json, report.html
    print_result(result.record(), target)                # what `tissuq show target` prints, too

The answer comes first: `Number`s with their intervals, a finding in a sentence or two, uses with their verdicts, one
next step, one `Picture`. Then warnings, the tables, and sections that a page folds. Prose knows ``**strong**`` and
`` `code` ``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isnan
from typing import TYPE_CHECKING, Any, Self, TypeAlias, TypedDict

from tissuq.assessment.uses import Use, Verdict
from tissuq.report.tables import interval, known_number, significant
from tissuq.result_warning import Severity, most_severe_first

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pydantic import BaseModel

RESULT = "result.json"
"""The file with the record of a result."""
MAX_NUMBERS = 3
"""Numbers of one kind in an answer; tables have all."""
MAX_PLAIN = 1e6
"""Size of a number, or of an end of its interval, from which it is given to three digits."""
MAX_SHOWN = 3
"""Warnings that are shown at once, unless more are problems; the others are counted and folded."""


class NumberRecord(TypedDict):
    """A number in result.json."""

    name: str
    value: float | str | None
    low: float | None
    high: float | None
    unit: str
    text: str
    remark: str


class TableRecord(TypedDict):
    """A table in result.json."""

    title: str
    headers: list[str]
    rows: list[list[str]]
    note: str


class UseRecord(TypedDict):
    """A use in result.json."""

    purpose: str
    verdict: str
    reason: str


class WarningRecord(TypedDict):
    """A warning in result.json."""

    code: str
    severity: str
    text: str


class SectionRecord(TypedDict):
    """A section in result.json: its sentences, and its tables."""

    title: str
    text: list[str]
    tables: list[TableRecord]


class Record(TypedDict):
    """What stands in result.json: a result without its figures and files."""

    title: str
    subject: str
    numbers: list[NumberRecord]
    finding: str
    uses: list[UseRecord]
    next: str
    warnings: list[WarningRecord]
    tables: list[TableRecord]
    sections: list[SectionRecord]


@dataclass(frozen=True)
class Number:
    """A number to take home, in the user's unit.

    Parameters
    ----------
    name : str
        What it is of.
    value : float or str
        Where it is no number, what stands in its place, such as the name of a test.
    low, high : float, optional
        Ends of its interval, in the same unit.
    unit : str
    interval_is : str
        What the interval is.
    remark : str
        Stands beside a value without an interval.

    Examples
    --------
    >>> number = Number("initial shear modulus", 81.34, 79.02, 83.71, "kPa")
    >>> number.text, number.range
    ('81.3 kPa', '79.0 to 83.7')
    """

    name: str
    value: float | str
    low: float | None = None
    high: float | None = None
    unit: str = ""
    interval_is: str = "95 % interval"
    remark: str = ""

    @property
    def text(self) -> str:
        """The value with its unit, rounded by the width of the interval."""
        if isinstance(self.value, str):
            return self.value
        if isnan(self.value):
            return "not known"
        spread, ends = self._spread, (self.value, self.low or 0.0, self.high or 0.0)
        largest = max(ends, key=abs)  # value and interval are written alike
        rounded = interval(self.value, largest, spread)[0] if spread else significant(self.value)
        return f"{rounded} {self.unit}".strip()

    @property
    def range(self) -> str:
        """The ends of the interval, or nothing."""
        if self.low is None or self.high is None or isnan(self.low + self.high):
            return ""
        spread = self._spread
        ends = interval(self.low, self.high, spread) if spread else (significant(self.low), significant(self.high))
        return " to ".join(ends)

    @property
    def _spread(self) -> float:
        """The width that says how many digits count; zero where there is none, or where few digits can be read."""
        if self.low is None or self.high is None:
            return 0.0
        largest = max(abs(number) for number in (self.value, self.low, self.high) if not isinstance(number, str))
        return (self.high - self.low) / 4 if largest < MAX_PLAIN else 0.0

    @property
    def beside(self) -> str:
        """What stands beside the value."""
        return f"{self.interval_is} {self.range}" if self.range else self.remark

    def record(self) -> NumberRecord:
        """Return it as it goes into a file."""
        value = self.value if isinstance(self.value, str) else known_number(self.value)
        low, high = (None if end is None else known_number(end) for end in (self.low, self.high))
        return {"name": self.name, "value": value, "low": low, "high": high, "unit": self.unit, "text": self.text,
                "remark": self.beside}  # fmt: skip


@dataclass(frozen=True)
class Table:
    """A table for people: cells are text.

    Parameters
    ----------
    headers : sequence of str
    rows : sequence of sequence of str
    title : str
    text_columns : tuple of int
        Columns that are read, not compared; the first is one in any case.
    note : str
        Stands beneath.
    main : str
        First cell of the row that the answer is of.
    picture : Picture, optional
        Shows the same; a page has it above the table.
    """

    headers: list[str]
    rows: list[list[str]]
    title: str = ""
    text_columns: tuple[int, ...] = ()
    note: str = ""
    main: str = ""
    picture: Picture | None = None

    kind = "table"

    @classmethod
    def of(cls, rows: Iterable[Any], columns: Mapping[str, Callable[[Any], str]], title: str = "", **more: Any) -> Self:
        """Return the table of rows whose cells are made of each by the columns, which are given by their heads."""
        return cls(list(columns), [[cell(row) for cell in columns.values()] for row in rows], title, **more)

    def record(self) -> TableRecord:
        """Return it as it goes into a file."""
        rows = [list(map(str, row)) for row in self.rows]
        return {"title": self.title, "headers": list(self.headers), "rows": rows, "note": self.note}


@dataclass(frozen=True)
class Picture:
    """A figure with its name in the run folder, words for those who cannot see it, and what it shows.

    Parameters
    ----------
    name : str
    figure : Figure, or function without arguments
        A function draws it only where it is wanted.
    alt, caption : str
    is_slim : bool
        Whether a page shows it narrower than its text.
    chart : function without arguments, optional
        Returns the data of the interactive chart (`chart_data`) that stands in its place where scripts run.
    """

    name: str
    figure: Figure | Callable[[], Figure]
    alt: str
    caption: str
    is_slim: bool = False
    chart: Callable[[], dict[str, Any]] | None = None

    kind = "picture"

    def drawn(self) -> Figure:
        """Return the figure."""
        return self.figure() if callable(self.figure) else self.figure


@dataclass(frozen=True)
class Preformatted:
    """Text of a program, such as a difference of files."""

    text: str

    kind = "preformatted"


@dataclass(frozen=True)
class Section:
    """What a page folds under a title: paragraphs, lists (tuples of sentences), tables, pictures, further sections."""

    title: str
    blocks: tuple[Block, ...]

    kind = "section"

    def record(self) -> SectionRecord:
        """Return title, sentences and tables, those of sections within it among them."""
        record: SectionRecord = {"title": self.title, "text": [], "tables": []}
        for block in self.blocks:
            if isinstance(block, str):
                record["text"].append(block)
            elif isinstance(block, tuple):
                record["text"] += block
            elif isinstance(block, Table):
                record["tables"].append(block.record())
            elif isinstance(block, Section):
                inner = block.record()
                record["text"] += [block.title, *inner["text"]]
                record["tables"] += inner["tables"]
        return record


Block: TypeAlias = "str | tuple[str, ...] | Table | Picture | Preformatted | Section"
"""What stands in a section; a tuple is a list of sentences."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a command has to say, whole: for page, terminal, files and programs.

    Parameters
    ----------
    command : str
        What repeats it, without ``tissuq`` and ``--config``.
    title : str
    subject : str
        What it is about, in a line: data, material, sizes.
    numbers : tuple of Number
        To take home; the first is the headline.
    finding : str
        What they say, in a sentence or two.
    uses : tuple of Use
        For what it can be used, and why.
    next_step : str
        The one thing to do next, as typed in a shell; ``{run}`` stands for the folder.
    picture : Picture, optional
        Stands beside the answer, and is to be read on a screen of 400 px.
    tables : tuple of Table
        Printed in the terminal, and unfolded on the page.
    sections : tuple of Section
    warnings : tuple of str
        `ResultWarning`s, or plain sentences, which are cautions.
    files : mapping of str to object
        By name in the run folder: rows (``.csv``, ``.json``), a table of pandas without its index, text, bytes, a file
        to copy, or a function of the path.
    recipe : BaseModel, optional
        The settings for run.toml, where it is not written yet; ``without`` those of no meaning.
    how_to_repeat : str
        Instead of the recipe's command, where there is none.
    """

    command: str
    title: str
    subject: str
    numbers: tuple[Number, ...] = ()
    finding: str = ""
    uses: tuple[Use, ...] = ()
    next_step: str = ""
    picture: Picture | None = None
    tables: tuple[Table, ...] = ()
    sections: tuple[Section, ...] = ()
    warnings: tuple[str, ...] = ()
    files: Mapping[str, Any] = field(default_factory=dict)
    recipe: BaseModel | None = None
    without: frozenset[str] = frozenset()
    how_to_repeat: str = ""

    @property
    def pictures(self) -> Iterator[Picture]:
        """All figures, that beside the answer first."""
        if self.picture is not None:
            yield self.picture
        yield from _pictures_of((*self.tables, *self.sections))

    def record(self) -> Record:
        """Return everything but figures and files as it stands in result.json, with warnings in the form of a shell."""
        warnings = most_severe_first(self.warnings)
        return {
            "title": self.title,
            "subject": self.subject,
            "numbers": [number.record() for number in self.numbers],
            "finding": self.finding,
            "uses": [{"purpose": use.purpose, "verdict": str(use.verdict), "reason": use.reason} for use in self.uses],
            "next": self.next_step,
            "warnings": [{"code": w.code, "severity": str(w.severity), "text": w.shell} for w in warnings],
            "tables": [table.record() for table in self.tables],
            "sections": [section.record() for section in self.sections],
        }


def few_and_others(record: Record) -> tuple[list[WarningRecord], list[WarningRecord]]:
    """Return the warnings of a record to show at once, problems in any case, and the others; in order of severity.

    Notes are folded, unless the first use is in doubt: then one of them may say why.
    """
    warnings, uses = record["warnings"], record["uses"]
    severities = [warning["severity"] for warning in warnings]
    is_in_doubt = bool(uses) and uses[0]["verdict"] != Verdict.YES
    notes = 0 if is_in_doubt else severities.count(Severity.NOTE)
    count = min(max(MAX_SHOWN, severities.count(Severity.PROBLEM)), len(warnings) - notes)
    return warnings[:count], warnings[count:]


def _pictures_of(blocks: tuple[Block, ...]) -> Iterator[Picture]:
    for block in blocks:
        if isinstance(block, Picture):
            yield block
        elif isinstance(block, Table) and block.picture is not None:
            yield block.picture
        elif isinstance(block, Section):
            yield from _pictures_of(block.blocks)
