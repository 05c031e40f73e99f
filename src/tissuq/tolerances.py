"""By how much whole tests may be off: errors that all their measurements share, and what they do to the stress."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode
from tissuq.smoothing import smoothed

__all__ = ["BETWEEN_SPECIMENS", "Tolerances", "specimens_of"]

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
    stretch : float
        Of every single stretch: independent errors of the displacement, which count as noise where the curve is steep.

    Raises
    ------
    InputError
        When one of them is negative or not a number.
    """

    stress: float = 0.0
    length: float = 0.0
    slack: float = 0.0
    zero: float = 0.0
    stretch: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not isinstance(value, Real) or isinstance(value, bool) or not 0 <= float(value) < inf:
                raise InputError(f"the tolerance of the {name} must be a number, zero or more, not {value!r}.")

    def __bool__(self) -> bool:
        return any(vars(self).values())

    def in_common(self, experiment: Experiment) -> float:
        """Return the standard deviation of the relative error of stress that all specimens have in common."""
        return float(self.stress / np.sqrt(specimens_of(experiment).shape[1]))

    @property
    def need_slope(self) -> bool:
        """Whether any of them moves the curve along the stretch."""
        return bool(self.length or self.slack or self.stretch)

    def variance(
        self, mode: LoadingMode, stretch: FloatArray, stress: FloatArray, slope: FloatArray | float
    ) -> FloatArray:
        """Return the variance (..., n) of the stress of a test at stretches (n,), where it would be ``stress``."""
        found = (self.stress * stress) ** 2 + self.zero**2
        if self.need_slope:
            strain, whole = _strains(mode, stretch)
            found = found + slope**2 * ((self.length * strain) ** 2 + (self.slack * whole) ** 2 + self.stretch**2)
        return np.asarray(found)

    def noise(self, test: Experiment, curve: FloatArray) -> FloatArray:
        """Return what the errors of every single stretch are as noise of the stress: sd (n,), MPa."""
        return self.stretch * np.abs(self._slope(test, curve)) if self.stretch else np.zeros(len(curve))

    def _slope(self, test: Experiment, curve: FloatArray) -> FloatArray:
        if test.stretch.ndim > 1 or test.stress.ndim > 1:
            raise InputError(
                f"experiment '{test.name}' has several controls or stresses: tolerances of length, slack and stretch "
                "are for tests with one of each."
            )
        return smoothed(test.stretch, curve).slope

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
        slope = self._slope(test, curve)
        strain, whole = _strains(test.mode, test.stretch)
        moved = self.length * strain * slope, self.slack * whole * slope
        return np.column_stack([self.stress * curve, *moved, np.full(len(curve), self.zero)])


def _strains(mode: LoadingMode, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by what relative errors of the gauge length, and of the stretch free of stress, change the stretch."""
    strain = stretch - mode.reference
    return strain, stretch if mode.reference else np.ones_like(stretch)


BETWEEN_SPECIMENS = Tolerances(stress=0.18)
"""For tests of different specimens, where nothing is said: their stresses agree to 18 %."""


def specimens_of(experiment: Experiment) -> NDArray[np.bool_]:
    """Return which tests (tests, specimens) are of which specimen; a test without a name is of one of its own."""
    every = [part.specimen or number for number, part in enumerate(experiment.parts)]
    return np.array([[each == specimen for specimen in dict.fromkeys(every)] for each in every])
