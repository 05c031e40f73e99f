"""What every study of measured files fits to them: the material, the noise, and how."""

from __future__ import annotations

from math import inf
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.experiments.units import StressUnit
from tissuq.fitting import Method
from tissuq.noise import Noise, noise_named

__all__ = ["FittedSettings"]


class FittedSettings(BaseModel):
    """What is fitted; the noise is in the files' unit of stress."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    material: str = "neo-hookean"
    noise_sd: float | Literal["unknown"] = "unknown"
    noise: Literal["unknown", "proportional", "repeats", "autoregressive"] | None = None
    method: Method = "auto"
    seed: int = Field(0, ge=0)

    @field_validator("noise_sd", mode="before")
    @classmethod
    def _positive_or_unknown(cls, given: Any) -> Any:
        is_number = isinstance(given, int | float) and not isinstance(given, bool)
        if given != "unknown" and not (is_number and 0 < given < inf):
            raise ValueError(
                f"must be a positive number in the file's stress unit, or 'unknown', not {given!r}; noise of zero "
                "would make every measurement exact"
            )
        return given

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
