"""What a campaign says: coverage, interval score, width and bias, each with its Monte Carlo error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.studies.coverage.settings import CoverageSettings

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["summarise"]


def summarise(settings: CoverageSettings, results: Sequence[dict[str, Any]], *by: str) -> pd.DataFrame:
    """Return one row a design, strength, formulation and whatever else is asked for (``"family"``).

    Columns: fits; failed; coverage, the share of intervals that hold the true C10, and its standard error; score, the
    mean interval score over the true C10 (width, plus 2 / (1 - prob) times by how much the truth is missed; Gneiting
    & Raftery 2007), and its standard error; width, the median ratio of an interval's width to that of an oracle that
    knows everything but C10; bias, the mean of (posterior mean - truth) / truth.
    """
    import pandas as pd
    from scipy.special import ndtri

    rows = []
    for found in results:
        names = {
            "design": settings.designs[found["design"]].label,
            "strength": settings.strengths[found["strength"]],
            "formulation": settings.formulations[found["formulation"]],
            "family": settings.families[found["family"]],
        }
        for truth, oracle, fit in zip(found["truth"], found["oracle_sd"], found["fits"], strict=True):
            low, high, mean, _ = fit or [np.nan] * 4
            missed = max(low - truth, truth - high, 0.0) if fit else np.nan
            rows.append(
                names
                | {
                    "holds": float(low <= truth <= high) if fit else np.nan,
                    "score": (high - low + 2 / (1 - settings.prob) * missed) / truth,
                    "width": (high - low) / (2 * ndtri(0.5 + 0.5 * settings.prob) * oracle),
                    "bias": (mean - truth) / truth,
                }
            )
    groups = pd.DataFrame(rows).groupby(["design", "strength", *by, "formulation"], sort=False)
    count = groups["holds"].count()
    coverage, score = groups["holds"].mean(), groups["score"]
    return pd.DataFrame(
        {
            "fits": count,
            "failed": groups.size() - count,
            "coverage": coverage,
            "coverage_error": np.sqrt(coverage * (1 - coverage) / count),
            "score": score.mean(),
            "score_error": score.std() / np.sqrt(count),
            "width": groups["width"].median(),
            "bias": groups["bias"].mean(),
        }
    ).reset_index()
