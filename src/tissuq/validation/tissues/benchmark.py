"""The benchmark as many small tasks, what each of them gives, and the summary of all by class of tissue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.tolerances import Tolerances
from tissuq.posterior.fitting import fit
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import predictive_mixtures, speaks_of
from tissuq.prediction.scores import interval_score, root_mean_square
from tissuq.studies.stream import Campaign
from tissuq.validation.tissues.corpus import TissueSet, read_corpus
from tissuq.validation.tissues.settings import ESTIMAND_OF_PROTOCOL, PROTOCOLS, RIVALS, Split, TissueSettings

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ALL", "PROBABILITIES", "PredictionTask", "predicted", "run_benchmark", "summarise_tissues", "tasks_of"]

FloatArray = NDArray[np.float64]

PROBABILITIES = (0.5, 0.8, 0.95)
"""Of the intervals whose coverage is counted; the last is that of half widths and scores."""
TARGET_INSIDE, TARGET_HALF_WIDTH = 0.9, 0.5
"""Share of the measurements in the band, and half width relative to the stress, that make a prediction useful."""
MODULUS = ("modulus_low", "modulus_of_predicted", "modulus_high")
"""Initial shear moduli, MPa: the interval of the fitted tests, and the median of the predicted one between its ends."""
MODULI = "modes"
"""The protocol that compares initial shear moduli, too: that of the fitted tests with that of the predicted one."""
ALL = "all"
"""The class of all tissues together."""


@dataclass(frozen=True)
class PredictionTask:
    """A prediction of one test by one formulation, all by their indices but the set, which has a name."""

    tissue: str
    protocol: str
    number: int
    formulation: str

    @property
    def key(self) -> str:
        """What tells it from every other task of the benchmark."""
        return f"{self.tissue}/{self.protocol}/{self.number}/{self.formulation}"

    @property
    def label(self) -> str:
        """What is shown while it is carried out."""
        return f"{self.tissue}, {self.protocol}, {self.formulation}"


def tasks_of(settings: TissueSettings) -> list[PredictionTask]:
    """Return all tasks of a benchmark, in their order.

    Raises
    ------
    InputError
        When data cannot be read, there is no set of a name, or there is nothing to predict.
    """
    corpus = _corpus(settings.folder)
    unknown = [name for name in settings.sets if name not in corpus]
    if unknown:
        raise InputError(f"there is no set {', '.join(map(repr, unknown))}. The sets are: {', '.join(corpus)}.")
    tasks = [
        PredictionTask(name, protocol, number, formulation)
        for name in settings.sets or corpus
        for protocol in settings.protocols
        for number in _taken(len(_splits(settings.folder, name, protocol)), settings.predictions)
        for formulation in settings.formulations
    ]
    if not tasks:
        raise InputError(f"the sets hold nothing to predict by the protocols {', '.join(settings.protocols)}.")
    return tasks


def carry_out(settings: TissueSettings, task: PredictionTask) -> dict[str, Any]:
    """Return how one test was predicted; ``failure`` says why, where it was not."""
    split = _splits(settings.folder, task.tissue, task.protocol)[task.number]
    fitted = [_thinned(test, settings.points) for test in split.fitted]
    target = _thinned(split.predicted, settings.points)
    row: dict[str, Any] = {
        "tissue": task.tissue,
        "class": _corpus(settings.folder)[task.tissue].tissue_class,
        "protocol": task.protocol,
        "formulation": task.formulation,
        "fitted": [test.name for test in fitted],
        "predicted": target.name,
        "mode": target.mode.name,
    }
    rival = RIVALS.get(task.formulation)
    options: dict[str, Any] = {"material": settings.material} | (rival or {"discrepancy": task.formulation})
    if not rival and discrepancy_named(task.formulation).is_energy:  # others take up errors of the test themselves
        estimand = ESTIMAND_OF_PROTOCOL[task.protocol]
        options["tolerances"] = Tolerances(estimand if settings.tolerances is None else "", **settings.tolerances or {})
    try:
        posterior = fit(fitted, **options)
        row |= predicted(posterior, target)
        if task.protocol == MODULI:
            of_target = fit(target, **options).initial_shear_modulus
            low, high = posterior.initial_shear_modulus.hdi(PROBABILITIES[-1])
            row |= {"modulus_low": low, "modulus_high": high, "modulus_of_predicted": float(of_target.quantile(0.5))}
        return row
    except (TissuqError, np.linalg.LinAlgError) as error:
        return row | {"failure": str(error)}


run_benchmark = Campaign(tasks_of, carry_out)
"""Carries out a benchmark on real tissue."""


def predicted(posterior: Posterior, test: Experiment) -> dict[str, float]:
    """Return how a posterior predicts all stresses of a test that it has not seen.

    The band is that of a new test with noise and an error of its own; a discrepancy that says nothing about the test's
    mode is left out of it. Stresses of zero, which are so by definition, are left out.

    Returns
    -------
    dict
        ``inside_50``, ``inside_80`` and ``inside_95``, the shares of the measurements in central intervals; over the
        root mean square of the stress those of the half width of the 95 % interval (``half_width``) and of the error of
        the median (``error``), and the mean interval score (``score``).
    """
    model = posterior.model
    tails = sorted({0.5, *(0.5 + 0.5 * prob for prob in PROBABILITIES), *(0.5 - 0.5 * prob for prob in PROBABILITIES)})
    measured, quantiles = [], []
    for curve in test.curves:
        is_loaded = curve.stress != 0
        blocks = predictive_mixtures(
            [(1.0, posterior.solution)],
            curve.points[is_loaded],
            curve.mode,
            curve.channel,
            discrepancy=speaks_of(model, curve.mode),
            noises=(True,),
        )
        measured.append(curve.stress[is_loaded])
        quantiles += [[mixture.quantile(tail) for tail in tails] for (mixture,) in blocks]
    stress, levels = np.concatenate(measured), np.concatenate(quantiles, axis=1)
    size = root_mean_square(stress)
    result = {}
    for prob, low, high in zip(PROBABILITIES[::-1], levels, levels[::-1], strict=False):
        result[f"inside_{100 * prob:.0f}"] = float(((low <= stress) & (stress <= high)).mean())
    low, centre, high = levels[0], levels[len(tails) // 2], levels[-1]
    return result | {
        "half_width": root_mean_square(0.5 * (high - low)) / size,
        "error": root_mean_square(centre - stress) / size,
        "score": float(interval_score(low, high, stress, PROBABILITIES[-1]).mean()) / size,
    }


def summarise_tissues(results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a protocol, class of tissue and formulation, and one of all classes together.

    Columns: ``predictions`` and ``failed``; the means over predictions of ``inside_50``, ``inside_80`` and
    ``inside_95``; the medians of ``half_width``, ``error`` and ``score``; and ``useful``, the share of predictions with
    90 % of the measurements in a 95 % band whose half width is less than half of the stress. Where one mode is
    predicted from another, ``modulus_inside``, the share of 95 % intervals of the fitted tests' initial shear modulus
    that hold the median of that of the predicted test, and ``modulus_ratio``, the median ratio of their ends.
    """
    import pandas as pd

    scores = [*(f"inside_{100 * prob:.0f}" for prob in PROBABILITIES), "half_width", "error", "score"]
    table = pd.DataFrame(results).reindex(columns=["protocol", "class", "formulation", *scores, *MODULUS])
    is_useful = (table["inside_95"] >= TARGET_INSIDE) & (table["half_width"] < TARGET_HALF_WIDTH)
    table["useful"] = is_useful.where(table["inside_95"].notna()).astype(float)
    low, modulus, high = (table[f"modulus_{name}"] for name in ("low", "of_predicted", "high"))
    table["modulus_inside"] = ((low <= modulus) & (modulus <= high)).where(modulus.notna()).astype(float)
    table["modulus_ratio"] = high / low.clip(lower=0)
    pieces = [table, table.assign(**{"class": ALL})] if table["class"].nunique() > 1 else [table]
    rows = pd.concat(pieces)
    for name in ("protocol", "class", "formulation"):  # in the order of the results
        rows[name] = pd.Categorical(rows[name], list(dict.fromkeys(rows[name])))
    groups = rows.groupby(["protocol", "class", "formulation"], observed=True)
    count = groups["inside_95"].count()
    summary = pd.DataFrame({"predictions": count, "failed": groups.size() - count})
    for name in (*scores, "useful", "modulus_inside", "modulus_ratio"):
        summary[name] = groups[name].mean() if "inside" in name or name == "useful" else groups[name].median()
    return summary.reset_index()


@lru_cache(maxsize=1)
def _corpus(folder: str | None) -> dict[str, TissueSet]:
    return {tissue.name: tissue for tissue in read_corpus(folder)}


@lru_cache
def _splits(folder: str | None, tissue: str, protocol: str) -> tuple[Split, ...]:
    return tuple(PROTOCOLS[protocol](_corpus(folder)[tissue].tests))


def _taken(count: int, limit: int) -> list[int]:
    """Return numbers below a count, evenly among all where these are too many."""
    return sorted({int(number) for number in np.linspace(0, count - 1, min(count, limit)).round()}) if count else []


def _thinned(test: Experiment, points: int) -> Experiment:
    return test if len(test) <= points else test.where(np.array(_taken(len(test), points)))
