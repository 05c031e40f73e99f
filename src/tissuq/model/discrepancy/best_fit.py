"""Gaussian-process discrepancies in stress that leave the material what it can fit (Plumlee 2017, Gu & Wang 2018)."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.experiments.experiment import Curve, Experiment
from tissuq.experiments.modes import Path
from tissuq.mechanics.material import Material
from tissuq.mechanics.stress import stress_basis
from tissuq.model.discrepancy.processes import ConditionedProcess, squared_exponential

__all__ = ["OrthogonalProcess", "RangeProcess", "ScaledProcess"]

FloatArray = NDArray[np.float64]

QUADRATURE_NODES = 96
"""Of the rule over the range of the data: they tell a correlation length of 0.02 times the range."""
MIN_RELATIVE_VARIANCE = 1e-13
"""Variance of the integrals, relative to their sum, that is as good as none: a long psi makes them nearly dependent."""


class RangeProcess(ConditionedProcess):
    """A process conditioned on what it does over the range of the data: its definition depends on the experiment."""

    ranges: tuple[tuple[float, float], ...] = ()
    """The range of the stretches of every curve, once they are known."""

    is_best_fit = True

    @abstractmethod
    def zeros(self, curve: int, abscissa: Any, length: Any) -> tuple[Any, Any]:
        """Return the covariances (n, k) of the process with the k quantities that are zero, and of these (k, k)."""

    def kernel(self, curve: int, at_rows: Any, at_columns: Any, values: Mapping[str, Any]) -> Any:
        length = values["psi"]
        rows, among = self._zeros(curve, at_rows, length)
        columns, _ = self._zeros(curve, at_columns, length)
        explained = rows @ rows.__array_namespace__().linalg.solve(among, columns.T)
        return squared_exponential((at_rows[:, None] - at_columns[None, :]) / length) - explained

    def kernel_diagonal(self, curve: int, abscissa: Any, values: Mapping[str, Any]) -> Any:
        rows, among = self._zeros(curve, abscissa, values["psi"])
        arrays = rows.__array_namespace__()
        explained = (rows * arrays.linalg.solve(among, rows.T).T).sum(axis=1)
        return arrays.maximum(1.0 - explained, 0.0)

    def _zeros(self, curve: int, abscissa: Any, length: Any) -> tuple[Any, Any]:
        if not self.ranges:
            raise ModelError(f"discrepancy '{self.name}' depends on the experiment: it needs adapted_to first.")
        return self.zeros(curve, abscissa, length)


@dataclass(frozen=True)
class OrthogonalProcess(RangeProcess):
    """The squared exponential given that M has no part that the material could fit.

    The integral of M(l) d stress/d theta_j over the range of the data is zero for every parameter theta_j. So the
    material that comes closest to the whole curve in the mean square is estimated. Beyond the range nothing
    binds M but its smoothness.

    References
    ----------
    Plumlee (2017), Bayesian calibration of inexact computer models, JASA 112, 1274-1285.
    """

    material: Material | None = None
    paths: tuple[Path, ...] = ()
    ranges: tuple[tuple[float, float], ...] = ()

    name = "gp-orthogonal"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)) given integrals of M d stress/d theta = 0 over the data"
    source = "Plumlee 2017, for the parameters in which the stress is linear"
    caution = (
        "What is estimated is the material that best fits the stress over the range of the data, not the initial "
        "modulus: another range has another answer. Do not read C10 as half the modulus of the tissue."
    )

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        bent = [parameter.symbol for parameter in material.parameters if not parameter.is_linear]
        if bent:
            raise ModelError(
                f"discrepancy '{self.name}' is defined for stresses that are linear in the parameters, and that of "
                f"material '{material.name}' is not in {', '.join(bent)}: choose another discrepancy, or material."
            )
        curves = self.curves_of_one_stretch(experiment)
        paths, ranges = tuple(curve.path for curve in curves), tuple(map(_range_of, curves))
        return replace(self, material=material, paths=paths, ranges=ranges, curves=len(curves))

    def zeros(self, curve: int, abscissa: Any, length: Any) -> tuple[Any, Any]:
        assert self.material is not None  # noqa: S101 (it comes with the ranges)
        nodes, columns = _weighted_stresses(self.material, self.paths[curve], self.ranges[curve])
        with_integrals = squared_exponential((abscissa[:, None] - nodes) / length) @ columns
        integrals = columns.T @ squared_exponential((nodes[:, None] - nodes) / length) @ columns
        return with_integrals, integrals + MIN_RELATIVE_VARIANCE * integrals.trace() * np.eye(columns.shape[1])


@dataclass(frozen=True)
class ScaledProcess(RangeProcess):
    """The squared exponential whose paths are weighted by exp(-lambda mean(M^2) / (2 c^2)), mean over the data's range.

    With points x_i and weights w_i of a rule for that mean, it is the process given M(x_i) + e_i = 0 with independent
    e_i of variance c^2 / (lambda w_i); for equal weights, K = R - R_x (R_xx + (m / lambda) I)^-1 R_x', the paper's
    discretised form. No direction of M keeps a root mean square of more than c / sqrt(lambda).

    Parameters
    ----------
    penalty : float
        lambda = penalty sqrt(n) for n measurements. Gu, Xie & Wang (arXiv:1807.03829) show that lambda proportional to
        sqrt(n) c / noise_sd finds the best-fitting material as n grows. The ratio of c to the noise is set to 10 here,
        where the authors' package RobustCalibration starts, so that lambda changes with neither.

    References
    ----------
    Gu & Wang (2018), Scaled Gaussian stochastic process for computer model calibration and prediction, SIAM/ASA Journal
    on Uncertainty Quantification 6, 1555-1583.
    """

    penalty: float = 10.0
    measurements: tuple[int, ...] = ()
    ranges: tuple[tuple[float, float], ...] = ()

    name = "gp-scaled"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)), M weighted by exp(-5 sqrt(n) mean(M^2) / c^2)"
    source = "Gu & Wang 2018, with lambda = 10 sqrt(n)"
    caution = (
        "What is estimated is the material that best fits the stress over the range of the data, not the initial "
        "modulus: the discrepancy is kept small, whatever the material is. Do not read C10 as half the modulus of the "
        "tissue."
    )

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        curves = self.curves_of_one_stretch(experiment)
        counts, ranges = tuple(map(len, curves)), tuple(map(_range_of, curves))
        return replace(self, measurements=counts, ranges=ranges, curves=len(curves))

    def zeros(self, curve: int, abscissa: Any, length: Any) -> tuple[Any, Any]:
        nodes, weights = _nodes_over(self.ranges[curve])
        root = np.sqrt(weights)
        among = root[:, None] * squared_exponential((nodes[:, None] - nodes) / length) * root
        cross = squared_exponential((abscissa[:, None] - nodes) / length) * root
        return cross, among + np.eye(len(nodes)) / (self.penalty * sqrt(self.measurements[curve]))


def _range_of(curve: Curve) -> tuple[float, float]:
    """Return the least and the largest stretch of a curve."""
    return float(curve.abscissa.min()), float(curve.abscissa.max())


@lru_cache(maxsize=64)
def _nodes_over(ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre nodes between two ends, and their weights, which sum to one."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_NODES)
    return 0.5 * (ends[0] + ends[1]) + 0.5 * (ends[1] - ends[0]) * nodes, 0.5 * weights


@lru_cache(maxsize=64)
def _weighted_stresses(material: Material, path: Path, ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return nodes (m,) over a range, and columns (m, k) whose products with M are its integrals with the stresses.

    The stresses of unit parameters are replaced by orthonormal combinations, which the same M are orthogonal to.
    """
    nodes, weights = _nodes_over(ends)
    root = np.sqrt(weights)[:, None]
    orthonormal, _ = np.linalg.qr(root * stress_basis(material, path.at(nodes)))
    return nodes, root * orthonormal
