"""Summary of a simulation-based calibration, with two tests of uniform ranks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.validation.sbc.settings import SbcSettings

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["SIZE", "ecdf_band", "probabilities_of", "shape_p_value", "spread_p_value", "summarise_ranks"]

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

    grid = _places()
    level = np.quantile(_least_of_uniform(count), 1 - prob, method="lower")
    return grid, binom.ppf(0.5 * level, count, grid) / count, binom.isf(0.5 * level, count, grid) / count


def shape_p_value(probabilities: FloatArray) -> float:
    """Return the p value of values being uniform, by how far their ECDF leaves it anywhere; exact but for ties."""
    counts = (probabilities[:, None] <= _places()).sum(axis=0)
    lowest = _least(counts[None], len(probabilities))[0]
    smaller = int((_least_of_uniform(len(probabilities)) <= lowest * (1 + 1e-9)).sum())
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
    counts = generator.multinomial(count, np.full(POINTS, 1 / POINTS), size=SIMULATIONS).cumsum(axis=1)[:, :-1]
    return _least(counts, count)


def _least(counts: NDArray[np.int64], count: int) -> FloatArray:
    """Return the least of the two-sided binomial probabilities of counts below each place (m, POINTS - 1)."""
    from scipy.stats import binom

    hits = np.arange(count + 1)[:, None]
    tails = 2 * np.minimum(binom.cdf(hits, count, _places()), binom.sf(hits - 1, count, _places()))
    return np.asarray(tails[counts, np.arange(POINTS - 1)].min(axis=1))


SIZE = 0.05
"""Probability that any parameter is marked if all are calibrated."""


def probabilities_of(
    settings: SbcSettings, results: Sequence[dict[str, Any]]
) -> Mapping[tuple[str, str, str], NDArray[np.float64]]:
    """Return the probabilities below the truth by formulation, noise and parameter; nan where a fit failed."""
    ranks: dict[tuple[str, str, str], list[float]] = {}
    for result in results:
        setting = settings.formulations[result["formulation"]], settings.noise[result["noise"]]
        for symbol, probabilities in result["below"].items():
            ranks.setdefault((*setting, symbol), []).extend(
                np.nan if value is None else value for value in probabilities
            )
    return {setting: np.array(values) for setting, values in ranks.items()}


def summarise_ranks(settings: SbcSettings, results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a formulation, noise and parameter.

    Columns: fits, failed; mean, of the posterior probability below the truth (0.5 when right); spread, the standard
    deviation of its normal score (1 when right; more, posteriors are too narrow); p_shape and p_spread, of the tests
    in `tissuq.validation.sbc.summary`; calibrated, whether both are at least 0.05 over the number of all tests, so
    that the chance is 5 % at most that any row is marked when all is right.
    """
    import pandas as pd
    from scipy.special import ndtri

    rows = []
    for (formulation, noise, symbol), ranks in probabilities_of(settings, results).items():
        valid = ranks[np.isfinite(ranks)]
        rows.append(
            {
                "formulation": formulation,
                "noise": noise,
                "parameter": symbol,
                "fits": len(valid),
                "failed": len(ranks) - len(valid),
                "mean": valid.mean(),
                "spread": np.sqrt(np.mean(ndtri(np.clip(valid, 1e-9, 1 - 1e-9)) ** 2)),
                "p_shape": shape_p_value(valid),
                "p_spread": spread_p_value(valid),
            }
        )
    table = pd.DataFrame(rows)
    table["calibrated"] = table[["p_shape", "p_spread"]].min(axis=1) >= SIZE / (2 * len(table))
    return table
