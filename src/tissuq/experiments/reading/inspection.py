"""What was understood of a file before anything is fitted, as a text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Unpack

import numpy as np

from tissuq.experiments.numbers import wrapped
from tissuq.experiments.reading.assumptions import is_doubtful
from tissuq.experiments.reading.axial_stretch import is_axial_displacement, is_of_length, stretches_held
from tissuq.experiments.reading.experiment_file import Reading, read_file
from tissuq.experiments.reading.findings import data_warnings
from tissuq.experiments.reading.measured_rows import labelled
from tissuq.experiments.reading.options import PythonOptions
from tissuq.experiments.reading.python_form import in_python, refusals_in_python
from tissuq.experiments.reading.table import Column
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH, SPREADS
from tissuq.experiments.units import stress_unit
from tissuq.result_warning import merged

MIN_TRIPLES = 30
"""Number of triples of neighbouring measurements from which their scatter shows the noise."""
MAX_CYCLES_SHOWN = 12
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "vertical bars", " ": "blanks"}
LABEL_WIDTH, TEXT_WIDTH = 10, 110
"""Characters of the column of labels, and of a line."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was understood of a file; printed, it is what ``tissuq inspect`` shows.

    Parameters
    ----------
    reading : Reading
        The experiment and what was done on the way to it.
    worded : callable
        How notes are worded: as they are, or in Python's terms.
    """

    reading: Reading
    worded: Callable[[str], str] = str

    @property
    def line(self) -> str:
        """What was understood, in one line: name, loading mode, rows, stretches and stresses."""
        experiment = self.reading.experiment
        name = f"{experiment.name}: {experiment.mode.name} ({self.reading.mode_source})"
        spans = "; ".join(
            f"{f'{label}: ' * bool(label)}{self.control} {stretch}, stress {stress}"
            for label, stretch, stress in self._spans()
        )
        return f"{name}, {len(self.reading.used)} rows, {spans}"

    @property
    def control(self) -> str:
        """What the measured stresses are along: stretch, or amount of shear."""
        name = self.reading.experiment.mode.abscissa_control.name
        return "stretch" if "stretch" in name else name

    @cached_property
    def noise_sds(self) -> tuple[float | None, ...]:
        """The noise of each stress of the loading mode, MPa; None where the measurements do not show it."""
        used = self.reading.used
        return tuple(noise_between_neighbours(used.course, stress) for stress in used.stress)

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
        return tuple(map(self.worded, data_warnings(self.reading)))

    def __str__(self) -> str:
        doubts = [text for text in self.warnings if is_doubtful(text)]
        notes = [text for text in self.warnings if text not in doubts]
        lines = [*(_wrapped("ATTENTION", text) for text in doubts), *[""] * bool(doubts)]
        lines += [f"{self.reading.table.file}: what was understood", ""]
        lines += [_wrapped(label, text) for label, text in self._rows()]
        lines += ["", *(_wrapped(f"step {number}", text) for number, text in enumerate(self.steps, start=1))]
        if len(self.reading.cycles) > 1:
            lines += ["", *self._cycle_table()]
        return "\n".join([*lines, *[""] * bool(notes), *(_wrapped("Note", text) for text in notes)])

    def _rows(self) -> Iterator[tuple[str, str]]:
        table, used = self.reading.table, self.reading.used
        head = f"{len(table.head)} lines above them" if len(table.head) != 1 else "1 line above them"
        cells = f", separated by {SEPARATORS[table.separator]}; rows in {table.span}, {head}"
        spans_of_rows = f"; {table.span}, counted from {int(table.counted != 'row')}"
        yield "table", f"{len(table.names)} columns{cells if table.counted == 'line' else spans_of_rows}"
        yield "columns", ", ".join(self._columns())
        dropped = filter(None, labelled(used.labels, used.reasons))
        yield "rows", "; ".join([f"{len(used)} of {len(table.rows)} used", *dropped])
        yield "mode", f"{self.reading.experiment.mode.name} ({self.reading.mode_source})"
        labels = {name: getattr(self.reading.experiment, name) for name in ("specimen", "direction", "condition")}
        if any(labels.values()):
            yield "test", ", ".join(f"{name} {label}" for name, label in labels.items() if label)
        labels_of_spans, stretches, stresses = zip(*self._spans(), strict=True)
        repeated = len(used) - len(np.unique(self.reading.experiment.stretch, axis=0))
        again = f"; rows at a repeated {self.control}: {repeated}" if repeated else ""
        axial, is_hoop_alone = used.axial_stretch, len(used.labels) == 1
        held = "" if axial is None or not is_hoop_alone else f" (hoop), axial stretch {stretches_held(axial)}"
        yield self.control.split()[-1], f"{'; '.join(labelled(labels_of_spans, stretches))}{held}{again}"
        yield "stress", f"{'; '.join(labelled(labels_of_spans, stresses))} (engineering stress, tension positive)"
        if used.standard_error.any():
            pairs = zip(used.standard_error, used.stress, strict=True)
            shares = [float(np.sqrt((error**2).mean() / (stress**2).mean())) for error, stress in pairs]
            words = [f"{share:.2g} of the stress" if share else "" for share in shares]
            yield "error", f"{'; '.join(labelled(used.labels, words))} (standard error of the mean)"
        noise = [self._noise(sd, stress) for sd, stress in zip(self.noise_sds, used.stress, strict=True)]
        yield "noise", "; ".join(labelled(used.labels, noise))

    def _spans(self) -> Iterator[tuple[str, str, str]]:
        """Yield of every stress what it is along, where there are several, and the ranges of stretch and stress."""
        used, unit = self.reading.used, stress_unit(self.reading.experiment.stress_unit)
        for label, stretch, stress in zip(used.labels, used.stretch, used.stress, strict=True):
            low, high = stress.min() / unit.to_mpa, stress.max() / unit.to_mpa
            spans = f"{stretch.min():.6g} to {stretch.max():.6g}", f"{low:.6g} to {high:.6g} {unit.name}"
            yield label, *spans

    def _columns(self) -> Iterator[str]:
        table = self.reading.table
        has_several_controls = len(self.reading.experiment.mode.controls) > 1
        roles = {}
        for spread in self.reading.spreads:
            if spread.column is not None and not spread.problem:
                roles[spread.column] = f"{SPREADS[spread.kind]} of the stress"
        for label, choice in zip(self.reading.used.labels, self.reading.choices, strict=True):
            suffix = f" of {label}" if label else ""
            measure = _typed(choice.stress_type) if choice.load == "stress" else ""
            roles[choice.stress] = f"{measure}{choice.load.replace('_', ' ')}{suffix}"
            if choice.measure != ROLE_OF_AXIAL_STRETCH:
                roles[choice.deformation] = (
                    _typed(choice.strain_type) + choice.measure.replace("_", " ") + suffix * has_several_controls
                )
        if (column := self.reading.axial_column) is not None:
            what = "axial displacement" if is_axial_displacement(table, column) else "length"
            roles[column] = f"{what} of the tube" if is_of_length(table, column) else "axial stretch"
        for column in range(len(table.names)):
            if self.reading.mode_source == f"column {table.label(column)}":
                roles[column] = "loading mode"
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
        cycles, stretch, lines = self.reading.cycles, self.reading.recorded.course, self.reading.table.lines
        mean = "mean " * (len(self.reading.used.stretch) > 1)
        yield f"{f'cycle     {self.reading.table.counted}s':<{29 - len(mean)}}{mean}stretch: from   turning at   to"
        for number, cycle in list(enumerate(cycles, start=1))[:MAX_CYCLES_SHOWN]:
            rows = cycle.rows()
            ends = (stretch[row] for row in (rows[0], cycle.peak, rows[-1]))
            label = "" if cycle.label == str(number) else cycle.label
            span = f"{lines[rows[0]]} to {lines[rows[-1]]}"
            yield f"{number:<9} {span:<18}" + "".join(f"{end:>13.4f}" for end in ends) + f"  {label}".rstrip()
        if len(cycles) > MAX_CYCLES_SHOWN:
            yield f"... {len(cycles)} cycles in all"


def inspect(path: Any, **options: Unpack[PythonOptions]) -> Inspection:
    """Return what would be understood of a file or a table, with the options of :func:`tissuq.read`, before a fit.

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
    with refusals_in_python(path):
        reading = read_file(path, **options)
        return Inspection(reading, partial(in_python, stress_unit=reading.experiment.stress_unit))


def lines_of_tests(inspections: Sequence[Inspection]) -> list[str]:
    """Return what was understood of each of several tests, in a numbered line, wrapped."""
    return [_wrapped(f"test {number}", inspection.line) for number, inspection in enumerate(inspections, start=1)]


def overview(inspections: Sequence[Inspection]) -> str:
    """Return what was understood of several tests: a line of each, and the warnings of all."""
    of_tests = {f"test {number}": data_warnings(test.reading) for number, test in enumerate(inspections, start=1)}
    lines = [f"{len(inspections)} tests were understood", "", *lines_of_tests(inspections)]
    for text in merged(of_tests, named=True, everyone="all tests"):
        lines += ["", _wrapped("Note", text)]
    return "\n".join([*lines, "", "To see one of them: tissuq inspect 'FILE#NAME', with its name or number."])


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


def _typed(measure: str) -> str:
    """Return the name of a measure of strain or stress before what it is of; nothing of the engineering one."""
    return "" if measure == "engineering" else f"{measure} "


def _wrapped(label: str, text: str) -> str:
    return wrapped(f"{label:<{LABEL_WIDTH}}{text}", TEXT_WIDTH, subsequent_indent=" " * LABEL_WIDTH)
