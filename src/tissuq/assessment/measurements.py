"""Warnings about the measurements of a test, with advice for the next ones, and the factors between several tests."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.experiment import Experiment, labels_of_tests
from tissuq.experiments.modes.mode import SHEAR
from tissuq.inference.solution import Solution
from tissuq.prediction.moments import mean_curve
from tissuq.result_warning import ResultWarning, Severity

MIN_MEASUREMENTS = 12
"""Smallest number of measurements that describe how the stress deviates from the material."""
NEAR_STRAIN_SHARE = 0.15
"""Share of the largest strain within which a measurement is near the reference."""

MIN_CHANGE, MIN_ERRORS = 0.2, 4.0
"""Change of the ratio of two tests' stresses along them, over its middle, that is told, and its standard errors."""

MAX_RATIO, MIN_IN_COMMON = 3.0, 5
"""Ratio of the stresses of tests that were loaded alike from which it is told, 2.5 standard deviations (0.42) of the
logarithm of that of moduli of a tissue in two tests; measurements, at the least, where both were loaded alike."""

MEASUREMENTS_OF_MEAN, MIN_FALL = 3, 0.05
"""Consecutive measurements whose mean is compared, and by what share of the largest mean a stress falls to the end."""


def falls(experiment: Experiment) -> bool:
    """Return whether a stress that was measured on the way out falls before the largest stretch, by more than noise."""
    for curve in experiment.curves:
        stress = curve.stress[~curve.is_back][np.argsort(curve.abscissa[~curve.is_back], kind="stable")]
        if len(stress) >= MEASUREMENTS_OF_MEAN:
            means = np.convolve(stress, np.full(MEASUREMENTS_OF_MEAN, 1 / MEASUREMENTS_OF_MEAN), mode="valid")
            if means.max() - means[-1] > MIN_FALL * np.abs(means).max():
                return True
    return False


def measurement_warnings(experiment: Experiment) -> Iterator[ResultWarning]:
    """Yield what was implausible when tests were read, and each gap in what was measured, with what to measure next."""
    yield from experiment.warnings
    strain = np.concatenate([curve.abscissa - curve.mode.controls[0].reference for curve in experiment.curves])
    reach = float(np.abs(strain).max())
    has_directions = len(experiment.modes) == 1 and experiment.modes[0].controls[0] != SHEAR
    if has_directions and not ((strain > 1e-9).any() and (strain < -1e-9).any()):
        measured, missing = ("tension", "compression") if (strain > 0).any() else ("compression", "tension")
        yield ResultWarning(
            f"there is {measured} only, which leaves the initial modulus about twice as uncertain as both directions: "
            f"measure in {missing}, too, if the specimen allows it.",
            "one-direction",
            Severity.NOTE,
        )
    is_near = (np.abs(strain) <= NEAR_STRAIN_SHARE * reach) & (strain != 0)
    if not is_near.any():
        control = experiment.curves[0].mode.controls[0]
        nearest = control.reference + strain[np.abs(strain) > 0][np.abs(strain[np.abs(strain) > 0]).argmin()]
        yield ResultWarning(
            f"nothing is measured between {control.name} {control.reference:g} and {nearest:.4g}, so the initial "
            f"modulus is extrapolated: measure within {NEAR_STRAIN_SHARE * reach:.2g} of {control.name} "
            f"{control.reference:g}, beside it.",
            "not-near-reference",
        )
    if not experiment.shows_direction and any(test.shows_direction for test in experiment.tests):
        yield ResultWarning(
            "a preferred direction is looked for only where every test measured the stresses of both axes: fit those "
            "that did by themselves to see one.",
            "no-direction-looked-for",
            Severity.NOTE,
        )
    yield from _differing_tests(experiment)
    if experiment.size < MIN_MEASUREMENTS:
        yield ResultWarning(
            f"{experiment.size} measurements are too few to show how the stress deviates from the material: "
            f"measure at {MIN_MEASUREMENTS} stretches or more.",
            "few-measurements",
        )


def _differing_tests(experiment: Experiment) -> Iterator[ResultWarning]:
    """Yield a warning about two tests that were loaded alike, whose stresses are in another ratio at either end.

    An error of load or area is one factor along a test. Of tests that are taken for those of two specimens it is a
    note.
    """
    labelled = list(zip(labels_of_tests(experiment.tests), experiment.tests, strict=True))
    differing = []
    for (name, one), (other_name, other) in combinations(labelled, 2):
        is_one = bool(one.specimen) and one.specimen == other.specimen
        if (is_one or len(labelled) == 2) and (ratios := _changing_ratio(one, other)):
            differing.append((abs(ratios[1] - ratios[0]), is_one, f"of '{name}' over that of '{other_name}'", ratios))
    if not differing:
        return
    _, is_one, of_which, (at_rest, at_reach, reach) = max(differing)
    control = experiment.curves[0].mode.controls[0].name
    words = f"the stress {of_which} is {at_rest:.2g} near rest and {at_reach:.2g} at {control} {reach:.3g}"
    if is_one:
        yield ResultWarning(
            f"two tests of one specimen contradict each other: {words}, which is no error of load or area. No "
            "isotropic material gives both: see whether direction, speed or state of the specimen differed, and fit "
            "each by itself.",
            "contradicting-tests",
        )
    else:
        yield ResultWarning(
            f"{words}. It is taken for a difference between two specimens: if it is one between two directions or "
            "states of one material, no isotropic material gives both, so fit each by itself.",
            severity=Severity.NOTE,
        )


def _changing_ratio(one: Experiment, other: Experiment) -> tuple[float, float, float] | None:
    """Return the ratio of the stresses of two tests at rest, at the reach of both, and this; None where it is the same.

    It is taken to be linear in the strain, by least squares at the points of the first test.
    """
    if (common := _common(one, other, MIN_MEASUREMENTS)) is None:
        return None
    share, stress, other_stress, end = common
    columns = other_stress[:, None] * np.column_stack([np.ones(len(share)), share])
    weights, squares, rank, _ = np.linalg.lstsq(columns, stress, rcond=None)
    if rank < 2 or weights[0] <= 0 or weights.sum() <= 0:
        return None
    variance = float(squares[0]) / (len(stress) - 2) * np.linalg.inv(columns.T @ columns)[1, 1]
    change, middle = abs(float(weights[1])), float(weights[0] + weights[1] / 2)
    if change < MIN_CHANGE * middle or change < MIN_ERRORS * np.sqrt(variance):
        return None
    return float(weights[0]), float(weights.sum()), end


def _common(one: Experiment, other: Experiment, fewest: int) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Return what two tests have in common that were loaded alike; None of fewer measurements of the first.

    Returns
    -------
    Shares (k,) of the way to the end of the shorter one at points of the first, the stresses of both there, and the
    value of the control at that end.
    """
    if one.mode != other.mode or len(one.curves) + len(other.curves) > 2 or len(one.mode.controls) > 1:
        return None
    reference = one.mode.controls[0].reference
    strain, other_strain = (test.curves[0].abscissa - reference for test in (one, other))
    sign = 1.0 if strain.max() > -strain.min() else -1.0
    reach = min(float((sign * strain).max()), float((sign * other_strain).max()))
    order, is_common = np.argsort(other_strain, kind="stable"), (sign * strain > 0) & (sign * strain <= reach)
    if is_common.sum() < fewest:
        return None
    other_stress = np.interp(strain[is_common], other_strain[order], other.curves[0].stress[order])
    share = sign * strain[is_common] / reach
    return share, one.curves[0].stress[is_common], other_stress, reference + sign * reach


def stresses_apart(experiment: Experiment) -> str:
    """Return in words that a test has another stress than the median of those that were loaded alike; or nothing.

    Of many specimens of a tissue the softest and the stiffest may well differ by more than two do.
    """
    names, tests = labels_of_tests(experiment.tests), experiment.tests
    ratios: list[dict[int, float]] = [{} for _ in tests]
    for (number, test), (compared_number, compared) in combinations(enumerate(tests), 2):
        if ratio := _ratio(test, compared):
            ratios[number][compared_number], ratios[compared_number][number] = ratio, 1 / ratio
    medians = {number: float(np.median([*of_test.values()])) for number, of_test in enumerate(ratios) if of_test}
    farthest = max(medians, key=lambda number: abs(np.log(medians[number])), default=None)
    if farthest is None or abs(np.log(medians[farthest])) <= np.log(MAX_RATIO):
        return ""
    compared_numbers = [*ratios[farthest]]
    alike = f"the median of {len(compared_numbers)} other tests"
    if len(compared_numbers) == 1:
        alike = f"that of '{names[compared_numbers[0]]}'"
    return (
        f"the tests contradict each other: the stress of '{names[farthest]}' is {medians[farthest]:.2g} times {alike} "
        "where they were loaded alike. "
    )


def _ratio(test: Experiment, compared: Experiment) -> float | None:
    """Return the ratio of the stresses of two tests that were loaded alike; None where little is in common.

    Scatter makes least squares of one on the other too small, and the other way round too large: of what is between,
    that which is nearest to one.
    """
    if common := _common(test, compared, MIN_IN_COMMON):
        _, stress, compared_stress, _ = common
    elif common := _common(compared, test, MIN_IN_COMMON):
        _, compared_stress, stress, _ = common
    else:
        return None
    product = float(stress @ compared_stress)
    if product <= 0:
        return None
    return float(np.clip(1.0, product / float(compared_stress @ compared_stress), float(stress @ stress) / product))


def factors_of_tests(solution: Solution) -> dict[str, float]:
    """Return the factor of the stress of every test over that of the common material, by the tests' names.

    Tests of the same name are numbered. The factors are posterior means, relative to the mean of all specimens, which
    the data do not determine. There are none where tests have no stress error of their own, or autocorrelated errors.
    """
    model = solution.model
    whitening, tests = model.whitening, model.experiment.tests
    has_spread = len(tests) > 1 and bool(model.tolerances.stress or model.tolerances.test)
    if whitening is None or not has_spread or not len(whitening.spread) or model.fitted_errors.lag:
        return {}
    curve = mean_curve(solution)
    residual = model.experiment.measured - curve
    noise = whitening.size**2 * whitening.transposed(whitening(residual))
    ends = np.cumsum([test.size for test in tests])[:-1]
    pairs = zip(np.split(residual - noise, ends), np.split(curve, ends), strict=True)
    return {
        label: 1 + float(error @ test_curve / (test_curve @ test_curve))
        for label, (error, test_curve) in zip(labels_of_tests(tests), pairs, strict=True)
    }
