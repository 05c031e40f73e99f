"""What `tissuq calibrate` does: a file of a control and a measured quantity, and an expensive model of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.emulation import Calibration, FileForward, UmbridgeForward
from tissuq.emulation.forward import Forward
from tissuq.emulation.length_scales import Kernel, Trend
from tissuq.emulation.material_posterior import check_material
from tissuq.emulation.problem import Method
from tissuq.emulation.runs import PointSet
from tissuq.errors import InputError
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.tables import read_table
from tissuq.parameters.priors import Prior, prior_from
from tissuq.parameters.seeds import MAX_SEED
from tissuq.posterior.posterior import Posterior
from tissuq.studies.calibrate import calibrate
from tissuq.studies.stream import Step, silent

__all__ = ["CalibrationSettings", "CalibrationStudy", "Measured", "run_calibration"]

FloatArray = NDArray[np.float64]


NUMBER = r"\d+\.?\d*"
RANGE = re.compile(rf"{NUMBER}:{NUMBER}")
"""Smallest and largest stretch."""


class CalibrationSettings(BaseModel):
    """Everything that a calibration depends on, in the units of the forward model."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: str
    control: str | int | None = None
    measured: str | int | None = None
    sheet: str | int | None = None
    skip_rows: int = Field(0, ge=0)
    every: int = Field(1, ge=1)
    forward: str | None = None
    umbridge: str | None = None
    model: str = "forward"
    priors: dict[str, dict[str, Any]] = Field(min_length=1)
    discrepancy: str = "none"
    noise_sd: float | Literal["unknown"] = "unknown"
    zero_load: float = 0.0
    runs: int = Field(40, ge=1)
    refine: int = Field(0, ge=0)
    design: PointSet = "sobol"
    kernel: Kernel = "squared-exponential"
    trend: Trend = "linear"
    method: Method = "auto"
    material: str | None = None
    range: str | None = None
    mode: str = "uniaxial"
    unit: str = "MPa"
    seed: int = Field(0, ge=0, le=MAX_SEED)

    @field_validator("noise_sd", mode="before")
    @classmethod
    def _positive_or_unknown(cls, value: Any) -> Any:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if value != "unknown" and not (is_number and 0 < value < inf):
            raise ValueError(
                f"must be a positive number in the unit of the measured values, or 'unknown', not {value!r}"
            )
        return value

    @model_validator(mode="after")
    def _one_model(self) -> Self:
        if (self.forward is None) == (self.umbridge is None):
            raise ValueError("give one forward model: a function in a file (forward) or a server (umbridge), not both")
        if (self.material is None) != (self.range is None):
            raise ValueError("material and range belong together: the law of the forward model, and its stretches, "
                             "such as 0.7:1.3")  # fmt: skip
        if self.range is not None and not RANGE.fullmatch(self.range):
            raise ValueError(f"range must be the smallest and the largest stretch, such as 0.7:1.3, not {self.range!r}")
        return self

    @property
    def stretches(self) -> tuple[float, float]:
        """The smallest and the largest stretch in the forward model."""
        low, high = str(self.range).split(":")
        return float(low), float(high)

    @property
    def forward_model(self) -> Forward:
        """What is run."""
        return UmbridgeForward(self.umbridge, self.model) if self.umbridge else FileForward(str(self.forward))

    @property
    def parameter_priors(self) -> dict[str, Prior]:
        """Of the parameters, by name."""
        return {symbol: prior_from(prior) for symbol, prior in self.priors.items()}


@dataclass(frozen=True, eq=False)
class Measured:
    """Two columns of a file: what was set and what was measured, with their names and units."""

    control: FloatArray
    measured: FloatArray
    control_label: str
    measured_label: str


@dataclass(frozen=True)
class CalibrationStudy:
    """Results of a calibration."""

    settings: CalibrationSettings
    data: Measured
    calibration: Calibration
    seconds: float
    posterior: Posterior | None = None
    """That of the material in the forward model, where one is named."""

    @property
    def warnings(self) -> list[str]:
        """Warnings about the calibration."""
        return list(self.calibration.warnings)


def run_calibration(
    settings: CalibrationSettings,
    folder: Path = Path(),
    *,
    runs_in: Path | None = None,
    workers: int = 1,
    step: Step = silent,
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

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When file, settings or model cannot be used.
    """
    if settings.material is not None:
        check_material(settings.material, settings.parameter_priors, settings.unit)
    data = _read(settings, folder)
    start = perf_counter()
    names = ("discrepancy", "noise_sd", "zero_load", "runs", "refine", "design", "kernel", "trend", "method", "seed")
    calibration = calibrate(
        data.control,
        data.measured,
        settings.forward_model,
        settings.parameter_priors,
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
    return CalibrationStudy(settings, data, calibration, perf_counter() - start, posterior)


def _read(settings: CalibrationSettings, folder: Path) -> Measured:
    table = read_table(folder / settings.file, settings.skip_rows, settings.sheet)
    columns = _places(table, (settings.control, settings.measured))
    control, measured = (column[:: settings.every] for column in table.numbers(columns))
    return Measured(control, measured, *(_label(table, column_index) for column_index in columns))


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


def _place(table: Table, requested: str | int) -> int:
    matches = [index for index, name in enumerate(table.names) if name == requested]
    if matches:
        return matches[0]
    if isinstance(requested, int) and 1 <= requested <= len(table.names):
        return requested - 1
    raise InputError(f"{table.file} has no column '{requested}'; it has {', '.join(filter(None, table.names))}.")


def _label(table: Table, index: int) -> str:
    unit = table.units[index].strip("[]() ")
    name = table.names[index] or f"column {index + 1}"
    return f"{name} [{unit}]" if unit else name
