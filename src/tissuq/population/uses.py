"""For what a population can be used: reporting the modulus of the tissue, predicting a new specimen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import chain

import numpy as np

from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.uses import PRECISE, Use, Verdict, precision_of, relative_half_width, worst_of
from tissuq.population.draws import PopulationDraws
from tissuq.population.picture import numbers_of
from tissuq.population.warnings import (
    far_specimens,
    has_converged,
    has_few_specimens,
    specimens_with,
    warnings_of_tests,
)
from tissuq.posterior.warnings import warnings_about
from tissuq.prediction.bands import Band
from tissuq.result_warning import Severity

PREDICTING = "predict a new specimen"
NOT_PREDICTED = "its stress cannot be predicted in the modes that were measured; 'Stress of a new specimen' says why"
CONTRADICTING = "the tests of most specimens contradict each other, so that moduli may be those of none of them"
DOUBTFUL_MEASUREMENTS = {"measurements", "large-drift"}
"""Codes of warnings about measurements beside which nothing is known for certain."""
DEPARTING = "the fitted curves of most specimens depart from the measured ones, and the intervals do not include that"


def uses_of_population(
    population: PopulationDraws,
    bands: Sequence[Band],
    quantity: str = "modulus",
) -> tuple[Use, ...]:
    """Return for what a population can be used, by the limits that hold for the fit of a specimen.

    Parameters
    ----------
    population : PopulationDraws
    bands : sequence of Band
        Of the stress of a new specimen, without noise, where specimens were measured; none where it is not predicted.
    quantity : str
        What the first pooled parameter is, or stands for.
    """
    against = _reason_against(population)
    purposes = (f"report the {quantity} of the tissue", PREDICTING)
    if against:
        return tuple(Use(purpose, Verdict.NO, against) for purpose in purposes)
    judged = (_reporting(population), _predicting(population, bands))
    return tuple(
        Use(purpose, *_beside_measurements(population, *verdict))
        for purpose, verdict in zip(purposes, judged, strict=True)
    )


def share_of_initial_stiffness(population: PopulationDraws) -> float:
    """Return the share of the initial stiffness that the discrepancy carries: the median of the specimens."""
    shares = [abs(shares_of_discrepancy(fit.solution)[1][0]) for fit in population.posteriors.values()]
    return float(np.median(shares))


def _reason_against(population: PopulationDraws) -> str:
    """Return what stands against any use; nothing where nothing does."""
    far = ", ".join(far_specimens(population))
    at_rest = specimens_with(population, "stress-at-rest")
    reasons = {
        "sampling has not converged": not has_converged(population),
        "what was read of the files is doubtful, as the warning says": bool(
            specimens_with(population, "doubtful-reading")
        ),
        f"{far} differs from the others as much as by a mistaken unit, as the warning says": bool(far),
        f"there is stress at rest{_of_few(population, at_rest)}, so that moduli may be off by far more than their "
        "intervals": bool(at_rest) and not _are_beside(population, at_rest),
        "the discrepancy aims at the best fit, not at the parameters": (
            population.complete.model.discrepancy.is_best_fit
        ),
    }
    found = next((reason for reason, applies in reasons.items() if applies), "")
    return found or _against_most_fits(population)


def _of_few(population: PopulationDraws, names: Sequence[str]) -> str:
    """Return which specimens it is of, as the end of a clause, where these are less than half."""
    return f" in {', '.join(names)}" if 0 < 2 * len(names) < len(population.names) else ""


def _are_beside(population: PopulationDraws, names: Sequence[str]) -> bool:
    """Return whether specimens are less than half, and their moduli move the middle of all within its interval."""
    if not _of_few(population, names):
        return False
    moduli = {name: posterior.initial_shear_modulus.mean for name, posterior in population.posteriors.items()}
    if min(moduli.values()) <= 0:
        return False
    logarithms = {name: np.log(modulus) for name, modulus in moduli.items()}
    others = [value for name, value in logarithms.items() if name not in names]
    shift = abs(np.expm1(np.mean([*logarithms.values()]) - np.mean(others)))
    return bool(shift <= _half_width(population))


def _half_width(population: PopulationDraws) -> float:
    """Return half the 95 % interval of the median over specimens of the first pooled parameter, over that median."""
    numbers = numbers_of(population.summary(unit="MPa"))[population.symbols[0], "median"]
    return float((numbers["hdi_high"] - numbers["hdi_low"]) / 2 / abs(numbers["median"]))


def _against_most_fits(population: PopulationDraws) -> str:
    """Return what stands against any use of the separate fits of more than half of the specimens."""
    fits = population.posteriors.values()
    counts = Counter(
        code
        for fit in fits
        for code in {warning.code for warning in warnings_about(fit.solution, {}, np.concatenate(fit.inside_bands()))}
    )
    reasons = {"tests-apart": CONTRADICTING, "unmodelled-curve": DEPARTING}
    return next((reason for code, reason in reasons.items() if 2 * counts[code] > len(fits)), "")


def _reporting(population: PopulationDraws) -> tuple[Verdict, str]:
    """Return whether the median of the population can be reported."""
    carried = share_of_initial_stiffness(population)
    if carried > PRECISE:
        of_stiffness = f"{100 * carried:.0f} % of the initial stiffness (median of the specimens)"
        return Verdict.NO, f"the discrepancy carries {of_stiffness}, by which it may be off"
    verdict, width = precision_of(_half_width(population))
    return _beside_law(population, verdict, f"median over specimens {width}")


def _predicting(population: PopulationDraws, bands: Sequence[Band]) -> tuple[Verdict, str]:
    """Return whether the stress of a specimen that was not measured can be predicted, where others were."""
    if not bands:
        return Verdict.NO, NOT_PREDICTED
    verdict, width = precision_of(max(map(relative_half_width, bands)))
    sentence = f"its stress {width} on average where specimens were measured, their spread included"
    if beyond := population.covariates.beyond(population.patient_covariates):
        return worst_of(verdict, Verdict.CARE), f"{sentence}, but it is beyond the specimens: {', '.join(beyond)}"
    if has_few_specimens(population):
        few = f"which {len(population.names)} specimens determine no better than its prior"
        return worst_of(verdict, Verdict.CARE), f"{sentence}, {few}"
    return _beside_law(population, verdict, sentence)


def _beside_measurements(population: PopulationDraws, verdict: Verdict, sentence: str) -> tuple[Verdict, str]:
    """Return a verdict with the doubt that warnings about the measurements of specimens, notes aside, leave.

    Stress at rest in a few of them may leave the numbers of the tissue as they are.
    """
    if at_rest := specimens_with(population, "stress-at-rest"):
        verdict, sentence = (
            worst_of(verdict, Verdict.CARE),
            f"{sentence}; there is stress at rest in {', '.join(at_rest)}",
        )
    warnings = chain.from_iterable(warnings_of_tests(population).values())
    if any(w.code in DOUBTFUL_MEASUREMENTS and w.severity is not Severity.NOTE for w in warnings):
        return worst_of(verdict, Verdict.CARE), f"{sentence}; see the warning about the measurements"
    return verdict, sentence


def _beside_law(population: PopulationDraws, verdict: Verdict, sentence: str) -> tuple[Verdict, str]:
    """Return a verdict that holds where the law is right, if no error of it was allowed for."""
    if population.complete.model.discrepancy.parameters:
        return verdict, sentence
    return worst_of(verdict, Verdict.CARE), f"{sentence}, if the material is right: its errors are not included"
