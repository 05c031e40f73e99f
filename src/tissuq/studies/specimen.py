"""The study of one measured file: a material fitted with each chosen discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from pydantic import Field, field_validator

from tissuq.assessment import Assessment, design_warnings
from tissuq.discrepancy import Auto, ConditionedProcess, EnergyDiscrepancy, discrepancies, discrepancy_named
from tissuq.errors import ConvergenceError, InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading import read_experiment
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.fitting import fit
from tissuq.mechanics import Material, material_named
from tissuq.parameters import Parameter
from tissuq.posterior import Posterior
from tissuq.priors import Prior, prior_from
from tissuq.studies.measured import MeasuredSettings

__all__ = ["ALL", "SpecimenSettings", "SpecimenStudy", "run_specimen"]

ALL = "all"
"""In place of discrepancies: the paper's and the average of energies, where they apply to the material."""


class SpecimenSettings(MeasuredSettings):
    """Everything that a fit of a file depends on; stresses (noise, priors) in the file's unit of stress."""

    file: str
    discrepancies: tuple[str, ...] = Field((Auto.name,), min_length=1)
    priors: dict[str, dict[str, float | str]] = Field(default_factory=dict)

    @field_validator("discrepancies")
    @classmethod
    def _all_or_named(cls, given: tuple[str, ...]) -> tuple[str, ...]:
        if ALL in given and given != (ALL,):
            raise ValueError(f"'{ALL}' stands alone; leave it out, or leave out the names beside it")
        return given

    def experiment(self, folder: Path = Path()) -> Experiment:
        """Read the measurements; a relative file lies in ``folder``."""
        return read_experiment(folder / self.file, **self.reading)


@dataclass(frozen=True)
class SpecimenStudy:
    """What was found: a posterior for each discrepancy, why some do not apply, and what those that do, do.

    Sampled posteriors are not assessed, which would sample them again.
    """

    settings: SpecimenSettings
    experiment: Experiment
    posteriors: dict[str, Posterior]
    seconds: dict[str, float]
    skipped: dict[str, str]
    assessments: dict[str, Assessment]

    @property
    def unit(self) -> StressUnit:
        """The unit in which the file gives stresses."""
        return stress_unit(self.experiment.stress_unit)

    @property
    def warnings(self) -> list[str]:
        """What a reader must know of the data and the fits, each once with the discrepancies that it concerns."""
        concerned: dict[str, list[str]] = {}
        for name, posterior in self.posteriors.items():
            for text in posterior.warnings:
                concerned.setdefault(text, []).append(name)
        found = [f"{', '.join(names)}: {text}" for text, names in concerned.items()]
        found += design_warnings(self.experiment)
        if "the file states no unit" in self.experiment.source:
            found.insert(
                0, "the file states no unit of stress, so MPa was assumed; if it is another, give --stress-unit."
            )
        return found

    @property
    def headline(self) -> str:
        """The parameter that summaries put first."""
        return next(iter(self.posteriors.values())).model.headline

    def is_cut_by_prior(self, name: str) -> bool:
        """Whether a bound of a prior, not the data, decides part of a fit."""
        return any("cut by a bound" in text for text in self.posteriors[name].warnings)

    @property
    def not_converged(self) -> list[str]:
        """Discrepancies with which sampling has not converged."""
        return [name for name, posterior in self.posteriors.items() if posterior.solution.is_approximate]


def run_specimen(
    settings: SpecimenSettings,
    folder: Path = Path(),
    step: Callable[[str], None] = lambda text: None,
    law: Material | None = None,
) -> SpecimenStudy:
    """Read the file and fit the material with every chosen discrepancy.

    Settings may come from a file, so that a law of the user's own which they name is not run; it is given as ``law``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When file or settings cannot be used. A discrepancy that cannot be fitted is an error when it was named, and
        is skipped with the reason when all were asked for.
    """
    experiment = settings.experiment(folder)
    material = law or material_named(settings.material)
    unit = stress_unit(experiment.stress_unit)
    is_all = settings.discrepancies == (ALL,)
    names = _every() if is_all else list(dict.fromkeys(settings.discrepancies))
    priors = _priors(settings, material, names, unit)
    posteriors, seconds, skipped = {}, {}, {}
    for name in names:
        step(name)
        start = perf_counter()
        own = {p.symbol for p in _parameters(settings, material, name)}
        if is_all and len(experiment) < len(own):
            skipped[name] = f"{len(experiment)} measurements are too few for its parameters {', '.join(sorted(own))}."
            continue
        try:
            posteriors[name] = fit(
                experiment,
                material=material,
                discrepancy=name,
                noise=settings.noise_in(unit),
                priors={symbol: prior for symbol, prior in priors.items() if symbol in own},
                method=settings.method,
                seed=settings.seed,
            )
            seconds[name] = perf_counter() - start
        except (ConvergenceError, ModelError) as error:
            if not is_all:
                raise
            skipped[name] = str(error)
    if not posteriors:
        simplest, reason = next(iter(skipped.items()))
        raise ModelError(f"no discrepancy can be fitted, not even '{simplest}': {reason}")
    step("assessing")
    assessments = {name: each.assess() for name, each in posteriors.items() if name != "none" and not each.diagnostics}
    return SpecimenStudy(settings, experiment, posteriors, seconds, skipped, assessments)


def _every() -> list[str]:
    others = EnergyDiscrepancy, ConditionedProcess
    return [name for name, kind in discrepancies().items() if kind is Auto or not issubclass(kind, others)]


def _parameters(settings: SpecimenSettings, material: Material, discrepancy: str) -> tuple[Parameter, ...]:
    noise = settings.noise_in(stress_unit("MPa")).parameters
    return (*material.parameters, *discrepancy_named(discrepancy).parameters, *noise)


def _priors(settings: SpecimenSettings, material: Material, names: list[str], unit: StressUnit) -> Mapping[str, Prior]:
    """Return the chosen priors in MPa and stretch."""
    known = {p.symbol: p for name in names for p in _parameters(settings, material, name)}
    unknown = sorted(set(settings.priors) - set(known))
    if unknown:
        raise InputError(f"there is a prior for '{unknown[0]}', but the parameters of this fit are {', '.join(known)}.")
    return {
        symbol: prior_from(given).scaled(unit.to_mpa if known[symbol].unit else 1.0)
        for symbol, given in settings.priors.items()
    }
