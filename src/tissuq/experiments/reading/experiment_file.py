"""From a laboratory's file to an experiment, with one stress or several, in steps of which each leaves a sentence."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import InflatedTube, Uniaxial
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.assumptions import assumptions
from tissuq.experiments.reading.axial_stretch import column_of_axial_stretch
from tissuq.experiments.reading.columns import choose_columns
from tissuq.experiments.reading.conversion import (
    as_columns,
    measured_rows,
    points_of,
    stress_measure_of,
    with_engineering_stress,
)
from tissuq.experiments.reading.data_frame import is_data_frame
from tissuq.experiments.reading.measured_rows import Cycle, MeasuredRows, find_cycles
from tissuq.experiments.reading.options import PythonOptions, ReadingOptions, checked_mode, spelled_out
from tissuq.experiments.reading.plausibility import check_stretches, volume_step
from tissuq.experiments.reading.recognition import ColumnChoice, adding
from tissuq.experiments.reading.regions import AUTO, TestedStress, least_errors, tested_stresses
from tissuq.experiments.reading.rows_of_tests import (
    SeveralSpecimens,
    columns_only,
    labels_of,
    only_rows,
    other_label,
    specimen_of,
)
from tissuq.experiments.reading.signs import check_signs, with_signs
from tissuq.experiments.reading.spread import Spread
from tissuq.experiments.reading.stated_mode import (
    DEFAULT_SOURCE,
    about_mode,
    check_not_inflated,
    check_not_sheared,
    comment_on_mode,
    direction_of,
    mode_of,
)
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.tables import read_table
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH


@dataclass(frozen=True, eq=False)
class Reading:
    """A file, the experiment that was read from it, and what was done on the way to its stresses.

    Parameters
    ----------
    experiment : Experiment
    table : Table
        All rows of the file.
    choices : tuple of ColumnChoice
        The columns that were read for each stress.
    recorded : MeasuredRows
        All rows as stretch and stress, before any was dropped or stretch counted from a preload.
    used : MeasuredRows
        The rows of the experiment, and the steps that led to it.
    cycles : tuple of Cycle
        Of the recorded rows.
    warnings : tuple of str
        What was left out or taken for what, such as rows without values.
    tested : tuple of TestedStress
        Each stress of these rows.
    mode_source : str
        Where the loading mode comes from.
    spreads : tuple of Spread
        Standard errors of each stress, where it is the mean of several specimens.
    doubts : tuple of str
        What was assumed, and where sizes as given differ from those in the file.
    axial_column : int, optional
        The column of the axial stretch of a tube, where it is read.
    """

    experiment: Experiment
    table: Table
    choices: tuple[ColumnChoice, ...]
    recorded: MeasuredRows
    used: MeasuredRows
    cycles: tuple[Cycle, ...]
    warnings: tuple[str, ...]
    tested: tuple[TestedStress, ...]
    mode_source: str = ""
    spreads: tuple[Spread, ...] = ()
    doubts: tuple[str, ...] = ()
    axial_column: int | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """Doubts, and what was left out."""
        return *self.doubts, *self.warnings

    @property
    def used_cycles(self) -> Sequence[Cycle]:
        """The cycles of the rows of the experiment."""
        return self.tested[0].cycles


def read_file(path: Any, **options: Unpack[PythonOptions]) -> Reading:
    """Read a file as `tissuq.read` does, and keep what was done on the way."""
    plain = spelled_out(options)
    if (mode := plain.get("mode")) is not None:
        checked_mode(mode, plain)
    table = read_table(path, **plain)
    rows = only_rows(table, columns_only(table, plain.get("only")))
    reading = read_rows(rows, table.file if is_data_frame(path) else path, **plain)
    if refusal := other_label(table, reading.experiment, plain.get("only")):
        raise InputError(refusal)
    return reading


def read_rows(
    table: Table, path: str | os.PathLike[str], words: Sequence[str] = (), /, **options: Unpack[ReadingOptions]
) -> Reading:
    """Return what `read_file` does for the rows of a file that have been found already, all of them or some.

    ``words`` are further names of the test, which may say its loading mode.
    """
    stated, mode_source = mode_of(path, table, options, words)
    mode = checked_mode(stated, options)
    name = options.get("name")
    with about_mode(mode.name, mode_source):
        labelled_choices = choose_columns(table, mode, options)
    choices = tuple(labelled_choices.values())
    if mode_source == DEFAULT_SOURCE and choices[0].load == "stress":
        if choices[0].measure == "strain":
            check_not_sheared(table)
        check_not_inflated(table, choices[0].stress)
    has_axial_stretch = isinstance(mode, InflatedTube) or choices[-1].measure == ROLE_OF_AXIAL_STRETCH
    axial_column = column_of_axial_stretch(table, options) if has_axial_stretch else None
    absent = set[int]()
    try:
        measured, loads, spreads, dimensions = measured_rows(table, mode, labelled_choices, options)
    except SeveralSpecimens:
        raise
    except InputError:
        columns = list(dict.fromkeys(column for choice in choices for column in (choice.deformation, choice.stress)))
        columns += [] if axial_column is None else [axial_column]
        readable = table.without_faulty(columns, options.get("leave_out")).without_missing(columns)
        if readable is table:
            raise
        absent, table = set(table.lines) - set(readable.lines), readable
        measured, loads, spreads, dimensions = measured_rows(table, mode, labelled_choices, options)
    names = Path(path).stem, comment_on_mode(Path(path)), table.sheet, table.title, name or ""
    direction = direction_of(*(text for _, text in table.head), *names)
    shape = dimensions.broad_in_words if mode == Uniaxial() else ""
    recorded = with_signs(measured, choices, options, direction, shape)
    reference, shown, errors = mode.controls[0].reference, loads[0].unit, dict[str, float]()
    cycles = find_cycles(table, recorded.course, reference)
    branch, lines = options.get("branch"), options.get("leave_out")
    used, begun = (
        rows if lines is None else rows.without_lines(lines, absent)
        for rows in (
            recorded.of_cycle(cycles, options.get("cycle"), which)
            for which in (branch, None if branch == "unloading" else branch)  # load begins on the way there
        )
    )
    if (preload := options.get("preload")) == AUTO:
        slacks = [tested.slack for tested in tested_stresses(begun, mode, shown)]
        used = used.loaded(slacks, reference)
        sds = [slack.sd / (slack.stretch if reference else 1.0) for slack in slacks if slack]
        errors = {"slack": max(sds)} if sds else errors
    elif preload is not None:
        thresholds = [load.stress_in(preload) for load in loads]
        used = used.taut(preload, thresholds, begun, reference, shown)
    if (stretch_range := options.get("stretch_range")) is not None:
        used = used.within(*stretch_range)
    if options.get("until_peak"):
        used = used.until_peak()
    if options.get("relaxed"):
        used = used.relaxed()
    check_stretches(used, choices)
    stress_measure, doubt = loads[0].measure or stress_measure_of(table, choices), ""
    if stress_measure.engineering:
        of_file = recorded.stretch[:, used.rows] if stress_measure.is_of_file else used.stretch
        doubt = stress_measure.doubt(points_of(mode, used, of_file), used.stress)
        recorded, used = (
            with_engineering_stress(mode, stress_measure, measured, points_of(mode, measured, stretch))
            for measured, stretch in ((recorded, recorded.stretch), (used, of_file))
        )
        if mode.controls != (SHEAR,) or stress_measure.name != "cauchy":
            used = used.with_step(stress_measure.step)
    if (step := options.get("every", 1)) > 1:
        rows = np.arange(0, len(used), step)
        used = used.kept(rows, f"one row in {step} asked for").with_step(f"one row in {step}")
    turn = options.get("turn")
    with adding(f"Signs are turned as asked, --turn {turn}: turn others, or leave it out." if turn else ""):
        check_signs(used, choices, options, shown)
    if mode.along_axis_1 == Uniaxial() and (volume := volume_step(used, is_taken=bool(options.get("incompressible")))):
        used = used.with_step(volume)
    used = used.with_step(f"{len(used)} rows ({used.table.span})")
    sheet, tested = table.file.removeprefix(str(path)), tested_stresses(used, mode, shown)
    experiment = Experiment(
        mode=mode,
        stretch=points_of(mode, used),
        stress=as_columns(used.stress),
        standard_error=as_columns(used.standard_error),
        name=Path(path).stem if name is None else name,
        source=f"{Path(path).name}{sheet}: {'; '.join(used.steps)}",
        least_errors=errors | least_errors(tested),
    ).labelled(
        stress_unit=shown.name, specimen=specimen_of(used.table), apart=step, **labels_of(used.table, [*names, *words])
    )
    problems = (spread.problem for spread in spreads if spread.problem)
    doubts = *assumptions(used, choices, options), *dimensions.averages, *dimensions.contradictions
    about_loads = filter(None, (doubt, *(load.note for load in loads)))
    notes = *table.notes, *problems, *about_loads
    return Reading(
        experiment,
        table,
        choices,
        recorded,
        used,
        tuple(cycles),
        notes,
        tested,
        mode_source,
        spreads,
        doubts,
        axial_column,
    )
