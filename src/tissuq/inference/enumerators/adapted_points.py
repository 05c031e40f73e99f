"""Weighted points of adapted proposals over any number of nonlinear parameters, the linear ones in closed form."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.line import FINE, Accuracy
from tissuq.inference.enumerators.survey import climb
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.linear import ConditionalGaussian
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.proposals import Mixture, Proposal, fitted_mixture, weighted_points
from tissuq.inference.quasi_monte_carlo import effective, even_points, log_normal, sobol_rounds
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
SURVEY_POINTS, CLIMBS, LEAST_DISTANCE = 1024, 8, 0.7
"""Points of the prior among which climbs to peaks begin, how many do, and how far apart."""
COINCIDENT = 0.5
"""Distance of two peaks, in widths of one, below which they are the same."""
MAX_CLIMBS, CLIMBED_HEIGHT = 8, 0.5
"""Climbs one after another, each in steps of the width where the last ended, and what the last gains of log density."""
RIDGE_RATIO = 5.0
"""Width of a proposal along its longest axis over that along the next one, from which it lies on a ridge."""
RIDGE_STEP, MAX_RIDGE_STEPS, RIDGE_LOG_DROP = 0.2, 24, 10.0
"""Length of a step along a ridge, in sds of the prior, how many there are each way, and the log density below the peak
at which they end."""
MIN_STEP_RATIO, MAX_STEP_RATIO = 0.2, 4.0
"""Distance of a climbed place from the last one, over the step, beyond which it is on another ridge or none."""
UNBOUNDED = np.array(np.inf)
"""End of coordinates that are normal under the prior."""
RELEVANT_LOG_DROP = 20.0
"""Logarithm of the mass of a peak below the largest at which it does not count."""
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
        starts = [self.start or _around_peaks(density, dimension)]
        share = self.accuracy.min_effective / FINE.min_effective if self.start else 1.0
        count = 1 << int(share * POINTS_PER_PARAMETER * dimension).bit_length()
        uniforms = islice(sobol_rounds(dimension, count, seed=0), MAX_ROUNDS)
        for done, weighted in enumerate(weighted_points(density, starts, uniforms, fitted_mixture), 1):
            number = effective(weighted.log_weights)
            log_masses.append(weighted.log_mass)
            needed = 2 if self.start else MIN_ROUNDS
            if done >= needed and number >= min_effective and np.ptp(log_masses[-MIN_ROUNDS:]) < MAX_CHANGE:
                break
        else:
            raise ConvergenceError(
                f"the posterior of {', '.join(model.nonlinear)} was not found well enough: {number:.0f} of "
                f"{len(weighted.points)} points are effective. Give narrower priors, or use the method 'nuts'."
            )
        points, log_weights, _ = weighted
        self.start = fitted_mixture(points, log_weights)
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        matters = weights > NEGLIGIBLE_WEIGHT
        weights, settings = weights[matters] / weights[matters].sum(), density.settings(points[matters])
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
        error = float(np.sqrt(1 / number - 1 / len(log_weights))) + error_of_mass
        return replace(solution, log_evidence=weighted.log_mass, log_evidence_error=error)


def _around_peaks(log_density: Callable[[FloatArray], FloatArray], dimension: int) -> Mixture:
    """Return a mixture with a proposal around each place to which a climb from a good point of the prior has come.

    And with proposals along the ridges on which these lie.
    """
    climbed = list(_climbed(log_density, _feet(log_density, dimension)))
    largest = max(log_mass for log_mass, _ in climbed)
    proposals, on_ridges = list[Proposal](), list[Proposal]()
    for log_mass, proposal in climbed:
        scores = [np.linalg.solve(other.root, proposal.mean - other.mean) for other in proposals]
        if log_mass >= largest - RELEVANT_LOG_DROP and all(np.linalg.norm(score) > COINCIDENT for score in scores):
            proposals.append(proposal)
    for proposal in proposals:
        if all(np.linalg.norm(proposal.mean - other.mean) > RIDGE_STEP for other in on_ridges):
            on_ridges += _along_ridge(log_density, proposal)
    proposals += on_ridges
    return [(1 / len(proposals), proposal) for proposal in proposals]


def _feet(log_density: Callable[[FloatArray], FloatArray], dimension: int) -> FloatArray:
    """Return good points (K, d) of the prior far apart."""
    from scipy.special import ndtri

    points, feet = ndtri(even_points(dimension, SURVEY_POINTS)), list[FloatArray]()
    for index in np.argsort(-log_density(points)):
        if all(np.linalg.norm(points[index] - foot) > LEAST_DISTANCE for foot in feet):
            feet.append(points[index])
        if len(feet) == CLIMBS:
            break
    return np.array(feet)


def _climbed(log_density: Callable[[FloatArray], FloatArray], peaks: FloatArray) -> Iterator[tuple[float, Proposal]]:
    """Yield places to which climbs from points (K, d) come, with Gaussians of the width there and their log masses.

    Along a narrow bent ridge climbs begin again, in steps of the width where the last ended: it has places all along.
    """
    roots, last_heights = np.repeat(np.eye(peaks.shape[1])[None], len(peaks), axis=0), np.full(len(peaks), -np.inf)
    for _ in range(MAX_CLIMBS):
        evaluate, at_peaks = partial(_along, log_density, peaks, roots), np.zeros((1, *peaks.shape))
        steps, heights, curvatures = (ends[0] for ends in climb(evaluate, at_peaks, -UNBOUNDED, UNBOUNDED))
        peaks = peaks + (roots @ steps[:, :, None])[:, :, 0]
        covariances = roots @ np.linalg.inv(curvatures) @ roots.swapaxes(1, 2)
        roots = np.asarray(np.linalg.cholesky(covariances), dtype=np.float64)
        log_masses = heights + 0.5 * np.linalg.slogdet(covariances)[1]
        yield from zip(log_masses.tolist(), map(Proposal, peaks, roots), strict=True)
        is_relevant = log_masses >= log_masses.max() - RELEVANT_LOG_DROP
        if not (is_relevant & (heights > last_heights + CLIMBED_HEIGHT)).any():
            return
        last_heights = heights


def _along_ridge(log_density: Callable[[FloatArray], FloatArray], proposal: Proposal) -> Iterator[Proposal]:
    """Yield proposals both ways along the ridge on which one lies, if it does: each a step on, then climbed across."""
    values, axes = np.linalg.eigh(proposal.root @ proposal.root.T)
    if len(values) == 1 or values[-1] < RIDGE_RATIO**2 * values[-2]:
        return
    least_height = log_density(proposal.mean[None])[0] - RIDGE_LOG_DROP
    for direction in (axes[:, -1], -axes[:, -1]):
        centre, across = proposal.mean, axes[:, :-1] * np.sqrt(values[:-1])
        for _ in range(MAX_RIDGE_STEPS):
            start = centre + RIDGE_STEP * direction
            on_plane = partial(_across, log_density, start, across)
            *_, (_, peak) = _climbed(on_plane, np.zeros((1, across.shape[1])))
            height, step = on_plane(peak.mean[None])[0], start + across @ peak.mean - centre
            length = np.linalg.norm(step)
            if not (height > least_height and MIN_STEP_RATIO < length / RIDGE_STEP < MAX_STEP_RATIO):
                break
            centre, direction, root = centre + step, step / length, across @ peak.root
            covariance = root @ root.T
            yield Proposal(centre, np.asarray(np.linalg.cholesky(covariance + np.outer(step, step))))
            off_direction = np.eye(len(step)) - np.outer(direction, direction)
            variances, axes_across = np.linalg.eigh(off_direction @ covariance @ off_direction)
            across = axes_across[:, 1:] * np.sqrt(variances[1:])


def _across(
    log_density: Callable[[FloatArray], FloatArray], start: FloatArray, across: FloatArray, steps: FloatArray
) -> FloatArray:
    """Return the log density (N,) at steps (N, d - 1) along directions across a ridge (d, d - 1), from a place (d,)."""
    return log_density(start + steps @ across.T)


def _along(
    log_density: Callable[[FloatArray], FloatArray], centres: FloatArray, roots: FloatArray, steps: FloatArray
) -> FloatArray:
    """Return the log density (1, K, P) at steps (1, K, P, d) from K centres, in units of the roots' widths there."""
    points = centres[:, None] + steps[0] @ roots.swapaxes(1, 2)
    return log_density(points.reshape(-1, centres.shape[1])).reshape(steps.shape[:-1])


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
