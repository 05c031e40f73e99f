"""The study: settings, seven formulations on synthetic data, the claims, and how they depend on range and priors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import NeoHookean, Yeoh, simulate
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.tolerances import AS_TESTED
from tissuq.parameters.priors import Prior, Uniform, prior_from
from tissuq.posterior.fitting import fit, fit_many
from tissuq.posterior.posterior import Posterior
from tissuq.posterior.solver import Method
from tissuq.prediction.bands import Band, predict_band
from tissuq.result_warning import ResultWarning, Severity, merged
from tissuq.studies.campaign_settings import PaperOptions
from tissuq.validation.paper.claims import Finding, Findings, Verdict, find, judge

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


class PaperSettings(PaperOptions):
    """Everything that a run of the study depends on; stresses in MPa.

    The paper prints the true parameters, the noise and that priors are wide and uniform. It prints neither the
    number of points, the stretch range nor the bounds of the priors: those defaults are ours.
    """

    stretch_low: float = Field(0.5, gt=0, allow_inf_nan=False, description="smallest stretch")
    stretch_high: float = Field(4.25, gt=0, allow_inf_nan=False, description="largest stretch")

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

    @field_validator("truth")
    @classmethod
    def _complete_truth(cls, truth: dict[str, float]) -> dict[str, float]:
        if unknown := sorted(set(truth) - set(TRUTH)):
            raise ValueError(f"a Yeoh material has no parameter {', '.join(unknown)}; it has {', '.join(TRUTH)}")
        return TRUTH | truth

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.stretch_low >= self.stretch_high:
            ends = f"the smallest stretch, {self.stretch_low:g}, must be less than the largest, {self.stretch_high:g}"
            raise ValueError(f"{ends} (--stretch-range)")
        return self

    @property
    def stretch(self) -> FloatArray:
        """The measured stretches, evenly spaced."""
        return np.linspace(self.stretch_low, self.stretch_high, self.points)

    def experiment(self, replicate: int = 0) -> Experiment:
        """Return the synthetic measurements; replicates differ in their noise alone."""
        return simulate(Yeoh(), self.truth, self.stretch, self.noise_sd, self.seed + replicate)

    def priors_of(self, formulation: str) -> dict[str, Prior]:
        """Return the priors of the parameters that a formulation has."""
        parameters = (*NeoHookean.parameters, *discrepancy_named(formulation).parameters)
        return {p.symbol: prior_from(self.priors[p.symbol]) for p in parameters}

    def options_of(self, formulation: str, **priors: Prior) -> dict[str, Any]:
        """Return the options of a fit with a formulation; ``priors`` replace those of its parameters."""
        own = {"discrepancy": formulation, "priors": self.priors_of(formulation) | priors}
        return own | {"noise_sd": self.noise_sd, "tolerances": AS_TESTED}


RANGES = ((0.5, 4.25), (0.5, 3.0), (0.6, 2.0), (1.0, 4.25))
AMPLITUDE_BOUNDS = (1.0, 10.0)
OF_A_FIT = " (Options are those of tissuq fit; this study is as the paper has it.)"
"""Behind advice that names some."""


@dataclass(frozen=True)
class Cell:
    """How often the interval of one formulation held the true C10, for one stretch range."""

    stretch_low: float
    stretch_high: float
    formulation: str
    amplitude_bound: float | None
    held: int
    data_sets: int


def sensitivity(
    settings: PaperSettings, findings_in_range: Sequence[Findings], step: Callable[[str], None]
) -> list[Cell]:
    """Return a cell for every range and formulation, the GP once for each amplitude bound (MPa).

    Every cell uses as many data sets as the study has replicates, with the same seeds; ``own`` are the findings on
    the study's own range, which are not computed again.
    """
    cells = []
    study_range = (settings.stretch_low, settings.stretch_high)
    for low, high in ranges_of(settings):
        step(f"stretch range {low:g} to {high:g}")
        varied = settings.model_copy(update={"stretch_low": low, "stretch_high": high})
        for formulation in FORMULATIONS:
            if formulation == "gp":
                cells += [_fitted(varied, formulation, bound) for bound in AMPLITUDE_BOUNDS]
            elif (low, high) == study_range:
                held = [findings[formulation].holds_truth for findings in findings_in_range]
                cells.append(Cell(low, high, formulation, None, sum(held), len(held)))
            else:
                cells.append(_fitted(varied, formulation, None))
    return cells


def ranges_of(settings: PaperSettings) -> list[tuple[float, float]]:
    """Return the stretch ranges of the table: the study's own, and the others."""
    return list(dict.fromkeys(((settings.stretch_low, settings.stretch_high), *RANGES)))


def _fitted(settings: PaperSettings, formulation: str, bound: float | None) -> Cell:
    options = settings.options_of(formulation, **{} if bound is None else {"c": Uniform(0, bound)})
    experiments = [settings.experiment(replicate) for replicate in range(settings.replicates)]
    posteriors = fit_many(experiments, method="exact", **options)
    intervals = [posterior.solution.marginals["C10"].hdi() for posterior in posteriors]
    held = sum(low <= settings.truth["C10"] <= high for low, high in intervals)
    return Cell(settings.stretch_low, settings.stretch_high, formulation, bound, held, settings.replicates)


@dataclass(frozen=True)
class Fitted:
    """One formulation fitted to the run's own data set, with its wall time."""

    formulation: str
    posterior: Posterior
    finding: Finding
    seconds: float


@dataclass(frozen=True)
class PaperStudy:
    """Everything that a run found. ``main`` is the exact route unless only NUTS was asked for."""

    settings: PaperSettings
    experiment: Experiment
    main: dict[str, Fitted]
    sampled: dict[str, Fitted]
    verdicts: list[Verdict]
    cells: list[Cell]

    @property
    def warnings(self) -> list[ResultWarning]:
        """Warnings about the fits, one of each kind with the formulations that it concerns.

        They are notes: how these fits are wrong is what the study is about, and nobody is to act on it.
        """
        sampled = {f"{name} (nuts)": fit for name, fit in self.sampled.items()}
        texts = merged({name: fit.posterior.warnings_of_fit for name, fit in {**self.main, **sampled}.items()})
        texts = [text.with_end(OF_A_FIT) if "--" in text.shell else text for text in texts]
        return [text if text.severity is Severity.PROBLEM else text.as_note() for text in texts]

    @property
    def not_converged(self) -> list[str]:
        """Formulations whose sampling has not converged."""
        fits = {**self.main, **self.sampled}
        return [name for name, fitted in fits.items() if fitted.posterior.solution.is_approximate]


def steps_of(settings: PaperSettings) -> int:
    """Return how many steps a run announces."""
    fits = len(FORMULATIONS) * (2 if settings.sampler == "both" else 1)
    more = len(FORMULATIONS) if settings.replicates > 1 else 0
    return fits + more + len(ranges_of(settings)) + 1


def run_paper(settings: PaperSettings, step: Callable[[str], None] = lambda text: None) -> PaperStudy:
    """Carry out the study.

    Parameters
    ----------
    settings : PaperSettings
    step : callable
        Called with a few words before each step, for a progress display.
    """
    experiment = settings.experiment()
    main = _fit_all(settings, experiment, "nuts" if settings.sampler == "nuts" else "exact", step)
    sampled = _fit_all(settings, experiment, "nuts", step) if settings.sampler == "both" else {}
    data_sets: list[Findings] = [{name: fitted.finding for name, fitted in main.items()}]
    if settings.replicates > 1:
        data_sets += _find_in_replicates(settings, step)
    return PaperStudy(settings, experiment, main, sampled, judge(data_sets), sensitivity(settings, data_sets, step))


def _find_in_replicates(settings: PaperSettings, step: Callable[[str], None]) -> list[dict[str, Finding]]:
    """Return the findings for every further data set, fitted together formulation by formulation."""
    experiments = [settings.experiment(replicate) for replicate in range(1, settings.replicates)]
    findings_by_data_set: list[dict[str, Finding]] = [{} for _ in experiments]
    bases: list[Band] = []
    for name in FORMULATIONS:
        step(f"{settings.replicates - 1} more data sets: {name}")
        posteriors = fit_many(experiments, method="exact", seed=settings.seed, **settings.options_of(name))
        if not bases:
            bases = [predict_band(fit.solution, fit.model.experiment.stretch) for fit in posteriors]
        for findings, posterior, base in zip(findings_by_data_set, posteriors, bases, strict=True):
            findings[name] = find(posterior, settings.truth["C10"], base)
    return findings_by_data_set


def _fit_all(
    settings: PaperSettings,
    experiment: Experiment,
    sampler: Literal["exact", "nuts"],
    step: Callable[[str], None],
) -> dict[str, Fitted]:
    fitted: dict[str, Fitted] = {}
    base: Band | None = None
    for name in FORMULATIONS:
        step(f"{name} ({sampler})")
        start = perf_counter()
        method: Method = "joint" if sampler == "nuts" else "exact"
        posterior = fit(experiment, method=method, seed=settings.seed, **settings.options_of(name))
        seconds = perf_counter() - start
        base = base or predict_band(posterior.solution, experiment.stretch)
        fitted[name] = Fitted(name, posterior, find(posterior, settings.truth["C10"], base), seconds)
    return fitted
