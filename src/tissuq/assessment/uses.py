"""For what a result can be used: reporting the modulus, predicting tests and other modes, finite elements."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.assessment.modulus import modulus_symbols
from tissuq.assessment.shares import shares_of_discrepancy
from tissuq.assessment.stability import StableRange
from tissuq.errors import TissuqError
from tissuq.experiments.curve import Curve
from tissuq.experiments.experiment import Experiment
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Solution
from tissuq.model.tolerances import AS_TESTED, TISSUE
from tissuq.prediction.bands import Band, predict_band
from tissuq.result_warning import ResultWarning, Severity, symbols_in

PRECISE, USEFUL = 0.2, 0.5
"""Half widths of 95 % intervals, over the mean, up to which a number is precise, and of use."""
MIN_INSIDE = 0.9
"""Share of the measurements inside their 95 % bands below which these do not describe the test."""
MIN_STABLE, MIN_OFTEN_STABLE = 0.95, 0.5
"""Probabilities of stability over the measured range above which simulations rarely fail, and often succeed."""
CORRELATED, CORRELATED_ERRORS = "correlated-residuals", "the errors of consecutive measurements are correlated"
"""Code of the warning that intervals are too narrow, and why."""
UNKNOWN = 3.0
"""Half width over the mean from which not even a sign or a power of ten is known."""
COMPUTING = "compute with a new specimen"
"""What cards, predictions and simulations of a new specimen of a population are for."""
NORMAL_HALF_WIDTH, SET_BY_COMMON_ERROR = 1.96, 0.7
"""Half width of a normal 95 % interval over its sd, and the share of a half width that sets it."""
SPREAD = "assumed spread between specimens"
SKEW = 1.25
"""Ratio of the parts of an interval above and below the mean up to which one number stands for both."""
MAX_ASIDE = 0.05
"""Distance of measured strains from one proportion, over the largest strain, up to which they are in it."""
GRID_POINTS = 9
"""Stretches at which the width of a band is looked at."""


class Verdict(StrEnum):
    """Whether a result can be used for something, from the best to the worst."""

    YES = "yes"
    CARE = "with care"
    NO = "no"


class Use(NamedTuple):
    """For what a result can be used, or not, and why."""

    purpose: str
    verdict: Verdict
    reason: str


def uses_of(
    solution: Solution,
    stiffness: Marginal,
    ranges: Mapping[str, StableRange],
    warnings: Sequence[ResultWarning],
    inside: BoolArray,
) -> tuple[Use, ...]:
    """Return for what a posterior with this initial shear modulus can be used; the others as in `answer_of`."""
    codes = {w.code for w in warnings if w.code != "measurements" or w.severity is not Severity.NOTE}
    counts = f"{inside.sum()} of {len(inside)} {solution.model.experiment.rows_name} inside the band"
    missed = f"only {counts}" if inside.sum() < MIN_INSIDE * len(inside) else ""
    own_tests = _own_tests(solution, codes, counts, missed)
    other_modes = _other_modes(solution, ranges, codes, own_tests, missed)
    return (
        Use("report the modulus", *_reporting(solution, stiffness, codes, warnings, missed)),
        Use("predict these tests", *own_tests),
        Use("predict other loading modes", *other_modes),
        Use("simulate with finite elements", *_simulating(solution, ranges, other_modes, codes)),
    )


def may_be_of_one_specimen(experiment: Experiment) -> bool:
    """Whether there are several tests, and not all say of which specimen they are."""
    return len(experiment.tests) > 1 and not all(test.specimen for test in experiment.tests)


def _reporting(
    solution: Solution,
    stiffness: Marginal,
    codes: Collection[str],
    warnings: Sequence[ResultWarning],
    missed: str,
) -> tuple[Verdict, str]:
    """Return whether the modulus can be reported."""
    symbols = modulus_symbols(solution.model)
    is_cut = not set(symbols_in(warnings, "prior-bound")).isdisjoint(symbols)
    reasons_against = {
        "sampling has not converged": "not-converged" in codes,
        "what was read of the file is doubtful, as the warning says": "doubtful-reading" in codes,
        "there is stress at rest, so that it may be off by far more than its interval": "stress-at-rest" in codes,
        "the load drifts during the test, so that it may be off by far more than its interval": "large-drift" in codes,
        "a bound of its prior, not the data, determines it": is_cut,
        "the tests contradict each other, so that it may be that of none of them": "tests-apart" in codes,
        "the fitted curve departs from the measured one, and the interval does not include that": (
            "unmodelled-curve" in codes
        ),
        "the discrepancy aims at the best fit, not at the modulus": "best-fit-target" in codes,
    }
    for reason, applies in reasons_against.items():
        if applies:
            return Verdict.NO, reason
    carried = abs(shares_of_discrepancy(solution)[1][0])
    low, high = stiffness.hdi()
    half_width = (high - low) / 2 / abs(stiffness.mean)
    verdict, width = precision_of(half_width)
    if half_width <= 1:
        width = f"known to {_ends_in_words(*((end - stiffness.mean) / abs(stiffness.mean) for end in (low, high)))}"
    if carried > PRECISE:
        of_stiffness = f"{100 * carried:.0f} % of the initial stiffness"
        return Verdict.NO, f"the discrepancy carries {of_stiffness}, by which it may be off"
    if not solution.model.discrepancy.parameters:
        return worst_of(verdict, Verdict.CARE), f"{width}, if the material is right: its errors are not included"
    if "contradicting-tests" in codes:
        return worst_of(verdict, Verdict.CARE), f"{width}, but the tests contradict each other"
    if "prior-dominates" in codes:
        return worst_of(verdict, Verdict.CARE), f"{width}, by the prior that was given as much as by the data, or more"
    if "sharp-prior" in codes:
        return worst_of(verdict, Verdict.CARE), f"{width}, or better: the prior that was given tells more than is in it"
    if "not-near-reference" in codes:
        return worst_of(verdict, Verdict.CARE), f"{width}, extrapolated to rest, beside which too little was measured"
    if missed:
        return worst_of(verdict, Verdict.CARE), f"{width}, but {missed}"
    if CORRELATED in codes:
        return worst_of(verdict, Verdict.CARE), f"{width}, or less well: {CORRELATED_ERRORS}"
    if "measurements" in codes:
        return worst_of(verdict, Verdict.CARE), f"{width}; see the warning about the measurements"
    model = solution.model
    of_common_error = model.common_error * NORMAL_HALF_WIDTH / half_width
    if of_common_error > SET_BY_COMMON_ERROR:
        names = " and ".join(f"'{error.name}'" for error, _ in model.tolerances if error.name in ("stress", "test"))
        error = f"assumed error of load and area (tolerance {names}, {100 * model.common_error:.0f} %)"
        unnamed = " (each test without the name of one counts as a specimen)"
        spread = SPREAD + unnamed * may_be_of_one_specimen(model.experiment)
        common = spread if model.tolerances.estimand == TISSUE else error
        share = _number(100 * min(1.0, of_common_error**2))
        return verdict, f"{width}, {share} % of its variance due to the {common}"
    return verdict, width + ", errors of the test not included" * (model.tolerances.estimand == AS_TESTED)


def precision_of(half_width: float) -> tuple[Verdict, str]:
    """Return a verdict on the half width of an interval over its middle, and the width in words."""
    verdict = Verdict.YES if half_width <= PRECISE else Verdict.CARE if half_width <= USEFUL else Verdict.NO
    return verdict, f"known to {_percent(half_width)}" if half_width <= UNKNOWN else _percent(half_width)


def _percent(half_width: float) -> str:
    if not half_width <= 1:
        return "no better than ± 100 %" if half_width <= UNKNOWN else "not known at all"
    return f"± {_number(100 * half_width)} %"


def _number(percentage: float) -> str:
    return f"{percentage:.0f}" if percentage >= 10 else f"{max(percentage, 0.1):.2g}"


def _ends_in_words(low: float, high: float) -> str:
    """Return the ends of an interval from the mean, over the mean: as one number where they are about the same."""
    if max(-low, high) <= SKEW * min(-low, high):
        return _percent((high - low) / 2)
    low_end, high_end = (_number(100 * abs(end)) for end in (low, high))
    return f"within −{low_end} % and +{high_end} %"


def worst_of(*verdicts: Verdict) -> Verdict:
    """Return the worst of some verdicts."""
    return max(verdicts, key=list(Verdict).index)


def _own_tests(solution: Solution, codes: Collection[str], counts: str, missed: str) -> tuple[Verdict, str]:
    """Return whether the measured tests are described, over the range in which they were measured."""
    if not solution.is_of_data:
        return Verdict.NO, "no test was measured of what this posterior describes"
    try:
        widths = [relative_half_width(_band_of(solution, curve)) for curve in solution.model.experiment.curves]
    except TissuqError as error:
        return Verdict.NO, str(error)
    verdict, width = precision_of(max(widths))
    if missed:
        return Verdict.NO, missed
    names = [curve.name for curve in solution.model.experiment.curves]
    worst_test = f", worst in '{names[int(np.argmax(widths))]}'" if max(widths) > SKEW * min(widths) else ""
    of_what = "of another such test " if solution.model.tolerances.estimand == TISSUE else ""
    where = " on average where it was measured" if max(widths) <= UNKNOWN else ""
    sentence = f"stress {of_what}{width}{where}{worst_test}; {counts}"
    for code, reason in (("unmodelled-curve", "the fitted curve departs from the measured one"),
                         ("stress-at-rest", "there is stress at rest, where the material has none"),
                         ("large-drift", "the load drifts during the test"),
                         ("tests-apart", "the tests contradict each other"),
                         ("contradicting-tests", "the tests contradict each other"),
                         (CORRELATED, CORRELATED_ERRORS),
                         ("measurements", "see the warning about the measurements")):  # fmt: skip
        if code in codes:
            return worst_of(verdict, Verdict.CARE), f"{sentence}, but {reason}"
    return verdict, sentence


def _band_of(solution: Solution, curve: Curve) -> Band:
    """Return the band of the stress itself at measured points that span a curve."""
    order = np.argsort(curve.abscissa, kind="stable")
    rows = order[np.linspace(0, len(order) - 1, min(GRID_POINTS, len(order))).astype(int)]
    return predict_band(solution, curve.points[rows], noise=False, curve=curve)


def relative_half_width(band: Band) -> float:
    """Return the root mean square of half the width of a band over that of its median."""
    size = float(np.sqrt(np.mean(band.median**2)))
    return float(np.sqrt(np.mean((band.high - band.low) ** 2))) / 2 / size if size else np.inf


def _other_modes(
    solution: Solution,
    ranges: Mapping[str, StableRange],
    codes: Collection[str],
    own_tests: tuple[Verdict, str],
    missed: str,
) -> tuple[Verdict, str]:
    """Return whether loading modes that were not measured can be predicted, within the measured invariants."""
    model = solution.model
    measured = {mode.name for mode in model.experiment.modes}
    if not model.discrepancy.is_energy and model.discrepancy.parameters:
        return Verdict.NO, f"the discrepancy '{model.discrepancy.name}' belongs to the stress of the measured test"
    if "unmodelled-curve" in codes:
        return Verdict.NO, "the material alone does not follow the measured curve"
    if "inseparable-parameters" in codes:
        return Verdict.NO, "the measured tests do not tell all parameters, as the warning says"
    if missed:
        return Verdict.NO, f"not even the measured tests are described: {missed}"
    unmeasured = {name: stable_range for name, stable_range in ranges.items() if name not in measured}
    if not unmeasured:
        if not ranges:
            return Verdict.CARE, "not looked at for this material"
        return own_tests[0], "uniaxial, equibiaxial and planar stress were measured, so that the line above holds"
    try:
        widths = {
            name: [
                relative_half_width(predict_band(solution, stretch, noise=False, mode=name))
                for stretch in _compression_and_tension(stable_range)
            ]
            for name, stable_range in unmeasured.items()
        }
    except TissuqError as error:
        return Verdict.NO, str(error)
    verdict = worst_of(*(precision_of(width)[0] for of_mode in widths.values() for width in of_mode))
    is_same = measured == {"uniaxial"} and _differ(widths.get("equibiaxial", [0.0]))
    explained = " (the strains of uniaxial tension)" if is_same else ""
    of_modes = ", ".join(
        f"{name} stress {_signed_percents(of_mode)}{explained if name == 'equibiaxial' else ''}"
        for name, of_mode in widths.items()
    )
    origin = "measured" if solution.is_of_data else "stated"
    sentence = f"within the strains that were {origin}: {of_modes}"
    if {"tests-apart", "contradicting-tests"} & {*codes}:
        return worst_of(verdict, Verdict.CARE), f"{sentence}; but the tests contradict each other"
    if solution.is_of_data and (path := _only_path(model.experiment)):
        return worst_of(verdict, Verdict.CARE), f"{sentence}; {path}"
    return verdict, sentence


def _only_path(experiment: Experiment) -> str:
    """Return in words that all was measured along one path from rest, and its opposite; empty where it was not."""
    if len(experiment.modes) > 1:
        return ""
    if len(experiment.modes[0].controls) == 1:
        return "only one mode was measured"
    strain = experiment.states.log_stretches[0]
    size = np.linalg.norm(strain, axis=1)
    farthest = strain[size.argmax()]
    aside = strain - np.outer(strain @ farthest, farthest) / size.max() ** 2
    is_path = np.linalg.norm(aside, axis=1).max() <= MAX_ASIDE * size.max()
    return "the strains of both axes were measured in one proportion alone" if is_path else ""


def _compression_and_tension(stable_range: StableRange) -> list[FloatArray]:
    """Return stretches over a range, those below 1 apart from those above it where it has both."""
    low, high = stable_range.low, stable_range.high
    ends = [(low, 1.0), (1.0, high)] if low < 1 < high else [(low, high)]
    return [np.linspace(*pair, GRID_POINTS) for pair in ends]


def _differ(widths: Sequence[float]) -> bool:
    """Return whether half widths of compression and tension are to be said apart."""
    return max(widths) > SKEW * min(widths) and len(set(map(_percent, widths))) > 1


def _signed_percents(widths: Sequence[float]) -> str:
    """Return half widths in words: that of the range, or those of compression and tension where they differ."""
    if not _differ(widths):
        return _percent(max(widths))
    texts = list(map(_percent, widths))
    return f"{texts[1]} in tension and {texts[0]} in compression"


def _simulating(
    solution: Solution,
    ranges: Mapping[str, StableRange],
    other_modes: tuple[Verdict, str],
    codes: Collection[str],
) -> tuple[Verdict, str]:
    """Return whether draws of material and discrepancy serve finite elements."""
    model = solution.model
    if not model.discrepancy.is_energy:
        return Verdict.NO, f"the discrepancy '{model.discrepancy.name}' is an error of the stress and no material"
    if solution.is_directed:
        return Verdict.NO, (
            "the tissue has a preferred direction, which cards of this law have not; fit a law with fibres "
            "(tissuq materials)"
        )
    if "unmodelled-curve" in codes:
        return Verdict.NO, "the fitted curve departs from the measured one"
    if not model.material.is_isotropic and model.energy_symbols:
        if len(set(model.experiment.states.paths)) == 1:
            return (
                Verdict.NO,
                "one stress was measured, and neither fibres nor the free energy beside them follow from it",
            )
        return Verdict.CARE, "fibres beside a free energy have cards in FEBio alone, and need axes in the model"
    if not model.material.is_isotropic:
        return Verdict.CARE, "fibres have cards where a code has their law, and need axes in the model"
    if not ranges:
        return Verdict.CARE, "whether it is stable cannot be computed for this material"
    worst = min(ranges.values(), key=lambda stable_range: stable_range.probability)
    origin = "measured" if solution.is_of_data else "stated"
    share = f"{100 * worst.probability:.0f} % of the draws are stable within the {origin} strains"
    if worst.probability < MIN_STABLE:
        share += f", least in {worst.mode} loading"
    if worst.probability < MIN_OFTEN_STABLE:
        return Verdict.NO, share
    if other_modes[0] is Verdict.NO:
        also = "" if worst.probability >= MIN_STABLE else f"; {share}"
        return Verdict.NO, f"the stress in other loading modes is not known well enough{also}"
    stable = Verdict.YES if worst.probability >= MIN_STABLE else Verdict.CARE
    if stable is Verdict.YES and other_modes[0] is Verdict.CARE:
        return Verdict.CARE, f"as uncertain as the stress in other loading modes; {share}"
    return worst_of(stable, other_modes[0]), f"{share}; what leaves the {origin} strains is extrapolated"
