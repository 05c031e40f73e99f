"""The band of a quantity over draws, and what its variance is due to, with the errors of a finite number of draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "BAND",
    "PROBABILITY",
    "SHARES",
    "Band",
    "Shares",
    "band_of",
    "band_probability",
    "force_table",
    "shares_of",
    "standard_errors",
]

FloatArray = NDArray[np.float64]

PROBABILITY = 0.95
BOOTSTRAP_RESAMPLES = 400
"""Number of bootstrap resamples of the draws for standard errors."""


@dataclass(frozen=True)
class Band:
    """Mean, sd and interval of draws at every step: arrays (s,)."""

    mean: FloatArray
    sd: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class Shares:
    """Shares of the variance of a new measurement; they add up to one, and a single one can be negative or above one.

    With Q a draw's quantity and Q0 that of its parameters alone, Var Q = Cov(Q, Q0) + Cov(Q, Q - Q0): the parameters'
    part and the discrepancy's. A negative one means that the two compensate each other in the posterior.

    Attributes
    ----------
    parameters, discrepancy, noise : (s,) arrays
    correlation : (s,) array
        Correlation of Q0 and Q - Q0; not a number without discrepancy.

    References
    ----------
    Li et al. (2010), Global sensitivity analysis for systems with independent and/or correlated inputs.
    """

    parameters: FloatArray
    discrepancy: FloatArray
    noise: FloatArray
    correlation: FloatArray


def band_probability(draws: int) -> float:
    """Return the probability that a band of so many draws holds: 95 %, or what the range of fewer than 39 draws holds.

    Examples
    --------
    >>> band_probability(64), round(band_probability(16), 2)
    (0.95, 0.88)
    """
    return min(PROBABILITY, (draws - 1) / (draws + 1))


def band_of(values: FloatArray) -> Band:
    """Return mean, sd and the ends of the central interval of draws (N, s), which holds `band_probability`.

    Raises
    ------
    InputError
        When there are fewer than two draws.
    """
    if len(values) < 2:
        raise InputError(f"a band needs two draws or more, and there are {len(values)}.")
    tail = (1 - band_probability(len(values))) / 2
    low, high = np.quantile(values, [tail, 1 - tail], axis=0, method="weibull")
    return Band(values.mean(axis=0), values.std(axis=0, ddof=1), low, high)


def shares_of(complete: FloatArray, material_only: FloatArray, noise_sd: float = 0.0) -> Shares:
    """Return what the variance of draws (N, s) is due to, given the same draws (N, s) without their discrepancy."""
    centred, centred_material = complete - complete.mean(axis=0), material_only - material_only.mean(axis=0)
    discrepancy = centred - centred_material
    total = (centred**2).mean(axis=0) * len(complete) / (len(complete) - 1) + noise_sd**2
    terms = centred_material, discrepancy
    covariances = [(centred * term).sum(axis=0) / (len(complete) - 1) for term in terms]
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.sqrt((centred_material**2).sum(axis=0) * (discrepancy**2).sum(axis=0))
        correlation = (centred_material * discrepancy).sum(axis=0) / size
        return Shares(covariances[0] / total, covariances[1] / total, noise_sd**2 / total, correlation)


def standard_errors(
    statistics: Callable[..., Mapping[str, FloatArray]], *draws: FloatArray, seed: int = 0
) -> dict[str, FloatArray]:
    """Return the bootstrap's standard errors of statistics of draws (N, s), of which all arrays are resampled alike.

    Each column has statistics of its own. Draws of a quasi-random sequence have smaller errors than that.
    """
    count, columns = draws[0].shape
    rows = np.random.default_rng(seed).integers(count, size=(BOOTSTRAP_RESAMPLES, count))
    resampled = (values[rows.T].reshape(count, BOOTSTRAP_RESAMPLES * columns) for values in draws)
    replicates = statistics(*resampled)
    return {
        name: np.std(values.reshape(BOOTSTRAP_RESAMPLES, columns), axis=0, ddof=1)
        for name, values in replicates.items()
    }


BAND = ("mean", "sd", "low", "high")
SHARES = ("parameters", "discrepancy", "noise", "correlation")


def force_table(
    travel: FloatArray,
    complete: FloatArray,
    material_only: FloatArray,
    without: FloatArray | None,
    noise_sd: float,
    travel_name: str = "travel_mm",
) -> pd.DataFrame:
    """Return band and shares of the variance at every step, each with its standard error (``_error``).

    Parameters
    ----------
    travel : (s,) array, mm
    complete, material_only : (N, s) arrays, N
        Draws, and the same draws without discrepancy; not a number where a draw did not get that far.
    without : (M, s) array, N, or None
        Draws of a fit without discrepancy.
    noise_sd : float
        Standard deviation of a new measurement of the force, N.
    travel_name : str
        Name of its column.

    Returns
    -------
    pandas.DataFrame
        The travel; draws that got there; mean, sd, low and high (N); the shares of the variance of a new measurement;
        the sd of what the discrepancy adds (``discrepancy_sd``); and the band of the draws alone and of the fit without
        discrepancy, with the prefixes ``alone_`` and ``without_``.
    """
    import pandas as pd

    rows = []
    for step, travel_at_step in enumerate(travel):
        row: dict[str, Any] = {travel_name: float(travel_at_step)}
        is_reached = np.isfinite(complete[:, step]) & np.isfinite(material_only[:, step])
        row["draws"] = int(is_reached.sum())
        if row["draws"] > 1:
            row |= _with_errors(complete[is_reached, step], material_only[is_reached, step], noise_sd)
            row["discrepancy_sd"] = float((complete - material_only)[is_reached, step].std(ddof=1))
        for name, values in (("alone", material_only[is_reached, step]), ("without", _reached(without, step))):
            if len(values) > 1:
                row |= {f"{name}_{key}": float(getattr(band_of(values[:, None]), key)[0]) for key in BAND}
        rows.append(row)
    return pd.DataFrame(rows)


def _reached(values: FloatArray | None, step: int) -> FloatArray:
    return np.zeros(0) if values is None else values[np.isfinite(values[:, step]), step]


def _with_errors(complete: FloatArray, material_only: FloatArray, noise_sd: float) -> dict[str, float]:
    def statistics(complete: FloatArray, material_only: FloatArray) -> dict[str, FloatArray]:
        band, shares = band_of(complete), shares_of(complete, material_only, noise_sd)
        return {name: getattr(band, name) for name in BAND} | {name: getattr(shares, name) for name in SHARES}

    draws = complete[:, None], material_only[:, None]
    estimates, errors = statistics(*draws), standard_errors(statistics, *draws)
    return {name: float(estimates[name][0]) for name in estimates} | {
        f"{name}_error": float(errors[name][0]) for name in errors
    }
