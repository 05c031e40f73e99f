"""Warnings about a calibration, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from tissuq.emulation.emulator import Emulator
from tissuq.emulation.problem import Problem
from tissuq.emulation.runs import EmulatorCheck

if TYPE_CHECKING:
    from tissuq.emulation.likelihood import Likelihood
    from tissuq.emulation.sampling import SampledPosterior

__all__ = ["NO_PARAMETERS_FIT", "calibration_warnings"]

NO_PARAMETERS_FIT = "no parameters that the priors allow give the measurements"
"""Start of the warning that something other than the parameters is wrong."""
MIN_EMULATOR_SHARE = 0.1
"""Share of a posterior variance due to the emulator from which a warning is given."""
MAX_MEAN_SHIFT = 0.5
"""Largest shift of a mean by the emulator's error without a warning, in posterior standard deviations."""
MAX_RMS_STANDARDISED = 1.5
"""Largest root mean square of the standardised errors of an emulator that is not over-confident."""
EDGE_WIDTH, MAX_EDGE_PROBABILITY = 0.01, 0.02
"""Width of an edge of the run plan, as a share of its own, and the largest posterior probability there without a
warning."""
MIN_MISFIT_PROBABILITY = 1e-4
"""Probability of a misfit as large as that of the best parameters below which no parameters give the data."""
MAX_SHARE_OUT_OF_REACH = 0.5
"""Largest share of the measurements beyond all outputs of the runs without a warning."""
MAX_SHARE_NEAR_FAILURES = 0.05
"""Largest share of the posterior nearer to a failed run than to any other without a warning."""
DRAWS_NEAR_FAILURES = 400
"""Number of draws from which that share is computed."""
DISCREPANCY_WARNINGS = {
    "none": (
        "no error of the forward model is allowed for: where the model is wrong, its parameters are over-confident, "
        "and the interval does not show it."
    ),
    "gp": (
        "the discrepancy has initial stiffness of its own, and takes it from the parameters: in tests, its intervals "
        "cover the initial modulus far less often than stated (docs/expensive-models.md). Prefer gp-pinned."
    ),
    "gp-pinned": (
        "the initial stiffness is left to the parameters; the learnt discrepancy holds for this experiment only."
    ),
}
"""Warning that belongs to each discrepancy beside a forward model."""


def calibration_warnings(
    problem: Problem,
    emulator: Emulator,
    check: EmulatorCheck,
    posterior: SampledPosterior,
    exact: SampledPosterior,
    emulator_share: Mapping[str, float],
    likelihood: Likelihood,
) -> Iterator[str]:
    """Yield the warnings that a calibration carries, the gravest first.

    Parameters
    ----------
    problem : Problem
    emulator : Emulator
    check : EmulatorCheck
        Each run of the emulator predicted from the others.
    posterior, exact : SampledPosterior
        With the emulator's error, and as if it were exact.
    emulator_share : mapping of str to float
        Share of every parameter's posterior variance that is due to the emulator's error.
    likelihood : Likelihood
    """
    if not posterior.converged:
        yield posterior.verdict
    yield from _no_parameters_fit(problem, emulator, posterior, likelihood)
    if emulator.runs.failed.any():
        share = _share_near_failures(emulator, posterior)
        position = (
            f"A share of {share:.0%} of the posterior is nearer to a failed run than to any other: there the emulator "
            "is unreliable."
            if share > MAX_SHARE_NEAR_FAILURES
            else "The posterior is not near them."
        )
        yield f"{emulator.runs.failure_summary} {position}"
    yield from _emulator_warnings(problem, check, posterior, exact, emulator_share)
    at_bounds, beyond_runs = _at_ends(problem, emulator, posterior)
    if beyond_runs:
        yield (
            f"the posterior lies beyond the runs of the model in {', '.join(beyond_runs)}, which lie where its prior "
            "is: the emulator extrapolates, or the prior contradicts the measurements. Let runs be placed where the "
            "posterior is (refine)."
        )
    if at_bounds:
        yield (
            f"the posterior reaches the bound of the prior of {', '.join(at_bounds)}: there the prior, not the data, "
            "decides. Give a wider prior, unless the bound is intended."
        )
    yield DISCREPANCY_WARNINGS[problem.discrepancy.name]


def _no_parameters_fit(
    problem: Problem, emulator: Emulator, posterior: SampledPosterior, likelihood: Likelihood
) -> Iterator[str]:
    """Yield a warning where the measurements cannot be what the model gives at any parameters, beyond all errors."""
    from scipy.special import gammaincc

    draws = posterior.thinned(DRAWS_NEAR_FAILURES)
    misfits = likelihood.misfits(draws)
    best, size = draws[int(misfits.argmin())], len(problem.measured)
    outputs = emulator.runs.good[1]
    is_out = (problem.measured < outputs.min(axis=0)) | (problem.measured > outputs.max(axis=0))
    is_absorbed = problem.discrepancy.name == "gp" or None in problem.noise_sd.values()  # by what is unknown
    is_out_of_reach = is_absorbed and is_out.mean() > MAX_SHARE_OUT_OF_REACH
    if gammaincc(0.5 * size, 0.5 * misfits.min()) > MIN_MISFIT_PROBABILITY and not is_out_of_reach:
        return
    values = best[: len(problem.forward_symbols)]
    predicted = emulator.moments(values[None])[0][0]
    worst = int(np.argmax(np.abs(problem.measured - predicted) / emulator.basis.scale))
    named = ", ".join(f"{symbol} {value:.3g}" for symbol, value in zip(problem.forward_symbols, values, strict=True))
    misfit = np.sqrt(misfits.min() / size)
    away = f"{misfit:.1f} standard deviations of noise, discrepancy and emulator away (root mean square; 1 is right)"
    absorbed = "described by a discrepancy or a noise that takes up the whole difference"
    yield (
        f"{NO_PARAMETERS_FIT}: at the best ({named}) they are {absorbed if misfit < 1 else away}, most at the control "
        f"{problem.control[worst]:.4g}: measured {problem.measured[worst]:.4g}, model {predicted[worst]:.4g}. "
        f"{is_out.sum()} of {size} measurements are "
        "beyond the outputs of all runs. Check the units of data and model, give wider priors, or allow for a wrong "
        "model (discrepancy gp-pinned)."
    )


def _emulator_warnings(
    problem: Problem,
    check: EmulatorCheck,
    posterior: SampledPosterior,
    exact: SampledPosterior,
    emulator_share: Mapping[str, float],
) -> Iterator[str]:
    forward = problem.forward_symbols
    shifts = {
        symbol: abs(exact.marginals[symbol].mean - marginal.mean) / marginal.sd
        for symbol, marginal in posterior.marginals.items()
    }
    largest_share = max(forward, key=lambda symbol: emulator_share[symbol])
    largest_shift = max(forward, key=lambda symbol: shifts[symbol])
    advice = "Give more runs, or let some be placed where the posterior is (refine)."
    if emulator_share[largest_share] > MIN_EMULATOR_SHARE:
        yield (
            f"the emulator's error is large beside the noise: it makes {emulator_share[largest_share]:.0%} of the "
            f"posterior variance of {largest_share}. {advice}"
        )
    elif shifts[largest_shift] > MAX_MEAN_SHIFT:
        yield (
            f"the emulator's error is large beside the noise: it shifts the mean of {largest_shift} by "
            f"{shifts[largest_shift]:.1f} standard deviations. {advice}"
        )
    if check.rms_standardised > MAX_RMS_STANDARDISED:
        yield (
            "the emulator is over-confident: runs predicted from the others are off by "
            f"{check.rms_standardised:.1f} of its standard deviations (root mean square; 1 is right). Where the model "
            "is not smooth in its parameters, try the kernel matern-5/2; otherwise give more runs."
        )


def _share_near_failures(emulator: Emulator, posterior: SampledPosterior) -> float:
    """Return the share of the posterior whose nearest run failed, in the unit box of the runs."""
    runs, coordinates = emulator.runs, emulator.coordinates
    draws = posterior.thinned(DRAWS_NEAR_FAILURES)[:, : len(runs.symbols)]
    run_points, draw_points = coordinates.of(runs.points), coordinates.of(draws)
    nearest = ((draw_points[:, None] - run_points[None]) ** 2).sum(axis=2).argmin(axis=1)
    return float(runs.failed[nearest].mean())


def _at_ends(problem: Problem, emulator: Emulator, posterior: SampledPosterior) -> tuple[list[str], list[str]]:
    """Return where the posterior is at bounds of priors, and where it is beyond all runs: parameters and which end."""
    at_bounds: list[str] = []
    beyond_runs: list[str] = []
    for symbol, column in zip(problem.forward_symbols, emulator.runs.points.T, strict=True):
        prior, values = problem.priors[symbol], posterior.values[:, problem.symbols.index(symbol)]
        run_ends, signs = (float(column.min()), float(column.max())), (1.0, -1.0)
        edge = EDGE_WIDTH * (run_ends[1] - run_ends[0])
        for end, bound, run_end, sign in zip(("lower", "upper"), prior.support, run_ends, signs, strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                is_cut = np.isfinite(prior.log_density(bound))
            is_beyond = sign * (values - bound) < edge if is_cut else sign * (values - run_end) < 0
            if posterior.weights[is_beyond].sum() > MAX_EDGE_PROBABILITY:
                (at_bounds if is_cut else beyond_runs).append(f"{symbol} ({end})")
    return at_bounds, beyond_runs
