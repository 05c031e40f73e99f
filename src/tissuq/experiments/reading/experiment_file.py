"""From a laboratory's file to an experiment, in steps of which each leaves a sentence."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.columns import ColumnChoice
from tissuq.experiments.reading.cycles import Cycle, chosen, find_cycles
from tissuq.experiments.reading.dimensions import Dimensions, dimensions_of
from tissuq.experiments.reading.measures import Load, stress_of, stretch_of
from tissuq.experiments.reading.plausibility import check_shear_signs, check_signs, check_stretch
from tissuq.experiments.reading.signs import with_compression_negative
from tissuq.experiments.reading.slack import preload_stress, taut
from tissuq.experiments.reading.table import Table, read_table
from tissuq.experiments.reading.table_rows import Column, Curve, course
from tissuq.experiments.reading.two_stresses import (
    choose_every,
    dimensions_of_axes,
    of_the_second,
    on_same_rows,
    told_steps,
)

__all__ = ["STRESS_TYPES", "Reading", "ReadingOptions", "read_experiment", "read_file", "read_rows"]

STRESS_TYPES = ("engineering", "cauchy")
AXES = ("x", "y")


class ReadingOptions(TypedDict, total=False):
    """How to read a file where it does not tell by itself: the options of :func:`read_experiment`."""

    mode: str | LoadingMode
    columns: Mapping[str, str | int] | None
    stress_unit: str | None
    stress_type: str
    strain_unit: str | None
    force_unit: str | None
    displacement_unit: str | None
    dimensions: Mapping[str, str] | None
    compression_positive: bool
    cycle: str | int | None
    branch: str | None
    preload: str | None
    every: int
    axis: str | None
    sheet: str | int | None
    name: str | None
    skip_rows: int


@dataclass(frozen=True, eq=False)
class Reading:
    """A file, the experiment that was read from it, and what was done on the way to its stress, or the first of two.

    Parameters
    ----------
    experiment : Experiment
    table : Table
        All rows of the file.
    choice : ColumnChoice
        The columns that were read.
    recorded : Curve
        All rows as stretch and stress, before any was dropped or stretch counted from a preload.
    used : Curve
        The rows of the experiment, and the steps that led to it.
    cycles : tuple of Cycle
        Of the recorded rows.
    warnings : tuple of str
    label : str
        What the stress is called where the mode has two.
    further : tuple of Reading
        The same of the second stress.
    """

    experiment: Experiment
    table: Table
    choice: ColumnChoice
    recorded: Curve
    used: Curve
    cycles: tuple[Cycle, ...]
    warnings: tuple[str, ...]
    label: str = ""
    further: tuple[Reading, ...] = ()

    @property
    def stresses(self) -> tuple[Reading, ...]:
        """What was read of each stress: this, and of the second one."""
        return (self, *self.further)

    @property
    def steps(self) -> list[str]:
        """What was done, a sentence a step."""
        return told_steps([each.label for each in self.stresses], [each.used for each in self.stresses])

    @property
    def course(self) -> Column:
        """What tells how far the test has gone in the rows used: its stretch, or the mean of its stretches."""
        return np.asarray(self.experiment.stretch.reshape(len(self.used), -1).mean(axis=1))


def read_experiment(path: str | os.PathLike[str], **options: Unpack[ReadingOptions]) -> Experiment:
    """Read stretches and stresses from a file: CSV, TSV, columns of numbers, or an Excel workbook.

    Separators, decimal points or commas, encodings, lines above the table, a row of column names, a
    row of units, and columns and dimensions in English or German are recognised. Nothing is guessed where a wrong
    guess would change the numbers.

    Parameters
    ----------
    path : str or path
        The file.
    mode : str or LoadingMode
        How the specimen was loaded; uniaxial unless given.
    columns : mapping, optional
        From ``stretch``, ``strain``, ``displacement`` or ``shear`` (the amount of shear), and ``stress`` or ``force``,
        to the name of a column or its number from 1. Columns with usual names (with a unit or not) need none. The
        second axis or stress of a loading mode that has two is ``stretch2`` ... ``force2``; columns with x and y in
        their names need none in the mode ``biaxial``.
    stress_unit : str, optional
        Unit of the stresses; without it the file's own, and MPa when the file states none. For a file of forces,
        the unit in which people want to read the stresses, kPa unless given.
    stress_type : str
        ``engineering`` (force over undeformed area) or ``cauchy``, which is divided by the stretch; a shear
        stress is the same in both.
    strain_unit : str, optional
        ``%`` or ``1``, for a column of strains; without it the file's own, and 1 when it states none.
    force_unit, displacement_unit : str, optional
        Such as ``mN`` and ``um``, for columns of which the file states no unit.
    dimensions : mapping, optional
        Of the undeformed specimen, with units: ``length``; ``area``, or ``width`` and ``thickness``, or ``diameter``.
        Without it those in the lines above the table. Only displacements and forces need them. In the mode
        ``biaxial`` length and width are the sizes along the first and the second axis, and the width of one axis is
        the length of the other.
    compression_positive : bool
        Whether the file counts compression as positive: flips stresses at stretches below 1, and strains and
        displacements that are positive, too.
    cycle : str or int, optional
        ``first``, ``last`` or the number (from 1) of the only cycle to use; all unless given.
    branch : str, optional
        ``loading`` or ``unloading``: the only branch to use.
    preload : str, optional
        Force or stress with its unit (``0.05 N``, ``1 kPa``) at which the specimen counts as taut: stretches are
        counted from there, and rows that carry less are dropped.
    every : int
        Use only every second (2), third (3) ... of these rows.
    axis : str, optional
        ``x`` or ``y``: the only one whose columns to read from the file of a biaxial machine.
    sheet : str or int, optional
        Name or number (from 1) of the sheet of an Excel workbook.
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

    Raises
    ------
    InputError
        When the file, a cell or an option cannot be used, naming the line and the column.

    Examples
    --------
    >>> from tissuq.experiments import datasets
    >>> data = read_experiment(datasets.path("rubber-treloar-uniaxial"))
    >>> data.stress_unit, len(data)
    ('MPa', 21)
    """
    return read_file(path, **options).experiment


def read_file(path: str | os.PathLike[str], **options: Unpack[ReadingOptions]) -> Reading:
    """Read a file as :func:`read_experiment` does, and keep what was done on the way."""
    _checked_mode(**options)
    table = read_table(path, options.get("skip_rows", 0), options.get("sheet"))
    return read_rows(table, path, **options)


def read_rows(table: Table, path: str | os.PathLike[str], **options: Unpack[ReadingOptions]) -> Reading:
    """Return what `read_file` does for the rows of a file that have been found already, all of them or some."""
    mode = _checked_mode(**options)
    stress_type, every, name = options.get("stress_type", "engineering"), options.get("every", 1), options.get("name")
    is_positive = options.get("compression_positive", False)
    found = choose_every(table, mode, options.get("columns"), stress_type, options.get("axis"))
    labels, choices = list(found), list(found.values())
    dimensions = dimensions_of(table, options.get("dimensions"))
    curves, loads = _measured(table, mode, found, dimensions, options)
    curves = [with_compression_negative(*each, is_positive) for each in zip(curves, choices, strict=True)]
    recorded, cycles = curves, find_cycles(table, course(curves))
    curves = [chosen(curve, cycles, options.get("cycle"), options.get("branch")) for curve in curves]
    if (preload := options.get("preload")) is not None:
        peak = find_cycles(curves[0].table, course(curves))[0].peak
        thresholds = [preload_stress(preload, load.area) for load in loads]
        pairs = zip(curves, thresholds, strict=True)
        curves = [taut(curve, preload, threshold, peak) for curve, threshold in pairs]
        curves = on_same_rows(curves, f"carrying less than {preload} on the other axis")
    is_shear = mode.controls == (SHEAR,)
    if not is_shear:
        for choice, curve in zip(choices, curves, strict=True):
            check_stretch(curve.table, choice, curve.stretch)
    if stress_type == "cauchy" and not is_shear:
        recorded = _from_cauchy(mode, recorded)
        curves = [
            each.told("Cauchy stress divided by stretch to engineering stress") for each in _from_cauchy(mode, curves)
        ]
    if every > 1:
        kept = np.arange(0, len(curves[0]), every)
        curves = [curve.kept(kept, f"one row in {every} asked for").told(f"one row in {every}") for curve in curves]
    if is_shear:
        check_shear_signs(curves[0].table, choices[0], curves[0].stretch, curves[0].stress)
    else:
        _check_signs(curves, choices, is_positive)
    lines = curves[0].table.lines
    curves = [curve.told(f"{len(curve)} rows (lines {lines[0]} to {lines[-1]})") for curve in curves]
    steps = told_steps(labels, curves)
    sheet = table.file.removeprefix(str(path))
    experiment = Experiment(
        mode=mode,
        stretch=_points(mode, curves),
        stress=np.stack([curve.stress for curve in curves], axis=-1) if len(curves) > 1 else curves[0].stress,
        name=Path(path).stem if name is None else name,
        source=f"{Path(path).name}{sheet}: {'; '.join(steps)}",
        stress_unit=loads[0].unit.name,
    )
    first, *further = (
        Reading(experiment, table, choice, before, curve, tuple(cycles), dimensions.warnings, label)
        for label, choice, before, curve in zip(labels, choices, recorded, curves, strict=True)
    )
    return replace(first, further=tuple(further))


def _checked_mode(**options: Unpack[ReadingOptions]) -> LoadingMode:
    """Return the loading mode, once the options have been looked at that need no file."""
    mode, stress_type = loading_mode(options.get("mode", "uniaxial")), options.get("stress_type", "engineering")
    axis, every = options.get("axis"), options.get("every", 1)
    if len(mode.stresses) > 2 or len(mode.controls) > len(mode.stresses):
        raise InputError(
            f"a file is read in loading modes with one stress or two, and '{mode.name}' has "
            f"{', '.join(mode.stresses)}: give its values to Experiment."
        )
    if len(mode.stresses) > 1 and options.get("compression_positive"):
        raise InputError(
            f"compression_positive=True (--compression-positive) is for loading modes with one stress, not for "
            f"'{mode.name}'. Change the signs in the file, tension positive."
        )
    if not (len(mode.stresses) == 1 or mode.machine_axes) and options.get("preload") is not None:
        raise InputError(
            f"preload (--preload) does not go with loading mode '{mode.name}', where it does not say which stress "
            "carries it. Leave it out, and count stretches in the file from where the specimen is taut."
        )
    if stress_type not in STRESS_TYPES:
        raise InputError(f"stress_type must be one of {', '.join(STRESS_TYPES)}, not '{stress_type}'.")
    if axis is not None and axis not in AXES:
        raise InputError(f"axis must be one of {', '.join(AXES)}, not '{axis}'.")
    if not isinstance(every, int) or every < 1:
        raise InputError(f"every must be a number of rows, 1 or more, not {every!r}.")
    return mode


def _measured(
    table: Table,
    mode: LoadingMode,
    choices: Mapping[str, ColumnChoice],
    dimensions: Dimensions,
    options: ReadingOptions,
) -> tuple[list[Curve], list[Load]]:
    """Return every row as stretch and stress of the kind that the file gives, and how the stress was obtained."""
    labels, chosen_columns = list(choices), list(choices.values())
    numbers = [table.numbers([choice.deformation, choice.stress]) for choice in chosen_columns]
    of_each = [dimensions] * len(labels)
    if mode.machine_axes:
        of_each = dimensions_of_axes(table, dimensions, chosen_columns, [own[0] for own in numbers])
    curves, loads = [], []
    for number, (choice, own, (deformation, load)) in enumerate(zip(chosen_columns, of_each, numbers, strict=True)):
        with of_the_second(labels, mode) if number else nullcontext():
            stretch, source = stretch_of(
                table, choice, deformation, load, own, options.get("strain_unit"), options.get("displacement_unit")
            )
            stress_type = options.get("stress_type", "engineering")
            stress = stress_of(
                table, choice, load, own, stress_type, options.get("stress_unit"), options.get("force_unit")
            )
        curves.append(Curve(table, np.arange(len(stretch)), stretch, stress.stress, (source, stress.source)))
        loads.append(stress)
    return curves, loads


def _points(mode: LoadingMode, curves: Sequence[Curve]) -> Column:
    """Return the points of the mode: the stretch, or a column for each axis."""
    return np.stack([curve.stretch for curve in curves], axis=-1) if len(mode.controls) > 1 else curves[0].stretch


def _from_cauchy(mode: LoadingMode, curves: Sequence[Curve]) -> list[Curve]:
    points = _points(mode, curves)
    return [
        replace(curve, stress=curve.stress / path.cauchy_ratio(points))
        for path, curve in zip(mode.paths, curves, strict=True)
    ]


def _check_signs(curves: Sequence[Curve], choices: Sequence[ColumnChoice], compression_positive: bool) -> None:
    """Refuse stresses of the wrong sign in those rows where the stretches, all above 1 or below, tell their sign."""
    change = np.stack([curve.stretch - 1 for curve in curves])
    alike = np.flatnonzero((change >= 0).all(axis=0) | (change <= 0).all(axis=0))
    for curve, choice in zip(curves if len(alike) else (), choices, strict=False):
        own = curve.kept(alike, "of no sign")
        check_signs(own.table, choice, own.stretch, own.stress, compression_positive)
