"""The one thing to do next."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from tissuq.assessment.measurements import falls
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.stability import StableRange
from tissuq.assessment.uses import PRECISE, SPREAD, Use, Verdict, may_be_of_one_specimen
from tissuq.experiments.experiment import Experiment
from tissuq.inference.solution import Solution
from tissuq.result_warning import ResultWarning, Severity, has_code


class Step(NamedTuple):
    """What to do next, as typed in a shell (``{run}`` stands for the folder of the run) and in Python."""

    shell: str
    python: str


STEPS: Mapping[str, Step] = {
    "auto": Step(
        "let the data decide how wrong the material is: fit again with --discrepancy auto.",
        'let the data decide how wrong the material is: fit again with discrepancy="auto".',
    ),
    "problem": Step(*["act on the first warning: it says what to do."] * 2),
    "measurements": Step(
        "act on the warning about the measurements: fit again with {options}.",
        "act on the warning about the measurements: it says what to do.",
    ),
    "slack": Step(
        "count from where load begins: fit again with --preload auto.",
        'count from where load begins: read again with preload="auto".',
    ),
    "fibres": Step(
        "fit a law with fibres, which has the preferred direction: fit again with --material holzapfel-gasser-ogden "
        "(tissuq materials lists others).",
        'fit a law with fibres, which has the preferred direction: fit again with material="holzapfel-gasser-ogden".',
    ),
    "strips": Step(
        "fit a law with fibres to the tests along both axes: fit again with --material holzapfel-gasser-ogden "
        "--discrepancy gp-pinned.",
        'fit a law with fibres to the tests along both axes: fit again with material="holzapfel-gasser-ogden" and '
        'discrepancy="gp-pinned".',
    ),
    "zero": Step(
        "take off what the load cell shows at rest: fit again with {options}.",
        'take off what the load cell shows at rest, as the warning says: read again with load_zero="first".',
    ),
    "few": Step(
        "measure at more stretches, from near rest onward: tissuq design {run} says which.",
        "measure at more stretches, from near rest onward: posterior.design() says which.",
    ),
    "specimens": Step(*["measure further specimens: how much they differ is assumed so far, and sets the width."] * 2),
    "unnamed specimens": Step(
        "if the tests are of one specimen, say so: fit again with --specimen NAME once for each; if not, measure more.",
        'if the tests are of one specimen, say so: fit [test.labelled(specimen="NAME"), ...]; if not, measure more.',
    ),
    "law": Step(
        "see whether another law describes the measurements by itself: fit again with --material all.",
        "see whether another law describes the measurements by itself: tq.fit_laws.",
    ),
    "design": Step(
        "see which test would make it narrower: tissuq design {run}",
        "see which test would make it narrower: posterior.design()",
    ),
    "apart": Step(*["find out why the tests contradict each other, as the warning says."] * 2),
    "curve": Step(*["act on the warning about the measured curve, which the fit does not follow."] * 2),
    "second mode": Step(
        "measure a second loading mode; tissuq design {run}{targets} says which helps most.",
        "measure a second loading mode; posterior.design({targets}) says which helps most.",
    ),
    "stable": Step(
        "restrict the fit to stable materials: fit again with --stable-in all.",
        'restrict the fit to stable materials: fit again with stable_in="all".',
    ),
    "peak": Step(
        "leave out where the stress falls, which no stable material does: fit again with --until-peak.",
        "leave out where the stress falls, which no stable material does: read again with until_peak=True.",
    ),
    "export": Step(
        "take it into finite elements: tissuq export {run} --format abaqus",
        "take it into finite elements: posterior.ensemble(20), tq.write_cards",
    ),
}
"""What may be done next."""
STEPS_OF_WARNINGS: Mapping[str, str] = {
    "stress-at-rest": "zero",
    "tests-apart": "apart",
    "contradicting-tests": "apart",
    "unmodelled-curve": "curve",
    "measurements": "measurements",
    "large-drift": "measurements",
    "unstable": "stable",
    "few-measurements": "few",
    "slack": "slack",
}
"""Step for a caution of each code: before further tests, for the severest that has one."""
ONLY_IN_DOUBT = {"slack": Verdict.CARE, "few-measurements": Verdict.NO}
"""Of some, the best verdict on the modulus at which they are the next step."""


OPTION = (
    r'--(?:until-peak|relaxed)|--[a-z-]+ (?:"[^"]+"|auto|last|first|loading|biaxial|planar|[a-z]+=[\d.]*\d|\d[\d:,]*)'
)
OPTIONS = re.compile(f"(?:{OPTION})(?: (?:{OPTION}))*")
"""The options, with their values, that a warning about measurements proposes."""
MAY_BE_SPECIMENS = "they may be tests of several specimens"
"""What a warning about cycles says of those whose unloading was not recorded."""


def next_step(
    solution: Solution,
    uses: Sequence[Use],
    ranges: Mapping[str, StableRange],
    warnings: Sequence[ResultWarning],
) -> Step:
    """Return the one thing to do next, the severest of the warnings first."""
    if any(warning.severity is Severity.PROBLEM for warning in warnings):
        return STEPS["problem"]
    reporting, _, predicting, simulating = (use.verdict for use in uses)
    model, verdicts = solution.model, list(Verdict)
    is_plain_law = solution.is_of_data and not model.energy_symbols and model.material.is_isotropic
    if is_plain_law and not has_code(warnings, "stress-at-rest"):
        return STEPS["auto"]
    if model.material.is_isotropic and model.experiment.is_along_both_axes and reporting is not Verdict.YES:
        return STEPS["strips"]
    for warning in warnings:
        is_due = verdicts.index(reporting) >= verdicts.index(ONLY_IN_DOUBT.get(warning.code, Verdict.YES))
        if warning.severity is Severity.CAUTION and warning.code in STEPS_OF_WARNINGS and is_due:
            name = STEPS_OF_WARNINGS[warning.code]
            if name == "stable" and solution.is_directed:  # no card of the law has the direction
                name = "fibres"
            elif name == "stable" and falls(model.experiment):
                name = "peak"
            elif name == "stable" and not all(of_mode.probability for of_mode in ranges.values()):
                name = "law"
            return _with_options(STEPS[name], warning, warnings)
    if not solution.is_of_data:
        return STEPS["export"]
    if solution.is_directed:
        return STEPS["fibres"]
    if reporting is not Verdict.YES:
        if SPREAD in uses[0].reason:
            return STEPS["unnamed specimens" if may_be_of_one_specimen(model.experiment) else "specimens"]
        is_law_wrong = model.material.is_isotropic and shares_of_discrepancy(solution)[0][0] > PRECISE
        return STEPS["law" if is_law_wrong else "design"]
    if predicting is not Verdict.YES and len(model.experiment.modes) == 1:
        return _with_targets(STEPS["second mode"], model.experiment, ranges)
    return STEPS["export" if simulating is not Verdict.NO else "design"]


def _with_targets(step: Step, experiment: Experiment, ranges: Mapping[str, StableRange]) -> Step:
    """Return a step that aims at the stress of every mode that was not measured, at the end of its strains."""
    measured = {mode.name for mode in experiment.modes}
    ends = {name: of.high if of.high > 1 else of.low for name, of in ranges.items() if name not in measured}
    targets = [f"{name}:{end:.3g}" for name, end in ends.items()]
    return Step(
        step.shell.replace("{targets}", "".join(f" --target {target}" for target in targets)),
        step.python.replace("{targets}", f"target={targets}" if targets else ""),
    )


def _with_options(step: Step, warning: ResultWarning, others: Sequence[ResultWarning] = ()) -> Step:
    """Return a step with the options that a warning proposes first, or without a command where it proposes none.

    Where another one proposes these and more, it has all of that. Where cycles may be specimens, only a person knows
    which of two things to do.
    """
    if "{options}" not in step.shell:
        return step
    if MAY_BE_SPECIMENS in warning:
        return step._replace(shell=step.python)
    proposed, *further = (OPTIONS.search(each.shell) for each in (warning, *others))
    if not proposed:
        return step._replace(shell=step.python)
    least = _single(proposed[0])
    fullest = max((found[0] for found in (proposed, *further) if found and _single(found[0]) >= least), key=len)
    return step._replace(shell=step.shell.replace("{options}", fullest))


def _single(options: str) -> set[str]:
    """Return the options of a text one by one."""
    return set(re.findall(OPTION, options))
