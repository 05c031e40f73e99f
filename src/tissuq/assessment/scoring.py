"""Scores of a test that a posterior has not seen, within the calibrated range and beyond."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.stability import is_calibrated
from tissuq.experiments.experiment import Experiment
from tissuq.inference.solution import Solution
from tissuq.prediction.bands import stress_ratio
from tissuq.prediction.scores import judged

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["scores_of"]


def scores_of(
    solution: Solution, test: Experiment, *, discrepancy: bool, prob: float, stress_type: str
) -> pd.DataFrame:
    """Return the scores of a test, or of several joined; `Posterior.scores` says what they are."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for part, channel, _ in test.curves:
        ratio = stress_ratio(stress_type, part.mode, channel)
        every = judged(solution, part, channel, discrepancy=discrepancy, prob=prob)
        every = every.times(ratio(every.points))
        own = {"test": part.name, "mode": part.mode.name, "measured": part.mode.stresses[channel]}
        for name, chosen in _ranges(is_calibrated(solution.model.experiment, part.mode, every.points)).items():
            rows.append(own | {"range": name, "count": int(chosen.sum())} | every.where(chosen).summary())
    return pd.DataFrame(rows)


def _ranges(known: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Return all measurements, and where some are beyond the calibrated range those on either side of its ends."""
    every = {"all": np.ones_like(known)}
    parts = {"calibrated": known, "beyond": ~known}
    return every if known.all() else every | {name: chosen for name, chosen in parts.items() if chosen.any()}
