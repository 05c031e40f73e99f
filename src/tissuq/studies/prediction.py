"""What a run predicts in any loading mode, beside measurements of that mode where there are some."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.assessment.stability import calibrated_range, is_calibrated
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment, checked_points
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.mechanics import Material
from tissuq.mechanics.path import invariants
from tissuq.posterior import Posterior
from tissuq.prediction.bands import speaks_of
from tissuq.studies.earlier_run import load_run

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["POINTS", "Prediction", "predict_run", "predicted"]

FloatArray = NDArray[np.float64]

POINTS = 101
"""Stretches of a band, unless said."""


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
    bands : mapping of (int, bool, bool) to pandas.DataFrame
        Mean, low and high (MPa) by number of the stress, with the discrepancy or not, and with noise or not.
    data : Experiment, optional
        The measurements that it is compared with.
    scores : pandas.DataFrame, optional
        How they are predicted (`Posterior.scores`), with the discrepancy or without as column ``discrepancy``.
    notes : tuple of str
        What a reader must know.
    """

    posterior: Posterior
    mode: LoadingMode
    points: FloatArray
    prob: float
    stress_type: str
    kinds: tuple[bool, ...]
    bands: Mapping[tuple[int, bool, bool], pd.DataFrame]
    data: Experiment | None
    scores: pd.DataFrame | None
    notes: tuple[str, ...]

    @property
    def unit(self) -> StressUnit:
        """The unit in which the run's measurements give stresses."""
        return stress_unit(self.posterior.model.experiment.stress_unit)

    @property
    def stresses(self) -> tuple[str, ...]:
        """The names of the predicted stresses."""
        name = "Cauchy stress" if self.stress_type == "cauchy" else "engineering stress"
        return tuple(each.replace("engineering stress", name) for each in self.mode.stresses)

    @property
    def controls(self) -> dict[str, FloatArray]:
        """The points by control: stretch, and stretch2 of a second one."""
        columns = self.points.reshape(len(self.points), -1).T
        return {f"stretch{place if place > 1 else ''}": column for place, column in enumerate(columns, 1)}

    @cached_property
    def is_calibrated(self) -> NDArray[np.bool_]:
        """At which points (g,) the invariants stay in the range that was measured."""
        return is_calibrated(self.posterior.model.experiment, self.mode, self.points)

    @property
    def is_data_calibrated(self) -> NDArray[np.bool_]:
        """Of which measurements (n,) that is true."""
        assert self.data is not None  # noqa: S101 (asked for where there are some)
        return is_calibrated(self.posterior.model.experiment, self.mode, self.data.stretch)

    @property
    def calibrated_range(self) -> tuple[float, float] | None:
        """The ends of that range, where the mode has one control."""
        return _range(self.posterior, self.mode)

    def measured(self, channel: int) -> FloatArray:
        """Return the measurements (n,) of a stress that it is compared with, MPa."""
        assert self.data is not None  # noqa: S101 (asked for where there are some)
        ratio = self.mode.channels[channel].cauchy_ratio(self.data.stretch) if self.stress_type == "cauchy" else 1.0
        return np.asarray(self.data.stress.reshape(len(self.data), -1)[:, channel] * ratio)

    @property
    def table(self) -> pd.DataFrame:
        """All bands, MPa: a row for every stress and point.

        Columns measured (of several stresses), stretch (and stretch2), is_calibrated; mean, low, high of the stress
        with the discrepancy and predictive_low, predictive_high of a measurement of it; and the same of the material
        alone, from alone_mean on.
        """
        import pandas as pd

        tables = []
        for channel, name in enumerate(self.stresses):
            own: dict[str, Any] = {"measured": name} if len(self.stresses) > 1 else {}
            own |= self.controls | {"is_calibrated": self.is_calibrated}
            for kind in self.kinds:
                prefix = "" if kind else "alone_"
                stress, noisy = (self.bands[channel, kind, noise] for noise in (False, True))
                own |= {f"{prefix}{end}": stress[end].to_numpy() for end in ("mean", "low", "high")}
                own |= {f"{prefix}predictive_{end}": noisy[end].to_numpy() for end in ("low", "high")}
            tables.append(pd.DataFrame(own))
        return pd.concat(tables, ignore_index=True)

    @property
    def data_set(self) -> xr.Dataset:
        """All bands as labelled arrays, with the measurements where there are some; stresses in MPa.

        Dimensions discrepancy and noise (``"with"``, ``"without"``), stress, and stretch, or point where the mode has
        several controls.
        """
        import xarray as xr

        along = "stretch" if self.points.ndim == 1 else "point"
        words = {kind: "with" if kind else "without" for kind in (True, False)}
        order = [*product(self.kinds, (True, False), range(len(self.stresses)))]
        shape = len(self.kinds), 2, len(self.stresses), len(self.points)
        arrays = {
            end: np.reshape([self.bands[channel, kind, noise][end] for kind, noise, channel in order], shape)
            for end in ("mean", "low", "high")
        }
        mpa, dims = {"units": "MPa"}, ("discrepancy", "noise", "stress", along)
        found = xr.Dataset(
            {
                "mean": ((dims[0], *dims[2:]), arrays["mean"][:, 0], mpa | {"long_name": "mean stress"}),
                "low": (dims, arrays["low"], mpa | {"long_name": f"lower end of the {self.prob:.12g} interval"}),
                "high": (dims, arrays["high"], mpa | {"long_name": f"upper end of the {self.prob:.12g} interval"}),
                "is_calibrated": (along, self.is_calibrated.astype(np.int8), {"units": "1"}),
            },
            {name: (along, column, {"units": "1"}) for name, column in self.controls.items()}
            | {"discrepancy": [words[kind] for kind in self.kinds], "noise": [words[True], words[False]]}
            | {"stress": list(self.stresses)},
            self._labels,
        )
        if self.data is not None:
            stress = [self.measured(channel) for channel in range(len(self.stresses))]
            found["measured"] = (("stress", "measurement"), np.array(stress), mpa)
            for place, column in enumerate(self.data.stretch.reshape(len(self.data), -1).T, 1):
                name = f"measured_stretch{place if place > 1 else ''}"
                found[name] = ("measurement", column, {"units": "1"})
        return found

    @property
    def _labels(self) -> dict[str, Any]:
        model, ends = self.posterior.model, self.calibrated_range
        labels = {"loading_mode": self.mode.name, "stress_type": self.stress_type, "prob": self.prob}
        labels |= {"material": model.material.name, "discrepancy": model.discrepancy.name}
        labels |= {"fitted_to": model.experiment.name, "stress_unit_of_the_run": self.unit.name}
        return labels | ({} if ends is None else {"calibrated_low": ends[0], "calibrated_high": ends[1]})

    def save(self, path: str | Path) -> None:
        """Write `data_set` as NetCDF."""
        content = bytes(self.data_set.to_netcdf(engine="h5netcdf"))  # in memory first, as a posterior is saved
        Path(path).write_bytes(content)


def predict_run(
    run: str | Path, discrepancy: str | None = None, material: Material | None = None, **options: Any
) -> Prediction:
    """Predict the stress in a loading mode from a run of ``tissuq fit``.

    Parameters
    ----------
    run : str or Path
        The run folder.
    discrepancy, material
        As for `tissuq.load_run`.
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
        When the run cannot be used (`tissuq.load_run`), or cannot predict what is asked for.

    Examples
    --------
    >>> import tissuq as tq
    >>> planar = tq.datasets.load("rubber-treloar-planar")
    >>> found = tq.predict_run("runs/rubber-treloar-uniaxial", data=planar)  # doctest: +SKIP
    >>> found.table, found.scores, found.notes  # doctest: +SKIP
    """
    with catch_warnings(record=True) as said:
        simplefilter("always", UserWarning)
        posterior = load_run(run, discrepancy, material)
    notes = tuple(str(each.message) for each in said if issubclass(each.category, UserWarning))
    return predicted(posterior, notes=notes, **options)


def predicted(
    posterior: Posterior,
    *,
    mode: str | LoadingMode | None = None,
    stretch: ArrayLike | None = None,
    points: int = POINTS,
    prob: float = 0.95,
    stress_type: str = "engineering",
    data: Experiment | None = None,
    notes: tuple[str, ...] = (),
) -> Prediction:
    """Return what a posterior predicts in a loading mode; the arguments are the options of `predict_run`.

    ``notes`` are sentences that go before those about the prediction.
    """
    asked = _mode(posterior, mode, data)
    at = _points(posterior, asked, stretch, points, data)
    model = posterior.model
    kinds = (True, False) if model.discrepancy.parameters and speaks_of(model, asked) else (False,)
    options: dict[str, Any] = {"prob": prob, "stress_type": stress_type}
    order = product(range(len(asked.stresses)), kinds, (False, True))
    bands = {each: _band(posterior, asked, at, *each, options) for each in order}
    scores = None if data is None else _scores(posterior, data, kinds, options)
    known = (*notes, *_notes(posterior, asked, at, data))
    return Prediction(posterior, asked, at, prob, stress_type, kinds, bands, data, scores, known)


def _band(
    posterior: Posterior,
    mode: LoadingMode,
    at: FloatArray,
    channel: int,
    kind: bool,
    noise: bool,
    options: dict[str, Any],
) -> pd.DataFrame:
    """Return mean, low and high of a stress at points; refuse where it is too large for a number."""
    with np.errstate(over="ignore", invalid="ignore"):
        found = posterior.predict(at, mode=mode, channel=channel, discrepancy=kind, noise=noise, **options)
    is_finite = np.isfinite(found.to_numpy()).all(axis=1)
    if not is_finite.all():
        beyond = at.reshape(len(at), -1)[~is_finite, 0][0]
        raise ModelError(
            f"the predicted stress is too large for a number at a {mode.controls[0].name} of {beyond:g}: predict "
            "nearer to what was measured."
        )
    return found


def _mode(posterior: Posterior, mode: str | LoadingMode | None, data: Experiment | None) -> LoadingMode:
    """Return the mode to predict, which must be that of the data."""
    modes = posterior.model.experiment.modes
    if data is not None and len(data.parts) > 1:
        raise InputError(f"'{data.name}' are several tests: give those of one to compare with.")
    if mode is None and data is None and len(modes) > 1:
        names = ", ".join(each.name for each in modes)
        raise InputError(f"the run is of tests in several modes ({names}): say which mode to predict.")
    found = loading_mode(mode) if mode is not None else data.parts[0].mode if data is not None else modes[0]
    if data is not None and data.parts[0].mode != found:
        raise InputError(
            f"the measurements '{data.name}' are of mode {data.parts[0].mode.name}, and {found.name} is predicted: "
            "give measurements of that mode."
        )
    return found


def _points(
    posterior: Posterior, mode: LoadingMode, stretch: ArrayLike | None, points: int, data: Experiment | None
) -> FloatArray:
    """Return the points at which to predict: those that were asked for, or the usual ones."""
    if len(mode.controls) > 1 and stretch is not None and data is not None:
        raise InputError(
            f"mode '{mode.name}' has several controls, and measurements lie where they lie: give stretches or "
            "measurements to compare with, not both."
        )
    if stretch is not None:
        return checked_points(mode, stretch)
    ends = _range(posterior, mode)
    if ends is not None:
        return np.linspace(*(ends if data is None else _beside(ends, mode, data.stretch)), points)
    own = [part.stretch for part in posterior.model.experiment.parts if part.mode == mode]
    if data is None and not own:
        names = ", ".join(control.name for control in mode.controls)
        raise InputError(
            f"mode '{mode.name}' has several controls ({names}): say at which values of each to predict (stretch and "
            "stretch2)."
        )
    return own[0] if data is None else data.stretch


def _beside(ends: tuple[float, float], mode: LoadingMode, measured: FloatArray) -> tuple[float, float]:
    """Return the ends of a range on those sides of rest on which there are measurements, and no nearer than these."""
    rest, low, high = float(mode.reference), float(measured.min()), float(measured.max())
    return min(ends[0], low) if low < rest else rest, max(ends[1], high) if high > rest else rest


def _range(posterior: Posterior, mode: LoadingMode) -> tuple[float, float] | None:
    return calibrated_range(posterior.model.experiment, mode) if len(mode.controls) == 1 else None


def _scores(posterior: Posterior, data: Experiment, kinds: tuple[bool, ...], options: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    tables = {kind: posterior.scores(data, discrepancy=kind, **options) for kind in kinds}
    for kind, table in tables.items():
        table.insert(3, "discrepancy", "with" if kind else "without")
    return pd.concat(tables.values(), ignore_index=True)


def _notes(posterior: Posterior, mode: LoadingMode, points: FloatArray, data: Experiment | None) -> list[str]:
    """Return what a reader must know, in sentences."""
    model, found = posterior.model, []
    if not speaks_of(model, mode):
        measured = ", ".join(each.name for each in model.experiment.modes)
        found.append(
            f"the discrepancy '{model.discrepancy.name}' is an error of the {measured} stress and says nothing about "
            f"the {mode.name} one, which is predicted without it: by the material alone. Fit with one that is an "
            "energy, such as 'auto', to have it there, too."
        )
    was_fitted = data is not None and _was_fitted(model.experiment, data)
    if was_fitted:
        found.append(
            "the run was fitted to these very measurements: how they are predicted is a check of the fit, and says "
            "nothing of other data."
        )
    beyond = [(int((~is_calibrated(model.experiment, mode, points)).sum()), len(points), "points")]
    if data is not None:
        known = is_calibrated(model.experiment, mode, data.stretch)
        beyond.append((int((~known).sum()), len(data), "measurements"))
    outside = " and ".join(f"{count} of {whole} {what}" for count, whole, what in beyond if count)
    if outside:
        found.append(f"{outside} lie beyond what was measured: {_calibrated_in_words(posterior, mode)}.")
    if data is not None and not was_fitted and not model.tolerances:
        found.append(
            "the run allows for no errors of whole tests, so that its bands are those of the specimen that was "
            "fitted: a test of another one, or another area or gauge length, is not covered by them. Fit with "
            "--tolerance stress=18% (or what is usual between your specimens) to have that in the bands."
        )
    return found


def _was_fitted(experiment: Experiment, data: Experiment) -> bool:
    return any(
        part.mode == data.mode
        and np.array_equal(part.stretch, data.stretch)
        and np.array_equal(part.stress, data.stress)
        for part in experiment.parts
    )


def _calibrated_in_words(posterior: Posterior, mode: LoadingMode) -> str:
    """Return up to where both invariants were measured."""
    ends = _range(posterior, mode)
    if ends is not None:
        control, (low, high) = mode.controls[0].name, ends
        return f"in mode {mode.name} the run is calibrated from {low:.4g} to {high:.4g} ({control})"
    data = posterior.model.experiment
    first, second = (float(each.max()) for each in invariants(data.mode, data.stretch))
    return f"the run is calibrated up to I1 - 3 = {first:.3g} and I2 - 3 = {second:.3g}"
