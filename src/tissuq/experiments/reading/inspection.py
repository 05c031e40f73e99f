"""What was understood of a file before anything is fitted, and what is strange about its measurements."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from textwrap import fill
from typing import Unpack

import numpy as np

from tissuq.experiments.modes import Uniaxial
from tissuq.experiments.modes.mode import STRETCH
from tissuq.experiments.reading.cycles import find_cycles
from tissuq.experiments.reading.experiment_file import Reading, ReadingOptions, read_file
from tissuq.experiments.reading.headings import ROLES, heading, on_axis
from tissuq.experiments.reading.measured_rows import labelled
from tissuq.experiments.reading.plausibility import RATIO_ASSUMED
from tissuq.experiments.reading.positions import ZERO_ASSUMED
from tissuq.experiments.reading.slack import find_slack
from tissuq.experiments.reading.table import Column
from tissuq.experiments.reading.units import stress_unit

__all__ = ["DOUBTFUL_UNIT", "Inspection", "data_warnings", "inspect", "noise_between_neighbours"]

MIN_TRIPLES = 30
"""Number of triples of neighbouring measurements from which their scatter shows the noise."""
MAX_CYCLES_SHOWN = 12
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}
LABEL_WIDTH, TEXT_WIDTH = 10, 110
"""Characters of the column of labels, and of a line."""

DOUBTFUL_UNIT = "check the unit:"
"""How warnings begin that come before all others: a wrong unit is a factor of 100 or 1000."""
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


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was understood of a file; printed, it is what ``tissuq inspect`` shows.

    Parameters
    ----------
    reading : Reading
        The experiment and what was done on the way to it.
    noise_sds : tuple of float or None
        Estimate of the noise of the engineering stress, MPa, of each stress of the loading mode; None where the
        measurements do not show it.
    """

    reading: Reading
    noise_sds: tuple[float | None, ...]

    @property
    def noise_sd(self) -> float | None:
        """The noise of the stress, or the first of two."""
        return self.noise_sds[0]

    @property
    def steps(self) -> tuple[str, ...]:
        """What was done, a sentence a step."""
        return self.reading.used.steps

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should look at before fitting."""
        return data_warnings(self.reading)

    def __str__(self) -> str:
        doubts = [text for text in self.warnings if DOUBTFUL_UNIT in text]
        notes = [text for text in self.warnings if text not in doubts]
        lines = [*(_wrapped("ATTENTION", text) for text in doubts), *[""] * bool(doubts)]
        lines += [f"{self.reading.table.file}: what was understood", ""]
        lines += [_wrapped(label, text) for label, text in self._rows()]
        lines += ["", *(_wrapped(f"step {number}", text) for number, text in enumerate(self.steps, start=1))]
        if len(self.reading.cycles) > 1:
            lines += ["", *self._cycle_table()]
        return "\n".join([*lines, *[""] * bool(notes), *(_wrapped("Note", text) for text in notes)])

    def _rows(self) -> Iterator[tuple[str, str]]:
        table, used, unit = self.reading.table, self.reading.used, stress_unit(self.reading.experiment.stress_unit)
        head = f"{len(table.head)} lines above them" if len(table.head) != 1 else "1 line above them"
        cells = SEPARATORS[table.separator]
        yield "table", f"{len(table.names)} columns, separated by {cells}; rows in lines {_span(table.lines)}, {head}"
        yield "columns", ", ".join(self._columns())
        dropped = filter(None, labelled(used.labels, used.reasons))
        yield "rows", "; ".join([f"{len(used)} of {len(table.rows)} used", *dropped])
        repeated = len(used) - len(np.unique(self.reading.experiment.stretch, axis=0))
        again = f"; {repeated} rows repeat a stretch" if repeated else ""
        spans = labelled(used.labels, [f"{stretch.min():.6g} to {stretch.max():.6g}" for stretch in used.stretch])
        yield "stretch", f"{'; '.join(spans)}{again}"
        ends = [(stress.min() / unit.to_mpa, stress.max() / unit.to_mpa) for stress in used.stress]
        spans = labelled(used.labels, [f"{low:.6g} to {high:.6g} {unit.name}" for low, high in ends])
        yield "stress", f"{'; '.join(spans)} (engineering stress, tension positive)"
        noise = [self._noise(sd, stress) for sd, stress in zip(self.noise_sds, used.stress, strict=True)]
        yield "noise", "; ".join(labelled(used.labels, noise))

    def _columns(self) -> Iterator[str]:
        table = self.reading.table
        has_several_controls = len(self.reading.experiment.mode.controls) > 1
        roles = {}
        for label, choice in zip(self.reading.used.labels, self.reading.choices, strict=True):
            suffix = f" of {label}" if label else ""
            roles[choice.stress] = f"{choice.load}{suffix}"
            roles[choice.deformation] = choice.measure + suffix * has_several_controls
        for column in range(len(table.names)):
            yield f"{table.label(column)} {'is ' + roles[column] if column in roles else 'not read'}"

    def _noise(self, noise_sd: float | None, stress: Column) -> str:
        unit = stress_unit(self.reading.experiment.stress_unit)
        if noise_sd is None:
            return "not told: too few neighbouring measurements"
        if noise_sd == 0:
            return "smaller than the last digit in the file"
        share = noise_sd / float(np.abs(stress).max())
        return (
            f"sd about {noise_sd / unit.to_mpa:.2g} {unit.name} between neighbours, {100 * share:.2g} % of the "
            "largest stress; slow drifts are not in it"
        )

    def _cycle_table(self) -> Iterator[str]:
        cycles, stretch = self.reading.cycles, self.reading.recorded.course
        mean = "mean " * (len(self.reading.experiment.mode.controls) > 1)
        yield f"{'cycle     lines':<{29 - len(mean)}}{mean}stretch: from   turning at   to"
        for number, cycle in list(enumerate(cycles, start=1))[:MAX_CYCLES_SHOWN]:
            rows = cycle.rows()
            ends = (stretch[row] for row in (rows[0], cycle.peak, rows[-1]))
            label = "" if cycle.label == str(number) else cycle.label
            span = _span(self.reading.table.lines[rows[0] : rows[-1] + 1])
            yield f"{number:<9} {span:<18}" + "".join(f"{end:>13.4f}" for end in ends) + f"  {label}".rstrip()
        if len(cycles) > MAX_CYCLES_SHOWN:
            yield f"... {len(cycles)} cycles in all"


def inspect(path: str | os.PathLike[str], **options: Unpack[ReadingOptions]) -> Inspection:
    """Return what would be understood of a file, with the options of :func:`tissuq.read_experiment`, before a fit.

    Raises
    ------
    InputError
        Whenever the file cannot be read as an experiment.

    Examples
    --------
    >>> from tissuq.experiments import datasets
    >>> inspection = inspect(datasets.path("rubber-treloar-uniaxial"))
    >>> print(inspection.steps[0])
    stretch = column 'stretch'
    """
    reading = read_file(path, **options)
    course = reading.used.course
    return Inspection(reading, tuple(noise_between_neighbours(course, stress) for stress in reading.used.stress))


def noise_between_neighbours(stretch: Column, stress: Column) -> float | None:
    """Estimate the standard deviation of independent noise from how measurements stray from their neighbours.

    Each is compared with the line through the ones before and after it, where its stretch lies between theirs
    (Gasser, Sroka & Jennen-Steinmetz, Biometrika 73, 1986); the median makes turning points harmless. The curve itself
    must be straight over three measurements. None where there are fewer than 30 such.
    """
    low, middle, high = stretch[:-2], stretch[1:-1], stretch[2:]
    is_between = (middle - low) * (high - middle) > 0
    if is_between.sum() < MIN_TRIPLES:
        return None
    weight = ((high - middle)[is_between]) / ((high - low)[is_between])
    line = weight * stress[:-2][is_between] + (1 - weight) * stress[2:][is_between]
    residual = (stress[1:-1][is_between] - line) / np.sqrt(1 + weight**2 + (1 - weight) ** 2)
    return float(1.4826 * np.median(np.abs(residual)))


def _span(lines: Sequence[int]) -> str:
    return f"{lines[0]} to {lines[-1]}"


def _wrapped(label: str, text: str) -> str:
    return fill(f"{label:<{LABEL_WIDTH}}{text}", TEXT_WIDTH, subsequent_indent=" " * LABEL_WIDTH)


def data_warnings(reading: Reading) -> tuple[str, ...]:
    """Return what a person should look at before a fit, of each stress."""
    labels = reading.used.labels
    texts = (labelled(labels, [check(reading, number) for number in range(len(labels))]) for check in CHECKS)
    found = [*reading.warnings, *filter(None, chain.from_iterable(texts))]
    return tuple(sorted(found, key=lambda text: DOUBTFUL_UNIT not in text))


def _unit_assumed(reading: Reading, number: int) -> str:
    if "MPa (assumed" not in reading.experiment.source:
        return ""
    return (
        f"{DOUBTFUL_UNIT} the file states no unit of stress, so MPa was assumed; say which it is: --stress-unit kPa, "
        "or --stress-unit MPa."
    )


def _strain_unit_assumed(reading: Reading, number: int) -> str:
    if RATIO_ASSUMED not in reading.experiment.source:
        return ""
    largest = float(np.abs(reading.used.stretch[number] - 1).max())
    return (
        f"{DOUBTFUL_UNIT} the file states no unit of strain, and {largest:g} was taken as {largest:.0%}; say which it "
        "is: --strain-unit % or --strain-unit 1."
    )


def _zero_assumed(reading: Reading, number: int) -> str:
    if ZERO_ASSUMED not in reading.experiment.source:
        return ""
    table, column = reading.table, reading.choices[number].deformation
    name = table.names[column] or str(column + 1)
    return (
        f"column {table.label(column)} does not begin at 0, where there is no load: it was taken for positions, and "
        f"counted from its first row. To say so give --zero first; if it holds displacements, --zero '0 mm'; if it "
        f"holds the length or height of the specimen, --column 'length={name}'."
    )


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
        return f"the measurements begin at {control.name} {stretch[nearest]:.4g}, not near {control.reference:g}."
    at_reference, largest = float(stress[nearest]), float(np.abs(stress).max())
    if abs(at_reference) <= NOTABLE_SHARE * largest:
        return ""
    return (
        f"at {control.name} {stretch[nearest]:.4g} the stress is already {at_reference / unit.to_mpa:.3g} {unit.name}, "
        f"{abs(at_reference) / largest:.0%} of the largest: a preload, or the zero of the load cell. "
        f"A hyperelastic material has no stress at {control.name} {control.reference:g}."
    )


def _slack(reading: Reading, number: int) -> str:
    used, mode = reading.used, reading.experiment.mode
    if any("the preload" in step for step in used.steps):
        return ""
    loading = find_cycles(used.table, used.course)[0].rows("loading")
    slack = find_slack(used.stretch[number][loading], used.stress[number][loading])
    if slack is None:
        return ""
    unit = stress_unit(reading.experiment.stress_unit)
    if len(mode.stresses) == 1 or mode.machine_axes:
        preload = f"{_rounded_up(slack.preload / unit.to_mpa):g} {unit.name}"
        advice = f'to count from where it is taut give --preload "{preload}", which drops these rows.'
    else:
        advice = "count stretches in the file from where it is taut."
    return (
        f"the first {slack.rows} rows carry no load that shows, up to {mode.controls[0].name} {slack.stretch:.4g}: "
        f"slack, or a toe too soft to measure; {advice}"
    )


def _rounded_up(value: float) -> float:
    """Return a positive number with two digits that is not smaller."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(1.02 * value / digit) * digit)


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
    _strain_unit_assumed,
    _zero_assumed,
    _size,
    _stretch_size,
    _cycles,
    _hysteresis,
    _reference,
    _slack,
    _many,
    _other_axis,
)
