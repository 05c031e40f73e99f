"""How the ranking depends on the stretch range, and the GP's verdict on the prior of its amplitude."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tissuq.fitting import fit_many
from tissuq.priors import Uniform
from tissuq.studies.paper.findings import Findings
from tissuq.studies.paper.settings import FORMULATIONS, PaperSettings

__all__ = ["AMPLITUDE_BOUNDS", "RANGES", "Cell", "ranges_of", "sensitivity"]

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


def sensitivity(settings: PaperSettings, own: Sequence[Findings], step: Callable[[str], None]) -> list[Cell]:
    """Return a cell for every range and formulation, the GP once for each amplitude bound (MPa).

    Every cell uses as many data sets as the study has replicates, with the same seeds; ``own`` are the findings on
    the study's own range, which are not computed again.
    """
    cells = []
    here = (settings.stretch_low, settings.stretch_high)
    for low, high in ranges_of(settings):
        step(f"stretch range {low:g} to {high:g}")
        there = settings.model_copy(update={"stretch_low": low, "stretch_high": high})
        for formulation in FORMULATIONS:
            if formulation == "gp":
                cells += [_fitted(there, formulation, bound) for bound in AMPLITUDE_BOUNDS]
            elif (low, high) == here:
                held = [findings[formulation].holds_truth for findings in own]
                cells.append(Cell(low, high, formulation, None, sum(held), len(held)))
            else:
                cells.append(_fitted(there, formulation, None))
    return cells


def ranges_of(settings: PaperSettings) -> list[tuple[float, float]]:
    """Return the stretch ranges of the table: the study's own, and the others."""
    return list(dict.fromkeys(((settings.stretch_low, settings.stretch_high), *RANGES)))


def _fitted(settings: PaperSettings, formulation: str, bound: float | None) -> Cell:
    priors = settings.priors_of(formulation) | ({} if bound is None else {"c": Uniform(0, bound)})
    posteriors = fit_many(
        [settings.experiment(replicate) for replicate in range(settings.replicates)],
        discrepancy=formulation,
        noise_sd=settings.noise_sd,
        priors=priors,
        method="exact",
    )
    intervals = [posterior.solution.marginals["C10"].hdi() for posterior in posteriors]
    held = sum(low <= settings.truth["C10"] <= high for low, high in intervals)
    return Cell(settings.stretch_low, settings.stretch_high, formulation, bound, held, settings.replicates)
