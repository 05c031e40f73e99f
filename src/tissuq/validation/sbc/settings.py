"""What a calibration by simulation runs over."""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.errors import TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import material_named
from tissuq.model.discrepancy import discrepancies, discrepancy_named
from tissuq.model.scales import default_prior
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Flat, HalfCauchy, Normal, Prior, Uniform, prior_from
from tissuq.parameters.seeds import MAX_SEED
from tissuq.validation.coverage.fitted import model_of, parameters_of
from tissuq.validation.coverage.settings import Design

__all__ = ["SbcSettings"]

PRIORS: dict[str, Prior] = {
    "C10": Uniform(0.5, 1.5),
    **{symbol: Normal(0, 0.3) for symbol in ("m0", "m1", "m2", "C01")},
    "C20": Normal(0, 0.2),
    "C30": Normal(0, 0.1),
    "S": Uniform(0, 0.5),
    "c": Uniform(0, 1),
    "psi": Uniform(0.2, 2),
    "c1": HalfCauchy(0.1),
    "c2": HalfCauchy(0.1),
    "noise_sd": Uniform(0.05, 0.5),
}
POSITIVE, ABOUT_ZERO = Uniform(0.5, 1.5), Normal(0, 0.3)
"""Priors of a material's linear parameters that have none above, MPa."""


class SbcSettings(BaseModel):
    """Formulations x noise x replicates of a material; in each, parameters from the priors, data, and a fit.

    The priors (MPa; psi in stretch) are the same for every data set: none is taken from the data. Known noise is that
    of the design.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    material: str = "neo-hookean"
    formulations: tuple[str, ...] = Field(default_factory=lambda: tuple(discrepancies()), min_length=1)
    noise: tuple[Literal["known", "unknown"], ...] = Field(("known", "unknown"), min_length=1)
    design: Design = Design(low=0.6, high=2.0, points=30, noise_sd=0.2)
    priors: dict[str, dict[str, Any]] = Field(default_factory=lambda: {s: p.as_dict() for s, p in PRIORS.items()})
    replicates: int = Field(300, ge=20, le=100_000)
    seed: int = Field(0, ge=0, le=MAX_SEED)

    @field_validator("noise", mode="before")
    @classmethod
    def _one_or_more(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @field_validator("formulations", "noise")
    @classmethod
    def _each_once(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(values)) < len(values):
            raise ValueError("an entry is given twice, which would count the same fits twice")
        return values

    @model_validator(mode="after")
    def _possible(self) -> Self:
        try:
            priors = self.chosen_priors
            for formulation in self.formulations:
                parameters = (*material_named(self.material).parameters, *discrepancy_named(formulation).parameters)
                missing = [p.symbol for p in parameters if isinstance(priors.get(p.symbol, Flat()), Flat)]
                if missing:
                    raise ValueError(f"'{formulation}' needs proper priors of {', '.join(missing)} to be drawn from")
                for noise in self.noise:
                    self.model(formulation, noise)
            known = parameters_of(self.formulations, material_named(self.material))
            for symbol in self.priors.keys() - known - PRIORS.keys():
                raise ValueError(
                    f"priors: there is no parameter '{symbol}'; those of the material, the formulations and the noise "
                    f"are {', '.join(sorted(known))}"
                )
        except TissuqError as error:
            raise ValueError(str(error)) from error
        return self

    @property
    def chosen_priors(self) -> dict[str, Prior]:
        """The given priors, and ours for what is not given.

        Those of a material's other parameters are positive about 1 MPa or normal about zero where they are linear, and
        otherwise its default priors on this design.
        """
        priors = PRIORS | {symbol: prior_from(prior) for symbol, prior in self.priors.items()}
        stretch = self.design.stretch
        scale = Experiment(self.design.mode, stretch, np.ones(len(stretch)))
        for parameter in material_named(self.material).parameters:
            if parameter.symbol not in priors:
                linear = POSITIVE if parameter.support[0] >= 0 else ABOUT_ZERO
                priors[parameter.symbol] = linear if parameter.is_linear else default_prior(parameter, scale)
        return priors

    def model(self, formulation: str, noise: str) -> StatisticalModel:
        """Return the model of a formulation, on data that do not matter."""
        noise_sd = self.design.noise_sd if noise == "known" else noise
        law = material_named(self.material)
        return model_of(formulation, self.design.mode, self.design.stretch, noise_sd, self.chosen_priors, law)
