"""Warnings about a calibration: sentences with codes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.emulation.emulator import Emulator
from tissuq.emulation.problem import Problem, is_far, symbol_of
from tissuq.emulation.runs import EmulatorCheck
from tissuq.experiments.smoothing import scatter
from tissuq.model.discrepancy import PinnedProcess
from tissuq.model.noise import NOISE_SD
from tissuq.result_warning import ResultWarning, Severity

if TYPE_CHECKING:
    from tissuq.emulation.likelihood import Likelihood
    from tissuq.emulation.sampling import SampledPosterior

Ends = list[tuple[str, str]]
"""Parameters, and of each the lower or the upper end."""

NO_PARAMETERS_FIT = "no parameters that the priors allow give the measurements"
"""Start of the warning that something other than the parameters is wrong."""
MIN_EMULATOR_SHARE = 0.1
"""Share of a posterior variance due to the emulator from which a warning is given."""
MAX_MEAN_SHIFT = 0.5
"""Largest shift of a mean by the emulator's error without a warning, in posterior standard deviations."""
MAX_SHIFT_IN_SDS = 10
"""Larger shifts are told as more than that: beside a posterior at a bound, which is as narrow as one likes."""
MAX_ERROR_SHARE = 0.1
"""Largest error of the emulator at the posterior, as a share of the measurements, that may be larger than the noise
without a warning: beyond, a posterior with the error and one without may agree that nothing is known."""
MAX_RMS_STANDARDISED = 1.5
"""Largest root mean square of the standardised errors of an emulator that is not over-confident."""
EDGE_WIDTH, MAX_EDGE_PROBABILITY = 0.01, 0.02
"""Width of an edge of the run plan, as a share of its own, and the largest posterior probability there without a
warning; beyond the runs, by how much it may exceed that of the prior, from which few runs leave out its ends."""
MAX_LEFT_OUT = 0.25
"""Largest probability of a prior beyond either end of runs that were planned for it, be they ever so few."""
PRIOR_POINTS = 4096
"""Equally probable values of a prior by which its probability beyond the runs is counted."""
MIN_MISFIT_PROBABILITY = 1e-4
"""Probability of a misfit as large as that of the best parameters below which no parameters give the data."""
MAX_SHARE_OUT_OF_REACH = 0.5
"""Largest share of the measurements beyond all outputs of the runs without a warning."""
MAX_SCATTERS, MAX_SHARE_OFF = 5.0, 0.1
"""Scatters about a smooth curve, and share of the measurements, that both lie between these and the nearest prediction
where an unknown noise stands for a model that cannot give them."""
MAX_SHARE_NEAR_FAILURES = 0.05
"""Largest share of the posterior nearer to a failed run than to any other without a warning."""
MIN_EFFECT, MIN_SHARE_OF_PRIOR = 1e-3, 0.9
"""Total sensitivity index below which, and width of the posterior over that of the prior from which, a parameter is
said to have no effect."""
DRAWS_NEAR_FAILURES = 400
"""Number of draws from which that share is computed."""
DISCREPANCY_WARNINGS = {
    "none": ResultWarning(
        "no error of the forward model is allowed for: where the model is wrong, its parameters are over-confident, "
        "and the interval does not show it.",
        "no-discrepancy",
    ),
    "gp": ResultWarning(
        "the discrepancy has initial stiffness of its own, and takes it from the parameters: in tests, its intervals "
        "cover the initial modulus far less often than stated (docs/expensive-models.md). Prefer gp-pinned.",
        "free-discrepancy",
    ),
    "gp-pinned": ResultWarning(
        "the initial stiffness is left to the parameters; the learnt discrepancy holds for this experiment only.",
        "free-discrepancy",
        Severity.NOTE,
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
    totals: Mapping[str, float],
    likelihood: Likelihood,
) -> Iterator[ResultWarning]:
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
    totals : mapping of str to float
        Total sensitivity index of every parameter of the model.
    likelihood : Likelihood
    """
    if not posterior.converged:
        yield ResultWarning(posterior.verdict, "not-converged", Severity.PROBLEM)
    error_share = _error_share(problem, emulator, posterior)
    without_effect = list(_without_effect(problem, posterior, totals)) if error_share <= MAX_ERROR_SHARE else []
    if without_effect:
        yield ResultWarning(
            f"the model hardly depends on {', '.join(without_effect)}, and the result is the prior: see whether the "
            "model reads a parameter of this name (--prior).",
            "poorly-determined",
            symbols=without_effect,
        )
    yield from _far_from_zero_load(problem)
    none_fit = list(_no_parameters_fit(problem, emulator, posterior, likelihood))
    yield from none_fit
    if emulator.runs.failed.any():
        share = _share_near_failures(emulator, posterior)
        position = (
            f"A share of {100 * share:.0f} % of the posterior is nearer to a failed run than to any other: there the "
            "emulator is unreliable."
            if share > MAX_SHARE_NEAR_FAILURES
            else "The posterior is not near them."
        )
        severity = Severity.CAUTION if share > MAX_SHARE_NEAR_FAILURES else Severity.NOTE
        yield ResultWarning(f"{emulator.runs.failure_summary} {position}", "inaccurate-emulator", severity)
    if not none_fit:  # of which there is nothing to be made more accurate
        yield from _large_error(problem, posterior, exact, emulator_share, error_share)
    yield from _over_confident(check)
    at_bounds, beyond_runs = _at_ends(problem, emulator, posterior)
    if beyond_runs:
        yield ResultWarning(
            f"the posterior lies beyond the runs of the model in {_listed(beyond_runs)}: the emulator extrapolates "
            "there, or the prior contradicts the measurements. Let runs be placed where the posterior is (refine); in "
            "the place of an emulator that was made with narrower priors make a new one.",
            "inaccurate-emulator",
        )
    if at_bounds:
        yield ResultWarning(
            f"the posterior reaches the bound of the prior of {_listed(at_bounds)}: there the prior, "
            "not the data, decides. Give a wider prior, unless the bound is intended.",
            "prior-bound",
            symbols=[symbol for symbol, _ in at_bounds],
        )
    yield DISCREPANCY_WARNINGS[problem.discrepancy.name]
    if problem.discrepancy.is_correlated and problem.without_discrepancy:
        yield ResultWarning(
            f"of {', '.join(problem.without_discrepancy)}, measured at one control, no error of the forward model "
            "is allowed for: where the model is wrong there, the parameters are over-confident.",
            "no-discrepancy",
        )


def _no_parameters_fit(
    problem: Problem, emulator: Emulator, posterior: SampledPosterior, likelihood: Likelihood
) -> Iterator[ResultWarning]:
    """Yield a warning where the measurements cannot be what the model gives at any parameters, beyond all errors."""
    from scipy.special import gammaincc

    draws, measured, size = posterior.thinned(DRAWS_NEAR_FAILURES), problem.measured, len(problem.measured)
    points, outputs = emulator.runs.good
    at_draws = likelihood.misfits(draws)
    of_discrepancy = np.tile(draws[int(at_draws.argmin()), points.shape[1] :], (len(points), 1))
    misfit = min(at_draws.min(), likelihood.misfits(np.hstack([points, of_discrepancy])).min())
    beyond = np.maximum(outputs.min(axis=0) - measured, measured - outputs.max(axis=0))
    is_out_of_reach = _is_out_of_reach(problem, beyond, np.ptp(outputs, axis=0))
    predicted = likelihood.predictions(draws, discrepancy=False, noise=False)[0]
    is_noise = _noise_is_misfit(problem, np.vstack([outputs, predicted]))
    if gammaincc(0.5 * size, 0.5 * misfit) > MIN_MISFIT_PROBABILITY and not is_out_of_reach and not is_noise:
        return
    scale = np.concatenate([
        np.full(stop - start, problem.noise_sd[name] or _rms(measured[start:stop]))
        for name, (start, stop) in problem.quantities.items()
    ])  # fmt: skip
    nearest = int(_rms((outputs - measured) / scale).argmin())
    worst = int(np.argmax(np.abs(outputs[nearest] - measured) / scale))
    name, (start, stop) = next(quantity for quantity in problem.quantities.items() if worst in range(*quantity[1]))
    off = _rms(outputs[nearest, start:stop] - measured[start:stop])
    named = [f"{symbol} {value:.3g}" for symbol, value in zip(problem.forward_symbols, points[nearest], strict=True)]
    away = np.sqrt(misfit / size)
    yield ResultWarning(
        f"{NO_PARAMETERS_FIT}: "
        + (
            "a discrepancy or a noise takes up the whole difference. "
            if away < 1 or is_noise
            else f"at best they are {away:.1f} standard deviations of noise, discrepancy and emulator away (root mean "
            "square; 1 is right). "
        )
        + f"Of {len(points)} runs the nearest ({', '.join(named)}) is off "
        f"by {off:.3g}{f' in {name}' if name else ''} (root mean square), most at the control "
        f"{problem.control[worst]:.4g}: measured {measured[worst]:.4g}, model {outputs[nearest, worst]:.4g}. "
        f"{(beyond > 0).sum()} of {size} measurements are "
        "beyond the outputs of all runs. Check the units of data and model, give wider priors, or allow for a wrong "
        "model (discrepancy gp-pinned).",
        "unmodelled-curve",
        Severity.PROBLEM,
    )


def _is_out_of_reach(problem: Problem, beyond: FloatArray, widths: FloatArray) -> bool:
    """Return whether what is unknown takes up a wrong model, by how far measurements (n,) are beyond all outputs.

    Outputs differ by ``widths`` (n,). A free process or an unknown noise does so where most are beyond; one that is
    pinned where all in the half of a quantity nearest to zero load, which it changes least, are beyond by more than the
    outputs differ.
    """
    if isinstance(problem.discrepancy, PinnedProcess):
        distance = np.abs(problem.control - problem.discrepancy.references[0])
        ends = [slice(*quantity) for quantity in problem.quantities.values()]
        return any((beyond > widths)[of][distance[of] <= np.median(distance[of])].all() for of in ends)
    is_absorbed = problem.discrepancy.is_correlated or None in problem.noise_sd.values()
    return bool(is_absorbed and (beyond > 0).mean() > MAX_SHARE_OUT_OF_REACH)


def _without_effect(problem: Problem, posterior: SampledPosterior, totals: Mapping[str, float]) -> Iterator[str]:
    """Yield the parameters on which the outputs do not depend, and that the measurements leave where they were."""
    for symbol, prior in problem.forward_priors.items():
        if totals[symbol] < MIN_EFFECT:
            prior_width, width = (of.quantile(0.75) - of.quantile(0.25) for of in (prior, posterior.marginals[symbol]))
            if width > MIN_SHARE_OF_PRIOR * prior_width:
                yield symbol


def _far_from_zero_load(problem: Problem) -> Iterator[ResultWarning]:
    """Yield a warning where a process is pinned so far from the measurements that it is free at all of them."""
    if not isinstance(problem.discrepancy, PinnedProcess):
        return
    zero_load = problem.discrepancy.references[0]
    for name, (start, stop) in problem.quantities.items():
        control = problem.control[start:stop]
        if is_far(control, zero_load):
            yield ResultWarning(
                f"gp-pinned is zero at the control {zero_load:g} (--zero-load), which is far from those "
                f"{f'of {name} ' if name else ''}that were measured, {control.min():.4g} to {control.max():.4g}: the "
                "discrepancy then takes a share of the initial stiffness, as gp does. Give the control at which there "
                "is no load: of stretches --zero-load 1.",
                "free-discrepancy",
            )


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((values**2).mean(axis=-1)))


def _noise_is_misfit(problem: Problem, predicted: FloatArray) -> bool:
    """Return whether an unknown noise stands for a difference that is no noise, of the nearest prediction of (N, n).

    Of a quantity without a discrepancy it is one that is large beside the measurements' scatter about a smooth curve.
    """
    for name in problem.without_discrepancy:
        start, stop = problem.quantities[name]
        control, measured = problem.control[start:stop], problem.measured[start:stop]
        scattered = scatter(control, measured)
        if problem.noise_sd[name] is None and scattered is not None:
            off = _rms(predicted[:, start:stop] - measured).min()
            if off > MAX_SCATTERS * scattered and off > MAX_SHARE_OFF * _rms(measured):
                return True
    return False


def _error_share(problem: Problem, emulator: Emulator, posterior: SampledPosterior) -> float:
    """Return the emulator's error at the posterior over the measurements (root mean squares), zero below the noise.

    The largest of all quantities.
    """
    draws, share = posterior.thinned(DRAWS_NEAR_FAILURES), 0.0
    variances = np.diagonal(emulator.moments(draws[:, : len(problem.forward_symbols)])[1], axis1=1, axis2=2)
    for name, (start, stop) in problem.quantities.items():
        error = float(np.median(np.sqrt(variances[:, start:stop].mean(axis=1))))
        noise_sd = problem.noise_sd[name] or posterior.marginals[symbol_of(NOISE_SD.symbol, name)].mean
        if error > noise_sd:
            share = max(share, error / float(_rms(problem.measured[start:stop])))
    return share


def _large_error(
    problem: Problem,
    posterior: SampledPosterior,
    exact: SampledPosterior,
    emulator_share: Mapping[str, float],
    error_share: float,
) -> Iterator[ResultWarning]:
    """Yield a warning where the emulator's error widens or shifts the posterior notably, or hides all there is."""
    forward = problem.forward_symbols
    shifts = {
        symbol: abs(exact.marginals[symbol].mean - marginal.mean) / marginal.sd
        for symbol, marginal in posterior.marginals.items()
    }
    largest_share = max(forward, key=lambda symbol: emulator_share[symbol])
    largest_shift = max(forward, key=lambda symbol: shifts[symbol])
    advice = "Give more runs, or let some be placed where the posterior is (refine)."
    if emulator_share[largest_share] > MIN_EMULATOR_SHARE:
        yield ResultWarning(
            f"the emulator's error is large beside the noise: it makes {100 * emulator_share[largest_share]:.0f} % of "
            f"the posterior variance of {largest_share}. {advice}",
            "inaccurate-emulator",
        )
    elif shifts[largest_shift] > MAX_MEAN_SHIFT:
        shift = shifts[largest_shift]
        multiple = f"{shift:.1f}" if shift < MAX_SHIFT_IN_SDS else f"more than {MAX_SHIFT_IN_SDS}"
        yield ResultWarning(
            f"the emulator's error is large beside the noise: it shifts the mean of {largest_shift} by {multiple} "
            f"standard deviations. {advice}",
            "inaccurate-emulator",
        )
    elif error_share > MAX_ERROR_SHARE:
        yield ResultWarning(
            "the emulator's error is larger than the noise where the posterior is: "
            f"{100 * error_share:.0f} % of the measurements (root mean square), so that these tell little of the "
            f"parameters. {advice} Priors over which the outputs differ by powers of ten need narrower ones.",
            "inaccurate-emulator",
        )


def _over_confident(check: EmulatorCheck) -> Iterator[ResultWarning]:
    """Yield a warning where the errors of the emulator are larger than it says."""
    if check.rms_standardised > MAX_RMS_STANDARDISED:
        yield ResultWarning(
            "the emulator is over-confident: runs predicted from the others are off by "
            f"{check.rms_standardised:.1f} of its standard deviations (root mean square; 1 is right). Where the model "
            "is not smooth in its parameters, try the kernel matern-5/2; otherwise give more runs.",
            "inaccurate-emulator",
        )


def _share_near_failures(emulator: Emulator, posterior: SampledPosterior) -> float:
    """Return the share of the posterior whose nearest run failed, in the unit box of the runs."""
    runs, coordinates = emulator.runs, emulator.coordinates
    draws = posterior.thinned(DRAWS_NEAR_FAILURES)[:, : len(runs.symbols)]
    run_points, draw_points = coordinates.of(runs.points), coordinates.of(draws)
    nearest = ((draw_points[:, None] - run_points[None]) ** 2).sum(axis=2).argmin(axis=1)
    return float(runs.failed[nearest].mean())


def _at_ends(problem: Problem, emulator: Emulator, posterior: SampledPosterior) -> tuple[Ends, Ends]:
    """Return where the posterior is at bounds of priors, and where more of it than of the prior is beyond all runs.

    Where runs of a narrower prior are all that the emulator knows, any of it.
    """
    at_bounds, beyond_runs = Ends(), Ends()
    for symbol, column in zip(problem.forward_symbols, emulator.runs.points.T, strict=True):
        prior, values = problem.priors[symbol], posterior.values[:, problem.symbols.index(symbol)]
        prior_values = np.asarray(prior.quantile((np.arange(PRIOR_POINTS) + 0.5) / PRIOR_POINTS))
        run_ends, signs = (float(column.min()), float(column.max())), (1.0, -1.0)
        edge = EDGE_WIDTH * (run_ends[1] - run_ends[0])
        for end, bound, run_end, sign in zip(("lower", "upper"), prior.support, run_ends, signs, strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                is_cut = np.isfinite(prior.log_density(bound))
            at_bound = posterior.weights[sign * (values - bound) < edge].sum() if is_cut else 0.0
            beyond = posterior.weights[sign * (values - run_end) < 0].sum()
            of_prior = float((sign * (prior_values - run_end) < 0).mean())
            are_of_another = of_prior > MAX_LEFT_OUT
            if at_bound > MAX_EDGE_PROBABILITY:
                at_bounds.append((symbol, end))
            if (are_of_another or not is_cut) and beyond > MAX_EDGE_PROBABILITY + of_prior * (not are_of_another):
                beyond_runs.append((symbol, end))
    return at_bounds, beyond_runs


def _listed(ends: Ends) -> str:
    return ", ".join(f"{symbol} ({end})" for symbol, end in ends)
