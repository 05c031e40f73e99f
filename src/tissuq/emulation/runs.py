"""Runs of a forward model: where they are made, what they gave or why they failed, and an emulator's errors there."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.emulation.forward import Forward, UnreadableError
from tissuq.emulation.problem import ERROR_SYMBOLS, PriorCorrelation
from tissuq.errors import InputError
from tissuq.parameters.priors import Prior

PointSet = Literal["sobol", "latin"]
"""Scrambled Sobol points, or a Latin hypercube whose points stay apart."""

TAIL_PROBABILITY = 0.001
"""Probability of an unbounded prior beyond either end of the run plan."""


def space_filling(
    priors: Mapping[str, Prior],
    runs: int,
    seed: int = 0,
    design: PointSet = "sobol",
    correlation: PriorCorrelation | None = None,
) -> FloatArray:
    """Return the parameters (runs, d) at which to run a model: evenly spread over the quantiles of their priors.

    Uniform and log-uniform priors are covered up to their ends, others up to their quantiles of 0.1 and 99.9 %.

    Parameters
    ----------
    priors : mapping of str to Prior
        Priors of the d parameters.
    runs : int
        Number of points.
    seed : int
        Seed of the points.
    design : str
        ``"sobol"`` (scrambled Sobol points) or ``"latin"`` (a Latin hypercube whose points are moved apart).
    correlation : PriorCorrelation, optional
        Of the priors.

    Raises
    ------
    InputError
        When a prior is flat, there is no such design, or the number of runs is below one.

    Examples
    --------
    >>> from tissuq import Uniform
    >>> points = space_filling({"C10": Uniform(0, 2), "C20": Uniform(-1, 1)}, runs=16)
    >>> points.shape, bool((points[:, 0] > 1).sum() == 8)
    ((16, 2), True)
    """
    from scipy.special import ndtr, ndtri
    from scipy.stats import qmc

    if design not in get_args(PointSet):
        raise InputError(f"the design must be one of {', '.join(get_args(PointSet))}, not '{design}'.")
    if runs < 1:
        raise InputError(f"the number of runs must be at least 1, not {runs}.")
    size, generator = len(priors), np.random.default_rng([seed, 41])
    if design == "sobol":
        cube = qmc.Sobol(size, rng=generator).random_base2(int(np.ceil(np.log2(max(runs, 2)))))[:runs]
    else:
        cube = qmc.LatinHypercube(size, optimization="random-cd", rng=generator).random(runs)
    if correlation is not None:
        cube = ndtr(correlation.scores(ndtri(np.clip(cube, TAIL_PROBABILITY, 1 - TAIL_PROBABILITY))))
    columns = zip(priors.values(), cube.T, strict=True)
    return np.column_stack([_quantiles(prior, column) for prior, column in columns])


def _quantiles(prior: Prior, probability: FloatArray) -> FloatArray:
    is_box = prior.gaussian is not None and prior.gaussian[1] == 0
    is_whole = is_box or prior.name == "log-uniform"
    shrunk = probability if is_whole else TAIL_PROBABILITY + (1 - 2 * TAIL_PROBABILITY) * probability
    return np.asarray(prior.quantile(shrunk), dtype=np.float64)


MIN_FAILED_RUNS = 3
"""Smallest number of failed runs from which a threshold of one parameter that separates them is reported."""


@dataclass(frozen=True)
class ForwardRun:
    """One run that is to be made: a task that may be sent to another process.

    Parameters
    ----------
    forward : Forward
    parameters : tuple of (str, float)
    control : tuple of float
        Controls at which the outputs were measured.
    number : int
        Number shown while it runs.
    """

    forward: Forward
    parameters: tuple[tuple[str, float], ...]
    control: tuple[float, ...]
    number: int

    @property
    def key(self) -> str:
        """The parameters, which identify the run."""
        return json.dumps(self.parameters)

    @property
    def label(self) -> str:
        """The text shown when the run is done."""
        return f"run {self.number}"


def carry_out(run: ForwardRun) -> dict[str, Any]:
    """Run the model once, and return its outputs or the reason of its failure, as plain data.

    Raises
    ------
    InputError
        When the model returns no row of numbers, or the first run cannot be read. One that is too short or too long is
        a failed run.
    """
    start = perf_counter()
    result: dict[str, Any] = {"outputs": [], "error": ""}
    try:
        outputs = run.forward.run(dict(run.parameters), np.array(run.control))
    except Exception as error:  # a failed run is a result, which is listed
        if isinstance(error, UnreadableError) and run.number == 1:
            raise
        first_line = f"{type(error).__name__}: {error}".strip().splitlines()[0][:300]
        result["error"] = first_line + _without_prior(error, dict(run.parameters))
    else:
        result |= _checked(outputs, run)
        if not result["error"]:
            run.forward.clear(dict(run.parameters))
    return result | {"parameters": dict(run.parameters), "seconds": perf_counter() - start}


def _without_prior(error: Exception, parameters: Mapping[str, float]) -> str:
    """Return which priors there are, where a model asked for a parameter that has none; else nothing."""
    if not isinstance(error, KeyError) or not (missing := {*error.args} - {*parameters}):
        return ""
    taken = "".join(
        f"; {symbol} is of the discrepancy or the noise: give the model's another name"
        for symbol in missing & ERROR_SYMBOLS
    )
    return f" (there are priors of {', '.join(parameters)}{taken})"


def _checked(outputs: Any, run: ForwardRun) -> dict[str, Any]:
    try:
        values = np.asarray(outputs, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"the forward model '{run.forward.name}' returns no array of numbers: {error}.") from error
    if values.shape != (len(run.control),):
        difference = (
            f"outputs of shape {values.shape}; there are {len(run.control)} measurements, and it must return one "
            "output for each"
        )
        if values.ndim == 1:  # a solver that stopped early, at these parameters alone
            return {"error": difference}
        raise InputError(f"the forward model '{run.forward.name}' returns {difference}.")
    if not np.isfinite(values).all():
        bad = np.flatnonzero(~np.isfinite(values))
        first = f"the first at the control {run.control[bad[0]]:g}"
        return {"error": f"{len(bad)} of {len(values)} outputs are not finite, {first}"}
    return {"outputs": values.tolist()}


@dataclass(frozen=True, eq=False)
class ForwardRuns:
    """The runs of a forward model.

    Parameters
    ----------
    symbols : tuple of str
        The d parameters.
    points : (N, d) array
        Parameters of all runs, failed ones included.
    outputs : (N, n) array
        nan where a run failed.
    errors : tuple of str
        Reasons of failure; empty where a run succeeded.
    seconds : (N,) array
        Durations of the runs, s.
    """

    symbols: tuple[str, ...]
    points: FloatArray
    outputs: FloatArray
    errors: tuple[str, ...]
    seconds: FloatArray

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def failed(self) -> BoolArray:
        """Which runs failed: (N,) array."""
        return np.array([bool(error) for error in self.errors])

    @property
    def good(self) -> tuple[FloatArray, FloatArray]:
        """Parameters and outputs of the runs that did not fail."""
        return self.points[~self.failed], self.outputs[~self.failed]

    @property
    def failure_reason(self) -> str:
        """The most frequent reason of failed runs, in words."""
        reasons = [error for error in self.errors if error]
        most_frequent = max(set(reasons), key=reasons.count)
        return f"{'The reason' if len(set(reasons)) == 1 else 'The most frequent reason'}: {most_frequent}."

    def joined(self, new_runs: ForwardRuns) -> ForwardRuns:
        """Return these runs followed by others of the same model."""
        return ForwardRuns(
            self.symbols,
            np.concatenate([self.points, new_runs.points]),
            np.concatenate([self.outputs, new_runs.outputs]),
            self.errors + new_runs.errors,
            np.concatenate([self.seconds, new_runs.seconds]),
        )

    @property
    def failure_summary(self) -> str:
        """The number, the region and the most frequent reason of failed runs, in words; empty where none failed."""
        if not self.failed.any():
            return ""
        return (
            f"{self.failed.sum()} of {len(self)} runs of the forward model failed, {self._failure_region()}. "
            f"{self.failure_reason}"
        )

    def _failure_region(self) -> str:
        """Return the region of the failures: beyond a value of one parameter, or their ranges."""
        good, bad = self.points[~self.failed], self.points[self.failed]
        if len(good) and len(bad) >= MIN_FAILED_RUNS:
            for symbol, failed, succeeded in zip(self.symbols, bad.T, good.T, strict=True):
                if failed.min() > succeeded.max():
                    return f"all those with {symbol} from {failed.min():.4g} and none below {succeeded.max():.4g}"
                if failed.max() < succeeded.min():
                    return f"all those with {symbol} up to {failed.max():.4g} and none above {succeeded.min():.4g}"
        if len(bad) == 1:
            return "the one with " + ", ".join(
                f"{symbol} = {value:.4g}" for symbol, value in zip(self.symbols, bad[0], strict=True)
            )
        columns = zip(self.symbols, bad.T, strict=True)
        ranges = " and ".join(f"{symbol} from {column.min():.4g} to {column.max():.4g}" for symbol, column in columns)
        inside = int(((good >= bad.min(axis=0)) & (good <= bad.max(axis=0))).all(axis=1).sum())
        successes = f"{inside or 'no'} run{'s' * (inside != 1)} with values in these ranges succeeded"
        return f"with {ranges}; {successes}"


def gathered(symbols: Sequence[str], results: Sequence[Mapping[str, Any]], outputs: int) -> ForwardRuns:
    """Return the runs whose results `carry_out` gave, in their order; each has ``outputs`` numbers unless it failed."""
    missing = np.full(outputs, np.nan)
    return ForwardRuns(
        tuple(symbols),
        np.array([[result["parameters"][symbol] for symbol in symbols] for result in results]).reshape(
            -1, len(symbols)
        ),
        np.array([missing if result["error"] else result["outputs"] for result in results]).reshape(-1, outputs),
        tuple(result["error"] for result in results),
        np.array([result["seconds"] for result in results]),
    )


FIRST_RUNS = 4
"""Number of runs after which it is asked whether further ones can be of use."""
MAX_OPPOSITE_COSINE = -0.9
"""Largest cosine between outputs and measurements of which only the sign differs."""


def check_first_runs(runs: ForwardRuns, measured: FloatArray, quantities: Mapping[str, tuple[int, int]]) -> None:
    """Refuse to go on when the first runs all failed, or all gave a quantity with the opposite sign.

    Parameters
    ----------
    runs : ForwardRuns
    measured : (n,) array
        What the outputs are compared with.
    quantities : mapping of str to (int, int)
        Where the measurements of each quantity begin and end.

    Raises
    ------
    InputError
        When that is so.
    """
    if runs.failed.all():
        raise InputError(
            f"the first {len(runs)} runs of the forward model all failed, and no more were made. {runs.failure_reason} "
            "Mend the model or the options, or give other priors, and call it again."
        )
    _, outputs = runs.good
    for name, (start, stop) in quantities.items():
        values, computed = measured[start:stop], outputs[:, start:stop]
        sizes = np.linalg.norm(values) * np.linalg.norm(computed, axis=1)
        if (computed @ values < MAX_OPPOSITE_COSINE * sizes).all():
            end = int(np.abs(values).argmax())
            raise InputError(
                f"{f'{name}: ' if name else ''}the outputs of the model and the measurements have opposite signs: "
                f"{computed[0, end]:.4g} was computed where {values[end]:.4g} was measured. Turn the sign of one of "
                "them; of a model in a deck, that of --factor."
            )


NORMAL_QUANTILE_975 = 1.959963984540054
"""Standard deviations within which 95 % of normal errors lie."""

ROUNDING_SHARE = 1e-9
"""Share of the largest output below which an error is rounding."""


@dataclass(frozen=True, eq=False)
class EmulatorCheck:
    """Runs of a model beside the emulator's predictions of them.

    Parameters
    ----------
    kind : str
        How the runs were withheld from the emulator.
    points : (N, d) array
    computed, predicted : (N, n) array
        Outputs of the model, and of the emulator.
    covariance : (N, n, n) array
        Covariance of the emulator's error.
    """

    kind: str
    points: FloatArray
    computed: FloatArray
    predicted: FloatArray
    covariance: FloatArray

    @cached_property
    def sd(self) -> FloatArray:
        """Standard deviations (N, n) of the emulator's error."""
        rounding = ROUNDING_SHARE * np.abs(self.computed).max()
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2) + rounding**2))

    @property
    def standardised(self) -> FloatArray:
        """Errors (N, n) over their standard deviations: about standard normal."""
        return np.asarray((self.computed - self.predicted) / self.sd)

    @property
    def share_inside(self) -> float:
        """Share of the outputs within 1.96 standard deviations: about 0.95."""
        return float((np.abs(self.standardised) < NORMAL_QUANTILE_975).mean())

    @property
    def rms_standardised(self) -> float:
        """Root mean square of the standardised errors: about one; more where the emulator is over-confident."""
        return float(np.sqrt((self.standardised**2).mean()))

    @property
    def log_density(self) -> float:
        """Mean over the outputs of the log of their marginal densities."""
        return float((-0.5 * self.standardised**2 - np.log(self.sd)).mean() - 0.5 * np.log(2 * np.pi))

    @property
    def relative_error(self) -> float:
        """Root mean square of the errors over that of the outputs."""
        return float(np.sqrt(((self.computed - self.predicted) ** 2).sum() / (self.computed**2).sum()))

    def __str__(self) -> str:
        return (
            f"{self.kind}: {len(self.points)} runs, relative error {self.relative_error:.2g} (root mean square), "
            f"{100 * self.share_inside:.0f} % of the outputs inside 95 %, standardised errors "
            f"{self.rms_standardised:.2g} (1)"
        )
