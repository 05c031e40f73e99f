"""A calibration by simulation as many small tasks."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.experiments.experiment import Experiment
from tissuq.inference.marginal import Marginal
from tissuq.studies.coverage.fitted import fit_all
from tissuq.studies.coverage.settings import BLOCK
from tissuq.studies.sbc.prior_draws import draw_from_prior
from tissuq.studies.sbc.settings import SbcSettings
from tissuq.studies.stream import Step, run_tasks, silent

__all__ = ["Task", "carry_out", "run_sbc", "tasks_of"]


@dataclass(frozen=True)
class Task:
    """Some data sets of one formulation and noise, by their places in the settings."""

    formulation: int
    noise: int
    first: int
    count: int
    label: str

    @property
    def key(self) -> str:
        """What tells it from every other task."""
        return f"{self.formulation}-{self.noise}-{self.first}-{self.count}"


def tasks_of(settings: SbcSettings) -> list[Task]:
    """Return all tasks, in their order."""
    starts = range(0, settings.replicates, BLOCK)
    return [
        Task(formulation, noise, start, min(BLOCK, settings.replicates - start), settings.formulations[formulation])
        for noise, start, formulation in product(range(len(settings.noise)), starts, range(len(settings.formulations)))
    ]


def run_sbc(
    settings: SbcSettings, folder: Path, *, pool: Executor | None = None, step: Step = silent
) -> list[dict[str, Any]]:
    """Carry out what is not done yet, and return the results of all tasks, in their order.

    Parameters and exceptions are those of `tissuq.studies.stream.run_tasks`.
    """
    return run_tasks(tasks_of(settings), partial(carry_out, settings), folder, pool=pool, step=step)


def carry_out(settings: SbcSettings, task: Task) -> dict[str, Any]:
    """Return the posterior probability below the true value of every parameter; null where a fit failed."""
    formulation, noise = settings.formulations[task.formulation], settings.noise[task.noise]
    model = settings.model(formulation, noise)
    truths, scores, data = [], [], []
    for replicate in range(task.first, task.first + task.count):
        generator = np.random.default_rng((settings.seed, 3, task.formulation, task.noise, replicate))
        values, stress = draw_from_prior(model, generator)
        truths.append(values)
        scores.append(generator.uniform(size=len(values)))
        data.append(Experiment(model.experiment.mode, model.experiment.stretch, stress))
    noise_sd = settings.design.noise_sd if noise == "known" else noise
    fits = fit_all(data, formulation, [noise_sd] * len(data), settings.chosen_priors, model.material)
    below: dict[str, list[float | None]] = {symbol: [None] * len(data) for symbol in model.symbols}
    for place, fit in fits:
        for symbol, uniform in zip(model.symbols, scores[place], strict=True):
            if fit is not None:
                marginal = fit.marginals[symbol]
                below[symbol][place] = probability_below(marginal, truths[place][symbol], uniform)
    return {"formulation": task.formulation, "noise": task.noise, "below": below}


def probability_below(marginal: Marginal, value: float, uniform: float) -> float:
    """Return the posterior probability below a value; a random part of that of zero where this is the value.

    An amplitude is zero with a probability where a discrepancy may lack its block.
    """
    if value == 0.0:
        return float(uniform * marginal.cumulative[0])
    return float(np.interp(value, marginal.points, marginal.cumulative))
