"""Weighted points of adapted proposals over any number of nonlinear parameters, the linear ones in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.line import FINE, Accuracy
from tissuq.inference.enumerators.ridges import around_peaks
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.linear import ConditionalGaussian
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.proposals import Mixture, fitted_mixture, weighted_points
from tissuq.inference.quasi_monte_carlo import log_normal, sobol_rounds
from tissuq.inference.solution import Marginals, Representation, Solution
from tissuq.inference.truncated_mixture import TruncatedMixture
from tissuq.model.scales import at_scores
from tissuq.model.statistical_model import StatisticalModel

POINTS_PER_PARAMETER = 256
"""Points of a round for each parameter, about: their number is a power of two. Where a similar model is known, and less
accuracy is asked for, there are fewer."""
EFFECTIVE_MULTIPLE = 20.0
"""Effective points over those of values that each cost a sum over energies, for which `Accuracy` is made."""
IRRELEVANT_LOG_DROP = 14.0
"""Log density below the largest at which the mass inside the bounds need not be known exactly: e^-14 is a millionth."""
MIN_ROUNDS, MAX_ROUNDS, MAX_CHANGE = 4, 40, 0.1
"""Rounds at least, of fewer where a similar model is known, and at most, and change of the log of the mass in these."""
NEGLIGIBLE_WEIGHT = 1e-9
"""Share of the posterior that a point must hold."""
MAX_COMPONENTS = 3000
"""Components, at most, that represent the posterior in draws and predictions."""


@dataclass
class AdaptedPoints:
    """Importance points of more nonlinear parameters than quadrature takes.

    Parameters
    ----------
    accuracy : Accuracy
    start : Mixture, optional
        Where the posterior of a similar model lies, at which the points begin; that of the last model afterwards.
    """

    accuracy: Accuracy = FINE
    start: Mixture | None = None

    @staticmethod
    def why_not(model: StatisticalModel) -> str:
        """Return why it does not serve a model; nothing where it does."""
        if model.has_directions:
            return ""
        return (
            f"noise '{model.noise.name}' and discrepancy '{model.discrepancy.name}' are not independent along any "
            "fixed directions"
        )

    def solve(self, models: Sequence[StatisticalModel], seed: int = 0) -> list[Solution]:
        """Return posterior and evidence of models, each by itself.

        Raises
        ------
        ConvergenceError
            When few of the points hold nearly everything, or the sum does not settle.
        """
        return [self._solution(model, seed) for model in models]

    def _solution(self, model: StatisticalModel, seed: int) -> Solution:
        density, dimension = _Density(model), len(model.nonlinear)
        min_effective, log_masses = EFFECTIVE_MULTIPLE * self.accuracy.min_effective, list[float]()
        starts = [self.start or around_peaks(density, dimension)]
        share = self.accuracy.min_effective / FINE.min_effective if self.start else 1.0
        count = 1 << int(share * POINTS_PER_PARAMETER * dimension).bit_length()
        uniforms = islice(sobol_rounds(dimension, count, seed=0), MAX_ROUNDS)
        for done, weighted in enumerate(weighted_points(density, starts, uniforms, fitted_mixture), 1):
            number = weighted.effective
            log_masses.append(weighted.log_mass)
            needed = 2 if self.start else MIN_ROUNDS
            if done >= needed and number >= min_effective and np.ptp(log_masses[-MIN_ROUNDS:]) < MAX_CHANGE:
                break
        else:
            raise ConvergenceError(
                f"the posterior of {', '.join(model.nonlinear)} was not found well enough: {number:.0f} of "
                f"{len(weighted.points)} points are effective. Give narrower priors, or use the method 'nuts'."
            )
        self.start = fitted_mixture(weighted.points, weighted.log_weights)
        matters = (weights := weighted.weights) > NEGLIGIBLE_WEIGHT
        weights, settings = weights[matters] / weights[matters].sum(), density.settings(weighted.points[matters])
        gaussians = density.conditional(settings[None])
        mixture = GaussianMixture(weights, settings, gaussians.mean[0], gaussians.root[0])
        truncated = TruncatedMixture(mixture, density.conditional.boxes)

        def marginal(symbol: str) -> Marginal:
            if symbol in model.linear:
                return truncated.marginal(model.linear.index(symbol))
            return marginal_of_points(settings[:, model.nonlinear.index(symbol)], weights, model.priors[symbol].support)

        linear = f"{', '.join(model.linear)} integrated in closed form" if model.linear else "no linear parameter"
        reason = f"{linear}; a sum over {len(weights)} points of {', '.join(model.nonlinear)} ({number:.0f} effective)"
        representation = Representation(
            lambda count: truncated.components(MAX_COMPONENTS).resampled(count),
            lambda count: truncated.components().resampled(count),
        )
        solution = Solution(model, "exact", reason, representation, Marginals.of(model, marginal), seed)
        if model.is_improper:
            return solution
        _, error_of_mass = truncated.checked_masses(model.linear)
        error = weighted.relative_error + error_of_mass
        return replace(solution, log_evidence=weighted.log_mass, log_evidence_error=error)


class _Density:
    """The log density of the nonlinear parameters of a model, in coordinates that are normal under their priors."""

    def __init__(self, model: StatisticalModel) -> None:
        self.conditional = ConditionalGaussian([model])
        self._priors = [model.priors[symbol] for symbol in model.nonlinear]

    def settings(self, points: FloatArray) -> FloatArray:
        """Return the values (N, d) at points (N, d)."""
        return at_scores(self._priors, points)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return it (N,) at points (N, d)."""
        try:
            gaussians = self.conditional(self.settings(points)[None])
        except (ConvergenceError, np.linalg.LinAlgError):  # where columns depend on each other, far away
            if len(points) == 1:
                return np.full(1, -np.inf)
            return np.concatenate([self(half) for half in np.array_split(points, 2)])
        mean, root = gaussians.mean[0], gaussians.root[0]
        boxes = self.conditional.boxes.repeated(len(points))
        likelihood = gaussians.log_likelihood[0] + log_normal(points)
        likelihood = np.where(np.isnan(likelihood), -np.inf, likelihood)
        values = likelihood + boxes.ceiling(mean, root)
        near = np.flatnonzero(values > values.max() - IRRELEVANT_LOG_DROP)
        values[near] = likelihood[near] + boxes[near].log_mass(mean[near], root[near])[0]
        return np.asarray(values)
