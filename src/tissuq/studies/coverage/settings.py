"""What a campaign runs over."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.errors import InputError, TissuqError
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics.path import invariants
from tissuq.studies.coverage.formulations import check_formulation
from tissuq.studies.coverage.truths import FAMILIES, LEAST_LIMIT

__all__ = ["PRESETS", "CoverageSettings", "Design", "preset"]

PRESETS = ("designs", "formulations", "strength", "rivals")
BLOCK = 50
"""Data sets of one task."""


class Design(BaseModel):
    """Where a specimen is measured, and with what noise (MPa)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    low: float = Field(ge=0.1, le=10)
    high: float = Field(ge=0.1, le=10)
    points: int = Field(ge=3, le=10_000)
    noise_sd: float = Field(gt=0, allow_inf_nan=False)
    mode: str = "uniaxial"

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low ({self.low}) must be less than high ({self.high})")
        return self

    @field_validator("mode")
    @classmethod
    def _known_mode(cls, name: str) -> str:
        try:
            loading_mode(name)
        except TissuqError as error:
            raise ValueError(str(error)) from error
        return name

    @property
    def label(self) -> str:
        """A short name."""
        mode = "" if self.mode == "uniaxial" else f"{self.mode} "
        return f"{mode}[{self.low:g}, {self.high:g}] n={self.points} sd={self.noise_sd:g}"

    @property
    def stretch(self) -> NDArray[np.float64]:
        """Equally spaced stretches."""
        return np.linspace(self.low, self.high, self.points)


class CoverageSettings(BaseModel):
    """Truths x designs x formulations x replicates; each replicate is another material of its family and other noise.

    ``strengths`` multiply how far the truths are from neo-Hookean ones.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    families: tuple[str, ...] = Field(tuple(FAMILIES), min_length=1)
    designs: tuple[Design, ...] = Field(min_length=1)
    formulations: tuple[str, ...] = Field(("none", "yeoh", "gp", "auto"), min_length=1)
    strengths: tuple[Annotated[float, Field(ge=0, le=1)], ...] = Field((1.0,), min_length=1)
    replicates: int = Field(50, ge=1, le=100_000)
    noise: Literal["known", "unknown"] = "known"
    prob: float = Field(0.95, gt=0, lt=1)
    seed: int = Field(0, ge=0)

    @field_validator("families", "designs", "formulations", "strengths")
    @classmethod
    def _each_once(cls, given: tuple[Any, ...]) -> tuple[Any, ...]:
        for place, each in enumerate(given):
            if each in given[:place]:
                raise ValueError(f"{each} is there twice, which would count the same fits twice")
        return given

    @model_validator(mode="after")
    def _within_reach(self) -> Self:
        for design in self.designs if "gent" in self.families else ():
            reach = float(invariants(loading_mode(design.mode), design.stretch)[0].max())
            if reach >= 0.95 * LEAST_LIMIT:
                raise ValueError(
                    f"design {design.label}: I1 - 3 reaches {reach:.3g}, and Gent materials lock at {LEAST_LIMIT:g} or "
                    "above; measure less far, or leave out the family gent"
                )
        return self

    @field_validator("families")
    @classmethod
    def _known_families(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in FAMILIES:
                raise ValueError(f"there is no family '{name}'; there are {', '.join(FAMILIES)}")
        return names

    @field_validator("formulations")
    @classmethod
    def _known_formulations(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            try:
                check_formulation(name)
            except TissuqError as error:
                raise ValueError(str(error)) from error
        return names


def preset(name: str) -> dict[str, object]:
    """Return the settings of a preset, by name, as TOML gives them.

    Raises
    ------
    InputError
        When there is no such preset.
    """
    if name not in PRESETS:
        raise InputError(f"there is no preset '{name}'. Choose one of: {', '.join(PRESETS)}.")
    return tomllib.loads((files("tissuq.studies.coverage") / "presets" / f"{name}.toml").read_text(encoding="utf-8"))
