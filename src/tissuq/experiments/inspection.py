"""What was understood of a file before anything is fitted: columns, rows, cycles, ranges, noise, doubts."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.doubts import doubts
from tissuq.experiments.reading import Reading, ReadingOptions, read_file
from tissuq.experiments.units import stress_unit

__all__ = ["Inspection", "inspect", "noise_between_neighbours"]

Column = NDArray[np.float64]

ENOUGH = 30
"""Triples of neighbouring measurements from which their scatter tells the noise."""
CYCLES_SHOWN = 12
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}
LABEL, WIDTH = 10, 110


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was understood of a file; printed, it is what ``tissuq inspect`` shows.

    Parameters
    ----------
    reading : Reading
        The experiment and what was done on the way to it.
    noise_sd : float or None
        Estimate of the noise of the engineering stress, MPa; None where the measurements do not tell it.
    """

    reading: Reading
    noise_sd: float | None

    @property
    def steps(self) -> tuple[str, ...]:
        """What was done, a sentence a step."""
        return self.reading.used.steps

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should look at before fitting."""
        return doubts(self.reading)

    def __str__(self) -> str:
        lines = [f"{self.reading.table.file}: what was understood", ""]
        lines += [_wrapped(label, text) for label, text in self._rows()]
        lines += ["", *(_wrapped(f"step {number}", text) for number, text in enumerate(self.steps, start=1))]
        if len(self.reading.cycles) > 1:
            lines += ["", *self._cycle_table()]
        return "\n".join([*lines, *[""] * bool(self.warnings), *(_wrapped("Note", text) for text in self.warnings)])

    def _rows(self) -> Iterator[tuple[str, str]]:
        table, used, unit = self.reading.table, self.reading.used, stress_unit(self.reading.experiment.stress_unit)
        above = f"{len(table.above)} lines above them" if len(table.above) != 1 else "1 line above them"
        cells = SEPARATORS[table.separator]
        yield "table", f"{len(table.names)} columns, separated by {cells}; rows in lines {_span(table.lines)}, {above}"
        yield "columns", ", ".join(self._columns())
        dropped = "; ".join(f"{each.count} dropped: {each.reason}" for each in used.dropped)
        yield "rows", f"{len(used)} of {len(table.rows)} used" + (f"; {dropped}" if dropped else "")
        repeated = len(used) - len(np.unique(used.stretch))
        again = f"; {repeated} rows repeat a stretch" if repeated else ""
        yield "stretch", f"{used.stretch.min():.6g} to {used.stretch.max():.6g}{again}"
        low, high = used.stress.min() / unit.to_mpa, used.stress.max() / unit.to_mpa
        yield "stress", f"{low:.6g} to {high:.6g} {unit.name} (engineering stress, tension positive)"
        yield "noise", self._noise()

    def _columns(self) -> Iterator[str]:
        table, choice = self.reading.table, self.reading.choice
        taken = {choice.deformation: choice.measure, choice.stress: choice.load}
        for column in range(len(table.names)):
            yield f"{table.label(column)} {'is ' + taken[column] if column in taken else 'not read'}"

    def _noise(self) -> str:
        unit = stress_unit(self.reading.experiment.stress_unit)
        if self.noise_sd is None:
            return "not told: too few neighbouring measurements"
        if self.noise_sd == 0:
            return "smaller than the last digit in the file"
        share = self.noise_sd / float(np.abs(self.reading.used.stress).max())
        return (
            f"sd about {self.noise_sd / unit.to_mpa:.2g} {unit.name} between neighbours, {100 * share:.2g} % of the "
            "largest stress; slow drifts are not in it"
        )

    def _cycle_table(self) -> Iterator[str]:
        cycles, curve = self.reading.cycles, self.reading.recorded
        yield "cycle     lines              stretch: from   turning at   to"
        for number, cycle in list(enumerate(cycles, start=1))[:CYCLES_SHOWN]:
            rows = cycle.rows()
            ends = (curve.stretch[row] for row in (rows[0], cycle.peak, rows[-1]))
            label = "" if cycle.label == str(number) else cycle.label
            span = _span(self.reading.table.lines[rows[0] : rows[-1] + 1])
            yield f"{number:<9} {span:<18}" + "".join(f"{end:>13.4f}" for end in ends) + f"  {label}".rstrip()
        if len(cycles) > CYCLES_SHOWN:
            yield f"... {len(cycles)} cycles in all"


def inspect(path: str | os.PathLike[str], **options: Unpack[ReadingOptions]) -> Inspection:
    """Tell what would be understood of a file, with the options of :func:`tissuq.read_experiment`, before a fit.

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
    used = reading.used
    return Inspection(reading, noise_between_neighbours(used.stretch, used.stress))


def noise_between_neighbours(stretch: Column, stress: Column) -> float | None:
    """Estimate the standard deviation of independent noise from how measurements stray from their neighbours.

    Each is compared with the line through the ones before and after it, where its stretch lies between theirs
    (Gasser, Sroka & Jennen-Steinmetz, Biometrika 73, 1986); the median makes turning points harmless. The curve itself
    must be straight over three measurements. None where there are fewer than 30 such.
    """
    before, at, after = stretch[:-2], stretch[1:-1], stretch[2:]
    between = (at - before) * (after - at) > 0
    if between.sum() < ENOUGH:
        return None
    weight = ((after - at)[between]) / ((after - before)[between])
    line = weight * stress[:-2][between] + (1 - weight) * stress[2:][between]
    residual = (stress[1:-1][between] - line) / np.sqrt(1 + weight**2 + (1 - weight) ** 2)
    return float(1.4826 * np.median(np.abs(residual)))


def _span(lines: Sequence[int]) -> str:
    return f"{lines[0]} to {lines[-1]}"


def _wrapped(label: str, text: str) -> str:
    return fill(f"{label:<{LABEL}}{text}", WIDTH, subsequent_indent=" " * LABEL)
