"""Summary of a campaign, each number with its Monte Carlo error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.validation.coverage.settings import CoverageSettings

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["summarise", "summarise_unseen"]

CELL = ["design", "strength", "noise"]


def summarise(settings: CoverageSettings, results: Sequence[dict[str, Any]], *by: str) -> pd.DataFrame:
    """Return one row a design, strength, noise, formulation and whatever else is asked for (``"family"``).

    Columns, each but the first two with the Monte Carlo standard error in ``..._error``:

    - fits, failed
    - coverage: the share of intervals that hold the true C10; its error is that of a share with one more of either
      kind, so that it is not zero where all hold
    - score: the mean interval score over the true C10 (width, plus 2 / (1 - prob) times by how much the truth is
      missed; Gneiting & Raftery 2007)
    - price: the mean interval score over the width of the interval of an oracle that knows everything but C10; and
      price_median, its median
    - width: the median ratio of an interval's width to the oracle's
    - bias: the mean of (posterior mean - truth) / truth
    - predictive, where it was asked for: the share of new measurements inside the predictive band
    """
    import pandas as pd
    from scipy.special import ndtri

    rows = []
    width_in_sd = 2 * ndtri(0.5 + 0.5 * settings.prob)
    for names, truth, oracle, fit, predictive in _every(settings, results, "predictive"):
        low, high, mean, _ = fit or [np.nan] * 4
        missed = max(low - truth, truth - high, 0.0) if fit else np.nan
        score = high - low + 2 / (1 - settings.prob) * missed
        rows.append(
            names
            | {
                "coverage": float(low <= truth <= high) if fit else np.nan,
                "score": score / truth,
                "price": score / (width_in_sd * oracle),
                "width": (high - low) / (width_in_sd * oracle),
                "bias": (mean - truth) / truth,
                "predictive": np.nan if predictive is None else predictive,
            }
        )
    groups = pd.DataFrame(rows).groupby([*CELL, *by, "formulation"], sort=False)
    count = groups["coverage"].count()
    table = pd.DataFrame({"fits": count, "failed": groups.size() - count})
    table["coverage"] = groups["coverage"].mean()
    likely = (table["coverage"] * count + 1) / (count + 2)
    table["coverage_error"] = np.sqrt(likely * (1 - likely) / count)
    _add_means(table, groups, "score", "price", "bias", *(["predictive"] if settings.predictive else []))
    table["price_median"], table["price_median_error"] = groups["price"].median(), groups["price"].agg(_median_error)
    table["width"], table["width_error"] = groups["width"].median(), groups["width"].agg(_median_error)
    return table.reset_index()


def summarise_unseen(settings: CoverageSettings, results: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return one row a design, strength, noise, formulation and loading mode that was not measured.

    Columns: materials; coverage, the share of stretches at which the interval of the stress itself holds the true one,
    and error, the median over materials of the relative root mean square error of the posterior mean stress; both with
    their Monte Carlo standard errors, for which a material counts once.
    """
    import pandas as pd

    rows = [
        names | {"mode": mode, "coverage": scores[0] if scores else np.nan, "error": scores[1] if scores else np.nan}
        for mode in settings.unseen
        for names, _, _, _, scores in _every(settings, results, mode)
    ]
    groups = pd.DataFrame(rows).groupby([*CELL, "mode", "formulation"], sort=False)
    table = pd.DataFrame({"materials": groups["coverage"].count()})
    _add_means(table, groups, "coverage")
    table["error"], table["error_error"] = groups["error"].median(), groups["error"].agg(_median_error)
    return table.reset_index()


def _every(
    settings: CoverageSettings, results: Sequence[dict[str, Any]], more: str
) -> Iterator[tuple[dict[str, Any], float, float, list[float] | None, Any]]:
    """Yield the place, the truth, the oracle's sd, the fit and, where it was asked for, more of every data set."""
    for result in results:
        names = {
            "design": settings.designs[result["design"]].label,
            "strength": settings.strengths[result["strength"]],
            "noise": settings.noise[result["noise"]],
            "formulation": settings.formulations[result["formulation"]],
            "family": settings.families[result["family"]],
        }
        requested = result.get(more, [None] * len(result["truth"]))
        for numbers in zip(result["truth"], result["oracle_sd"], result["fits"], requested, strict=True):
            yield names, *numbers


def _add_means(table: pd.DataFrame, groups: Any, *names: str) -> None:
    for name in names:
        table[name], table[f"{name}_error"] = groups[name].mean(), groups[name].sem()


def _median_error(values: pd.Series[float]) -> float:
    """Return the standard error of a median: half the distance between the values one error of their rank away."""
    present = values.dropna()
    if len(present) < 2:
        return float("nan")
    away = 0.5 / np.sqrt(len(present))
    low, high = np.quantile(present, [max(0.5 - away, 0.0), min(0.5 + away, 1.0)])
    return float(0.5 * (high - low))
