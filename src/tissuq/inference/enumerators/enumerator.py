"""What every enumerator has in common: it sums a posterior up by weighted settings of the nonlinear parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tissuq.inference.solution import Solution
from tissuq.model.statistical_model import StatisticalModel

__all__ = ["Enumerator"]


class Enumerator(Protocol):
    """Finds weighted settings of nonlinear parameters; given each, the linear ones are Gaussian (or points).

    A solution holds the settings and their weights in its `mixture`, the error of its evidence, and diagnostics where
    they are draws.
    """

    def why_not(self, model: StatisticalModel) -> str:
        """Return why it does not serve a model, in words that follow "does not apply: "; nothing where it does."""

    def solve(self, models: Sequence[StatisticalModel], seed: int) -> list[Solution]:
        """Return the posteriors of models with the same parts on the same stretches.

        Raises
        ------
        ConvergenceError
            When they are not found to the enumerator's tolerance.
        """
