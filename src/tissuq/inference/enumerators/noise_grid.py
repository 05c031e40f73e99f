"""Unknown noise beside errors of whole tests: the sum over values of the noise, each of them taken as known.

The errors of whole tests have sizes of their own, which do not grow with the noise: the covariance of the data,
noise_sd^2 R + C C', has other directions at every noise_sd. So each value needs a factorisation, and is a fit with
known noise; the logarithm of noise_sd is nearly Gaussian, and few equally spaced values of it integrate it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyfit

from tissuq.arrays import FloatArray
from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.amplitudes import log_prior_of_log
from tissuq.inference.enumerators.line import OF_SUM, ROUGH, Accuracy
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import Marginal, blended, marginal_of_table
from tissuq.inference.solution import Marginals, Representation, Solution
from tissuq.model.noise import NOISE_SD, noise_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Flat, Prior

SYMBOL = NOISE_SD.symbol
END_FACTOR = 2.0
"""By which the noise may lie beyond the resolution of the tests and the noise of a fit without tolerances."""
MIN_NOISE_SHARE = 3e-4
"""Least noise over the largest stress, at first, where no resolution is stated."""
MAX_STEP, MIN_STEP = 1.1, 0.03
"""Between values of the logarithm of the noise."""
MAX_DROP = 1.5
"""Largest difference of the log density of consecutive values."""
NEGLIGIBLE_DROP, WIDENING_DROP = 6.5, 5.0
"""By how much the log density at the ends is to lie below the largest one, and does at the least."""
INTERVALS, MAX_NODE_STEP = 8, 0.4
"""Number of intervals of the sum, at the least, and their largest length in the logarithm of the noise."""
MAX_CHANGE = 0.1
"""Largest change of the log likelihood from the least value of the noise down to none."""
TAIL = 12.0
"""Length over which a density falls in proportion to the noise, where this is too small to matter."""
NEGLIGIBLE_SHARE = 1e-5
"""Share of the posterior, below which a value of the noise is left out."""
POSSIBLE_PROBABILITIES, TINY = (1e-9, 1 - 1e-9), 1e-300
"""Of the noise before the data, beyond which it is not sought; the smallest number of which there is a logarithm."""
MAX_VALUES = 40
"""Of the noise in one sum."""
MAX_COMPONENTS = 3000
"""Components, about, that represent the posterior."""
MIN_SPLINE = 4
"""Values from which a cubic spline goes through the log density, which is nearly a parabola."""
TABLE_POINTS, TAIL_POINTS = 801, 201
"""Of the marginal of the noise, between its values and beneath them."""
DENSITY_STEPS, DENSITY_STEP = 60, 0.2
"""In which the density at the values of the noise is found from their shares, and their length: what lies beyond an end
changes much with the density there."""
FACTORS_AT_ONCE, STEPS_BEYOND = 1000, 4
"""Factors taken together, which bounds the memory; steps beyond the values to which they reach."""


@dataclass(frozen=True)
class NoiseGrid:
    """Sums posteriors with known noise over values of the noise.

    Parameters
    ----------
    known_solver : callable
        Returns a function that gives the solution of a model with known noise, with its evidence; it may learn from one
        model for the next. The argument is the accuracy of the evidence.
    """

    known_solver: Callable[[Accuracy], Callable[[StatisticalModel], Solution]]

    @staticmethod
    def why_not(model: StatisticalModel) -> str:
        """Return why it does not serve a model; nothing where it does."""
        if not model.tolerances:
            return "there are no errors of whole tests beside the noise"
        if model.noise.parameters != (NOISE_SD,):
            return f"noise '{model.noise}' is not one unknown number"
        if model.discrepancy.is_scattered:
            return f"discrepancy '{model.discrepancy.name}' adds to the noise"
        flat = [symbol for symbol, prior in model.priors.items() if isinstance(prior, Flat)]
        return f"the flat prior of {flat[0]} gives no evidence" if flat else ""

    def solve(self, models: Sequence[StatisticalModel], seed: int = 0) -> list[Solution]:
        """Return the posteriors of models, whose fitted errors have the noise at which the sums begin."""
        return [self._sum(model, seed) for model in models]

    def _sum(self, model: StatisticalModel, seed: int) -> Solution:
        solutions: dict[float, Solution] = {}
        sketch = replace(model, discrepancy=model.discrepancy.sketch)
        (_, mean_sd), prior = model.noise_of_tests, model.priors[SYMBOL]

        def log_weight(
            fitted_model: StatisticalModel, solve_known: Callable[[StatisticalModel], Solution], log_noise: float
        ) -> float:
            """Return the logarithm of the posterior density of the logarithm of the noise, up to a constant."""
            noise_sd = np.exp(log_noise)
            solutions[log_noise] = solve_known(at_noise(fitted_model, noise_sd))
            log_evidence = solutions[log_noise].log_evidence
            if log_evidence is None:
                raise ConvergenceError("a fit with known noise has no evidence, which weighs values of the noise.")
            return log_evidence + float(log_prior_of_log(prior, noise_sd))

        largest = float(np.abs(model.experiment.measured).max())
        ends = _ends(prior)
        high = np.log(END_FACTOR * (model.fitted_errors.level or mean_sd))
        low = min(np.log((model.tolerances.resolution or MIN_NOISE_SHARE) * largest / END_FACTOR), high - MAX_STEP)
        low, high = (low, high) if ends[0] < high and low < ends[1] else ends
        initial = _spaced(max(float(low), ends[0]), min(float(high), ends[1]))
        refined = _refined(partial(log_weight, sketch, self.known_solver(ROUGH)), initial, prior)
        nodes = _nodes(*refined, prior)
        logs, log_weights = _widened(partial(log_weight, model, self.known_solver(OF_SUM)), nodes, prior)
        return _joined(model, [solutions[float(value)] for value in logs], logs, log_weights, seed)


def with_known_noise(model: StatisticalModel, noise_sd: FloatArray) -> StatisticalModel:
    """Return a model with the noise (tests,) of every test known."""
    sds = tuple(map(float, noise_sd))
    priors = {symbol: prior for symbol, prior in model.chosen_priors.items() if symbol != SYMBOL}
    errors = replace(model.fitted_errors, level=None)
    return replace(model, noise=noise_named(sds), chosen_priors=priors, fitted_errors=errors)


def at_noise(model: StatisticalModel, noise_sd: float) -> StatisticalModel:
    """Return a model with its noise known, that of every test in proportion to a common noise_sd."""
    of_tests, mean_sd = model.noise_of_tests
    return with_known_noise(model, noise_sd / mean_sd * of_tests)


def at_level(model: StatisticalModel) -> StatisticalModel:
    """Return a model that is summed over its noise with this known, at the level that was estimated; others as are."""
    if NoiseGrid.why_not(model) or not model.fitted_errors.level:
        return model
    return at_noise(model, model.fitted_errors.level)


def _ends(prior: Prior) -> tuple[float, float]:
    """Return the logarithms of the noise between which its prior leaves it."""
    low, high = prior.quantile(np.array(POSSIBLE_PROBABILITIES))
    return float(np.log(max(low, TINY))), float(np.log(high))


def _spaced(low: float, high: float) -> FloatArray:
    """Return values between two ends, no farther apart than the largest step."""
    return np.linspace(low, high, 2 + int((high - low) / MAX_STEP))


def _refined(function: Callable[[float], float], initial: FloatArray, prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Return values between which the log density is known, and its values; elsewhere it is negligible."""
    ends = _ends(prior)
    values = {float(log_noise): function(float(log_noise)) for log_noise in initial}
    while len(values) < MAX_VALUES:
        log_noises = np.array(sorted(values))
        logs = np.array([values[log_noise] for log_noise in log_noises])
        floor = logs.max() - NEGLIGIBLE_DROP
        matters = np.maximum(logs[1:], logs[:-1]) > floor
        is_rough = matters & (np.abs(np.diff(logs)) > MAX_DROP) & (np.diff(log_noises) > MIN_STEP)
        is_rough[0] |= logs[0] > floor and log_noises[1] - log_noises[0] > 0.5 * MAX_STEP
        new = list(0.5 * (log_noises[1:] + log_noises[:-1])[is_rough])
        # Below the resolution of the tests, nothing but the prior depends on the noise: it is the end's.
        is_end = logs[0] <= floor or _is_flat_beneath(log_noises, logs, prior)
        new += [] if is_end else [log_noises[0] - MAX_STEP]
        new += [log_noises[-1] + MAX_STEP] if logs[-1] > floor else []
        new = [float(np.clip(log_noise, *ends)) for log_noise in new]
        if all(log_noise in values for log_noise in new):
            break
        values |= {log_noise: function(log_noise) for log_noise in new if log_noise not in values}
    log_noises = np.array(sorted(values))
    return log_noises, np.array([values[log_noise] for log_noise in log_noises])


def _nodes(log_noises: FloatArray, logs: FloatArray, prior: Prior) -> FloatArray:
    """Return equally spaced values over the range in which a function, roughly known, is not negligible."""
    table, density = _table(log_noises, logs, prior, is_local=True)
    matters = table[density > np.exp(-NEGLIGIBLE_DROP)]
    low, high = max(float(matters[0]), float(log_noises[0])), float(matters[-1])
    return np.linspace(low, high, 1 + max(INTERVALS, int(np.ceil((high - low) / MAX_NODE_STEP))))


def _widened(function: Callable[[float], float], log_noises: FloatArray, prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Return equally spaced values, more where the log density is not negligible, and its values."""
    ends, step = _ends(prior), float(log_noises[1] - log_noises[0])
    values = {float(log_noise): function(float(log_noise)) for log_noise in log_noises}
    while len(values) < MAX_VALUES:
        ordered = np.array(sorted(values))
        logs = np.array([values[log_noise] for log_noise in ordered])
        (lowest, last), floor = (float(ordered[0]), float(ordered[-1])), logs.max() - WIDENING_DROP
        if logs[-1] > floor and last + step <= ends[1]:
            values[last + step] = function(last + step)
        elif logs[0] > floor and lowest - step >= ends[0] and not _is_flat_beneath(ordered, logs, prior):
            values[lowest - step] = function(lowest - step)
        else:
            break
    ordered = np.array(sorted(values))
    return ordered, np.array([values[log_noise] for log_noise in ordered])


def _joined(
    model: StatisticalModel, solutions: Sequence[Solution], logs: FloatArray, log_weights: FloatArray, seed: int
) -> Solution:
    """Return the posterior from those at values of the logarithm of the noise, and its log density at these."""
    prior = model.priors[SYMBOL]
    table, density = _table(logs, log_weights, prior)
    shares = _shares(logs, table, density)
    local_mass = _shares(logs, *_table(logs, log_weights, prior, is_local=True)).sum()
    total = shares.sum()
    shares = shares / total

    def marginal(symbol: str) -> Marginal:
        if symbol == SYMBOL:
            return marginal_of_table(np.exp(table), density / np.exp(table))
        weighted = [
            (float(share), solution.marginals[symbol]) for share, solution in zip(shares, solutions, strict=True)
        ]
        return blended(weighted, model.priors[symbol].support)

    matters = shares > NEGLIGIBLE_SHARE
    solutions = [solution for solution, is_kept in zip(solutions, matters, strict=True) if is_kept]
    logs, shares = logs[matters], shares[matters] / shares[matters].sum()
    best = int(np.argmax(shares))
    members: dict[str, float] = {}
    for share, solution in zip(shares, solutions, strict=True):
        for name, probability in solution.members.items():
            members[name] = members.get(name, 0.0) + float(share * probability)
    return Solution(
        model.with_errors(level=float(np.exp(shares @ logs))),
        solutions[best].route,
        f"the noise integrated over {len(solutions)} values; at each of them {solutions[best].reason}",
        Representation(
            *(partial(_represented, model, solutions, shares, logs, is_wide=is_wide) for is_wide in (False, True))
        ),
        Marginals(model.symbols, marginal),
        seed,
        log_evidence=float(log_weights.max() + np.log(total)),
        log_evidence_error=float(shares @ [solution.log_evidence_error or 0.0 for solution in solutions])
        + float(abs(local_mass / total - 1)),
        members=members,
    )


def _table(
    logs: FloatArray, log_weights: FloatArray, prior: Prior, *, is_local: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return many values of the logarithm of the noise, and their density over its largest known value.

    Beneath the known values they go on down to the least of the prior.
    """
    from scipy.interpolate import Akima1DInterpolator, CubicSpline

    heights, lowest = log_weights - log_weights.max(), min(_ends(prior)[0], float(logs[0]))
    tail = np.linspace(lowest, logs[0], TAIL_POINTS if lowest < logs[0] else 0, endpoint=False)
    of_tail = _beneath(logs, heights, prior)(np.exp(2 * (tail - logs[0]))) + log_prior_of_log(prior, np.exp(tail))
    table = np.linspace(logs[0], logs[-1], TABLE_POINTS)
    interpolator = Akima1DInterpolator if is_local or len(logs) < MIN_SPLINE else CubicSpline
    return np.append(tail, table), np.exp(np.append(of_tail, interpolator(logs, heights)(table)))


def _beneath(logs: FloatArray, log_weights: FloatArray, prior: Prior) -> Polynomial:
    """Return the log likelihood beneath the least value as a parabola of the square of the noise over that.

    As it is where the noise is small beside other independent errors.
    """
    squares = np.exp(2 * (logs[:3] - logs[0]))
    log_likelihoods = log_weights[:3] - log_prior_of_log(prior, np.exp(logs[:3]))
    return Polynomial(polyfit(squares, log_likelihoods, len(squares) - 1))


def _is_flat_beneath(logs: FloatArray, log_weights: FloatArray, prior: Prior) -> bool:
    """Return whether the log likelihood hardly changes from the least value of the noise down to none."""
    none, least = _beneath(logs, log_weights, prior)(np.array([0.0, 1.0]))
    return bool(abs(least - none) < MAX_CHANGE)


def _shares(logs: FloatArray, table: FloatArray, density: FloatArray) -> FloatArray:
    """Return the mass that belongs to every value (k,): of the density about it, between it and its neighbours."""
    return np.array([np.trapezoid(density * np.interp(table, logs, unit), table) for unit in np.eye(len(logs))])


def shares_with_factors(logs: FloatArray, shares: FloatArray, log_factors: FloatArray, prior: Prior) -> FloatArray:
    """Return the shares (k, n) of values of the noise in the posterior times factors, which change much between them.

    What changes little has the shares of the posterior. So the density is found of which they are the shares, and
    interpolated together with the factors.

    Parameters
    ----------
    logs, shares : (k,) arrays
        Logarithms of the values, ascending, and the share of the posterior that each stands for.
    log_factors : (k, n) array
    prior : Prior
        Of the noise, beyond whose bounds it cannot lie.
    """
    log_density, ends = np.log(shares), _ends(prior)
    for _ in range(DENSITY_STEPS):
        of_values = _masses(logs, log_density[:, None], ends)[:, 0]
        log_density = log_density + DENSITY_STEP * np.log(shares / of_values * of_values.sum())
    blocks = np.array_split(log_density[:, None] + log_factors, 1 + log_factors.shape[1] // FACTORS_AT_ONCE, axis=1)
    masses = np.concatenate([_masses(logs, heights, ends) for heights in blocks], axis=1)
    return np.asarray(masses / masses.sum(axis=0))


def _masses(logs: FloatArray, heights: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """Return the mass (k, n) that belongs to every value, of densities with these logarithms (k, n) over their largest.

    Beyond the values the logarithm goes on for a few steps, as a parabola through the last three that does not open
    upwards; then, where the noise is too small to matter, it falls in proportion to the noise, which its prior leaves.
    None lies beyond the ends of the prior.
    """
    from scipy.interpolate import Akima1DInterpolator, CubicSpline

    heights = heights - heights.max(axis=0)
    reach = STEPS_BEYOND * (logs[1] - logs[0])
    tail = logs[0] - reach - np.linspace(TAIL, 0, TABLE_POINTS // 10, endpoint=False)
    table = np.append(tail, np.linspace(logs[0] - reach, logs[-1] + reach, TABLE_POINTS))
    interpolator = Akima1DInterpolator if len(logs) < MIN_SPLINE else CubicSpline
    log_density = interpolator(logs, heights)(np.clip(table, logs[0], logs[-1]))
    for is_beyond, order in ((table < logs[0], slice(None)), (table > logs[-1], slice(None, None, -1))):
        x, y = logs[order][:3], heights[order][:3]
        slopes = np.diff(y, axis=0) / np.diff(x)[:, None]
        bend = np.minimum((slopes[-1] - slopes[0]) / (x[-1] - x[0]), 0.0)
        distance = (table[is_beyond] - x[0])[:, None]
        log_density[is_beyond] = y[0] + distance * (slopes[0] + bend * (distance - (x[1] - x[0])))
    log_density[: len(tail)] = log_density[len(tail)] + (tail - table[len(tail)])[:, None]
    cells = np.exp(log_density) * (np.gradient(table) * (ends[0] <= table) * (table <= ends[1]))[:, None]
    return np.asarray(np.array([np.interp(table, logs, unit) for unit in np.eye(len(logs))]) @ cells)


def _represented(
    model: StatisticalModel,
    solutions: Sequence[Solution],
    shares: FloatArray,
    logs: FloatArray,
    count: int | None,
    *,
    is_wide: bool,
) -> GaussianMixture:
    """Return the components of all solutions, fewer of those of less weight."""
    mixtures = []
    for solution, share, log in zip(solutions, shares, logs, strict=True):
        components = solution.few_components(max(1, int(share * MAX_COMPONENTS)), is_wide=is_wide)
        values = dict(zip(solution.model.nonlinear, components.settings.T, strict=True))
        values[SYMBOL] = np.full(len(components), np.exp(log))
        settings = np.column_stack([values[symbol] for symbol in model.nonlinear])
        mixtures.append(
            replace(components, settings=settings, weights=share * components.weights / components.weights.sum())
        )
    return GaussianMixture.of_all(mixtures).resampled(count)
