"""What priors do to a parameter and to the evidence: power-scaling, and other widths of the priors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.solution import Solution
from tissuq.model import StatisticalModel
from tissuq.prediction.densities import joint_log_likelihood
from tissuq.prediction.replicates import stride
from tissuq.priors import Flat, Prior, Uniform

__all__ = ["SCALES", "PowerScaling", "known_evidence_changes", "power_scaling", "rescaled", "scale_symbols"]

FloatArray = NDArray[np.float64]

SCALES: dict[str, float] = {"quarter": 0.25, "fourfold": 4.0}
"""Factors of the scales of the discrepancy's amplitudes with which their priors' influence is told."""
ALPHAS = (0.99, 1.01)
"""Powers of prior and likelihood from which the sensitivities are taken; those of ArviZ."""
THRESHOLD = 0.05
"""Sensitivity from which it counts (Kallioinen, Paananen, Bürkner & Vehtari 2024)."""
SHUT = 1e-3
"""Density at the end of a box, relative to the largest, below which the box is as good as infinite."""


@dataclass(frozen=True)
class PowerScaling:
    """How fast a parameter's posterior changes as its prior, or the likelihood, is raised to a power.

    Cumulative Jensen-Shannon distance for each doubling of the power, at the power one.
    """

    prior: float
    likelihood: float

    def sentence(self, parameter: str) -> str:
        """Return the numbers and what they mean, for a person."""
        numbers = f"power-scaling sensitivity: prior {self.prior:.2f}, likelihood {self.likelihood:.2f}"
        if self.prior < THRESHOLD:
            if self.likelihood < THRESHOLD:
                return f"neither the priors nor the data move {parameter} much ({numbers}): read its interval as it is"
            return f"the data decide {parameter}, the shapes of the priors hardly ({numbers})"
        if self.likelihood < THRESHOLD:
            return (
                f"the priors decide {parameter} more than the data do ({numbers}): measure more, or defend the priors"
            )
        return (
            f"both the priors and the data move {parameter} ({numbers}), which may be at odds: "
            "give priors that you can defend, or measure more"
        )


def power_scaling(solution: Solution) -> PowerScaling | None:
    """Return the sensitivity of the headline parameter to prior and likelihood; None for very many measurements.

    The likelihood is the joint one of linear and nonlinear parameters, with the discrepancy's random part among
    the errors: the amplitudes and noise are parameters, the discrepancy itself is none, and its distribution
    given them is not scaled with the priors. Sums and length scales of an average have uniform priors, which no
    power changes. Nor does a power move the ends of a uniform box: those are told by other widths.

    References
    ----------
    Kallioinen, Paananen, Bürkner & Vehtari (2024), Statistics and Computing 34, 57.
    """
    if stride(solution) > 1:
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
    other = {symbol: model.priors[symbol].scaled(factor) for symbol in scale_symbols(model)}
    return replace(model, chosen_priors=model.priors | other)


def known_evidence_changes(solution: Solution) -> dict[str, float]:
    """Return changes of the log evidence with the priors that need no other fit.

    boxes: were the uniform boxes of the linear parameters four times as wide, where they do not cut and nothing but
    them bounds the prior. quarter and
    fourfold, of the prior scales of the discrepancy's random part: zero where it has none.
    """
    model = solution.model
    found: dict[str, float] = {}
    if solution.log_evidence is None:
        return found
    boxes = [symbol for symbol in model.linear if isinstance(model.priors[symbol], Uniform)]
    if not solution.stable_in and not any(_cuts(solution, symbol) for symbol in boxes):
        found["boxes"] = -log(4.0) * len(boxes)
    if not scale_symbols(model):
        found |= dict.fromkeys(SCALES, 0.0)
    return found


def _cuts(solution: Solution, symbol: str) -> bool:
    """Return whether an end of a box that is not a natural bound of the parameter cuts its posterior."""
    marginal = solution.marginals[symbol]
    parameter = next(p for p in solution.model.parameters if p.symbol == symbol)
    ends = zip(solution.model.priors[symbol].support, parameter.support, strict=True)
    at_ends = [float(marginal.pdf(chosen)) for chosen, natural in ends if chosen != natural]
    return max(at_ends, default=0.0) > SHUT * float(marginal.density.max())


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
    for alpha in ALPHAS:
        weights = np.exp((alpha - 1) * deviation)
        weights = weights / float(weights.sum())
        distance = max(_distance(ascending, weights), _distance(-ascending[::-1], weights[::-1]))
        speeds.append(distance / abs(float(np.log2(alpha))))
    return float(np.mean(speeds))


def _distance(values: FloatArray, weights: FloatArray) -> float:
    """Return the cumulative Jensen-Shannon distance between ascending draws (D,) and the same draws weighted."""
    gaps = np.diff(values)
    first, second = np.arange(1, len(values)) / len(values), np.cumsum(weights)[:-1]
    between = 0.5 * (first + second)
    divergence = float(gaps @ (first * np.log2(first / between) + second * np.log2(second / between)))
    size = float(gaps @ (first + second))  # the terms that make each divergence positive cancel in their sum
    return float(np.sqrt(max(divergence, 0.0) / size)) if size > 0 else 0.0
