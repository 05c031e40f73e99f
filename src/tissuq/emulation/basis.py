"""Few numbers that stand for the many outputs of a run: the singular value decomposition of what was computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["OutputBasis", "basis_of", "has_signs"]

FloatArray = NDArray[np.float64]

LEFT_OUT = 1e-10
"""Share of the outputs' variance in the directions that are left out, at most."""
MOST_LOG = 10.0
"""Variance of a logarithm beyond which nothing is known anyway."""


@dataclass(frozen=True, eq=False)
class OutputBasis:
    """Outputs, or the logarithms of their sizes, = mean + directions @ scores + what is left out.

    Parameters
    ----------
    mean : (n,) array
    directions : (n, q) array
        Scaled, so that the scores of the runs have unit variance.
    left_out : (n, n) array
        Covariance of what is left out, over the runs.
    signs : (n,) array, optional
        Of the outputs, where their logarithms are taken; zero where an output is always zero.
    """

    mean: FloatArray
    directions: FloatArray
    left_out: FloatArray
    signs: FloatArray | None = None

    @property
    def is_log(self) -> bool:
        """Whether it is one of logarithms."""
        return self.signs is not None

    def scores(self, outputs: FloatArray) -> FloatArray:
        """Return the scores (N, q) of outputs (N, n)."""
        size = (self.directions**2).sum(axis=0)
        return np.asarray((self._plain(outputs) - self.mean) @ (self.directions / size))

    def residuals(self, outputs: FloatArray) -> FloatArray:
        """Return what of outputs (N, n), or of their logarithms, the directions do not reach."""
        return np.asarray(self._plain(outputs) - self.mean - self.scores(outputs) @ self.directions.T)

    def _plain(self, outputs: FloatArray) -> FloatArray:
        return outputs if self.signs is None else _logs(outputs, self.signs)

    @property
    def arrays(self) -> dict[str, Any]:
        """What `output_moments` needs."""
        own = {name: getattr(self, name) for name in ("mean", "directions", "left_out")}
        return own if self.signs is None else own | {"signs": self.signs}


def basis_of(outputs: FloatArray, *, is_log: bool = False) -> OutputBasis:
    """Return the directions in which outputs (m, n) of runs vary, up to a negligible share of their variance."""
    signs = np.sign(outputs[0]) if is_log else None
    plain = outputs if signs is None else _logs(outputs, signs)
    mean = plain.mean(axis=0)
    _, sizes, directions = np.linalg.svd(plain - mean, full_matrices=False)
    rest = 1 - np.cumsum(sizes**2) / max((sizes**2).sum(), np.finfo(float).tiny)
    kept = int(np.argmax(rest <= LEFT_OUT)) + 1
    dropped = sizes[kept:, None] * directions[kept:]
    scale = max(len(outputs) - 1, 1)
    scaled = (sizes[:kept, None] * directions[:kept]).T / np.sqrt(scale)
    return OutputBasis(mean, scaled, dropped.T @ dropped / scale, signs)


def has_signs(outputs: FloatArray) -> bool:
    """Return whether every output has the same sign in all runs, so that logarithms can be taken."""
    return bool((np.sign(outputs) == np.sign(outputs[0])).all() and outputs.any())


def output_moments(arrays: dict[str, Any], mean: Any, variance: Any, error: Any = 0.0) -> tuple[Any, Any]:
    """Return mean (n,) and covariance (n, n) of the outputs from those of the scores (q,), NumPy or JAX.

    ``error`` (n,) is added to the mean before logarithms are undone. The moments of a log-normal are exact.
    """
    directions = arrays["directions"]
    centre = arrays["mean"] + directions @ mean + error
    cov = (directions * variance) @ directions.T + arrays["left_out"]
    if "signs" not in arrays:
        return centre, cov
    library = centre.__array_namespace__()
    known = library.minimum(cov, MOST_LOG)
    sizes = arrays["signs"] * library.exp(centre + 0.5 * library.diagonal(known))
    return sizes, sizes[:, None] * sizes[None, :] * library.expm1(known)


def _logs(outputs: FloatArray, signs: FloatArray) -> FloatArray:
    return np.log(np.where(signs == 0, 1.0, np.abs(outputs)))
