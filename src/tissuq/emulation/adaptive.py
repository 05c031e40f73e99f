"""From runs to a posterior, with further runs where the posterior is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.emulation.calibration import Calibration
from tissuq.emulation.emulator import Emulator, emulate, runs_needed
from tissuq.emulation.kriging import Kernel, Trend
from tissuq.emulation.problem import Method, Problem
from tissuq.emulation.runs import ForwardRuns, PointSet, space_filling
from tissuq.errors import InputError
from tissuq.parameters.checks import check_count, check_seed

Runner = Callable[[FloatArray], ForwardRuns]
"""A function that runs a forward model at parameters (N, d)."""

MAX_ERROR_RATIO = 0.02
"""Ratio of the emulator's error to noise and discrepancy (variances) below which no further runs are made."""
CANDIDATE_DRAWS = 256
"""Number of draws of the posterior among which further runs are chosen."""


@dataclass(frozen=True)
class EmulationSettings:
    """Settings of an emulator and of its posterior.

    Parameters
    ----------
    runs : int
        Number of runs of the space-filling plan.
    refine : int
        Largest number of further runs, in batches where the posterior is and the emulator is least certain, until its
        error is negligible beside the noise.
    design, kernel, trend, method : str
    seed : int
    """

    runs: int = 40
    refine: int = 0
    design: PointSet = "sobol"
    kernel: Kernel = "squared-exponential"
    trend: Trend = "linear"
    method: Method = "auto"
    seed: int = 0

    def __post_init__(self) -> None:
        check_count(self.runs, "the number of runs must be 1 or more")
        check_count(self.refine, "the number of further runs must be 0 or more", least=0)
        check_seed(self.seed)


def calibrated(
    problem: Problem, run: Runner, settings: EmulationSettings, emulator: Emulator | None = None
) -> Calibration:
    """Return the posterior of a problem.

    Parameters
    ----------
    problem : Problem
    run : callable
        Function that runs the forward model.
    settings : EmulationSettings
    emulator : Emulator, optional
        An earlier emulator of the same model at the same controls, in place of the run plan.
    """
    if emulator is None:
        _check_run_count(problem, settings)
        plan = settings.runs, settings.seed, settings.design, problem.correlation
        runs = run(space_filling(problem.forward_priors, *plan))
        emulator = _emulator(runs, problem, settings)
    else:
        _check_fit(problem, emulator)
    calibration = _posterior(problem, emulator, settings)
    remaining, held_out = settings.refine, calibration.held_out
    while remaining > 0 and calibration.error_ratio > MAX_ERROR_RATIO:
        new_runs = run(_most_uncertain(calibration, min(remaining, len(problem.forward_symbols) + 2)))
        remaining -= len(new_runs)
        if not new_runs.failed.all():
            held_out = (*held_out, calibration.emulator.check(*new_runs.good))
        emulator = _emulator(calibration.runs.joined(new_runs), problem, settings)
        calibration = _posterior(problem, emulator, settings)
    return replace(calibration, held_out=held_out)


def _emulator(runs: ForwardRuns, problem: Problem, settings: EmulationSettings) -> Emulator:
    quantities = tuple(problem.quantities.values())
    return emulate(runs, problem.control, settings.kernel, settings.trend, problem.forward_priors, quantities)


def _posterior(problem: Problem, emulator: Emulator, settings: EmulationSettings) -> Calibration:
    from tissuq.emulation.likelihood import Likelihood
    from tissuq.emulation.sampling import sample_posterior

    posterior = sample_posterior(Likelihood(problem, emulator), settings.seed, settings.method)
    return Calibration(problem, emulator, posterior, (), settings.seed, settings.method)


def _most_uncertain(calibration: Calibration, count: int) -> FloatArray:
    """Return parameters (count, d) from the posterior at which the emulator is least certain.

    They are apart from each other and from failed runs, near which no further run reduces the uncertainty.
    """
    draws = calibration.draws(CANDIDATE_DRAWS)[:, : len(calibration.problem.forward_symbols)]
    _, covariance = calibration.emulator.moments(draws)
    uncertainty = np.trace(covariance, axis1=1, axis2=2)
    spread = np.maximum(draws.std(axis=0), 1e-12 * np.abs(draws).max(axis=0) + np.finfo(float).tiny)

    def away_from(point: FloatArray) -> FloatArray:
        return np.asarray(-np.expm1(-0.5 * (((draws - point) / spread) ** 2).sum(axis=1)))

    for point in calibration.runs.points[calibration.runs.failed]:
        uncertainty = uncertainty * away_from(point)
    selected: list[int] = []
    for _ in range(count):
        selected.append(int(np.argmax(uncertainty)))
        uncertainty = uncertainty * away_from(draws[selected[-1]])
    return np.asarray(draws[selected])


def _check_run_count(problem: Problem, settings: EmulationSettings) -> None:
    """Refuse too few runs before any is made, because one may take hours."""
    if settings.trend not in get_args(Trend):
        return  # `emulate` refuses it
    dimension = len(problem.forward_symbols)
    needed = runs_needed(dimension, settings.trend)
    if settings.runs < needed:
        raise InputError(
            f"an emulator of {dimension} parameters with a {settings.trend} mean needs {needed} runs or more, and "
            f"{settings.runs} are requested (--runs)."
        )


def _check_fit(problem: Problem, emulator: Emulator) -> None:
    """Refuse an emulator of other parameters or controls; one of a narrower region than the priors gives a warning."""
    if not isinstance(emulator, Emulator):
        raise InputError(f"emulator must be that of an earlier calibration, not {emulator!r:.80}.")
    if emulator.symbols != problem.forward_symbols:
        raise InputError(
            f"the emulator is one of {', '.join(emulator.symbols)}; the priors are of "
            f"{', '.join(problem.forward_symbols)}."
        )
    if not np.array_equal(emulator.control, problem.control):
        raise InputError("the emulator is one at other controls than the measurements: make a new one.")
