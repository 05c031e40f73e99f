"""A campaign as many small tasks, what each of them gives, and the summary of all with Monte Carlo errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment import Average
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.mechanics.invariants import MeasuredStates, farthest_stretch
from tissuq.posterior.posterior import Posterior
from tissuq.studies.stream import Campaign, TaskOfFields
from tissuq.validation.coverage.fitted import fit_all
from tissuq.validation.coverage.settings import BLOCK, CoverageSettings
from tissuq.validation.coverage.truths import TRUTHS, Truth, draw_truth

if TYPE_CHECKING:
    import pandas as pd


POINTS = 12
"""Stretches of a loading mode that was not measured."""


def share_of_new(fit: Posterior | Average, data: Experiment, truth: Truth, noise_sd: float, prob: float) -> float:
    """Return the share of new measurements, at the measured stretches, that the predictive band holds on average."""
    from scipy.special import ndtr

    band = fit.predict(data.stretch, prob=prob)
    low, high = ((band[end] - truth.stress(data.mode, data.stretch)) / noise_sd for end in ("low", "high"))
    return float(np.mean(ndtr(high) - ndtr(low)))


def stress_unseen(
    fit: Posterior | Average, data: Experiment, truth: Truth, mode: LoadingMode, prob: float
) -> tuple[float, float]:
    """Return the share of the true stress inside the band of the stress itself, and the error of its mean.

    The error is the root mean square over the stretches, relative to that of the true stress. A discrepancy that is an
    energy is part of the prediction; any other is left out, because it says nothing about another loading mode.
    """
    stretch = unseen_stretches(data.mode, data.stretch, mode)
    is_energy = isinstance(fit, Posterior) and fit.model.discrepancy.is_energy
    band = fit.predict(stretch, discrepancy=is_energy, noise=False, prob=prob, mode=mode)
    stress = truth.stress(mode, stretch)
    share = np.mean((band["low"] <= stress) & (stress <= band["high"]))
    return float(share), float(np.linalg.norm(band["median"] - stress) / np.linalg.norm(stress))


def unseen_stretches(measured: LoadingMode, stretch: FloatArray, mode: LoadingMode) -> FloatArray:
    """Return stretches above one in a mode, up to where I1 or I2 leaves the range that was measured in another."""
    states = MeasuredStates.of(measured.at(stretch))
    return np.linspace(1.0, farthest_stretch(mode, states, 1), POINTS + 1)[1:]


@dataclass(frozen=True)
class Task(TaskOfFields):
    """Some replicates of one family on one design, with one formulation; all by their indices in the settings."""

    design: int
    strength: int
    noise: int
    family: int
    formulation: int
    start: int
    count: int
    label: str

    @property
    def indices(self) -> dict[str, int]:
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


def carry_out(settings: CoverageSettings, task: Task) -> dict[str, Any]:
    """Return truths, intervals and moments of C10 in every replicate of a task; null where a fit failed.

    The oracle, which knows everything but C10, has the standard deviation noise_sd / ||stress of C10 = 1||.
    """
    design, formulation = settings.designs[task.design], settings.formulations[task.formulation]
    mode, stretch = loading_mode(design.mode), design.stretch
    family = settings.families[task.family]
    family_seed = TRUTHS.index(family)
    truths: list[Truth] = []
    data, noise_sd = [], []
    for replicate in range(task.start, task.start + task.count):
        drawn = draw_truth(family, (settings.seed, 1, family_seed, replicate), settings.scale)
        truth = drawn.nearer(settings.strengths[task.strength])
        sd = design.noise_sd * (truth.C10 if settings.scale else 1.0)
        generator = np.random.default_rng((settings.seed, 2, family_seed, replicate, task.design))
        truths.append(truth)
        noise_sd.append(sd)
        data.append(
            Experiment(mode, stretch, truth.stress(mode, stretch) + sd * generator.standard_normal(len(stretch)))
        )
    assumed_noise = noise_sd if settings.noise[task.noise] == "known" else ["unknown"] * len(data)
    names = ("fits", *(["predictive"] if settings.predictive else []), *settings.unseen)
    rows: dict[str, list[Any]] = {name: [None] * len(data) for name in names}
    for index, fit in fit_all(data, formulation, assumed_noise, settings.chosen_priors):
        if fit is None:
            continue
        rows["fits"][index] = _interval(fit, settings.prob)
        if settings.predictive:
            rows["predictive"][index] = share_of_new(fit, data[index], truths[index], noise_sd[index], settings.prob)
        for name in settings.unseen:
            rows[name][index] = stress_unseen(fit, data[index], truths[index], loading_mode(name), settings.prob)
    oracle_sd = [
        sd / float(np.linalg.norm(truth.law(mode, stretch))) for sd, truth in zip(noise_sd, truths, strict=True)
    ]
    return task.indices | {"truth": [truth.C10 for truth in truths], "oracle_sd": oracle_sd, **rows}


run_campaign = Campaign(tasks_of, carry_out)
"""Carries out a campaign of coverage."""


def _interval(fit: Posterior | Average, prob: float) -> list[float]:
    """Return ends, mean and sd of C10."""
    marginal = fit.marginals["C10"]
    return [*marginal.hdi(prob), marginal.mean, marginal.sd]


CELL = ["design", "strength", "noise"]


def summarise(settings: CoverageSettings, results: Sequence[dict[str, Any]], *by: str) -> pd.DataFrame:
    """Return one row a design, strength, noise, formulation and whatever else is asked for (``"family"``).

    Columns, each but the first two with the Monte Carlo standard error in ``..._error``:

    - fits, failed
    - coverage: the share of intervals that hold the true C10; its error is that of a share with one more of either
      kind, so that it is not zero where all hold
    - score: the mean interval score over the true C10 (width, plus 2 / (1 - prob) times by how much the truth is
      missed; Gneiting & Raftery 2007)
    - price: the mean interval score over the width of the interval of an oracle that knows everything but C10; and
      price_median, its median
    - width: the median ratio of an interval's width to the oracle's
    - bias: the mean of (posterior mean - truth) / truth
    - predictive, where it was asked for: the share of new measurements inside the predictive band
    """
    import pandas as pd
    from scipy.special import ndtri

    rows = []
    width_in_sd = 2 * ndtri(0.5 + 0.5 * settings.prob)
    for names, truth, oracle, fit, predictive in _every(settings, results, "predictive"):
        low, high, mean, _ = fit or [np.nan] * 4
        missed = max(low - truth, truth - high, 0.0) if fit else np.nan
        score = high - low + 2 / (1 - settings.prob) * missed
        rows.append(
            names
            | {
                "coverage": float(low <= truth <= high) if fit else np.nan,
                "score": score / truth,
                "price": score / (width_in_sd * oracle),
                "width": (high - low) / (width_in_sd * oracle),
                "bias": (mean - truth) / truth,
                "predictive": np.nan if predictive is None else predictive,
            }
        )
    groups = pd.DataFrame(rows).groupby([*CELL, *by, "formulation"], sort=False)
    count = groups["coverage"].count()
    table = pd.DataFrame({"fits": count, "failed": groups.size() - count})
    table["coverage"] = groups["coverage"].mean()
    likely = (table["coverage"] * count + 1) / (count + 2)
    table["coverage_error"] = np.sqrt(likely * (1 - likely) / count)
    _add_means(table, groups, "score", "price", "bias", *(["predictive"] if settings.predictive else []))
    table["price_median"], table["price_median_error"] = groups["price"].median(), groups["price"].agg(_median_error)
    table["width"], table["width_error"] = groups["width"].median(), groups["width"].agg(_median_error)
    return table.reset_index()


def summarise_unseen(settings: CoverageSettings, results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a design, strength, noise, formulation and loading mode that was not measured.

    Columns: materials; coverage, the share of stretches at which the interval of the stress itself holds the true one,
    and error, the median over materials of the relative root mean square error of the posterior mean stress; both with
    their Monte Carlo standard errors, for which a material counts once.
    """
    import pandas as pd

    rows = [
        names | {"mode": mode, "coverage": scores[0] if scores else np.nan, "error": scores[1] if scores else np.nan}
        for mode in settings.unseen
        for names, _, _, _, scores in _every(settings, results, mode)
    ]
    groups = pd.DataFrame(rows).groupby([*CELL, "mode", "formulation"], sort=False)
    table = pd.DataFrame({"materials": groups["coverage"].count()})
    _add_means(table, groups, "coverage")
    table["error"], table["error_error"] = groups["error"].median(), groups["error"].agg(_median_error)
    return table.reset_index()


def _every(
    settings: CoverageSettings, results: Sequence[dict[str, Any]], more: str
) -> Iterator[tuple[dict[str, Any], float, float, list[float] | None, Any]]:
    """Yield the place, the truth, the oracle's sd, the fit and, where it was asked for, more of every data set."""
    for result in results:
        names = {
            "design": settings.designs[result["design"]].label,
            "strength": settings.strengths[result["strength"]],
            "noise": settings.noise[result["noise"]],
            "formulation": settings.formulations[result["formulation"]],
            "family": settings.families[result["family"]],
        }
        requested = result.get(more, [None] * len(result["truth"]))
        for numbers in zip(result["truth"], result["oracle_sd"], result["fits"], requested, strict=True):
            yield names, *numbers


def _add_means(table: pd.DataFrame, groups: Any, *names: str) -> None:
    for name in names:
        table[name], table[f"{name}_error"] = groups[name].mean(), groups[name].sem()


def _median_error(values: pd.Series[float]) -> float:
    """Return the standard error of a median: half the distance between the values one error of their rank away."""
    present = values.dropna()
    if len(present) < 2:
        return float("nan")
    away = 0.5 / np.sqrt(len(present))
    low, high = np.quantile(present, [max(0.5 - away, 0.0), min(0.5 + away, 1.0)])
    return float(0.5 * (high - low))
