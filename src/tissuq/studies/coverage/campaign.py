"""A campaign as many small tasks."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.assessment import Average
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import loading_mode
from tissuq.posterior import Posterior
from tissuq.studies.coverage.fitted import fit_all
from tissuq.studies.coverage.predictions import share_of_new, stress_unseen
from tissuq.studies.coverage.settings import BLOCK, CoverageSettings
from tissuq.studies.coverage.truths import TRUTHS, Truth, draw_truth
from tissuq.studies.stream import Step, run_tasks, silent

__all__ = ["Task", "carry_out", "run_campaign", "tasks_of"]


@dataclass(frozen=True)
class Task:
    """Some replicates of one family on one design, with one formulation; all by their places in the settings."""

    design: int
    strength: int
    noise: int
    family: int
    formulation: int
    first: int
    count: int
    label: str

    @property
    def key(self) -> str:
        """What tells it from every other task of the campaign."""
        return "-".join(map(str, self.place.values()))

    @property
    def place(self) -> dict[str, int]:
        """Everything but its label."""
        return {name: value for name, value in asdict(self).items() if name != "label"}


def tasks_of(settings: CoverageSettings) -> list[Task]:
    """Return all tasks of a campaign, in their order."""
    blocks = [(start, min(BLOCK, settings.replicates - start)) for start in range(0, settings.replicates, BLOCK)]
    return [
        Task(design, strength, noise, family, formulation, *block, settings.formulations[formulation])
        for design, strength, noise, block, family, formulation in product(
            range(len(settings.designs)),
            range(len(settings.strengths)),
            range(len(settings.noise)),
            blocks,
            range(len(settings.families)),
            range(len(settings.formulations)),
        )
    ]


def run_campaign(
    settings: CoverageSettings, folder: Path, *, pool: Executor | None = None, step: Step = silent
) -> list[dict[str, Any]]:
    """Carry out what is not done yet of a campaign, and return the results of all tasks, in their order.

    Parameters
    ----------
    settings : CoverageSettings
    folder : Path
        Exists; holds the results so far, if any.
    pool : Executor, optional
        Workers from `tissuq.studies.stream.open_pool`.
    step : callable
        Told of every task that is done: its label, and whether it was done now or before.
    """
    return run_tasks(tasks_of(settings), partial(carry_out, settings), folder, pool=pool, step=step)


def carry_out(settings: CoverageSettings, task: Task) -> dict[str, Any]:
    """Return truths, intervals and moments of C10 in every replicate of a task; null where a fit failed.

    The oracle, which knows everything but C10, has the standard deviation noise_sd / ||stress of C10 = 1||.
    """
    design, formulation = settings.designs[task.design], settings.formulations[task.formulation]
    mode, stretch = loading_mode(design.mode), design.stretch
    family = settings.families[task.family]
    own = TRUTHS.index(family)
    truths: list[Truth] = []
    data, noise_sd = [], []
    for replicate in range(task.first, task.first + task.count):
        drawn = draw_truth(family, (settings.seed, 1, own, replicate), settings.scale)
        truth = drawn.nearer(settings.strengths[task.strength])
        sd = design.noise_sd * (truth.C10 if settings.scale else 1.0)
        generator = np.random.default_rng((settings.seed, 2, own, replicate, task.design))
        truths.append(truth)
        noise_sd.append(sd)
        data.append(
            Experiment(mode, stretch, truth.stress(mode, stretch) + sd * generator.standard_normal(len(stretch)))
        )
    told = noise_sd if settings.noise[task.noise] == "known" else ["unknown"] * len(data)
    names = ("fits", *(["predictive"] if settings.predictive else []), *settings.unseen)
    rows: dict[str, list[Any]] = {name: [None] * len(data) for name in names}
    for place, fit in fit_all(data, formulation, told, settings.chosen_priors):
        if fit is None:
            continue
        rows["fits"][place] = _interval(fit, settings.prob)
        if settings.predictive:
            rows["predictive"][place] = share_of_new(fit, data[place], truths[place], noise_sd[place], settings.prob)
        for name in settings.unseen:
            rows[name][place] = stress_unseen(fit, data[place], truths[place], loading_mode(name), settings.prob)
    oracle_sd = [
        sd / float(np.linalg.norm(truth.law(mode, stretch))) for sd, truth in zip(noise_sd, truths, strict=True)
    ]
    return task.place | {"truth": [truth.C10 for truth in truths], "oracle_sd": oracle_sd, **rows}


def _interval(fit: Posterior | Average, prob: float) -> list[float]:
    """Return ends, mean and sd of C10."""
    marginal = fit.marginals["C10"]
    return [*marginal.hdi(prob), marginal.mean, marginal.sd]
