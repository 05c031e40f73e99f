"""From a laboratory's file to an experiment, with one stress or several, in steps of which each leaves a sentence."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Unpack, cast

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
from tissuq.experiments.reading.findings import cautions
from tissuq.experiments.reading.measured_rows import Cycle, MeasuredRows, find_cycles
from tissuq.experiments.reading.options import READING_OPTIONS, PythonOptions, ReadingOptions, checked_mode, spelled_out
from tissuq.experiments.reading.plausibility import check_stretches, volume_step
from tissuq.experiments.reading.python_form import in_python, refusals_worded_for
from tissuq.experiments.reading.recognition import ColumnChoice, adding
from tissuq.experiments.reading.regions import (
    AUTO,
    Region,
    TestedStress,
    least_errors,
    regions_of,
    tested_stresses,
)
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

    @cached_property
    def regions(self) -> list[list[Region]]:
        """What happened in the test besides elastic loading, as each stress shows it."""
        return [regions_of(tested) for tested in self.tested]


def read(path: Any, **options: Unpack[PythonOptions]) -> Experiment:
    """Read stretches and stresses from a file (CSV, TSV, columns of numbers, an Excel workbook) or a table in memory.

    Separators, decimal points or commas, encodings, lines above the table, a row of column names, a
    row of units, and columns and dimensions in English or German are recognised. Nothing is guessed where a wrong
    guess would change the numbers.

    Parameters
    ----------
    path : str or path, or table
        The file, or a table in memory: a DataFrame of pandas or polars, a Dataset of xarray, a mapping from names to
        arrays or quantities of pint. Units are those in the names of columns, of quantities, and of the attributes
        ``units`` of xarray.
    stretch, strain, displacement, shear, twist, rate, sliding, stress, torque, force : str or int, optional
        Entries of ``columns``: the name of a column, or its number from 1; those of a second axis end in 2.
    pressure, outer_diameter, inner_diameter, total_force : str or int, optional
        Likewise, of a tube; its axial force is ``force``, or ``total_force`` with that of the pressure on its ends.
    axial_stretch : float, optional
        Of a tube that was stretched along its axis: the length at which it is held over the undeformed one. Without it
        the file's column of that name, the one in ``columns`` under ``axial_stretch``, also of lengths, or what a line
        above the table states.
    length, area, width, thickness, diameter : str, optional
        Entries of ``dimensions``, such as ``"10 mm"``, or quantities of pint.
    unit : str, optional
        In short for ``stress_unit``.
    mode : str or LoadingMode, optional
        How the specimen was loaded. Without it as a comment in the file (``# mode: planar``), its name or its columns
        say: both axes of a biaxial machine, or an amount of shear; else uniaxial.
    columns : mapping, optional
        From ``stretch``, ``strain``, ``displacement``, ``length`` (the current one, or the height), ``shear`` (the
        amount of shear), ``sliding`` (the displacement of one sheared plane, over the height ``length``), ``twist``
        (of a disc), or ``outer_diameter`` or ``inner_diameter`` (of a tube), and ``stress``, ``force``, ``torque`` or
        ``pressure`` (in a tube), to the name of a column or its number from 1. Columns with usual names (with a unit or
        not) need none. The second axis or stress of a loading mode that has two is ``stretch2`` ... ``force2``; columns
        with x and y in their names need none in the mode ``biaxial``.
    stress_unit : str, optional
        Unit of the stresses; without it the file's own, and MPa when the file states none. For a file of forces,
        the unit in which people want to read the stresses, kPa unless given.
    stress_type : str, optional
        ``engineering`` (force over undeformed area); ``cauchy``, which is divided by the stretch (a shear stress is the
        same in both); ``second-piola-kirchhoff``, which is multiplied by the deformation gradient; or ``torsion``, the
        stress 2 T / (pi R^3) that rheometers state for the rim of a disc. Without it what the column's name says, and
        engineering where that says nothing.
    strain_type : str, optional
        ``engineering`` (stretch - 1, or the amount of shear), ``true`` (logarithmic), ``green``, ``almansi``, or
        ``angle`` of shear; otherwise as `stress_type`.
    strain_unit : str, optional
        ``%`` or ``1``, for a column of strains; without it the file's own, and 1 when it states none. ``deg`` or
        ``rad`` for angles of shear.
    force_unit, displacement_unit : str, optional
        Such as ``mN`` and ``um``, for columns of which the file states no unit.
    zero : str, optional
        From which value displacements are counted, such as ``35.2 mm``, or ``first`` for that of the first row: there
        the specimen has its undeformed length. Without it from 0, or from the first row where
        they begin away from 0 with little load.
    mean_of : int, optional
        Of how many specimens the stresses are means; without it the file's column ``n``. Standard errors of the
        experiment come from a column of them (``sem``), or of standard deviations (``sd``) of so many specimens.
    dimensions : mapping, optional
        Of the undeformed specimen, with units: ``length``; ``area``, or ``width`` and ``thickness``, or ``diameter``.
        Without it those that the file states: in the lines above the table, in columns that hold one number, or in a
        table of specimens above it or in another sheet of the workbook. Only displacements and forces need
        them, and a tube its outer ``diameter`` and the ``thickness`` of its wall. In the mode ``biaxial`` length and
        width are the sizes along the first and the second axis, and the width of one axis is the length of the other.
    only : mapping, optional
        From the name of a column to what must stand in it, such as ``{"Specimen": "S1"}``: the only rows to read. A
        table of several specimens is refused without it.
    compression_positive : bool, optional
        Whether the file counts compression as positive: flips stresses at stretches below 1, and strains and
        displacements that are positive, too. Without it compression is negative, and asked about where a name says
        compression, or the specimen is broader than long, and the numbers are positive.
    turn : str, optional
        ``load``, ``deformation`` or ``both``: which signs are changed, as of a load cell that counts tension as
        negative. For all loading modes.
    load_zero : str, optional
        The reading of the load cell without load, which is taken off: a force or stress with its unit, or ``first`` for
        that of the first row.
    cycle : str or int, optional
        ``first``, ``last`` or the number (from 1) of the only cycle to use; all unless given.
    branch : str, optional
        ``loading`` or ``unloading``: the only branch to use.
    compliance : str, optional
        Of the machine, a length over a force such as ``0.5 um/N``: displacements are less by what it gives under load.
    leave_out : str, optional
        Lines of the file whose rows to leave out, such as ``31,45:50``.
    preload : str, optional
        Force or stress with its unit (``0.05 N``, ``1 kPa``) at which the specimen counts as taut: stretches are
        counted from there, and rows that carry less are dropped. Or ``auto``: they are counted from where load begins,
        as far as slack shows, with an uncertainty that becomes one of the ``least_errors``.
    stretch_range : pair of float, optional
        Lowest and highest stretch, or amount of shear, of the rows to use, as counted from the preload.
    until_peak : bool
        Leave out the rows after the largest stress of those that are left: rupture, relaxation, unloading.
    relaxed : bool
        Use the last row of every rest only: of a test in steps, after each of which the stress relaxes.
    incompressible : bool
        Take the volume of a uniaxial test as constant, though a column of lateral strains says that it changes.
    every : int
        Use only every second (2), third (3) ... of these rows.
    axis : str, optional
        ``x`` or ``y``: the only one whose columns to read from the file of a biaxial machine.
    sheet : str or int, optional
        Name or number (from 1) of the sheet of a workbook.
    table : int, optional
        Which of several tables of a text or sheet, from 1.
    name : str, optional
        Name of the experiment; the name of the file without its ending when not given.
    skip_rows : int
        Lines at the top of the file to pass over unseen.

    Returns
    -------
    Experiment
        Stretches (dimensionless) and engineering stresses (MPa) in the order of the file, with a column for each
        axis where the loading mode has two; its ``source``
        tells the file, columns, units and every step. :func:`tissuq.inspect` shows them.

    Warns
    -----
    UserWarning
        Of a unit or a zero of displacements that was assumed, of dimensions that the file states otherwise, of rows
        and columns that cannot be used and are left out, and of what no elastic material does in a test, such as cycles
        that differ, a drift of the load cell, relaxation or a rupture.

    Raises
    ------
    InputError
        When the file, a cell or an option cannot be used, naming the line (of a table in memory its row, counted from
        0) and the column.

    Examples
    --------
    >>> import pandas as pd
    >>> import tissuq as tq
    >>> data = tq.read(tq.datasets.path("rubber-treloar-uniaxial"))
    >>> data.stress_unit, len(data)
    ('MPa', 21)
    >>> frame = pd.DataFrame({"lambda": [1.0, 1.1, 1.2], "P [kPa]": [0.0, 2.5, 5.5], "T [kPa]": [0.0, 2.75, 6.6]})
    >>> tq.read(frame, stress="P [kPa]").stress.tolist()
    [0.0, 0.0025, 0.0055]
    """
    with refusals_worded_for(path):
        reading = read_file(path, **options)
    for text in cautions(reading):
        warnings.warn(in_python(text, reading.experiment.stress_unit), stacklevel=2)
    return reading.experiment


read_experiment = read
"""The earlier name of `read`."""


def read_file(path: Any, **options: Unpack[PythonOptions]) -> Reading:
    """Read a file as :func:`read` does, and keep what was done on the way."""
    plain = cast(ReadingOptions, spelled_out(options, READING_OPTIONS))
    if (mode := plain.get("mode")) is not None:
        checked_mode(mode, plain)
    table = table_of(path, plain)
    rows = only_rows(table, columns_only(table, plain.get("only")))
    reading = read_rows(rows, table.file if is_data_frame(path) else path, **plain)
    if refusal := other_label(table, reading.experiment, plain.get("only")):
        raise InputError(refusal)
    return reading


def table_of(path: Any, options: ReadingOptions) -> Table:
    """Return the table of a file that the options choose."""
    return read_table(path, options.get("skip_rows", 0), options.get("sheet"), options.get("table"))


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
    ).labelled(stress_unit=shown.name, specimen=specimen_of(used.table), **labels_of(used.table, [*names, *words]))
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
