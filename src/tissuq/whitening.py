"""The errors of whole tests: by how much all measurements of a test may be off together, and what undoes that."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.smoothing import smoothed

__all__ = ["BETWEEN_SPECIMENS", "Tolerances", "Whitening", "specimens_of", "whitening"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Tolerances:
    """By how much a whole test may be off: standard deviations of errors that all its measurements share.

    Tests of one specimen share them. To first order in the errors they move the measured stresses along fixed curves,
    the stress and its slope, so that they are integrated in closed form, as everything that is linear. Of the stress
    only the specimens' differences from their mean count there: an error that all have in common is not in the data,
    and multiplies the answer.

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

    Raises
    ------
    InputError
        When one of them is negative or not a number.
    """

    stress: float = 0.0
    length: float = 0.0
    slack: float = 0.0
    zero: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not isinstance(value, Real) or isinstance(value, bool) or not 0 <= float(value) < inf:
                raise InputError(f"the tolerance of the {name} must be a number, zero or more, not {value!r}.")

    def __bool__(self) -> bool:
        return any(vars(self).values())

    def in_common(self, experiment: Experiment) -> float:
        """Return the standard deviation of the relative error of stress that all specimens have in common."""
        return float(self.stress / np.sqrt(len(specimens_of(experiment))))

    @property
    def need_slope(self) -> bool:
        """Whether any of them moves the curve along the stretch."""
        return bool(self.length or self.slack)

    def variance(
        self, mode: LoadingMode, stretch: FloatArray, stress: FloatArray, slope: FloatArray | float
    ) -> FloatArray:
        """Return the variance (..., n) of the stress of a test at stretches (n,), where it would be ``stress``."""
        strain, whole = _strains(mode, stretch)
        moved = (self.length * strain * slope) ** 2 + (self.slack * whole * slope) ** 2
        return np.asarray((self.stress * stress) ** 2 + self.zero**2 + moved)

    def columns(self, test: Experiment, curve: FloatArray) -> FloatArray:
        """Return what one standard deviation of each error does to the stresses (n, 4) of a test, MPa.

        Parameters
        ----------
        test : Experiment
        curve : (n,) array, MPa
            About what stresses it has without errors. The measurements themselves would not do: what they are off by
            would count as less, the more the stress is taken to be too large (Peelle's pertinent puzzle).

        Raises
        ------
        InputError
            When the test has several controls and so no one slope.
        """
        if not self.need_slope:
            nothing = np.zeros(len(curve))
            return np.column_stack([self.stress * curve, nothing, nothing, np.full(len(curve), self.zero)])
        if test.stretch.ndim > 1 or test.stress.ndim > 1:
            raise InputError(
                f"experiment '{test.name}' has several controls or stresses: tolerances of length and slack are for "
                "tests with one of each."
            )
        slope = smoothed(test.stretch, curve).slope
        strain, whole = _strains(test.mode, test.stretch)
        moved = self.length * strain * slope, self.slack * whole * slope
        return np.column_stack([self.stress * curve, *moved, np.full(len(curve), self.zero)])


def _strains(mode: LoadingMode, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by what relative errors of the gauge length, and of the stretch free of stress, change the stretch."""
    strain = stretch - mode.reference
    return strain, stretch if mode.reference else np.ones_like(stretch)


BETWEEN_SPECIMENS = Tolerances(stress=0.18)
"""For tests of different specimens, where nothing is said: their stresses agree to 18 %."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """What turns measurements whose errors differ and hang together into ones of independent errors of sd noise_sd.

    Their covariance is noise_sd^2 D (I + U diag(spread) U') D with D = diag(size) and orthonormal U.

    Attributes
    ----------
    size : (n,) array
        Independent noise of each measurement over noise_sd.
    along : (n, q) array
        U.
    spread : (q,) array
    """

    size: FloatArray
    along: FloatArray
    spread: FloatArray

    def __call__(self, columns: Any) -> Any:
        """Return columns (n,) or (n, k) of the measurements, whitened."""
        return self._stretched((columns.T / self.size).T, 1 / np.sqrt(1 + self.spread))

    def transposed(self, columns: FloatArray) -> FloatArray:
        """Return the transpose of the whitening times columns (n,) or (n, k)."""
        return np.asarray((self._stretched(columns, 1 / np.sqrt(1 + self.spread)).T / self.size).T)

    def undone(self, columns: FloatArray) -> FloatArray:
        """Return the columns (n,) or (n, k) that the whitening makes these of."""
        return np.asarray((self._stretched(columns, np.sqrt(1 + self.spread)).T * self.size).T)

    def _stretched(self, columns: Any, factors: FloatArray) -> Any:
        """Return columns with their parts along U times factors (q,)."""
        return columns + self.along @ ((self.along.T @ columns).T * (factors - 1)).T

    def precisions(self, white: FloatArray) -> FloatArray:
        """Return the diagonals (m, n) of the inverse covariances of the measurements, given those of whitened ones.

        Where errors hang together, whitened measurements must have one precision.
        """
        lost = self.along**2 @ (self.spread / (1 + self.spread))
        return np.asarray(white * (1 - lost) / self.size**2)

    @property
    def log_determinant(self) -> float:
        """The log of the absolute determinant of the whitening."""
        return float(-np.log(self.size).sum() - 0.5 * np.log1p(self.spread).sum())


def specimens_of(experiment: Experiment) -> list[str | int]:
    """Return the different specimens of an experiment: their names, or the numbers of tests without one."""
    return list(dict.fromkeys(part.specimen or number for number, part in enumerate(experiment.parts)))


def whitening(
    experiment: Experiment,
    noise_sd: FloatArray,
    usual: float,
    tolerances: Tolerances,
    curve: FloatArray | None = None,
) -> Whitening | None:
    """Return the whitening of tests, or None where their errors are independent and equal as they are.

    Parameters
    ----------
    experiment : Experiment
        One test, or several.
    noise_sd : (tests,) array, MPa
        Noise of each test, as known or about.
    usual : float, MPa
        The same of the parameter noise_sd.
    tolerances : Tolerances
    curve : (n,) array, MPa, optional
        About what stress the measurements have without errors, where there are tolerances.
    """
    parts = experiment.parts
    count = [part.stress.size for part in parts]
    size = np.repeat(noise_sd / usual, count)
    specimens = [part.specimen or number for number, part in enumerate(parts)]
    every = []
    if tolerances and curve is not None:
        curves = np.split(curve, np.cumsum(count)[:-1])
        shares = [tolerances.columns(part, own) for part, own in zip(parts, curves, strict=True)]
        names = specimens_of(experiment)
        of = np.array([[each == name for name in names] for each in specimens], dtype=np.float64)
        between = of - of.mean(axis=1, keepdims=True)
        for number in range(len(names)):
            weights = np.where(np.arange(4) == 0, between[:, number, None], of[:, number, None])
            every.append(np.concatenate([share * own for share, own in zip(shares, weights, strict=True)]))
    columns = np.column_stack([np.zeros((len(size), 0)), *every]) / (size * usual)[:, None]
    along, singular, _ = np.linalg.svd(columns, full_matrices=False)
    kept = singular > 1e-8 * singular.max(initial=0.0)
    if not kept.any() and np.allclose(size, 1, rtol=1e-12):
        return None
    return Whitening(size, along[:, kept], singular[kept] ** 2)
