"""What a reader of a posterior must know before using it, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite

import numpy as np

from tissuq.assessment.extent import has_energy
from tissuq.assessment.stability import LOST, StableRange
from tissuq.assessment.stable_posterior import StableSolution
from tissuq.inference.solution import Solution
from tissuq.prediction.moments import mean_curve

__all__ = ["warnings_about"]

INSEPARABLE = 0.1
"""Noise and discrepancy are inseparable when either may be less than this share of both (5 % of the draws each)."""
ROUGH = 0.1
"""Error of the log evidence, by integration, above which nothing rests on it."""
VAGUE = 1.0
"""Width of the headline parameter's 95 % interval, over its median, above which it is hardly known."""
UNSTABLE = 0.5
"""Probability of stability over the measured range below which a simulation is likely to fail."""
HIGH = 0.1
"""Density at a bound, relative to the largest, above which the bound decides."""

SOME, MOST_VALUES, FEWEST = 200, 4_000_000, 12
"""Components whose mean the residuals are from, and values at once; measurements from which they tell something."""
NOTABLE, BEYOND_CHANCE = 0.3, 4.0
"""Correlation of consecutive residuals worth a word; standard errors beyond which it is no chance."""


def warnings_about(solution: Solution, ranges: Mapping[str, StableRange]) -> Iterator[str]:
    """Yield the warnings that a posterior carries, the gravest first."""
    if solution.is_approximate and solution.diagnostics is not None:
        yield solution.diagnostics.verdict
    if ranges and min(found.probability for found in ranges.values()) < UNSTABLE:
        yield _instability(solution, min(ranges.values(), key=lambda found: found.probability))
    if isinstance(solution, StableSolution) and solution.share < LOST:
        yield (
            "the data contradict what was asked for: without stable_in a share of "
            f"{solution.share:.1g} of the posterior would be stable. What is left describes them less well."
        )
    if solution.model.discrepancy.is_best_fit:
        yield solution.model.discrepancy.caution
    if solution.model.confounds_noise:
        yield (
            "noise_sd and S are both unknown, and only noise_sd^2 + S^2 is in the data: read neither alone, or give "
            "the noise (repeated measurements at one stretch tell it: noise 'repeats')."
        )
    elif _noise_is_inseparable(solution):
        yield (
            "the data do not tell noise from discrepancy: the more there is of one, the less of the other. Read "
            "neither alone, or give the noise (repeated measurements at one stretch tell it)."
        )
    error = solution.log_evidence_error
    if error is not None and not error <= ROUGH and solution.diagnostics is None:
        size = f"is off by about {error:.1g}" if isfinite(error) else "is not known"
        yield (
            f"the sums behind this posterior are rough (the log evidence {size}), as where the "
            "noise that was given is far smaller than the scatter of the data: give a larger one, or leave it unknown."
        )
    together = _correlation(solution)
    if together is not None:
        yield (
            f"consecutive residuals hang together (correlation {together:.2f}), so that the measurements are not "
            "independent and the intervals too narrow: fit with the noise 'autoregressive', or with fewer points."
        )
    headline = solution.model.headline
    low, high = solution.marginals[headline].hdi()
    if high - low > VAGUE * abs(float(solution.marginals[headline].quantile(0.5))):
        yield (
            f"the data say little of {headline}: its 95 % interval is wider than its median is large. Measure more, "
            "nearer stretch 1, or with less noise."
        )
    cut = [f"{symbol} ({end})" for symbol, end in _cut_by_prior(solution)]
    if cut:
        yield (
            f"the posterior is cut by a bound of the prior of {', '.join(cut)}: there the bound, not the data, "
            "decides. Give a wider prior, unless the bound is meant."
        )


def _instability(solution: Solution, found: StableRange) -> str:
    """Return what it means that a material is hardly ever stable, in the loading mode in which it is least."""
    what = "material and discrepancy together are" if has_energy(solution.model) else "the material is"
    how = "hardly ever stable" if found.probability < LOST else "less often stable than not"
    where = " (already at rest: its initial shear modulus is negative)" if found.loss.median == 1 else ""
    return (
        f"over the measured range {what} {how}{where}, so that no simulation with these parameters can be trusted: "
        "measure in more loading modes, choose another material, or leave out what is not stable (stable_in)."
    )


def _noise_is_inseparable(solution: Solution) -> bool:
    """Return whether the noise may be almost all or almost nothing of the variance that both have together."""
    model = solution.model
    is_free = any(parameter.symbol in model.nonlinear for parameter in model.discrepancy.parameters)
    if not model.noise.parameters or not is_free:
        return False
    values = {symbol: drawn.ravel() for symbol, drawn in solution.draws.items()}
    noise = model.noise_variance(values, float(model.levels.mean()) if model.noise.depends_on_level else 0.0)
    own = model.discrepancy.independent_variance(values) + model.discrepancy.correlated_variance(values)
    low, high = np.quantile(noise / (noise + own), [0.05, 0.95])
    return bool(low < INSEPARABLE and high > 1 - INSEPARABLE)


def _correlation(solution: Solution) -> float | None:
    """Return the correlation of consecutive residuals, whitened, where it is beyond chance; None where it is not."""
    model, whole = solution.model, []
    if model.is_correlated or len(model.experiment) < FEWEST:
        return None
    some = int(np.clip(MOST_VALUES // len(model.experiment), 1, SOME))
    residual = model.stress - np.asarray(model.white(mean_curve(solution, thinned=some)))
    start = 0
    for _, _, stress in model.experiment.curves:
        whole.append(residual[start : start + len(stress)])
        start += len(stress)
    size = sum(float(each @ each) for each in whole)
    found = sum(float(each[1:] @ each[:-1]) for each in whole) / size if size else 0.0
    return found if found > max(NOTABLE, BEYOND_CHANCE / np.sqrt(len(residual))) else None


def _cut_by_prior(solution: Solution) -> Iterator[tuple[str, str]]:
    """Yield the parameters whose posterior is still high at a bound that only the prior sets, and which bound."""
    for parameter in solution.model.parameters:
        marginal = solution.marginals[parameter.symbol]
        ends = zip(("lower", "upper"), solution.model.priors[parameter.symbol].support, parameter.support, strict=True)
        for name, chosen, natural in ends:
            inside = chosen + (1e-3 if name == "lower" else -1e-3) * marginal.sd
            if chosen != natural and marginal.pdf(inside) > HIGH * marginal.density.max():
                yield parameter.symbol, name
