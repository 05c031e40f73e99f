"""The contract of every discrepancy: a mean that is linear in its parameters, and a covariance."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Path
from tissuq.mechanics.material import Material
from tissuq.parameters import Parameter
from tissuq.registry import find, variants

__all__ = ["Discrepancy", "discrepancies", "discrepancy_named"]


@dataclass(frozen=True)
class Discrepancy(ABC):
    """What the material cannot explain: measured stress = material + discrepancy + noise (eq. 15).

    A new discrepancy is one subclass in one file. It names its parameters and overrides what it has: a mean (a
    basis, one column for each linear parameter), an independent variance (the same at every point), or a
    correlated part (a variance and a correlation between stretches). Parameters reach it as a mapping
    from symbol to value; arithmetic only, so that NumPy and JAX values both pass through.
    """

    name: ClassVar[str]
    formula: ClassVar[str]
    source: ClassVar[str]
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
        """Return the discrepancy for this material and experiment: itself, unless its definition needs to know them."""
        return self

    def mean_basis(self, mode: Path, stretch: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (n, k) mean stresses of unit linear parameters, in their order."""
        return np.zeros((len(stretch), 0))

    def material_part(self, values: Mapping[str, float]) -> tuple[Material, tuple[float, ...]] | None:
        """Return the material whose stress the mean is, with its parameters, where it is that of one."""
        return None

    def independent_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) that the discrepancy adds to every point by itself."""
        return 0.0

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        """Return the variance (MPa^2) of the correlated part; of a process that is conditioned, before that."""
        return 0.0

    def correlation(self, first: Any, second: Any, values: Mapping[str, Any]) -> Any:
        """Return the (n, m) covariance of the correlated part between two sets of stretches, over its variance."""
        raise NotImplementedError(f"discrepancy '{self.name}' has no correlated part")

    def relative_variance(self, stretch: Any, values: Mapping[str, Any]) -> Any:
        """Return the (n,) diagonal of `correlation`: one, unless the process is conditioned on something."""
        return np.ones(len(stretch))

    @property
    def is_scattered(self) -> bool:
        """Whether it has an independent part."""
        return bool(self.independent_variance({p.symbol: 1.0 for p in self.parameters}))

    @property
    def is_correlated(self) -> bool:
        """Whether the discrepancy at one stretch tells something about another."""
        return bool(self.shape_symbols)


def discrepancies() -> dict[str, type[Discrepancy]]:
    """Return every discrepancy by name, those with few parameters first."""
    return dict(sorted(variants(Discrepancy).items(), key=lambda item: len(item[1].parameters)))


def discrepancy_named(discrepancy: str | Discrepancy) -> Discrepancy:
    """Return the discrepancy of that name; a discrepancy is returned as it is.

    Raises
    ------
    ModelError
        When no discrepancy has that name.
    """
    if isinstance(discrepancy, Discrepancy):
        return discrepancy
    from tissuq.discrepancy.energy import energy_sum

    return energy_sum(discrepancy) or find(Discrepancy, "discrepancy", discrepancy, ModelError)()
