"""What a run of the paper's study depends on; the defaults are the paper's, or stand in for what it leaves out."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import NeoHookean, Yeoh, simulate
from tissuq.model.discrepancy import discrepancy_named
from tissuq.parameters.priors import Prior, Uniform, prior_from
from tissuq.parameters.seeds import MAX_SEED

__all__ = ["FORMULATIONS", "PaperSettings"]

FORMULATIONS = ("none", "constant", "linear", "quadratic", "mooney-rivlin", "yeoh", "gp")
"""The paper's seven formulations of model uncertainty, in its order."""

TRUTH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}

PRIORS: dict[str, Prior] = {
    "C10": Uniform(0, 10),
    **{symbol: Uniform(-50, 50) for symbol in ("m0", "m1", "m2", "C01", "C20", "C30")},
    "S": Uniform(0, 10),
    "c": Uniform(0, 1),
    "psi": Uniform(0.05, 10),
}


class PaperSettings(BaseModel):
    """Everything that a run of the study depends on; stresses in MPa.

    The paper prints the true parameters, the noise and that priors are wide and uniform. It prints neither the
    number of points, the stretch range nor the bounds of the priors: those defaults are ours.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    points: int = Field(30, ge=6, le=10_000, description="number of measurements")
    stretch_low: float = Field(0.5, gt=0, allow_inf_nan=False, description="smallest stretch")
    stretch_high: float = Field(4.25, gt=0, allow_inf_nan=False, description="largest stretch")
    noise_sd: float = Field(0.5, gt=0, allow_inf_nan=False, description="standard deviation of the noise, MPa")
    seed: int = Field(2021, ge=0, le=MAX_SEED, description="seed of noise and draws")
    replicates: int = Field(1, ge=1, le=10_000, description="data sets over which the claims are checked")
    sampler: Literal["exact", "nuts", "both"] = "exact"
    truth: dict[str, float] = Field(default_factory=lambda: dict(TRUTH))
    priors: dict[str, dict[str, Any]] = Field(default_factory=lambda: {s: p.as_dict() for s, p in PRIORS.items()})

    @field_validator("priors")
    @classmethod
    def _complete_priors(cls, priors: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        unknown = sorted(set(priors) - set(PRIORS))
        if unknown:
            raise ValueError(f"no parameter is named {', '.join(unknown)}; there are {', '.join(PRIORS)}")
        try:
            return {symbol: prior_from(priors[symbol]).as_dict() if symbol in priors else p.as_dict()
                    for symbol, p in PRIORS.items()}  # fmt: skip
        except InputError as error:
            raise ValueError(str(error)) from error

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.stretch_low >= self.stretch_high:
            raise ValueError(f"stretch_low {self.stretch_low:g} must be less than stretch_high {self.stretch_high:g}")
        if sorted(self.truth) != sorted(TRUTH):
            raise ValueError(f"truth needs exactly {', '.join(TRUTH)}")
        return self

    @property
    def stretch(self) -> NDArray[np.float64]:
        """The measured stretches, evenly spaced."""
        return np.linspace(self.stretch_low, self.stretch_high, self.points)

    def experiment(self, replicate: int = 0) -> Experiment:
        """Return the synthetic measurements; replicates differ in their noise alone."""
        return simulate(Yeoh(), self.truth, self.stretch, self.noise_sd, self.seed + replicate)

    def priors_of(self, formulation: str) -> dict[str, Prior]:
        """Return the priors of the parameters that a formulation has."""
        parameters = (*NeoHookean.parameters, *discrepancy_named(formulation).parameters)
        return {p.symbol: prior_from(self.priors[p.symbol]) for p in parameters}
