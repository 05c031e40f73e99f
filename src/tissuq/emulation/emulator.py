"""The emulator: outputs of an expensive model at any parameters, with their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray
from tissuq.emulation.kriging import (
    Kernel,
    Kriging,
    LengthScales,
    Mode,
    Trend,
    fitted,
    leave_one_out,
    moments,
    trend_basis,
)
from tissuq.emulation.output_basis import OutputBasis, basis_of, has_signs, output_moments
from tissuq.emulation.runs import EmulatorCheck, ForwardRuns
from tissuq.errors import InputError, ModelError
from tissuq.inference.threads import one_thread
from tissuq.parameters.priors import Prior

if TYPE_CHECKING:
    import pandas as pd

LEADING_DIRECTIONS = 2
"""Number of directions of the outputs for which coordinates are chosen."""
LOW_PROBABILITY, MAX_DISTANCE_BELOW = 1e-4, 0.25
"""Prior probability below the smallest value that matters, and the largest distance of this value from the runs, as a
share of their range of logarithms."""
SENSITIVITY_POINTS, SENSITIVITY_BLOCK = 2048, 512
"""Points from which sensitivity indices are estimated, and how many are computed at once."""
EXTRA_RUNS = 4
"""Smallest number of runs in excess of the coefficients of the mean."""


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The unit box of the runs: parameters, or the logarithms of some, from the smallest to the largest."""

    low: FloatArray
    high: FloatArray
    is_log: BoolArray

    def of(self, values: Any) -> Any:
        """Return points (..., d) of the box at parameters (..., d), NumPy or JAX."""
        arrays = values.__array_namespace__()
        positive = arrays.where(self.is_log, values, 1.0)
        logs = arrays.log(arrays.maximum(positive, np.finfo(float).tiny))
        return (arrays.where(self.is_log, logs, values) - self.low) / (self.high - self.low)


@dataclass(frozen=True, eq=False)
class Emulator:
    """A Gaussian process for each of the few directions in which the outputs of a model vary.

    Parameters
    ----------
    runs : ForwardRuns
        Runs from which it was made.
    control : (n,) array
        Controls of the outputs.
    coordinates : Coordinates
    basis : OutputBasis
    kriging : Kriging
    """

    runs: ForwardRuns
    control: FloatArray
    coordinates: Coordinates
    basis: OutputBasis
    kriging: Kriging

    @property
    def symbols(self) -> tuple[str, ...]:
        """The parameters."""
        return self.runs.symbols

    @property
    def logarithms(self) -> tuple[str, ...]:
        """The parameters whose logarithms are used."""
        return tuple(np.array(self.symbols)[self.coordinates.is_log].tolist())

    @cached_property
    def arrays(self) -> dict[str, Any]:
        """The arrays of which `emulated` is computed."""
        return {
            "low": self.coordinates.low,
            "span": self.coordinates.high - self.coordinates.low,
            "is_log": self.coordinates.is_log,
            "outputs": self.basis.arrays,
            "processes": self.kriging.arrays,
        }

    @property
    def form(self) -> tuple[Kernel, Trend]:
        """The static arguments of compiled functions."""
        return self.kriging.kernel, self.kriging.trend

    def moments(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return means (N, n) and covariances (N, n, n) of the outputs at parameters (N, d)."""
        mean, cov = _compiled(self.form)(values, self.arrays)
        return np.asarray(mean), np.asarray(cov)

    def predict(self, parameters: Mapping[str, float]) -> pd.DataFrame:
        """Return the predicted outputs at parameters, and the standard deviation of the emulator's error.

        Returns
        -------
        pandas.DataFrame
            Columns control, mean, sd.
        """
        import pandas as pd

        unknown = set(self.symbols) ^ set(parameters)
        if unknown:
            raise InputError(
                f"the emulator needs {', '.join(self.symbols)}; '{sorted(unknown)[0]}' is missing or unknown."
            )
        mean, cov = self.moments(np.array([[parameters[symbol] for symbol in self.symbols]], dtype=np.float64))
        sd = np.sqrt(np.diagonal(cov[0]))
        return pd.DataFrame({"control": self.control, "mean": mean[0], "sd": sd})

    def sensitivity(self, priors: Mapping[str, Prior]) -> pd.DataFrame:
        """Return which share of the outputs' variance each parameter explains where all vary over their priors.

        Sobol's indices, estimated from the emulator's mean (Saltelli et al. 2010), over all outputs together: variances
        are summed, those of several quantities relative to the spread of each over the runs. With those of few runs,
        errors of the emulator are part of them.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter: first, the share that the parameter explains alone, and total, the share that is
            left when all others are known.

        Examples
        --------
        >>> import numpy as np
        >>> import tissuq as tq
        >>> from tissuq.emulation import emulate, gathered
        >>> points = np.random.default_rng(0).random((12, 2))
        >>> results = [{"parameters": {"a": a, "b": b}, "outputs": [a + 2 * b], "error": "", "seconds": 0.0}
        ...            for a, b in points]
        >>> found = emulate(gathered(["a", "b"], results, 1), [1.0])
        >>> found.sensitivity({"a": tq.Uniform(0, 1), "b": tq.Uniform(0, 1)})["first"].round(2).to_dict()
        {'a': 0.2, 'b': 0.8}
        """
        import pandas as pd
        from scipy.stats import qmc

        size = len(self.symbols)
        cube = qmc.Sobol(2 * size, rng=np.random.default_rng(61)).random(SENSITIVITY_POINTS)
        quantiles = [priors[symbol].quantile for symbol in self.symbols]
        base_points, new_points = (
            np.column_stack([quantile(column) for quantile, column in zip(quantiles, half.T, strict=True)])
            for half in (cube[:, :size], cube[:, size:])
        )
        base, new = self._means(base_points) / self.basis.scale, self._means(new_points) / self.basis.scale
        variance = np.concatenate([base, new]).var(axis=0).sum()
        rows = []
        for k in range(size):
            mixed = self._means(np.where(np.arange(size) == k, new_points, base_points)) / self.basis.scale
            first_order = (new * (mixed - base)).mean(axis=0).sum()
            rows.append((first_order / variance, 0.5 * ((mixed - base) ** 2).mean(axis=0).sum() / variance))
        return pd.DataFrame(rows, pd.Index(self.symbols, name="parameter"), ["first", "total"])

    def _means(self, values: FloatArray) -> FloatArray:
        """Return the means (N, n) of the outputs at parameters (N, d), about those of the runs."""
        blocks = np.array_split(values, max(len(values) // SENSITIVITY_BLOCK, 1))
        return np.asarray(np.concatenate([self.moments(block)[0] for block in blocks]) - self.runs.good[1].mean(axis=0))

    def check(self, points: ArrayLike | None = None, outputs: ArrayLike | None = None) -> EmulatorCheck:
        """Return the errors of the emulator: every run predicted from the others, or held-out runs.

        Parameters
        ----------
        points : (N, d) array, optional
            Parameters of held-out runs; without them, each run of the emulator is left out in turn.
        outputs : (N, n) array, optional
            Outputs of the model there.

        Examples
        --------
        >>> import numpy as np
        >>> from tissuq.emulation import emulate, gathered
        >>> stretch, points = np.linspace(1.1, 1.5, 5), np.linspace(0.5, 2, 9)
        >>> results = [{"parameters": {"C10": c}, "outputs": 2 * c * (stretch - stretch**-2), "error": "",
        ...             "seconds": 0.0} for c in points]
        >>> emulate(gathered(["C10"], results, 5), stretch).check().relative_error < 1e-6
        True
        """
        if points is None or outputs is None:
            points, computed = self.runs.good
            error, sd = leave_one_out(self.kriging)
            scores, residuals = self.basis.scores(computed) - error, self.basis.residuals(computed)
            output_moments_of_runs = [
                output_moments(self.basis.arrays, *arguments)
                for arguments in zip(scores, sd**2, residuals, strict=True)
            ]
            mean, cov = (np.array(arguments) for arguments in zip(*output_moments_of_runs, strict=True))
            return EmulatorCheck("each left out", points, computed, mean, cov)
        points, computed = np.atleast_2d(np.asarray(points, float)), np.atleast_2d(np.asarray(outputs, float))
        return EmulatorCheck("held out", points, computed, *self.moments(points))


def emulated(form: tuple[Kernel, Trend], values: Any, arrays: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return mean (n,) and covariance (n, n) of the outputs at parameters (d,); JAX traces it."""
    point = Coordinates(arrays["low"], arrays["low"] + arrays["span"], arrays["is_log"]).of(values)
    return output_moments(arrays["outputs"], *moments(*form, arrays["processes"], point))


@lru_cache
def _compiled(form: tuple[Kernel, Trend]) -> Any:
    import jax

    jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]
    return jax.jit(jax.vmap(lambda values, arrays: emulated(form, values, arrays), (0, None)))


def emulate(
    runs: ForwardRuns,
    control: ArrayLike,
    kernel: Kernel = "squared-exponential",
    trend: Trend = "linear",
    priors: Mapping[str, Prior] | None = None,
    quantities: Sequence[tuple[int, int]] = (),
) -> Emulator:
    """Return the emulator of a model from its runs.

    Logarithms of positive parameters are used where that makes the runs more probable; those of outputs whose signs
    never change, where every run is then better predicted from the others.

    Parameters
    ----------
    runs : ForwardRuns
    control : (n,) array
        Controls of the outputs.
    kernel : str
        ``"squared-exponential"``, for models that are smooth in their parameters, or ``"matern-5/2"``.
    trend : str
        Polynomial mean of the processes: ``"constant"``, ``"linear"`` or ``"quadratic"``.
    priors : mapping of str to Prior, optional
        Priors of the parameters. The logarithm is not used where a parameter may come far nearer to zero than the runs.
    quantities : sequence of (int, int)
        First and last but one of the outputs of each of several quantities, whose units differ.

    Raises
    ------
    ModelError
        When too few runs have succeeded.
    """
    for name, value, kind in (("kernel", kernel, Kernel), ("trend", trend, Trend)):
        if value not in get_args(kind):
            raise InputError(f"the {name} must be one of {', '.join(get_args(kind))}, not '{value}'.")
    points, outputs = runs.good
    form: tuple[Kernel, Trend] = (kernel, trend)
    prior_of_column = [None if priors is None else priors[symbol] for symbol in runs.symbols]
    needed = runs_needed(points.shape[1], trend)
    if len(points) < needed:
        failed = f" {runs.failure_summary}" if runs.failed.any() else ""
        raise ModelError(
            f"an emulator of {points.shape[1]} parameters with a {trend} mean needs {needed} runs that succeed, and "
            f"there are {len(points)}.{failed} Ask for more runs, or give priors without "
            "the values at which the model fails."
        )
    if np.ptp(outputs, axis=0).max() == 0:
        raise ModelError("the forward model gives the same outputs at all parameters: there is nothing to identify.")
    may_be_log = [_may_be_log(column, prior) for column, prior in zip(points.T, prior_of_column, strict=True)]
    controls = np.asarray(control, dtype=np.float64)
    with one_thread():
        emulators = [
            _emulator_on(
                runs, controls, basis_of(outputs, is_log=is_log, quantities=quantities), np.array(may_be_log), form
            )
            for is_log in (False, True)[: 1 + has_signs(outputs)]
        ]
        return max(emulators, key=lambda emulator: emulator.check().log_density)


def runs_needed(dimension: int, trend: Trend) -> int:
    """Return how many runs an emulator of so many parameters needs."""
    return EXTRA_RUNS + int(trend_basis(np.zeros((1, dimension)), trend).shape[1])


def _emulator_on(
    runs: ForwardRuns,
    control: FloatArray,
    basis: OutputBasis,
    may_be_log: BoolArray,
    form: tuple[Kernel, Trend],
) -> Emulator:
    """Return the emulator with the coordinates that make the leading scores of the runs most probable."""
    points, outputs = runs.good
    scores = basis.scores(outputs)
    coordinates, modes = _best_coordinates(points, scores[:, :LEADING_DIRECTIONS], may_be_log, form)
    kriging, is_predicted = fitted(coordinates.of(points), scores, *form, near=modes)
    return Emulator(runs, control, coordinates, basis.truncated_to(is_predicted), kriging)


def _best_coordinates(
    points: FloatArray, scores: FloatArray, may_be_log: BoolArray, form: tuple[Kernel, Trend]
) -> tuple[Coordinates, list[Mode]]:
    """Return the coordinates that make scores (m, q) most probable, and the modes of their length scales.

    Each parameter by itself and all by their logarithms are tried, and from the better of the two one parameter after
    the other is changed as long as that helps.
    """
    fits: dict[tuple[bool, ...], tuple[float, Coordinates, list[Mode]]] = {}

    def log_evidence(is_log: BoolArray) -> float:
        key = tuple(is_log.tolist())
        if key not in fits:
            coordinates = _box(points, is_log)
            scales = LengthScales(coordinates.of(points), *form)
            earlier = max(fits.values(), key=lambda fit: fit[0])[2] if fits else []
            modes: list[Mode] = []
            for column, values in enumerate(scores.T):
                modes.append(scales.mode(values, [*earlier[column : column + 1], *modes[-1:]], 0 if fits else 2))
            fits[key] = sum(mode.log_density for mode in modes), coordinates, modes
        return fits[key][0]

    best = max((np.zeros_like(may_be_log), may_be_log), key=log_evidence)
    is_better = True
    while is_better:
        neighbours = [np.where(np.arange(len(best)) == k, ~best, best) for k in np.flatnonzero(may_be_log)]
        candidate = max([best, *neighbours], key=log_evidence)
        is_better, best = log_evidence(candidate) > log_evidence(best), candidate
    return fits[tuple(best.tolist())][1:]


def _may_be_log(column: FloatArray, prior: Prior | None) -> bool:
    """Return whether the logarithms of a prior's probable values are near those of the runs (m,)."""
    if column.min() <= 0:
        return False
    low, high = np.log([column.min(), column.max()])
    smallest = column.min() if prior is None else float(prior.quantile(LOW_PROBABILITY))
    return smallest > 0 and low - np.log(smallest) <= MAX_DISTANCE_BELOW * (high - low)


def _box(points: FloatArray, is_log: BoolArray) -> Coordinates:
    """Return the unit box of points (m, d), of some parameters by their logarithms."""
    values = np.where(is_log, np.log(np.where(is_log, points, 1.0)), points)
    low, high = values.min(axis=0), values.max(axis=0)
    return Coordinates(low, np.where(high > low, high, low + 1), is_log)
