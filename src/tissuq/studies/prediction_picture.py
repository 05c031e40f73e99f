"""The picture of a prediction: a row of panels for each stress, with the discrepancy and of the material alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tissuq.pictures.curves import ways_of
from tissuq.pictures.prediction import Measured, Predicted, draw_predicted, predicted_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tissuq.studies.prediction import Prediction

__all__ = ["draw_prediction"]

FloatArray = NDArray[np.float64]


def draw_prediction(axes: Sequence[Axes], prediction: Prediction) -> None:
    """Draw every stress and kind on axes of its own, row by row; the kinds of a stress on the same vertical axis."""
    count, across = len(prediction.stresses), len(prediction.kinds)
    for channel in range(count):
        row = axes[channel * across : (channel + 1) * across]
        found = [_shown(prediction, channel, kind) for kind in prediction.kinds]
        for axis, of in zip(row, found, strict=True):
            draw_predicted(axis, of, prediction.unit, predicted_limits(found), prediction.prob)
            axis.set_title(of.title)
            if prediction.points.ndim > 1 or channel == count - 1:
                axis.set_xlabel(of.label)
        row[0].set_ylabel(f"{prediction.stresses[channel]} [{prediction.unit.name}]")


def _shown(prediction: Prediction, channel: int, kind: bool) -> Predicted:
    """Return what is drawn of a stress, with the discrepancy or without."""
    number, abscissa = _abscissa(prediction)
    measured = None
    if prediction.data is not None:
        points = prediction.data.stretch if prediction.points.ndim == 1 else abscissa
        measured = Measured(points, prediction.measured(channel), prediction.is_data_calibrated)
    return Predicted(
        abscissa=abscissa,
        stress=prediction.curves[channel, kind, False],
        measurements=prediction.curves[channel, kind, True],
        is_calibrated=prediction.is_calibrated,
        calibrated=prediction.calibrated_range if prediction.points.ndim == 1 else None,
        ways=ways_of(prediction.mode, prediction.points, abscissa),
        measured=measured,
        label=_label(prediction, number),
        title=_title(prediction, channel, kind),
        quantity=prediction.stresses[channel],
    )


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
