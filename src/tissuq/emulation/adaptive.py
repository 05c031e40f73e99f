"""From runs to a posterior, with further runs where it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.emulation.calibration import Calibration
from tissuq.emulation.design import Design, space_filling
from tissuq.emulation.emulator import Emulator, emulate, runs_needed
from tissuq.emulation.kriging import Kernel, Trend
from tissuq.emulation.problem import Method, Problem
from tissuq.emulation.runs import ForwardRuns
from tissuq.errors import InputError

__all__ = ["Choices", "Runner", "calibrated"]

FloatArray = NDArray[np.float64]

Runner = Callable[[FloatArray], ForwardRuns]
"""Runs a forward model at parameters (N, d)."""

ENOUGH = 0.02
"""Ratio of the emulator's error to noise and discrepancy (variances) below which no further runs are made."""
CANDIDATES = 256
"""Draws of the posterior among which further runs are chosen."""


@dataclass(frozen=True)
class Choices:
    """How a model is emulated and its posterior found.

    Parameters
    ----------
    runs : int
        Of the space-filling design.
    refine : int
        Further ones at most, in batches where the posterior is and the emulator is least sure, until its error hardly
        counts beside the noise.
    design, kernel, trend, method : str
    seed : int
    """

    runs: int = 40
    refine: int = 0
    design: Design = "sobol"
    kernel: Kernel = "squared-exponential"
    trend: Trend = "linear"
    method: Method = "auto"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.refine < 0:
            raise InputError(f"the number of further runs must be 0 or more, not {self.refine}.")


def calibrated(problem: Problem, run: Runner, choices: Choices, emulator: Emulator | None = None) -> Calibration:
    """Return the posterior of a problem.

    Parameters
    ----------
    problem : Problem
    run : callable
        Runs the forward model.
    choices : Choices
    emulator : Emulator, optional
        An earlier one of the same model at the same controls, instead of the design.
    """
    if emulator is None:
        _check_enough(problem, choices)
        runs = run(space_filling(problem.forward_priors, choices.runs, choices.seed, choices.design))
        emulator = emulate(runs, problem.control, choices.kernel, choices.trend, problem.forward_priors)
    else:
        _check_fit(problem, emulator)
    found = _posterior(problem, emulator, choices)
    left, held_out = choices.refine, found.held_out
    while left > 0 and found.error_ratio > ENOUGH:
        more = run(_where_unsure(found, min(left, len(problem.forward_symbols) + 2)))
        left -= len(more)
        if not more.failed.all():
            held_out = (*held_out, found.emulator.check(*more.good))
        emulator = emulate(
            found.runs.joined(more), problem.control, choices.kernel, choices.trend, problem.forward_priors
        )
        found = _posterior(problem, emulator, choices)
    return Calibration(found.problem, found.emulator, found.posterior, held_out, choices.seed, choices.method)


def _posterior(problem: Problem, emulator: Emulator, choices: Choices) -> Calibration:
    from tissuq.emulation.likelihood import Likelihood
    from tissuq.emulation.sampling import sampled

    found = sampled(Likelihood(problem, emulator), choices.seed, choices.method)
    return Calibration(problem, emulator, found, (), choices.seed, choices.method)


def _where_unsure(found: Calibration, count: int) -> FloatArray:
    """Return parameters (count, d) from the posterior at which the emulator is least sure.

    They are apart from each other and from runs that failed, which an emulator never becomes surer of.
    """
    draws = found.draws(CANDIDATES)[:, : len(found.problem.forward_symbols)]
    _, covariance = found.emulator.moments(draws)
    unsure = np.trace(covariance, axis1=1, axis2=2)
    spread = np.maximum(draws.std(axis=0), 1e-12 * np.abs(draws).max(axis=0) + np.finfo(float).tiny)

    def away_from(point: FloatArray) -> FloatArray:
        return np.asarray(-np.expm1(-0.5 * (((draws - point) / spread) ** 2).sum(axis=1)))

    for point in found.runs.points[found.runs.failed]:
        unsure = unsure * away_from(point)
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(int(np.argmax(unsure)))
        unsure = unsure * away_from(draws[chosen[-1]])
    return np.asarray(draws[chosen])


def _check_enough(problem: Problem, choices: Choices) -> None:
    """Refuse too few runs before any is made: each may take hours."""
    if choices.trend not in get_args(Trend):
        return  # which `emulate` refuses
    dimension = len(problem.forward_symbols)
    needed = runs_needed(dimension, choices.trend)
    if choices.runs < needed:
        raise InputError(
            f"an emulator of {dimension} parameters with a {choices.trend} mean needs {needed} runs or more, and "
            f"{choices.runs} are asked for (--runs)."
        )


def _check_fit(problem: Problem, emulator: Emulator) -> None:
    """Refuse an emulator of other parameters or controls; of a narrower region than the priors, a warning tells."""
    if emulator.symbols != problem.forward_symbols:
        raise InputError(
            f"the emulator is one of {', '.join(emulator.symbols)}; the priors are of "
            f"{', '.join(problem.forward_symbols)}."
        )
    if not np.array_equal(emulator.control, problem.control):
        raise InputError("the emulator is one at other controls than the measurements: make a new one.")
