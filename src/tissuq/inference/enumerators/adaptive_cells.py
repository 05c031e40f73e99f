"""The exact route: linear parameters in closed form, quadrature over the nonlinear ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ConvergenceError, ModelError
from tissuq.inference.enumerators.adapted_points import IRRELEVANT_LOG_DROP, AdaptedPoints
from tissuq.inference.enumerators.line import FINE
from tissuq.inference.enumerators.quadrature import (
    MAX_DIMENSION,
    START_PROBABILITIES,
    Lines,
    Quadrature,
    has_missed,
    integrate,
)
from tissuq.inference.enumerators.survey import (
    Warp,
    coordinates_of,
    log_prior_density,
    parameters_of,
    survey,
    warp_along,
)
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.linear import Conditional, ConditionalGaussian
from tissuq.inference.marginal import TABLE_POINTS, Marginal, moments_of_values, weighted_grid
from tissuq.inference.reduction import BasesOf, bases_of
from tissuq.inference.solution import Marginals, Representation, Solution
from tissuq.inference.truncated_mixture import TruncatedMixture
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Prior

DATA_SETS_AT_ONCE = (2000, 200, 40, 5)
"""Data sets integrated at once, by the number of nonlinear parameters: what bounds the memory."""
MANY_LINES = 2000
"""Of a quadrature, beyond which a marginal is tabulated at fewer points."""
MAX_GROWTH = 2.0
"""Number of cells, over that of the first model for which they were made, up to which similar models begin at them."""


@dataclass
class AdaptiveCells:
    """Adaptive quadrature over at most three nonlinear parameters; a single setting where there is none.

    Models that are solved one after another are to be similar: they differ by their errors alone.

    Parameters
    ----------
    is_checked : bool
        Whether climbs from other values of the structure see that no mass was missed, which takes as long again; of
        similar models one tells it of all.
    tolerance : float
        Of the interpolation, relative to the integral.
    start : Start, optional
        Cells at which the next model begins: those of the most probable one so far, unless they had become many.
    bases : callable
        Returns the stresses of unit parameters; it may remember them from one model to the next.
    """

    is_checked: bool = True
    tolerance: float = FINE.tolerance
    start: Start | None = None
    bases: BasesOf = bases_of

    def why_not(self, model: StatisticalModel) -> str:
        """Return why quadrature does not serve a model; nothing where it does."""
        if reason := AdaptedPoints.why_not(model):
            return reason
        if len(model.nonlinear) > MAX_DIMENSION:
            return (
                f"it integrates at most {MAX_DIMENSION} nonlinear parameters, and this model has "
                f"{len(model.nonlinear)} ({', '.join(model.nonlinear)})"
            )
        return ""

    def solve(self, models: Sequence[StatisticalModel], seed: int = 0) -> list[Solution]:
        """Return posterior and evidence of models with at most three nonlinear parameters each.

        Likelihood times normalised prior is integrated, so the evidence includes uniform densities. Bounds of the
        linear parameters that cut off less than 1e-8 of the posterior leave it a mixture of Gaussians; where they cut
        off more, they are integrated numerically. The error given with the evidence is that of the
        quadrature and of the mass within the bounds.

        Parameters
        ----------
        models : sequence of StatisticalModel
            With the same material, discrepancy and noise on the same stretches: they share every factorisation.
        seed : int
            Of the draws; nothing else is random.

        Raises
        ------
        ModelError
            When a model has more than three nonlinear parameters, or noise and discrepancy without closed form.
        ConvergenceError
            When the quadrature does not reach its tolerance.

        References
        ----------
        Zeraatpisheh, Bordas & Beex (2021), eq. 15 and 28, integrated instead of sampled.
        """
        reason = self.why_not(models[0])
        if reason:
            raise ModelError(f"the method 'exact' does not apply: {reason}. Use the method 'nuts' or 'smc'.")
        together = DATA_SETS_AT_ONCE[len(models[0].nonlinear)]
        blocks = [models[start : start + together] for start in range(0, len(models), together)]
        return [
            _solution(integration, index, seed)
            for integration in (self._integration(block) for block in blocks)
            for index in range(len(integration.models))
        ]

    def _integration(self, models: Sequence[StatisticalModel]) -> _Integration:
        """Integrate models together, or a single one from where the most probable one was."""
        integration = _Integration(models, self)
        if len(models) == 1 and integration.warp and (rule := integration.rule):
            count, start = len(rule.cells.lower), integration.start
            fewest = start.fewest if start else count
            if not start or rule.log_integral[0] > start.rule.log_integral[0]:
                reached = Start(integration.priors[0], integration.warp, rule, fewest)
                self.start = reached if count <= MAX_GROWTH * fewest else None
            self.is_checked = False
        return integration


class Start(NamedTuple):
    """A rule in the coordinates of a warp of parameters with priors, and how many cells the first model had there."""

    priors: Sequence[Prior]
    warp: Warp
    rule: Quadrature
    fewest: int


class _Integration:
    """Everything that data sets on the same stretches share while their nonlinear parameters are integrated."""

    def __init__(self, models: Sequence[StatisticalModel], cells: AdaptiveCells) -> None:
        self.models = models
        self.conditional = ConditionalGaussian(models, cells.bases)
        self.dimension = len(models[0].nonlinear)
        self.priors = [[model.priors[symbol] for symbol in model.nonlinear] for model in models]
        is_similar = len(models) == 1 and cells.start and cells.start.priors == self.priors[0]
        self.start = cells.start if is_similar else None
        self._top = np.full((len(models), 1), -np.inf)
        self.rule: Quadrature | None = None
        self.warp: Warp | None = None
        if self.dimension:
            if self.start:
                self.warp, first_cells = self.start.warp, self.start.rule.cells
            else:
                region = survey(self.priors, len(models[0].structure), self._log_ceiling)
                self.warp, first_cells = warp_along(region), None
            self.rule = integrate(self._log_integrand, self.dimension, cells.tolerance, first_cells)
            self.settings = self.warp.parameters(self.rule.points)[0]
        else:
            self.settings = np.zeros((len(models), 1, 0))
        self.gaussians = self.conditional(self.settings)
        if cells.is_checked and self.rule and len(models[0].structure) > 1:
            for index in range(len(models)):
                self._check_found(index, self.rule.weights[index])

    def _check_found(self, index: int, weights: FloatArray) -> None:
        """Refuse the integral of one posterior that has mass where the survey's lattice did not see it."""
        assert self.warp is not None  # noqa: S101 (there is a structure)
        is_log, priors = self.warp.is_log, self.priors[index : index + 1]
        conditional, structure = ConditionalGaussian(self.models[index : index + 1]), self.models[0].structure

        def log_density(g: FloatArray) -> FloatArray:
            h = parameters_of(g, is_log)[None]
            try:
                gaussians = conditional(h)
            except (ConvergenceError, np.linalg.LinAlgError):  # where columns depend on each other, far away
                return np.full(len(g), -np.inf)
            value = (
                gaussians.log_likelihood
                + _ceiling(conditional, gaussians)
                + log_prior_density(priors, h)
                + (g * is_log).sum(axis=1)
            )
            return np.asarray(np.where(np.isnan(value), -np.inf, value)[0])

        tried = np.array([prior.quantile(START_PROBABILITIES) for prior in priors[0][: len(structure)]])
        starts = coordinates_of(tried.T, is_log[: len(structure)]).T
        bounds = np.column_stack([self.warp.lower[index], self.warp.upper[index]])
        if has_missed(log_density, bounds, coordinates_of(self.settings[index], is_log), weights, starts):
            raise ConvergenceError(
                f"the posterior of {', '.join(structure)} is a ridge too thin for quadrature beside this noise: use "
                "the method 'nuts', or give a narrow prior of one of them."
            )

    def _log_ceiling(self, h: FloatArray) -> FloatArray:
        """Return a likelihood that is no less than the true one, and equal where at most one bound is near."""
        gaussians = self.conditional(h)
        return np.asarray(gaussians.log_likelihood + _ceiling(self.conditional, gaussians))

    def _log_integrand(self, u: FloatArray) -> FloatArray:
        """Return the posterior's log density (B, N) in the coordinates of the warp; bounds count where it matters."""
        assert self.warp is not None  # noqa: S101 (only called once it is there)
        h, log_density = self.warp.parameters(u)
        with np.errstate(over="ignore", invalid="ignore"):  # where a parameter runs to infinity nothing is probable
            gaussians = self.conditional(h)
            ceiling = _ceiling(self.conditional, gaussians)
            value = gaussians.log_likelihood + ceiling + log_prior_density(self.priors, h) - log_density
        value = np.where(np.isnan(value), -np.inf, value)
        is_exact = np.zeros(value.shape, dtype=bool)
        for margin in (0.0, IRRELEVANT_LOG_DROP):  # the best ones first, which tell what matters
            floor = self._top if margin else value.max(axis=1, keepdims=True)
            relevant = ~is_exact & (value >= floor - margin) & np.isfinite(value)
            data_set = np.broadcast_to(np.arange(len(value))[:, None], value.shape)[relevant]
            log_mass, _ = self.conditional.boxes[data_set].log_mass(gaussians.mean[relevant], gaussians.root[relevant])
            value[relevant] += log_mass - ceiling[relevant]
            is_exact |= relevant
            exact = np.where(is_exact, value, -np.inf)
            self._top = np.maximum(self._top, exact.max(axis=1, keepdims=True))
        return value


def _ceiling(conditional: ConditionalGaussian, gaussians: Conditional) -> FloatArray:
    """Return no less than the log mass (B, N) within the bounds of the linear parameters."""
    shape, size, p = gaussians.log_likelihood.shape, gaussians.log_likelihood.size, gaussians.mean.shape[2]
    boxes = conditional.boxes[np.repeat(np.arange(shape[0]), shape[1])]
    return boxes.ceiling(gaussians.mean.reshape(size, p), gaussians.root.reshape(size, p, p)).reshape(shape)


def _solution(integration: _Integration, index: int, seed: int) -> Solution:
    """Return the posterior of one of the data sets."""
    model, rule, gaussians = integration.models[index], integration.rule, integration.gaussians
    box = integration.conditional.boxes[[index]]
    weights = rule.weights[index] if rule else np.ones(1)
    mixture = GaussianMixture(weights, integration.settings[index], gaussians.mean[index], gaussians.root[index])
    truncated = TruncatedMixture(mixture, box)

    def marginal(symbol: str) -> Marginal:
        if symbol in model.linear:
            return truncated.marginal(model.linear.index(symbol))
        assert integration.rule is not None  # noqa: S101 (there is a nonlinear parameter)
        assert integration.warp is not None  # noqa: S101
        side = model.nonlinear.index(symbol)
        return _marginal_of_quadrature(integration.rule, integration.warp, index, side, mixture.settings[:, side])

    linear = f"{', '.join(model.linear)} integrated in closed form" if model.linear else "no linear parameter"
    integrated = f"quadrature over {', '.join(model.nonlinear)}" if model.nonlinear else "nothing left to integrate"
    cut = "; bounds of the linear parameters cut the posterior and were honoured" if truncated.is_cut else ""
    representation = Representation(lambda count: truncated.components().resampled(count))
    solution = Solution(
        model, "exact", f"{linear}; {integrated}{cut}", representation, Marginals.of(model, marginal), seed
    )
    if model.is_improper:
        return solution
    log_mass, error_of_mass = truncated.checked_masses(model.linear)
    if rule:
        evidence = float(rule.log_integral[index])
        error_of_evidence = float(rule.log_error[index] + np.exp(-IRRELEVANT_LOG_DROP) + error_of_mass)
    else:
        evidence, error_of_evidence = float(gaussians.log_likelihood[index, 0] + log_mass.sum()), error_of_mass
    return replace(solution, log_evidence=evidence, log_evidence_error=error_of_evidence)


def _marginal_of_quadrature(rule: Quadrature, warp: Warp, index: int, side: int, values: FloatArray) -> Marginal:
    """Return the marginal of a nonlinear parameter: the quadrature's own interpolant, other parameters integrated.

    Parameters
    ----------
    rule : Quadrature
        In the coordinates of the warp.
    warp : Warp
    index : int
        The data set's place among those of rule and warp.
    side : int
        The parameter's place among the nonlinear ones.
    values : (M,) array
        Its values at the points of the rule.
    """
    weights, warp = rule.weights[index], warp[index]
    lines = rule.lines(side, index)
    heavy = np.abs(lines.series[:, 0] * lines.width) > 1e-8
    lines = Lines(lines.preceding[heavy], lines.start[heavy], lines.width[heavy], lines.series[heavy])
    seen = values[weights > 1e-8]
    low, high = warp.bounds(side)
    margin = 0.05 * np.ptp(seen)
    ends = max(low, seen.min() - margin), min(high, seen.max() + margin)
    points = weighted_grid(values, weights, ends, TABLE_POINTS if len(lines.start) <= MANY_LINES else TABLE_POINTS // 4)
    coordinates, slope = warp.coordinate(side, points, lines.preceding)
    density = lines.evaluate(coordinates, slope)
    cumulative = lines.integrate_to(coordinates)
    return Marginal.of(*moments_of_values(weights, values), points, density, cumulative)
