"""Gaussian-process discrepancies in stress: free, pinned at the reference, or leaving the material what it can fit."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import sqrt
from typing import Any, Self

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.experiments.curve import Curve
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Path
from tissuq.mechanics.material import Material
from tissuq.mechanics.stress import stress_basis
from tissuq.model.discrepancy.discrepancy import Discrepancy
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import Uniform

MAX_SERIES_EXPONENT = 40.0
"""Product of scores beyond which the first terms of the exponential's series are less than rounding."""
QUADRATURE_NODES = 96
"""Of the rule over the range of the data: they tell a correlation length of 0.02 times the range."""
MIN_RELATIVE_VARIANCE = 1e-13
"""Variance of the integrals, relative to their sum, that is as good as none: a long psi makes them nearly dependent."""
c = Parameter.scale("c", "standard deviation of the process")
psi = Parameter("psi", "correlation length", "stretch", (0.0, float("inf")), False, Uniform(0.02, 3.0))


def squared_exponential(score: Any) -> Any:
    """Return exp(-score^2 / 2)."""
    exponent = -0.5 * score**2
    return exponent.__array_namespace__().exp(exponent)


def pinned_squared_exponential(score: Any, score_prime: Any, derivatives: int) -> Any:
    """Return the squared exponential of scores, given that the process (and its derivative) are zero at zero.

    It is the product of both with zero, times exp(one other) without the first terms of its series, where that
    exponent is large, what is left out is less than rounding.
    """
    product = score * score_prime
    arrays = product.__array_namespace__()
    bounded = arrays.minimum(product, MAX_SERIES_EXPONENT)
    series = arrays.expm1(bounded) - (bounded if derivatives else 0.0)
    pinned = series * arrays.exp(-0.5 * (score**2 + score_prime**2))
    return arrays.where(product < MAX_SERIES_EXPONENT, pinned, squared_exponential(score - score_prime))


class GaussianProcess(Discrepancy):
    """Zero mean and covariance c^2 exp(-(l - l')^2 / (2 psi^2)) (eq. 25, 26).

    Differs from the source, which prints det for det^(1/2) and omits the noise variance in eq. 25.
    """

    name = "gp"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2))"
    source = "Zeraatpisheh et al. 2021, eq. 25 and 26"
    parameters = (c, psi)
    shape_symbols = ("psi",)
    caution = (
        "The process takes a share of the initial stiffness, and how much depends on the prior of its amplitude c."
    )

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        return values["c"] ** 2

    def kernel(self, curve: int, at_rows: Any, at_columns: Any, values: Mapping[str, Any]) -> Any:
        return squared_exponential((at_rows[:, None] - at_columns[None, :]) / values["psi"])


class ConditionedProcess(Discrepancy):
    """Zero mean and covariance c^2 K, K the squared exponential (psi) given that something of the process is zero.

    ``c`` stays the standard deviation of the process before that; what is left of it is smaller, the more so the longer
    ``psi`` is.
    """

    parameters = (c, psi)
    shape_symbols = ("psi",)

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        return values["c"] ** 2

    def curves_of_one_stretch(self, experiment: Experiment) -> tuple[Curve, ...]:
        """Return the curves of an experiment, each of which must be one stress against one control.

        Raises
        ------
        ModelError
            When a test has several controls or stresses.
        """
        for curve in experiment.curves:
            if len(curve.mode.controls) > 1 or len(curve.mode.stresses) > 1:
                raise ModelError(
                    f"discrepancy '{self.name}' is defined over the range of one stretch, and mode '{curve.mode.name}' "
                    f"of experiment '{curve.name}' has several controls or stresses: choose another one, such as "
                    "'auto'."
                )
        return experiment.curves


@dataclass(frozen=True)
class PinnedProcess(ConditionedProcess):
    """The squared exponential given M(1) = 0 and M'(1) = 0: no stress and no stiffness at the reference.

    With s = (l - 1) / psi, K = exp(-(s^2 + s'^2) / 2) (exp(s s') - 1 - s s'). Where nothing is
    deformed at 0, as in shear, the conditions are at 0.
    """

    references: tuple[float, ...] = (1.0,)

    name = "gp-pinned"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)) given M(1) = M'(1) = 0"
    source = "a Gaussian process conditioned on the reference state"
    caution = (
        "The initial stiffness is the material's own, but the process is an error of the stress in one test, not an "
        "energy: it says nothing of other loading modes. Measured in campaigns, its intervals hold the initial modulus "
        "less often than they say (docs/rivals.md)."
    )

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        references = tuple(float(curve.mode.reference) for curve in self.curves_of_one_stretch(experiment))
        return replace(self, references=references, curves=len(references))

    def kernel(self, curve: int, at_rows: Any, at_columns: Any, values: Mapping[str, Any]) -> Any:
        rows, columns = ((abscissa - self.references[curve]) / values["psi"] for abscissa in (at_rows, at_columns))
        return pinned_squared_exponential(rows[:, None], columns[None, :], 1)

    def kernel_diagonal(self, curve: int, abscissa: Any, values: Mapping[str, Any]) -> Any:
        score = (abscissa - self.references[curve]) / values["psi"]
        return pinned_squared_exponential(score, score, 1)


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
