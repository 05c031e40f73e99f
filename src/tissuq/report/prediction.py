"""The folder of a prediction: bands and scores as tables and labelled arrays, the figure and a page."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.drawing.panels import legend_above
from tissuq.drawing.style import new_figure
from tissuq.prediction.bands import Band
from tissuq.report.run_folder import INPUT, write_figures, write_page, write_recipe
from tissuq.report.tables import interval, significant, write_csv, write_json
from tissuq.result_warning import in_shell
from tissuq.studies.prediction import Prediction
from tissuq.studies.prediction_picture import draw_prediction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tissuq.studies.prediction_settings import PredictionSettings

__all__ = [
    "band_headers",
    "prediction_figure",
    "readable_bands",
    "readable_scores",
    "score_headers",
    "write_prediction_run",
]


def prediction_figure(prediction: Prediction) -> Figure:
    """Return a row of panels for each stress: with the discrepancy, where it is known, and the material alone.

    The stretches at which an invariant is larger than in the measurements of the run are hatched.
    """
    count, kinds = len(prediction.stresses), len(prediction.kinds)
    with new_figure(4.9 * kinds + (1.6 if kinds == 1 else 0.4), 3.7 * count + 0.7) as figure:
        axes = figure.subplots(count, kinds, squeeze=False, sharey="row", sharex=prediction.points.ndim == 1)
        draw_prediction(list(axes.ravel()), prediction)
        legend_above(figure, axes.ravel(), 3 * kinds if kinds > 1 else 2)
    return figure


MAX_ROWS = 13
"""Number of rows of the table of bands on page and terminal; the files have all."""
MAX_SHARE, MAX_STRESS, MIN_STRESS = 10.0, 1e5, 1e-12
"""Largest share shown as a percentage; stresses (in the unit of the run) shown in powers of ten, and as zero."""


def write_prediction_run(
    prediction: Prediction,
    settings: PredictionSettings,
    folder: Path,
    target: Path,
    beside: Path = Path(),
    *,
    law: str | None = None,
    figures: bool = True,
) -> None:
    """Write everything that a prediction leaves behind into an empty folder.

    Parameters
    ----------
    prediction : Prediction
    settings : PredictionSettings
        From which it came.
    folder : Path
        Exists and is empty.
    target : Path
        What the folder will be in the end: the recipe names the run from there.
    beside : Path
        Where the relative paths of the settings lie.
    law : str, optional
        The material that was named, where it is a law in the user's file.
    figures : bool
        Draw them, too.
    """
    command = f"predict{'' if figures else ' --no-figures'}{f' --user-law {law}' if law else ''}"
    relocated: dict[str, Any] = {"run": os.path.relpath(beside / settings.run, target), "mode": prediction.mode.name}
    if settings.data is not None:
        (folder / INPUT).mkdir()
        source = beside / settings.data.file
        shutil.copyfile(source, folder / INPUT / source.name)
        copy = {"file": f"{INPUT}/{source.name}", "mode": prediction.mode.name}
        relocated["data"] = settings.data.model_copy(update=copy)
    write_recipe(folder, command, settings.model_copy(update=relocated))
    write_csv(folder / "prediction.csv", prediction.rows)
    prediction.save(folder / "prediction.nc")
    if prediction.scores is not None:
        rows = [{str(name): value for name, value in row.items()} for row in prediction.scores.to_dict("records")]
        unit = prediction.unit.name
        names = {name: f"{name} [{unit}]" for name in ("crps", "interval_score")}
        write_csv(folder / "scores.csv", [{names.get(name, name): row[name] for name in row} for row in rows])
        write_json(folder / "scores.json", [row | {"unit": unit} for row in rows])
    if figures:
        write_figures(folder, {"prediction": prediction_figure(prediction)})
    write_page(folder, "prediction.html", **_context(prediction, settings), command=command)


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
                cells += [_median(stress, index, scale), _ends(stress, index, scale), _ends(noisy, index, scale)]
            rows.append([*cells, "yes" if prediction.is_calibrated[index] else "no"])
    return rows


def score_headers(prediction: Prediction) -> list[str]:
    """Return the heads of the columns of `readable_scores`."""
    stress_column = ["measured"] * (len(prediction.stresses) > 1)
    unit = prediction.unit.name
    inside = f"inside {100 * prediction.prob:.4g} %"
    return [
        "prediction",
        *stress_column,
        "range",
        "points",
        inside,
        "half width",
        "error",
        f"CRPS, {unit}",
        f"interval score, {unit}",
    ]


def readable_scores(prediction: Prediction) -> list[list[str]]:
    """Return how the measurements are predicted as text."""
    rows = []
    assert prediction.scores is not None  # noqa: S101 (requested only if there are measurements)
    for row in prediction.scores.to_dict("records"):
        cells = [_of(prediction, row)] + [row["measured"]] * (len(prediction.stresses) > 1)
        shares = [_share(row[name]) for name in ("inside", "half_width", "error")]
        stresses = [_stress(row[name]) for name in ("crps", "interval_score")]
        rows.append([*cells, row["range"], f"{row['count']}", *shares, *stresses])
    return rows


def _kind(prediction: Prediction, kind: bool) -> str:
    model = prediction.posterior.model
    return f"with {model.discrepancy.name}" if kind else f"{model.material.name} alone"


def _of(prediction: Prediction, row: Mapping[Any, Any]) -> str:
    return _kind(prediction, row["discrepancy"] == "with")


def _share(value: float) -> str:
    return "" if isnan(value) else f"{value:.0%}" if value < MAX_SHARE else f"> {MAX_SHARE:.0%}"


def _stress(value: float) -> str:
    return significant(value) if abs(value) < MAX_STRESS else f"{value:.0e}"


def _median(band: Band, index: int, scale: float) -> str:
    median, width = (float(stress[index]) / scale for stress in (band.median, band.high - band.low))
    if max(abs(median), width) < MIN_STRESS:
        return "0"
    return interval(median, median, width / 4)[0] if abs(median) < MAX_STRESS else f"{median:.0e}"


def _ends(band: Band, index: int, scale: float) -> str:
    low, high = (float(stress[index]) / scale for stress in (band.low, band.high))
    if max(-low, high) < MIN_STRESS:
        return "0"
    texts = interval(low, high, (high - low) / 4) if max(-low, high) < MAX_STRESS else (f"{low:.0e}", f"{high:.0e}")
    return "{} to {}".format(*texts)


def _context(prediction: Prediction, settings: PredictionSettings) -> dict[str, Any]:
    model = prediction.posterior.model
    data = prediction.data
    return {
        "prediction": prediction,
        "run": Path(settings.run).name or settings.run,
        "model": model,
        "measured": " and ".join(f"{test.mode.name} ({len(test)} measurements)" for test in model.experiment.tests),
        "lead": _lead(prediction),
        "share": f"{100 * prediction.prob:.4g} %",
        "headers": band_headers(prediction),
        "rows": readable_bands(prediction),
        "is_part": len(prediction.points) > MAX_ROWS,
        "data": data,
        "score_headers": score_headers(prediction),
        "scores": [] if prediction.scores is None else readable_scores(prediction),
        "fit_warnings": list(map(in_shell, prediction.posterior.warnings)),
    }


def _lead(prediction: Prediction) -> str:
    """Return the finding in a sentence or two."""
    return _lead_of_bands(prediction) if prediction.scores is None else _lead_of_scores(prediction)


def _lead_of_scores(prediction: Prediction) -> str:
    assert prediction.scores is not None and prediction.data is not None  # noqa: S101, PT018 (checked by the caller)
    ranges = set(prediction.scores["range"])
    scored_range = "calibrated" if "calibrated" in ranges else "all"
    range_words = " in the calibrated range" if scored_range in ranges - {"all"} else ""
    range_words = ", all outside the calibrated range," if ranges == {"all", "beyond"} else range_words
    texts = []
    for channel, name in enumerate(prediction.stresses):
        rows = prediction.scores[
            (prediction.scores["range"] == scored_range)
            & (prediction.scores["measured"] == prediction.mode.stresses[channel])
        ]
        stress_words = f" ({name})" if len(prediction.stresses) > 1 else ""
        findings = [
            f"{row['inside']:.0%} lie in the {100 * prediction.prob:.4g} % band ({_of(prediction, row)}), "
            f"whose mean errs by {_share(row['error'])} of the stress"
            for row in rows.to_dict("records")
        ]
        count = rows["count"].iloc[0]
        texts.append(
            f"Of {count} measurements of {prediction.data.name}{stress_words}{range_words} {', and '.join(findings)}."
        )
    return " ".join(texts)


def _lead_of_bands(prediction: Prediction) -> str:
    calibrated = np.flatnonzero(prediction.is_calibrated)
    change = np.abs(
        prediction.points.reshape(len(prediction.points), -1) - np.atleast_1d(prediction.mode.reference)
    ).max(axis=1)
    index = int(calibrated[change[calibrated].argmax()] if len(calibrated) else change.argmax())
    point_words = " and ".join(
        f"{control.name} {column[index]:.4g}"
        for control, column in zip(prediction.mode.controls, prediction.controls.values(), strict=True)
    )
    texts = []
    for channel, name in enumerate(prediction.stresses):
        band, scale = prediction.curves[channel, prediction.kinds[0], False], prediction.unit.to_mpa
        median, ends = (words(band, index, scale) for words in (_median, _ends))
        texts.append(f"the {name} is {median} {prediction.unit.name} ({100 * prediction.prob:.4g} %: {ends})")
    extrapolated = "" if len(calibrated) else ", which is outside the measured range"
    kind = _kind(prediction, prediction.kinds[0])
    return f"At {point_words} in mode {prediction.mode.name}{extrapolated}, {' and '.join(texts)}: {kind}."
