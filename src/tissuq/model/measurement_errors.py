"""Errors of a test, each a class: what a unit of them does to the measured stresses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import LoadingMode
from tissuq.registry import plugins, variants

Shared = Literal["specimens' differences", "tests' differences", "specimen", "test"]

CORRELATION_SHARE = 1 / 3
"""Correlation length of a smooth error over the range of the strain of its test."""
PROCESS_NODES = 12
"""Number of places along a test from which a smooth error is interpolated; its variance is right to 1e-6."""
SHARE_DEGREE = 2
"""Degree of the polynomial of the strain that a standard error over the stress is taken for."""
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
    standard_error : (..., n) array, MPa
        Of stresses that are means of several specimens; zero of others.
    """

    mode: LoadingMode
    stretch: FloatArray
    stress: FloatArray
    slope: FloatArray | float = 0.0
    largest: float | None = None
    standard_error: FloatArray | float = 0.0

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
    description = "of the stress of a specimen (its area, and how specimens differ)"
    shared = "specimens' differences"

    def effect(self, points: ErrorPoints) -> Any:
        return points.stress


class TestError(MeasurementError):
    """Of the stress of one test as a whole: grips, friction, glue, order of the tests, another mode or direction."""

    name = "test"
    description = "of the stress of a test (its load, and how tests of a specimen differ)"
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
        return np.asarray(points.stress)[..., None] * _smooth_root(points)


class MeanError(MeasurementError):
    """Of the mean of several specimens, as large as the standard errors that its file states.

    Half of its variance is that of one number times the standard error, the other half a process as of `SmoothError`:
    specimens differ in stiffness, and in the shape of their curves. Independent from point to point, the standard
    errors would tell as much more as there are points.

    The standard errors are smoothed: they are taken as the stress times a parabola of the strain. What they scatter
    about it belongs to the same specimens as what the stresses do, and would pull these to where it is small.
    """

    name = "mean"
    description = "times the standard error of the mean, smooth along the curve"
    shared = "test"

    def effect(self, points: ErrorPoints) -> Any:
        smooth = _smooth_root(points)
        as_a_whole = np.ones((len(smooth), 1))
        return _smooth_standard_error(points)[..., None] * np.sqrt(0.5) * np.hstack([as_a_whole, smooth])


def _smooth_standard_error(points: ErrorPoints) -> FloatArray:
    """Return the standard error (..., n) as the absolute stress times a parabola of the strain, for each stress."""
    stress = np.abs(points.stress)
    if not np.any(points.standard_error):
        return np.zeros_like(stress)
    strain = _distance(points)
    powers = np.kron(np.eye(stress.shape[-1] // len(strain)), strain[:, None] ** np.arange(SHARE_DEGREE + 1))
    columns = stress[..., None] * powers
    shares, *_ = np.linalg.lstsq(columns, points.standard_error, rcond=None)
    return np.asarray(np.maximum(columns @ shares, 0.0))


def _smooth_root(points: ErrorPoints) -> FloatArray:
    """Return a root (n, q) of the correlation of an error that is smooth along each stress of a test."""
    distance = _distance(points)
    root = _process_root(distance, CORRELATION_SHARE * float(np.ptp(distance)))
    stresses_of_mode = np.shape(points.stress)[-1] // len(distance)
    return np.asarray(np.kron(np.eye(stresses_of_mode), root))


def _distance(points: ErrorPoints) -> FloatArray:
    """Return the strain (n,) of points, or how far they are strained where the mode has several controls."""
    strain = points.stretch - points.mode.reference
    return np.asarray(strain if strain.ndim == 1 else np.linalg.norm(strain, axis=1))


def _process_root(points: FloatArray, length: float) -> FloatArray:
    """Return a root (n, q) of the squared-exponential correlation of places (n,), from a few places among them."""
    if length <= 0:
        return np.ones((len(points), 1))
    nodes = np.linspace(points.min(), points.max(), PROCESS_NODES)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * ((nodes[:, None] - nodes) / length) ** 2))
    is_significant = values > MIN_NODE_EIGENVALUE * values[-1]
    across = np.exp(-0.5 * ((points[:, None] - nodes) / length) ** 2)
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
