"""What `tissuq calibrate` does: a file of a control and a measured quantity, and an expensive model of it."""

from __future__ import annotations

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
from tissuq.emulation.design import Design
from tissuq.emulation.forward import Forward
from tissuq.emulation.kriging import Kernel, Trend
from tissuq.emulation.problem import Method
from tissuq.errors import InputError
from tissuq.experiments.table import Table, read_table
from tissuq.priors import Prior, prior_from
from tissuq.studies.calibrate import calibrate
from tissuq.studies.stream import Step, silent

__all__ = ["CalibrationSettings", "CalibrationStudy", "Measured", "run_calibration"]

FloatArray = NDArray[np.float64]


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
    design: Design = "sobol"
    kernel: Kernel = "squared-exponential"
    trend: Trend = "linear"
    method: Method = "auto"
    seed: int = Field(0, ge=0)

    @field_validator("noise_sd", mode="before")
    @classmethod
    def _positive_or_unknown(cls, given: Any) -> Any:
        is_number = isinstance(given, int | float) and not isinstance(given, bool)
        if given != "unknown" and not (is_number and 0 < given < inf):
            raise ValueError(f"must be a positive number in the unit of what was measured, or 'unknown', not {given!r}")
        return given

    @model_validator(mode="after")
    def _one_model(self) -> Self:
        if (self.forward is None) == (self.umbridge is None):
            raise ValueError("give one forward model: a function in a file (forward) or a server (umbridge), not both")
        return self

    @property
    def forward_model(self) -> Forward:
        """What is run."""
        return UmbridgeForward(self.umbridge, self.model) if self.umbridge else FileForward(str(self.forward))

    @property
    def own_priors(self) -> dict[str, Prior]:
        """Of the parameters, by name."""
        return {symbol: prior_from(given) for symbol, given in self.priors.items()}


@dataclass(frozen=True, eq=False)
class Measured:
    """Two columns of a file: what was set and what was measured, with their names and units."""

    control: FloatArray
    measured: FloatArray
    control_label: str
    measured_label: str


@dataclass(frozen=True)
class CalibrationStudy:
    """What was found."""

    settings: CalibrationSettings
    data: Measured
    calibration: Calibration
    seconds: float

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
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
    data = _read(settings, folder)
    start = perf_counter()
    names = ("discrepancy", "noise_sd", "zero_load", "runs", "refine", "design", "kernel", "trend", "method", "seed")
    calibration = calibrate(
        data.control,
        data.measured,
        settings.forward_model,
        settings.own_priors,
        folder=runs_in,
        workers=workers,
        step=step,
        **{name: getattr(settings, name) for name in names},
    )
    return CalibrationStudy(settings, data, calibration, perf_counter() - start)


def _read(settings: CalibrationSettings, folder: Path) -> Measured:
    table = read_table(folder / settings.file, settings.skip_rows, settings.sheet)
    places = _places(table, (settings.control, settings.measured))
    control, measured = (column[:: settings.every] for column in table.numbers(places))
    return Measured(control, measured, *(_label(table, place) for place in places))


def _places(table: Table, asked: Sequence[str | int | None]) -> tuple[int, int]:
    """Return the columns of the control and of what was measured, counted from 0."""
    if None in asked:
        if asked != (None, None) or len(table.names) != 2:
            names = ", ".join(table.label(place) for place in range(len(table.names)))
            raise InputError(
                f"{table.file} has the columns {names}: say which one is the control, such as a depth, and which one "
                "was measured, such as a force (--control NAME --measured NAME)."
            )
        return 0, 1
    found = [_place(table, each) for each in asked if each is not None]
    if found[0] == found[1]:
        raise InputError(
            f"{table.file}: the control and what was measured are the same column {table.label(found[0])}."
        )
    return found[0], found[1]


def _place(table: Table, asked: str | int) -> int:
    own = [place for place, name in enumerate(table.names) if name == asked]
    if own:
        return own[0]
    if isinstance(asked, int) and 1 <= asked <= len(table.names):
        return asked - 1
    raise InputError(f"{table.file} has no column '{asked}'; it has {', '.join(filter(None, table.names))}.")


def _label(table: Table, place: int) -> str:
    unit = table.units[place].strip("[]() ")
    name = table.names[place] or f"column {place + 1}"
    return f"{name} [{unit}]" if unit else name
