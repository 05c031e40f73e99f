"""Warnings about priors: that they determine the result, that they are sharp, and that their bounds cut it off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tissuq.assessment.modulus import modulus_symbols
from tissuq.assessment.sensitivity import MIN_SENSITIVITY, power_scaling
from tissuq.inference.solution import Solution
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Interval, Uniform
from tissuq.result_warning import ResultWarning

ONE_SD_EITHER_SIDE, SHARP = (0.16, 0.84), 2.0
"""Probabilities between which a prior is twice as wide as its standard deviation; this over that of the error that all
tests have in common, below which the prior is sharp."""
MAX_DENSITY_AT_BOUND = 0.1
"""Marginal density at a prior bound, over its largest value, above which the bound determines the result."""


def influence_of_priors(solution: Solution) -> str:
    """Return in words that priors which were given, no bounds alone, determine the modulus as much as the data do."""
    model = solution.model
    symbols = [symbol for symbol in modulus_symbols(model) if symbol in model.chosen_priors]
    if all(isinstance(model.chosen_priors[symbol], Uniform) for symbol in symbols):
        return ""
    sensitivity = power_scaling(solution)
    if sensitivity is None or sensitivity.prior < MIN_SENSITIVITY:
        return ""
    words = f"the prior that was given for {' and '.join(symbols)} determines the result "
    if sensitivity.likelihood < MIN_SENSITIVITY:
        return words + "more than the data do: without it the result would be another one, unless both agree."
    return words + "as much as the data do, and the two may contradict each other: see what the data say without it."


def is_sharp(solution: Solution, symbol: str) -> bool:
    """Return whether a prior that was given, no bounds alone, is as sharp as the error that all tests share."""
    model = solution.model
    prior = model.chosen_priors.get(symbol)
    if prior is None or isinstance(prior, Interval):
        return False
    low, high = prior.quantile(np.array(ONE_SD_EITHER_SIDE))
    error = model.common_error * abs(float(solution.marginals[symbol].quantile(0.5)))
    return bool(0.5 * (high - low) < SHARP * error)


def sharp_prior(model: StatisticalModel, symbols: Sequence[str]) -> ResultWarning:
    """Return the warning about priors that are as sharp as that error."""
    names = " and ".join(symbols)
    return ResultWarning(
        f"the prior that was given for {names} is weighed against the stress as measured, and the error that all tests "
        f"have in common ({100 * model.common_error:.2g} %) is added afterwards: the interval is wider than prior and "
        "data allow together, and may lie beside the prior. Fit without it, and weigh both by the inverse of their "
        "variances.",
        "sharp-prior",
    )


def cut_by_prior(solution: Solution) -> Iterator[tuple[str, str]]:
    """Yield the parameters whose posterior density is high at a bound that only the prior sets, and which bound."""
    for parameter in solution.model.parameters:
        marginal = solution.marginals[parameter.symbol]
        ends = zip(("lower", "upper"), solution.model.priors[parameter.symbol].support, parameter.support, strict=True)
        for name, bound, natural in ends:
            inside = bound + (1e-3 if name == "lower" else -1e-3) * marginal.sd
            if bound != natural and marginal.pdf(inside) > MAX_DENSITY_AT_BOUND * marginal.density.max():
                yield parameter.symbol, name
