"""What a calibration by simulation says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.studies.sbc.settings import SbcSettings
from tissuq.studies.sbc.uniformity import shape_p_value, spread_p_value

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["SIZE", "probabilities_of", "summarise_ranks"]

SIZE = 0.05
"""Chance that anything is marked when all is right."""


def probabilities_of(
    settings: SbcSettings, results: Sequence[dict[str, Any]]
) -> Mapping[tuple[str, str, str], NDArray[np.float64]]:
    """Return the probabilities below the truth by formulation, noise and parameter; nan where a fit failed."""
    found: dict[tuple[str, str, str], list[float]] = {}
    for each in results:
        place = settings.formulations[each["formulation"]], settings.noise[each["noise"]]
        for symbol, below in each["below"].items():
            found.setdefault((*place, symbol), []).extend(np.nan if value is None else value for value in below)
    return {place: np.array(values) for place, values in found.items()}


def summarise_ranks(settings: SbcSettings, results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a formulation, noise and parameter.

    Columns: fits, failed; mean, of the posterior probability below the truth (0.5 when right); spread, the standard
    deviation of its normal score (1 when right; more, posteriors are too narrow); p_shape and p_spread, of the tests
    in `tissuq.studies.sbc.uniformity`; calibrated, whether both are at least 0.05 over the number of all tests, so that
    the chance is 5 % at most that any row is marked when all is right.
    """
    import pandas as pd
    from scipy.special import ndtri

    rows = []
    for (formulation, noise, symbol), every in probabilities_of(settings, results).items():
        below = every[np.isfinite(every)]
        rows.append(
            {
                "formulation": formulation,
                "noise": noise,
                "parameter": symbol,
                "fits": len(below),
                "failed": len(every) - len(below),
                "mean": below.mean(),
                "spread": np.sqrt(np.mean(ndtri(np.clip(below, 1e-9, 1 - 1e-9)) ** 2)),
                "p_shape": shape_p_value(below),
                "p_spread": spread_p_value(below),
            }
        )
    table = pd.DataFrame(rows)
    table["calibrated"] = table[["p_shape", "p_spread"]].min(axis=1) >= SIZE / (2 * len(table))
    return table
