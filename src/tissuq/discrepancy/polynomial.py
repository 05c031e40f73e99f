"""Discrepancies with a polynomial mean in the stretch and an independent error of unknown size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.experiments.modes import Path
from tissuq.parameters import Parameter

__all__ = ["Constant", "IndependentError", "Linear", "Quadratic"]

S = Parameter.scale("S", "standard deviation of the discrepancy about its mean")
M = tuple(Parameter(f"m{degree}", f"coefficient of stretch^{degree}") for degree in range(3))


class IndependentError(Discrepancy):
    """Any mean plus an error of variance S^2, independent at every point (covariance S^2 I)."""

    def independent_variance(self, values: Mapping[str, Any]) -> Any:
        return values["S"] ** 2


class Polynomial(IndependentError):
    """The mean m0 + m1 l + ... of some degree, in stress: it carries stress and stiffness at stretch 1."""

    degree: ClassVar[int]
    caution = "Its mean takes a share of the initial stiffness, so the material's modulus may be far off."

    def mean_basis(self, mode: Path, stretch: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.vander(stretch, self.degree + 1, increasing=True)


class Constant(Polynomial):
    """Mean m0 (eq. 20)."""

    name = "constant"
    degree = 0
    formula = "m0 + S e"
    source = "Zeraatpisheh et al. 2021, eq. 20"
    parameters = (*M[:1], S)


class Linear(Polynomial):
    """Mean m0 + m1 l (eq. 21). Differs from the source, which prints the sign of m1 reversed."""

    name = "linear"
    degree = 1
    formula = "m0 + m1 l + S e"
    source = "Zeraatpisheh et al. 2021, eq. 21"
    parameters = (*M[:2], S)


class Quadratic(Polynomial):
    """Mean m0 + m1 l + m2 l^2 (eq. 22)."""

    name = "quadratic"
    degree = 2
    formula = "m0 + m1 l + m2 l^2 + S e"
    source = "Zeraatpisheh et al. 2021, eq. 22"
    parameters = (*M, S)
