"""By how much tests may be off, and so what an interval is of; and what of it was estimated by further fits."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.checked_arrays import stress_in_mpa
from tissuq.experiments.experiment import Experiment
from tissuq.model.measurement_errors import (
    ErrorPoints,
    MeasurementError,
    ResolutionError,
    ScaleError,
    Shared,
    TestError,
    measurement_errors,
)
from tissuq.registry import find, variants

CONTRADICTION_SPREAD = 0.3
"""Standard deviation of the relative stress of tests that contradict each other. The logarithm of the ratio of two then
has one of 0.42, as that of the moduli in shear and in tension or compression of 15 isotropic tissues."""
AS_TESTED, SPECIMEN, TISSUE, NO_ERRORS = "as-tested", "specimen", "tissue", "none"
"""What intervals are of; the last is another word for the first."""
ONE_SPECIMEN, MEAN_OF_SPECIMENS = "this specimen", "the mean of the measured specimens"
"""Of what measurements are in words: with standard errors they are means of several specimens."""
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
        AS_TESTED: Estimand(f"{ONE_SPECIMEN} as tested, errors of the test not included", MappingProxyType({})),
        SPECIMEN: Estimand(
            f"{ONE_SPECIMEN}, errors of the test included",
            MappingProxyType({"stress": 0.05, "test": 0.05, **LABORATORY}),
        ),
        TISSUE: Estimand(
            "the tissue (the mean of its specimens), errors of the test included",
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
        ``"as-tested"`` (or ``"none"``), ``"specimen"`` or ``"tissue"`` (`estimands`): sizes of a careful laboratory,
        which ``sizes`` replace one by one; without it all others are zero.
    stress : float
        Relative, of the stress: area, thickness, load cell, and how much one specimen is stiffer than another.
    test : float
        Relative, of the stress of one test as a whole: how much tests of one specimen differ, in other modes, too.
    length : float
        Relative, of strain: gauge length.
    slack : float
        Of the stretch at which the specimen is free of stress: slack, preload.
    zero : float, MPa, or str such as "0.7 kPa"
        Of the stress at rest: zero of the load cell.
    smooth : float
        Relative, of the stress, another one all along the curve of each test: digitising, averaging, drift, hysteresis.
    stretch : float
        Of every single stretch: independent errors of the displacement, which count as noise where the curve is steep.
    resolution : float
        Relative to the largest stress of a test, of every single stress: resolution of the load cell, digits of a file.
    mean : float
        Of the mean of several specimens, times the standard errors of the data (`Experiment.standard_error`); smooth
        along the curve. By default 1 where the data have them.
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

    def __init__(self, estimand: str = "", /, **sizes: float | str) -> None:
        estimand = AS_TESTED if estimand == NO_ERRORS else estimand
        if estimand and estimand not in ESTIMANDS:
            raise InputError(f"there is no estimand '{estimand}'. Choose one of: {', '.join(ESTIMANDS)}.")
        errors = {name: find(MeasurementError, "error of a test", name, InputError)() for name in sizes}
        sizes = {name: stress_in_mpa(size) if errors[name].is_stress else size for name, size in sizes.items()}
        for name, size in sizes.items():
            if not isinstance(size, Real) or isinstance(size, bool) or not 0 <= float(size) < inf:
                raise InputError(f"the tolerance of the {name} must be a number, zero or more, not {size!r}.")
        all_sizes = {**(ESTIMANDS[estimand].sizes if estimand else {}), **sizes}
        kinds = {**variants(MeasurementError), **{name: type(error) for name, error in errors.items()}}
        self.estimand = estimand or ("" if any(all_sizes.values()) else AS_TESTED)
        self._numbers = frozenset(sizes)
        self._stated = {name: float(all_sizes[name]) for name in kinds if name in all_sizes}
        self._sizes = {name: size for name, size in self._stated.items() if size}
        self._errors = {name: kinds[name]() for name in self._sizes}

    def __repr__(self) -> str:
        sizes = [f"{name}={size!r}" for name, size in self.unusual.items()]
        return f"Tolerances({', '.join([repr(self.estimand)] * bool(self._standard) + sizes)})"

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
    def unusual(self) -> dict[str, float]:
        """The sizes that are not those of the estimand."""
        sizes = {name: self._sizes.get(name, 0.0) for name in measurement_errors()}
        return {name: size for name, size in sizes.items() if size != self._standard.get(name, 0.0)}

    @property
    def _standard(self) -> Mapping[str, float]:
        return ESTIMANDS[self.estimand].sizes if self.estimand else {}

    def meaning(self, experiment: Experiment) -> str:
        """Return what an interval of data with these errors is of, in words."""
        words = ESTIMANDS[self.estimand].description if self.estimand else "the specimens, with the stated errors"
        return words.replace(ONE_SPECIMEN, MEAN_OF_SPECIMENS) if experiment.standard_error.any() else words

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

    def with_sizes(self, **sizes: float | str) -> Tolerances:
        """Return the same tolerances but for these sizes, which do not count as stated by themselves."""
        changed = Tolerances("" if self.estimand == AS_TESTED else self.estimand, **{**self._stated, **sizes})
        changed._numbers = self._numbers
        return changed

    def replaced_by(self, sizes: Mapping[str, float | str]) -> Tolerances:
        """Return the same tolerances but for sizes that are stated as numbers.

        Examples
        --------
        >>> import tissuq as tq
        >>> tq.Tolerances("specimen").replaced_by({"slack": 0.02})
        Tolerances('specimen', slack=0.02)
        """
        changed = self.with_sizes(**sizes)
        changed._numbers = self._numbers | sizes.keys()
        return changed

    def at_least(self, sizes: Mapping[str, float]) -> Tolerances:
        """Return the same with errors at least as large, but for those that were stated as numbers.

        Where there are none at all, only errors of a whole test are added: known noise, or a discrepancy that takes up
        errors, has those that every measurement has by itself.

        Examples
        --------
        >>> import tissuq as tq
        >>> tq.Tolerances("specimen", length=0).at_least({"slack": 0.02, "length": 0.02, "resolution": 0.001})
        Tolerances('specimen', length=0.0, slack=0.02)
        """
        larger = {name: size for name, size in sizes.items() if size > self._sizes.get(name, 0.0)}
        larger = {name: size for name, size in larger.items() if name not in self._numbers}
        if self:
            return self.with_sizes(**larger) if larger else self
        kinds = variants(MeasurementError)
        of_test = {name: size for name, size in larger.items() if not kinds[name].is_independent}
        return Tolerances(**(self._stated | of_test)) if of_test else self

    def account_of(self, least_errors: Mapping[str, float]) -> str:
        """Return in words which errors are as large as the measurements themselves show; empty where none is."""
        names = [name for name, size in least_errors.items() if self._sizes.get(name) == size]
        sizes = " and ".join(f"{name} of {self._sizes[name]:.2g}" for name in names)
        return f"the tolerance {sizes} is as large as the measurements show" if names else ""

    def of_another_specimen(self) -> Tolerances:
        """Return the errors of a test of another specimen, which are of the tissue.

        Its stress differs as specimens do, where that of the same specimen has a smaller error, or none.
        """
        if self.estimand != SPECIMEN and self.stress:
            return self
        of_tissue = ESTIMANDS[TISSUE].sizes
        names = (ScaleError.name, TestError.name) if self.estimand == SPECIMEN else (ScaleError.name,)
        return self.with_sizes(**{name: max(self._sizes.get(name, 0.0), of_tissue[name]) for name in names})

    def with_factor(self, factor: float, names: Collection[str]) -> Tolerances:
        """Return the same tolerances with some of their sizes times a factor."""
        return self.with_sizes(**{name: factor * self._sizes[name] for name in names if name in self._sizes})

    def of_contradictory_tests(self, experiment: Experiment) -> Tolerances:
        """Return the same with so much between tests that each differs by `CONTRADICTION_SPREAD` or more."""
        tests, specimens = specimens_of(experiment).shape
        of_specimen = self.stress if specimens == tests else 0.0
        remainder = float(np.sqrt(max(CONTRADICTION_SPREAD**2 - of_specimen**2, 0.0)))
        return self.with_sizes(test=max(self.test, remainder))

    @property
    def has_standard_spreads(self) -> bool:
        """Whether the spreads between specimens and tests are those of the estimand, not stated by themselves."""
        standard, names = self._standard, (ScaleError.name, TestError.name)
        is_standard = all(self._sizes.get(name, 0.0) == standard.get(name, 0.0) for name in names)
        return bool(standard) and is_standard and not self._numbers & {*names}

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
            size * _effect(error, points) for error, size in self if not error.is_independent and error.shared == shared
        ]
        return np.column_stack([np.zeros((len(points.stress), 0)), *columns])


def _effect(error: MeasurementError, points: ErrorPoints) -> FloatArray:
    """Return what a unit of an error adds to the stresses of a test: (n,), or (n, q)."""
    effect, count = np.asarray(error.effect(points)), len(points.stress)
    if effect.shape[:1] != (count,):
        raise ModelError(
            f"the error of a test '{error.name}' has an effect of shape {effect.shape} on {count} stresses: return a "
            "number for each of them."
        )
    if not np.isfinite(effect).all():
        raise ModelError(f"the error of a test '{error.name}' has an effect that is not a finite number.")
    return effect


BETWEEN_SPECIMENS = Tolerances(stress=ESTIMANDS[TISSUE].sizes["stress"])
"""For tests of different specimens, where the discrepancy takes up other errors: their stresses agree to 18 %."""


def specimens_of(experiment: Experiment) -> BoolArray:
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
    reconciling_stability : float, optional
        Probability that an energy which reconciles several tests is stable, where that is so small that one of I1
        alone took its place.
    fits : int
        How many fits of the same data the estimates took.
    """

    curve: FloatArray | None = None
    slopes: FloatArray | None = None
    level: float | None = None
    lag: float | None = None
    factor: float | None = None
    reconciling_stability: float | None = None
    fits: int = 0

    def points_of(self, experiment: Experiment) -> list[ErrorPoints]:
        """Return the points of every test at which its errors act; none where no curve was estimated."""
        if self.curve is None:
            return []
        points, start = [], 0
        for test in experiment.tests:
            span = slice(start, start + test.size)
            slope = 0.0 if self.slopes is None else self.slopes[span, : len(test.mode.controls)]
            error = test.standard_error
            points.append(ErrorPoints(test.mode, test.stretch, self.curve[span], slope, standard_error=error))
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

    @property
    def contradiction(self) -> str:
        """That the tests contradict each other, in words; empty where they do not."""
        if self.reconciling_stability is None:
            return ""
        share = self.reconciling_stability
        probability = "less than 1 %" if share < 0.01 else f"{100 * share:.0f} %"
        return (
            "the tests contradict each other: a material that reconciles all of them is stable with a probability of "
            f"{probability} only. So a simpler discrepancy is fitted (auto-first), and the stresses of tests may "
            f"differ by {100 * CONTRADICTION_SPREAD:.0f} %. See whether grips, friction, slack, direction or the state "
            "of the specimens differed."
        )
