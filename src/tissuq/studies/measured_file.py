"""Settings that studies of measured files share: how a file is read, which material and noise are fitted."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any, Literal, Self, cast

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.experiment_file import Reading, read_file
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.units import StressUnit
from tissuq.model.noise import Noise, noise_named
from tissuq.parameters.seeds import MAX_SEED
from tissuq.posterior.solver import Method

__all__ = ["FittedSettings", "MeasuredFile", "MeasuredTest", "ReadingSettings"]


class ReadingSettings(BaseModel):
    """The options of :func:`tissuq.read_experiment`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    mode: str | None = None
    columns: dict[str, str | int] = Field(default_factory=dict)
    stress_unit: str | None = None
    stress_type: str | None = None
    strain_type: str | None = None
    strain_unit: str | None = None
    force_unit: str | None = None
    displacement_unit: str | None = None
    zero: str | None = None
    mean_of: int | None = Field(None, ge=2)
    dimensions: dict[str, str] = Field(default_factory=dict)
    only: dict[str, str | int] = Field(default_factory=dict)
    compression_positive: bool | None = None
    turn: str | None = None
    load_zero: str | None = None
    cycle: str | int | None = None
    branch: str | None = None
    compliance: str | None = None
    leave_out: str | None = None
    preload: str | None = None
    stretch_range: tuple[float, float] | None = None
    until_peak: bool = False
    every: int = Field(1, ge=1)
    axis: str | None = None
    sheet: str | int | None = None
    table: int | None = Field(None, ge=1)
    skip_rows: int = Field(0, ge=0)

    @property
    def reading_options(self) -> ReadingOptions:
        """How to read a file."""
        return cast(ReadingOptions, {name: getattr(self, name) for name in ReadingSettings.model_fields})


class MeasuredFile(ReadingSettings):
    """A file, and how to read it."""

    file: str
    name: str | None = None

    def reading(self, folder: Path = Path(), found: Reading | None = None) -> Reading:
        """Return what is read from the file, a relative one in ``folder``, unless that has been found already.

        It is named as the settings say, or as the file.
        """
        reading = found or read_file(folder / self.file, **self.reading_options)
        return replace(reading, experiment=reading.experiment.labelled(name=self.name or Path(self.file).stem))

    def experiment(self, folder: Path = Path()) -> Experiment:
        """Read the measurements; a relative file lies in ``folder``."""
        return self.reading(folder).experiment


class MeasuredTest(MeasuredFile):
    """One of several files that are fitted together."""

    specimen: str = ""
    direction: str = ""
    condition: str = ""
    noise_sd: float | None = Field(None, gt=0)

    def reading(self, folder: Path = Path(), found: Reading | None = None) -> Reading:
        """Return what is read from the file, with the specimen, the direction and the condition that are stated."""
        reading = super().reading(folder, found)
        stated = {"specimen": self.specimen, "direction": self.direction, "condition": self.condition}
        labels = {name: label for name, label in stated.items() if label}
        return replace(reading, experiment=reading.experiment.labelled(**labels))


class FittedSettings(BaseModel):
    """What is fitted; the noise is in the files' unit of stress."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    material: str = "neo-hookean"
    noise_sd: float | Literal["unknown"] = "unknown"
    noise: Literal["unknown", "independent", "proportional", "repeats", "autoregressive"] | None = None
    method: Method = "auto"
    seed: int = Field(0, ge=0, le=MAX_SEED)

    @field_validator("noise_sd", mode="before")
    @classmethod
    def _positive_or_unknown(cls, value: Any) -> Any:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if value != "unknown" and not (is_number and 0 < value < inf):
            raise ValueError(
                f"must be a positive number in the file's stress unit, or 'unknown', not {value!r}; noise of zero "
                "would make every measurement exact"
            )
        return value

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        if self.noise is not None and self.noise_sd != "unknown":
            raise ValueError(f"give noise_sd or noise, not both (noise_sd is {self.noise_sd}, noise is '{self.noise}')")
        return self

    def noise_in(self, unit: StressUnit) -> Noise:
        """Return the noise, a known standard deviation converted from a unit to MPa."""
        if self.noise_sd == "unknown":
            return noise_named(self.noise or "unknown")
        return noise_named(self.noise_sd * unit.to_mpa)
