"""Simulation-based calibration as many small tasks: data drawn from the model itself, and their fits."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.marginal import Marginal
from tissuq.model.statistical_model import StatisticalModel
from tissuq.studies.stream import Step, run_tasks, silent
from tissuq.validation.coverage.fitted import fit_all
from tissuq.validation.coverage.settings import BLOCK
from tissuq.validation.sbc.settings import SbcSettings

__all__ = ["Task", "carry_out", "draw_from_prior", "run_sbc", "tasks_of"]

FloatArray = NDArray[np.float64]


def draw_from_prior(model: StatisticalModel, generator: np.random.Generator) -> tuple[dict[str, float], FloatArray]:
    """Return values of all parameters, drawn from their priors, and the measured stress (n,), MPa, that they lead to.

    An amplitude of which the drawn member of an energy discrepancy has no block is zero.

    Raises
    ------
    ModelError
        When the noise depends on the data.
    """
    if model.noise.depends_on_level or model.noise.shares_discrepancy:
        raise ModelError(f"noise '{model.noise.name}' depends on the data, so data cannot be drawn from the prior.")
    values = {symbol: float(prior.quantile(generator.uniform())) for symbol, prior in model.priors.items()}
    states = model.experiment.states
    design = model.basis(states, [values[symbol] for symbol in model.bent_symbols])
    stress = design @ [values[symbol] for symbol in model.column_symbols]
    if model.energy_symbols:
        stress = stress + _energy_stress(model, values, generator)
    if model.is_correlated:
        covariance = model.correlated_variance(values) * model.correlation(states, states, values)
        sizes, vectors = np.linalg.eigh(covariance)
        stress = stress + vectors @ (np.sqrt(np.maximum(sizes, 0.0)) * generator.standard_normal(len(states)))
    return values, stress + np.sqrt(model.white_variance(values)) * generator.standard_normal(len(states))


def _energy_stress(model: StatisticalModel, values: dict[str, float], generator: np.random.Generator) -> FloatArray:
    """Draw a member and its weights; set the amplitudes that it has not to zero."""
    members = model.energy_members
    number = int(generator.choice(len(members), p=[candidate.probability for candidate in members]))
    member = members[number]
    for block, symbol in enumerate(model.energy_symbols):
        if block not in member.amplitude_indices:
            values[symbol] = 0.0
    stress = np.zeros(model.experiment.size)
    features = member.stress_features(model.experiment.states)
    for block, terms in zip(member.amplitude_indices, features, strict=True):
        stress += values[model.energy_symbols[block]] * terms @ generator.standard_normal(terms.shape[1])
    return stress


@dataclass(frozen=True)
class Task:
    """Some data sets of one formulation and noise, by their indices in the settings."""

    formulation: int
    noise: int
    start: int
    count: int
    label: str

    @property
    def key(self) -> str:
        """What tells it from every other task."""
        return f"{self.formulation}-{self.noise}-{self.start}-{self.count}"


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
    for replicate in range(task.start, task.start + task.count):
        generator = np.random.default_rng((settings.seed, 3, task.formulation, task.noise, replicate))
        values, stress = draw_from_prior(model, generator)
        truths.append(values)
        scores.append(generator.uniform(size=len(values)))
        data.append(Experiment(model.experiment.mode, model.experiment.stretch, stress))
    noise_sd = settings.design.noise_sd if noise == "known" else noise
    fits = fit_all(data, formulation, [noise_sd] * len(data), settings.chosen_priors, model.material)
    ranks: dict[str, list[float | None]] = {symbol: [None] * len(data) for symbol in model.symbols}
    for index, fit in fits:
        for symbol, uniform in zip(model.symbols, scores[index], strict=True):
            if fit is not None:
                marginal = fit.marginals[symbol]
                ranks[symbol][index] = probability_below(marginal, truths[index][symbol], uniform)
    return {"formulation": task.formulation, "noise": task.noise, "below": ranks}


def probability_below(marginal: Marginal, value: float, uniform: float) -> float:
    """Return the posterior probability below a value; a random part of that of zero where this is the value.

    An amplitude is zero with a probability where a discrepancy may lack its block.
    """
    if value == 0.0:
        return float(uniform * marginal.cumulative[0])
    return float(np.interp(value, marginal.points, marginal.cumulative))
