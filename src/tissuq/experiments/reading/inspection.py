"""What was understood of a file before anything is fitted: columns, rows, cycles, ranges, noise, doubts."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.reading.data_warnings import doubts
from tissuq.experiments.reading.experiment_file import Reading, ReadingOptions, read_file
from tissuq.experiments.reading.table_rows import Curve, course
from tissuq.experiments.reading.two_stresses import told_once
from tissuq.experiments.reading.units import stress_unit

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
    noise_sds : tuple of float or None
        Estimate of the noise of the engineering stress, MPa, of each stress of the loading mode; None where the
        measurements do not tell it.
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
        return tuple(self.reading.steps)

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
        dropped = [
            "; ".join(f"{each.count} dropped: {each.reason}" for each in stress.used.dropped)
            for stress in self.reading.stresses
        ]
        yield "rows", "; ".join([f"{len(used)} of {len(table.rows)} used", *filter(None, self._of_each(dropped))])
        repeated = len(used) - len(np.unique(self.reading.experiment.stretch, axis=0))
        again = f"; {repeated} rows repeat a stretch" if repeated else ""
        curves = [stress.used for stress in self.reading.stresses]
        spans = self._of_each([f"{each.stretch.min():.6g} to {each.stretch.max():.6g}" for each in curves])
        yield "stretch", f"{'; '.join(spans)}{again}"
        ends = [(each.stress.min() / unit.to_mpa, each.stress.max() / unit.to_mpa) for each in curves]
        spans = self._of_each([f"{low:.6g} to {high:.6g} {unit.name}" for low, high in ends])
        yield "stress", f"{'; '.join(spans)} (engineering stress, tension positive)"
        noise = [self._noise(*each) for each in zip(self.noise_sds, curves, strict=True)]
        yield "noise", "; ".join(self._of_each(noise))

    def _of_each(self, texts: Sequence[str]) -> list[str]:
        return told_once([stress.label for stress in self.reading.stresses], texts)

    def _columns(self) -> Iterator[str]:
        table = self.reading.table
        taken = {}
        for each in self.reading.stresses:
            of = f" of {each.label}" if each.label else ""
            taken[each.choice.stress] = f"{each.choice.load}{of}"
            taken[each.choice.deformation] = each.choice.measure + of * (len(self.reading.experiment.mode.controls) > 1)
        for column in range(len(table.names)):
            yield f"{table.label(column)} {'is ' + taken[column] if column in taken else 'not read'}"

    def _noise(self, noise_sd: float | None, curve: Curve) -> str:
        unit = stress_unit(self.reading.experiment.stress_unit)
        if noise_sd is None:
            return "not told: too few neighbouring measurements"
        if noise_sd == 0:
            return "smaller than the last digit in the file"
        share = noise_sd / float(np.abs(curve.stress).max())
        return (
            f"sd about {noise_sd / unit.to_mpa:.2g} {unit.name} between neighbours, {100 * share:.2g} % of the "
            "largest stress; slow drifts are not in it"
        )

    def _cycle_table(self) -> Iterator[str]:
        cycles, stretch = self.reading.cycles, course([each.recorded for each in self.reading.stresses])
        mean = "mean " * (len(self.reading.experiment.mode.controls) > 1)
        yield f"{'cycle     lines':<{29 - len(mean)}}{mean}stretch: from   turning at   to"
        for number, cycle in list(enumerate(cycles, start=1))[:CYCLES_SHOWN]:
            rows = cycle.rows()
            ends = (stretch[row] for row in (rows[0], cycle.peak, rows[-1]))
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
    sds = (noise_between_neighbours(reading.course, each.used.stress) for each in reading.stresses)
    return Inspection(reading, tuple(sds))


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
