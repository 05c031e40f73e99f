"""Errors of a test, each a class, and by how much a test may be off: what they do to the measured stresses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real
from types import MappingProxyType
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.registry import find, plugins, variants

__all__ = [
    "AS_TESTED",
    "BETWEEN_SPECIMENS",
    "ESTIMANDS",
    "SPECIMEN",
    "TISSUE",
    "ErrorPoints",
    "FittedErrors",
    "MeasurementError",
    "Tolerances",
    "estimands",
    "measurement_errors",
    "specimens_of",
]

FloatArray = NDArray[np.float64]

Shared = Literal["specimens' differences", "tests' differences", "specimen", "test"]

CORRELATION_SHARE = 1 / 3
"""Correlation length of a smooth error over the range of the strain of its test."""
PROCESS_NODES = 12
"""Number of places along a test from which a smooth error is interpolated; its variance is right to 1e-6."""
MIN_NODE_EIGENVALUE = 1e-6
"""Eigenvalue, relative to the largest, below which a direction of the errors there is left out."""


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
    slope : (..., n, c) array, MPa
        Of the stress along each control; zero where no error needs it.
    largest : float, MPa
        The largest stress of the test: that at these points, unless given.
    """

    mode: LoadingMode
    stretch: FloatArray
    stress: FloatArray
    slope: FloatArray | float = 0.0
    largest: float | None = None

    def moved(self, displacement: FloatArray) -> Any:
        """Return what displacements of the controls, shaped as ``stretch``, add to the stresses, (..., n, c).

        Each control is displaced by itself.
        """
        stresses_of_mode = np.shape(self.stress)[-1] // len(displacement)
        return np.concatenate([displacement.reshape(len(displacement), -1)] * stresses_of_mode) * self.slope


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
    """Between which tests it is the same: ``"specimen"``, all those of a specimen; ``"test"``, none. Of some only the
    differences of specimens, or tests, from their mean are in the data: what all have in common multiplies the
    answer."""

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
    shared = "specimens' differences"

    def effect(self, points: ErrorPoints) -> Any:
        return points.stress


class TestError(MeasurementError):
    """Of the stress of one test as a whole: grips, friction, glue, order of the tests, another mode or direction."""

    name = "test"
    description = "of the stress (spread between tests of a specimen)"
    shared = "tests' differences"

    def effect(self, points: ErrorPoints) -> Any:
        return points.stress


class LengthError(MeasurementError):
    """Relative, of the strain: gauge length."""

    name = "length"
    description = "of the strain"
    needs_slope = True

    def effect(self, points: ErrorPoints) -> Any:
        return points.moved(points.stretch - points.mode.reference)


class SlackError(MeasurementError):
    """Of the stretch at which the specimen is free of stress: slack, preload."""

    name = "slack"
    description = "of stretch from slack"
    needs_slope = True

    def effect(self, points: ErrorPoints) -> Any:
        return points.moved(np.where(points.mode.reference, points.stretch, 1.0))


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
        return points.moved(np.ones_like(points.stretch))


class ResolutionError(MeasurementError):
    """Of every single stress, over the largest one of its test: resolution of the load cell, digits of the file."""

    name = "resolution"
    description = "of the largest stress, in each single stress"
    is_independent = True

    def effect(self, points: ErrorPoints) -> Any:
        largest = np.abs(points.stress).max() if points.largest is None else points.largest
        return largest * np.ones_like(points.stress)


AS_TESTED, SPECIMEN, TISSUE = "as-tested", "specimen", "tissue"
LABORATORY: Mapping[str, float] = MappingProxyType(
    {"length": 0.01, "slack": 0.005, "smooth": 0.02, "resolution": 0.002}
)
"""Errors of a test in a careful laboratory: standard deviations."""


class Estimand(NamedTuple):
    """What an interval is to hold, in words, and the errors of the tests that it then includes."""

    description: str
    sizes: Mapping[str, float]


ESTIMANDS: Mapping[str, Estimand] = MappingProxyType(
    {
        AS_TESTED: Estimand("this specimen as tested, errors of the test not included", MappingProxyType({})),
        SPECIMEN: Estimand(
            "this specimen, errors of the test included",
            MappingProxyType({"stress": 0.05, "test": 0.05, **LABORATORY}),
        ),
        TISSUE: Estimand(
            "the tissue: another specimen, errors of the test included",
            MappingProxyType({"stress": 0.18, "test": 0.1, **LABORATORY}),
        ),
    }
)
"""What intervals may be of, by name."""


def estimands() -> Mapping[str, Estimand]:
    """Return what intervals may be of, by name: in words, and with the errors of the tests that they include.

    Examples
    --------
    >>> import tissuq as tq
    >>> list(tq.estimands())
    ['as-tested', 'specimen', 'tissue']
    """
    return ESTIMANDS


class Tolerances:
    """By how much a whole test may be off: standard deviations of errors of the test, by their names.

    They say what an interval is of: without any it is of the specimen *as tested*, with those of the test of the
    *specimen*, with the spread between specimens, too, of the *tissue*.

    Tests of one specimen share their errors, but for those of each test. To first order these move the measured
    stresses along fixed curves, the stress and its slopes, so that they are integrated in closed form, as everything
    that is linear. Of the errors ``stress`` and ``test`` only the differences of specimens and tests from their mean
    count there: what all have in common is not in the data, and multiplies the answer.

    Parameters
    ----------
    estimand : str, optional
        ``"as-tested"``, ``"specimen"`` or ``"tissue"`` (`estimands`): sizes of a careful laboratory, which ``sizes``
        replace one by one; without it all others are zero.
    stress : float
        Relative, of the stress: area, thickness, load cell, and how much one specimen is stiffer than another.
    test : float
        Relative, of the stress of one test as a whole: how much tests of one specimen differ, in other modes, too.
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
    resolution : float
        Relative to the largest stress of a test, of every single stress: resolution of the load cell, digits of a file.
    **sizes : float
        Of further errors, such as a `MeasurementError` of your own, by their names.

    Raises
    ------
    InputError
        When one of them is negative or not a number, or there is no such error, or no such estimand.

    Examples
    --------
    >>> import tissuq as tq
    >>> tq.Tolerances(stress=0.1, slack=0.01)
    Tolerances(stress=0.1, slack=0.01)
    >>> tq.Tolerances("specimen", slack=0).sizes["length"]
    0.01
    """

    def __init__(self, estimand: str = "", /, **sizes: float) -> None:
        if estimand and estimand not in ESTIMANDS:
            raise InputError(f"there is no estimand '{estimand}'. Choose one of: {', '.join(ESTIMANDS)}.")
        errors = {name: find(MeasurementError, "error of a test", name, InputError)() for name in sizes}
        for name, size in sizes.items():
            if not isinstance(size, Real) or isinstance(size, bool) or not 0 <= float(size) < inf:
                raise InputError(f"the tolerance of the {name} must be a number, zero or more, not {size!r}.")
        all_sizes = {**(ESTIMANDS[estimand].sizes if estimand else {}), **sizes}
        kinds = {**variants(MeasurementError), **{name: type(error) for name, error in errors.items()}}
        self.estimand = estimand or ("" if any(all_sizes.values()) else AS_TESTED)
        self._stated = {name: float(all_sizes[name]) for name in kinds if name in all_sizes}
        self._sizes = {name: size for name, size in self._stated.items() if size}
        self._errors = {name: kinds[name]() for name in self._sizes}

    def __repr__(self) -> str:
        standard = ESTIMANDS[self.estimand].sizes if self.estimand else {}
        names = [name for name in measurement_errors() if self._sizes.get(name, 0.0) != standard.get(name, 0.0)]
        sizes = [f"{name}={self._sizes.get(name, 0.0)!r}" for name in names]
        return f"Tolerances({', '.join([repr(self.estimand)] * bool(standard) + sizes)})"

    def __eq__(self, value: object) -> bool:
        return isinstance(value, Tolerances) and (self.estimand, self._sizes) == (value.estimand, value._sizes)

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
    def stated(self) -> dict[str, float]:
        """The sizes with those of the estimand that are set to zero."""
        return dict(self._stated)

    @property
    def meaning(self) -> str:
        """What an interval with these errors is of, in words."""
        return ESTIMANDS[self.estimand].description if self.estimand else "the specimens, with the stated errors"

    @property
    def stress(self) -> float:
        """The relative standard deviation of the stress between specimens."""
        return self._sizes.get(ScaleError.name, 0.0)

    @property
    def test(self) -> float:
        """The relative standard deviation of the stress between tests of a specimen."""
        return self._sizes.get(TestError.name, 0.0)

    @property
    def resolution(self) -> float:
        """The standard deviation of every single stress, over the largest one of its test."""
        return self._sizes.get(ResolutionError.name, 0.0)

    def with_sizes(self, **sizes: float) -> Tolerances:
        """Return the same tolerances but for these sizes."""
        return Tolerances(self.estimand, **(self._stated | sizes))

    def with_factor(self, factor: float) -> Tolerances:
        """Return the same tolerances with the spreads between specimens and tests times a factor."""
        names = [name for name in (ScaleError.name, TestError.name) if name in self._sizes]
        return self.with_sizes(**{name: factor * self._sizes[name] for name in names})

    @property
    def has_standard_spreads(self) -> bool:
        """Whether the spreads between specimens and tests are those of the estimand, not stated by themselves."""
        standard = ESTIMANDS[self.estimand].sizes if self.estimand else {}
        names = ScaleError.name, TestError.name
        return bool(standard) and all(self._sizes.get(name, 0.0) == standard.get(name, 0.0) for name in names)

    def in_common(self, experiment: Experiment) -> float:
        """Return the standard deviation of the relative error of stress that all specimens and tests have in common."""
        tests, specimens = specimens_of(experiment).shape
        return float(np.hypot(self.stress / np.sqrt(specimens), self.test / np.sqrt(tests)))

    @property
    def need_slope(self) -> bool:
        """Whether any of them moves the curve along the stretch."""
        return any(error.needs_slope for error, _ in self)

    def variance(self, points: ErrorPoints) -> FloatArray:
        """Return the variance (..., n) of the stress of a new test at points."""
        return np.asarray(sum(size**2 * error.variance(points) for error, size in self))

    def noise(self, points: ErrorPoints) -> FloatArray:
        """Return what errors that every measurement has by itself are as noise of the stress: sd (n,), MPa."""
        variances = [size**2 * error.variance(points) for error, size in self if error.is_independent]
        return np.asarray(np.sqrt(sum(variances, start=np.zeros(len(points.stress)))))

    def columns(self, points: ErrorPoints, shared: Shared) -> FloatArray:
        """Return what one standard deviation of each error of a test as a whole does to its stresses (n, q), MPa.

        Parameters
        ----------
        points : ErrorPoints
            All points of the test, with about what stresses (n,) it has there without errors.
        shared : str
            Which errors: those with this value of `MeasurementError.shared`.
        """
        columns = [
            size * error.effect(points) for error, size in self if not error.is_independent and error.shared == shared
        ]
        return np.column_stack([np.zeros((len(points.stress), 0)), *columns])


BETWEEN_SPECIMENS = Tolerances(stress=ESTIMANDS[TISSUE].sizes["stress"])
"""For tests of different specimens, where the discrepancy takes up other errors: their stresses agree to 18 %."""


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
    slopes : (n, c) array, MPa, optional
        Of that stress along each control of its test; of tests with fewer than c controls the last ones are zero.
    level : float, MPa, optional
        The standard deviation of all independent errors (noise and S), to which errors of whole tests are relative.
    lag : float, optional
        Correlation of the noise of consecutive measurements.
    factor : float, optional
        Of the spreads of the stress between specimens and tests, over the stated ones, where several tests tell it.
    fits : int
        How many fits of the same data the estimates took.
    """

    curve: FloatArray | None = None
    slopes: FloatArray | None = None
    level: float | None = None
    lag: float | None = None
    factor: float | None = None
    fits: int = 0

    def points_of(self, experiment: Experiment) -> list[ErrorPoints]:
        """Return the points of every test at which its errors act; none where no curve was estimated."""
        if self.curve is None:
            return []
        points, start = [], 0
        for test in experiment.tests:
            part = slice(start, start + test.size)
            slope = 0.0 if self.slopes is None else self.slopes[part, : len(test.mode.controls)]
            points.append(ErrorPoints(test.mode, test.stretch, self.curve[part], slope))
            start += test.size
        return points

    @property
    def account(self) -> str:
        """What was estimated and what it cost, in words; empty where nothing was."""
        estimates = [
            "the mean curve along which whole tests err" * (self.curve is not None),
            f"the spread between tests ({self.factor:.3g} times the stated one)" if self.factor is not None else "",
            f"the lag-1 correlation of {self.lag:.3g}" if self.lag is not None else "",
        ]
        named = " and ".join(filter(None, estimates))
        return f"{named} estimated by {self.fits} further fits and then taken as known" if named else ""
