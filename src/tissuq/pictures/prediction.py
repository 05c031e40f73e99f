"""Pictures of predictions: bands over any stretches and beyond what was measured, and the stress of every draw."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray
from tissuq.assessment.stability import calibrated_range, is_calibrated, measured_range
from tissuq.drawing.panels import Panels, limits_of, within
from tissuq.drawing.pieces import band, cut_off, line, outside, points
from tissuq.drawing.style import BAND, BASE, INK, relative_size
from tissuq.errors import InputError, ModelError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import values_of_control
from tissuq.experiments.units import StressUnit
from tissuq.inference.solution import Solution
from tissuq.pictures.curves import Way, ways_of
from tissuq.prediction.bands import Band, predict_bands, speaks_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 121
"""Of a band, unless they are given."""
REACH = 0.35
"""How far a prediction goes beyond what was measured on either side, over the measured range."""
LESSER_REACHES = (REACH, REACH / 3, REACH / 10)
"""The same where a material locks before."""
KNOWN_MARGIN, NEAR_MARGIN = 0.75, 0.25
"""Of calibrated bands, over the range of measurements and medians, and of others, over that: how much an axis shows."""
MOST_DRAWN = 200
"""Draws with a line of their own; of more some are drawn, evenly through the ensemble."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements that a prediction is compared with: (n,) arrays, stress in MPa."""

    abscissa: FloatArray
    stress: FloatArray
    is_calibrated: BoolArray


@dataclass(frozen=True, eq=False)
class Predicted:
    """The bands of one stress, MPa.

    Attributes
    ----------
    abscissa : (g,) array
        What it is drawn against.
    stress, measurements : Band
        Of the stress itself, and of new measurements of it.
    is_calibrated : (g,) array of bool
        Where the state is among those that were measured.
    calibrated : (float, float) or None
        The ends of that range; None where several controls make it no interval.
    ways : list of Way
        The paths that the points follow.
    measured : Measured or None
    label, title, quantity : str
        Of the horizontal axis, of the panel, and of the stress.
    """

    abscissa: FloatArray
    stress: Band
    measurements: Band
    is_calibrated: BoolArray
    calibrated: tuple[float, float] | None
    ways: list[Way]
    measured: Measured | None
    label: str
    title: str
    quantity: str


def stretches_to_show(solution: Solution, mode: LoadingMode, reach: float = REACH) -> FloatArray:
    """Return points of a mode to predict at: over the measured range and beyond; or those that were measured.

    Raises
    ------
    InputError
        When the mode has several controls and was not measured.
    """
    if len(mode.controls) > 1:
        measured = next((curve.points for curve in solution.model.experiment.curves if curve.mode == mode), None)
        if measured is None:
            names = " and ".join(control.name for control in mode.controls)
            raise InputError(
                f"'{mode.name}' has several controls ({names}): say where to predict by stretch=, a row for each point."
            )
        return measured
    low, high = measured_range(solution.model.experiment, mode)
    wider = reach * (high - low)
    lowest, reference = mode.controls[0].above, float(mode.reference)
    start = low if np.isclose(low, reference) else max(low - wider, low - 0.5 * (low - lowest))
    end = high if np.isclose(high, reference) else high + wider
    return np.linspace(start, end, POINTS)


def predictions(
    solution: Solution, mode: LoadingMode, stretch: ArrayLike | None = None, prob: float = 0.95
) -> list[Predicted]:
    """Return every stress of a mode, with the discrepancy where it says something about the mode.

    Unless stretches are given, as far beyond the measured range as the material has a stress.

    Raises
    ------
    InputError, ModelError
        When the points are none of the mode, must be given, or the material has no stress there.
    """
    if stretch is not None:
        return _predictions(solution, mode, checked_points(mode, np.atleast_1d(stretch)), prob)
    for reach in LESSER_REACHES:
        with suppress(ModelError):
            return _predictions(solution, mode, stretches_to_show(solution, mode, reach), prob)
    return _predictions(solution, mode, stretches_to_show(solution, mode, 0.0), prob)


def _predictions(solution: Solution, mode: LoadingMode, points: FloatArray, prob: float) -> list[Predicted]:
    model = solution.model
    is_joint, several, is_directed = speaks_of(model, mode), len(mode.controls) > 1, solution.is_directed
    predictions = []
    for channel, quantity in enumerate(mode.stresses):
        options: dict[str, Any] = {"discrepancy": is_joint, "prob": prob, "mode": mode, "channel": channel}
        noisy, stress = predict_bands([(1.0, solution)], points, (True, False), **options)
        number = mode.drawn_against(channel, points)
        abscissa = values_of_control(points, number)
        predictions.append(
            Predicted(
                abscissa=abscissa,
                stress=stress,
                measurements=noisy,
                is_calibrated=is_calibrated(model, mode, points, is_directed=is_directed),
                calibrated=None if several else calibrated_range(model, mode, is_directed=is_directed),
                ways=ways_of(mode, points, abscissa),
                measured=_measured(solution, mode, channel, number),
                label=mode.controls[number].name,
                title=mode.name if is_joint else f"{mode.name}\n{model.material.name} alone, discrepancy unknown",
                quantity=quantity,
            )
        )
    return predictions


def prediction(drawn: Panels, predicted: Sequence[Predicted], unit: StressUnit, prob: float = 0.95) -> None:
    """Draw every stress on a panel of its own."""
    for axis, prediction_of_mode in zip(drawn.axes, predicted, strict=True):
        draw_predicted(axis, prediction_of_mode, unit, predicted_limits([prediction_of_mode]), prob)
        axis.set_ylabel(f"{prediction_of_mode.quantity} [{unit.name}]")
        axis.set_xlabel(prediction_of_mode.label)
        if drawn.is_new:
            axis.set_title(prediction_of_mode.title)
    drawn.explain()


def predicted_limits(predicted: Sequence[Predicted]) -> tuple[float, float]:
    """Return the ends of an axis, MPa: what is measured, the medians, and of bands what is not far from them."""
    core, known_ends, possible_limits = list[FloatArray](), list[FloatArray](), list[FloatArray]()
    for curve in predicted:
        is_calibrated = _known(curve)
        core += [curve.stress.median[is_calibrated], *([curve.measured.stress] if curve.measured is not None else [])]
        known_ends += [values[is_calibrated] for values in (curve.measurements.low, curve.measurements.high)]
        possible_limits += [curve.measurements.low, curve.measurements.high]
    core.append(np.array(limits_of(core, known_ends, KNOWN_MARGIN)))
    low, high = limits_of(core, [])
    extent = high - low
    medians = [np.clip(curve.stress.median, low - extent, high + extent) for curve in predicted]
    near = [np.clip(ends, low - NEAR_MARGIN * extent, high + NEAR_MARGIN * extent) for ends in possible_limits]
    return limits_of([*core, *medians, *near], [])


def _known(predicted: Predicted) -> BoolArray:
    """Return where a prediction is calibrated, or everywhere where it is nowhere."""
    return predicted.is_calibrated if predicted.is_calibrated.any() else np.ones_like(predicted.is_calibrated)


def draw_predicted(
    axis: Axes, predicted: Predicted, unit: StressUnit, limits: tuple[float, float], prob: float = 0.95
) -> None:
    """Draw bands, measurements and where nothing was measured; ``limits`` of the stress are in MPa."""
    scale, percent, abscissa = unit.to_mpa, f"{100 * prob:.4g} %", predicted.abscissa
    ends = limits[0] / scale, limits[1] / scale
    for interval, strength, label in (
        (predicted.measurements, 0.18, f"{percent} of measurements"),
        (predicted.stress, 0.38, f"{percent} of the stress"),
    ):
        low, high = within(interval.low / scale, ends), within(interval.high / scale, ends)
        band(axis, abscissa, low, high, strength=strength, label=label, ways=predicted.ways)
    median = within(predicted.stress.median / scale, ends)
    line(axis, abscissa, median, label="predicted median", ways=predicted.ways)
    margin = 0.02 * max(float(np.ptp(abscissa)), 0.1 * abs(float(abscissa.max())))
    axis.set_xlim(abscissa.min() - margin, abscissa.max() + margin)
    axis.set_ylim(ends)
    in_range = _known(predicted)
    cut_off(
        axis, predicted.measurements.low[in_range] / scale, predicted.measurements.high[in_range] / scale, unit.name
    )
    axis.locator_params(axis="x", nbins=6)
    size = relative_size()
    if predicted.calibrated is not None:
        outside(axis, *predicted.calibrated, "extrapolated")
    elif not predicted.is_calibrated.all():
        farther = abscissa[~predicted.is_calibrated]
        axis.plot(farther, np.zeros_like(farther), "|", color=BASE, ms=8 * size, transform=axis.get_xaxis_transform(),
                  label="extrapolated", clip_on=False)  # fmt: skip
    if predicted.measured is None:
        return
    shown = predicted.measured
    for is_shown, face, label in (
        (shown.is_calibrated, INK, "measured"),
        (~shown.is_calibrated, "white", "measured beyond"),
    ):
        if is_shown.any():
            points(axis, shown.abscissa[is_shown], shown.stress[is_shown] / scale, label=label,
                   mec=INK, mfc=face, ms=3.6 * size, mew=0.9 * size)  # fmt: skip


def curves(drawn: Panels, stretch: FloatArray, stress: FloatArray, mode: LoadingMode, unit: StressUnit) -> None:
    """Draw the stresses (N, g), MPa, of draws at stretches (g,), and their median."""
    (axis,), count = drawn.axes, len(stress)
    order = np.argsort(stretch, kind="stable")
    abscissa, values = stretch[order], stress[:, order] / unit.to_mpa
    median = np.median(values, axis=0)
    limits = limits_of([median], [np.quantile(values, [0.005, 0.995], axis=0)])
    indices = np.linspace(0, count - 1, min(count, MOST_DRAWN)).round().astype(int)
    label = f"{count} draws" if len(indices) == count else f"{len(indices)} of {count} draws"
    for number, row in enumerate(values[indices]):
        line(axis, abscissa, within(row, limits), color=BASE, width=0.6, alpha=0.5, label="" if number else label)
    line(axis, abscissa, median, color=BAND, label="median of the draws")
    axis.set_ylim(limits)
    axis.set_xlabel(mode.controls[0].name)
    axis.set_ylabel(f"{mode.stresses[0]} [{unit.name}]")
    if drawn.is_new:
        axis.set_title(mode.name)
    drawn.explain()


def _measured(solution: Solution, mode: LoadingMode, channel: int, control: int) -> Measured | None:
    """Return what the fitted tests measured of a stress of a mode, where they did, against one of its controls."""
    data = solution.model.experiment
    curves = [curve for curve in data.curves if (curve.mode, curve.channel) == (mode, channel)]
    if not curves or not solution.is_of_data:
        return None
    points, stress = (np.concatenate([getattr(curve, name) for curve in curves]) for name in ("points", "stress"))
    return Measured(values_of_control(points, control), stress, np.ones(len(stress), dtype=bool))
