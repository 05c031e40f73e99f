"""Warnings that a posterior carries: what to know before using it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import ceil, isfinite, log

import numpy as np
from scipy.special import bdtr

from tissuq.arrays import BoolArray, FloatArray
from tissuq.assessment.extent import has_energy
from tissuq.assessment.measurements import falls, stresses_apart
from tissuq.assessment.modulus import modulus, modulus_symbols
from tissuq.assessment.separability import inseparable_parameters
from tissuq.assessment.stability import MIN_LOSS_PROBABILITY, StableRange
from tissuq.experiments.experiment import labels_of_tests
from tissuq.inference.solution import Solution
from tissuq.model.error_model import widening_of_lag
from tissuq.model.measurement_errors import ScaleError, TestError
from tissuq.model.noise import KnownNoise
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.tolerances import ESTIMANDS
from tissuq.posterior.plug_in import leaves_standard_errors_out
from tissuq.posterior.prior_warnings import cut_by_prior, influence_of_priors, is_sharp, sharp_prior
from tissuq.prediction.moments import level_of_errors, mean_curve
from tissuq.result_warning import ResultWarning, Severity

PRIOR_BOUND_REACHED = "the posterior is truncated by a prior bound"
"""Start of the warning about a posterior that a bound of a prior cuts off."""

MIN_VARIANCE_SHARE = 0.1
"""Share of the joint variance below which noise or discrepancy may vanish (at the 5 % quantiles of the draws)."""
MAX_LOG_EVIDENCE_ERROR = 0.3
"""Error of the log evidence, by integration, above which a quarter of the posterior may be missing, and intervals with
it. Comparisons by evidence warn of smaller ones where these decide."""
MAX_RELATIVE_WIDTH = 1.0
"""Width of the headline parameter's 95 % interval, over its median, above which it is poorly determined."""
MIN_STABLE_PROBABILITY = 0.5
"""Probability of stability over the measured range below which a simulation is likely to fail."""


MAX_COMPONENTS, MAX_ARRAY_VALUES = 200, 4_000_000
"""Posterior components that the residuals are averaged over; array values (components x measurements) for them."""
MIN_MEASUREMENTS = 12
"""Number of measurements from which a correlation of residuals is estimated."""
MIN_LAG1_CORRELATION, MIN_STANDARD_ERRORS = 0.3, 4.0
"""Lag-1 correlation of residuals that is reported, and by how many standard errors (1 / sqrt(n)) it must exceed 0."""
MAX_LEFT_CORRELATION = 0.2
"""Correlation of errors that is left where a fit with fewer points is advised."""


MAX_SDS_APART = 2.5
"""Standard deviations of the assumed spread of two tests that the log of the ratio of their stresses may be off."""
MAX_FACTOR_OF_TESTS = 2.0
"""Of the usual spread between tests of a specimen, that which they tell may be so many times as large."""
MAX_PROBABILITY_OF_MISSES = 1e-3
"""Probability that so few measurements are inside their 95 % bands, were these right, below which they are not."""


def warnings_about(solution: Solution, ranges: Mapping[str, StableRange], inside: BoolArray) -> Iterator[ResultWarning]:
    """Yield the warnings that a posterior carries.

    Parameters
    ----------
    solution : Solution
    ranges : mapping of str to StableRange
        Stable range by loading mode.
    inside : (n,) array of bool
        Which measurements are inside their 95 % predictive bands.
    """
    if solution.is_approximate and solution.diagnostics is not None:
        yield ResultWarning(solution.diagnostics.verdict, "not-converged", Severity.PROBLEM)
    if contradiction := solution.model.fitted_errors.contradiction:
        yield ResultWarning(contradiction, "contradicting-tests")
    if directions := _directions_of_one_fibre(solution.model):
        yield ResultWarning(
            f"the tests are along several directions of the tissue ({directions}), while fibres lie at one angle from "
            "axis 1 of every test: these directions are taken for one, so that the parameters are of none. Say which "
            "tests were along axis 2: {mode}, with the mode of every test.",
            "contradicting-tests",
            Severity.PROBLEM,
            mode="uniaxial@2",
        )
    if solution.model.material.is_isotropic and solution.model.experiment.is_along_both_axes:
        yield ResultWarning(
            "tests along axis 1 and along axis 2 of the tissue are taken for those of one isotropic material. One with "
            "fibres is fitted with {material} and {discrepancy}.",
            severity=Severity.NOTE,
            material="holzapfel-gasser-ogden",
            discrepancy="gp-pinned",
        )
    if ranges and min(stable_range.probability for stable_range in ranges.values()) < MIN_STABLE_PROBABILITY:
        yield _instability(solution, min(ranges.values(), key=lambda stable_range: stable_range.probability))
    if not solution.is_of_data:
        return
    if large := _large_noise(solution.model):
        yield large
    if solution.stable_share < MIN_LOSS_PROBABILITY:
        yield ResultWarning(
            "the data contradict the stability constraint (stable_in): without it, only a fraction of "
            f"{solution.stable_share:.1g} of the posterior is stable. The constrained posterior describes the data "
            "less well.",
            "stability-contradicted",
        )
    if leaves_standard_errors_out(solution.model):
        yield ResultWarning(
            "the standard errors of the means that the data state are not in the intervals: fit with {noise} and "
            "{discrepancy}, which include them.",
            "standard-errors-left-out",
            noise="unknown",
            discrepancy="auto",
        )
    if solution.model.discrepancy.is_best_fit:
        yield ResultWarning(solution.model.discrepancy.caution, "best-fit-target")
    if _is_sum_of_variances(solution.model):
        yield ResultWarning(
            "noise_sd and S are both unknown, but the data determine only noise_sd^2 + S^2: do not interpret either "
            "one alone, or give the noise (repeated measurements at one stretch determine it: {noise}).",
            "inseparable-noise",
            Severity.NOTE,
            noise="repeats",
        )
    elif _noise_is_inseparable(solution):
        yield ResultWarning(
            "the data cannot separate noise from discrepancy: the larger one is, the smaller the other. Do not "
            "interpret either one alone, or give the noise (repeated measurements at one stretch determine it).",
            "inseparable-noise",
            Severity.NOTE,
        )
    if together := inseparable_parameters(solution):
        yield ResultWarning(
            f"the tests do not tell {' and '.join(together)}{' apart' if len(together) > 1 else ''}: other values give "
            "the same stresses, so that their intervals are those of their priors, and only what was measured may be "
            "predicted. Measure in another mode or direction, or give what is known of them by priors (of fibres the "
            "angle, as in exponential-fibres@30).",
            "inseparable-parameters",
            symbols=[*together],
        )
    error = solution.log_evidence_error
    if error is not None and not error <= MAX_LOG_EVIDENCE_ERROR and solution.diagnostics is None:
        size = f"about {error:.1g}" if isfinite(error) else "unknown"
        remedy = (
            "Give priors that hold less of what the data exclude"
            + ("." if has_energy(solution.model) else ", or sample (--method nuts, in Python method='nuts').")
            if solution.model.noise.parameters
            else "This happens when the given noise is far smaller than the scatter of the data: give a larger noise, "
            "or leave it unknown."
        )
        yield ResultWarning(
            f"numerical integration is inaccurate (error of the log evidence: {size}), and so are intervals. {remedy}",
            "inaccurate-integral",
        )
    cut = list(cut_by_prior(solution))
    lag1, held = _lag1_correlation(solution), int(inside.sum())
    if between_tests := _tests_apart(solution):
        yield ResultWarning(between_tests, "tests-apart")
    elif lag1 is not None:
        yield _correlated_residuals(solution.model, lag1)
    elif not cut and bdtr(held, len(inside), 0.95) < MAX_PROBABILITY_OF_MISSES:
        yield _missed_measurements(solution.model, f"{held} of {len(inside)}")
    if words := influence_of_priors(solution):
        yield ResultWarning(words, "prior-dominates")
    if sharp := [symbol for symbol in modulus_symbols(solution.model) if is_sharp(solution, symbol)]:
        yield sharp_prior(solution.model, sharp)
    headline = solution.model.headline
    low, high = solution.marginals[headline].hdi()
    if high - low > MAX_RELATIVE_WIDTH * abs(float(solution.marginals[headline].quantile(0.5))):
        simpler = ", or fit a law with fewer parameters" if len(solution.model.material_symbols) > 1 else ""
        yield ResultWarning(
            f"the data determine {headline} poorly: its 95 % interval is wider than its median. Unless another warning "
            f"says why, measure more points, nearer to rest, or with less noise{simpler}.",
            "poorly-determined",
        )
    if cut:
        yield ResultWarning(
            f"{PRIOR_BOUND_REACHED} of {', '.join(f'{symbol} ({end})' for symbol, end in cut)}: there the bound, not "
            "the data, determines the result. Give a wider prior, unless the bound is intended.",
            "prior-bound",
            symbols=[symbol for symbol, _ in cut],
        )


def _large_noise(model: StatisticalModel) -> ResultWarning | None:
    """Return the warning about known noise that no measurement of a test stands out of, as of another unit."""
    if not isinstance(model.noise, KnownNoise):
        return None
    unit = model.experiment.shown_unit
    for test, sd in zip(model.experiment.tests, model.noise.of_tests(model.experiment) / unit.to_mpa, strict=True):
        largest = float(np.abs(test.measured).max()) / unit.to_mpa
        if sd > largest:
            return ResultWarning(
                f"the noise that was given, {sd:.3g} {unit.name}, is larger than the largest stress, {largest:.3g} "
                f"{unit.name}, so that the measurements tell nothing. Give it in the right unit, or leave it unknown "
                "({noise_sd}).",
                "large-noise",
                Severity.PROBLEM,
                noise_sd="unknown",
            )
    return None


def _instability(solution: Solution, stable_range: StableRange) -> ResultWarning:
    """Return the warning for a material that is rarely stable, in the loading mode in which it is least stable."""
    what = "material and discrepancy together are" if has_energy(solution.model) else "the material is"
    share = f"stable in only {100 * stable_range.probability:.0f} % of the draws"
    how = "rarely stable" if stable_range.probability < MIN_LOSS_PROBABILITY else share
    at_rest = " (already at rest)" if stable_range.loss.median == 1 else ""
    if at_rest and modulus(solution).mean < 0:
        at_rest = " (already at rest: the initial shear modulus is negative)"
    finding = f"over the measured range {what} {how}{at_rest}. Do not use these parameters in a simulation: "
    if falls(solution.model.experiment):
        return ResultWarning(
            finding + "leave out where the measured stress falls, which no stable material does ({until_peak}).",
            "unstable",
            until_peak=True,
        )
    return ResultWarning(
        finding + "measure in more loading modes, choose another material, or restrict the fit to stable materials "
        "({stable_in}).",
        "unstable",
        stable_in="all",
    )


def _correlated_residuals(model: StatisticalModel, lag1: float) -> ResultWarning:
    """Return the warning about residuals that are not independent, and what is likely to cure it."""
    finding = f"residuals are autocorrelated (lag-1 correlation {lag1:.2f})"
    if not model.energy_symbols:
        return ResultWarning(
            "the fitted curve departs systematically from the measured one, and the intervals do not include that: "
            f"{finding}. Fit with {{discrepancy}}.",
            "unmodelled-curve",
            discrepancy=_describing_discrepancy(model),
        )
    text = f"{finding}: the errors of consecutive measurements are not independent, and the intervals are too narrow. "
    if any(curve.is_back.any() for curve in model.experiment.curves):
        return ResultWarning(text + "Fit one branch of the cycle ({branch}).", "correlated-residuals", branch="loading")
    every = _every_uncorrelated(lag1, min(len(curve) for curve in model.experiment.curves))
    every *= max(curve.averaged * curve.apart for curve in model.experiment.curves)
    if model.noise.is_consecutive:
        return ResultWarning(text + "Fit with fewer points ({every}).", "correlated-residuals", every=every)
    return ResultWarning(
        text + "Fit with {noise}, or with fewer points ({every}).",
        "correlated-residuals",
        noise="autoregressive",
        every=every,
    )


def _every_uncorrelated(lag1: float, points: int) -> int:
    """Return how many points apart errors are hardly correlated; at most so many that enough of a curve's are used."""
    apart = ceil(log(MAX_LEFT_CORRELATION) / log(min(lag1, 0.99)))
    return max(2, min(apart, points // MIN_MEASUREMENTS))


def _missed_measurements(model: StatisticalModel, counts: str) -> ResultWarning:
    """Return the warning about bands that do not hold the measurements, and what is likely to cure it."""
    text = f"only {counts} measurements are inside their 95 % bands, so that intervals are too narrow. "
    if len(model.experiment.tests) > 1 and model.noise.parameters:
        return ResultWarning(
            text + "See which of the tests departs from the others, and fit it by itself.", "unmodelled-curve"
        )
    if not model.noise.parameters and (model.energy_symbols or not model.material.is_isotropic):
        return ResultWarning(
            text + "Give a larger noise, or leave it unknown ({noise_sd}).", "unmodelled-curve", noise_sd="unknown"
        )
    if model.energy_symbols:
        return ResultWarning(text + "See where they depart from the curve.", "unmodelled-curve")
    return ResultWarning(
        text + "Fit with {discrepancy}.", "unmodelled-curve", discrepancy=_describing_discrepancy(model)
    )


def _describing_discrepancy(model: StatisticalModel) -> str:
    """Return the discrepancy that describes what the law does not, where one may be fitted to these tests."""
    return "gp-pinned" if model.derived_parameters else "auto"


def _directions_of_one_fibre(model: StatisticalModel) -> str:
    """Return directions of tests with one stress along one axis, where they are several and the material has fibres."""
    curves = [curve for curve in model.experiment.curves if len(curve.mode.stresses) == 1 and curve.direction]
    along_1, along_2 = (
        dict.fromkeys(curve.direction for curve in curves if (curve.mode.along_axis_1 == curve.mode) == is_first)
        for is_first in (True, False)
    )
    directions = max(along_1, along_2, key=len)
    return "" if model.material.is_isotropic or len(directions) < 2 else ", ".join(directions)


def _is_sum_of_variances(model: StatisticalModel) -> bool:
    """Return whether only the sum of noise and discrepancy variance is in the data, whatever they are."""
    is_one_level = not model.noise.depends_on_level and not model.noise.shares_discrepancy
    return bool(model.noise.parameters) and is_one_level and model.discrepancy.is_scattered


def _noise_is_inseparable(solution: Solution) -> bool:
    """Return whether noise could be nearly all or nearly none of the joint variance of noise and discrepancy."""
    model = solution.model
    is_free = any(parameter.symbol in model.nonlinear for parameter in model.discrepancy.parameters)
    if not model.noise.parameters or not is_free:
        return False
    values = {symbol: drawn.ravel() for symbol, drawn in solution.draws.items()}
    noise = model.noise_variance(values, float(model.levels.mean()) if model.noise.depends_on_level else 0.0)
    discrepancy = model.discrepancy.independent_variance(values) + model.discrepancy.correlated_variance(values)
    low, high = np.quantile(noise / (noise + discrepancy), [0.05, 0.95])
    return bool(low < MIN_VARIANCE_SHARE and high > 1 - MIN_VARIANCE_SHARE)


def _mean_curve(solution: Solution) -> FloatArray:
    """Return the mean stress (n,) at the measurements, from so few components that memory suffices."""
    count = int(np.clip(MAX_ARRAY_VALUES // len(solution.model.states), 1, MAX_COMPONENTS))
    return mean_curve(solution, thinned=count)


def _lag1_correlation(solution: Solution) -> float | None:
    """Return the lag-1 correlation of the whitened residuals where it is significant and makes a difference, else None.

    It makes none where errors that are assumed (the resolution of the load cell) are so large that the residuals, as
    correlated as they are, tell no more than those.
    """
    model = solution.model
    if model.is_correlated or model.experiment.size < MIN_MEASUREMENTS:
        return None
    residual = np.asarray(model.white(model.experiment.measured - _mean_curve(solution)))
    curves = np.split(residual, np.cumsum([len(curve) for curve in model.experiment.curves])[:-1])
    size = sum(float(curve @ curve) for curve in curves)
    lag1 = sum(float(curve[1:] @ curve[:-1]) for curve in curves) / size if size else 0.0
    if lag1 <= max(MIN_LAG1_CORRELATION, MIN_STANDARD_ERRORS / np.sqrt(len(residual))):
        return None
    is_covered = np.sqrt(size / len(residual)) * widening_of_lag(lag1) < level_of_errors(solution)
    return None if is_covered else lag1


def _tests_apart(solution: Solution) -> str:
    """Return in words that tests are farther from the curve of one material than their spread allows; else nothing."""
    model, tests = solution.model, solution.model.experiment.tests
    advice = (
        "See whether units, areas, grips, friction, direction or the state of the specimens differed, and fit each by "
        "itself."
    )
    if words := stresses_apart(model.experiment):
        return words + advice
    tolerances, is_said = model.tolerances, bool(model.fitted_errors.contradiction)
    if len(tests) < 2 or not (tolerances.stress or tolerances.test) or not model.energy_symbols or is_said:
        return ""
    curves = np.split(_mean_curve(solution), np.cumsum([test.size for test in tests])[:-1])
    factors = [
        float(test.measured @ curve / (curve @ curve)) if curve.any() else 1.0
        for test, curve in zip(tests, curves, strict=True)
    ]
    lowest, highest = int(np.argmin(factors)), int(np.argmax(factors))
    is_one_specimen = bool(tests[lowest].specimen) and tests[lowest].specimen == tests[highest].specimen
    standard = ESTIMANDS[tolerances.estimand].sizes if tolerances.estimand else {}  # told ones may be as small as noise
    of_specimens, of_tests = (
        max(tolerances.sizes.get(name, 0.0), standard.get(name, 0.0)) for name in (ScaleError.name, TestError.name)
    )
    if is_one_specimen and standard:  # of one specimen, a larger spread is told by what the material cannot explain
        of_tests = min(of_tests, MAX_FACTOR_OF_TESTS * standard[TestError.name])
    spread = np.hypot(of_tests, 0.0 if is_one_specimen else of_specimens)
    if factors[lowest] > 0 and np.log(factors[highest] / factors[lowest]) <= MAX_SDS_APART * np.sqrt(2) * spread:
        return ""
    names = labels_of_tests(tests)
    return (
        f"the tests contradict each other: the stress of '{names[highest]}' is {factors[highest]:.2g} times that of "
        f"one material for all, and that of '{names[lowest]}' {factors[lowest]:.2g} times, farther apart than the "
        f"spread of {100 * spread:.0f} % that {'tests of a specimen may have' if is_one_specimen else 'is assumed'}. "
        f"The interval may hold neither. {advice}"
    )
