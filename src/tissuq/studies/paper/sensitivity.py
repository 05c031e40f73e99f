"""How the ranking depends on the stretch range, and the GP's verdict on the prior of its amplitude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tissuq.fitting import fit
from tissuq.priors import Uniform
from tissuq.studies.paper.settings import FORMULATIONS, PaperSettings

__all__ = ["AMPLITUDE_BOUNDS", "RANGES", "Cell", "sensitivity"]

RANGES = ((0.5, 4.25), (0.5, 3.0), (0.6, 2.0), (1.0, 4.25))
AMPLITUDE_BOUNDS = (1.0, 10.0)


@dataclass(frozen=True)
class Cell:
    """How often the interval of one formulation held the true C10, for one stretch range."""

    stretch_low: float
    stretch_high: float
    formulation: str
    amplitude_bound: float | None
    held: int
    data_sets: int
    mean_log_evidence: float


def sensitivity(settings: PaperSettings, step: Callable[[str], None]) -> list[Cell]:
    """Return a cell for every range and formulation, the GP once for each amplitude bound (MPa).

    Every cell uses as many data sets as the study has replicates, with the same seeds.
    """
    cells = []
    own = (settings.stretch_low, settings.stretch_high)
    for low, high in dict.fromkeys((own, *RANGES)):
        step(f"stretch range {low:g} to {high:g}")
        there = settings.model_copy(update={"stretch_low": low, "stretch_high": high})
        for formulation in FORMULATIONS:
            for bound in AMPLITUDE_BOUNDS if formulation == "gp" else (None,):
                cells.append(_cell(there, formulation, bound))
    return cells


def _cell(settings: PaperSettings, formulation: str, bound: float | None) -> Cell:
    priors = settings.priors_of(formulation)
    if bound is not None:
        priors["c"] = Uniform(0, bound)
    held, evidence = 0, 0.0
    for replicate in range(settings.replicates):
        posterior = fit(
            settings.experiment(replicate),
            discrepancy=formulation,
            noise_sd=settings.noise_sd,
            priors=priors,
            sampler="exact",
        )
        low, high = posterior.solution.marginals["C10"].hdi()
        held += low <= settings.truth["C10"] <= high
        evidence += posterior.log_evidence or 0.0
    return Cell(
        settings.stretch_low,
        settings.stretch_high,
        formulation,
        bound,
        held,
        settings.replicates,
        evidence / settings.replicates,
    )
