"""A Gaussian-process discrepancy in stress that is orthogonal to the material's stresses (Plumlee 2017)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.conditioned import RangeProcess, nodes_over
from tissuq.discrepancy.kernels import squared_exponential
from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Path
from tissuq.mechanics.material import Material
from tissuq.mechanics.stress import stress_basis

__all__ = ["OrthogonalProcess"]

FloatArray = NDArray[np.float64]

ROUNDING = 1e-13
"""Variance of the integrals, relative to their sum, that is as good as none: a long psi makes them nearly dependent."""


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
    mode: Path | None = None
    ends: tuple[float, float] | None = None

    name = "gp-orthogonal"
    formula = "c^2 exp(-(l - l')^2 / (2 psi^2)) given integrals of M d stress/d theta = 0 over the data"
    source = "Plumlee 2017, for the parameters in which the stress is linear"
    is_best_fit = True
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
        ends = float(experiment.stretch.min()), float(experiment.stretch.max())
        return replace(self, material=material, mode=experiment.mode, ends=ends)

    def zeros(self, stretch: Any, length: Any) -> tuple[Any, Any]:
        assert self.material is not None  # noqa: S101 (it comes with the ends)
        assert self.mode is not None  # noqa: S101
        assert self.ends is not None  # noqa: S101
        nodes, columns = _weighted_stresses(self.material, self.mode, self.ends)
        with_integrals = squared_exponential((stretch[:, None] - nodes) / length) @ columns
        integrals = columns.T @ squared_exponential((nodes[:, None] - nodes) / length) @ columns
        return with_integrals, integrals + ROUNDING * integrals.trace() * np.eye(columns.shape[1])


@lru_cache(maxsize=64)
def _weighted_stresses(material: Material, mode: Path, ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return nodes (m,) over a range, and columns (m, k) whose products with M are its integrals with the stresses.

    The stresses of unit parameters are replaced by orthonormal combinations, which the same M are orthogonal to.
    """
    nodes, weights = nodes_over(ends)
    root = np.sqrt(weights)[:, None]
    orthonormal, _ = np.linalg.qr(root * stress_basis(material, mode, nodes))
    return nodes, root * orthonormal
