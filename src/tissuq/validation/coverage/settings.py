"""What a campaign runs over."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError, TissuqError
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics.invariants import largest_invariants
from tissuq.model.discrepancy import discrepancy_named
from tissuq.parameters.priors import Prior, prior_from
from tissuq.studies.campaign_settings import CoverageOptions, each_once, names_among
from tissuq.studies.settings import looked_up, there_is
from tissuq.validation.coverage.fitted import model_of, parameters_of, parts_of
from tissuq.validation.coverage.truths import FAMILIES, FIXED, MIN_LOCKING_LIMIT, TRUTHS

PRESETS = (
    "paper",
    "panel",
    "random-materials",
    "strength",
    "formulations",
    "transfer",
    "rivals",
    "further-families",
    "small-strains",
)
BLOCK = 50
"""Number of data sets of one task."""
LOCKING = {"gent": MIN_LOCKING_LIMIT, "gent-gent": MIN_LOCKING_LIMIT, "fixed-gent": 30.0}
"""The smallest I1 - 3 at which truths have no finite stress."""


def _curve(name: str) -> None:
    if not loading_mode(name).is_curve:
        raise ModelError(f"a campaign needs a loading mode with one stress and one stretch, which '{name}' is not")


def _parts(name: str) -> None:
    for discrepancy in parts_of(name):
        discrepancy_named(discrepancy)


class Design(BaseModel):
    """Where a specimen is measured, and with what noise (MPa, or times C10 in a campaign with a scale)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    low: float = Field(ge=0.1, le=10)
    high: float = Field(ge=0.1, le=10)
    points: int = Field(ge=3, le=10_000)
    noise_sd: float = Field(gt=0, allow_inf_nan=False)
    mode: str = "uniaxial"

    _known_mode = field_validator("mode")(there_is(_curve))

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low ({self.low}) must be less than high ({self.high})")
        return self

    @property
    def label(self) -> str:
        """A short name."""
        mode = "" if self.mode == "uniaxial" else f"{self.mode} "
        return f"{mode}[{self.low:g}, {self.high:g}] n={self.points} sd={self.noise_sd:g}"

    @property
    def stretch(self) -> FloatArray:
        """Equally spaced stretches."""
        return np.linspace(self.low, self.high, self.points)


class CoverageSettings(CoverageOptions):
    """Truths x designs x noise x formulations x replicates; each replicate is another member of its family, and noise.

    ``families`` names families and fixed materials; ``strengths`` multiply how far they are from neo-Hookean ones.
    With ``scale`` C10 of the families is log-uniform between its ends (MPa), and the noise of every design is in units
    of C10. ``priors`` replace those of the parameters that a formulation has. ``predictive`` asks for the share of new
    measurements inside predictive bands, ``unseen`` for the true stress in loading modes that were not measured.
    """

    families: tuple[str, ...] = Field(tuple(FAMILIES), min_length=1)
    designs: tuple[Design, ...] = Field(min_length=1)
    formulations: tuple[str, ...] = Field(("none", "yeoh", "gp", "auto"), min_length=1)
    strengths: tuple[Annotated[float, Field(ge=0, le=1)], ...] = Field((1.0,), min_length=1)
    scale: tuple[Annotated[float, Field(gt=0, allow_inf_nan=False)], ...] = Field((), max_length=2)
    priors: dict[str, dict[str, Any]] = Field(default_factory=dict)
    predictive: bool = False
    unseen: tuple[str, ...] = ()
    prob: float = Field(0.95, gt=0, lt=1)
    most_fits: int = Field(1_000_000, ge=1)

    _once = field_validator("families", "designs", "formulations", "strengths", "noise", "unseen")(each_once)
    _known_families = field_validator("families")(names_among(TRUTHS, "family"))
    _known_formulations = field_validator("formulations")(there_is(_parts))
    _known_modes = field_validator("unseen")(there_is(_curve))

    @field_validator("scale")
    @classmethod
    def _two_ends(cls, ends: tuple[float, ...]) -> tuple[float, ...]:
        if ends and (len(ends) < 2 or ends[0] >= ends[1]):
            raise ValueError("needs a smaller and a larger C10 in MPa, such as [0.001, 100.0]")
        return ends

    @field_validator("priors")
    @classmethod
    def _known_priors(cls, priors: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        return {symbol: looked_up(prior_from, prior).as_dict() for symbol, prior in priors.items()}

    @model_validator(mode="after")
    def _within_limits(self) -> Self:
        if self.fits > self.most_fits:
            raise ValueError(
                f"{self.fits:,} fits are requested, but most_fits is {self.most_fits:,}: take fewer "
                "families, designs, noises, strengths, formulations or replicates, or raise most_fits"
            )
        fixed = [name for name in self.families if name in FIXED]
        if self.scale and fixed:
            raise ValueError(f"a scale applies to families, but {', '.join(fixed)} has a fixed C10")
        return self

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for design in self.designs:
            reach = largest_invariants(loading_mode(design.mode).at(design.stretch))[0]
            for family in LOCKING.keys() & self.families:
                if reach >= 0.95 * LOCKING[family]:
                    raise ValueError(
                        f"design {design.label}: I1 - 3 reaches {reach:.3g}, and Gent materials lock at "
                        f"{LOCKING[family]:g} or above; use smaller stretches, or leave out {family}"
                    )
            if design.mode in self.unseen:
                raise ValueError(f"design {design.label} measures {design.mode} stress, so it is not unseen")
            for formulation in self.formulations:
                for noise in self.noise:
                    noise_sd = design.noise_sd if noise == "known" else noise
                    try:
                        for discrepancy in parts_of(formulation):
                            model_of(discrepancy, design.mode, design.stretch, noise_sd, self.chosen_priors)
                    except TissuqError as error:
                        combination = f"design {design.label} with '{formulation}' and {noise} noise"
                        raise ValueError(f"{combination}: {error}") from error
        symbols = parameters_of(self.formulations)
        for symbol in self.priors.keys() - symbols:
            raise ValueError(
                f"priors: there is no parameter '{symbol}'; those of the formulations and the noise are "
                f"{', '.join(sorted(symbols))}"
            )
        return self

    @property
    def cells(self) -> int:
        """How many combinations there are of everything but families and replicates."""
        return len(self.designs) * len(self.strengths) * len(self.noise) * len(self.formulations)

    @property
    def fits(self) -> int:
        """How many posteriors are computed."""
        return self.cells * len(self.families) * self.replicates

    @property
    def chosen_priors(self) -> dict[str, Prior]:
        """The priors that are given."""
        return {symbol: prior_from(prior) for symbol, prior in self.priors.items()}


def preset(name: str) -> dict[str, object]:
    """Return the settings of a preset, by name, as TOML gives them.

    Raises
    ------
    InputError
        When there is no such preset.
    """
    if name not in PRESETS:
        raise InputError(f"there is no preset '{name}'. Choose one of: {', '.join(PRESETS)}.")
    return tomllib.loads((files("tissuq.validation.coverage") / "presets" / f"{name}.toml").read_text(encoding="utf-8"))
