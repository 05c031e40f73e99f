"""Priors that go together: normal and log-normal ones whose standard scores are correlated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.parameters.priors import LogNormal, Normal, Prior

__all__ = ["PriorCorrelation", "correlated"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class PriorCorrelation:
    """The correlation of standard scores: of normal parameters, and of the logarithms of log-normal ones.

    The parameters on that line are jointly normal, so that their density is that of the priors times
    exp(-z' (R^-1 - I) z / 2) / sqrt(det R) with z their scores.

    Attributes
    ----------
    priors : tuple of Prior
        Of all parameters of the forward model, in their order.
    matrix : tuple of tuples of float
        R.
    """

    priors: tuple[Prior, ...]
    matrix: tuple[tuple[float, ...], ...]

    def scores(self, independent: FloatArray) -> FloatArray:
        """Return correlated scores (N, d) of independent ones (N, d)."""
        return np.asarray(independent @ np.linalg.cholesky(np.array(self.matrix)).T)

    def log_density(self, values: Sequence[Any], arrays: Any) -> Any:
        """Return the log of the factor beside the priors at parameters (d,); ``arrays`` is NumPy or jax.numpy."""
        size = len(self.matrix)
        weights = np.linalg.inv(self.matrix) - np.eye(size)
        is_correlated = np.abs(weights).sum(axis=1) > 0
        pairs = zip(self.priors, values, is_correlated, strict=True)
        scores = arrays.stack([_score(prior, value, arrays) if used else 0.0 * value for prior, value, used in pairs])
        return -0.5 * scores @ weights @ scores - 0.5 * np.linalg.slogdet(self.matrix)[1]


def correlated(priors: Mapping[str, Prior], correlations: Mapping[tuple[str, str], float]) -> PriorCorrelation | None:
    """Return the correlation of priors from that of pairs; None where there is none.

    Raises
    ------
    InputError
        When a pair is not one of two parameters with normal or log-normal priors, or the pairs contradict each other.
    """
    if not correlations:
        return None
    symbols, matrix = list(priors), np.eye(len(priors))
    for pair, value in correlations.items():
        unknown = [symbol for symbol in pair if symbol not in priors]
        if len(pair) != 2 or pair[0] == pair[1] or unknown:
            raise InputError(
                f"the prior correlation of {', '.join(pair)} is not one of two parameters of the model, which are "
                f"{', '.join(symbols)}."
            )
        for symbol in pair:
            if not _is_whole(priors[symbol]):
                raise InputError(
                    f"the prior of {symbol}, {priors[symbol]}, can have no correlation: only normal priors without "
                    "bounds and log-normal ones can."
                )
        if not -1 < value < 1:
            raise InputError(f"the prior correlation of {', '.join(pair)} must lie between -1 and 1, not at {value:g}.")
        i, j = (symbols.index(symbol) for symbol in pair)
        matrix[i, j] = matrix[j, i] = value
    if np.linalg.eigvalsh(matrix)[0] <= 1e-9:
        raise InputError("the prior correlations contradict each other: no parameters have them together.")
    return PriorCorrelation(tuple(priors.values()), tuple(map(tuple, matrix.tolist())))


def _is_whole(prior: Prior) -> bool:
    is_unbounded = prior.support in ((-np.inf, np.inf), (0.0, np.inf))
    return (
        is_unbounded
        and isinstance(prior, Normal | LogNormal)
        and not (isinstance(prior, Normal) and prior.support[0] == 0)
    )


def _score(prior: Prior, value: Any, arrays: Any) -> Any:
    """Return how many standard deviations a value is from the middle, on the line of a normal or log-normal prior."""
    if isinstance(prior, LogNormal):
        return (arrays.log(value) - np.log(prior.median)) / prior.sd_log
    assert isinstance(prior, Normal)  # noqa: S101 (others have no correlation)
    return (value - prior.mean) / prior.sd
