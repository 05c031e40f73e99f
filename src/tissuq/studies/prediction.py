"""`Prediction`: bands in any loading mode beside measurements of that mode if there are some, and their picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.assessment.stability import calibrated_range, is_calibrated
from tissuq.drawing.panels import panels
from tissuq.experiments.checked_arrays import headed, in_unit
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import values_of_control
from tissuq.experiments.units import StressUnit
from tissuq.pictures.curves import ways_of
from tissuq.pictures.prediction import Measured, Predicted, draw_predicted, predicted_limits
from tissuq.posterior.netcdf import LabelledGroup, save_groups
from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes


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
        """The unit in which stresses are shown."""
        return self.posterior.model.experiment.shown_unit

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
    def percent(self) -> str:
        """The probability of the bands, in words."""
        return f"{100 * self.prob:.4g} %"

    def called(self, kind: bool) -> str:
        """Return what is predicted: ``with the discrepancy gp``, or ``neo-hookean alone``."""
        model = self.posterior.model
        return f"with the discrepancy {model.discrepancy.name}" if kind else f"{model.material.name} alone"

    @property
    def controls(self) -> dict[str, FloatArray]:
        """The points by control: stretch, and stretch2 of a second one."""
        columns = self.points.reshape(len(self.points), -1).T
        return {f"stretch{number if number > 1 else ''}": column for number, column in enumerate(columns, 1)}

    @cached_property
    def is_calibrated(self) -> BoolArray:
        """At which points (g,) the state is among those that were measured."""
        return calibrated_points(self.posterior, self.mode, self.points)

    @property
    def is_compression_deduced(self) -> bool:
        """Whether points in compression count as measured, though no test was: other modes reach the same states."""
        controls, tests = self.mode.controls, self.posterior.model.experiment.tests
        if (
            len(controls) > 1
            or float(self.mode.reference) != 1
            or any((t.stretch < t.mode.reference).any() for t in tests)
        ):
            return False
        return bool((self.is_calibrated & (self.points < 1)).any())

    @property
    def is_data_calibrated(self) -> BoolArray:
        """Of which measurements (n,) that is true."""
        assert self.data is not None  # noqa: S101 (requested only if there are measurements)
        return calibrated_points(self.posterior, self.mode, self.data.stretch)

    @property
    def calibrated_range(self) -> tuple[float, float] | None:
        """The ends of that range, where the mode has one control."""
        return range_of(self.posterior, self.mode)

    def measured(self, channel: int) -> FloatArray:
        """Return the measurements (n,) of a stress that it is compared with, MPa."""
        assert self.data is not None  # noqa: S101 (requested only if there are measurements)
        ratio = self.mode.paths[channel].cauchy_ratio(self.data.stretch) if self.stress_type == "cauchy" else 1.0
        return np.asarray(self.data.curves[channel].stress * ratio)

    def scores_of(self, kind: bool) -> pd.DataFrame:
        """Return how all measurements of each stress are predicted, with the discrepancy or without."""
        assert self.scores is not None  # noqa: S101 (requested only if there are measurements)
        is_of_kind = self.scores["discrepancy"] == ("with" if kind else "without")
        return self.scores[is_of_kind & (self.scores["range"] == "all")]

    def plot(self, ax: Any = None) -> Any:
        """Draw every stress with the discrepancy, where it is known, and of the material alone: a panel each.

        Stretches outside the range that was measured are hatched.

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

        unit, rows = self.unit, np.unique(np.linspace(0, len(self.points) - 1, ROWS_SHOWN).round().astype(int))
        kind = self.kinds[0]
        tables = []
        for channel, name in enumerate(self.stresses):
            columns = self.controls | self._ends(channel, kind)
            table = pd.DataFrame({key: values[rows] for key, values in columns.items()})
            table["is_calibrated"] = self.is_calibrated[rows]
            shown = headed(table, unit).to_html(index=False, float_format="{:.4g}".format)
            tables.append(f"<p>{self.mode.name}, {name} [{unit.name}]</p>{shown}")
        return "".join(tables)

    def _ends(self, channel: int, kind: bool) -> dict[str, FloatArray]:
        """Return median and ends of the band of a stress, and ends of that of a measurement, in the unit of the run."""
        stress, noisy = (self.curves[channel, kind, noise] for noise in (False, True))
        ends = {"median": stress.median, "low": stress.low, "high": stress.high}
        ends |= {"predictive_low": noisy.low, "predictive_high": noisy.high}
        return {name: values / self.unit.to_mpa for name, values in ends.items()}

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
        for channel, name in enumerate(self.stresses):
            columns: dict[str, FloatArray | BoolArray] = self.controls | {"is_calibrated": self.is_calibrated}
            for kind in self.kinds:
                prefix = "" if kind else "alone_"
                ends = self._ends(channel, kind)
                columns |= {f"{prefix}{end} [{self.unit.name}]": values for end, values in ends.items()}
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
        kinds = {kind: "with" if kind else "without" for kind in (True, False)}
        order = [*product(self.kinds, (True, False), range(len(self.stresses)))]
        shape = len(self.kinds), 2, len(self.stresses), len(self.points)
        units, dims = {"units": self.unit.name}, ("discrepancy", "noise", "stress", along)
        by_name, interval = dict[str, Any](), f"of the {self.prob:.12g} interval"
        words = {"median": "median stress", "low": f"lower end {interval}", "high": f"upper end {interval}"}
        for end, long_name in words.items():
            values = [getattr(self.curves[channel, kind, noise], end) for kind, noise, channel in order]
            by_name[end] = (dims, np.reshape(values, shape) / self.unit.to_mpa, units | {"long_name": long_name})
        by_name["is_calibrated"] = (along, self.is_calibrated.astype(np.int8), {"units": "1"})
        coordinates: dict[str, Any] = {name: (along, column, {"units": "1"}) for name, column in self.controls.items()}
        coordinates |= {"discrepancy": [kinds[kind] for kind in self.kinds], "noise": [kinds[True], kinds[False]]}
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


def range_of(posterior: Posterior, mode: LoadingMode) -> tuple[float, float] | None:
    """Return the stretches up to which states were measured, where a mode has one control."""
    if len(mode.controls) > 1:
        return None
    return calibrated_range(posterior.model, mode, is_directed=posterior.solution.is_directed)


def calibrated_points(posterior: Posterior, mode: LoadingMode, points: FloatArray) -> BoolArray:
    """Return at which points (g,) or (g, c) of a mode the state is among those that were measured."""
    return is_calibrated(posterior.model, mode, points, is_directed=posterior.solution.is_directed)


def draw_prediction(axes: Sequence[Axes], prediction: Prediction) -> None:
    """Draw every stress and kind on axes of its own, row by row; the kinds of a stress on the same vertical axis."""
    count, across = len(prediction.stresses), len(prediction.kinds)
    for channel in range(count):
        row = axes[channel * across : (channel + 1) * across]
        predicted = [_shown(prediction, channel, kind) for kind in prediction.kinds]
        for axis, panel in zip(row, predicted, strict=True):
            draw_predicted(axis, panel, prediction.unit, predicted_limits(predicted), prediction.prob)
            axis.set_title(panel.title)
            if prediction.points.ndim > 1 or channel == count - 1:
                axis.set_xlabel(panel.label)
        row[0].set_ylabel(f"{prediction.stresses[channel]} [{prediction.unit.name}]")


def _shown(prediction: Prediction, channel: int, kind: bool) -> Predicted:
    """Return what is drawn of a stress, with the discrepancy or without."""
    number = prediction.mode.drawn_against(channel, prediction.points)
    abscissa = values_of_control(prediction.points, number)
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
    if prediction.scores is None:
        return prediction.called(kind)
    row = prediction.scores_of(kind).iloc[channel]
    return f"{prediction.called(kind)}:  {round(row['inside'] * row['count'])} of {row['count']} inside"
