"""The result of a prediction: the stress at the end of the range, and tables of bands and of how measurements do."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from dataclasses import replace
from math import isnan
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment.uses import COMPUTING, UNKNOWN, Use
from tissuq.drawing.panels import legend_above
from tissuq.drawing.style import ANSWER_WIDTH, new_figure
from tissuq.emulation.material_posterior import CALIBRATION
from tissuq.errors import InputError
from tissuq.prediction.bands import Band
from tissuq.report.inputs import Copies
from tissuq.report.measured import named
from tissuq.report.result import Number, Picture, Result, Section, Table
from tissuq.report.source_run import uses_of
from tissuq.report.summary import SAME_STATES, SCORES
from tissuq.report.tables import interval, significant, table_files
from tissuq.result_warning import in_shell
from tissuq.studies.prediction import Prediction, draw_prediction
from tissuq.studies.settings import seen_from

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from tissuq.studies.run_settings import PredictionSettings

NOT_COMPRESSED = " No test was in compression, which counts as measured where it deforms the tissue as the tests did."


def prediction_figure(prediction: Prediction, width: float | None = None) -> Figure:
    """Return a row of panels for each stress: with the discrepancy, where it is known, and the material alone.

    The stretches outside the range that was measured are hatched.
    """
    count, kinds = len(prediction.stresses), len(prediction.kinds)
    with new_figure(width or 4.9 * kinds + (1.6 if kinds == 1 else 0.4), 3.7 * count + 0.7) as figure:
        axes = figure.subplots(count, kinds, squeeze=False, sharey="row", sharex=prediction.points.ndim == 1)
        draw_prediction(list(axes.ravel()), prediction)
        legend_above(figure, axes.ravel(), 4 if kinds > 1 else 2)
    return figure


def prediction_result(
    prediction: Prediction,
    settings: PredictionSettings,
    target: Path,
    beside: Path = Path(),
    *,
    law: str | None = None,
) -> Result:
    """Return what a prediction says.

    Parameters
    ----------
    prediction : Prediction
    settings : PredictionSettings
        From which it came.
    target : Path
        The run folder to be: the recipe names the run from there.
    beside : Path
        Where the relative paths of the settings lie.
    law : str, optional
        The material that was named, where it is a law in the user's file.
    """
    copies = Copies()
    relocated: dict[str, Any] = {"run": seen_from(target, beside / settings.run), "mode": prediction.mode.name}
    files: dict[str, Any] = {"prediction.csv": prediction.rows, "prediction.nc": prediction.save}
    if settings.data is not None:
        copy = {"file": copies.of_file(beside / settings.data.file), "mode": prediction.mode.name}
        relocated["data"] = settings.data.model_copy(update=copy)
    if prediction.scores is not None:
        rows = [{str(name): value for name, value in row.items()} for row in prediction.scores.to_dict("records")]
        files |= table_files("scores", rows, SCORES, replace(prediction.unit, to_mpa=1.0))  # they are in it already
    tables = [band_table(prediction)]
    if prediction.scores is not None and prediction.data is not None:
        tables.append(score_table(prediction, prediction.scores, prediction.data.name))
    model = prediction.posterior.model
    measured = " and ".join(f"{test.mode.name} ({len(test)} {test.rows_name})" for test in model.experiment.tests)
    source = f"fitted to {named(model.experiment)}"
    if prediction.posterior.solution.route == CALIBRATION:  # its tests stand for a range of stretches
        source = "calibrated with a forward model"
        measured = "what a forward model was calibrated on"
    run = Path(settings.run).name or settings.run
    return Result(
        command=f"predict{f' --user-law {law}' if law else ''}",
        title=f"Predicted stress: {prediction.mode.name}, by {model.material.name} {source}",
        subject=f"run {run}: {model.material.name}, discrepancy {model.discrepancy.name}, fitted to {measured}",
        numbers=(*_stresses_at_the_end(prediction), *_shares(prediction)),
        finding=_lead_of_bands(prediction) if prediction.scores is None else _lead_of_scores(prediction),
        uses=_use_of_mode(prediction, beside / settings.run),
        next_step=_next_step(prediction, _named(settings, beside)),
        picture=Picture(
            "answer", lambda: prediction_figure(replace(prediction, kinds=prediction.kinds[:1]), ANSWER_WIDTH),
            f"Predicted bands of the stress in mode {prediction.mode.name}", _caption(prediction),
        ),
        tables=tuple(tables),
        sections=_sections(prediction),
        warnings=tuple(prediction.warnings),
        files=files | copies,
        recipe=settings.model_copy(update=relocated),
    )  # fmt: skip


def _use_of_mode(prediction: Prediction, run: Path) -> tuple[Use, ...]:
    """Return whether this mode can be predicted, as the answer of the run says; nothing where it is not known."""
    try:
        uses = uses_of(run, prediction.posterior.model)
    except InputError:
        return ()
    is_measured = prediction.mode in prediction.posterior.model.experiment.modes
    purpose = "predict these tests" if is_measured else "predict other loading modes"
    return tuple(use for use in uses if use.purpose.startswith((purpose, COMPUTING)))


def _stresses_at_the_end(prediction: Prediction) -> list[Number]:
    """Return every stress at the end of what is calibrated, with its band."""
    index, scale = _calibrated_end(prediction), prediction.unit.to_mpa
    is_known = prediction.is_calibrated[index]
    numbers = []
    for channel, name in enumerate(prediction.stresses):
        band = prediction.curves[channel, prediction.kinds[0], False]
        median, low, high = (float(column[index]) / scale for column in (band.median, band.low, band.high))
        words = f"{name} at {_point(prediction, index)}{'' if is_known else ', extrapolated'}"
        numbers.append(Number(words, median, low, high, prediction.unit.name, f"{prediction.percent} interval"))
    return numbers


def _shares(prediction: Prediction) -> list[Number]:
    """Return how many measurements lie inside the band, and how much of the range is extrapolated."""
    numbers, count = [], len(prediction.points)
    if prediction.scores is not None:
        rows = prediction.scores_of(prediction.kinds[0])
        inside, all_of_them = round(float((rows["inside"] * rows["count"]).sum())), int(rows["count"].sum())
        value = f"{inside} of {all_of_them}"
        width = f"half width of the band {_share_words(float(rows['half_width'].max()))}"
        remark = f"{prediction.percent} expected; {width} of the stress"
        numbers.append(Number("measurements inside the band", value, remark=remark))
    extrapolated = count - int(prediction.is_calibrated.sum())
    remark = f"{'outside' if extrapolated else 'all within'} the {_measured_range(prediction)}"
    numbers.append(Number("extrapolated", f"{100 * extrapolated / count:.0f} % of the points", remark=remark))
    return numbers


def _measured_range(prediction: Prediction) -> str:
    """Return what says whether a state was measured: in a mode of the run its stretches, in another the invariants."""
    controls = prediction.mode.controls
    is_measured = len(controls) == 1 and prediction.mode in prediction.posterior.model.experiment.modes
    return f"measured range of {f'the {controls[0].name}' if is_measured else 'I1 and I2'}"


def _named(settings: PredictionSettings, beside: Path) -> str:
    """Return the run as it is typed, with the law and the discrepancy where these were chosen."""
    chosen = (("--material", settings.material), ("--discrepancy", settings.discrepancy))
    options = [word for option, name in chosen if name is not None for word in (option, name)]
    return shlex.join([os.path.normpath(beside / settings.run), *options])


def _next_step(prediction: Prediction, run: str) -> str:
    """Return what to do next; ``run`` is the run as it is typed."""
    if prediction.posterior.solution.is_of_data and not prediction.is_calibrated.all():
        return f"see which test would make the extrapolated stress less uncertain: tissuq design {run}"
    if prediction.scores is None:
        mode = prediction.mode.name
        return (
            f"compare with a measurement of this mode, if there is one: tissuq predict {run} --mode {mode} --data FILE"
        )
    return "see which laws describe all tests together: tissuq fit FILES --material LAW --material OTHER"


def _caption(prediction: Prediction) -> str:
    share, deduced = prediction.percent, NOT_COMPRESSED * prediction.is_compression_deduced
    return (
        f"Dark: {share} of the stress itself, noise off. Light: {share} of measurements of it. Hatched: outside the "
        f"{_measured_range(prediction)}; there bands may run out of the panel.{deduced}"
    )


def _sections(prediction: Prediction) -> tuple[Section, ...]:
    """Return what a page folds: all bands as figures, how to read them, the warnings of the fit, the measurements."""
    model, data, share = prediction.posterior.model, prediction.data, prediction.percent
    figure = Picture(
        "prediction", lambda: prediction_figure(prediction), f"All bands of the stress in mode {prediction.mode.name}",
        _caption(prediction), len(prediction.kinds) == 1,
    )  # fmt: skip
    test_error = " and an error of the whole test like theirs" if model.tolerances else ""
    reading = [
        "The band of the stress is the uncertainty of the fitted material; that of measurements adds the noise of the "
        f"run's measurements{test_error}.",
        "Calibrated: within the range in which both invariants I1 and I2 were measured (in a mode of the run, the "
        "stretches that were). Even inside that range one mode does not determine how the energy depends on the other "
        "invariant, so bands of other modes are wider than those of the measured mode.",
        SAME_STATES,
    ]
    if prediction.kinds[0]:
        reading.append(
            "Where bands with and without the discrepancy are far apart, the material alone does not describe the "
            "tissue; its narrow band then understates the uncertainty."
        )
    scores = (
        f"**Inside**: the share of measurements in the {share} band of measurements, which should be about {share}; if "
        "it is less, the band is too narrow for these data; if it is 100 %, the band may be too wide.",
        "**Half width** of that band and **error** of its median: root mean squares, relative to that of the measured "
        "stress.",
        "**CRPS** (continuous ranked probability score) and **interval score** reward bands that are narrow and hold "
        "the data, in the unit of stress; less is better. They compare predictions of the same measurements, here with "
        "and without the discrepancy, and mean nothing in isolation.",
        "Measurements without stress are left out: at rest it is zero by definition.",
    )
    sections = [Section("All bands", (figure,)), Section("How to read it", (tuple(reading),))]
    if data is not None:
        sections.append(Section("How the measurements are predicted", (scores,)))
    if prediction.posterior.warnings:
        sections.append(Section("Warnings of the fit", (tuple(map(in_shell, prediction.posterior.warnings)),)))
    if data is not None:
        words = f"{data.name}: {len(data)} measurements, {data.source}."
        sections.append(Section("The measurements", (words,)))
    return tuple(sections)


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
            f"{100 * row['inside']:.0f} % lie in the {prediction.percent} band "
            f"({prediction.called(row['discrepancy'] == 'with')}), whose median errs by "
            f"{_share_words(row['error'])} of the stress"
            for row in rows.to_dict("records")
        ]
        count = rows["count"].iloc[0]
        texts.append(
            f"Of {count} measurements of {prediction.data.name}{stress_words}{range_words} {', and '.join(findings)}."
        )
    return " ".join(texts)


def _lead_of_bands(prediction: Prediction) -> str:
    """Return what the numbers do not say: the stress farthest from rest, extrapolated, or that of the material alone.

    The numbers are of the end of what is calibrated, with the discrepancy where the run has one.
    """
    index, change, kind = _calibrated_end(prediction), _changes(prediction), prediction.called(prediction.kinds[0])
    farthest = int(change.argmax())
    if change[index] < change[farthest]:
        stresses = _stresses_at(prediction, farthest, prediction.kinds[0])
        return f"Extrapolated to {_point(prediction, farthest)}, {kind}, {stresses}."
    if not prediction.kinds[0]:
        return f"Predicted by {kind}."
    of_material = _stresses_at(prediction, index, kind=False)
    return f"Predicted {kind}. There, for {prediction.called(kind=False)}, {of_material}."


def _stresses_at(prediction: Prediction, index: int, kind: bool) -> str:
    """Return every stress at a point in words: ``the stress is 5 kPa (95 %: 4 to 6)``, or that it is not known.

    Beside a larger stress at the same point, one near zero is known by the standard of that.
    """
    texts = []
    largest = max(
        abs(prediction.curves[channel, kind, False].median[index]) for channel in range(len(prediction.stresses))
    )
    for channel, name in enumerate(prediction.stresses):
        band, scale = prediction.curves[channel, kind, False], prediction.unit.to_mpa
        median, ends = _median_words(band, index, scale), _end_words(band, index, scale)
        half_width = (band.high[index] - band.low[index]) / 2
        is_known = half_width <= UNKNOWN * largest
        unit, percent = prediction.unit.name, prediction.percent
        known, unknown = f"{median} {unit} ({percent}: {ends})", f"not known at all ({percent}: {ends} {unit})"
        texts.append(f"the {name} is {known if is_known else unknown}")
    return " and ".join(texts)


def _calibrated_end(prediction: Prediction) -> int:
    """Return which calibrated point is farthest from rest, or which of all where none is calibrated."""
    candidates = prediction.is_calibrated | (not prediction.is_calibrated.any())
    return int(np.where(candidates, _changes(prediction), -1.0).argmax())


def _changes(prediction: Prediction) -> FloatArray:
    """Return how far every point is from rest; of a tube that was stretched, how much wider than the narrowest."""
    points = prediction.points.reshape(len(prediction.points), -1)
    if len(prediction.mode.controls) > len(prediction.mode.stresses):
        return np.asarray(points[:, 0] - points[:, 0].min())
    changes: FloatArray = np.abs(points - np.atleast_1d(prediction.mode.reference)).max(axis=1)
    return changes


def _point(prediction: Prediction, index: int) -> str:
    controls = zip(prediction.mode.controls, prediction.controls.values(), strict=True)
    return " and ".join(f"{control.name} {column[index]:.4g}" for control, column in controls)


MAX_ROWS = 13
"""Number of rows of the table of bands on page and terminal; the files have all."""
MAX_SHARE, MAX_STRESS, MIN_STRESS = 10.0, 1e5, 1e-12
"""Largest share shown as a percentage; stresses (in the unit of the run) shown in powers of ten, and as zero."""


def band_table(prediction: Prediction) -> Table:
    """Return some rows of the bands, from end to end, as text in the unit of the run."""
    rows, unit, several = [], prediction.unit, len(prediction.stresses) > 1
    names, count = [control.name for control in prediction.mode.controls], len(prediction.points)
    bands = ["median", f"{prediction.percent} of the stress", f"{prediction.percent} of measurements"]
    bands_alone = ["alone: median", "alone: stress", "alone: measurements"] if prediction.kinds[0] else []
    indices = np.unique(np.linspace(0, count - 1, min(count, MAX_ROWS)).round().astype(int))
    for channel, name in enumerate(prediction.stresses):
        for index in indices:
            cells = [f"{column[index]:.4g}" for column in prediction.controls.values()] + [name] * several
            for kind in prediction.kinds:
                stress, noisy = (prediction.curves[channel, kind, noise] for noise in (False, True))
                ends = [_end_words(band, index, unit.to_mpa) for band in (stress, noisy)]
                cells += [_median_words(stress, index, unit.to_mpa), *ends]
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
        "prediction": lambda row: prediction.called(row["discrepancy"] == "with"),
        **({"measured": itemgetter("measured")} if several else {}),
        "range": itemgetter("range"),
        "points": lambda row: f"{row['count']}",
        f"inside {prediction.percent}": lambda row: _share_words(row["inside"]),
        "half width": lambda row: _share_words(row["half_width"]),
        "error": lambda row: _share_words(row["error"]),
        f"CRPS, {unit}": lambda row: _stress(row["crps"]),
        f"interval score, {unit}": lambda row: _stress(row["interval_score"]),
    }
    text_columns = (1, 2) if several else (1,)
    return Table.of(scores.to_dict("records"), columns, f"Measurements of {data}", text_columns=text_columns)


def _share_words(value: float) -> str:
    """Return a share of the stress as a percentage."""
    return "" if isnan(value) else f"{100 * value:.0f} %" if value < MAX_SHARE else f"> {100 * MAX_SHARE:.0f} %"


def _stress(value: float, digits: int = 3) -> str:
    return significant(value, digits) if abs(value) < MAX_STRESS else f"{value:.0e}"


def _median_words(band: Band, index: int, scale: float) -> str:
    """Return the median of a band with digits that its width supports; `scale` is the unit of stress in MPa."""
    median, width = (float(stress[index]) / scale for stress in (band.median, band.high - band.low))
    if max(abs(median), width) < MIN_STRESS:
        return "0"
    if abs(median) >= MAX_STRESS:
        return f"{median:.0e}"
    return interval(median, median, min(width / 4, abs(median) or width))[0]


def _end_words(band: Band, index: int, scale: float) -> str:
    """Return both ends of a band: ``4 to 6``."""
    low, high = (float(stress[index]) / scale for stress in (band.low, band.high))
    if max(-low, high) < MIN_STRESS:
        return "0"
    is_plain = max(-low, high) < MAX_STRESS
    texts = interval(low, high, (high - low) / 4) if is_plain else (_stress(low, 1), _stress(high, 1))
    return "{} to {}".format(*texts)
