"""The contract of every discrepancy: a mean that is linear in its parameters, and a covariance; and none at all."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import States
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter


@dataclass(frozen=True)
class Discrepancy(ABC):
    """What the material cannot explain: measured stress = material + discrepancy + noise (eq. 15).

    A new discrepancy is one subclass in one file. It names its parameters and overrides what it has: a mean (a
    basis, one column for each linear parameter), an independent variance (the same at every point), or a
    correlated part (a variance and a correlation between stretches). Parameters reach it as a mapping
    from symbol to value; arithmetic only, so that NumPy and JAX values both pass through.

    An energy acts wherever the specimen is deformed. An error of the stress is another, independent one in every
    measured curve: an error of one says nothing of another, nor of what was not measured.

    Parameters
    ----------
    curves : int
        The number of measured curves, which the model tells (`adapted_to`).
    """

    curves: int = field(default=1, kw_only=True)

    entry_point_group: ClassVar[str] = "tissuq.discrepancies"
    name: ClassVar[str]
    formula: ClassVar[str] = "formula not stated"
    source: ClassVar[str] = "source not stated"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    shape_symbols: ClassVar[tuple[str, ...]] = ()
    """The parameters on which the correlation depends."""
    is_energy: ClassVar[bool] = False
    """Whether what it has learnt in one loading mode holds in others."""
    is_best_fit: ClassVar[bool] = False
    """Whether the material that best fits the data is estimated, rather than that at the reference."""
    caution: ClassVar[str] = ""
    """What a reader of its result must know about the material's parameters."""

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        """Return the discrepancy for this material and the curves of this experiment."""
        return self if self.is_energy else replace(self, curves=len(experiment.curves))

    @property
    def of_contradictory_tests(self) -> Discrepancy | None:
        """What takes its place where no stable energy that it has reconciles several tests; None where nothing does."""
        return None

    @property
    def sketch(self) -> Discrepancy:
        """One that costs less to integrate and stands for it where only a first idea of a posterior is wanted."""
        return self

    def mean_basis(self, states: States) -> FloatArray:
        """Return the (n, k) mean stresses of unit linear parameters, in their order."""
        return np.zeros((len(states), 0))

    def material_part(self, values: Mapping[str, float]) -> tuple[Material, tuple[float, ...]] | None:
        """Return the material whose stress the mean is, with its parameters, where it is that of one."""
        return None

    def independent_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) that the discrepancy adds to every point by itself."""
        return 0.0

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) of the correlated part; of a process that is conditioned, before that."""
        return 0.0

    def correlation(self, rows: States, columns: States, values: Mapping[str, Any]) -> Any:
        """Return the (n, m) covariance of the correlated part between states, over its variance.

        That between different curves is zero.
        """
        return sum(
            np.reshape(rows.in_curve(curve), (-1, 1))
            * np.reshape(columns.in_curve(curve), (1, -1))
            * self.kernel(curve, rows.abscissa, columns.abscissa, values)
            for curve in range(self.curves)
        )

    def relative_variance(self, states: States, values: Mapping[str, Any]) -> Any:
        """Return the (n,) diagonal of `correlation`: one, unless the process is conditioned on something."""
        return sum(
            states.in_curve(curve) * self.kernel_diagonal(curve, states.abscissa, values)
            for curve in range(self.curves)
        )

    def kernel(self, curve: int, at_rows: Any, at_columns: Any, values: Mapping[str, Any]) -> Any:
        """Return the (n, m) `correlation` in one curve between two sets of what its stress is drawn against."""
        raise NotImplementedError(f"discrepancy '{self.name}' has no correlated part")

    def kernel_diagonal(self, curve: int, abscissa: Any, values: Mapping[str, Any]) -> Any:
        """Return the (n,) diagonal of `kernel`."""
        return np.ones(len(abscissa))

    @property
    def is_scattered(self) -> bool:
        """Whether it has an independent part."""
        return bool(self.independent_variance({p.symbol: 1.0 for p in self.parameters}))

    @property
    def is_correlated(self) -> bool:
        """Whether the discrepancy at one stretch tells something about another."""
        return bool(self.shape_symbols)


class NoDiscrepancy(Discrepancy):
    """Measured stress = material + noise (eq. 12)."""

    name = "none"
    formula = "0"
    source = "Zeraatpisheh et al. 2021, eq. 12"
    is_energy = True
    caution = (
        "If the material is wrong, its parameters are over-confident: the interval does not show it, the check may."
    )
