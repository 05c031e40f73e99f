"""From a laboratory's file to an experiment, in steps of which each leaves a sentence."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.columns import ColumnChoice, choose_columns
from tissuq.experiments.curve import Curve
from tissuq.experiments.cycles import Cycle, chosen, find_cycles
from tissuq.experiments.dimensions import dimensions_of
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.measures import stress_of, stretch_of
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.plausibility import check_shear_signs, check_signs, check_stretch
from tissuq.experiments.signs import with_compression_negative
from tissuq.experiments.slack import preload_stress, taut
from tissuq.experiments.table import Table, read_table

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
    """A file, the experiment that was read from it, and what was done on the way.

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
    """

    experiment: Experiment
    table: Table
    choice: ColumnChoice
    recorded: Curve
    used: Curve
    cycles: tuple[Cycle, ...]
    warnings: tuple[str, ...]


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
        to the name of a column or its number from 1. Columns with usual names (with a unit or not) need none.
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
        Without it those in the lines above the table. Only displacements and forces need them.
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
        ``x`` or ``y``: whose columns to read from the file of a biaxial machine.
    sheet : str or int, optional
        Name or number (from 1) of the sheet of an Excel workbook.
    name : str, optional
        Name of the experiment; the name of the file without its ending when not given.
    skip_rows : int
        Lines at the top of the file to pass over unseen.

    Returns
    -------
    Experiment
        Stretches (dimensionless) and engineering stresses (MPa) in the order of the file; its ``source``
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
    stress_type, axis = options.get("stress_type", "engineering"), options.get("axis")
    every, name = options.get("every", 1), options.get("name")
    is_shear = mode.controls == (SHEAR,)
    choice = choose_columns(table, options.get("columns"), stress_type, axis, is_shear)
    dimensions = dimensions_of(table, options.get("dimensions"))
    deformation, load = table.numbers([choice.deformation, choice.stress])
    stretch, stretch_source = stretch_of(
        table, choice, deformation, load, dimensions, options.get("strain_unit"), options.get("displacement_unit")
    )
    measured = stress_of(
        table, choice, load, dimensions, stress_type, options.get("stress_unit"), options.get("force_unit")
    )
    curve = Curve(table, np.arange(len(stretch)), stretch, measured.stress, (stretch_source, measured.source))
    curve = with_compression_negative(curve, choice, options.get("compression_positive", False))
    recorded, cycles = curve, find_cycles(table, curve.stretch)
    curve = chosen(curve, cycles, options.get("cycle"), options.get("branch"))
    if (preload := options.get("preload")) is not None:
        threshold = preload_stress(preload, measured.area)
        curve = taut(curve, preload, threshold, peak=find_cycles(curve.table, curve.stretch)[0].peak)
    if not is_shear:
        check_stretch(curve.table, choice, curve.stretch)
    if stress_type == "cauchy" and not is_shear:
        recorded, curve = (
            replace(each, stress=each.stress / mode.cauchy_ratio(each.stretch)) for each in (recorded, curve)
        )
        curve = curve.told("Cauchy stress divided by stretch to engineering stress")
    if every > 1:
        kept = np.arange(0, len(curve), every)
        curve = curve.kept(kept, f"one row in {every} asked for").told(f"one row in {every}")
    if is_shear:
        check_shear_signs(curve.table, choice, curve.stretch, curve.stress)
    else:
        check_signs(curve.table, choice, curve.stretch, curve.stress, options.get("compression_positive", False))
    curve = curve.told(f"{len(curve)} rows (lines {curve.table.lines[0]} to {curve.table.lines[-1]})")
    sheet = table.file.removeprefix(str(path))
    experiment = Experiment(
        mode=mode,
        stretch=curve.stretch,
        stress=curve.stress,
        name=Path(path).stem if name is None else name,
        source=f"{Path(path).name}{sheet}: {'; '.join(curve.steps)}",
        stress_unit=measured.unit.name,
    )
    return Reading(experiment, table, choice, recorded, curve, tuple(cycles), dimensions.warnings)


def _checked_mode(**options: Unpack[ReadingOptions]) -> LoadingMode:
    """Return the loading mode, once the options have been looked at that need no file."""
    mode, stress_type = loading_mode(options.get("mode", "uniaxial")), options.get("stress_type", "engineering")
    axis, every = options.get("axis"), options.get("every", 1)
    if len(mode.channels) > 1 or len(mode.controls) > 1:
        raise InputError(
            f"a file is read in loading modes with one stress, and '{mode.name}' has {', '.join(mode.stresses)}: give "
            "its values to Experiment."
        )
    if stress_type not in STRESS_TYPES:
        raise InputError(f"stress_type must be one of {', '.join(STRESS_TYPES)}, not '{stress_type}'.")
    if axis is not None and axis not in AXES:
        raise InputError(f"axis must be one of {', '.join(AXES)}, not '{axis}'.")
    if not isinstance(every, int) or every < 1:
        raise InputError(f"every must be a number of rows, 1 or more, not {every!r}.")
    return mode
