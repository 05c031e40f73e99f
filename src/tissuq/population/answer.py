"""The answer of a population first: what to expect of a new specimen, the law, and for what both can be used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import exp
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from tissuq.assessment.extent import has_energy
from tissuq.assessment.modulus import modulus_symbols
from tissuq.assessment.next_step import Step
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.uses import COMPUTING, PRECISE, Use, Verdict
from tissuq.errors import TissuqError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.units import StressUnit
from tissuq.mechanics import initial_shear_modulus
from tissuq.population.draws import PopulationDraws
from tissuq.population.next_step import next_step
from tissuq.population.patient import check_one_control, patient_band
from tissuq.population.picture import numbers_of
from tissuq.population.uses import NOT_PREDICTED, share_of_initial_stiffness, uses_of_population
from tissuq.population.warnings import specimens_with
from tissuq.prediction.bands import Band, asked_for

MODULUS = "initial shear modulus"
ENDS = ("hdi_low", "hdi_high")
POINTS = 81
"""Of the stress of a new specimen where specimens were measured."""
Measured: TypeAlias = tuple[LoadingMode, int]
"""A loading mode and the number of one of its stresses."""


class PopulationEstimate(NamedTuple):
    """A number of a population: its name, median, the ends of its 95 % interval, and their unit."""

    name: str
    median: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class PopulationAnswer:
    """What a population says, before everything else.

    Attributes
    ----------
    estimates : tuple of PopulationEstimate
        What is to be expected of a new specimen, the median of the population, and the spread between specimens.
    uses : tuple of Use
        Reporting the modulus of the tissue, predicting a new specimen, and finite elements with one.
    next_step : Step
    law : str
        Where the law by itself does not describe the measurements: how much of the stress the discrepancy carries.
    share : float
        That share, the median of the specimens; zero where it is not known.
    """

    estimates: tuple[PopulationEstimate, ...]
    uses: tuple[Use, ...]
    next_step: Step
    law: str = ""
    share: float = 0.0

    def __str__(self) -> str:
        """Return the answer as lines, with what to do next as typed in Python."""
        lines = [
            f"{name} {median:.3g}{f' {unit}' * bool(unit)}, 95 % interval {low:.3g} to {high:.3g}"
            for name, median, low, high, unit in self.estimates
        ]
        lines += [self.law] * bool(self.law)
        lines += [f"{use.verdict.upper()}: {use.purpose}: {use.reason}" for use in self.uses]
        return "\n".join([*lines, f"Next: {self.next_step.python}"])


def answer_of_population(
    population: PopulationDraws,
    shown: StressUnit | None = None,
    bands: Iterable[Band] | None = None,
    without: Sequence[str] = (),
    *,
    has_aim: bool = False,
) -> PopulationAnswer:
    """Return the answer that a population gives.

    Parameters
    ----------
    shown : StressUnit, optional
        That of the estimates, unless it is that of the population.
    bands : iterable of Band, optional
        The stress of a new specimen where specimens were measured, where it is known already.
    without : sequence of str
        Specimens that were left out.
    has_aim : bool
        Whether the number of specimens that an aim takes is told beside.
    """
    words, times = headline(population)
    symbol, is_log = population.symbols[0], bool(population.coordinates.is_log[0])
    shown = shown or population.unit()
    unit, table = population.unit_of(symbol, shown), numbers_of(population.summary(unit=shown.name))

    def estimate(name: str, quantity: str, unit_name: str) -> PopulationEstimate:
        middle, low, high = (table[symbol, quantity][end] for end in ("median", *ENDS))
        if quantity == "spread" and is_log:
            return PopulationEstimate(name, exp(middle), exp(low), exp(high), "")
        return PopulationEstimate(name, times * middle, times * low, times * high, unit_name)

    estimates = (
        estimate(f"{words} of a new specimen{patient_in_words(population)}", "new specimen", unit.name),
        estimate(f"{words}, median of the population{patient_in_words(population, {})}", "median", unit.name),
        estimate("spread between specimens" + ", as a factor" * is_log, "spread", unit.name),
    )
    share = share_of_discrepancy(population)
    if bands is None:
        bands = [band for (band,) in stresses_where_measured(population, (True,))[0].values()]
    uses = uses_of_population(population, [*bands], "modulus" if words == MODULUS else words)
    law = about_law(population, share) + about_modulus(population, share, words)
    uses = (*uses, use_of_law_alone(share, uses[-1]))
    step = next_step(population, uses, share, without, has_aim=has_aim)
    return PopulationAnswer(estimates, uses, step, law.strip(), share)


def patient_in_words(population: PopulationDraws, known: Mapping[str, Any] | None = None) -> str:
    """Return what is ``known`` of a specimen, in brackets, or else of the new specimen; nothing without covariates.

    Of nothing it is where the median of the population is.
    """
    text = population.covariates.described(population.patient_covariates if known is None else known)
    return f" ({text})" if text else ""


def stresses_where_measured(
    population: PopulationDraws, kinds: Sequence[bool]
) -> tuple[dict[Measured, tuple[Band, ...]], list[str]]:
    """Return every stress of a new specimen where specimens were measured, and why those of a mode are not predicted.

    With the model error for a true one of the ``kinds``, and of the material alone for a false one.
    """
    bands, not_predicted = dict[Measured, tuple[Band, ...]](), list[str]()
    tests = [test for fit in population.posteriors.values() for test in fit.model.experiment.tests]
    for mode in population.complete.model.experiment.modes:
        reach = np.concatenate([test.stretch for test in tests if test.mode == mode])
        stretch = np.linspace(reach.min(), reach.max(), POINTS)
        try:
            check_one_control(mode)
            for channel in range(len(mode.stresses)):
                of_stress: dict[str, Any] = {"prob": 0.95, "channel": channel}
                asked_for([population.complete.solution], stretch, mode=mode, discrepancy=any(kinds), **of_stress)
                bands[mode, channel] = tuple(
                    patient_band(population, mode, stretch, discrepancy=kind, **of_stress) for kind in kinds
                )
        except TissuqError as error:  # two controls, or some of the population's materials lock before the largest
            not_predicted.append(f"{mode.name}: {error}")
    return bands, not_predicted


def headline(population: PopulationDraws) -> tuple[str, float]:
    """Return what a page says first, and its ratio to the first parameter.

    The initial shear modulus where it is a multiple of the first parameter, and this parameter otherwise.
    """
    model, symbol = population.complete.model, population.symbols[0]
    if modulus_symbols(model) != (symbol,) or model.bent_symbols:
        return symbol, 1.0
    of_the_first = [float(parameter.symbol == symbol) for parameter in model.material.parameters]
    return MODULUS, initial_shear_modulus(model.material, of_the_first)


def use_of_law_alone(share: float, predicting: Use) -> Use:
    """Return whether a new specimen serves further computations, which have the law alone.

    Parameters
    ----------
    share : float
        Of the stress which the discrepancy carries.
    predicting : Use
        Of the stress of a new specimen where others were measured.
    """
    if share > PRECISE:
        carried = f"which carries {100 * share:.0f} % of the stress (median of the specimens)"
        return Use(COMPUTING, Verdict.NO, f"cards and predictions leave out the discrepancy, {carried}")
    if predicting.reason == NOT_PREDICTED:
        return Use(COMPUTING, Verdict.CARE, "how well its stress is known was not computed")
    return predicting._replace(purpose=COMPUTING)


def about_law(population: PopulationDraws, share: float) -> str:
    """Return how far the law alone is from the measurements, as a sentence after others; nothing where it is near."""
    if share <= PRECISE:
        return ""
    law = population.complete.model.material.name
    return (
        f" {law} alone is wrong here: the discrepancy carries {100 * share:.0f} % of the stress (median of the "
        f"specimens), and cards of a new specimen are of {law} alone."
    )


def about_modulus(population: PopulationDraws, share: float, words: str) -> str:
    """Return why the modulus of a law that is wrong can be right, as a sentence after others."""
    initial = share_of_initial_stiffness(population)
    if words != MODULUS or not initial <= PRECISE < share:
        return ""
    return f" The modulus is that at rest, of which the discrepancy carries {100 * initial:.0f} %."


def share_of_discrepancy(population: PopulationDraws) -> float:
    """Return the share of the stress that the discrepancy carries: the median of the specimens without stress at rest.

    Zero where it is not known of most specimens.
    """
    posteriors, at_rest = population.posteriors, specimens_with(population, "stress-at-rest")
    fits = [fit for name, fit in posteriors.items() if name not in at_rest and has_energy(fit.solution.model)]
    shares = [shares_of_discrepancy(fit.solution)[0] for fit in fits]
    known = [share for share, _, high in shares if high < 1]
    return float(np.median(known)) if 2 * len(known) > len(posteriors) else 0.0
