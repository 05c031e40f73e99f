"""A discrepancy in stress on several measured stresses: another one in each, of the same size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import Path
from tissuq.mechanics.joint import ABSCISSA, CURVE, Rows
from tissuq.mechanics.material import Material
from tissuq.parameters import Parameter

__all__ = ["Separate", "separated"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Separate(Discrepancy):
    """Independent copies of a discrepancy, one for each stress of each test: an error of one says nothing of another.

    Means have parameters of their own (m0_1, m0_2, in the order of the tests); S, c and psi are shared. S counts in
    proportion to the noise of each test.
    """

    every: tuple[Discrepancy, ...]

    def __post_init__(self) -> None:
        for name in ("name", "formula", "source", "shape_symbols", "is_best_fit", "caution"):
            object.__setattr__(self, name, getattr(self.every[0], name))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]  # of the object, not the class
        """Those of the means for every test, and the shared ones."""
        own = self.every[0].parameters
        means = [
            replace(each, symbol=f"{each.symbol}_{number}", description=f"{each.description}, curve {number}")
            for number in range(1, len(self.every) + 1)
            for each in own
            if each.is_linear
        ]
        return (*means, *(each for each in own if not each.is_linear))

    def mean_basis(self, mode: Path, stretch: FloatArray) -> FloatArray:
        if not isinstance(mode, Rows):  # states that were not measured in any test
            return np.zeros((len(stretch), sum(p.is_linear for p in self.parameters)))
        blocks = [
            each.mean_basis(mode, stretch[:, ABSCISSA]) * (stretch[:, CURVE] == number)[:, None]
            for number, each in enumerate(self.every)
        ]
        return np.hstack(blocks)

    def independent_variance(self, values: Mapping[str, Any]) -> Any:
        return self.every[0].independent_variance(values)

    def correlated_variance(self, values: Mapping[str, Any]) -> Any:
        return self.every[0].correlated_variance(values)

    def correlation(self, first: Any, second: Any, values: Mapping[str, Any]) -> Any:
        return sum(
            (first[:, CURVE] == number)[:, None]
            * (second[:, CURVE] == number)
            * each.correlation(first[:, ABSCISSA], second[:, ABSCISSA], values)
            for number, each in enumerate(self.every)
        )

    def relative_variance(self, stretch: Any, values: Mapping[str, Any]) -> Any:
        return sum(
            (stretch[:, CURVE] == number) * each.relative_variance(stretch[:, ABSCISSA], values)
            for number, each in enumerate(self.every)
        )


def separated(discrepancy: Discrepancy, material: Material, experiment: Experiment) -> Discrepancy:
    """Return a discrepancy as adapted to material and experiment; one in stress, to each of several measured stresses.

    Raises
    ------
    ModelError
        When it depends on the range of one stretch, and a test has more than one or several stresses.
    """
    is_one = discrepancy.is_energy or not discrepancy.parameters or isinstance(discrepancy, Separate)
    if len(experiment.curves) == 1 or is_one:
        return discrepancy.adapted_to(material, experiment)
    wide = next((part for part in experiment.parts if part.stretch.ndim > 1 or part.stress.ndim > 1), None)
    if wide is not None and type(discrepancy).adapted_to is not Discrepancy.adapted_to:
        raise ModelError(
            f"discrepancy '{discrepancy.name}' is defined over the range of one stretch, and mode '{wide.mode.name}' "
            f"of experiment '{wide.name}' has several controls or stresses: choose another one, such as 'auto'."
        )
    return Separate(tuple(discrepancy.adapted_to(material, part) for part, _, _ in experiment.curves))
