"""From the chosen columns to rows of stretch and stress, and from a measure of stress to the engineering one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.axial_stretch import axial_stretch_of, note_of_tube
from tissuq.experiments.reading.columns import about_stress, mapping_of_each_stress
from tissuq.experiments.reading.deformations import stretch_of, without_machine
from tissuq.experiments.reading.dimensions import Dimensions
from tissuq.experiments.reading.dimensions_of_table import dimensions_of, dimensions_of_stresses, of_block
from tissuq.experiments.reading.loads import Load, force_in, meant_for, stress_of, without_ends, without_zero
from tissuq.experiments.reading.measured_rows import MeasuredRows
from tissuq.experiments.reading.measures import STRESS_MEASURES, StressMeasure
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import PRESSURE, TOTAL_FORCE, ColumnChoice
from tissuq.experiments.reading.rows_of_tests import check_one_specimen, columns_only
from tissuq.experiments.reading.side_by_side import test_beside
from tissuq.experiments.reading.spread import Spread, spread_of
from tissuq.experiments.reading.stated_sizes import names_of_specimen
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH
from tissuq.experiments.units import FORCE

LONG = "engineering stress of "
"""How names of several stresses begin; what is said of each of them begins with the axis alone."""


def measured_rows(
    table: Table,
    mode: LoadingMode,
    choices: Mapping[str, ColumnChoice],
    options: ReadingOptions,
) -> tuple[MeasuredRows, list[Load], tuple[Spread, ...], Dimensions]:
    """Return every row as stretch and stress of the kind that the file gives.

    With each stress, its standard errors, and the dimensions of the specimen, of which there must be one.
    """
    labels, columns = tuple(choices), list(choices.values())
    numbers = [table.numbers([choice.deformation, choice.stress]) for choice in columns]
    changes = np.array([deformation - deformation[0] for deformation, _ in numbers])
    farthest = np.abs(changes).argmax(axis=0)  # the axis along which each row is farther from the first
    check_one_specimen(table, columns, changes[farthest, np.arange(len(farthest))])
    specimens = names_of_specimen(table, columns, options.get("only"))
    test = test_beside(table, columns[0].stress, mode, options) if len(columns) == 1 else None
    dimensions = dimensions_of(table, options.get("dimensions"), specimens, test)
    if len(columns) == 1:
        words = [Path(table.file).name, table.sheet, table.title, options.get("name") or ""]
        words += ["compression"] if options.get("compression_positive") else []
        dimensions = of_block(table, columns[0], (numbers[0][0], numbers[0][1]), dimensions, words)
    axial = axial_stretch_of(table, mode, columns, dimensions, options)
    if axial is not None and axial.is_of_length:
        dimensions = replace(dimensions, set_by_user=dimensions.set_by_user - {"length"})
    sizes = dimensions_of_stresses(table, dimensions, mode, columns, [deformation for deformation, _ in numbers])
    stretches, loads, stretch_steps, spreads = [], [], [], []
    mappings = mapping_of_each_stress(mode, options.get("columns"))
    for number, (choice, size, (deformation, load)) in enumerate(zip(columns, sizes, numbers, strict=True)):
        is_of_tube, of_load = columns[0].load == PRESSURE, meant_for(choice, columns, options)
        is_force = choice.load == "force" and force_in(table, choice.stress, options) is FORCE
        size = replace(size, divide_forces=is_force, axial_stretch=1.0 if axial is None else axial.values)
        with about_stress(0 if is_of_tube else number, labels, mode):
            load, counted = without_zero(table, choice, load, of_load)
            deformation, given_way = without_machine(table, choice, deformation, load, options)
            if choice.measure == ROLE_OF_AXIAL_STRETCH and axial is not None:
                stretch, step = axial.values, ""
            else:
                stretch, step = stretch_of(table, choice, deformation, load, size, options)
            stress = stress_of(table, choice, load, size, of_load)
            spreads.append(spread_of(table, choice, mappings[number], stress, options.get("mean_of")))
        stretches.append(stretch)
        stretch_steps.append(f"{step}{given_way}")
        note = note_of_tube(size.tube[0], axial) if choice.load == PRESSURE else stress.note
        loads.append(replace(stress, source=f"{stress.source}{counted}", note=note))
    if columns[-1].load == TOTAL_FORCE and axial is not None:
        tube, _ = sizes[-1].tube
        loads[-1] = without_ends(loads[-1], tube.of_ends(stretches[0], axial.values, loads[0].stress))
    measured = MeasuredRows(
        table=table,
        rows=np.arange(len(table.rows)),
        stretch=np.stack(stretches),
        stress=np.stack([load.stress for load in loads]),
        standard_error=np.stack([np.broadcast_to(spread.standard_error, len(table.rows)) for spread in spreads]),
        labels=tuple(label.removeprefix(LONG) for label in labels),
        axial_stretch=None if axial is None else axial.values,
    )
    for name, value in columns_only(table, options.get("only")).items():
        measured = measured.with_step(f"only rows with '{value}' in column '{name}'")
    if axial is not None:
        measured = measured.with_step(axial.source)
    measured = measured.with_step(*stretch_steps).with_step(*(load.source for load in loads))
    if any(spread.source for spread in spreads):
        measured = measured.with_step(*(spread.source for spread in spreads))
    return measured, loads, tuple(spreads), dimensions


def with_engineering_stress(
    mode: LoadingMode, measure: StressMeasure, measured: MeasuredRows, points: Column
) -> MeasuredRows:
    """Return rows whose stresses of a measure, and their standard errors, are engineering ones."""
    if measure.engineering is None:
        return measured
    try:
        stress, error = measure.engineering(mode, points, measured.stress), measured.standard_error
    except InputError as refusal:
        raise InputError(f"{measured.table.file}: {refusal}") from refusal
    if error.any():
        error = np.abs(measure.engineering(mode, points, error))
    return replace(measured, stress=stress, standard_error=error)


def stress_measure_of(table: Table, choices: Sequence[ColumnChoice]) -> StressMeasure:
    """Return the measure of the stresses, which is one."""
    types = list(dict.fromkeys(choice.stress_type for choice in choices))
    if len(types) > 1:
        raise InputError(
            f"{table.file}: the stresses are of different types ({' and '.join(types)}). Give columns of one type "
            "(--column stress=NAME --column stress2=NAME)."
        )
    return STRESS_MEASURES[types[0]]


def points_of(mode: LoadingMode, measured: MeasuredRows, stretch: Column | None = None) -> Column:
    """Return the points of a mode (n,) or (n, c): the stretches of rows, or others, and the axial stretch of a tube."""
    columns = (measured.stretch if stretch is None else stretch)[: len(mode.controls)]
    axial = measured.axial_stretch
    return as_columns(columns if axial is None or len(columns) == len(mode.controls) else np.vstack([columns, axial]))


def as_columns(rows: Column) -> Column:
    """Return stretches or stresses (k, n) as an experiment takes them: a column for each, or the only one (n,)."""
    return np.ascontiguousarray(rows.T) if len(rows) > 1 else rows[0]
