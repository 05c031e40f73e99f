"""The benchmark on real tissue: what it runs over, its many small tasks, and the summary of all by class of tissue."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import Field, field_validator

from tissuq.assessment.uses import PRECISE, USEFUL, Verdict
from tissuq.errors import InputError, TissuqError
from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import material_named
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.tolerances import AS_TESTED, SPECIMEN, TISSUE, Tolerances
from tissuq.posterior.fitting import fit
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import predictive_mixtures, speaks_of
from tissuq.prediction.scores import interval_score, root_mean_square
from tissuq.studies.campaign_settings import TissueOptions, each_once, names_among
from tissuq.studies.settings import there_is
from tissuq.studies.stream import Campaign, TaskOfFields
from tissuq.validation.tissues.corpus import TissueSet, read_corpus

if TYPE_CHECKING:
    import pandas as pd


PROBABILITIES = (0.5, 0.8, 0.95)
"""Of the intervals whose coverage is counted; the last is that of half widths and scores."""
TARGET_INSIDE, TARGET_HALF_WIDTH = 0.9, 0.5
"""Share of the measurements in the band, and half width relative to the stress, that make a prediction useful."""
MODULUS = ("modulus_low", "modulus_of_predicted", "modulus_high", "modulus_mean")
"""Initial shear moduli, MPa: the interval of the fitted tests, the median of the predicted one between its ends, and
the mean of the fitted ones."""
MODULI = "modes"
"""The protocol that compares initial shear moduli, too: that of the fitted tests with that of the predicted one."""
ALL = "all"
"""The class of all tissues together."""
BEYOND_THE_RANGE = ("ends",)
"""Protocols whose predictions leave the range of the fitted tests, of which no verdict speaks."""
END_SHARE = 0.3
"""Share of the range of a test, farthest from the reference, that is predicted from the rest of it."""
MIN_FITTED = 4
"""Smallest number of measurements of a part of a test that is fitted or predicted."""


class Split(NamedTuple):
    """Tests that are fitted, and a test that is predicted from them."""

    fitted: tuple[Experiment, ...]
    predicted: Experiment


def _each_test(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict each test from all others of its set."""
    for index, test in enumerate(tests):
        if len(tests) > 1:
            yield Split((*tests[:index], *tests[index + 1 :]), test)


def _each_mode(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict each test from all tests of one other mode."""
    modes = dict.fromkeys(test.mode for test in tests)
    for test in tests:
        for mode in modes:
            if mode != test.mode:
                yield Split(tuple(fitted for fitted in tests if fitted.mode == mode), test)


def _each_protocol_of_a_specimen(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict each test of a specimen from the other tests of the same specimen."""
    for specimen in dict.fromkeys(test.specimen for test in tests if test.specimen):
        yield from _each_test([test for test in tests if test.specimen == specimen])


def _each_end(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict the end of each test, where it is farthest from the reference, from the rest of it."""
    for test in tests:
        strain = np.abs((test.stretch - test.mode.reference).reshape(len(test), -1)).max(axis=1)
        yield from _parts(test, strain > (1 - END_SHARE) * strain.max())


def _each_half(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict every second measurement of each test from the others."""
    for test in tests:
        yield from _parts(test, np.arange(len(test)) % 2 == 1)


def _parts(test: Experiment, is_predicted: np.ndarray) -> Iterator[Split]:
    if min(np.count_nonzero(is_predicted), np.count_nonzero(~is_predicted)) >= MIN_FITTED:
        yield Split((test.where(~is_predicted),), test.where(is_predicted))


PROTOCOLS: Mapping[str, Callable[[Sequence[Experiment]], Iterator[Split]]] = MappingProxyType(
    {
        "tests": _each_test,
        "modes": _each_mode,
        "specimens": _each_protocol_of_a_specimen,
        "ends": _each_end,
        "halves": _each_half,
    }
)
"""How the tests of a set become fitted and predicted ones, by name."""
ESTIMAND_OF_PROTOCOL: Mapping[str, str] = MappingProxyType(
    {"tests": TISSUE, "modes": TISSUE, "specimens": SPECIMEN, "ends": AS_TESTED, "halves": AS_TESTED}
)
"""What the intervals of a fit must be of, so that they hold for what is predicted."""


RIVALS = {"embedded": {"discrepancy": "none", "noise_sd": "proportional"}}
"""What is fitted under names that are no discrepancy.

Embedded: the stiffness of the law is random, anew at every measurement. So the stress of a law that is linear in its
stiffness has an independent error in proportion to it, as with proportional noise: the independent normal form of
Sargsyan, Huan & Najm (2019, arXiv:1801.06768), which Andres Arcones et al. (2026, Data-Centric Engineering) extend.
"""


class TissueSettings(TissueOptions):
    """Everything that a benchmark on real tissue depends on, but for the data themselves.

    Attributes
    ----------
    folder : str, optional
        Of the data sets (`tissuq.validation.tissues.read_corpus`); without it those of the package.
    sets : tuple of str
        Names of the sets that are taken; all, where there are none.
    protocols : tuple of str
        Which tests are predicted from which (`PROTOCOLS`).
    formulations : tuple of str
        Discrepancies of the fits, or ``"embedded"`` (`RIVALS`).
    material : str
    tolerances : dict of str to float, optional
        Standard deviations of errors of the tests (`tissuq.Tolerances`, stresses in MPa); without it those of what is
        predicted (`ESTIMAND_OF_PROTOCOL`): of the tissue for a new test, of the specimen for a test of the same one,
        none for a part of the same test.
    points : int
        Number of measurements at most that are taken from a test, evenly along it.
    predictions : int
        Number of predictions at most for each set and protocol, evenly among all.
    """

    points: int = Field(30, ge=4, le=10_000)

    _once = field_validator("protocols", "formulations")(each_once)
    _known_protocols = field_validator("protocols")(names_among(PROTOCOLS, "protocol"))
    _known_formulations = field_validator("formulations")(
        there_is(lambda name: RIVALS.get(name) or discrepancy_named(name))
    )
    _known_material = field_validator("material")(there_is(material_named))


@dataclass(frozen=True)
class PredictionTask(TaskOfFields):
    """A prediction of one test by one formulation, all by their indices but the set, which has a name."""

    tissue: str
    protocol: str
    number: int
    formulation: str
    separator = "/"

    @property
    def label(self) -> str:
        """What is shown while it is carried out."""
        return f"{self.tissue}, {self.protocol}, {self.formulation}"


def sets_of(settings: TissueSettings) -> tuple[str, ...]:
    """Return the names of the sets that are taken."""
    return settings.sets or tuple(_corpus(settings.folder))


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
        for name in sets_of(settings)
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
        modulus_use, own_tests, other_modes, _ = posterior.answer.uses
        row |= predicted(posterior, target)
        if task.protocol not in BEYOND_THE_RANGE:
            row["verdict"] = (own_tests if target.mode in posterior.model.experiment.modes else other_modes).verdict
        if task.protocol == MODULI:
            of_target = fit(target, **options).initial_shear_modulus
            low, high = posterior.initial_shear_modulus.hdi(PROBABILITIES[-1])
            row |= {"modulus_low": low, "modulus_high": high, "modulus_of_predicted": float(of_target.quantile(0.5))}
            row |= {"modulus_mean": posterior.initial_shear_modulus.mean, "modulus_verdict": modulus_use.verdict}
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


def summarise_verdicts(results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a protocol, formulation and verdict on what was predicted, the best verdict first.

    What is predicted, ``quantity``, is the stress of a test, and where one mode is predicted from another the initial
    shear modulus, too: its mean from the fitted tests against the median from the predicted one.

    Columns: ``predictions``; ``held``, the mean share of measurements (or of moduli) in 95 % intervals; ``error``, the
    median error of the centre, relative to the stress (or modulus) itself; and ``precise`` and ``of_use``, the shares
    of predictions that are off by no more than what a verdict of yes, and one of care, claims (`assessment.uses`).
    """
    import pandas as pd

    table = pd.DataFrame(results).reindex(
        columns=["protocol", "formulation", "verdict", "inside_95", "error", "modulus_verdict", *MODULUS]
    )
    low, modulus, high = (table[name] for name in MODULUS[:3])
    of_modulus = table.assign(
        quantity="modulus",
        verdict=table["modulus_verdict"],
        held=((low <= modulus) & (modulus <= high)).astype(float),
        error=(table["modulus_mean"] / modulus - 1).abs(),
    )
    rows = pd.concat([table.assign(quantity="stress", held=table["inside_95"]), of_modulus]).dropna(subset="verdict")
    for name, order in (("quantity", ("stress", "modulus")), ("protocol", PROTOCOLS), ("verdict", tuple(Verdict))):
        rows[name] = pd.Categorical(rows[name], list(order))
    rows["precise"], rows["of_use"] = ((rows["error"] <= limit).astype(float) for limit in (PRECISE, USEFUL))
    groups = rows.groupby(["quantity", "protocol", "formulation", "verdict"], observed=True)
    summary = groups[["held", "precise", "of_use"]].mean()
    return summary.assign(predictions=groups.size(), error=groups["error"].median()).reset_index()


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
