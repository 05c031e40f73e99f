"""What the chart on a page shows: measurements and bands of every formulation and stress, and the material by itself.

The page draws it with uPlot (MIT licence, 51 kB, embedded); without scripts and in print the still figure stands there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import TissuqError
from tissuq.experiments.curve import Curve
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.units import StressUnit
from tissuq.mechanics import stress_basis
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import predict_band, predict_bands

__all__ = ["chart_data"]

FloatArray = NDArray[np.float64]

GRID_POINTS = 41
"""Stretches at which bands are drawn, besides those of the measurements."""
MAX_MEASUREMENTS = 1000
"""Measurements of a curve that are drawn, spread over it."""
DIGITS = 5
"""Significant digits of the numbers on the page."""
SLIDER_SDS = 5.0
"""Standard deviations on each side of the mean that a slider of a parameter covers."""


class _View(NamedTuple):
    """A stress to draw: its name, mode and channel, the points of its curve, and the measurements there (or nan)."""

    name: str
    mode: LoadingMode
    channel: int
    points: FloatArray
    measured: FloatArray


def chart_data(posteriors: Mapping[str, Posterior], main: str, unit: StressUnit) -> dict[str, Any]:
    """Return the data of the chart, stresses in a unit.

    Parameters
    ----------
    posteriors : mapping of str to Posterior
        On one experiment, by formulation.
    main : str
        The formulation that is shown first, and alone with loading modes that were not measured.
    unit : StressUnit

    Returns
    -------
    dict
        ``views``, one a formulation and stress, with columns x, measured, low, median, high (of measurements),
        stress_low, stress_high (of the stress itself), alone_low, alone, alone_high (of the material alone) and basis
        (the stress of the material per unit of each parameter); ``parameters``, the linear ones of the material; and
        ``unit``.
    """
    names = sorted(posteriors, key=lambda name: name != main)
    views = [
        _drawn(name, posteriors[name], view, unit)
        for name in names
        for view in (*_measured_views(posteriors[name].model.experiment), *_other_views(posteriors[name], name == main))
    ]
    return {
        "unit": unit.name,
        "views": [view for view in views if view],
        "parameters": _sliders(posteriors[main], unit),
    }


def _measured_views(experiment: Experiment) -> Iterator[_View]:
    for curve in experiment.curves:
        points, measured = _with_grid(curve)
        name = f"{curve.name}, {curve.quantity}" if len(experiment.curves) > 1 else curve.mode.name
        yield _View(name, curve.mode, curve.channel, points, measured)


def _with_grid(curve: Curve) -> tuple[FloatArray, FloatArray]:
    """Return points in the order of the abscissa, measured ones with a grid between them, and the stresses or nan."""
    order = np.argsort(curve.abscissa, kind="stable")
    rows = order[np.unique(np.linspace(0, len(order) - 1, min(len(order), MAX_MEASUREMENTS)).astype(int))]
    points, stress = curve.points[rows], curve.stress[rows]
    if points.ndim > 1:
        return points, stress
    grid = np.linspace(points.min(), points.max(), GRID_POINTS)
    points, stress = np.r_[points, grid], np.r_[stress, np.full(GRID_POINTS, np.nan)]
    order = np.argsort(points, kind="stable")
    return points[order], stress[order]


def _other_views(posterior: Posterior, is_main: bool) -> Iterator[_View]:
    """Yield the loading modes of one stretch that were not measured, over the strains that were."""
    measured = {mode.name for mode in posterior.model.experiment.modes}
    for name, stable_range in posterior.stable_ranges.items() if is_main else ():
        if name not in measured:
            points = np.linspace(stable_range.low, stable_range.high, GRID_POINTS)
            yield _View(f"{name} (predicted)", loading_mode(name), 0, points, np.full(GRID_POINTS, np.nan))


def _drawn(formulation: str, posterior: Posterior, view: _View, unit: StressUnit) -> dict[str, Any]:
    """Return the columns of a view, none where a formulation says nothing about it."""
    model = posterior.model
    options: dict[str, Any] = {"mode": view.mode, "channel": view.channel}
    unique, rows = np.unique(view.points, axis=0, return_inverse=True)
    try:
        of_measurements, of_stress = predict_bands([(1.0, posterior.solution)], unique, [True, False], **options)
        alone = predict_band(posterior.solution, unique, noise=False, discrepancy=False, **options)
    except TissuqError:
        return {}
    bent = [float(posterior.marginals[symbol].quantile(0.5)) for symbol in model.bent_symbols]
    states = model.experiment.states_at(view.points, view.mode, view.channel)
    columns = {
        "measured": view.measured,
        "low": of_measurements.low[rows],
        "median": of_measurements.median[rows],
        "high": of_measurements.high[rows],
        "stress_low": of_stress.low[rows],
        "stress_high": of_stress.high[rows],
        "alone_low": alone.low[rows],
        "alone": alone.median[rows],
        "alone_high": alone.high[rows],
    }
    return {
        "formulation": formulation,
        "name": view.name,
        "control": view.mode.controls[0].name,
        "x": _rounded(view.mode.paths[view.channel].abscissa(view.points)),
        **{name: _rounded(column / unit.to_mpa) for name, column in columns.items()},
        "basis": [_rounded(column) for column in stress_basis(model.material, states, bent).T],
    }


def _sliders(posterior: Posterior, unit: StressUnit) -> list[dict[str, Any]]:
    """Return the material's linear parameters with mean and the range of a slider, in a unit of stress."""
    sliders = []
    for parameter in posterior.model.material.parameters:
        if parameter.is_linear:
            marginal = posterior.marginals[parameter.symbol]
            ends = marginal.mean - SLIDER_SDS * marginal.sd, marginal.mean + SLIDER_SDS * marginal.sd
            value, low, high = _rounded(np.array([marginal.mean, *ends]) / unit.to_mpa)
            sliders.append({"name": parameter.symbol, "value": value, "low": low, "high": high})
    return sliders


def _rounded(values: FloatArray) -> list[float | None]:
    """Return numbers with few digits; None for those that are none."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()]
