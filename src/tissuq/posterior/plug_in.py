"""Estimates of errors that are plugged in: each comes from further fits of the same data, which are counted."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment.stability import MIN_LOSS_PROBABILITY, stable_ranges
from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.inference.enumerators.noise_grid import at_level, at_noise, with_known_noise
from tissuq.inference.peak import highest, top_of_parabola
from tissuq.inference.solution import Solution
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.measurement_errors import MeanError, ScaleError, TestError
from tissuq.model.noise import AutoregressiveNoise, UnknownNoise
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.tolerances import BETWEEN_SPECIMENS, SPECIMEN, TISSUE, Tolerances, specimens_of
from tissuq.prediction.moments import level_of_errors, mean_curve_and_slopes

FACTORS = np.array([0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0])
"""Factors of the spreads between specimens and tests that are tried."""
MIN_PATH_COSINE = 0.999
"""Of the angle between the Hencky strains of tests that follow one path, tension or compression."""
CURVE_ITERATIONS = 3
"""Fits from which the mean curve and the level of the errors are found in turn."""
PILOT_NOISE_SHARE = 0.03
"""Noise over the root mean square stress of a test, at the least, of the fit from which its mean curve is."""
CURVE_COMPONENTS = 200
"""Components that stand for the posterior in the mean curve."""
LAG_GRID = (0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.92, 0.96, 0.98, 0.99)
"""Correlations of consecutive errors that are tried."""
MIN_POINTS_OF_CURVE = 12
"""Measurements of a curve from which it is seen whether consecutive errors are correlated."""
LONGEST_CORRELATION, LAG_COUNT = 0.1, 5
"""Correlation length of consecutive errors, over the points of a curve, beyond which an error is a smooth one of the
test; correlations up to it that are tried."""
MIN_LOG_EVIDENCE_GAIN = 3.0
"""Of autoregressive noise over independent one, from which it is taken."""
LEVEL_STEP, MAX_LEVEL_FACTOR, LEVEL_ACCURACY = 0.4, 20.0, 0.1
"""Of the search for the level at which noise is compared: first step of its logarithm; how far it may be from where
the search begins; accuracy of the log evidence there."""


class ErrorEstimates:
    """Makes the `FittedErrors` of one model.

    Parameters
    ----------
    solve : callable
        Returns the solution of a model.
    has_evidence : callable
        Returns whether a model is solved with its evidence, without sampling.
    sums_noise : callable
        Returns whether a model is solved as a sum over values of its noise.
    similar_solver : callable
        Returns a function that gives the solution of a model with known noise, roughly, and learns from one for the
        next.
    """

    def __init__(
        self,
        solve: Callable[[StatisticalModel], Solution],
        has_evidence: Callable[[StatisticalModel], bool],
        sums_noise: Callable[[StatisticalModel], bool],
        similar_solver: Callable[[], Callable[[StatisticalModel], Solution]],
    ) -> None:
        self._solve, self._has_evidence, self._sums_noise, self._fits = solve, has_evidence, sums_noise, 0
        self._similar_solver = similar_solver

    def of(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with every estimate that its errors need: curve and level, and lag."""
        with_curve = self._with_curve(model)
        with_lag = self._with_lag(with_curve)
        if with_lag is not with_curve and model.tolerances:
            with_lag = self._with_curve(with_lag.with_errors(curve=None))
        return with_lag.with_errors(fits=model.fitted_errors.fits + self._fits) if self._fits else with_lag

    def with_spreads_of_tests(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model whose spreads of the stress, between specimens and tests, are as large as several tests tell.

        Tests along one path tell a factor of the stated spreads: those of one specimen that between its tests alone,
        because they share what it differs by from others (its area, too). Those along different paths do not: an energy
        reconciles them whatever they differ by, and what it cannot (a direction of the tissue) is no spread. Where such
        an energy is hardly ever stable, the tests contradict each other: energies of I1 alone are then fitted, with the
        spread of such tests.
        """
        has_several = len(model.experiment.tests) > 1
        if not (has_several and (model.tolerances.stress or model.tolerances.test) and self._has_evidence(model)):
            return model
        simpler, have_one_path = model.discrepancy.of_contradictory_tests, _have_one_path(model)
        if simpler is None and not have_one_path:
            return model
        model = self._with_curve(model)
        sums_noise, level = self._sums_noise(model), None
        if sums_noise or simpler is not None:
            solution = self._solution(_sketch(model))
            level = solution.model.fitted_errors.level if sums_noise else None
        if simpler is not None:
            ranges = stable_ranges(solution).values()
            probability = min((of_mode.probability for of_mode in ranges), default=1.0)
            if probability < MIN_LOSS_PROBABILITY:
                model = _of_contradictory_tests(model, simpler).with_errors(reconciling_stability=probability)
                return model.with_errors(fits=self._fits)
        if have_one_path:
            for names in _spreads_that_are_told(model.experiment):
                model = self._with_factor(model, level, names)
        return model.with_errors(fits=self._fits)

    def with_probable_noise(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model whose unknown noise is autoregressive where the data are far more probable so.

        Only beside an energy discrepancy: without one, what looks like correlated errors is that of the material.
        Compared are few energies, each noise at the level that suits it best. A longer correlation than a share of the
        curve is not tried: such errors are the smooth ones of the test. Nor is any where noise is smaller than the
        independent errors that are assumed beside it (the resolution of the load cell): a lag then corrects those. The
        log evidence is concave, nearly, in the coordinate in which the lags are evenly spaced: the search ends where
        the gain can no longer be reached.
        """
        fewest = min(map(len, model.experiment.curves))
        is_open = type(model.noise) is UnknownNoise and bool(model.energy_symbols) and self._sums_noise(model)
        if not is_open or fewest < MIN_POINTS_OF_CURVE:
            return model
        model = self._with_curve(model)
        autoregressive = replace(_sketch(model), noise=AutoregressiveNoise())
        longest = np.exp(-1 / (LONGEST_CORRELATION * fewest))
        lags, evidences = np.linspace(0, np.arctanh(longest), LAG_COUNT), list[float]()
        level, solve = model.fitted_errors.level or model.noise_of_tests[1], self._similar_solver()
        for lag in np.tanh(lags):
            level, evidence = self._best_level(autoregressive.with_errors(lag=float(lag)), level, solve)
            step = evidence - evidences[-1] if evidences else np.inf
            evidences.append(evidence)
            at_most = evidence + (LAG_COUNT - len(evidences)) * (step + 2 * LEVEL_ACCURACY)
            is_assumed = len(evidences) == 1 and level < _assumed_level(model)
            if step < 0 or at_most < evidences[0] + MIN_LOG_EVIDENCE_GAIN or is_assumed:
                break
        fits = model.fitted_errors.fits + self._fits
        if max(evidences) < evidences[0] + MIN_LOG_EVIDENCE_GAIN:
            return model.with_errors(fits=fits)
        lag = float(np.tanh(_peak(lags[: len(evidences)], np.array(evidences))))
        return replace(model, noise=autoregressive.noise).with_errors(lag=lag, fits=fits)

    def _best_level(
        self, model: StatisticalModel, level: float, solve: Callable[[StatisticalModel], Solution]
    ) -> tuple[float, float]:
        """Return the level of the noise with the largest log evidence, searched from another one, and that.

        The levels that are tried count as one fit.
        """
        self._fits += 1

        def log_evidence(log_level: float) -> float:
            return _evidence_of(solve(at_noise(model, float(np.exp(log_level)))), model)

        reach = float(np.log(MAX_LEVEL_FACTOR))
        log_level, largest = highest(log_evidence, float(np.log(level)), LEVEL_STEP, reach, LEVEL_ACCURACY)
        return float(np.exp(log_level)), largest

    def _with_factor(self, model: StatisticalModel, level: float | None, names: Collection[str]) -> StatisticalModel:
        """Return a model with spreads times the factor that its tests tell, at a level of errors if noise needs it.

        The factor is the root of its posterior mean square over a grid, under a prior of mean square one, half
        Student's t with three degrees of freedom; at the noise that is likely without it.
        """
        stated, sketch = model.tolerances, _sketch(model)
        candidates = [replace(sketch, tolerances=stated.with_factor(float(factor), names)) for factor in FACTORS]
        if level is not None:
            candidates = [at_level(candidate.with_errors(level=level)) for candidate in candidates]
        evidences = [self._solution(candidate).log_evidence for candidate in candidates]
        if any(evidence is None for evidence in evidences):
            return model
        log_evidence = np.array(evidences, dtype=np.float64)
        weight = np.exp(log_evidence - log_evidence.max()) * FACTORS / (1 + FACTORS**2) ** 2  # even in the logarithm
        factor = float(np.sqrt(weight @ FACTORS**2 / weight.sum()))
        model = replace(model, tolerances=stated.with_factor(factor, names))
        return model.with_errors(factor=factor) if TestError.name in names else model

    def _with_lag(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with consecutive noise at the lag under which the data are most probable.

        Which has one peak: lags are tried from the middle of the grid upwards, as long as it rises. Where the noise is
        summed over, each lag is compared at the level that suits it best.
        """
        if not model.noise.is_consecutive or model.fitted_errors.lag is not None:
            return model
        level, solve = model.fitted_errors.level or model.noise_of_tests[1], self._similar_solver()

        def log_evidence_at(lag: float) -> float:
            lagged = model.with_errors(lag=lag)
            if self._sums_noise(model):
                return self._best_level(lagged, level, solve)[1]
            return _evidence_of(self._solution(lagged), lagged)

        best, evidences = len(LAG_GRID) // 2, dict[int, float]()
        while new := {best - 1, best, best + 1} & set(range(len(LAG_GRID))) - evidences.keys():
            evidences |= {index: log_evidence_at(LAG_GRID[index]) for index in sorted(new)}
            best = max(evidences, key=lambda index: evidences[index])
        indices = sorted(evidences)
        lags, log_evidence = np.arctanh(LAG_GRID)[indices], np.array([evidences[index] for index in indices])
        return model.with_errors(lag=float(np.tanh(_peak(lags, log_evidence))))

    def _with_curve(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with tolerances along its own mean curve, and at its own level of errors.

        As they are found first as if there were no tolerances, and then with these.
        """
        if not model.tolerances or model.fitted_errors.curve is not None:
            return model
        if self._sums_noise(model):
            curve, slopes = _curve_of(self._solution(_pilot(model)), model)
            residual = float(np.sqrt(((model.experiment.measured - curve) ** 2).mean()))
            return model.with_errors(curve=curve, slopes=slopes, level=residual)
        pilot = replace(model, tolerances=Tolerances())
        for _ in range(CURVE_ITERATIONS):
            solution = self._solution(pilot)
            curve, slopes = _curve_of(solution, model)
            pilot = model.with_errors(curve=curve, slopes=slopes, level=level_of_errors(solution))
        return pilot

    def _solution(self, model: StatisticalModel) -> Solution:
        self._fits += 1
        return self._solve(model)


def _evidence_of(solution: Solution, model: StatisticalModel) -> float:
    """Return the log evidence of a solution, by which noises of a model are compared."""
    if solution.log_evidence is None:
        raise ModelError(
            f"noise '{model.noise}' needs the evidence, which this fit does not have: choose proper priors, "
            "and a discrepancy and a method that give it, such as 'auto'."
        )
    return solution.log_evidence


def _spreads_that_are_told(experiment: Experiment) -> Sequence[tuple[str, ...]]:
    """Return the errors whose sizes tests along one path tell, those together that they cannot tell apart."""
    tests, specimens = specimens_of(experiment).shape
    if specimens == tests:
        return [(ScaleError.name, TestError.name)]
    return [(TestError.name,), (ScaleError.name,)][: min(specimens, 2)]


def _peak(points: FloatArray, values: FloatArray) -> float:
    """Return where a function is largest: at an end of points (n,), or on the parabola through the best three."""
    best = int(np.argmax(values))
    if best in (0, len(values) - 1):
        return float(points[best])
    neighbours = slice(best - 1, best + 2)
    return top_of_parabola(points[neighbours].tolist(), values[neighbours].tolist())[0]


def _sketch(model: StatisticalModel) -> StatisticalModel:
    """Return a model with the few energies that stand for its discrepancy in estimates."""
    return replace(model, discrepancy=model.discrepancy.sketch)


def _of_contradictory_tests(model: StatisticalModel, simpler: Discrepancy) -> StatisticalModel:
    """Return a model of tests that contradict each other, with a simpler discrepancy and more spread between tests."""
    symbols = {symbol for symbol in model.symbols if symbol not in model.energy_symbols}
    symbols |= {parameter.symbol for parameter in simpler.parameters}
    priors = {symbol: prior for symbol, prior in model.chosen_priors.items() if symbol in symbols}
    tolerances = model.tolerances.of_contradictory_tests(model.experiment)
    return replace(model, discrepancy=simpler, tolerances=tolerances, chosen_priors=priors)


def _pilot(model: StatisticalModel) -> StatisticalModel:
    """Return a model without errors of whole tests, of known noise: what these add to it at the least.

    So that its mean curve is the smooth one of the material, and does not follow those errors.
    """
    tests = model.experiment.tests
    size = np.array([np.sqrt((test.measured**2).mean()) for test in tests])
    noise_sd = np.hypot(model.noise.of_tests(model.experiment), PILOT_NOISE_SHARE * size)
    return with_known_noise(replace(_sketch(model), tolerances=Tolerances()), noise_sd)


def _curve_of(solution: Solution, model: StatisticalModel) -> tuple[FloatArray, FloatArray | None]:
    """Return the mean curve of a solution of the same data as a model, and its slopes where its errors need them."""
    return mean_curve_and_slopes(solution, CURVE_COMPONENTS, with_slopes=model.tolerances.need_slope)


def _assumed_level(model: StatisticalModel) -> float:
    """Return the root mean square of the independent errors that tolerances assume, MPa; zero where they do not."""
    tests = model.fitted_errors.points_of(model.experiment)
    variances = [model.tolerances.noise(points) ** 2 for points in tests]
    return float(np.sqrt(np.concatenate(variances).mean())) if variances else 0.0


def default_tolerances(model: StatisticalModel) -> Tolerances:
    """Return the tolerances of a model for which the user gives none.

    Those of the specimen, or where tests are of several, of the tissue. None where something else takes up errors of
    the test (a discrepancy with errors of its own, noise that is more than one number or, without a discrepancy,
    correlated), and of one test with known noise. Errors that the measurements themselves show are included at least as
    large.
    """
    if model.is_correlated or model.noise.depends_on_level or model.noise.shares_discrepancy:
        return Tolerances()
    discrepancy = model.discrepancy
    is_misfit_noise = model.noise.is_consecutive and not model.energy_symbols
    takes_up_errors = is_misfit_noise or discrepancy.is_scattered or not discrepancy.is_energy
    if specimens_of(model.experiment).shape[1] > 1:
        return (BETWEEN_SPECIMENS if takes_up_errors else Tolerances(TISSUE)).at_least(model.experiment.least_errors)
    is_known = len(model.experiment.tests) == 1 and not model.noise.parameters
    tolerances = Tolerances() if is_known or takes_up_errors else Tolerances(SPECIMEN)
    return tolerances.at_least(model.experiment.least_errors)


def with_standard_errors(model: StatisticalModel, tolerances: Tolerances) -> Tolerances:
    """Return tolerances, the default ones or those of an estimand, with the standard errors that the data state.

    The same where there are none, the noise is known or more than one number, or a discrepancy takes up such errors.
    """
    is_open = _has_standard_errors(model, tolerances) and _takes_standard_errors(model)
    return tolerances.with_sizes(**{MeanError.name: 1.0}) if is_open else tolerances


def leaves_standard_errors_out(model: StatisticalModel) -> bool:
    """Return whether standard errors of the data are left out because they do not go with noise or discrepancy."""
    return _has_standard_errors(model, model.tolerances) and not _takes_standard_errors(model)


def _has_standard_errors(model: StatisticalModel, tolerances: Tolerances) -> bool:
    """Return whether the data state standard errors of means, and nobody another size of these."""
    return bool(model.experiment.standard_error.any()) and MeanError.name not in tolerances.stated


def _takes_standard_errors(model: StatisticalModel) -> bool:
    """Return whether standard errors of means go with the noise and the discrepancy of a model."""
    return len(model.noise.parameters) == 1 and not (model.is_correlated or model.noise.shares_discrepancy)


def _have_one_path(model: StatisticalModel) -> bool:
    """Return whether all tests follow one path of the material from the reference, or its opposite."""
    farthest = []
    for test in model.experiment.tests:
        mode = test.mode.along_axis_1 if model.material.is_isotropic else test.mode
        logs = np.concatenate([path.at(test.stretch).log_stretches[0] for path in mode.paths])
        sizes = np.linalg.norm(logs, axis=1)
        farthest.append(logs[sizes.argmax()] / sizes.max())
    return bool((np.abs(np.array(farthest) @ farthest[0]) > MIN_PATH_COSINE).all())
