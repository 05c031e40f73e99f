"""The band of a quantity over draws, and what its variance is due to, with the errors of a finite number of draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError

__all__ = ["PROBABILITY", "Band", "Shares", "band_of", "held_probability", "shares_of", "standard_errors"]

FloatArray = NDArray[np.float64]

PROBABILITY = 0.95
RESAMPLES = 400
"""Of the draws, with replacement, for the errors."""


@dataclass(frozen=True)
class Band:
    """Over draws, one value a step: arrays (s,)."""

    mean: FloatArray
    sd: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class Shares:
    """Of the variance of a new measurement; they add up to one, and single ones can be negative or above one.

    With Q a draw's quantity and Q0 that of its parameters alone, Var Q = Cov(Q, Q0) + Cov(Q, Q - Q0): the parameters'
    part and the discrepancy's. A negative one says that the two compensate each other in the posterior.

    Attributes
    ----------
    parameters, discrepancy, noise : (s,) arrays
    correlation : (s,) array
        Of Q0 and Q - Q0; not a number without discrepancy.

    References
    ----------
    Li et al. (2010), Global sensitivity analysis for systems with independent and/or correlated inputs.
    """

    parameters: FloatArray
    discrepancy: FloatArray
    noise: FloatArray
    correlation: FloatArray


def held_probability(draws: int) -> float:
    """Return the probability that a band of so many draws holds: 95 %, or what the range of fewer than 39 draws holds.

    Examples
    --------
    >>> held_probability(64), round(held_probability(16), 2)
    (0.95, 0.88)
    """
    return min(PROBABILITY, (draws - 1) / (draws + 1))


def band_of(values: FloatArray) -> Band:
    """Return mean, sd and the ends of the central interval of draws (N, s), which holds `held_probability`.

    Raises
    ------
    InputError
        When there are fewer than two draws.
    """
    if len(values) < 2:
        raise InputError(f"a band needs two draws or more, and there are {len(values)}.")
    tail = (1 - held_probability(len(values))) / 2
    low, high = np.quantile(values, [tail, 1 - tail], axis=0, method="weibull")
    return Band(values.mean(axis=0), values.std(axis=0, ddof=1), low, high)


def shares_of(complete: FloatArray, alone: FloatArray, noise_sd: float = 0.0) -> Shares:
    """Return what the variance of draws (N, s) is due to, given the same draws (N, s) without their discrepancy."""
    centred, own = complete - complete.mean(axis=0), alone - alone.mean(axis=0)
    rest = centred - own
    total = (centred**2).mean(axis=0) * len(complete) / (len(complete) - 1) + noise_sd**2
    parts = [(centred * each).sum(axis=0) / (len(complete) - 1) for each in (own, rest)]
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.sqrt((own**2).sum(axis=0) * (rest**2).sum(axis=0))
        correlation = (own * rest).sum(axis=0) / size
        return Shares(parts[0] / total, parts[1] / total, noise_sd**2 / total, correlation)


def standard_errors(
    statistics: Callable[..., Mapping[str, FloatArray]], *draws: FloatArray, seed: int = 0
) -> dict[str, FloatArray]:
    """Return the bootstrap's standard errors of statistics of draws (N, s), of which all arrays are resampled alike.

    Draws of a quasi-random sequence have smaller errors than that.
    """
    generator, count = np.random.default_rng(seed), len(draws[0])
    found: dict[str, list[FloatArray]] = {}
    for _ in range(RESAMPLES):
        chosen = generator.integers(count, size=count)
        for name, value in statistics(*(each[chosen] for each in draws)).items():
            found.setdefault(name, []).append(value)
    return {name: np.std(each, axis=0, ddof=1) for name, each in found.items()}
