"""Posterior predictive distributions of the stress: mixtures of Gaussians at every stretch, and their bands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.curve import Curve
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Solution
from tissuq.inference.threads import one_thread
from tissuq.mechanics.equilibrium import why_no_equilibrium
from tissuq.model.compatibility import check_lateral_stretch
from tissuq.model.measurement_errors import ErrorPoints
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.checks import check_probability, check_switches
from tissuq.prediction.moments import variance_of_noise
from tissuq.prediction.stress import Stress

STRESS_TYPES = ("engineering", "cauchy")
"""What stresses are predicted as."""
MAX_PAIRS, MIN_COMPONENTS = 5_000_000, 200
"""Number of pairs of Gaussians, over all points, of a score; number to which a mixture is thinned at the most."""
SMOOTHING = 0.01
"""Standard deviation of a Gaussian in a quantile, at the least, over its mean or the spread of all."""
COMPONENTS_OF_SKETCH = 300
"""Gaussians that stand for a mixture where the search for its quantiles begins."""
MAX_STANDARD_SCORE = 30.0
"""Standard scores beyond which the tail of a Gaussian is nothing."""


@dataclass(frozen=True, eq=False)
class Mixtures:
    """Mixtures of M Gaussians at g places, their weights the same at all of them.

    Attributes
    ----------
    weights : (M,) array
        Non-negative, sum one.
    means : (M, g) array
    variances : (M, g) array
    """

    weights: FloatArray
    means: FloatArray
    variances: FloatArray

    @property
    def mean(self) -> FloatArray:
        """The mean (g,) at every place."""
        return np.asarray(self.weights @ self.means)

    def quantile(self, probability: float) -> FloatArray:
        """Return the quantile (g,) at every place, by safeguarded Newton iteration."""
        from scipy.special import ndtr, ndtri

        mean, centre = self.means, self.mean
        spread = np.sqrt(self.weights @ (self.variances + (mean - centre) ** 2))
        smoothing = SMOOTHING * np.minimum(spread, np.abs(mean))
        sd = np.sqrt(np.maximum(self.variances, smoothing**2))
        sd = np.maximum(sd, 1e-300)
        low, high = (mean - 10 * sd).min(axis=0), (mean + 10 * sd).max(axis=0)
        begin = centre + ndtri(probability) * spread
        if len(self.weights) > 2 * COMPONENTS_OF_SKETCH:
            begin = self._thinned(COMPONENTS_OF_SKETCH).quantile(probability)
        value = quantile = np.clip(begin, low, high)
        indices = np.arange(len(value))
        for _ in range(60):
            scores = (value - mean) / sd
            excess = self.weights @ ndtr(scores) - probability
            quantile[indices] = value
            is_open = np.abs(excess) >= 1e-9
            if not is_open.any():
                break
            if not is_open.all():
                indices, value, low, high, excess = (a[is_open] for a in (indices, value, low, high, excess))
                mean, sd, scores = (a[:, is_open] for a in (mean, sd, scores))
            low, high = np.where(excess < 0, value, low), np.where(excess < 0, high, value)
            with np.errstate(over="ignore"):
                density = self.weights @ (np.exp(-0.5 * scores**2) / sd) / np.sqrt(2 * np.pi)
            step = value - excess / np.maximum(density, 1e-300)
            value = np.where(
                (step >= low) & (step <= high), step, 0.5 * (low + high)
            )  # at an end where it has converged
        return np.where(spread == 0, centre, quantile)

    def crps(self, values: FloatArray) -> FloatArray:
        """Return the continuous ranked probability score (g,) of a value at every place, in its unit; small is good.

        The integral of (F(x) - [y <= x])^2, which is E|X - y| - E|X - X'| / 2 with X and X' independent of F. A
        difference of Gaussians is Gaussian, and E|N(m, v)| = m (2 Phi(m / s) - 1) + 2 s phi(m / s) with s^2 = v, so
        that the score of a mixture is a sum over its Gaussians less one over their pairs. Where places are many,
        few Gaussians stand for all.

        References
        ----------
        Grimit, Gneiting, Berrocal & Johnson (2006), Quarterly Journal of the Royal Meteorological Society 132,
        2925-2942 (mixtures); Gneiting & Raftery (2007), Journal of the American Statistical Association 102, 359-378.
        """
        thinned = self._thinned(max(MIN_COMPONENTS, int(np.sqrt(2 * MAX_PAIRS / len(values)))))
        i, j = np.triu_indices(len(thinned.weights), 1)
        pairs, squares = thinned.weights[i] * thinned.weights[j], thinned.weights**2
        scores = thinned.weights @ _mean_distance(thinned.means - values, thinned.variances)
        for index, (mean, variance) in enumerate(zip(thinned.means.T, thinned.variances.T, strict=True)):
            distance = pairs @ _mean_distance(mean[i] - mean[j], variance[i] + variance[j])
            scores[index] -= distance + squares @ np.sqrt(variance / np.pi)  # one Gaussian: E|X - X'| = 2 s / sqrt(pi)
        return np.asarray(scores)

    def _thinned(self, count: int) -> Mixtures:
        if len(self.weights) <= count:
            return self
        selected = systematic(self.weights[None], count)[0]
        return Mixtures(np.full(count, 1 / count), self.means[selected], self.variances[selected])


def _mean_distance(mean: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the mean distance from zero of Gaussians."""
    from scipy.special import erf

    sd = np.maximum(np.sqrt(variance), 1e-300)
    scores = np.clip(mean / sd / np.sqrt(2), -MAX_STANDARD_SCORE, MAX_STANDARD_SCORE)
    return np.asarray(mean * erf(scores) + sd * np.sqrt(2 / np.pi) * np.exp(-(scores**2)))


STRETCHES_OF_BLOCK = 2000
"""Stretches predicted at once: what bounds the memory."""
COMPONENTS_OF_BLOCK, DRAWS_OF_BLOCK, COMPONENTS_OF_MANY_BLOCKS = 1500, 4000, 200
"""Components that stand for the posterior at a block of stretches, draws that stand for that of a sampler, which are in
no order, and components at more blocks."""


@dataclass(frozen=True, eq=False)
class Band:
    """Median and central interval of the stress (MPa) at stretches, all of shape (g,)."""

    stretch: FloatArray
    median: FloatArray
    low: FloatArray
    high: FloatArray

    def at(self, rows: Any) -> Band:
        """Return it at some of the stretches: their numbers, a slice, or whether it is each."""
        return Band(*(values[rows] for values in vars(self).values()))


def predict_band(
    solution: Solution,
    stretch: ArrayLike,
    *,
    discrepancy: bool = True,
    noise: bool = True,
    prob: float = 0.95,
    mode: str | LoadingMode | None = None,
    channel: int = 0,
    curve: Curve | None = None,
) -> Band:
    """Return the median of the stress and the interval that holds ``prob`` of it, at each stretch.

    Parameters
    ----------
    solution : Solution
        The posterior.
    stretch : (g,) array, dimensionless
        Where to predict.
    discrepancy : bool
        With the discrepancy's share (eq. 27), or the model alone (eq. 28).
    noise : bool
        For a new measurement, or for the stress itself.
    prob : float
        Probability between the ends, equal tails.
    mode : str or LoadingMode, optional
        Another loading mode than that of the data.
    channel : int
        Which of the mode's stresses, from 0, where it has several.
    curve : Curve, optional
        One of those that were measured, in place of mode and channel. Tests of one mode may differ in their noise, and
        in a discrepancy that is of the stress; unless one is given, the noise is the geometric mean of that of the
        tests of the mode, or of all where none is of it, and the discrepancy that of the first of them.

    Raises
    ------
    InputError
        When a stretch is not positive, prob is not between 0 and 1, or the discrepancy says nothing about the mode.
    """
    options: dict[str, Any] = {"discrepancy": discrepancy, "prob": prob, "mode": mode, "channel": channel}
    return predict_bands([(1.0, solution)], stretch, (noise,), **options, curve=curve)[0]


def predict_bands(
    weighted_solutions: Sequence[tuple[float, Solution]],
    stretch: ArrayLike,
    noises: Sequence[bool],
    *,
    discrepancy: bool = True,
    prob: float = 0.95,
    mode: str | LoadingMode | None = None,
    channel: int = 0,
    curve: Curve | None = None,
    errs_beyond: bool = True,
) -> list[Band]:
    """Return bands of a mixture of posteriors of the same data, with weights that sum to one.

    They are for new measurements, for the stress itself, or for both at once; without the errors of the energy beyond
    the range of the data, if asked for. All else is as for `predict_band`.
    """
    solutions = [solution for _, solution in weighted_solutions]
    for noise in noises:
        check_switches(noise=noise)
    if curve is not None:
        mode, channel = curve.mode, curve.channel
    loading, points = asked_for(solutions, stretch, discrepancy=discrepancy, prob=prob, mode=mode, channel=channel)
    probabilities = centre_and_ends(prob)
    with one_thread():
        blocks = predictive_mixtures(
            weighted_solutions,
            points,
            loading,
            channel,
            discrepancy=discrepancy,
            noises=noises,
            curve=curve,
            errs_beyond=errs_beyond,
        )
        curves = [[(*map(mixture.quantile, probabilities),) for mixture in mixtures] for mixtures in blocks]
    abscissa = loading.paths[channel].abscissa(points)
    return [Band(abscissa, *np.concatenate(of_noise, axis=1)) for of_noise in zip(*curves, strict=True)]


def extrapolation_share(band: Band, without_errors: Band) -> FloatArray:
    """Return the share (g,) of a stress's variance that is due to errors of extrapolation.

    One less the squared ratio of the widths of a band without these errors and with them, as variances may not exist:
    the errors have the tails of Student's t with two degrees of freedom (`tissuq.mechanics.rays`).

    Examples
    --------
    >>> at, ends = np.ones(2), np.array([2.0, 1.0])
    >>> extrapolation_share(Band(at, 0 * at, -ends, ends), Band(at, 0 * at, -at, at))
    array([0.75, 0.  ])
    """
    wide, narrow = band.high - band.low, without_errors.high - without_errors.low
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(wide > narrow, 1 - (narrow / wide) ** 2, 0.0)


def centre_and_ends(prob: float) -> tuple[float, float, float]:
    """Return the probabilities below the median and the ends of a central interval."""
    return 0.5, 0.5 * (1 - prob), 0.5 * (1 + prob)


def predictive_mixtures(
    weighted_solutions: Sequence[tuple[float, Solution]],
    points: FloatArray,
    mode: LoadingMode,
    channel: int,
    *,
    discrepancy: bool,
    noises: Sequence[bool],
    curve: Curve | None = None,
    errs_beyond: bool = True,
) -> Iterator[list[Mixtures]]:
    """Yield the predictive distributions of a stress, with noise or without, at points of a mode, some at a time.

    They are those of a new test, or of a measured ``curve``, as `predict_band` says.
    """
    mixture = []
    for weight, solution in weighted_solutions:
        count = COMPONENTS_OF_BLOCK if solution.sampled is None else DRAWS_OF_BLOCK
        thinned = solution.thinned(COMPONENTS_OF_MANY_BLOCKS if len(points) > STRETCHES_OF_BLOCK else count).merged()
        mixture.append((solution.model, thinned.weighted(weight * thinned.weights)))
    for block in np.array_split(points, max(1, len(points) // STRETCHES_OF_BLOCK)):
        moments = [
            _moments(Stress(model, components, discrepancy, errs_beyond), block, mode, channel, curve, noises=noises)
            for model, components in mixture
        ]
        weights, mean, *variances = (np.concatenate(arrays) for arrays in zip(*moments, strict=True))
        yield [Mixtures(weights, mean, variance) for variance in variances]


def asked_for(
    solutions: Sequence[Solution],
    stretch: ArrayLike,
    *,
    discrepancy: bool,
    prob: float,
    mode: str | LoadingMode | None,
    channel: int,
) -> tuple[LoadingMode, FloatArray]:
    """Return the mode and the points (g,) or (g, c) of a prediction that posteriors of the same data can make.

    Raises
    ------
    InputError, ModelError
        When they cannot.
    """
    loading = loading_mode(mode) if mode is not None else _only_mode(solutions[0].model.experiment)
    points = checked_points(loading, np.atleast_1d(stretch))
    check_probability(prob)
    check_switches(discrepancy=discrepancy)
    if channel not in range(len(loading.stresses)):
        raise InputError(f"mode '{loading.name}' has the stresses {', '.join(loading.stresses)}: no number {channel}.")
    for solution in solutions:
        if problem := why_no_equilibrium(solution.model.material, loading.paths[channel].moved(points[:1], 0.0)):
            raise ModelError(problem)
    for solution in solutions if discrepancy else ():
        _check_mode(solution, loading)
        states, model = loading.paths[channel].at(points[:1]), solution.model
        check_lateral_stretch(model.material, model.discrepancy, states, f"mode '{loading.name}'")
    return loading, points


def speaks_of(model: StatisticalModel, mode: LoadingMode) -> bool:
    """Return whether a model's discrepancy says something about the stress in a mode: it is an energy, or of that."""
    return model.discrepancy.is_energy or mode in model.experiment.modes


def stress_ratio(stress_type: str, mode: str | LoadingMode, channel: int) -> Callable[[FloatArray], FloatArray]:
    """Return the function of points that gives a stress of that type over the engineering stress.

    Raises
    ------
    InputError
        When there is no such type.
    """
    if stress_type not in STRESS_TYPES:
        raise InputError(f"stress_type must be one of {', '.join(STRESS_TYPES)}, not '{stress_type}'.")
    if stress_type == "engineering":
        return lambda points: np.ones(len(points))
    return loading_mode(mode).paths[channel].cauchy_ratio


def inside_band(solution: Solution, curve: Curve, *, discrepancy: bool, prob: float = 0.95) -> BoolArray:
    """Return which measurements (n,) of a curve are inside the predictive band at their own stretches.

    The ends of the band at condensed measurements are interpolated between the points of these.
    """
    model = solution.model
    points = curve.points if model.condensed is None else model.condensed.points
    points, rows = np.unique(points, axis=0, return_inverse=True)
    band = predict_band(solution, points, discrepancy=discrepancy, prob=prob, curve=curve)
    low, high = model.at_measurements(np.column_stack([band.low, band.high])[rows.ravel()]).T
    return np.asarray((low <= curve.stress) & (curve.stress <= high))


def _moments(
    stress: Stress,
    points: FloatArray,
    mode: LoadingMode,
    channel: int,
    curve: Curve | None,
    *,
    noises: Sequence[bool],
) -> tuple[FloatArray, ...]:
    """Return weights (M,) and means (M, g) of a stress at points of a mode and its variances, with noise or without.

    With noise they are those of a new test with its own errors.
    """
    model = stress.model
    data = model.experiment
    states = data.states_at(points, mode, channel) if curve is None else data.states_of(curve, points)
    components, mean, of_stress = stress.at(states)
    of_stress = of_stress + (model.common_error * mean) ** 2
    if not any(noises):
        return components.weights, mean, *(of_stress for _ in noises)
    relative = model.noise_of_new_test(mode) if curve is None else model.relative_noise(states)
    of_measurements = of_stress + variance_of_noise(model, components, relative, mean)
    if model.tolerances:
        slope = stress.slopes(states, mean) if model.tolerances.need_slope else 0.0
        largest = float(np.abs(model.experiment.measured).max())  # as the band is one at each point by itself
        error_points = ErrorPoints(mode, points, mean, slope, largest)
        of_measurements = of_measurements + model.tolerances.variance(error_points)
    return components.weights, mean, *(of_measurements if noise else of_stress for noise in noises)


def _only_mode(experiment: Experiment) -> LoadingMode:
    if len(experiment.modes) > 1:
        names = ", ".join(mode.name for mode in experiment.modes)
        raise InputError(f"the tests were made in several modes ({names}): say which one to predict, by mode=.")
    return experiment.modes[0]


def _check_mode(solution: Solution, loading: LoadingMode) -> None:
    model = solution.model
    if not speaks_of(model, loading):
        names = ", ".join(mode.name for mode in model.experiment.modes)
        raise InputError(
            f"discrepancy '{model.discrepancy.name}' is an error of the {names} "
            f"stress and says nothing about the {loading.name} one: predict without it, or fit with one that is an "
            "energy, such as 'auto'."
        )
