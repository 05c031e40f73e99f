"""Two tests of uniform probabilities, each of a known size."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["ecdf_band", "shape_p_value", "spread_p_value"]

FloatArray = NDArray[np.float64]

POINTS = 100
SIMULATIONS = 9_999


def ecdf_band(count: int, prob: float = 0.95) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return probabilities, and the band that with ``prob`` holds the whole ECDF of ``count`` uniform values there.

    Between quantiles of the binomial distribution at each place, as wide as it takes for all places together.

    References
    ----------
    Säilynoja, Bürkner & Vehtari (2022), Statistics and Computing 32:32; the level is found by simulation.
    """
    from scipy.stats import binom

    places = _places()
    level = np.quantile(_least_of_uniform(count), 1 - prob, method="lower")
    return places, binom.ppf(0.5 * level, count, places) / count, binom.isf(0.5 * level, count, places) / count


def shape_p_value(probabilities: FloatArray) -> float:
    """Return the p value of values being uniform, by how far their ECDF leaves it anywhere; exact but for ties."""
    below = (probabilities[:, None] <= _places()).sum(axis=0)
    found = _least(below[None], len(probabilities))[0]
    smaller = int((_least_of_uniform(len(probabilities)) <= found * (1 + 1e-9)).sum())
    return (1 + smaller) / (1 + SIMULATIONS)


def spread_p_value(probabilities: FloatArray) -> float:
    """Return the p value (two-sided) of the normal scores of values having unit variance: too narrow, too wide."""
    from scipy.special import ndtri
    from scipy.stats import chi2

    scores = ndtri(np.clip(probabilities, 1e-9, 1 - 1e-9))
    squares = float(scores @ scores)
    return float(2 * min(chi2.cdf(squares, len(scores)), chi2.sf(squares, len(scores))))


def _places() -> FloatArray:
    return np.arange(1, POINTS) / POINTS


@lru_cache(maxsize=64)
def _least_of_uniform(count: int) -> FloatArray:
    """Return the test statistic of simulated uniform values."""
    generator = np.random.default_rng(0)
    below = generator.multinomial(count, np.full(POINTS, 1 / POINTS), size=SIMULATIONS).cumsum(axis=1)[:, :-1]
    return _least(below, count)


def _least(below: NDArray[np.int64], count: int) -> FloatArray:
    """Return the least of the two-sided binomial probabilities of counts below each place (m, POINTS - 1)."""
    from scipy.stats import binom

    every = np.arange(count + 1)[:, None]
    tails = 2 * np.minimum(binom.cdf(every, count, _places()), binom.sf(every - 1, count, _places()))
    return np.asarray(tails[below, np.arange(POINTS - 1)].min(axis=1))
