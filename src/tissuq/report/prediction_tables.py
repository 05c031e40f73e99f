"""The tables of a prediction: bands of the stress from end to end, and how the measurements are predicted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isnan
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.prediction.bands import Band
from tissuq.report.result import Table
from tissuq.report.tables import interval, significant
from tissuq.studies.prediction import Prediction

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["band_table", "end_words", "kind_words", "median_words", "score_table", "scored_kind", "share_words"]

MAX_ROWS = 13
"""Number of rows of the table of bands on page and terminal; the files have all."""
MAX_SHARE, MAX_STRESS, MIN_STRESS = 10.0, 1e5, 1e-12
"""Largest share shown as a percentage; stresses (in the unit of the run) shown in powers of ten, and as zero."""


def band_table(prediction: Prediction) -> Table:
    """Return some rows of the bands, from end to end, as text in the unit of the run."""
    rows, unit, several = [], prediction.unit, len(prediction.stresses) > 1
    names, count = [control.name for control in prediction.mode.controls], len(prediction.points)
    share = f"{100 * prediction.prob:.4g} %"
    bands = ["median", f"{share} of the stress", f"{share} of measurements"]
    bands_alone = ["alone: median", "alone: stress", "alone: measurements"] if prediction.kinds[0] else []
    indices = np.unique(np.linspace(0, count - 1, min(count, MAX_ROWS)).round().astype(int))
    for channel, name in enumerate(prediction.stresses):
        for index in indices:
            cells = [f"{column[index]:.4g}" for column in prediction.controls.values()] + [name] * several
            for kind in prediction.kinds:
                stress, noisy = (prediction.curves[channel, kind, noise] for noise in (False, True))
                ends = [end_words(band, index, unit.to_mpa) for band in (stress, noisy)]
                cells += [median_words(stress, index, unit.to_mpa), *ends]
            rows.append([*cells, "yes" if prediction.is_calibrated[index] else "no"])
    alone_words = "Alone: the material without the discrepancy. " if prediction.kinds[0] else ""
    excerpt = f"Some of {count} points; all are in `prediction.csv`." if count > MAX_ROWS else ""
    note = f"{unit.name}, {', '.join(prediction.stresses)}. {alone_words}{excerpt}".strip()
    headers = [*names, *["measured"] * several, *bands, *bands_alone, "calibrated"]
    title = f"Stress in mode {prediction.mode.name}, {unit.name}"
    return Table(headers, rows, title, (len(names),) if several else (), note)


def score_table(prediction: Prediction, scores: pd.DataFrame, data: str) -> Table:
    """Return as text how the measurements of that name are predicted."""
    several, unit = len(prediction.stresses) > 1, prediction.unit.name
    columns: dict[str, Callable[[Any], str]] = {
        "prediction": lambda row: scored_kind(prediction, row),
        **({"measured": itemgetter("measured")} if several else {}),
        "range": itemgetter("range"),
        "points": lambda row: f"{row['count']}",
        f"inside {100 * prediction.prob:.4g} %": lambda row: share_words(row["inside"]),
        "half width": lambda row: share_words(row["half_width"]),
        "error": lambda row: share_words(row["error"]),
        f"CRPS, {unit}": lambda row: _stress(row["crps"]),
        f"interval score, {unit}": lambda row: _stress(row["interval_score"]),
    }
    text_columns = (1, 2) if several else (1,)
    return Table.of(scores.to_dict("records"), columns, f"Measurements of {data}", text_columns=text_columns)


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
