"""Files of measurements and how to read them: what the commands that read them have in common."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

from pydantic import BaseModel, ConfigDict, Field

from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading import Reading, ReadingOptions, read_file

__all__ = ["MeasuredFile", "MeasuredTest", "ReadingSettings"]


class ReadingSettings(BaseModel):
    """The options of :func:`tissuq.read_experiment`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    mode: str = "uniaxial"
    columns: dict[str, str | int] = Field(default_factory=dict)
    stress_unit: str | None = None
    stress_type: str = "engineering"
    strain_unit: str | None = None
    force_unit: str | None = None
    displacement_unit: str | None = None
    dimensions: dict[str, str] = Field(default_factory=dict)
    compression_positive: bool = False
    cycle: str | int | None = None
    branch: str | None = None
    preload: str | None = None
    every: int = Field(1, ge=1)
    axis: str | None = None
    sheet: str | int | None = None
    skip_rows: int = Field(0, ge=0)

    @property
    def reading_options(self) -> ReadingOptions:
        """How to read a file."""
        return cast(ReadingOptions, {name: getattr(self, name) for name in ReadingSettings.model_fields})


class MeasuredFile(ReadingSettings):
    """A file, and how to read it."""

    file: str

    def reading(self, folder: Path = Path()) -> Reading:
        """Read the file, a relative one in ``folder``, and keep what was done on the way."""
        return read_file(folder / self.file, **self.reading_options)

    def experiment(self, folder: Path = Path()) -> Experiment:
        """Read the measurements; a relative file lies in ``folder``."""
        return self.reading(folder).experiment


class MeasuredTest(MeasuredFile):
    """One of several files that are fitted together."""

    name: str | None = None
    specimen: str = ""
    noise_sd: float | None = Field(None, gt=0)

    def reading(self, folder: Path = Path()) -> Reading:
        """Read the file, and say which specimen it was."""
        found = super().reading(folder)
        named = replace(found.experiment, name=self.name or found.experiment.name, specimen=self.specimen)
        return replace(found, experiment=named)
