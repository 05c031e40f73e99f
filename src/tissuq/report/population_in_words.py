"""What a page says is to be done next with a population."""

from __future__ import annotations

from collections.abc import Sequence

from tissuq.assessment.uses import PRECISE, Use, Verdict
from tissuq.population import Population
from tissuq.population.uses import CONTRADICTING, DEPARTING, NOT_PREDICTED, PREDICTING
from tissuq.population.warnings import far_specimens
from tissuq.result_warning import has_code

__all__ = ["next_step_of"]

WIDE_SPREAD = 1.0
"""Sd of the logarithms, a factor of 2.7, from which specimens differ too much for one range to be of use."""


def next_step_of(
    population: Population,
    warnings: Sequence[str],
    share: float = 0.0,
    already_without: Sequence[str] = (),
    uses: Sequence[Use] = (),
    *,
    has_aim: bool = False,
    at_rest: Sequence[str] = (),
) -> str:
    """Return what to do next: mend what is doubtful of files and specimens before anything is computed with them.

    ``share`` is that of the stress which the discrepancy carries; with an aim, the page has the number that it takes.
    ``at_rest`` are the specimens with stress at rest, where it is known which.
    """
    if not population.converged:
        return "sample again, with another --seed; see the first warning"
    if has_code(warnings, "doubtful-reading"):
        return "say what the files do not, as the warning about what was read asks, and fit again"
    if far := list(far_specimens(population)):
        options = " ".join(f"--without {name}" for name in (*already_without, *far))
        return (
            f"look at {', '.join(far)} first: the unit of the stresses, the area, slack, the columns. Then fit again, "
            f"or leave {'it' if len(far) == 1 else 'them'} out: {options}"
        )
    if has_code(warnings, "stress-at-rest"):
        if 0 < 2 * len(at_rest) < len(population.posteriors):
            options = " ".join(f"--without {name}" for name in (*already_without, *at_rest))
            return (
                f"take off what the load cell shows at rest in {', '.join(at_rest)}, as the warning about it says, and "
                f"fit again, or leave {'it' if len(at_rest) == 1 else 'them'} out: {options}"
            )
        return "take off what the load cell shows at rest, as the warning about it says, and fit again"
    if population.complete.model.discrepancy.is_best_fit:
        return "let the data decide how wrong the material is: fit again with --discrepancy auto"
    reasons = {use.reason for use in uses}
    if CONTRADICTING in reasons:
        return "find out why the tests of a specimen contradict each other: tissuq fit of one says which, and how much"
    if DEPARTING in reasons:
        if not population.complete.model.discrepancy.parameters:
            return "let the data decide how wrong the material is: fit again with --discrepancy auto"
        return "see what the fits do not follow: tissuq fit of one specimen says what to do about it"
    spread = float(population.summary()["median"][population.symbols[0], "spread"])
    if population.coordinates.is_log[0] and spread > WIDE_SPREAD:
        return (
            "find out why the specimens differ so much (units, areas, kinds of tissue: --covariates) before you "
            "compute with a new one"
        )
    if share > PRECISE:
        return (
            "fit another law (--material) before you compute with a new specimen, whose cards leave the discrepancy "
            "out; tissuq fit FILE --material all of one specimen says which"
        )
    against = [use.reason for use in uses if use.purpose == PREDICTING and use.verdict is Verdict.NO]
    if any(reason != NOT_PREDICTED for reason in against):
        if has_aim:
            return (
                "find out what sets the specimens apart (--covariates); how many it takes stands beneath the parameters"
            )
        return (
            "see whether more specimens would make a new one predictable (the same command with --aim 20%), or what "
            "sets them apart (--covariates)"
        )
    return "take a new specimen into finite elements: tissuq export {run} (structure and ensemble take the run, too)"
