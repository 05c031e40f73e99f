"""Estimates of errors that are plugged in: each comes from further fits of the same data, which are counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tissuq.errors import ModelError
from tissuq.inference.solution import Solution
from tissuq.model.measurement_errors import BETWEEN_SPECIMENS, Tolerances, specimens_of
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import level_of_errors, mean_curve

__all__ = ["ErrorEstimates"]

MIN_SPECIMENS_FOR_SPREAD = 4
"""Number of specimens from which their spread is estimated."""
SPREAD_FACTORS = np.array([0.125, 0.25, 0.5, 1.0, 2.0, 4.0])
"""Spreads between specimens that are tried, over the default one."""
CURVE_ITERATIONS = 3
"""Fits from which the mean curve and the level of the errors are found in turn."""
LAG_GRID = (0.0, 0.2, 0.4, 0.6, 0.75, 0.85, 0.92, 0.96, 0.98, 0.99)
"""Correlations of consecutive errors that are tried."""


class ErrorEstimates:
    """Makes the `FittedErrors` of one model.

    Parameters
    ----------
    solve : callable
        Returns the solution of a model.
    """

    def __init__(self, solve: Callable[[StatisticalModel], Solution]) -> None:
        self._solve, self._fits = solve, 0

    def of(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with every estimate that its errors need: curve and level, and lag."""
        with_curve = self._with_curve(model)
        with_lag = self._with_lag(with_curve)
        if with_lag is not with_curve and model.tolerances:
            with_lag = self._with_curve(with_lag.with_errors(curve=None))
        return with_lag.with_errors(fits=model.fitted_errors.fits + self._fits) if self._fits else with_lag

    def with_default_tolerances(self, model: StatisticalModel, *, has_evidence: bool) -> StatisticalModel:
        """Return a model with the tolerances that hold where the user gives none.

        None within a specimen, or where something else takes up errors of whole tests; else those of
        `BETWEEN_SPECIMENS`, of which the spread is estimated where there are specimens enough and an evidence: the root
        of its posterior mean square over a grid, under a half-Cauchy prior of the default spread, which is what the
        error in common needs of it.
        """
        default = default_tolerances(model)
        if not default:
            return model
        model = replace(model, tolerances=default)
        if specimens_of(model.experiment).shape[1] < MIN_SPECIMENS_FOR_SPREAD or not has_evidence:
            return model
        model = self._with_curve(model)
        spreads = default.stress * SPREAD_FACTORS
        candidates = [replace(model, tolerances=default.with_sizes(stress=float(spread))) for spread in spreads]
        evidences = [self._solution(candidate).log_evidence for candidate in candidates]
        if any(evidence is None for evidence in evidences):
            return model.with_errors(fits=self._fits)
        log_evidence = np.array(evidences, dtype=np.float64)
        weight = np.exp(log_evidence - log_evidence.max()) / (1 + SPREAD_FACTORS**2) * spreads  # even in the logarithm
        spread = float(np.sqrt(weight @ spreads**2 / weight.sum()))
        with_spread = replace(model, tolerances=default.with_sizes(stress=spread))
        return self.of(with_spread.with_errors(curve=None, level=None, spread=spread))

    def _with_lag(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with consecutive noise at the lag under which the data are most probable."""
        if not model.noise.is_consecutive or model.fitted_errors.lag is not None:
            return model
        candidates = [model.with_errors(lag=lag) for lag in LAG_GRID]
        log_evidence = np.array([self._evidence(candidate) for candidate in candidates])
        best = int(np.argmax(log_evidence))
        if best in (0, len(LAG_GRID) - 1):
            return candidates[best]
        # A parabola through the best three, in the lag's inverse hyperbolic tangent.
        neighbours = slice(best - 1, best + 2)
        curvature, slope, _ = np.polyfit(np.arctanh(LAG_GRID[neighbours]), log_evidence[neighbours], 2)
        return model.with_errors(lag=float(np.tanh(-slope / (2 * curvature))))

    def _with_curve(self, model: StatisticalModel) -> StatisticalModel:
        """Return a model with tolerances along its own mean curve, and at its own level of errors.

        As they are found first as if there were no tolerances, and then with these.
        """
        if not model.tolerances or model.fitted_errors.curve is not None:
            return model
        pilot = replace(model, tolerances=Tolerances())
        for _ in range(CURVE_ITERATIONS):
            solution = self._solution(pilot)
            pilot = model.with_errors(curve=mean_curve(solution), level=level_of_errors(solution))
        return pilot

    def _evidence(self, model: StatisticalModel) -> float:
        log_evidence = self._solution(model).log_evidence
        if log_evidence is None:
            raise ModelError(
                f"noise '{model.noise}' needs the evidence, which this fit does not have: choose proper priors, and a "
                "discrepancy and a method that give it, such as 'auto'."
            )
        return log_evidence

    def _solution(self, model: StatisticalModel) -> Solution:
        self._fits += 1
        return self._solve(model)


def default_tolerances(model: StatisticalModel) -> Tolerances:
    """Return the tolerances of a model for which the user gives none."""
    is_plain = not (model.is_correlated or model.noise.depends_on_level or model.noise.shares_discrepancy)
    return BETWEEN_SPECIMENS if specimens_of(model.experiment).shape[1] > 1 and is_plain else Tolerances()
