"""The figure of a prediction: bands with the discrepancy and of the material alone, over measurements if there are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tissuq.report.figures import BAND, BASE, INK, STYLE
from tissuq.studies.prediction import Prediction

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["prediction_figure"]

FloatArray = NDArray[np.float64]

MARGIN = 0.5
"""Margin above and below the calibrated or measured stresses, over their range; beyond it bands leave the panel."""


def prediction_figure(prediction: Prediction) -> Figure:
    """Return a row of panels for each stress: with the discrepancy, where it is known, and the material alone.

    The stretches at which an invariant is larger than in the measurements of the run are hatched.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    count, kinds = len(prediction.stresses), prediction.kinds
    with rc_context(STYLE):
        figure = Figure(figsize=(4.9 * len(kinds) + (1.6 if len(kinds) == 1 else 0.4), 3.7 * count + 0.7))
        panels = figure.subplots(count, len(kinds), squeeze=False, sharey="row", sharex=prediction.points.ndim == 1)
        for channel, row in enumerate(panels):
            for axis, kind in zip(row, kinds, strict=True):
                _draw(axis, prediction, channel, kind)
                axis.set_title(_title(prediction, channel, kind))
                if prediction.points.ndim > 1 or channel == count - 1:
                    axis.set_xlabel(_label(prediction, _abscissa(prediction)[0]))
            row[0].set_ylim(*_limits(prediction, channel))
            row[0].set_ylabel(f"{prediction.stresses[channel]} [{prediction.unit.name}]")
        handles: dict[str, Any] = {}
        for axis in panels.ravel():
            for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        shown = min(len(handles), 3 * len(kinds) if len(kinds) > 1 else 2)
        figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=shown, fontsize=9)
    return figure


def _draw(axis: Axes, prediction: Prediction, channel: int, kind: bool) -> None:
    """Draw bands, measurements and where nothing was measured."""
    _, abscissa = _abscissa(prediction)
    stress, noisy = (_drawn(prediction, channel, kind, noise) for noise in (False, True))
    order, share = np.argsort(abscissa, kind="stable"), f"{100 * prediction.prob:.4g} %"
    looks = ((noisy, 0.18, f"{share} of measurements"), (stress, 0.38, f"{share} of the stress"))
    is_path = prediction.points.ndim == 1 or prediction.data is None
    for band, strength, label in looks:
        low, high = (band[end].to_numpy()[order] for end in ("low", "high"))
        if is_path:
            axis.fill_between(abscissa[order], low, high, color=BAND, alpha=strength, lw=0, label=label)
        else:
            axis.vlines(abscissa[order], low, high, color=BAND, alpha=strength, lw=5, label=label)
    style: dict[str, Any] = {"ls": "-", "lw": 1.6} if is_path else {"ls": "", "marker": "_", "ms": 7}
    axis.plot(abscissa[order], stress["mean"].to_numpy()[order], color=BAND, label="predicted mean", **style)
    axis.set_xlim(*_padded(abscissa.min(), abscissa.max()))
    axis.locator_params(axis="x", nbins=6)
    _shade(axis, prediction)
    if prediction.data is not None:
        points = prediction.data.stretch if prediction.points.ndim == 1 else abscissa
        for is_shown, face, label in (
            (prediction.is_data_calibrated, INK, "measured"),
            (~prediction.is_data_calibrated, "white", "measured beyond"),
        ):
            if is_shown.any():
                values = prediction.measured(channel)[is_shown] / prediction.unit.to_mpa
                axis.plot(points[is_shown], values, "o", mec=INK, mfc=face, ms=3.6, mew=0.9, label=label, zorder=4)


def _drawn(prediction: Prediction, channel: int, kind: bool, noise: bool) -> pd.DataFrame:
    """Return a band in the unit of the run, cut where it has long left the panel: no renderer takes any number."""
    low, high = _limits(prediction, channel)
    band = prediction.bands[channel, kind, noise] / prediction.unit.to_mpa
    return band.clip(lower=low - 5 * (high - low), upper=high + 5 * (high - low))


def _abscissa(prediction: Prediction) -> tuple[int, FloatArray]:
    """Return the first control that changes, its number and its values."""
    columns = list(prediction.controls.values())
    number = next((index for index, column in enumerate(columns) if np.ptp(column) > 0), 0)
    return number, columns[number]


def _label(prediction: Prediction, number: int) -> str:
    """Return the name of the control along the axis, and where the others are held."""
    pairs = enumerate(zip(prediction.mode.controls, prediction.controls.values(), strict=True))
    held = [
        f"{control.name} {values[0]:.4g}"
        for index, (control, values) in pairs
        if index != number and np.ptp(values) == 0
    ]
    return prediction.mode.controls[number].name + (f" ({', '.join(held)})" if held else "")


def _shade(axis: Axes, prediction: Prediction) -> None:
    """Hatch where an invariant is larger than any that was measured."""
    if prediction.points.ndim > 1:
        if not prediction.is_calibrated.all():
            abscissa = _abscissa(prediction)[1][~prediction.is_calibrated]
            axis.plot(abscissa, np.zeros_like(abscissa), "|", color=BASE, ms=8, transform=axis.get_xaxis_transform(),
                      label="not calibrated", clip_on=False)  # fmt: skip
        return
    ends = prediction.calibrated_range
    assert ends is not None  # noqa: S101 (one control)
    start_limit, end_limit = axis.get_xlim()
    for start, end in ((start_limit, min(ends[0], end_limit)), (max(ends[1], start_limit), end_limit)):
        margin = 0.011 * (end_limit - start_limit)  # that of the axis beyond the last stretch is no place of its own
        if end - start > 3 * margin:
            axis.axvspan(start, end, facecolor="none", edgecolor=BASE, alpha=0.5, hatch="////", lw=0, zorder=3,
                         label="not calibrated")  # fmt: skip
            edge = end if start == start_limit else start
            axis.axvline(edge, color=BASE, lw=1.1, ls="--", zorder=0.5)


def _padded(low: float, high: float) -> tuple[float, float]:
    margin = 0.02 * max(high - low, 0.1 * abs(high))
    return low - margin, high + margin


def _title(prediction: Prediction, channel: int, kind: bool) -> str:
    model = prediction.posterior.model
    name = f"with the discrepancy {model.discrepancy.name}" if kind else f"{model.material.name} alone"
    if prediction.scores is None:
        return name
    rows = prediction.scores[
        (prediction.scores["discrepancy"] == ("with" if kind else "without")) & (prediction.scores["range"] == "all")
    ]
    row = rows.iloc[channel]
    return f"{name}:  {round(row['inside'] * row['count'])} of {row['count']} inside"


def _limits(prediction: Prediction, channel: int) -> tuple[float, float]:
    """Return the ends of the stress axis: all that is calibrated or measured, and some margin for what is beyond."""
    scale = prediction.unit.to_mpa
    calibrated = (
        prediction.is_calibrated if prediction.is_calibrated.any() else np.ones(len(prediction.points), dtype=bool)
    )
    bands = [prediction.bands[channel, kind, True] for kind in prediction.kinds]
    core = [band[end].to_numpy()[calibrated] for band in bands for end in ("low", "high")]
    core += [] if prediction.data is None else [prediction.measured(channel)]
    low, high = min(float(values.min()) for values in core), max(float(values.max()) for values in core)
    margin = MARGIN * (high - low)
    all_ends = np.concatenate([band[end].to_numpy() for band in bands for end in ("low", "high")])
    ends = np.clip([all_ends.min(), all_ends.max()], low - margin, high + margin)
    low, high = _padded(min(low, float(ends[0])), max(high, float(ends[1])))
    return low / scale, high / scale
