"""Predictions of a run in any loading mode, compared with measurements of that mode if given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.assessment.stability import calibrated_range, is_calibrated
from tissuq.drawing.panels import panels
from tissuq.errors import InputError, ModelError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.headed_tables import headed, in_unit
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material
from tissuq.mechanics.invariants import largest_invariants
from tissuq.model.tolerances import AS_TESTED, SPECIMEN
from tissuq.posterior.netcdf import LabelledGroup, save_groups
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band, extrapolation_share, predict_bands, speaks_of, stress_ratio
from tissuq.studies.earlier_run import load
from tissuq.studies.prediction_picture import draw_prediction
from tissuq.studies.prediction_settings import POINTS

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["Prediction", "predict_run", "predicted"]

FloatArray = NDArray[np.float64]

ROWS_SHOWN = 9
"""Rows of a notebook's table."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Bands of every stress of a loading mode, with and without discrepancy and noise, and how they do on data.

    Attributes
    ----------
    posterior : Posterior
    mode : LoadingMode
    points : (g,) or (g, c) array
        Values of the mode's controls.
    prob : float
        Probability of the bands.
    stress_type : str
        ``"engineering"`` or ``"cauchy"``.
    kinds : tuple of bool
        With the discrepancy and without, as far as they differ and the discrepancy says something about the mode.
    curves : mapping of (int, bool, bool) to Band
        Median, low and high (MPa) by number of the stress, with the discrepancy or not, and with noise or not.
    extrapolated : mapping of int to (g,) array
        Share of the variance of each stress, with the discrepancy, that is due to how the energy goes on beyond the
        measured range, by the number of the stress; 0 in that range.
    data : Experiment, optional
        The measurements that it is compared with.
    scores : pandas.DataFrame, optional
        How they are predicted (`Posterior.scores`), with the discrepancy or without as column ``discrepancy``; in the
        unit of the run.
    warnings : tuple of str
        Warnings about fit and prediction.
    """

    posterior: Posterior
    mode: LoadingMode
    points: FloatArray
    prob: float
    stress_type: str
    kinds: tuple[bool, ...]
    curves: Mapping[tuple[int, bool, bool], Band]
    extrapolated: Mapping[int, FloatArray]
    data: Experiment | None
    scores: pd.DataFrame | None
    warnings: tuple[str, ...]

    @property
    def unit(self) -> StressUnit:
        """The unit in which the run's measurements give stresses."""
        return stress_unit(self.posterior.model.experiment.stress_unit)

    @cached_property
    def bands(self) -> Mapping[tuple[int, bool, bool], pd.DataFrame]:
        """The `curves` as tables with the columns stretch, median, low and high, in the unit of the run."""
        import pandas as pd

        columns, unit = ["median", "low", "high"], self.unit.name
        return {key: in_unit(pd.DataFrame(vars(band)), columns, unit) for key, band in self.curves.items()}

    @property
    def stresses(self) -> tuple[str, ...]:
        """The names of the predicted stresses."""
        name = "Cauchy stress" if self.stress_type == "cauchy" else "engineering stress"
        return tuple(stress.replace("engineering stress", name) for stress in self.mode.stresses)

    @property
    def controls(self) -> dict[str, FloatArray]:
        """The points by control: stretch, and stretch2 of a second one."""
        columns = self.points.reshape(len(self.points), -1).T
        return {f"stretch{number if number > 1 else ''}": column for number, column in enumerate(columns, 1)}

    @cached_property
    def is_calibrated(self) -> NDArray[np.bool_]:
        """At which points (g,) the invariants stay in the range that was measured."""
        return is_calibrated(self.posterior.model.experiment, self.mode, self.points)

    @property
    def is_data_calibrated(self) -> NDArray[np.bool_]:
        """Of which measurements (n,) that is true."""
        assert self.data is not None  # noqa: S101 (requested only if there are measurements)
        return is_calibrated(self.posterior.model.experiment, self.mode, self.data.stretch)

    @property
    def calibrated_range(self) -> tuple[float, float] | None:
        """The ends of that range, where the mode has one control."""
        return _range(self.posterior, self.mode)

    def measured(self, channel: int) -> FloatArray:
        """Return the measurements (n,) of a stress that it is compared with, MPa."""
        assert self.data is not None  # noqa: S101 (requested only if there are measurements)
        ratio = self.mode.paths[channel].cauchy_ratio(self.data.stretch) if self.stress_type == "cauchy" else 1.0
        return np.asarray(self.data.curves[channel].stress * ratio)

    def plot(self, ax: Any = None) -> Any:
        """Draw every stress with the discrepancy, where it is known, and of the material alone: a panel each.

        Stretches at which an invariant is larger than in the fitted measurements are hatched.

        Parameters
        ----------
        ax : Axes, or array of Axes, optional
            As many as there are stresses times `kinds`; unless given, a new figure is made in `matplotlib.pyplot`.

        Returns
        -------
        Axes, or (n,) array of Axes
            Row by row: the kinds of the first stress, those of the next.
        """
        with panels(ax, len(self.stresses) * len(self.kinds)) as drawn:
            draw_prediction(drawn.axes, self)
            drawn.explain()
        return drawn.result

    def _repr_html_(self) -> str:
        """Return some rows of the stress as a table, which notebooks show; `table` has all."""
        import pandas as pd

        unit, places = self.unit, np.unique(np.linspace(0, len(self.points) - 1, ROWS_SHOWN).round().astype(int))
        kind = self.kinds[0]
        tables = []
        for channel, name in enumerate(self.stresses):
            bands = [self.curves[channel, kind, noise] for noise in (False, True)]
            ends = {end: getattr(bands[0], end) for end in ("median", "low", "high")}
            ends |= {f"predictive_{end}": getattr(bands[1], end) for end in ("low", "high")}
            columns = self.controls | {key: values / unit.to_mpa for key, values in ends.items()}
            table = pd.DataFrame({key: values[places] for key, values in columns.items()})
            table["is_calibrated"] = self.is_calibrated[places]
            shown = headed(table, unit).to_html(index=False, float_format="{:.4g}".format)
            tables.append(f"<p>{self.mode.name}, {name} [{unit.name}]</p>{shown}")
        return "".join(tables)

    @property
    def table(self) -> pd.DataFrame:
        """All bands: a row for every stress and point, and the unit of stress in the names of the columns.

        Columns measured (of several stresses), stretch (and stretch2), is_calibrated; ``median [kPa]``, low, high of
        the stress with the discrepancy and predictive_low, predictive_high of a measurement of it; extrapolated, the
        share of the variance of the stress that is due to how the energy goes on beyond the range; and the bands of the
        material alone, from alone_median on.
        """
        import pandas as pd

        return pd.DataFrame(self.rows)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of `table`."""
        rows: list[dict[str, Any]] = []
        unit = self.unit
        for channel, name in enumerate(self.stresses):
            columns: dict[str, FloatArray | NDArray[np.bool_]] = self.controls | {"is_calibrated": self.is_calibrated}
            for kind in self.kinds:
                prefix = "" if kind else "alone_"
                stress, noisy = (self.curves[channel, kind, noise] for noise in (False, True))
                bands = {end: getattr(stress, end) for end in ("median", "low", "high")}
                bands |= {f"predictive_{end}": getattr(noisy, end) for end in ("low", "high")}
                columns |= {f"{prefix}{name} [{unit.name}]": band / unit.to_mpa for name, band in bands.items()}
                columns |= {"extrapolated": self.extrapolated[channel]} if kind else {}
            label = {"measured": name} if len(self.stresses) > 1 else {}
            values = (column.tolist() for column in columns.values())
            rows += [label | dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)]
        return rows

    @property
    def data_set(self) -> xr.Dataset:
        """All bands as labelled arrays, with the measurements where there are some; in the unit of the run.

        Dimensions discrepancy and noise (``"with"``, ``"without"``), stress, and stretch, or point where the mode has
        several controls.
        """
        return self._group.to_dataset()

    @property
    def _group(self) -> LabelledGroup:
        along = "stretch" if self.points.ndim == 1 else "point"
        words = {kind: "with" if kind else "without" for kind in (True, False)}
        order = [*product(self.kinds, (True, False), range(len(self.stresses)))]
        shape = len(self.kinds), 2, len(self.stresses), len(self.points)
        arrays = {
            end: np.reshape([getattr(self.curves[channel, kind, noise], end) for kind, noise, channel in order], shape)
            / self.unit.to_mpa
            for end in ("median", "low", "high")
        }
        units, dims = {"units": self.unit.name}, ("discrepancy", "noise", "stress", along)
        by_name: dict[str, Any] = {
            "median": (dims, arrays["median"], units | {"long_name": "median stress"}),
            "low": (dims, arrays["low"], units | {"long_name": f"lower end of the {self.prob:.12g} interval"}),
            "high": (dims, arrays["high"], units | {"long_name": f"upper end of the {self.prob:.12g} interval"}),
            "is_calibrated": (along, self.is_calibrated.astype(np.int8), {"units": "1"}),
        }
        coordinates: dict[str, Any] = {name: (along, column, {"units": "1"}) for name, column in self.controls.items()}
        coordinates |= {"discrepancy": [words[kind] for kind in self.kinds], "noise": [words[True], words[False]]}
        coordinates |= {"stress": list(self.stresses)}
        if self.data is not None:
            stress = [self.measured(channel) for channel in range(len(self.stresses))]
            by_name["measured"] = (("stress", "measurement"), np.array(stress) / self.unit.to_mpa, units)
            for number, column in enumerate(self.data.stretch.reshape(len(self.data), -1).T, 1):
                name = f"measured_stretch{number if number > 1 else ''}"
                by_name[name] = ("measurement", column, {"units": "1"})
        return LabelledGroup(by_name, coordinates, self._labels)

    @property
    def _labels(self) -> dict[str, Any]:
        model, ends = self.posterior.model, self.calibrated_range
        labels = {"loading_mode": self.mode.name, "stress_type": self.stress_type, "prob": self.prob}
        labels |= {"material": model.material.name, "discrepancy": model.discrepancy.name}
        labels |= {"fitted_to": model.experiment.name, "stress_unit_of_the_run": self.unit.name}
        return labels | ({} if ends is None else {"calibrated_low": ends[0], "calibrated_high": ends[1]})

    def save(self, path: str | Path) -> None:
        """Write `data_set` as NetCDF."""
        save_groups({"/": self._group}, Path(path))


def predict_run(
    run: str | Path, discrepancy: str | None = None, material: Material | None = None, **options: Any
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
    is_beyond, shares = ~is_calibrated(posterior.model.experiment, mode, grid), np.zeros(len(grid))
    if is_beyond.any():
        without = _bands(posterior, mode, grid[is_beyond], channel, True, errs_beyond=False, **options)[False]
        beyond = Band(*(column[is_beyond] for column in vars(band).values()))
        shares[is_beyond] = extrapolation_share(beyond, without)
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
    ends = _range(posterior, mode)
    if ends is not None:
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


def _range(posterior: Posterior, mode: LoadingMode) -> tuple[float, float] | None:
    return calibrated_range(posterior.model.experiment, mode) if len(mode.controls) == 1 else None


def _scores(posterior: Posterior, data: Experiment, kinds: tuple[bool, ...], options: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    tables = {kind: posterior.scores(data, discrepancy=kind, **options) for kind in kinds}
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
    outside_counts = [(int((~is_calibrated(model.experiment, mode, points)).sum()), len(points), "points")]
    if data is not None:
        is_inside = is_calibrated(model.experiment, mode, data.stretch)
        outside_counts.append((int((~is_inside).sum()), len(data), "measurements"))
    outside = " and ".join(f"{count} of {total} {what}" for count, total, what in outside_counts if count)
    if outside:
        largest = max((shares.max() for shares in extrapolated.values()), default=0.0)
        due = f"; beyond, up to {largest:.0%} of the variance of the stress is due to how the energy goes on"
        calibrated = f"{_calibrated_in_words(posterior, mode)}{due if largest else ''}"
        texts.append(f"{outside} lie outside the measured range: {calibrated}.")
    if data is not None and not was_fitted and model.tolerances.estimand in (AS_TESTED, SPECIMEN):
        texts.append(
            f"the bands of this run are of {model.tolerances.meaning}: they do not cover another specimen. To include "
            "the spread between specimens and tests, fit with --estimand tissue."
        )
    return texts


def _calibrated_in_words(posterior: Posterior, mode: LoadingMode) -> str:
    """Return up to where both invariants were measured."""
    if ends := _range(posterior, mode):
        low, high = ends
        return f"in mode {mode.name} the run is calibrated from {low:.4g} to {high:.4g} ({mode.controls[0].name})"
    I1, I2 = largest_invariants(posterior.model.experiment.states)
    return f"the run is calibrated up to I1 - 3 = {I1:.3g} and I2 - 3 = {I2:.3g}"
