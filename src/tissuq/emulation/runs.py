"""Runs of a forward model: their outputs, and which of them failed where."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.forward import Forward
from tissuq.errors import InputError

__all__ = ["ForwardRun", "ForwardRuns", "carry_out", "gathered"]

FloatArray = NDArray[np.float64]

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
        When the model does not return one number for each measurement.
    """
    start = perf_counter()
    result: dict[str, Any] = {"outputs": [], "error": ""}
    try:
        outputs = run.forward.run(dict(run.parameters), np.array(run.control))
    except Exception as error:  # a failed run is a result, which is listed
        result["error"] = f"{type(error).__name__}: {error}".strip().splitlines()[0][:300]
    else:
        result |= _checked(outputs, run)
    return result | {"parameters": dict(run.parameters), "seconds": perf_counter() - start}


def _checked(outputs: Any, run: ForwardRun) -> dict[str, Any]:
    try:
        values = np.asarray(outputs, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"the forward model '{run.forward.name}' returns no array of numbers: {error}.") from error
    if values.shape != (len(run.control),):
        raise InputError(
            f"the forward model '{run.forward.name}' returns outputs of shape {values.shape}; there are "
            f"{len(run.control)} measurements, and it must return one output for each."
        )
    if not np.isfinite(values).all():
        return {"error": f"{np.count_nonzero(~np.isfinite(values))} of {len(values)} outputs are not finite"}
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
    def failed(self) -> NDArray[np.bool_]:
        """Which runs failed: (N,) array."""
        return np.array([bool(error) for error in self.errors])

    @property
    def good(self) -> tuple[FloatArray, FloatArray]:
        """Parameters and outputs of the runs that did not fail."""
        return self.points[~self.failed], self.outputs[~self.failed]

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
        reasons = [error for error in self.errors if error]
        most_frequent = max(set(reasons), key=reasons.count)
        return (
            f"{len(reasons)} of {len(self)} runs of the forward model failed, {self._failure_region()}. The most "
            f"frequent reason: {most_frequent}."
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
        columns = zip(self.symbols, bad.T, strict=True)
        ranges = [f"{symbol} {column.min():.4g} to {column.max():.4g}" for symbol, column in columns]
        inside = ((good >= bad.min(axis=0)) & (good <= bad.max(axis=0))).all(axis=1).sum()
        return f"at {', '.join(ranges)} (where {inside} others did not)"


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
