"""What a calibration of an expensive model depends on."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import field_validator, model_validator

from tissuq.studies.option import Settings, argument, option
from tissuq.studies.option_texts import column, priors, sd_or_unknown
from tissuq.studies.settings import positive_or_unknown
from tissuq.studies.shared_options import seed

if TYPE_CHECKING:
    from tissuq.emulation.forward import Forward
    from tissuq.parameters.priors import Prior

__all__ = ["CalibrationSettings"]

NUMBER = r"\d+\.?\d*"
RANGE = re.compile(rf"{NUMBER}:{NUMBER}")
"""Smallest and largest stretch."""


class CalibrationSettings(Settings):
    """Everything that a calibration depends on, in the units of the forward model."""

    file: str = argument(
        ..., "CSV or Excel file with a column of controls and one of measured values.", takes=Path, parse=str
    )
    forward: str | None = option(
        None, "Function of the model: file.py:function or package.module:function. Its code is run."
    )
    umbridge: str | None = option(None, "Instead: address of an UM-Bridge server, such as http://localhost:4242.")
    model: str = option("forward", "Name of the model on that server.")
    priors: dict[str, dict[str, Any]] = option(
        ...,
        "Prior of a parameter in the model's units, such as C10=uniform(0.1,5); repeat for each.",
        name="prior",
        parse=priors,
        min_length=1,
    )
    control: str | int | None = option(None, "Column of the control [the first of two].", parse=column)
    measured: str | int | None = option(None, "Column of the measured values [the second of two].", parse=column)
    discrepancy: str = option("none", "none, gp, or gp-pinned (zero with its slope at zero load).")
    noise_sd: float | Literal["unknown"] = option(
        "unknown",
        "Sd of the noise, in the unit of the measured values, or unknown.",
        takes=str,
        parse=sd_or_unknown,
    )
    zero_load: float = option(0.0, "Control at zero load.")
    runs: int = option(40, "Runs of the model over the priors.", ge=1)
    refine: int = option(0, "Further runs at most, where the posterior is and the emulator unsure.", ge=0)
    design: str = option("sobol", "sobol or latin.", choices="tissuq.emulation.runs:PointSet")
    kernel: str = option(
        "squared-exponential",
        "squared-exponential or matern-5/2.",
        choices="tissuq.emulation.length_scales:Kernel",
    )
    trend: str = option(
        "linear", "Mean: constant, linear or quadratic.", choices="tissuq.emulation.length_scales:Trend"
    )
    method: str = option("auto", "auto, importance or nuts.", choices="tissuq.emulation.problem:Method")
    material: str | None = option(
        None, "Law in the model with all its parameters: predict, export and structure then take the run."
    )
    range: str | None = option(None, "With --material: smallest and largest stretch, such as 0.7:1.3.")
    mode: str = option("uniaxial", "With --material: loading mode of the range.")
    unit: str = option("MPa", "With --material: the model's unit of stress.")
    every: int = option(1, "Use only every N-th row.", ge=1)
    sheet: str | int | None = option(None, "Sheet of an Excel workbook, by name or number.", parse=column)
    skip_rows: int = option(0, "Lines to skip at the top of the file.", ge=0)
    seed: int = seed()

    @field_validator("noise_sd", mode="before")
    @classmethod
    def _positive_or_unknown(cls, value: Any) -> Any:
        return positive_or_unknown(value, "the unit of the measured values")

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
        from tissuq.emulation import FileForward, UmbridgeForward

        return UmbridgeForward(self.umbridge, self.model) if self.umbridge else FileForward(str(self.forward))

    @property
    def parameter_priors(self) -> dict[str, Prior]:
        """Of the parameters, by name."""
        from tissuq.parameters.priors import prior_from

        return {symbol: prior_from(prior) for symbol, prior in self.priors.items()}
