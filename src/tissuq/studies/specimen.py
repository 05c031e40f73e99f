"""The study of one measured file: a material fitted with each chosen discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tissuq.discrepancy import discrepancies, discrepancy_named
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading import read_experiment
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.fitting import Sampler, fit
from tissuq.mechanics import material_named
from tissuq.model import NOISE
from tissuq.parameters import Parameter
from tissuq.posterior import Posterior
from tissuq.priors import Prior, prior_from

__all__ = ["ALL", "SpecimenSettings", "SpecimenStudy", "run_specimen"]

ALL = "all"
"""In place of discrepancies: every one that applies to the material."""


class SpecimenSettings(BaseModel):
    """Everything that a fit of a file depends on; stresses (noise, priors) in the file's unit of stress."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: str
    mode: str = "uniaxial"
    columns: dict[str, str | int] = Field(default_factory=dict)
    stress_unit: str | None = None
    stress_type: str = "engineering"
    strain_unit: str | None = None
    compression_positive: bool = False
    skip_rows: int = Field(0, ge=0)
    material: str = "neo-hookean"
    discrepancies: tuple[str, ...] = Field((ALL,), min_length=1)
    noise_sd: float | Literal["unknown"] = "unknown"
    priors: dict[str, dict[str, Any]] = Field(default_factory=dict)
    sampler: Sampler = "auto"
    seed: int = Field(0, ge=0)

    def experiment(self, folder: Path = Path()) -> Experiment:
        """Read the measurements; a relative file lies in ``folder``."""
        return read_experiment(
            folder / self.file,
            mode=self.mode,
            columns=self.columns or None,
            stress_unit=self.stress_unit,
            stress_type=self.stress_type,
            strain_unit=self.strain_unit,
            compression_positive=self.compression_positive,
            skip_rows=self.skip_rows,
        )


@dataclass(frozen=True)
class SpecimenStudy:
    """What was found: a posterior for each discrepancy, and why some do not apply."""

    settings: SpecimenSettings
    experiment: Experiment
    posteriors: dict[str, Posterior]
    seconds: dict[str, float]
    skipped: dict[str, str]

    @property
    def unit(self) -> StressUnit:
        """The unit in which the file gives stresses."""
        return stress_unit(self.experiment.stress_unit)

    @property
    def not_converged(self) -> list[str]:
        """Discrepancies with which sampling has not converged."""
        return [name for name, posterior in self.posteriors.items() if posterior.solution.is_approximate]


def run_specimen(
    settings: SpecimenSettings, folder: Path = Path(), step: Callable[[str], None] = lambda text: None
) -> SpecimenStudy:
    """Read the file and fit the material with every chosen discrepancy.

    Raises
    ------
    InputError, ModelError
        When file or settings cannot be used. A discrepancy that does not apply is an error when it was named, and is
        skipped with the reason when all were asked for.
    """
    experiment = settings.experiment(folder)
    unit = stress_unit(experiment.stress_unit)
    names = list(discrepancies()) if settings.discrepancies == (ALL,) else list(settings.discrepancies)
    priors = _priors(settings, names, unit)
    posteriors, seconds, skipped = {}, {}, {}
    for name in names:
        step(name)
        start = perf_counter()
        own = {p.symbol for p in _parameters(settings, name)}
        try:
            posteriors[name] = fit(
                experiment,
                material=settings.material,
                discrepancy=name,
                noise_sd=settings.noise_sd if settings.noise_sd == "unknown" else settings.noise_sd * unit.to_mpa,
                priors={symbol: prior for symbol, prior in priors.items() if symbol in own},
                sampler=settings.sampler,
                seed=settings.seed,
            )
            seconds[name] = perf_counter() - start
        except ModelError as error:
            if settings.discrepancies != (ALL,):
                raise
            skipped[name] = str(error)
    if not posteriors:
        raise ModelError("no discrepancy applies: " + " ".join(skipped.values()))
    return SpecimenStudy(settings, experiment, posteriors, seconds, skipped)


def _parameters(settings: SpecimenSettings, discrepancy: str) -> tuple[Parameter, ...]:
    noise = (NOISE,) if settings.noise_sd == "unknown" else ()
    return (*material_named(settings.material).parameters, *discrepancy_named(discrepancy).parameters, *noise)


def _priors(settings: SpecimenSettings, names: list[str], unit: StressUnit) -> Mapping[str, Prior]:
    """Return the chosen priors in MPa and stretch."""
    known = {p.symbol: p for name in names for p in _parameters(settings, name)}
    unknown = sorted(set(settings.priors) - set(known))
    if unknown:
        raise InputError(f"there is a prior for '{unknown[0]}', but the parameters of this fit are {', '.join(known)}.")
    return {
        symbol: prior_from(given).scaled(unit.to_mpa if known[symbol].dimension == "stress" else 1.0)
        for symbol, given in settings.priors.items()
    }
