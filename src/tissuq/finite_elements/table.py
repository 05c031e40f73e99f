"""What the forces of draws say, a row a step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.spread import band_of, shares_of, standard_errors

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["force_table"]

FloatArray = NDArray[np.float64]

BAND = ("mean", "sd", "low", "high")
SHARES = ("parameters", "discrepancy", "noise", "correlation")


def force_table(
    travel: FloatArray,
    complete: FloatArray,
    alone: FloatArray,
    without: FloatArray | None,
    noise_sd: float,
    travel_name: str = "travel",
) -> pd.DataFrame:
    """Return band and shares of the variance at every step, each with its standard error (``_error``).

    Parameters
    ----------
    travel : (s,) array, mm
    complete, alone : (N, s) arrays, N
        Draws, and the same draws without discrepancy; not a number where one did not get that far.
    without : (M, s) array, N, or None
        Draws of a fit without discrepancy.
    noise_sd : float
        N.
    travel_name : str

    Returns
    -------
    pandas.DataFrame
        The travel; draws that got there; mean, sd, low and high (N); the shares of the variance of a new measurement;
        the sd of what the discrepancy adds (``discrepancy_sd``); and the band of the draws alone and of the fit without
        discrepancy, with the prefixes ``alone_`` and ``without_``.
    """
    import pandas as pd

    rows = []
    for place, at in enumerate(travel):
        row: dict[str, Any] = {f"{travel_name}_mm": float(at)}
        there = np.isfinite(complete[:, place]) & np.isfinite(alone[:, place])
        row["draws"] = int(there.sum())
        if row["draws"] > 1:
            row |= _with_errors(complete[there, place], alone[there, place], noise_sd)
            row["discrepancy_sd"] = float((complete - alone)[there, place].std(ddof=1))
        for name, values in (("alone", alone[there, place]), ("without", _there(without, place))):
            if len(values) > 1:
                row |= {f"{name}_{key}": float(getattr(band_of(values[:, None]), key)[0]) for key in BAND}
        rows.append(row)
    return pd.DataFrame(rows)


def _there(values: FloatArray | None, place: int) -> FloatArray:
    return np.zeros(0) if values is None else values[np.isfinite(values[:, place]), place]


def _with_errors(complete: FloatArray, alone: FloatArray, noise_sd: float) -> dict[str, float]:
    def statistics(complete: FloatArray, alone: FloatArray) -> dict[str, FloatArray]:
        band, shares = band_of(complete), shares_of(complete, alone, noise_sd)
        return {name: getattr(band, name) for name in BAND} | {name: getattr(shares, name) for name in SHARES}

    draws = complete[:, None], alone[:, None]
    found, errors = statistics(*draws), standard_errors(statistics, *draws)
    return {name: float(found[name][0]) for name in found} | {
        f"{name}_error": float(errors[name][0]) for name in errors
    }
