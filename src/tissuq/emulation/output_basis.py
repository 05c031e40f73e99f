"""The few directions in which the outputs of a model vary from run to run, or the logarithms of the outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray

MAX_TRUNCATED_SHARE = 1e-10
"""Largest share of the outputs' variance in the directions that are truncated."""
MAX_LOG_VARIANCE = 10.0
"""Largest variance of a logarithm, beyond which its moments would overflow."""


@dataclass(frozen=True, eq=False)
class OutputBasis:
    """Outputs, or the logarithms of their sizes, = mean + directions @ scores + truncated remainder.

    Parameters
    ----------
    mean : (n,) array
    directions : (n, q) array
        Scaled, so that the scores of the runs have unit variance.
    truncated : (n, n) array
        Covariance of the truncated remainder over the runs.
    signs : (n,) array, optional
        Signs of the outputs, where their logarithms are taken; zero where an output is always zero.
    scale : (n,) array or float
        Sizes of the outputs, over which the directions are orthogonal.
    """

    mean: FloatArray
    directions: FloatArray
    truncated: FloatArray
    signs: FloatArray | None = None
    scale: FloatArray | float = 1.0

    @property
    def is_log(self) -> bool:
        """Whether it is one of logarithms."""
        return self.signs is not None

    def truncated_to(self, is_kept: BoolArray) -> OutputBasis:
        """Return the basis of some of its directions (q,); the others become part of the remainder."""
        dropped = self.directions[:, ~is_kept]
        return replace(self, directions=self.directions[:, is_kept], truncated=self.truncated + dropped @ dropped.T)

    def scores(self, outputs: FloatArray) -> FloatArray:
        """Return the scores (N, q) of outputs (N, n)."""
        directions = (self.directions.T / self.scale).T
        size = (directions**2).sum(axis=0)
        return np.asarray((self._working_scale(outputs) - self.mean) / self.scale @ (directions / size))

    def residuals(self, outputs: FloatArray) -> FloatArray:
        """Return the remainder of outputs (N, n), or of their logarithms, that the directions do not reach."""
        return np.asarray(self._working_scale(outputs) - self.mean - self.scores(outputs) @ self.directions.T)

    def _working_scale(self, outputs: FloatArray) -> FloatArray:
        return outputs if self.signs is None else _logs(outputs, self.signs)

    @property
    def arrays(self) -> dict[str, Any]:
        """The arrays of which `output_moments` is computed."""
        arrays = {name: getattr(self, name) for name in ("mean", "directions", "truncated")}
        return arrays if self.signs is None else arrays | {"signs": self.signs}


def basis_of(outputs: FloatArray, *, is_log: bool = False, quantities: Sequence[tuple[int, int]] = ()) -> OutputBasis:
    """Return the directions in which outputs (m, n) of runs vary, up to a negligible share of their variance.

    Outputs from the first to the last but one of ``quantities`` have a unit of their own, and equal weight together.
    """
    signs = np.sign(outputs[0]) if is_log else None
    working = outputs if signs is None else _logs(outputs, signs)
    mean = working.mean(axis=0)
    scale = np.ones(outputs.shape[1])
    for start, stop in quantities if len(quantities) > 1 and not is_log else ():
        scale[start:stop] = np.sqrt(((working - mean)[:, start:stop] ** 2).sum(axis=1).mean()) or 1.0
    _, sizes, directions = np.linalg.svd((working - mean) / scale, full_matrices=False)
    remaining_share = 1 - np.cumsum(sizes**2) / max((sizes**2).sum(), np.finfo(float).tiny)
    count = int(np.argmax(remaining_share <= MAX_TRUNCATED_SHARE)) + 1
    scaled = sizes[:, None] * directions * scale / np.sqrt(max(len(outputs) - 1, 1))
    return OutputBasis(mean, scaled[:count].T, scaled[count:].T @ scaled[count:], signs, scale)


def has_signs(outputs: FloatArray) -> bool:
    """Return whether every output has the same sign in all runs, so that logarithms can be taken."""
    return bool((np.sign(outputs) == np.sign(outputs[0])).all() and outputs.any())


def output_moments(arrays: dict[str, Any], mean: Any, variance: Any, error: Any = 0.0) -> tuple[Any, Any]:
    """Return mean (n,) and covariance (n, n) of the outputs from those of the scores (q,), NumPy or JAX.

    ``error`` (n,) is added to the mean before logarithms are undone. The moments of a log-normal are exact.
    """
    directions = arrays["directions"]
    centre = arrays["mean"] + directions @ mean + error
    cov = (directions * variance) @ directions.T + arrays["truncated"]
    if "signs" not in arrays:
        return centre, cov
    library = centre.__array_namespace__()
    bounded = library.minimum(cov, MAX_LOG_VARIANCE)
    sizes = arrays["signs"] * library.exp(centre + 0.5 * library.diagonal(bounded))
    return sizes, sizes[:, None] * sizes[None, :] * library.expm1(bounded)


def _logs(outputs: FloatArray, signs: FloatArray) -> FloatArray:
    return np.log(np.where(signs == 0, 1.0, np.abs(outputs)))
