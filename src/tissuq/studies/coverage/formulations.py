"""What a campaign fits: a discrepancy by its name, or an average of several by their evidence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tissuq.assessment import average
from tissuq.discrepancy import discrepancy_named
from tissuq.experiments.experiment import Experiment
from tissuq.fitting import fit_many
from tissuq.inference.marginal import Marginal
from tissuq.studies.paper.settings import FORMULATIONS

__all__ = ["AVERAGES", "check_formulation", "marginals_of_c10"]

AVERAGES = {"average-of-seven": FORMULATIONS}
"""Averages by name: the paper's seven formulations."""


def check_formulation(name: str) -> None:
    """Raise ModelError when there is no formulation of that name."""
    if name not in AVERAGES:
        discrepancy_named(name)


def marginals_of_c10(formulation: str, data: Sequence[Experiment], noise_sd: Any) -> list[Marginal]:
    """Return the marginal posterior of C10 for every data set."""
    names = AVERAGES.get(formulation, (formulation,))
    fits = [fit_many(data, discrepancy=name, noise_sd=noise_sd) for name in names]
    if len(names) == 1:
        return [posterior.solution.marginals["C10"] for posterior in fits[0]]
    return [average(dict(zip(names, each, strict=True))).marginals["C10"] for each in zip(*fits, strict=True)]
