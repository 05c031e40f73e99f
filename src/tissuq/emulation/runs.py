"""Runs of a forward model: what came out, what failed, and where."""

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

FEW = 3
"""Failed runs from which a value of one parameter that they all exceed tells something."""


@dataclass(frozen=True)
class ForwardRun:
    """One run that is to be made: a task of its own, which may travel to another process.

    Parameters
    ----------
    forward : Forward
    parameters : tuple of (str, float)
    control : tuple of float
        Where the outputs were measured.
    number : int
        For what is shown while it runs.
    """

    forward: Forward
    parameters: tuple[tuple[str, float], ...]
    control: tuple[float, ...]
    number: int

    @property
    def key(self) -> str:
        """The parameters, which tell it from every other run."""
        return json.dumps(self.parameters)

    @property
    def label(self) -> str:
        """What is shown when it is done."""
        return f"run {self.number}"


def carry_out(run: ForwardRun) -> dict[str, Any]:
    """Run the model once, and return its outputs or why there are none; plain data.

    Raises
    ------
    InputError
        When what it returns is no outputs at the measured controls, whatever the parameters.
    """
    start = perf_counter()
    found: dict[str, Any] = {"outputs": [], "error": ""}
    try:
        outputs = run.forward.run(dict(run.parameters), np.array(run.control))
    except Exception as error:  # a run that fails is a result: it is listed, and told
        found["error"] = f"{type(error).__name__}: {error}".strip().splitlines()[0][:300]
    else:
        found |= _checked(outputs, run)
    return found | {"parameters": dict(run.parameters), "seconds": perf_counter() - start}


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
    """What a forward model computed.

    Parameters
    ----------
    symbols : tuple of str
        The d parameters.
    points : (N, d) array
        Parameters of all runs, failed ones included.
    outputs : (N, n) array
        nan where a run failed.
    errors : tuple of str
        Why a run failed; empty where it did not.
    seconds : (N,) array
        How long each took.
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

    def joined(self, other: ForwardRuns) -> ForwardRuns:
        """Return these runs followed by others of the same model."""
        return ForwardRuns(
            self.symbols,
            np.concatenate([self.points, other.points]),
            np.concatenate([self.outputs, other.outputs]),
            self.errors + other.errors,
            np.concatenate([self.seconds, other.seconds]),
        )

    @property
    def told_failures(self) -> str:
        """How many runs failed, where, and why most of them; empty where none did."""
        if not self.failed.any():
            return ""
        reasons = [error for error in self.errors if error]
        usual = max(set(reasons), key=reasons.count)
        return (
            f"{len(reasons)} of {len(self)} runs of the forward model failed, {self._where()}. The most frequent "
            f"reason: {usual}."
        )

    def _where(self) -> str:
        """Return the region of the failures: beyond a value of one parameter, or their ranges."""
        good, bad = self.points[~self.failed], self.points[self.failed]
        if len(good) and len(bad) >= FEW:
            for symbol, own, others in zip(self.symbols, bad.T, good.T, strict=True):
                if own.min() > others.max():
                    return f"all those with {symbol} from {own.min():.4g} and none below {others.max():.4g}"
                if own.max() < others.min():
                    return f"all those with {symbol} up to {own.max():.4g} and none above {others.min():.4g}"
        ranges = [
            f"{symbol} {own.min():.4g} to {own.max():.4g}" for symbol, own in zip(self.symbols, bad.T, strict=True)
        ]
        inside = ((good >= bad.min(axis=0)) & (good <= bad.max(axis=0))).all(axis=1).sum()
        return f"at {', '.join(ranges)} (where {inside} others did not)"


def gathered(symbols: Sequence[str], results: Sequence[Mapping[str, Any]], outputs: int) -> ForwardRuns:
    """Return the runs whose results `carry_out` gave, in their order; each has ``outputs`` numbers unless it failed."""
    missing = np.full(outputs, np.nan)
    return ForwardRuns(
        tuple(symbols),
        np.array([[each["parameters"][symbol] for symbol in symbols] for each in results]).reshape(-1, len(symbols)),
        np.array([missing if each["error"] else each["outputs"] for each in results]).reshape(-1, outputs),
        tuple(each["error"] for each in results),
        np.array([each["seconds"] for each in results]),
    )
