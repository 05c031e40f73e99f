"""The exact route: linear parameters in closed form, quadrature over the nonlinear ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import ModelError
from tissuq.inference.bounds import resampled, split_at_bounds
from tissuq.inference.conditional import ConditionalGaussian
from tissuq.inference.marginal import (
    Marginal,
    blended,
    marginal_of_mixture,
    marginal_of_points,
    marginal_of_quadrature,
)
from tissuq.inference.quadrature import MAX_DIMENSION, Quadrature, integrate
from tissuq.inference.solution import Components, Solution
from tissuq.inference.warp import Warp, warp_around_mode
from tissuq.model import StatisticalModel

__all__ = ["is_exact", "solve_exactly"]

FloatArray = NDArray[np.float64]

CHAINS, DRAWS = 4, 1000


def is_exact(model: StatisticalModel) -> bool:
    """Return whether the exact route applies: at most three parameters that are not linear Gaussian."""
    return len(model.nonlinear) <= MAX_DIMENSION


def solve_exactly(model: StatisticalModel, seed: int = 0) -> Solution:
    """Return the posterior and the evidence of a model with at most three nonlinear parameters.

    Likelihood times normalised prior is integrated, so the evidence includes uniform densities. Bounds of the
    linear parameters that cut off less than 1e-8 of the posterior leave it a mixture of Gaussians; where they cut
    off more, it is represented by points within them. The error given with the evidence is that of the quadrature.

    Parameters
    ----------
    model : StatisticalModel
    seed : int
        Of the draws; nothing else is random.

    Raises
    ------
    ModelError
        When the model has more than three nonlinear parameters.
    ConvergenceError
        When the quadrature does not reach its tolerance.

    References
    ----------
    Zeraatpisheh, Bordas & Beex (2021), eq. 15 and 28, integrated instead of sampled.
    """
    if not is_exact(model):
        raise ModelError(
            f"the exact route integrates at most {MAX_DIMENSION} nonlinear parameters; this model has "
            f"{len(model.nonlinear)} ({', '.join(model.nonlinear)}). Use the sampler 'nuts'."
        )
    conditional = ConditionalGaussian(model)
    rule, warp = _integrate_nonlinear(model, conditional)
    settings = warp.parameters(rule.points)[0] if rule and warp else np.zeros((1, 0))
    given = conditional(settings)
    components = Components(rule.weights if rule else np.ones(1), settings, given.mean, given.root)
    inner, cut = split_at_bounds(components, given.outside, conditional.box)
    bounds = [model.priors[symbol].support for symbol in model.linear]
    marginals = {symbol: _linear_marginal(inner, cut, j, bounds[j]) for j, symbol in enumerate(model.linear)}
    if rule and warp:
        for side, symbol in enumerate(model.nonlinear):
            marginals[symbol] = marginal_of_quadrature(rule, warp, side, settings[:, side])
    components = inner.joined(resampled(cut)) if len(cut.weights) else inner
    columns = dict(zip((*model.nonlinear, *model.linear), _draw(components, seed), strict=True))
    return Solution(
        model=model,
        route="exact",
        reason=_reason(model, is_bounded=len(cut.weights) > 0),
        components=components,
        marginals={symbol: marginals[symbol] for symbol in model.symbols},
        draws={symbol: columns[symbol] for symbol in model.symbols},
        log_evidence=rule.log_integral if rule else float(given.log_likelihood[0]),
        log_evidence_error=rule.log_error if rule else 0.0,
    )


def _integrate_nonlinear(
    model: StatisticalModel, conditional: ConditionalGaussian
) -> tuple[Quadrature, Warp] | tuple[None, None]:
    """Integrate likelihood times prior over the nonlinear parameters, in coordinates that follow the posterior."""
    if not model.nonlinear:
        return None, None
    priors = [model.priors[symbol] for symbol in model.nonlinear]
    warp = warp_around_mode(priors, lambda h: conditional(h).log_likelihood)

    def log_integrand(u: FloatArray) -> FloatArray:
        h, log_density = warp.parameters(u)
        log_prior = sum(prior.log_density(column) for prior, column in zip(priors, h.T, strict=True))
        return np.asarray(conditional(h).log_likelihood + log_prior - log_density)

    return integrate(log_integrand, len(priors)), warp


def _linear_marginal(inner: Components, cut: Components, place: int, bounds: tuple[float, float]) -> Marginal:
    parts = []
    if len(inner.weights):
        sds = np.sqrt((inner.root[:, place] ** 2).sum(axis=1))
        parts.append((inner.weights.sum(), marginal_of_mixture(inner.weights, inner.mean[:, place], sds)))
    if len(cut.weights):
        parts.append((cut.weights.sum(), marginal_of_points(cut.mean[:, place], cut.weights, bounds)))
    return blended(parts, bounds)


def _draw(components: Components, seed: int) -> FloatArray:
    """Return draws (d + p, chains, draws) of the nonlinear and the linear parameters."""
    generator = np.random.default_rng(seed)
    chosen = generator.choice(len(components.weights), size=(CHAINS, DRAWS), p=components.weights)
    noise = generator.standard_normal((CHAINS, DRAWS, components.root.shape[2]))
    linear = components.mean[chosen] + np.einsum("cdij,cdj->cdi", components.root[chosen], noise)
    return np.moveaxis(np.concatenate([components.settings[chosen], linear], axis=2), 2, 0)


def _reason(model: StatisticalModel, is_bounded: bool) -> str:
    linear = f"{', '.join(model.linear)} integrated in closed form" if model.linear else "no linear parameter"
    nonlinear = f"quadrature over {', '.join(model.nonlinear)}" if model.nonlinear else "nothing left to integrate"
    bounds = "; bounds of the linear parameters cut the posterior and were honoured" if is_bounded else ""
    return f"{linear}; {nonlinear}{bounds}"
