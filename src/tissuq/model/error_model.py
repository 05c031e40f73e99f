"""The errors of all measurements: their variances, and the whitening that makes them independent and equal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, States
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.measurement_errors import ErrorPoints, Shared
from tissuq.model.noise import Noise, stress_level
from tissuq.model.tolerances import FittedErrors, Tolerances, specimens_of

NEGLIGIBLE_SPREAD, ROUNDING = 1e-9, 1e-14
"""Variance of a shared error over that of the noise, and over the largest one, below which it is left out."""


def widening_of_lag(lag: float) -> float:
    """Return how much larger independent errors tell as little of a smooth curve as those of a lag-1 correlation.

    The root of the spectral density of first-order autoregression at frequency zero, over its variance.
    """
    return float(np.sqrt((1 + lag) / (1 - lag)))


@dataclass(frozen=True, eq=False)
class Whitening:
    """What turns measurements whose errors differ and are correlated into ones of independent errors of sd noise_sd.

    Their covariance is noise_sd^2 D A^-1 (I + U diag(spread) U') A^-T D with D = diag(size) and orthonormal U; A takes
    from every error what the one before it lets expect, so that the errors before are those of first-order
    autoregression with the variance D^2.

    Attributes
    ----------
    size : (n,) array
        Noise of each measurement over noise_sd.
    lag : (n,) array
        Correlation of its noise with that of the measurement before it; zero for the first of a curve.
    along : (n, q) array
        U.
    spread : (q,) array
    """

    size: FloatArray
    lag: FloatArray
    along: FloatArray
    spread: FloatArray

    def __call__(self, columns: Any) -> Any:
        """Return columns (n,) or (n, k) of the measurements, whitened."""
        return self._stretched(self.unlagged((columns.T / self.size).T), 1 / np.sqrt(1 + self.spread))

    def unlagged(self, columns: Any) -> Any:
        """Return A times columns (n,) or (n, k)."""
        if not self.lag.any():
            return columns
        preceding = columns.__array_namespace__().concat([columns[:1], columns[:-1]])
        return ((columns.T - self.lag * preceding.T) / self._fresh).T

    def transposed(self, columns: FloatArray) -> FloatArray:
        """Return the transpose of the whitening times columns (n,) or (n, k)."""
        scaled = self._stretched(columns, 1 / np.sqrt(1 + self.spread)).T / self._fresh
        from_next = np.concatenate([scaled[..., 1:] * self.lag[1:], np.zeros_like(scaled[..., :1])], axis=-1)
        return np.asarray(((scaled - from_next) / self.size).T)

    def undone(self, columns: FloatArray) -> FloatArray:
        """Return the columns (n,) or (n, k) that the whitening makes these of."""
        errors = (self._stretched(columns, np.sqrt(1 + self.spread)).T * self._fresh).T
        if self.lag.any():
            for row in range(1, len(errors)):
                errors[row] += self.lag[row] * errors[row - 1]
        return np.asarray((errors.T * self.size).T)

    @property
    def _fresh(self) -> FloatArray:
        """What of each error is new (n,), over its size."""
        return np.sqrt(1 - self.lag**2)

    def _stretched(self, columns: Any, factors: FloatArray) -> Any:
        """Return columns with their parts along U times factors (q,)."""
        return columns + self.along @ ((self.along.T @ columns).T * (factors - 1)).T

    def precisions(self, white: FloatArray) -> FloatArray:
        """Return the diagonals (m, n) of the inverse covariances of the measurements, given those of whitened ones.

        Where errors are correlated, whitened measurements must have one precision.
        """
        diagonal, off_diagonal = 1 / self._fresh, np.append((self.lag / self._fresh)[1:], 0.0)
        along = diagonal[:, None] * self.along - off_diagonal[:, None] * np.vstack([self.along[1:], self.along[:1]])
        lost = along**2 @ (self.spread / (1 + self.spread))
        return np.asarray(white * (diagonal**2 + off_diagonal**2 - lost) / self.size**2)

    @property
    def log_determinant(self) -> float:
        """The log of the absolute determinant of the whitening."""
        return float(-np.log(self.size * self._fresh).sum() - 0.5 * np.log1p(self.spread).sum())


def whitening(
    experiment: Experiment,
    noise_sd: FloatArray,
    mean_sd: float,
    tolerances: Tolerances,
    errors: FittedErrors,
) -> Whitening | None:
    """Return the whitening of tests, or None where their errors are independent and equal as they are.

    Parameters
    ----------
    experiment : Experiment
        One test, or several.
    noise_sd : (tests,) array, MPa
        Noise of each test, as known or about.
    mean_sd : float, MPa
        Their geometric mean, for which the parameter noise_sd stands.
    tolerances : Tolerances
    errors : FittedErrors
        The curve along which whole tests err and its slopes, the level of the independent errors where it is not
        noise_sd's, and the correlation of the noise of consecutive measurements.
    """
    level, lag = errors.level or mean_sd, errors.lag or 0.0
    count = [test.size for test in experiment.tests]
    size, shared = np.repeat(noise_sd / mean_sd, count), np.zeros((sum(count), 0))
    if tolerances and (tests := errors.points_of(experiment)):
        size = np.hypot(size, np.concatenate([tolerances.noise(points) for points in tests]) / level)
        shared = _errors_of_tests(specimens_of(experiment), tolerances, tests)
    starts = np.cumsum([0, *(len(measured) for measured in experiment.curves[:-1])])
    lags = np.where(np.isin(np.arange(len(size)), starts), 0.0, lag)
    bare = Whitening(size, lags, np.zeros((len(size), 0)), np.zeros(0))
    columns = bare(shared) / level
    spread, vectors = np.linalg.eigh(columns.T @ columns)
    is_significant = spread > np.maximum(NEGLIGIBLE_SPREAD, ROUNDING * spread.max(initial=0.0))
    if not is_significant.any() and not lag and np.allclose(size, 1, rtol=1e-12):
        return None
    along = columns @ (vectors[:, is_significant] / np.sqrt(spread[is_significant]))
    return Whitening(size, lags, along, spread[is_significant])


def _errors_of_tests(specimens: BoolArray, tolerances: Tolerances, tests: Sequence[ErrorPoints]) -> FloatArray:
    """Return what errors of whole tests do to all measurements (n, q), at the points of these.

    Of some errors only the differences of specimens or tests from their mean. Where tests have different numbers of
    such columns, as of two stresses beside one, those that are missing are zero.
    """
    of_specimen = specimens.astype(np.float64)
    memberships: dict[Shared, FloatArray] = {
        "specimens' differences": of_specimen - of_specimen.mean(axis=1, keepdims=True),
        "tests' differences": np.eye(len(tests)) - 1 / len(tests),
        "specimen": of_specimen,
        "test": np.eye(len(tests)),
    }
    groups = []
    for shared, membership in memberships.items():
        columns = [tolerances.columns(points, shared) for points in tests]
        widest = max(column.shape[1] for column in columns)
        padded = [np.pad(column, [(0, 0), (0, widest - column.shape[1])]) for column in columns]
        groups.append(
            np.concatenate([np.kron(column, row[None]) for column, row in zip(padded, membership, strict=True)])
        )
    return np.hstack(groups)


class ErrorModel:
    """The errors of the measurements: what is independent of them, what is correlated, and the whitening of tests.

    Everything that inference sees of the data is whitened.
    """

    experiment: Experiment
    discrepancy: Discrepancy
    noise: Noise
    tolerances: Tolerances
    fitted_errors: FittedErrors

    @cached_property
    def whitening(self) -> Whitening | None:
        """What makes the errors of several tests independent and equal; None where they are so already."""
        if len(self.experiment.tests) == 1 and not self.tolerances and not self.fitted_errors.lag:
            return None
        noise_sd, mean_sd = self.noise_of_tests
        return whitening(self.experiment, noise_sd, mean_sd, self.tolerances, self.fitted_errors)

    @cached_property
    def noise_of_tests(self) -> tuple[FloatArray, float]:
        """The noise (tests,) of every test as known or about, MPa, and its geometric mean."""
        noise_sd = self.noise.of_tests(self.experiment)
        mean_sd = float(np.exp(np.log(noise_sd).mean()))
        return np.full(len(noise_sd), mean_sd) if self.noise.depends_on_level else noise_sd, mean_sd

    def white(self, columns: Any) -> Any:
        """Return columns (n,) or (n, k) of the measurements in units in which their errors are independent and equal.

        Everything that inference sees of the data is whitened.
        """
        return columns if self.whitening is None else self.whitening(columns)

    @property
    def log_whitening(self) -> float:
        """What whitening adds to the log density of the data."""
        return 0.0 if self.whitening is None else self.whitening.log_determinant

    def relative_noise(self, states: States) -> Any:
        """Return the noise over noise_sd at states (g,): that of the test; one where there is none."""
        if self.whitening is None or len(self.experiment.tests) == 1:
            return 1.0
        noise_sd, mean_sd = self.noise_of_tests
        of_curves = np.repeat(noise_sd / mean_sd, [len(test.curves) for test in self.experiment.tests])
        return np.append(of_curves, 1.0)[states.curve]  # the last one is of what no test has measured

    def noise_of_new_test(self, mode: LoadingMode) -> float:
        """Return the noise of a new test in a mode over noise_sd: what is `typical` of the tests in it."""
        if len(self.experiment.tests) == 1:
            return 1.0
        noise_sd, mean_sd = self.noise_of_tests
        return typical(noise_sd, [test.mode == mode for test in self.experiment.tests]) / mean_sd

    @property
    def common_error(self) -> float:
        """The relative standard deviation of the error of stress that all measurements have in common.

        It is not in the data: everything that is inferred is the tissue's stress times it, and so are `column_symbols`.
        """
        return self.tolerances.in_common(self.experiment)

    def noise_variance(self, values: Mapping[str, Any], level: Any) -> Any:
        """Return the variance (MPa^2) of the measurement noise where the absolute stress has a level (MPa)."""
        return self.noise.sd(values, level) ** 2

    def independent_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) of what the discrepancy adds to every measurement by itself."""
        return 0.0 if self.is_repeated else self.discrepancy.independent_variance(values)

    def white_variance(self, values: Mapping[str, Any], level: Any = 0.0) -> Any:
        """Return the variance (MPa^2) of all that is independent from measurement to measurement."""
        return self.noise_variance(values, level) + self.independent_variance(values)

    @cached_property
    def levels(self) -> FloatArray:
        """The level of the stress (n,) at every measurement, MPa, for noise that depends on it."""
        return stress_level(self.experiment)

    @property
    def is_correlated(self) -> bool:
        """Whether the discrepancy at one measurement tells something about another."""
        return self.discrepancy.is_correlated or self.is_repeated

    @cached_property
    def is_repeated(self) -> bool:
        """Whether measurements at one stretch share an otherwise independent discrepancy."""
        is_only_scattered = self.discrepancy.is_scattered and not self.discrepancy.is_correlated
        return self.noise.shares_discrepancy and is_only_scattered

    @property
    def has_directions(self) -> bool:
        """Whether errors are independent along directions that the size of noise and discrepancy leave alone."""
        return not (self.is_correlated and self.noise.depends_on_level)

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) of the correlated part of the discrepancy."""
        if self.is_repeated:
            return self.discrepancy.independent_variance(values)
        return self.discrepancy.correlated_variance(values)

    def correlation(self, rows: States, columns: States, values: Mapping[str, Any]) -> Any:
        """Return the (n, m) covariance of the correlated part between two sets of states, over its variance."""
        if self.is_repeated:
            return 1.0 * (rows.abscissa[:, None] == columns.abscissa[None, :])
        return self.discrepancy.correlation(rows, columns, values)

    def relative_variance(self, states: States, values: Mapping[str, Any]) -> Any:
        """Return the (n,) diagonal of `correlation`."""
        return self.discrepancy.relative_variance(states, values)


def typical(sizes: FloatArray, are_alike: Sequence[bool]) -> float:
    """Return the geometric mean of sizes (tests,) of the tests that are alike; of all tests where none is."""
    return float(np.exp(np.log(sizes[list(are_alike)] if any(are_alike) else sizes).mean()))
