"""What makes measurements whose errors differ and hang together into ones of independent and equal errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.experiment import Experiment
from tissuq.tolerances import Tolerances, specimens_of

__all__ = ["Whitening", "whitening"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Whitening:
    """What turns measurements whose errors differ and hang together into ones of independent errors of sd noise_sd.

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
        before = columns.__array_namespace__().concat([columns[:1], columns[:-1]])
        return ((columns.T - self.lag * before.T) / self._fresh).T

    def transposed(self, columns: FloatArray) -> FloatArray:
        """Return the transpose of the whitening times columns (n,) or (n, k)."""
        own = self._stretched(columns, 1 / np.sqrt(1 + self.spread)).T / self._fresh
        after = np.concatenate([own[..., 1:] * self.lag[1:], np.zeros_like(own[..., :1])], axis=-1)
        return np.asarray(((own - after) / self.size).T)

    def undone(self, columns: FloatArray) -> FloatArray:
        """Return the columns (n,) or (n, k) that the whitening makes these of."""
        own = (self._stretched(columns, np.sqrt(1 + self.spread)).T * self._fresh).T
        if self.lag.any():
            for row in range(1, len(own)):
                own[row] += self.lag[row] * own[row - 1]
        return np.asarray((own.T * self.size).T)

    @property
    def _fresh(self) -> FloatArray:
        """What of each error is new (n,), over its size."""
        return np.sqrt(1 - self.lag**2)

    def _stretched(self, columns: Any, factors: FloatArray) -> Any:
        """Return columns with their parts along U times factors (q,)."""
        return columns + self.along @ ((self.along.T @ columns).T * (factors - 1)).T

    def precisions(self, white: FloatArray) -> FloatArray:
        """Return the diagonals (m, n) of the inverse covariances of the measurements, given those of whitened ones.

        Where errors hang together, whitened measurements must have one precision.
        """
        own, after = 1 / self._fresh, np.append((self.lag / self._fresh)[1:], 0.0)
        along = own[:, None] * self.along - after[:, None] * np.vstack([self.along[1:], self.along[:1]])
        lost = along**2 @ (self.spread / (1 + self.spread))
        return np.asarray(white * (own**2 + after**2 - lost) / self.size**2)

    @property
    def log_determinant(self) -> float:
        """The log of the absolute determinant of the whitening."""
        return float(-np.log(self.size * self._fresh).sum() - 0.5 * np.log1p(self.spread).sum())


def whitening(
    experiment: Experiment,
    noise_sd: FloatArray,
    usual: float,
    tolerances: Tolerances,
    curve: FloatArray | None = None,
    level: float | None = None,
    lag: float = 0.0,
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
    level : float, MPa, optional
        About what the sd of all independent errors is, where it is not noise_sd's: errors of whole tests are in
        proportion to it.
    lag : float
        Correlation of the noise of consecutive measurements.
    """
    level = level or usual
    count = [part.stress.size for part in experiment.parts]
    size, whole = np.repeat(noise_sd / usual, count), np.zeros((sum(count), 0))
    if tolerances and curve is not None:
        pairs = list(zip(experiment.parts, np.split(curve, np.cumsum(count)[:-1]), strict=True))
        size = np.hypot(size, np.concatenate([tolerances.noise(*pair) for pair in pairs]) / level)
        whole = _errors_of_tests(specimens_of(experiment), [tolerances.columns(*pair) for pair in pairs])
    starts = np.cumsum([0, *(len(stress) for _, _, stress in experiment.curves[:-1])])
    lags = np.where(np.isin(np.arange(len(size)), starts), 0.0, lag)
    bare = Whitening(size, lags, np.zeros((len(size), 0)), np.zeros(0))
    columns = bare(whole) / level
    along, singular, _ = np.linalg.svd(columns, full_matrices=False)
    kept = singular > 1e-8 * singular.max(initial=0.0)
    if not kept.any() and not lag and np.allclose(size, 1, rtol=1e-12):
        return None
    return Whitening(size, lags, along[:, kept], singular[kept] ** 2)


def _errors_of_tests(specimens: NDArray[np.bool_], columns: Sequence[FloatArray]) -> FloatArray:
    """Return what errors of whole specimens do to all measurements (n, q), from what they do to those of each test.

    Of the stress, in the first column, only the specimens' differences from their mean.
    """
    shared = specimens.astype(np.float64)
    between = shared - shared.mean(axis=1, keepdims=True)
    return np.concatenate(
        [
            np.column_stack([np.outer(own[:, 0], apart), *(np.outer(column, same) for column in own[:, 1:].T)])
            for own, apart, same in zip(columns, between, shared, strict=True)
        ]
    )
