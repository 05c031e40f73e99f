"""Sensitivity of a parameter and of the evidence to the priors: power-scaling, and other widths of the priors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.inference.solution import Solution
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Flat, Prior, Uniform
from tissuq.prediction.densities import joint_log_likelihood, stride

SCALE_FACTORS: dict[str, float] = {"quarter": 0.25, "fourfold": 4.0}
"""Factors of the prior scales of the discrepancy's amplitudes for which the influence of these priors is given."""
POWERS = (0.99, 1.01)
"""Powers of prior and likelihood from which the sensitivities are taken; those of ArviZ."""
MIN_SENSITIVITY = 0.05
"""Smallest sensitivity that matters (Kallioinen, Paananen, Bürkner & Vehtari 2024)."""
MAX_END_DENSITY = 1e-3
"""Largest density at the end of a uniform prior, over the maximum, for which the end has no influence."""


@dataclass(frozen=True)
class PowerScaling:
    """How fast a parameter's posterior changes as its prior, or the likelihood, is raised to a power.

    Cumulative Jensen-Shannon distance for each doubling of the power, at the power one.
    """

    prior: float
    likelihood: float

    def sentence(self, parameter: str) -> str:
        """Return the numbers and their meaning in words."""
        numbers = f"power-scaling sensitivity: prior {self.prior:.2f}, likelihood {self.likelihood:.2f}"
        if self.prior < MIN_SENSITIVITY:
            if self.likelihood < MIN_SENSITIVITY:
                return f"neither the priors nor the data have much influence on {parameter} ({numbers})"
            return f"what is known of {parameter} is from the data, not from the shapes of the priors ({numbers})"
        if self.likelihood < MIN_SENSITIVITY:
            return (
                f"the priors influence {parameter} more than the data do ({numbers}): measure more, or justify the "
                "priors"
            )
        return (
            f"both the priors and the data influence {parameter} ({numbers}), and they may contradict each other: "
            "give priors that you can justify, or measure more"
        )


def power_scaling(solution: Solution) -> PowerScaling | None:
    """Return the sensitivity of the headline parameter to prior and likelihood; None for very many measurements.

    The likelihood is the joint one of linear and nonlinear parameters, with the discrepancy's random part among
    the errors: the amplitudes and noise are parameters, the discrepancy itself is none, and its distribution
    given them is not scaled with the priors. Sums and length scales of an average have uniform priors, which no
    power changes. Nor does a power move the ends of a uniform box: their influence is given by other widths.

    References
    ----------
    Kallioinen, Paananen, Bürkner & Vehtari (2024), Statistics and Computing 34, 57.
    """
    if solution.model.condensed is None and stride(solution) > 1:
        return None
    values = solution.draws[solution.model.headline].ravel()
    return PowerScaling(
        _sensitivity(values, _log_prior(solution).ravel()),
        _sensitivity(values, joint_log_likelihood(solution).ravel()),
    )


def scale_symbols(model: StatisticalModel) -> tuple[str, ...]:
    """Return the parameters that set the size of a discrepancy's random part."""
    return tuple(p.symbol for p in model.discrepancy.parameters if p.unit and p.symbol in model.nonlinear)


def rescaled(model: StatisticalModel, factor: float) -> StatisticalModel:
    """Return the model with the prior scales of its discrepancy's random part multiplied by a factor."""
    scaled_priors = {symbol: model.priors[symbol].scaled(factor) for symbol in scale_symbols(model)}
    return replace(model, chosen_priors=model.priors | scaled_priors)


def known_evidence_changes(solution: Solution) -> dict[str, float]:
    """Return changes of the log evidence with the priors that need no other fit.

    boxes: with uniform priors of the linear parameters four times as wide, where their ends have no influence and
    nothing else bounds the prior. quarter and fourfold, of the prior scales of the discrepancy's random part: zero
    where it has none.
    """
    model = solution.model
    changes: dict[str, float] = {}
    if solution.log_evidence is None:
        return changes
    boxes = [symbol for symbol in model.linear if isinstance(model.priors[symbol], Uniform)]
    if not solution.stable_in and not any(_cuts(solution, symbol) for symbol in boxes):
        changes["boxes"] = -log(4.0) * len(boxes)
    if not scale_symbols(model):
        changes |= dict.fromkeys(SCALE_FACTORS, 0.0)
    return changes


def _cuts(solution: Solution, symbol: str) -> bool:
    """Return whether an end of a box that is not a natural bound of the parameter cuts its posterior."""
    marginal = solution.marginals[symbol]
    parameter = next(p for p in solution.model.parameters if p.symbol == symbol)
    ends = zip(solution.model.priors[symbol].support, parameter.support, strict=True)
    at_ends = [float(marginal.pdf(prior_end)) for prior_end, natural_end in ends if prior_end != natural_end]
    return max(at_ends, default=0.0) > MAX_END_DENSITY * float(marginal.density.max())


def _log_prior(solution: Solution) -> FloatArray:
    """Return the log prior (chains, draws) of every draw."""
    model, total = solution.model, np.zeros(solution.shape)
    for symbol, drawn in solution.draws.items():
        prior = model.priors[symbol]
        if isinstance(prior, Flat | Uniform):
            continue
        # A member of an average without this amplitude: its expected log density, so that no unit matters.
        is_missing = (drawn == 0) & (symbol in model.energy_symbols)
        log_density = prior.log_density(np.where(is_missing, prior.quantile(0.5), drawn))
        total += np.where(is_missing, _expected_log_density(prior), log_density)
    return total


def _expected_log_density(prior: Prior) -> float:
    values = prior.quantile((np.arange(2000) + 0.5) / 2000)
    return float(np.mean(prior.log_density(values)))


def _sensitivity(values: FloatArray, log_density: FloatArray) -> float:
    """Return how fast draws (D,), weighted by the power of a density less one, change with that power."""
    order = np.argsort(values)
    ascending, deviation = values[order], log_density[order] - log_density.max()
    speeds = []
    for power in POWERS:
        weights = np.exp((power - 1) * deviation)
        weights = weights / float(weights.sum())
        distance = max(_distance(ascending, weights), _distance(-ascending[::-1], weights[::-1]))
        speeds.append(distance / abs(float(np.log2(power))))
    return float(np.mean(speeds))


def _distance(values: FloatArray, weights: FloatArray) -> float:
    """Return the cumulative Jensen-Shannon distance between ascending draws (D,) and the same draws weighted."""
    gaps = np.diff(values)
    empirical, reweighted = np.arange(1, len(values)) / len(values), np.cumsum(weights)[:-1]
    middle = 0.5 * (empirical + reweighted)
    divergence = float(gaps @ (empirical * np.log2(empirical / middle) + reweighted * np.log2(reweighted / middle)))
    size = float(gaps @ (empirical + reweighted))  # the terms that make each divergence positive cancel in their sum
    return float(np.sqrt(max(divergence, 0.0) / size)) if size > 0 else 0.0
