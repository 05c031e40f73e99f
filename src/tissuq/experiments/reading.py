"""From a laboratory's file to an experiment: columns chosen, units and stress measures converted."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments import units
from tissuq.experiments.columns import ColumnChoice, choose_columns, declared_unit
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.plausibility import check_signs, check_strain, check_stretch
from tissuq.experiments.table import Table, read_table

__all__ = ["STRESS_TYPES", "experiment_of", "read_experiment"]

STRESS_TYPES = ("engineering", "cauchy")

Column = NDArray[np.float64]


def read_experiment(
    path: str | os.PathLike[str],
    *,
    mode: str | LoadingMode = "uniaxial",
    columns: Mapping[str, str | int] | None = None,
    stress_unit: str | None = None,
    stress_type: str = "engineering",
    strain_unit: str | None = None,
    compression_positive: bool = False,
    name: str | None = None,
    skip_rows: int = 0,
) -> Experiment:
    """Read stretches and stresses from a text file (CSV, TSV, columns of numbers).

    Separators, decimal points or commas, encodings, lines above the table, a row of column names and a
    row of units are recognised. Nothing is guessed where a wrong guess would change the numbers.

    Parameters
    ----------
    path : str or path
        The file.
    mode : str or LoadingMode
        How the specimen was loaded.
    columns : mapping, optional
        From ``stretch`` or ``strain``, and ``stress``, to the name of a column or its number from 1.
        Columns named stretch, lambda, strain or stress (with a unit or not) need none.
    stress_unit : str, optional
        Unit of the stresses; without it the file's own, and MPa when the file states none.
    stress_type : str
        ``engineering`` (force over undeformed area) or ``cauchy``, which is divided by the stretch.
    strain_unit : str, optional
        ``%`` or ``1``, for a column of strains; without it the file's own, and 1 when it states none.
    compression_positive : bool
        Whether the file counts compression as positive: flips stresses at stretches below 1.
    name : str, optional
        Name of the experiment; the name of the file without its ending when not given.
    skip_rows : int
        Lines at the top of the file to pass over unseen.

    Returns
    -------
    Experiment
        Stretches (dimensionless) and engineering stresses (MPa) in the order of the file; its ``source``
        tells the file, columns, units and conversions.

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
    mode = loading_mode(mode)
    return experiment_of(
        read_table(path, skip_rows),
        Path(path).stem if name is None else name,
        mode=mode,
        columns=columns,
        stress_unit=stress_unit,
        stress_type=stress_type,
        strain_unit=strain_unit,
        compression_positive=compression_positive,
    )


def experiment_of(
    table: Table,
    name: str,
    *,
    mode: str | LoadingMode,
    columns: Mapping[str, str | int] | None,
    stress_unit: str | None,
    stress_type: str,
    strain_unit: str | None,
    compression_positive: bool,
) -> Experiment:
    """Return the experiment in a table; the options are those of `read_experiment`."""
    mode = loading_mode(mode)
    if stress_type not in STRESS_TYPES:
        raise InputError(f"stress_type must be one of {', '.join(STRESS_TYPES)}, not '{stress_type}'.")
    choice = choose_columns(table, columns, stress_type)
    deformation, stress = table.numbers([choice.deformation, choice.stress])
    stretch, stretch_source = _stretch(table, choice, deformation, stress, strain_unit)
    unit, unit_source = _stress_unit(table, choice, stress_unit)
    stress = stress * unit.to_mpa
    stress_source = f"{stress_type} stress from column {table.label(choice.stress)} in {unit_source}"
    if stress_type == "cauchy":
        stress = stress / stretch
        stress_source += ", divided by stretch to engineering stress"
    if compression_positive and (stretch >= 1).all():
        raise InputError(
            f"{table.place(choice.deformation)}: compression_positive=True (--compression-positive) is given, but no "
            "stretch is below 1, so nothing would change. If the file counts compressive strains as positive, too, "
            "change their sign in the file; otherwise leave it out."
        )
    if compression_positive:
        stress = np.where(stretch < 1, -stress, stress)
        stress_source += ", sign changed at stretch < 1"
    check_signs(table, choice, stretch, stress, compression_positive)
    rows = f"{len(stretch)} rows (lines {table.lines[0]} to {table.lines[-1]})"
    return Experiment(
        mode=mode,
        stretch=stretch,
        stress=stress,
        name=name,
        source=f"{Path(table.file).name}: {stretch_source}; {stress_source}; {rows}",
        stress_unit=unit.name,
    )


def _stretch(
    table: Table, choice: ColumnChoice, values: Column, stress: Column, strain_unit: str | None
) -> tuple[Column, str]:
    """Return the stretches and how they were obtained."""
    if strain_unit is not None and not choice.is_strain:
        raise InputError(
            f"{table.place(choice.deformation)} is read as stretch, but strain_unit='{strain_unit}' is "
            "given. Leave strain_unit (--strain-unit) out, or give the column as strain."
        )
    declared = declared_unit(table, choice.deformation)
    if not choice.is_strain and not units.looks_like_unit(declared):
        declared = ""
    factor = _strain_factor(table, choice, declared, strain_unit)
    label = table.label(choice.deformation)
    scaled = "" if factor == 1 else f" x {factor:g}"
    if choice.is_strain:
        check_strain(table, choice, values * factor, stress, has_unit=bool(declared or strain_unit))
        stretch, source = 1 + values * factor, f"stretch = 1 + column {label}{scaled}"
    else:
        stretch, source = values * factor, f"stretch = column {label}{scaled}"
    check_stretch(table, choice, stretch)
    return stretch, source


def _strain_factor(table: Table, choice: ColumnChoice, declared: str, given: str | None) -> float:
    place = table.place(choice.deformation)
    try:
        in_file = units.strain_factor(declared)
    except InputError as error:
        if given is None:
            hint = " To say it yourself, give strain_unit (--strain-unit)." if choice.is_strain else ""
            raise InputError(f"{place}: {error}{hint}") from error
        declared, in_file = "", 1.0
    if given is None:
        return in_file
    factor = units.strain_factor(given)
    if declared and in_file != factor:
        raise InputError(
            f"{place}: strain_unit='{given}' is given, but the file says '{declared}'. Leave strain_unit "
            "(--strain-unit) out, or correct the file."
        )
    return factor


def _stress_unit(table: Table, choice: ColumnChoice, given: str | None) -> tuple[units.StressUnit, str]:
    """Return the unit of the stresses and the words for where it comes from."""
    declared = declared_unit(table, choice.stress)
    if given is not None:
        unit = units.stress_unit(given)
        in_file = _unit_or_none(declared)
        if in_file and not np.isclose(in_file.to_mpa, unit.to_mpa, rtol=1e-9, atol=0):
            raise InputError(
                f"{table.place(choice.stress)}: stress_unit='{given}' is given, but the file says "
                f"'{declared}'. Leave stress_unit (--stress-unit) out, or correct the file."
            )
        return unit, f"{unit.name} (as given)"
    if not declared:
        return units.StressUnit("MPa", 1.0), "MPa (assumed: the file states no unit)"
    try:
        unit = units.stress_unit(declared)
    except InputError as error:
        raise InputError(
            f"{table.place(choice.stress)}: {error} To say it yourself, give stress_unit (--stress-unit)."
        ) from error
    return unit, f"{unit.name} (from the file)"


def _unit_or_none(text: str) -> units.StressUnit | None:
    try:
        return units.stress_unit(text) if text else None
    except InputError:
        return None
