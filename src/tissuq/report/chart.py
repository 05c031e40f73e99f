"""What the chart on a page shows: measurements and bands of every formulation and stress, and the material by itself.

The page draws it with uPlot (MIT licence, 51 kB, embedded); without scripts and in print the still figure stands there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.drawing.panels import limits_of
from tissuq.errors import TissuqError
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.modes.mode import values_of_control
from tissuq.experiments.units import StressUnit
from tissuq.mechanics import stress_basis
from tissuq.pictures.curves import Described, has_discrepancy, held_along, is_determined, rows_where_held
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band, predict_bands
from tissuq.report.figures import described_curves

GRID_POINTS = 41
"""Stretches at which the bands of a mode that was not measured are drawn."""
MAX_RATIO = 4.0
"""Of the stresses at both ends of a mode that was not measured, as far as its axis holds them: others run out."""
MAX_MEASUREMENTS = 1000
"""Measurements of a curve that are drawn, spread over it."""
DIGITS = 5
"""Significant digits of the numbers on the page."""
SLIDER_SDS, SLIDER_TAIL = 5.0, 0.001
"""Reach of a slider: standard deviations on each side of the mean, as far as the prior reaches; for an exponent the
probability beyond an end."""
NODES, MAX_ERROR = 9, 0.01
"""Values of an exponent at which the material's curves are known, and error of these between them over the largest."""


class _Bands(NamedTuple):
    """Bands of new measurements and of the stress, with the discrepancy and without where there is one."""

    measurements: Band
    stress: Band
    alone: Band | None


class _Test(NamedTuple):
    """A stress to draw: its name, mode, channel, points (g,) or (g, c) along one path, and the measurements, MPa.

    After them the number of the control that it is drawn against, and the bands, unless a posterior says nothing of it.
    """

    name: str
    mode: LoadingMode
    channel: int
    points: FloatArray
    measured_at: FloatArray
    measured: FloatArray
    control: int = 0
    is_curve: bool = True
    is_back: BoolArray = np.zeros(0, dtype=bool)
    bands: _Bands | None = None

    @property
    def abscissa(self) -> FloatArray:
        return values_of_control(self.points, self.control)


def chart_data(
    posteriors: Mapping[str, Posterior],
    main: str,
    unit: StressUnit,
    computed: Mapping[str, Sequence[Described]] | None = None,
) -> dict[str, Any]:
    """Return the data of the chart, stresses in a unit.

    Parameters
    ----------
    posteriors : mapping of str to Posterior
        On one experiment, by formulation.
    main : str
        The formulation that is shown first, and alone with loading modes that were not measured.
    unit : StressUnit
    computed : mapping of str to sequence of Described, optional
        What the posteriors say of their curves, of which nothing is computed anew.

    Returns
    -------
    dict
        ``tests``, one a stress, with x, the measurements, and basis (at every node of the exponent the stress of the
        material per unit of each linear parameter); ``views``, one a formulation and test, with low, median, high (of
        new measurements), stress_low, stress_high (of the stress itself), and alone_low, alone, alone_high (of the
        material alone, where there is a discrepancy and it is determined), and the limits of the axis; ``parameters``
        with the ranges of sliders, the linear ones first; ``nodes`` of an exponent that has a slider, or of its
        logarithm (``is_logarithm``); ``fixed``, the parameters that stay at their medians; and ``unit``.
    """
    described = computed or {name: described_curves(posterior) for name, posterior in posteriors.items()}
    posterior = posteriors[main]
    drawn = {name: list(_measured(described[name])) for name in sorted(posteriors, key=lambda name: name != main)}
    drawn[main] += _others(posterior)
    sliders = _Sliders(posterior, drawn[main], unit)
    views = [
        {"formulation": name, "test": number, **_columns(test.bands, test, unit)}
        for name, tests in drawn.items()
        for number, test in enumerate(tests)
        if test.bands is not None
    ]
    return {
        "unit": unit.name,
        "tests": [_test(test, sliders.basis(test), unit) for test in drawn[main]],
        "views": views,
        "parameters": sliders.parameters,
        "nodes": _rounded(sliders.nodes.values) if sliders.nodes else [],
        "is_logarithm": sliders.nodes is not None and sliders.nodes.is_logarithm,
        "fixed": sliders.fixed,
    }


def _measured(described: Sequence[Described]) -> Iterator[_Test]:
    """Yield the measured curves with their bands, of those with several paths each path.

    Bands that are no curve are drawn where the measurements are that are drawn.
    """
    for described_curve in described:
        curve = described_curve.curve
        name = curve.name if len(described) > 1 else curve.mode.name
        name += f", {curve.quantity}" if len(curve.mode.stresses) > 1 else ""
        pairs = zip(described_curve.ways, map(_spread, described_curve.measured_rows), strict=True)
        for number, ((indices, is_curve), rows) in enumerate(pairs, 1):
            shown = indices if is_curve else _spread(indices)
            points, way = described_curve.points[shown], ""
            if len(described_curve.ways) > 1 or rows_where_held(curve.mode, curve.points):
                way = f", {held_along(curve.mode, points) or f'path {number}'}"
            abscissa, stress, is_back = curve.drawn_at()[rows], curve.stress[rows], curve.is_back[rows]
            alone = described_curve.stress_alone.at(shown) if has_discrepancy(described_curve.solution) else None
            bands = _Bands(described_curve.measurements.at(shown), described_curve.stress.at(shown), alone)
            yield _Test(f"{name}{way}", curve.mode, curve.channel, points, abscissa, stress, curve.drawn_against,
                        is_curve, is_back, bands)  # fmt: skip


def _spread(indices: IndexArray) -> IndexArray:
    """Return so many places as are drawn, spread over all."""
    count = min(len(indices), MAX_MEASUREMENTS)
    return np.asarray(indices[np.unique(np.linspace(0, len(indices) - 1, count).astype(int))])


def _others(posterior: Posterior) -> Iterator[_Test]:
    """Yield the loading modes of one stretch that were not measured, over the strains that were, with their bands."""
    measured, none = {mode.name for mode in posterior.model.experiment.modes}, np.zeros(0)
    for name, stable_range in posterior.stable_ranges.items():
        if name not in measured:
            spaced = np.geomspace if stable_range.low > 0 else np.linspace  # curves bend where stretches are small
            points = spaced(stable_range.low, stable_range.high, GRID_POINTS)
            test = _Test(f"{name} (predicted)", loading_mode(name), 0, points, none, none)
            yield test._replace(bands=_predicted(posterior, test))


def _predicted(posterior: Posterior, test: _Test) -> _Bands | None:
    """Return the bands of a test that was not measured; none where a posterior says nothing about its mode."""
    weighted, material_stress = [(1.0, posterior.solution)], None
    try:
        measurements, stress = predict_bands(weighted, test.points, (True, False), mode=test.mode)
        if posterior.model.discrepancy.parameters:
            (material_stress,) = predict_bands(weighted, test.points, (False,), discrepancy=False, mode=test.mode)
    except TissuqError:
        return None
    return _Bands(measurements, stress, material_stress)


def _columns(bands: _Bands, test: _Test, unit: StressUnit) -> dict[str, Any]:
    columns = {
        "low": bands.measurements.low,
        "median": bands.measurements.median,
        "high": bands.measurements.high,
        "stress_low": bands.stress.low,
        "stress_high": bands.stress.high,
    }
    core = [test.measured, bands.measurements.median if len(test.measured) else _of_both_ends(bands.measurements)]
    if bands.alone is not None and is_determined(bands.alone, bands.stress):
        columns |= {"alone_low": bands.alone.low, "alone": bands.alone.median, "alone_high": bands.alone.high}
    limits = np.array(limits_of(core, list(columns.values())))
    columns["limits"] = limits
    return {name: _rounded(values / unit.to_mpa) for name, values in columns.items()}


def _of_both_ends(band: Band) -> FloatArray:
    """Return a median without what is far larger at one end than at the other, beside which that would be flat."""
    low, high = float(np.nanmin(band.median)), float(np.nanmax(band.median))
    smaller = min(-low, high)
    return np.clip(band.median, -MAX_RATIO * smaller, MAX_RATIO * smaller) if smaller > 0 else band.median


def _test(test: _Test, basis: FloatArray, unit: StressUnit) -> dict[str, Any]:
    """Return a test as the page has it, with its basis (nodes, columns, g) and measurements in a unit."""
    return {
        "name": test.name,
        "control": test.mode.controls[test.control].name,
        "is_curve": test.is_curve,
        "x": _rounded(test.abscissa),
        "measured_at": _rounded(test.measured_at),
        "measured": _rounded(test.measured / unit.to_mpa),
        "is_back": test.is_back.tolist(),
        "basis": [[_rounded(column) for column in columns] for columns in basis],
    }


class _Nodes(NamedTuple):
    """Chebyshev nodes of an exponent or of its logarithm, between which curves are interpolated."""

    values: FloatArray
    is_logarithm: bool

    @classmethod
    def within(cls, ends: FloatArray, *, is_logarithm: bool, shift: float = 0.0) -> _Nodes:
        """Return nodes between the ends of the exponent; shifted by one half, the places between them."""
        low, high = np.log(ends) if is_logarithm else ends
        angles = np.pi * (np.arange(NODES - 2 * shift) + shift) / (NODES - 1)
        return cls((low + high) / 2 + (high - low) / 2 * np.cos(angles), is_logarithm)

    @property
    def exponents(self) -> FloatArray:
        return np.exp(self.values) if self.is_logarithm else self.values


class _Sliders:
    """The material's parameters with mean and the range of a slider, and its curves from which any other is made.

    A curve is a linear combination of columns. Where there is one exponent, the columns are known at nodes of it,
    between which the page interpolates; several stay at their medians.
    """

    def __init__(self, posterior: Posterior, tests: Sequence[_Test], unit: StressUnit) -> None:
        self._model = posterior.model
        marginals, bent = posterior.marginals, posterior.model.bent_symbols
        self._medians = np.array([float(marginals[symbol].quantile(0.5)) for symbol in bent])
        self.parameters: list[dict[str, Any]] = []
        for parameter in self._model.material.parameters:
            if parameter.is_linear:
                mean, sd = marginals[parameter.symbol].mean, marginals[parameter.symbol].sd
                support = self._model.priors[parameter.symbol].support
                numbers = np.clip(mean + sd * np.array([0.0, -SLIDER_SDS, SLIDER_SDS]), *support) / unit.to_mpa
                self.parameters.append(_slider(parameter.symbol, unit.name, numbers))
        self.nodes: _Nodes | None = None
        self.fixed = list(bent)
        if len(bent) == 1:
            ends = np.array([marginals[bent[0]].quantile(tail) for tail in (SLIDER_TAIL, 1 - SLIDER_TAIL)], dtype=float)
            kinds = (False, True) if ends[0] > 0 else (False,)
            error, is_logarithm = min((self._error(ends, is_logarithm, tests), is_logarithm) for is_logarithm in kinds)
            if error < MAX_ERROR:
                self.nodes, self.fixed = _Nodes.within(ends, is_logarithm=is_logarithm), []
                self.parameters.append(_slider(bent[0], "", np.array([self._medians[0], *ends])))

    def basis(self, test: _Test) -> FloatArray:
        """Return the stress of the material at every node per unit of each linear parameter: (nodes, columns, g)."""
        return self._basis(test, self.nodes.exponents[:, None] if self.nodes else self._medians[None])

    def _basis(self, test: _Test, settings: FloatArray) -> FloatArray:
        states = self._model.experiment.states_at(test.points, test.mode, test.channel)
        return np.asarray(stress_basis(self._model.material, states, settings)).swapaxes(1, 2)

    def _error(self, ends: FloatArray, is_logarithm: bool, tests: Sequence[_Test]) -> float:
        """Return the largest error of a curve between nodes, over its largest value; infinite where it has no value."""
        from scipy.interpolate import BarycentricInterpolator

        nodes, between = (_Nodes.within(ends, is_logarithm=is_logarithm, shift=shift) for shift in (0.0, 0.5))
        errors = []
        for test in tests:
            try:
                at_nodes, exact = (self._basis(test, places.exponents[:, None]) for places in (nodes, between))
            except TissuqError:
                return np.inf
            if not (np.isfinite(at_nodes).all() and np.isfinite(exact).all()):
                return np.inf
            misses = np.abs(BarycentricInterpolator(nodes.values, at_nodes)(between.values) - exact).max(axis=-1)
            errors.append((misses / np.maximum(np.abs(exact).max(axis=-1), np.finfo(float).tiny)).max())
        return float(max(errors))


def _slider(name: str, unit: str, numbers: FloatArray) -> dict[str, Any]:
    value, low, high = _rounded(numbers)
    return {"name": name, "unit": unit, "value": value, "low": low, "high": high}


def _rounded(values: FloatArray) -> list[float | None]:
    """Return numbers with few digits; None for those that are none."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()]
