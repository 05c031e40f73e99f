"""What to do next with a population, as typed in a shell and in Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tissuq.assessment.next_step import STEPS, Step
from tissuq.assessment.uses import PRECISE, Use, Verdict
from tissuq.population.draws import PopulationDraws
from tissuq.population.uses import CONTRADICTING, DEPARTING, NOT_PREDICTED, PREDICTING
from tissuq.population.warnings import far_specimens, has_converged, specimens_with

WIDE_SPREAD = 1.0
"""Sd of the logarithms, a factor of 2.7, from which specimens differ too much for one range to be of use."""
STEPS_OF_POPULATIONS: Mapping[str, Step] = {
    "converge": Step(
        "sample again, with another --seed; see the first warning",
        "sample again, with another seed; see the first warning",
    ),
    "reading": Step(*["say what the files do not, as the warning about what was read asks, and fit again"] * 2),
    "zero": Step(*["take off what the load cell shows at rest, as the warning about it says, and fit again"] * 2),
    "auto": Step(*(text.rstrip(".") for text in STEPS["auto"])),
    "apart": Step(
        "find out why the tests of a specimen contradict each other: tissuq fit of one says which, and how much",
        "find out why the tests of a specimen contradict each other: tq.fit of one says which, and how much",
    ),
    "curve": Step(
        "see what the fits do not follow: tissuq fit of one specimen says what to do about it",
        "see what the fits do not follow: tq.fit of one specimen says what to do about it",
    ),
    "spread": Step(
        "find out why the specimens differ so much (units, areas, kinds of tissue: --covariates{beside}) before you "
        "compute with a new one",
        "find out why the specimens differ so much (units, areas, kinds of tissue: covariates{beside}) before you "
        "compute with a new one",
    ),
    "law": Step(
        "fit another law (--material) before you compute with a new specimen, whose cards leave the discrepancy "
        "out; tissuq fit FILE --material all of one specimen says which",
        "fit another law before you compute with a new specimen, whose cards leave the discrepancy out; tq.fit_laws of "
        "one specimen says which",
    ),
    "number": Step(
        "find out what sets the specimens apart (--covariates{beside}); how many it takes stands beneath the "
        "parameters",
        "find out what sets the specimens apart (covariates{beside}); population.specimens_needed says how many it "
        "takes",
    ),
    "aim": Step(
        "see whether more specimens would make a new one predictable (the same command with --aim 20%), or what "
        "sets them apart (--covariates{beside})",
        "see whether more specimens would make a new one predictable (population.specimens_needed(0.2)), or what sets "
        "them apart (covariates{beside})",
    ),
    "export": Step(
        "take a new specimen into finite elements: tissuq export {run} (structure and ensemble take the run, too)",
        "take a new specimen into finite elements: population.patient.ensemble(20), tq.write_cards",
    ),
}
"""What may be done next, beside looking at single specimens; ``{beside}`` stands for covariates that are known."""


def next_step(
    population: PopulationDraws,
    uses: Sequence[Use],
    share: float,
    already_without: Sequence[str] = (),
    *,
    has_aim: bool = False,
) -> Step:
    """Return the one thing to do next: mend what is doubtful of files and specimens before anything is computed.

    Parameters
    ----------
    population : PopulationDraws
    uses : sequence of Use
        For what it can be used.
    share : float
        Of the stress that the discrepancy carries.
    already_without : sequence of str
        Specimens that are left out already.
    has_aim : bool
        Whether the page has the number of specimens that an aim takes.
    """

    def without(names: Sequence[str], first: str) -> Step:
        it = "it" if len(names) == 1 else "them"
        options = " ".join(f"--without {name}" for name in (*already_without, *names))
        return Step(f"{first} fit again, or leave {it} out: {options}", f"{first} fit again, or leave {it} out")

    known = ", ".join(covariate.name for covariate in population.covariates.each)
    beside = f" beside {known}" * bool(known)
    steps = {
        name: Step(*(text.replace("{beside}", beside) for text in step)) for name, step in STEPS_OF_POPULATIONS.items()
    }
    if not has_converged(population):
        return steps["converge"]
    if specimens_with(population, "doubtful-reading"):
        return steps["reading"]
    if far := list(far_specimens(population)):
        named = f"look at {', '.join(far)} first: the unit of the stresses, the area, slack, the columns. Then"
        return without(far, named)
    if at_rest := specimens_with(population, "stress-at-rest"):
        if 2 * len(at_rest) >= len(population.posteriors):
            return steps["zero"]
        named = f"take off what the load cell shows at rest in {', '.join(at_rest)}, as the warning about it says, and"
        return without(at_rest, named)
    discrepancy, reasons = population.complete.model.discrepancy, {use.reason for use in uses}
    if discrepancy.is_best_fit:
        return steps["auto"]
    if CONTRADICTING in reasons:
        return steps["apart"]
    if DEPARTING in reasons:
        return steps["curve" if discrepancy.parameters else "auto"]
    spread = float(population.summary()["median"][population.symbols[0], "spread"])
    if population.coordinates.is_log[0] and spread > WIDE_SPREAD:
        return steps["spread"]
    if share > PRECISE:
        return steps["law"]
    against = [use.reason for use in uses if use.purpose == PREDICTING and use.verdict is Verdict.NO]
    if any(reason != NOT_PREDICTED for reason in against):
        return steps["number" if has_aim else "aim"]
    return steps["export"]
