"""The study itself: seven formulations on synthetic data, the claims, and what they depend on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Literal

from tissuq.experiments.experiment import Experiment
from tissuq.fitting import fit, fit_many
from tissuq.posterior import Posterior
from tissuq.prediction.bands import Band, predict_band
from tissuq.studies.paper.claims import Verdict, judge
from tissuq.studies.paper.findings import Finding, Findings, find
from tissuq.studies.paper.sensitivity import Cell, ranges_of, sensitivity
from tissuq.studies.paper.settings import FORMULATIONS, PaperSettings

__all__ = ["Fitted", "PaperStudy", "run_paper", "steps_of"]


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
    def warnings(self) -> list[str]:
        """What a reader must know of the fits."""
        every = [*self.main.values(), *self.sampled.values()]
        return list(dict.fromkeys(f"{each.formulation}: {text}" for each in every for text in each.posterior.warnings))

    @property
    def not_converged(self) -> list[str]:
        """Formulations whose sampling has not converged."""
        every = {**self.main, **self.sampled}
        return [name for name, fitted in every.items() if fitted.posterior.solution.is_approximate]


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
    found: list[dict[str, Finding]] = [{} for _ in experiments]
    bases: list[Band] = []
    for name in FORMULATIONS:
        step(f"{settings.replicates - 1} more data sets: {name}")
        posteriors = fit_many(
            experiments,
            discrepancy=name,
            noise_sd=settings.noise_sd,
            priors=settings.priors_of(name),
            method="exact",
            seed=settings.seed,
        )
        if not bases:
            bases = [predict_band(each.solution, each.model.experiment.stretch) for each in posteriors]
        for findings, posterior, base in zip(found, posteriors, bases, strict=True):
            findings[name] = find(posterior, settings.truth["C10"], base)
    return found


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
        posterior = fit(
            experiment,
            discrepancy=name,
            noise_sd=settings.noise_sd,
            priors=settings.priors_of(name),
            method="joint" if sampler == "nuts" else "exact",
            seed=settings.seed,
        )
        seconds = perf_counter() - start
        base = base or predict_band(posterior.solution, experiment.stretch)
        fitted[name] = Fitted(name, posterior, find(posterior, settings.truth["C10"], base), seconds)
    return fitted
