"""What `tissuq calibrate` does: a file of a control and a measured quantity, and an expensive model of it."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.emulation import Calibration, Forward
from tissuq.emulation.material_posterior import check_material
from tissuq.emulation.problem import symbol_of
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import FOUR_DIGITS, agree
from tissuq.experiments.reading.column_units import declared_unit
from tissuq.experiments.reading.headings import heading, is_of_specimens, plain
from tissuq.experiments.reading.rows_of_tests import SeveralSpecimens, only_rows, row_names
from tissuq.experiments.reading.table import Table, rows_in
from tissuq.experiments.reading.tables import read_table
from tissuq.experiments.units import FORCE, LENGTH, PRESSURE, measured_in, stress_unit
from tissuq.mechanics import material_named
from tissuq.model.noise import NOISE_SD
from tissuq.parameters.parameter import Parameter
from tissuq.posterior.posterior import Posterior
from tissuq.studies.calibrate import calibrate
from tissuq.studies.calibration_settings import CalibrationSettings, OfModel
from tissuq.studies.earlier_run import load_law, priors_of
from tissuq.studies.settings import DATA, INPUT, damage_reported
from tissuq.studies.stream import Step, silent

PROPORTIONAL_BY_CHANCE = 4
"""Fewest measurements of which it shows that they are those of another file in another unit."""
SAME_UNIT = 1e-9
"""Relative difference of factors of one unit under two names."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Two columns of a file: what was set and a quantity that was measured, with their names and units."""

    control: FloatArray
    measured: FloatArray
    control_label: str
    measured_label: str
    units: tuple[str, str] = ("", "")
    """Of both, where the file has them."""


@dataclass(frozen=True)
class CalibrationStudy:
    """Results of a calibration."""

    settings: CalibrationSettings
    data: Mapping[str, Measured]
    """By the names of the quantities; that of a single one is empty."""
    calibration: Calibration
    seconds: float
    forward: Forward
    """What was run."""
    posterior: Posterior | None = None
    """That of the material in the forward model, where one is named."""
    prior_run: str | None = None
    """The run whose posterior the priors are."""

    @property
    def units(self) -> dict[str, str]:
        """The units of parameters where they are known: of the material that is named, and of the noise."""
        of_material = {parameter.symbol: self.settings.unit for parameter in self._parameters if parameter.unit}
        of_errors = {
            symbol_of(parameter.symbol, name): measured.units[0 if parameter.dimension == "stretch" else 1]
            for name, measured in self.data.items()
            for parameter in (*self.calibration.problem.discrepancy.parameters, NOISE_SD)
        }
        return of_material | {symbol: unit for symbol, unit in of_errors.items() if unit}

    @property
    def symbols_of_material(self) -> set[str]:
        """The parameters of the material that is named: quantities of its unit of stress, and numbers."""
        return {parameter.symbol for parameter in self._parameters}

    @property
    def _parameters(self) -> tuple[Parameter, ...]:
        material = self.settings.material
        return () if material is None else material_named(material).parameters

    def label(self, symbol: str) -> str:
        """Return a parameter with its unit, where it has one that is known: ``mu1 [kPa]``."""
        return f"{symbol} [{self.units[symbol]}]" if symbol in self.units else symbol


def run_calibration(
    settings: CalibrationSettings,
    folder: Path = Path(),
    *,
    runs_in: Path | None = None,
    workers: int = 1,
    step: Step = silent,
    **running: Any,
) -> CalibrationStudy:
    """Read the file, run the model, and identify its parameters.

    Parameters
    ----------
    settings : CalibrationSettings
    folder : Path
        Where a relative file lies.
    runs_in : Path, optional
        Keeps the forward runs.
    workers : int
        Processes that run the model.
    step : callable
        Told of every run that is done.
    **running
        How a finite-element model is run: ``timeout``, ``retries``, ``keep``, ``abaqus``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When file, settings or model cannot be used.
    """
    prior_run = settings.prior_run
    settings = with_priors_of_run(settings, folder)
    if settings.material is not None:
        check_material(settings.material, settings.parameter_priors, settings.unit)
    data, experiments = _read(settings, folder)
    if prior_run is not None:
        _check_other_measurements(settings, data, folder / prior_run)
    units = {name: measured.units for name, measured in data.items()}
    if settings.material is not None and not settings.models:
        _check_unit(settings, list(units.values()))
    forward = settings.forward_model(folder, units, experiments, **running)
    start = perf_counter()
    names = ("discrepancy", "zero_load", "runs", "refine", "design", "kernel", "trend", "method", "seed")
    calibration = calibrate(
        {name: measured.control for name, measured in data.items()},
        {name: measured.measured for name, measured in data.items()},
        forward,
        settings.parameter_priors,
        noise_sd=settings.noises,
        correlations=settings.correlations,
        folder=runs_in,
        workers=workers,
        step=step,
        **{name: getattr(settings, name) for name in names},
    )
    posterior = None
    if settings.material is not None:
        posterior = calibration.posterior_of(
            settings.material, settings.stretches, mode=settings.mode, unit=settings.unit
        )
    return CalibrationStudy(settings, data, calibration, perf_counter() - start, forward, posterior, prior_run)


def with_priors_of_run(settings: CalibrationSettings, folder: Path = Path()) -> CalibrationSettings:
    """Return settings in which the posterior of a run stands as priors; what is stated of a parameter stays."""
    if settings.prior_run is None:
        return settings
    posterior = load_law(folder / settings.prior_run, str(settings.material))
    stated = settings.priors
    priors, correlations = priors_of(posterior, settings.unit, stated)
    pairs = {",".join(pair): value for pair, value in correlations.items()}
    changes = {
        "priors": {symbol: prior.as_dict() for symbol, prior in priors.items()} | stated,
        "prior_correlations": pairs | settings.prior_correlations,
        "prior_run": None,
    }
    return settings.model_copy(update=changes)


def _check_other_measurements(settings: CalibrationSettings, data: Mapping[str, Measured], run: Path) -> None:
    """Refuse the posterior of measurements as the prior beside them, whatever their file is called and in any unit."""
    for name, measured in data.items():
        fitted = [
            *(curve.stress for curve in load_law(run, str(settings.material)).model.experiment.curves),
            *_stresses_of_specimens(run, len(measured.measured), settings.every),
            *_columns_of_inputs(settings, measured, run),
        ]
        if any(_are_proportional(values, measured.measured) for values in fitted):
            raise InputError(
                f"the run '{run}' was fitted to the measurements{f' of {name}' * bool(name)} that are calibrated "
                f"({measured.measured_label}), which would count twice: give a run of other tests (--prior-run), or "
                "the priors themselves, as --prior C10=uniform(0.1, 5)."
            )


def _stresses_of_specimens(run: Path, count: int, stride: int) -> Iterator[FloatArray]:
    """Yield all successive stresses, so many and at every so many rows, of the specimens of a population.

    Its posterior is of a new specimen, of whom nothing was measured, and its files may have many specimens each.
    """
    file = _folder_of(run) / DATA
    if not file.is_file():
        return
    with file.open(newline="", encoding="utf-8") as lines, damage_reported(file):
        heads, *rows = csv.reader(lines)
        if heads[0] != "specimen":
            return
        stresses: dict[tuple[str, ...], list[float]] = {}
        for *labels, _, stress in rows:
            stresses.setdefault(tuple(labels), []).append(float(stress))
    for values in map(np.array, stresses.values()):
        for start in range(len(values) - stride * (count - 1)):
            yield values[start::stride][:count]


def _folder_of(run: Path) -> Path:
    """Return the folder of a run that may be named by the file of its posterior."""
    return run if run.is_dir() else run.parent.parent


def _columns_of_inputs(settings: CalibrationSettings, measured: Measured, run: Path) -> Iterator[FloatArray]:
    """Yield the columns of that name in the run's copies of measured files, of which a fit may have used some rows."""
    folder = _folder_of(run) / INPUT
    for file in sorted(path for path in folder.glob("*") if path.is_file()):
        with suppress(InputError):
            table = _table(file, settings)
            for column, quantity in enumerate(table.quantities):
                if quantity == heading(measured.measured_label).quantity:
                    yield table.without_missing([column]).numbers([column])[0][:: settings.every]


def _are_proportional(values: FloatArray, others: FloatArray) -> bool:
    """Return whether values are others in another unit or over another area.

    A few may be so by chance, and equal steps, as of prescribed loads, are so in any two tests.
    """
    if values.shape != others.shape or len(values) < PROPORTIONAL_BY_CHANCE or not values.any():
        return False
    if agree(values, np.linspace(values[0], values[-1], len(values)), FOUR_DIGITS):
        return False
    return agree(others, values * (values @ others / (values @ values)), FOUR_DIGITS)


def _check_unit(settings: CalibrationSettings, units: Sequence[tuple[str, str]]) -> None:
    """Refuse measurements whose units go with another one than the law's, unless the user says that of the model.

    They are stresses or pressures in it, or forces with lengths as controls: of mN and mm the unit of stress is kPa.
    """
    if "unit" in settings.model_fields_set:
        return
    for control, measured in units:
        factor = PRESSURE.factor_or_none(measured) if measured_in(measured) in ("stress", PRESSURE.name) else None
        said, named = f"the measured values are in {measured}", measured
        force, length = FORCE.factor_or_none(measured), LENGTH.factor_or_none(control)
        if force and length:
            factor = force / length**2
            named = next((name for name in ("kPa", "Pa") if isclose(stress_unit(name).to_mpa, factor)), "kPa")
            said = f"the forces are in {measured} and the controls in {control}"
        if factor is not None and not isclose(factor, stress_unit(settings.unit).to_mpa, rel_tol=SAME_UNIT):
            raise InputError(
                f"{said}, and the parameters of {settings.material} would be taken in {settings.unit}: say in which "
                f"unit of stress the model computes, --unit {named} or --unit {settings.unit}."
            )


def _read(settings: CalibrationSettings, folder: Path) -> tuple[dict[str, Measured], list[OfModel]]:
    """Return what was measured, by quantity, and what of it each file has; rows count where there is a value."""
    tables = [_table(folder / file, settings) for file in settings.files]
    experiments = _experiments(settings, tables)
    if settings.measured_names == ("",):
        columns = _places(tables[0], (settings.control, settings.measured))
        return {"": _measured(tables[0], columns, settings.every)}, experiments
    data: dict[str, Measured] = {}
    for table, (names, controlled) in zip(tables, experiments, strict=True):
        column_of = {name: _place(table, name) for name in names}
        named = controlled if len(tables) > 1 else ""
        requested = settings.control if settings.control is not None else named or None
        control = _control(table, [*column_of.values()], requested)
        data |= {
            name: _measured(table.without_missing([column]), (control, column), settings.every)
            for name, column in column_of.items()
        }
    return data, experiments


def _table(path: Path, settings: CalibrationSettings) -> Table:
    table = only_rows(read_table(path, skip_rows=settings.skip_rows, sheet=settings.sheet), settings.only)
    if settings.leave_out is None:
        return table
    remaining = np.flatnonzero(~rows_in(settings.leave_out, table.lines, table.file))
    if not len(remaining):
        raise InputError(f"{table.file}: no row is left but those of --leave-out {settings.leave_out}.")
    return table.taken(remaining)


def _experiments(settings: CalibrationSettings, tables: Sequence[Table]) -> list[OfModel]:
    """Return what each file is of: of several, the quantities and the control that are called as its columns."""
    if len(tables) == 1:
        return [OfModel(settings.measured_names, next(iter(settings.along), ""))]
    for option, names in (("--qoi", settings.measured_names), ("--along", settings.along)):
        for name in names:
            having = [str(table.file) for table in tables if _has(table, name)]
            if len(having) != 1:
                files = f"{' and '.join(having)} have" if having else "no file has"
                advice = "; rename it in the others" if having else ""
                raise InputError(
                    f"{files} a column '{name}' ({option} {name}=...): exactly one file must have it{advice}."
                )
    experiments = []
    for table in tables:
        measured, controls = (
            [name for name in names if _has(table, name)] for names in (settings.measured_names, settings.along)
        )
        if not measured:
            raise InputError(f"{table.file} has no column that is called as a quantity (--qoi NAME=...).")
        if len(controls) > 1:
            raise InputError(
                f"{table.file} has the columns {' and '.join(controls)}, both given as its control (--along): give one."
            )
        experiments.append(OfModel(tuple(measured), controls[0] if controls else ""))
    return experiments


def _control(table: Table, measured: Sequence[int], requested: str | int | None) -> int:
    """Return the column of the control: the one that is requested, or that is left."""
    columns = [index for index in range(len(table.names)) if index not in measured]
    if requested is None and len(columns) != 1:
        names = ", ".join(table.label(index) for index in columns)
        raise InputError(f"{table.file} has the columns {names}: name that of the control (--control NAME).")
    control = columns[0] if requested is None else _place(table, requested)
    if control in measured:
        raise InputError(f"{table.file}: the control {table.label(control)} is one of the quantities.")
    return control


def _measured(table: Table, columns: tuple[int, int], stride: int) -> Measured:
    control, measured = (column[::stride] for column in table.numbers(columns))
    _check_one_specimen(table)
    control_label, measured_label = (_label(table, index) for index in columns)
    units = declared_unit(table, columns[0]), declared_unit(table, columns[1])
    return Measured(control, measured, control_label, measured_label, units)


def _check_one_specimen(table: Table) -> None:
    """Refuse rows of several specimens, as a fit does: their parameters would be taken for the same.

    What another column tells apart, such as the sensors of one test, a forward model may know.
    """
    for column in filter(lambda number: is_of_specimens(table.quantities[number]), range(len(table.names))):
        labels = row_names(table, column)
        if len({*labels}) > 1:
            raise SeveralSpecimens(table.place(column), table.key(column), labels)


def _places(table: Table, requested: Sequence[str | int | None]) -> tuple[int, int]:
    """Return the columns of the control and of what was measured, counted from 0."""
    if None in requested:
        if requested != (None, None) or len(table.names) != 2:
            names = ", ".join(table.label(index) for index in range(len(table.names)))
            raise InputError(
                f"{table.file} has the columns {names}: name the column of the control, such as a depth, and the "
                "column of the measured values, such as a force (--control NAME --measured NAME)."
            )
        return 0, 1
    columns = [_place(table, column) for column in requested if column is not None]
    if columns[0] == columns[1]:
        raise InputError(f"{table.file}: control and measured values are the same column {table.label(columns[0])}.")
    return columns[0], columns[1]


def _has(table: Table, name: str) -> bool:
    """Return whether a table has a column of that name, with its unit or without."""
    return any(column == name or heading(column).quantity == plain(name) for column in table.names)


def _place(table: Table, requested: str | int) -> int:
    matches = [index for index, name in enumerate(table.names) if name == requested]
    if len(matches) > 1:
        numbers = " or ".join(str(index + 1) for index in matches)
        raise InputError(f"{table.file} has {len(matches)} columns '{requested}': give the number of one, {numbers}.")
    if matches:
        return matches[0]
    matches = [index for index, name in enumerate(table.names) if heading(name).quantity == plain(str(requested))]
    if len(matches) == 1:  # the name without its unit
        return matches[0]
    if isinstance(requested, int) and 1 <= requested <= len(table.names):
        return requested - 1
    raise InputError(f"{table.file} has no column '{requested}'; it has {', '.join(filter(None, table.names))}.")


def _label(table: Table, index: int) -> str:
    unit = table.units[index].strip("[]() ")
    name = table.names[index] or f"column {index + 1}"
    return f"{name} [{unit}]" if unit else name
