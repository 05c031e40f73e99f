"""A posterior under the condition that material and energy discrepancy are stable: its stable draws."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from tissuq.assessment.stability import are_stable
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import LoadingMode, curve_modes, loading_mode
from tissuq.inference.gaussian_mixture import CHAINS, GaussianMixture
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.solution import Marginals, Representation, Solution, shares_of_members
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import values_of

ALL_MODES = "all"
"""Name that stands for every loading mode."""
MIN_STABLE_DRAWS, MAX_ROUNDS, MIN_ROUNDS = 1000, 250, 10
"""Smallest number of stable draws; largest number of rounds of draws in which they are sought; number of rounds after
which the search ends if it finds fewer than one a round."""
PRIOR_DRAWS, MIN_STABLE_PRIOR_DRAWS = 10_000, 100
"""Number of draws from the prior, and the smallest number of stable ones from which the stable share is computed."""


def modes_named(names: str | Sequence[str]) -> tuple[str, ...]:
    """Return the loading modes that are named, each once.

    Raises
    ------
    InputError, ModelError
        When ``"all"`` is combined with other names, or there is no such mode.
    """
    if not isinstance(names, str | Sequence):
        raise InputError(f"stable_in must be '{ALL_MODES}' or names of loading modes, and () for none, not {names!r}.")
    requested = [names] if isinstance(names, str) else list(names)
    if ALL_MODES in requested and len(requested) > 1:
        raise InputError(f"'{ALL_MODES}' cannot be combined with other loading modes in stable_in: omit the others.")
    curves = [mode.name for mode in curve_modes()]
    modes = curves if requested == [ALL_MODES] else list(dict.fromkeys(loading_mode(name).name for name in requested))
    unsuitable = [name for name in modes if name not in curves]
    if unsuitable:
        suitable = ", ".join(curves)
        raise InputError(f"stable_in takes modes of one stretch and one stress ({suitable}), not '{unsuitable[0]}'.")
    return tuple(modes)


def stable_part(unconstrained: Solution, modes: Sequence[str], seed: int) -> Solution:
    """Return the posterior of a model whose prior excludes what is not stable over the measured range.

    With density and evidence of the prior p and stable parameters S it is that under p(h) [h in S] / P(S): the draws of
    the posterior under p that lie in S, exactly. The evidence follows from both shares of S,
    log Z + log P(S | y) - log P(S), of which the latter needs draws from the prior. It is unknown where the prior is
    improper, where too few of its draws are stable, or where it reaches materials about to lock.

    Parameters
    ----------
    unconstrained : Solution
        Posterior under the prior p.
    modes : sequence of str
        Loading modes in which it must be stable, over the range in which both invariants were measured.
    seed : int

    Raises
    ------
    ModelError
        When too few draws are stable, or stability cannot be computed from the material's energy.
    """
    model, paths = unconstrained.model, [loading_mode(name) for name in modes]
    mixture, draw_count = _stable_draws(unconstrained, paths, np.random.default_rng([seed, 17]))
    stable_count, per_chain = len(mixture), len(mixture) // CHAINS
    share = stable_count / draw_count
    names = ", ".join(modes)
    reason = f"{unconstrained.reason}; of {draw_count} draws the {stable_count} that are stable in {names} loading"

    def marginal(symbol: str) -> Marginal:
        values, _ = values_of(model, mixture, [symbol])
        return marginal_of_points(values[:, 0], mixture.weights, model.priors[symbol].support)

    solution = Solution(
        model,
        unconstrained.route,
        reason,
        Representation.of(mixture),
        Marginals.of(model, marginal),
        sampled=mixture.mean[: CHAINS * per_chain].reshape(CHAINS, per_chain, -1),
        diagnostics=unconstrained.diagnostics,
        members={} if mixture.member is None else shares_of_members(model, mixture.member, mixture.weights),
        stable_in=tuple(modes),
        stable_share=share,
    )
    if unconstrained.log_evidence is None or unconstrained.log_evidence_error is None:
        return solution
    prior, stable = _prior_draws(model, PRIOR_DRAWS, np.random.default_rng([seed, 18])), 0
    with suppress(ModelError):  # materials about to lock at one of the stretches
        stable = int(are_stable(model, prior, paths).sum())
    if stable < MIN_STABLE_PRIOR_DRAWS:
        reason += "; no evidence, because too few draws from the prior are stable"
        return replace(solution, reason=reason)
    prior_share = stable / PRIOR_DRAWS
    errors = np.sqrt([(1 - share) / stable_count, (1 - prior_share) / stable])
    return replace(
        solution,
        reason=f"{reason}, {prior_share:.2g} of the prior",
        stable_prior_share=prior_share,
        log_evidence=unconstrained.log_evidence + float(np.log(share / prior_share)),
        log_evidence_error=unconstrained.log_evidence_error + float(np.hypot(*errors)),
    )


def _stable_draws(
    unconstrained: Solution, paths: Sequence[LoadingMode], generator: np.random.Generator
) -> tuple[GaussianMixture, int]:
    """Return at least `MIN_STABLE_DRAWS` stable draws as points, and among how many draws these are."""
    source, batches, draw_count, stable_count = unconstrained.wide_mixture, [], 0, 0
    for count in range(1, MAX_ROUNDS + 1):
        component, linear = source.draw(int(generator.integers(2**32)))
        rows = component.ravel()
        member = None if source.member is None else source.member[rows]
        points = GaussianMixture.of_points(source.settings[rows], linear.reshape(len(rows), -1), member)
        stable = are_stable(unconstrained.model, points, paths)
        batches.append(points[stable])
        draw_count, stable_count = draw_count + component.size, stable_count + int(stable.sum())
        if stable_count >= MIN_STABLE_DRAWS or (count >= MIN_ROUNDS and stable_count < count):
            break
    if stable_count < MIN_STABLE_DRAWS:
        raise ModelError(
            f"only {stable_count} of {draw_count} draws of material '{unconstrained.model.material.name}' are stable "
            f"in {', '.join(path.name for path in paths)} loading, too few for their posterior: the data contradict "
            "a stable material of this kind. Choose another one, measure in more loading modes, or fit without "
            "stable_in."
        )
    draws = GaussianMixture.of_all(batches)
    return draws.weighted(np.full(stable_count, 1 / stable_count)), draw_count


def _prior_draws(model: StatisticalModel, count: int, generator: np.random.Generator) -> GaussianMixture:
    """Return draws of every parameter, and of the weights of an energy discrepancy, from their priors."""
    values = {symbol: np.asarray(prior.quantile(generator.random(count))) for symbol, prior in model.priors.items()}
    settings, linear = (
        np.array([values[symbol] for symbol in symbols]).reshape(-1, count).T
        for symbols in (model.nonlinear, model.linear)
    )
    if not model.energy_members:
        return GaussianMixture.of_points(settings, linear)
    sizes = [[features.shape[1] for features in model.energy_features(k)] for k in range(len(model.energy_members))]
    odds = [member.probability for member in model.energy_members]
    member = generator.choice(len(odds), count, p=np.array(odds) / sum(odds))
    weights = generator.standard_normal((count, max(map(sum, sizes))))
    for index in np.unique(member):
        rows, start = np.flatnonzero(member == index), 0
        for block, size in zip(model.energy_members[index].amplitude_indices, sizes[index], strict=True):
            weights[rows, start : start + size] *= values[model.energy_symbols[block]][rows, None]
            start += size
    return GaussianMixture.of_points(settings, np.hstack([linear, weights]), member)
