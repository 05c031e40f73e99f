"""The study of one measured file, or of several: a material fitted with each chosen discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from tissuq.assessment import Assessment, design_warnings
from tissuq.discrepancy import Auto, ConditionedProcess, EnergyDiscrepancy, discrepancies, discrepancy_named, separated
from tissuq.errors import ConvergenceError, InputError, ModelError, TissuqError
from tissuq.experiments.doubts import doubts
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading import Reading
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.fitting import fit
from tissuq.mechanics import Material, material_named
from tissuq.mechanics.joint import joined
from tissuq.noise import Noise, noise_named
from tissuq.parameters import Parameter
from tissuq.posterior import Posterior
from tissuq.priors import Prior, prior_from
from tissuq.studies.fitted import FittedSettings
from tissuq.studies.held_out import held_out_tests
from tissuq.studies.measured_file import MeasuredFile, MeasuredTest, ReadingSettings
from tissuq.tolerances import Tolerances

__all__ = ["ALL", "SpecimenSettings", "SpecimenStudy", "fitted", "run_specimen"]

ALL = "all"
"""In place of discrepancies: the paper's and the average of energies, where they apply to the material."""


class SpecimenSettings(FittedSettings, MeasuredFile):
    """Everything that a fit depends on; stresses (noise, priors) in the unit of stress of the file, or the first one.

    It is of one ``file``, or of several ``tests`` together.
    """

    file: str = ""
    tests: tuple[MeasuredTest, ...] = ()
    tolerances: dict[Literal["stress", "length", "slack", "zero", "stretch"], float] | None = None
    discrepancies: tuple[str, ...] = Field((Auto.name,), min_length=1)
    priors: dict[str, dict[str, float | str]] = Field(default_factory=dict)
    held_out: bool = False
    stable_in: tuple[str, ...] = ()

    @field_validator("discrepancies")
    @classmethod
    def _all_or_named(cls, given: tuple[str, ...]) -> tuple[str, ...]:
        if ALL in given and given != (ALL,):
            raise ValueError(f"'{ALL}' stands alone; leave it out, or leave out the names beside it")
        return given

    @model_validator(mode="after")
    def _measured(self) -> Self:
        if bool(self.file) == bool(self.tests):
            raise ValueError("give one file, or several tests with a file each")
        reading = set(ReadingSettings.model_fields)
        if self.tests and self.model_fields_set & reading:
            where = ", ".join(sorted(self.model_fields_set & reading))
            raise ValueError(f"how files are read is said in each of the tests, not beside them ({where})")
        told = [test.noise_sd is not None for test in self.tests]
        if any(told) and (not all(told) or self.noise or self.noise_sd != "unknown"):
            raise ValueError("give noise_sd in each of the tests, or once for all")
        if self.held_out and (len(self.tests) < 2 or any(told)):
            raise ValueError("held_out needs two tests or more, and one noise_sd for all of them or an unknown one")
        return self

    def readings(self, folder: Path = Path()) -> list[Reading]:
        """Read the file, or those of all tests; relative ones lie in ``folder``."""
        return [test.reading(folder) for test in self.tests] or [self.reading(folder)]

    def experiment(self, folder: Path = Path()) -> Experiment:
        """Read the measurements, of all tests together."""
        return joined([reading.experiment for reading in self.readings(folder)])

    def tolerances_in(self, unit: StressUnit) -> Tolerances | None:
        """Return the tolerances, those of stresses converted from a unit to MPa; None for the usual ones."""
        if self.tolerances is None:
            return None
        scale = {"zero": unit.to_mpa}
        return Tolerances(**{name: value * scale.get(name, 1.0) for name, value in self.tolerances.items()})

    def noise_in(self, unit: StressUnit) -> Noise:
        """Return the noise, known standard deviations converted from a unit to MPa."""
        every = [test.noise_sd for test in self.tests if test.noise_sd is not None]
        if every:
            return noise_named([each * unit.to_mpa for each in every])
        return super().noise_in(unit)


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
    doubts: tuple[str, ...] = ()
    """What is strange about the measurements."""
    held_out: tuple[dict[str, Any], ...] = ()
    """How every test is predicted from the others, where that was asked for."""

    @property
    def unit(self) -> StressUnit:
        """The unit in which the file, or the first of several, gives stresses."""
        return stress_unit(self.experiment.stress_unit)

    @property
    def warnings(self) -> list[str]:
        """What a reader must know of the data and the fits, each once with the discrepancies that it concerns."""
        concerned: dict[str, list[str]] = {}
        for name, posterior in self.posteriors.items():
            for text in posterior.warnings:
                concerned.setdefault(text, []).append(name)
        found = [f"{', '.join(names)}: {text}" for text, names in concerned.items()]
        return [*self.doubts, *found, *design_warnings(self.experiment)]

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
    """Read the file, or those of several tests, and fit the material with every chosen discrepancy.

    Settings may come from a file, so that a law of the user's own which they name is not run; it is given as ``law``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When file or settings cannot be used. A discrepancy that cannot be fitted is an error when it was named, and
        is skipped with the reason when all were asked for.
    """
    readings = settings.readings(folder)
    experiment = joined([reading.experiment for reading in readings])
    material = law or material_named(settings.material)
    unit = stress_unit(experiment.stress_unit)
    is_all = settings.discrepancies == (ALL,)
    names = _every() if is_all else list(dict.fromkeys(settings.discrepancies))
    symbols = {name: _parameters(settings, material, name, experiment) for name in names}
    priors = _priors(settings, symbols, unit)
    posteriors, seconds, skipped = {}, {}, {}
    for name in names:
        step(name)
        start = perf_counter()
        own = {p.symbol for p in symbols[name]}
        if is_all and len(experiment) < len(own):
            skipped[name] = f"{len(experiment)} measurements are too few for its parameters {', '.join(sorted(own))}."
            continue
        try:
            options = _options(settings, material, priors, symbols[name], unit)
            posteriors[name] = fit(experiment, discrepancy=name, **options)
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
    held_out: list[dict[str, Any]] = []
    for name in posteriors if settings.held_out else ():
        step(f"{name}: each test from the others")
        if separated(discrepancy_named(name), material, experiment).parameters != discrepancy_named(name).parameters:
            skipped[f"{name}, each test from the others"] = "it is another error of the stress in each test."
            continue
        options = _options(settings, material, priors, symbols[name], unit)
        options["tolerances"] = posteriors[name].model.tolerances
        try:
            found = held_out_tests(experiment.parts, discrepancy=name, **options).to_dict("records")
        except TissuqError as error:
            skipped[f"{name}, each test from the others"] = str(error)
            continue
        held_out += [{"formulation": name} | {str(key): _known(value) for key, value in row.items()} for row in found]
    parts = settings, experiment, posteriors, seconds, skipped, assessments, _doubts(readings)
    return SpecimenStudy(*parts, tuple(held_out))


def fitted(
    settings: SpecimenSettings, discrepancy: str, folder: Path = Path(), law: Material | None = None
) -> Posterior:
    """Return the posterior under one discrepancy of the measurements and the material of a study.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        As `run_specimen`.
    """
    experiment = settings.experiment(folder)
    material, unit = law or material_named(settings.material), stress_unit(experiment.stress_unit)
    own = _parameters(settings, material, discrepancy, experiment)
    chosen = {symbol: prior for symbol, prior in settings.priors.items() if symbol in [p.symbol for p in own]}
    priors = _priors(settings.model_copy(update={"priors": chosen}), {discrepancy: own}, unit)
    return fit(experiment, discrepancy=discrepancy, **_options(settings, material, priors, own, unit))


def _known(value: Any) -> Any:
    """Return a value, None for one that is no number."""
    return None if value != value else value


def _options(
    settings: SpecimenSettings,
    material: Material,
    priors: Mapping[str, Prior],
    parameters: tuple[Parameter, ...],
    unit: StressUnit,
) -> dict[str, Any]:
    """Return the options of a fit but the discrepancy."""
    own = {p.symbol for p in parameters}
    return {
        "material": material,
        "noise": settings.noise_in(unit),
        "priors": {symbol: prior for symbol, prior in priors.items() if symbol in own},
        "tolerances": settings.tolerances_in(unit),
        "method": settings.method,
        "stable_in": settings.stable_in,
        "seed": settings.seed,
    }


def _doubts(readings: Sequence[Reading]) -> tuple[str, ...]:
    """Return what is strange about the files, each with the name of its test where there are several."""
    every = [(reading.experiment.name, text) for reading in readings for text in doubts(reading)]
    return tuple(f"{name}: {text}" if len(readings) > 1 else text for name, text in every)


def _every() -> list[str]:
    others = EnergyDiscrepancy, ConditionedProcess
    return [name for name, kind in discrepancies().items() if kind is Auto or not issubclass(kind, others)]


def _parameters(
    settings: SpecimenSettings, material: Material, discrepancy: str, experiment: Experiment
) -> tuple[Parameter, ...]:
    noise = settings.noise_in(stress_unit("MPa")).parameters
    own = discrepancy_named(discrepancy)
    with suppress(ModelError):  # which the fit itself raises
        own = separated(own, material, experiment)
    return (*material.parameters, *own.parameters, *noise)


def _priors(
    settings: SpecimenSettings, parameters: Mapping[str, tuple[Parameter, ...]], unit: StressUnit
) -> Mapping[str, Prior]:
    """Return the chosen priors in MPa and stretch."""
    known = {p.symbol: p for own in parameters.values() for p in own}
    unknown = sorted(set(settings.priors) - set(known))
    if unknown:
        raise InputError(f"there is a prior for '{unknown[0]}', but the parameters of this fit are {', '.join(known)}.")
    return {
        symbol: prior_from(given).scaled(unit.to_mpa if known[symbol].unit else 1.0)
        for symbol, given in settings.priors.items()
    }
