"""Predictions of a run: what the settings, or a call in Python, ask for, and the warnings about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.assessment.stability import measured_range, measured_states
from tissuq.errors import InputError, ModelError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.mechanics import Material
from tissuq.model.tolerances import AS_TESTED, SPECIMEN
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band, extrapolation_share, predict_bands, speaks_of, stress_ratio
from tissuq.studies.earlier_run import load
from tissuq.studies.prediction import Prediction, calibrated_points, range_of
from tissuq.studies.run_settings import POINTS, PredictionSettings

if TYPE_CHECKING:
    import pandas as pd


def predict_run(
    run: str | Path, discrepancy: str | None = None, material: str | Material | None = None, **options: Any
) -> Prediction:
    """Predict the stress in a loading mode from a run of ``tissuq fit``.

    Parameters
    ----------
    run : str or Path
        The run folder.
    discrepancy, material
        As for `tissuq.load`.
    options
        mode : str or LoadingMode, by default that of the data, or else of the run.
        stretch : (g,) array, or (g, c) for a mode with c controls; by default ``points`` stretches, 101 unless said,
        over the range in which both invariants were measured; beside data, over theirs, too, and on their side of rest.
        prob : float, probability of the bands, 0.95 unless said.
        stress_type : ``"engineering"`` or ``"cauchy"``.
        data : Experiment, measurements of that mode to compare with.

    Returns
    -------
    Prediction

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When the run cannot be used (`tissuq.load`), or cannot predict what is asked for.

    Examples
    --------
    >>> import tissuq as tq
    >>> planar = tq.datasets.load("rubber-treloar-planar")
    >>> found = tq.predict_run("runs/rubber-treloar-uniaxial", data=planar)  # doctest: +SKIP
    >>> found.table, found.scores, found.warnings  # doctest: +SKIP
    """
    return predicted(load(run, discrepancy, material), **options)


def predicted(
    posterior: Posterior,
    *,
    mode: str | LoadingMode | None = None,
    stretch: ArrayLike | None = None,
    points: int = POINTS,
    prob: float = 0.95,
    stress_type: str = "engineering",
    data: Experiment | None = None,
) -> Prediction:
    """Return what a posterior predicts in a loading mode; the arguments are the options of `predict_run`."""
    data = data and data.in_means_as(posterior.model.experiment)
    target = _mode(posterior, mode, data)
    grid = _points(posterior, target, stretch, points, data)
    model = posterior.model
    kinds = (True, False) if model.discrepancy.parameters and speaks_of(model, target) else (False,)
    options: dict[str, Any] = {"prob": prob, "stress_type": stress_type}
    curves = {
        (channel, kind, noise): curve
        for channel, kind in product(range(len(target.stresses)), kinds)
        for noise, curve in _bands(posterior, target, grid, channel, kind, **options).items()
    }
    extrapolated = {
        channel: _extrapolated(posterior, target, grid, channel, curves[channel, True, False], **options)
        for channel in range(len(target.stresses) if True in kinds else 0)
    }
    scores = None if data is None else _scores(posterior, data, kinds, options)
    warnings = tuple(_prediction_warnings(posterior, target, grid, data, extrapolated))
    return Prediction(posterior, target, grid, prob, stress_type, kinds, curves, extrapolated, data, scores, warnings)


def _extrapolated(
    posterior: Posterior, mode: LoadingMode, grid: FloatArray, channel: int, band: Band, **options: Any
) -> FloatArray:
    """Return the share (g,) of the variance of a stress due to how the energy goes on beyond the measured range."""
    is_beyond, shares = ~calibrated_points(posterior, mode, grid), np.zeros(len(grid))
    if is_beyond.any():
        without = _bands(posterior, mode, grid[is_beyond], channel, True, errs_beyond=False, **options)[False]
        shares[is_beyond] = extrapolation_share(band.at(is_beyond), without)
    return shares


def _bands(
    posterior: Posterior,
    mode: LoadingMode,
    grid: FloatArray,
    channel: int,
    kind: bool,
    *,
    prob: float,
    stress_type: str,
    errs_beyond: bool = True,
) -> dict[bool, Band]:
    """Return median, low and high of a stress at points, without noise and with it; refuse what is no number."""
    options: dict[str, Any] = {"discrepancy": kind, "prob": prob, "mode": mode, "channel": channel}
    ratio, noises = stress_ratio(stress_type, mode, channel)(grid), (False, True)
    with np.errstate(over="ignore", invalid="ignore"):
        bands = [
            replace(band, median=ratio * band.median, low=ratio * band.low, high=ratio * band.high)
            for band in predict_bands([(1.0, posterior.solution)], grid, noises, errs_beyond=errs_beyond, **options)
        ]
    for band in bands:
        is_finite = np.isfinite([band.median, band.low, band.high]).all(axis=0)
        if not is_finite.all():
            value = grid.reshape(len(grid), -1)[~is_finite, 0][0]
            raise ModelError(
                f"the predicted stress overflows at a {mode.controls[0].name} of {value:g}: predict nearer to the "
                "measured range."
            )
    return dict(zip(noises, bands, strict=True))


def _mode(posterior: Posterior, mode: str | LoadingMode | None, data: Experiment | None) -> LoadingMode:
    """Return the mode to predict, which must be that of the data."""
    modes = posterior.model.experiment.modes
    if data is not None and len(data.tests) > 1:
        raise InputError(f"'{data.name}' holds several tests: give the measurements of one test to compare with.")
    if mode is None and data is None and len(modes) > 1:
        names = ", ".join(measured_mode.name for measured_mode in modes)
        raise InputError(f"the run has tests in several modes ({names}): choose the mode to predict.")
    target = loading_mode(mode) if mode is not None else data.mode if data is not None else modes[0]
    if data is not None and data.mode != target:
        raise InputError(
            f"the measurements '{data.name}' are of mode {data.mode.name}, but the predicted mode is "
            f"{target.name}: give measurements of that mode."
        )
    return target


def _points(
    posterior: Posterior, mode: LoadingMode, stretch: ArrayLike | None, points: int, data: Experiment | None
) -> FloatArray:
    """Return the points at which to predict: the requested ones, or the default ones."""
    if len(mode.controls) > 1 and stretch is not None and data is not None:
        raise InputError(
            f"mode '{mode.name}' has several controls: give either stretches or measurements to compare with, not both."
        )
    if stretch is not None:
        return checked_points(mode, stretch)
    if len(mode.controls) == 1:
        ends = measured_range(posterior.model.experiment, mode)
        return np.linspace(*(ends if data is None else _beside(ends, mode, data.stretch)), points)
    measured = [test.stretch for test in posterior.model.experiment.tests if test.mode == mode]
    if data is None and not measured:
        names = ", ".join(control.name for control in mode.controls)
        raise InputError(
            f"mode '{mode.name}' has several controls ({names}): give the values of each at which to predict (stretch "
            "and stretch2)."
        )
    return measured[0] if data is None else data.stretch


def _beside(ends: tuple[float, float], mode: LoadingMode, measured: FloatArray) -> tuple[float, float]:
    """Return the ends of a range on those sides of rest on which there are measurements, and no nearer than these."""
    reference, low, high = float(mode.reference), float(measured.min()), float(measured.max())
    return min(ends[0], low) if low < reference else reference, max(ends[1], high) if high > reference else reference


def _scores(posterior: Posterior, data: Experiment, kinds: tuple[bool, ...], options: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    unit = posterior.model.experiment.shown_unit.name
    tables = {kind: posterior.scores(data, discrepancy=kind, unit=unit, **options) for kind in kinds}
    for kind, table in tables.items():
        table.insert(3, "discrepancy", "with" if kind else "without")
    return pd.concat(tables.values(), ignore_index=True)


def _prediction_warnings(
    posterior: Posterior,
    mode: LoadingMode,
    points: FloatArray,
    data: Experiment | None,
    extrapolated: Mapping[int, FloatArray],
) -> list[str]:
    """Return the warnings about a prediction."""
    model, texts = posterior.model, []
    if not speaks_of(model, mode):
        measured = ", ".join(measured_mode.name for measured_mode in model.experiment.modes)
        texts.append(
            f"the discrepancy '{model.discrepancy.name}' is an error of the {measured} stress and does not apply to "
            f"the {mode.name} stress, which is predicted by the material alone. To predict with a discrepancy, fit "
            "with one that is an energy, such as 'auto'."
        )
    along, across, _ = mode.paths[0].at(mode.excursion([0.1])).moved(0.0).plane
    if across is None and posterior.solution.direction_probability:
        meaning = (
            "its one stress is predicted as the mean of those of axes 1 and 2"
            if along is None
            else "predicted is a test along axis 1 whose lateral stretches are equal, as those of an isotropic material"
        )
        texts.append(f"the fit allows a preferred direction, of which {mode.name} loading knows nothing: {meaning}.")
    was_fitted = data is not None and any(test.has_measurements_of(data) for test in model.experiment.tests)
    if was_fitted:
        texts.append(
            "the run was fitted to these measurements: their prediction checks the fit and says nothing about "
            "other data."
        )
    outside_counts = [(int((~calibrated_points(posterior, mode, points)).sum()), len(points), "points")]
    if data is not None:
        is_inside = calibrated_points(posterior, mode, data.stretch)
        outside_counts.append((int((~is_inside).sum()), len(data), "measurements"))
    outside = " and ".join(f"{count} of {total} {what}" for count, total, what in outside_counts if count)
    if outside:
        largest = max((shares.max() for shares in extrapolated.values()), default=0.0)
        states = measured_states(model, is_directed=posterior.solution.is_directed)
        due = f"; beyond, up to {100 * largest:.0f} % of the variance of the stress is due to how the energy goes on"
        if states.contain(mode.paths[0].at(points)).all():
            due = ", and I1 and I2 are no larger beyond it than in the tests of the run"
        calibrated = f"{_calibrated_in_words(posterior, mode)}{due if largest else ''}"
        texts.append(f"{outside} lie outside the measured range: {calibrated}.")
    if model.experiment.averaged_at_most > 1:
        is_of_single = data is not None and data.averaged_at_most == 1
        texts.append(
            f"the bands of measurements are those of {model.experiment.rows_name}, as were fitted: single ones scatter "
            f"more{', so that too many of those that are compared with them lie outside' if is_of_single else ''}."
        )
    if data is not None and not was_fitted and model.tolerances.estimand in (AS_TESTED, SPECIMEN):
        texts.append(
            f"the bands of this run are of {model.meaning}: they do not cover another specimen. To include "
            "the spread between specimens and tests, fit with --estimand tissue."
        )
    return texts


def _calibrated_in_words(posterior: Posterior, mode: LoadingMode) -> str:
    """Return up to which states was measured."""
    if ends := range_of(posterior, mode):
        low, high = ends
        if np.isclose(low, high):
            return f"in mode {mode.name} a stretch along an axis of the test was not measured, and it has a direction"
        return f"in mode {mode.name} the run is calibrated from {low:.4g} to {high:.4g} ({mode.controls[0].name})"
    states = measured_states(posterior.model, is_directed=posterior.solution.is_directed)
    stretches = [f"of {(1 + low) ** 0.5:.4g} to {(1 + high) ** 0.5:.4g}" for low, high in states.strains]
    along_axes = "".join(f", stretch {ends} along axis {axis}" for axis, ends in enumerate(stretches, 1))
    return f"the run is calibrated up to I1 - 3 = {states.I1:.3g} and I2 - 3 = {states.I2:.3g}{along_axes}"


def run_prediction(
    settings: PredictionSettings,
    folder: Path = Path(),
    step: Callable[[str], None] = lambda text: None,
    law: Material | None = None,
) -> Prediction:
    """Predict what the settings ask for from a run; relative paths lie in ``folder``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When run, files or settings cannot be used.
    """
    step("reading")
    mode = settings.mode_in(folder, law)
    options: dict[str, Any] = {name: getattr(settings, name) for name in ("points", "prob", "stress_type")}
    options |= {"mode": mode, "stretch": settings.points_of(mode)}
    if settings.data is not None:
        options["data"] = settings.data.model_copy(update={"mode": mode}).experiment(folder)
    step("predicting")
    return predict_run(folder / settings.run, settings.discrepancy, settings.law_of(law), **options)
