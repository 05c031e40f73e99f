"""Effects of covariates on the parameters of a population, and what they explain of the spread between specimens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.checked_arrays import headed
from tissuq.experiments.units import StressUnit
from tissuq.population.draws import INTERVAL_COLUMNS, PopulationDraws, interval

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ALL_COVARIATES", "effect_table", "explained_share"]

FloatArray = NDArray[np.float64]

ALL_COVARIATES = "all covariates"
"""In place of a covariate, of the share that they explain together."""


def explained_share(population: PopulationDraws) -> FloatArray:
    """Return draws (chains, draws, d) of the share of the variance between specimens that covariates explain.

    It is that of B x_i over the specimens, over its sum with tau squared (Gelman & Pardoe 2006).
    """
    hierarchy = population.hierarchy
    explained = np.einsum("ik,cdkj->cdij", population.covariates.design, hierarchy.effects).var(axis=2)
    return np.asarray(explained / (explained + hierarchy.tau**2))


def effect_table(population: PopulationDraws, prob: float, unit: StressUnit) -> pd.DataFrame:
    """Return `Population.effects`, differences of stresses in a unit."""
    import pandas as pd

    covariates, coordinates = population.covariates, population.coordinates
    slopes = population.hierarchy.effects / covariates.sizes[:, None]
    rows: dict[tuple[str, str], list[Any]] = {}
    for j, (symbol, is_log) in enumerate(zip(population.symbols, coordinates.is_log, strict=True)):
        scale = coordinates.scale[j] / population.unit_of(symbol, unit).to_mpa
        for k, (name, per) in enumerate(covariates.effects):
            draws = np.exp(slopes[..., k, j]) if is_log else slopes[..., k, j] * scale
            positive = float((slopes[..., k, j] > 0).mean())
            rows[symbol, name] = ["factor" if is_log else "difference", per, *interval(draws, prob), positive]
        if covariates:
            share = interval(explained_share(population)[..., j], prob)
            rows[symbol, ALL_COVARIATES] = ["share", "of the variance", *share, np.nan]
    index = pd.MultiIndex.from_tuples(rows, names=["parameter", "covariate"]) if rows else None
    table = pd.DataFrame(list(rows.values()), index, ["kind", "per", *INTERVAL_COLUMNS, "positive"])
    return headed(table, unit)
