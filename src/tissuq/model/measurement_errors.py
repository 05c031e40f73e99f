"""Errors of a test, each a class, and by how much a test may be off: what they do to the measured stresses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.smoothing import smoothed
from tissuq.registry import find, plugins, variants

__all__ = [
    "BETWEEN_SPECIMENS",
    "ErrorPoints",
    "FittedErrors",
    "MeasurementError",
    "Tolerances",
    "measurement_errors",
    "specimens_of",
]

FloatArray = NDArray[np.float64]

Shared = Literal["differences", "specimen", "test"]

CORRELATION_SHARE = 1 / 3
"""Correlation length of a smooth error over the range of the strain of its test."""
PROCESS_NODES = 12
"""Number of places along a test from which a smooth error is interpolated; its variance is right to 1e-6."""
MIN_NODE_EIGENVALUE = 1e-11
"""Eigenvalue, relative to the largest, below which a direction of the errors there is rounding."""


@dataclass(frozen=True, eq=False)
class ErrorPoints:
    """Points of a test at which its errors act.

    Attributes
    ----------
    mode : LoadingMode
    stretch : (n,) or (n, c) array, dimensionless
    stress : (..., n) array, MPa
        About what stress there is without errors. The measurements themselves would not do: what they are off by would
        count as less, the more the stress is taken to be too large (Peelle's pertinent puzzle).
    slope : (..., n) array, MPa
        Of the stress along the stretch; zero where no error needs it.
    """

    mode: LoadingMode
    stretch: FloatArray
    stress: FloatArray
    slope: FloatArray | float = 0.0


class MeasurementError(ABC):
    """An error of a test: to first order it moves the measured stresses along a fixed curve, or a few of them.

    A new error is one subclass in one file: its name, what it is in words, and the stress that a unit of it adds. Its
    standard deviation is then one of `Tolerances`, in closed form like everything that is linear.
    """

    entry_point_group: ClassVar[str] = "tissuq.measurement_errors"
    name: ClassVar[str]
    description: ClassVar[str]
    """What a size of it is, after the number: ``of the strain``."""
    is_stress: ClassVar[bool] = False
    """Whether its size is a stress (MPa)."""
    needs_slope: ClassVar[bool] = False
    """Whether it moves the curve along the stretch."""
    is_independent: ClassVar[bool] = False
    """Whether every measurement has one of its own, rather than all those of a specimen the same."""
    shared: ClassVar[Shared] = "specimen"
    """Between which tests it is the same: ``"specimen"``, all those of a specimen; ``"differences"``, these too, but
    only the specimens' differences from their mean are in the data; ``"test"``, none."""

    @abstractmethod
    def effect(self, points: ErrorPoints) -> Any:
        """Return what a unit of the error adds to the stresses (..., n), MPa.

        One that is a sum of independent unit errors returns what each of them adds, (..., n, q).
        """

    def variance(self, points: ErrorPoints) -> Any:
        """Return the variance (..., n) of the stress that a unit of the error gives, MPa^2."""
        effect = np.asarray(self.effect(points))
        return effect**2 if effect.ndim == np.ndim(points.stress) else (effect**2).sum(axis=-1)


def measurement_errors() -> dict[str, type[MeasurementError]]:
    """Return the errors of a test by name, those of other packages included."""
    plugins(MeasurementError)
    return variants(MeasurementError)


class ScaleError(MeasurementError):
    """Of the stress as a whole: area, thickness, load cell, and how much one specimen is stiffer than another."""

    name = "stress"
    description = "of the stress (spread between specimens)"
    shared = "differences"

    def effect(self, points: ErrorPoints) -> Any:
        return points.stress


class LengthError(MeasurementError):
    """Relative, of the strain: gauge length."""

    name = "length"
    description = "of the strain"
    needs_slope = True

    def effect(self, points: ErrorPoints) -> Any:
        return (points.stretch - points.mode.reference) * points.slope


class SlackError(MeasurementError):
    """Of the stretch at which the specimen is free of stress: slack, preload."""

    name = "slack"
    description = "of stretch from slack"
    needs_slope = True

    def effect(self, points: ErrorPoints) -> Any:
        return (points.stretch if points.mode.reference else np.ones_like(points.stretch)) * points.slope


class ZeroError(MeasurementError):
    """Of the stress at rest: zero of the load cell."""

    name = "zero"
    description = "at rest"
    is_stress = True

    def effect(self, points: ErrorPoints) -> Any:
        return np.ones_like(points.stress)


class SmoothError(MeasurementError):
    """Relative, of the stress, and smooth along the curve: digitising, averaging, drift, half of a hysteresis.

    A Gaussian process of the strain, squared exponential with a correlation length of a third of the range of the test;
    of every stress of a test another one.
    """

    name = "smooth"
    description = "of the stress, smooth along the curve"
    shared = "test"

    def effect(self, points: ErrorPoints) -> Any:
        strain = points.stretch - points.mode.reference
        distance = strain if strain.ndim == 1 else np.linalg.norm(strain, axis=1)
        root = _process_root(distance, CORRELATION_SHARE * float(np.ptp(distance)))
        stresses_of_mode = np.shape(points.stress)[-1] // len(distance)
        return np.asarray(points.stress)[..., None] * np.kron(np.eye(stresses_of_mode), root)


def _process_root(places: FloatArray, length: float) -> FloatArray:
    """Return a root (n, q) of the squared-exponential correlation of places (n,), from a few places among them."""
    if length <= 0:
        return np.ones((len(places), 1))
    nodes = np.linspace(places.min(), places.max(), PROCESS_NODES)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * ((nodes[:, None] - nodes) / length) ** 2))
    is_significant = values > MIN_NODE_EIGENVALUE * values[-1]
    across = np.exp(-0.5 * ((places[:, None] - nodes) / length) ** 2)
    return np.asarray(across @ vectors[:, is_significant] / np.sqrt(values[is_significant]))


class StretchError(MeasurementError):
    """Of every single stretch: independent errors of the displacement, which are noise where the curve is steep."""

    name = "stretch"
    description = "in each single stretch"
    needs_slope = True
    is_independent = True

    def effect(self, points: ErrorPoints) -> Any:
        return points.slope


class Tolerances:
    """By how much a whole test may be off: standard deviations of errors of the test, by their names.

    Tests of one specimen share their errors. To first order these move the measured stresses along fixed curves, the
    stress and its slope, so that they are integrated in closed form, as everything that is linear. Of the stress only
    the specimens' differences from their mean count there: an error that all have in common is not in the data, and
    multiplies the answer.

    Parameters
    ----------
    stress : float
        Relative, of the stress: area, thickness, load cell, and how much one specimen is stiffer than another.
    length : float
        Relative, of strain: gauge length.
    slack : float
        Of the stretch at which the specimen is free of stress: slack, preload.
    zero : float, MPa
        Of the stress at rest: zero of the load cell.
    smooth : float
        Relative, of the stress, another one all along the curve of each test: digitising, averaging, drift, hysteresis.
    stretch : float
        Of every single stretch: independent errors of the displacement, which count as noise where the curve is steep.
    **sizes : float
        Of further errors, such as a `MeasurementError` of your own, by their names.

    Raises
    ------
    InputError
        When one of them is negative or not a number, or there is no such error.

    Examples
    --------
    >>> import tissuq as tq
    >>> tq.Tolerances(stress=0.1, slack=0.01)
    Tolerances(stress=0.1, slack=0.01)
    """

    def __init__(self, **sizes: float) -> None:
        errors = {name: find(MeasurementError, "error of a test", name, InputError)() for name in sizes}
        for name, size in sizes.items():
            if not isinstance(size, Real) or isinstance(size, bool) or not 0 <= float(size) < inf:
                raise InputError(f"the tolerance of the {name} must be a number, zero or more, not {size!r}.")
        ordered = dict.fromkeys([*variants(MeasurementError), *sizes])
        self._sizes = {name: float(sizes[name]) for name in ordered if sizes.get(name)}
        self._errors = {name: errors[name] for name in self._sizes}

    def __repr__(self) -> str:
        return f"Tolerances({', '.join(f'{name}={size!r}' for name, size in self._sizes.items())})"

    def __eq__(self, value: object) -> bool:
        return isinstance(value, Tolerances) and self._sizes == value._sizes

    def __hash__(self) -> int:
        return hash(tuple(self._sizes.items()))

    def __bool__(self) -> bool:
        return bool(self._sizes)

    def __iter__(self) -> Iterator[tuple[MeasurementError, float]]:
        """Iterate over the errors whose size is not zero, with their sizes."""
        return ((self._errors[name], size) for name, size in self._sizes.items())

    @property
    def sizes(self) -> dict[str, float]:
        """The sizes that are not zero, by the errors' names."""
        return dict(self._sizes)

    @property
    def stress(self) -> float:
        """The relative standard deviation of the stress between specimens."""
        return self._sizes.get(ScaleError.name, 0.0)

    def with_sizes(self, **sizes: float) -> Tolerances:
        """Return the same tolerances but for these sizes."""
        return Tolerances(**(self._sizes | sizes))

    def in_common(self, experiment: Experiment) -> float:
        """Return the standard deviation of the relative error of stress that all specimens have in common."""
        return float(self.stress / np.sqrt(specimens_of(experiment).shape[1]))

    @property
    def need_slope(self) -> bool:
        """Whether any of them moves the curve along the stretch."""
        return any(error.needs_slope for error, _ in self)

    def variance(self, points: ErrorPoints) -> FloatArray:
        """Return the variance (..., n) of the stress of a new test at points."""
        return np.asarray(sum(size**2 * error.variance(points) for error, size in self))

    def noise(self, test: Experiment, curve: FloatArray) -> FloatArray:
        """Return what errors that every measurement has by itself are as noise of the stress: sd (n,), MPa."""
        points = self._points(test, curve)
        variances = [(size * error.effect(points)) ** 2 for error, size in self if error.is_independent]
        return np.asarray(np.sqrt(sum(variances, start=np.zeros(len(curve)))))

    def columns(self, test: Experiment, curve: FloatArray, shared: Shared) -> FloatArray:
        """Return what one standard deviation of each error of a test as a whole does to its stresses (n, q), MPa.

        Parameters
        ----------
        test : Experiment
        curve : (n,) array, MPa
            About what stresses it has without errors.
        shared : str
            Which errors: those with this value of `MeasurementError.shared`.

        Raises
        ------
        InputError
            When the test has several controls and so no one slope.
        """
        points = self._points(test, curve)
        columns = [
            size * error.effect(points) for error, size in self if not error.is_independent and error.shared == shared
        ]
        return np.column_stack([np.zeros((len(curve), 0)), *columns])

    def _points(self, test: Experiment, curve: FloatArray) -> ErrorPoints:
        if not self.need_slope:
            return ErrorPoints(test.mode, test.stretch, curve)
        if test.stretch.ndim > 1 or test.stress.ndim > 1:
            raise InputError(
                f"experiment '{test.name}' has several controls or stresses: tolerances of length, slack and stretch "
                "are for tests with one of each."
            )
        return ErrorPoints(test.mode, test.stretch, curve, smoothed(test.stretch, curve).slope)


BETWEEN_SPECIMENS = Tolerances(stress=0.18)
"""For tests of different specimens, where nothing is said: their stresses agree to 18 %."""


def specimens_of(experiment: Experiment) -> NDArray[np.bool_]:
    """Return which tests (tests, specimens) are of which specimen; a test without a name is of one of its own."""
    labels = [test.specimen or number for number, test in enumerate(experiment.tests)]
    return np.array([[label == specimen for specimen in dict.fromkeys(labels)] for label in labels])


@dataclass(frozen=True, eq=False)
class FittedErrors:
    """Estimates of the errors of the tests that are plugged in, not integrated; `tissuq.fit` makes them.

    Attributes
    ----------
    curve : (n,) array, MPa, optional
        About what stress the measurements have without errors: errors of whole tests act along it.
    level : float, MPa, optional
        The standard deviation of all independent errors (noise and S), to which errors of whole tests are relative.
    lag : float, optional
        Correlation of the noise of consecutive measurements.
    spread : float, optional
        Relative standard deviation of the stress between specimens, where these are enough to estimate it.
    fits : int
        How many fits of the same data the estimates took.
    """

    curve: FloatArray | None = None
    level: float | None = None
    lag: float | None = None
    spread: float | None = None
    fits: int = 0

    @property
    def account(self) -> str:
        """What was estimated and what it cost, in words; empty where nothing was."""
        estimates = [
            "the mean curve along which whole tests err" * (self.curve is not None),
            f"the spread of {self.spread:.3g} between specimens" if self.spread is not None else "",
            f"the lag-1 correlation of {self.lag:.3g}" if self.lag is not None else "",
        ]
        named = " and ".join(filter(None, estimates))
        return f"{named} estimated by {self.fits} further fits and then taken as known" if named else ""
