"""The tables of a prediction: bands of the stress from end to end, and how the measurements are predicted."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from typing import Any

import numpy as np

from tissuq.prediction.bands import Band
from tissuq.report.tables import interval, significant
from tissuq.studies.prediction import Prediction

__all__ = [
    "MAX_ROWS",
    "band_headers",
    "end_words",
    "kind_words",
    "median_words",
    "readable_bands",
    "readable_scores",
    "score_headers",
    "scored_kind",
    "share_words",
]

MAX_ROWS = 13
"""Number of rows of the table of bands on page and terminal; the files have all."""
MAX_SHARE, MAX_STRESS, MIN_STRESS = 10.0, 1e5, 1e-12
"""Largest share shown as a percentage; stresses (in the unit of the run) shown in powers of ten, and as zero."""


def band_headers(prediction: Prediction) -> list[str]:
    """Return the heads of the columns of `readable_bands`."""
    stress_column = ["measured"] * (len(prediction.stresses) > 1)
    names = [control.name for control in prediction.mode.controls]
    share = f"{100 * prediction.prob:.4g} %"
    bands = ["median", f"{share} of the stress", f"{share} of measurements"]
    bands_alone = ["alone: median", "alone: stress", "alone: measurements"] if prediction.kinds[0] else []
    return [*names, *stress_column, *bands, *bands_alone, "calibrated"]


def readable_bands(prediction: Prediction) -> list[list[str]]:
    """Return some rows of the bands, from end to end, as text in the unit of the run."""
    rows, scale = [], prediction.unit.to_mpa
    count = len(prediction.points)
    indices = np.unique(np.linspace(0, count - 1, min(count, MAX_ROWS)).round().astype(int))
    for channel, name in enumerate(prediction.stresses):
        for index in indices:
            cells = [f"{column[index]:.4g}" for column in prediction.controls.values()]
            cells += [name] * (len(prediction.stresses) > 1)
            for kind in prediction.kinds:
                stress, noisy = (prediction.curves[channel, kind, noise] for noise in (False, True))
                cells += [median_words(stress, index, scale), *(end_words(b, index, scale) for b in (stress, noisy))]
            rows.append([*cells, "yes" if prediction.is_calibrated[index] else "no"])
    return rows


def score_headers(prediction: Prediction) -> list[str]:
    """Return the heads of the columns of `readable_scores`."""
    stress_column = ["measured"] * (len(prediction.stresses) > 1)
    unit = prediction.unit.name
    inside = f"inside {100 * prediction.prob:.4g} %"
    scores = ["half width", "error", f"CRPS, {unit}", f"interval score, {unit}"]
    return ["prediction", *stress_column, "range", "points", inside, *scores]


def readable_scores(prediction: Prediction) -> list[list[str]]:
    """Return how the measurements are predicted as text."""
    rows = []
    assert prediction.scores is not None  # noqa: S101 (requested only if there are measurements)
    for row in prediction.scores.to_dict("records"):
        cells = [scored_kind(prediction, row)] + [row["measured"]] * (len(prediction.stresses) > 1)
        shares = [share_words(row[name]) for name in ("inside", "half_width", "error")]
        stresses = [_stress(row[name]) for name in ("crps", "interval_score")]
        rows.append([*cells, row["range"], f"{row['count']}", *shares, *stresses])
    return rows


def kind_words(prediction: Prediction, kind: bool) -> str:
    """Return what is predicted: ``with the discrepancy gp``, or ``neo-hookean alone``."""
    model = prediction.posterior.model
    return f"with the discrepancy {model.discrepancy.name}" if kind else f"{model.material.name} alone"


def scored_kind(prediction: Prediction, row: Mapping[Any, Any]) -> str:
    """Return what a row of the scores predicts."""
    return kind_words(prediction, row["discrepancy"] == "with")


def share_words(value: float) -> str:
    """Return a share of the stress as a percentage."""
    return "" if isnan(value) else f"{100 * value:.0f} %" if value < MAX_SHARE else f"> {100 * MAX_SHARE:.0f} %"


def _stress(value: float) -> str:
    return significant(value) if abs(value) < MAX_STRESS else f"{value:.0e}"


def _rough(value: float) -> str:
    """Return a stress beside one that is very large."""
    return significant(value, 1) if abs(value) < MAX_STRESS else f"{value:.0e}"


def median_words(band: Band, index: int, scale: float) -> str:
    """Return the median of a band with digits that its width supports; `scale` is the unit of stress in MPa."""
    median, width = (float(stress[index]) / scale for stress in (band.median, band.high - band.low))
    if max(abs(median), width) < MIN_STRESS:
        return "0"
    if abs(median) >= MAX_STRESS:
        return f"{median:.0e}"
    return interval(median, median, min(width / 4, abs(median) or width))[0]


def end_words(band: Band, index: int, scale: float) -> str:
    """Return both ends of a band: ``4 to 6``."""
    low, high = (float(stress[index]) / scale for stress in (band.low, band.high))
    if max(-low, high) < MIN_STRESS:
        return "0"
    texts = interval(low, high, (high - low) / 4) if max(-low, high) < MAX_STRESS else (_rough(low), _rough(high))
    return "{} to {}".format(*texts)
