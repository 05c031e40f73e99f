"""Gaussian processes in stress of which something is known to be zero: the reference state, integrals, or the whole."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.discrepancy.gaussian_process import c, psi
from tissuq.discrepancy.kernels import squared_exponential
from tissuq.errors import ModelError

__all__ = ["ConditionedProcess", "RangeProcess", "nodes_over"]

FloatArray = NDArray[np.float64]

NODES = 96
"""Of the rule over the range of the data: they tell a correlation length of 0.02 times the range."""


class ConditionedProcess(Discrepancy):
    """Zero mean and covariance c^2 K, K the squared exponential (psi) given that something of the process is zero.

    ``c`` stays the standard deviation of the process before that; what is left of it is smaller, the more so the longer
    ``psi`` is.
    """

    parameters = (c, psi)
    shape_symbols = ("psi",)

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        return values["c"] ** 2


class RangeProcess(ConditionedProcess):
    """A process conditioned on what it does over the range of the data: its definition depends on the experiment."""

    ends: tuple[float, float] | None = None
    """The range of the stretches, once it is known."""

    @abstractmethod
    def zeros(self, stretch: Any, length: Any) -> tuple[Any, Any]:
        """Return the covariances (n, k) of the process with the k quantities that are zero, and of these (k, k)."""

    def correlation(self, first: Any, second: Any, values: Mapping[str, Any]) -> Any:
        length = values["psi"]
        one, among = self._zeros(first, length)
        other, _ = self._zeros(second, length)
        explained = one @ one.__array_namespace__().linalg.solve(among, other.T)
        return squared_exponential((first[:, None] - second[None, :]) / length) - explained

    def relative_variance(self, stretch: Any, values: Mapping[str, Any]) -> Any:
        one, among = self._zeros(stretch, values["psi"])
        arrays = one.__array_namespace__()
        explained = (one * arrays.linalg.solve(among, one.T).T).sum(axis=1)
        return arrays.maximum(1.0 - explained, 0.0)

    def _zeros(self, stretch: Any, length: Any) -> tuple[Any, Any]:
        if self.ends is None:
            raise ModelError(f"discrepancy '{self.name}' depends on the experiment: it needs adapted_to first.")
        return self.zeros(stretch, length)


@lru_cache(maxsize=64)
def nodes_over(ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre nodes between two ends, and their weights, which sum to one."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (ends[0] + ends[1]) + 0.5 * (ends[1] - ends[0]) * nodes, 0.5 * weights
