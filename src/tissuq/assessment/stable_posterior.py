"""A posterior given that material and energy discrepancy are stable: those of its draws that are."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.stability import are_stable
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes
from tissuq.inference.energies import discrepancy_in_draws, shares_of_members
from tissuq.inference.marginal import Marginal, marginal_of_points
from tissuq.inference.solution import CHAINS, Components, Solution
from tissuq.model import StatisticalModel

__all__ = ["ALL", "StableSolution", "modes_named"]

FloatArray = NDArray[np.float64]

ALL = "all"
"""In place of loading modes: every one."""
FEWEST, ROUNDS, HOPELESS = 1000, 250, 10
"""Stable draws that are enough; rounds of draws among which they must be found, and after how many the search ends
where it finds fewer than one a round."""
PRIOR_DRAWS, TOLD = 10_000, 100
"""Draws from the prior, and how many of them must be stable to tell how much of it is."""


def modes_named(names: str | Sequence[str]) -> tuple[str, ...]:
    """Return the loading modes that are named, each once.

    Raises
    ------
    InputError, ModelError
        When ``"all"`` does not stand alone, or there is no such mode.
    """
    chosen = [names] if isinstance(names, str) else list(names)
    if ALL in chosen and len(chosen) > 1:
        raise InputError(f"'{ALL}' stands alone among the loading modes of stable_in; leave out the names beside it.")
    curves = [name for name, kind in loading_modes().items() if kind().is_curve]
    found = curves if chosen == [ALL] else list(dict.fromkeys(loading_mode(name).name for name in chosen))
    other = [name for name in found if name not in curves]
    if other:
        known = ", ".join(curves)
        raise InputError(f"stable_in takes modes of one stretch and one stress ({known}), not '{other[0]}'.")
    return tuple(found)


class StableSolution(Solution):
    """The posterior of a model whose prior leaves out what is not stable over the measured range.

    With density and evidence of the prior p and stable parameters S it is that under p(h) [h in S] / P(S): the draws of
    the posterior under p that lie in S, exactly. The evidence follows from both shares of S,
    log Z + log P(S | y) - log P(S), of which the latter needs draws from the prior.

    Parameters
    ----------
    whole : Solution
        Under the prior p.
    modes : sequence of str
        Loading modes in which it must be stable, over the range in which both invariants were measured.
    seed : int

    Attributes
    ----------
    share, prior_share : float
        P(S | y) and P(S); the latter, as the evidence, is not known where the prior is improper, where hardly any of it
        is stable, or where it reaches materials about to lock.

    Raises
    ------
    ModelError
        When hardly any draw is stable, or the material's energy does not tell.
    """

    def __init__(self, whole: Solution, modes: Sequence[str], seed: int) -> None:
        self.model, self.route, self.diagnostics, self._whole = whole.model, whole.route, whole.diagnostics, whole
        self.stable_in = tuple(modes)
        paths = [loading_mode(name) for name in modes]
        self.components, tried = self._kept(paths, np.random.default_rng([seed, 17]))
        kept = len(self.components.weights)
        self.share, self.prior_share = kept / tried, np.nan
        self.reason = f"{whole.reason}; of {tried} draws the {kept} that are stable in {', '.join(modes)} loading"
        if whole.log_evidence is not None and whole.log_evidence_error is not None:
            prior = _prior_draws(self.model, PRIOR_DRAWS, np.random.default_rng([seed, 18]))
            found = 0
            with suppress(ModelError):  # materials about to lock at one of the stretches
                found = int(are_stable(self.model, prior, paths).sum())
            if found < TOLD:
                self.reason += "; no evidence, because draws from the prior do not tell how much of it is stable"
                return
            self.prior_share = found / PRIOR_DRAWS
            errors = np.sqrt([(1 - self.share) / kept, (1 - self.prior_share) / found])
            self.log_evidence = whole.log_evidence + float(np.log(self.share / self.prior_share))
            self.log_evidence_error = whole.log_evidence_error + float(np.hypot(*errors))
            self.reason += f", {self.prior_share:.2g} of the prior"

    def _kept(self, paths: Sequence[LoadingMode], generator: np.random.Generator) -> tuple[Components, int]:
        """Return at least `FEWEST` stable draws as points, a multiple of the chains, and of how many they are."""
        source, kept, tried, found = self._whole.wide_components, [], 0, 0
        for count in range(1, ROUNDS + 1):
            chosen, linear = source.drawn(int(generator.integers(2**32)))
            points = _points(source.settings[chosen.ravel()], linear.reshape(chosen.size, -1))
            if source.member is not None:
                points = replace(points, member=source.member[chosen.ravel()])
            stable = are_stable(self.model, points, paths)
            kept.append(points[stable])
            tried, found = tried + chosen.size, found + int(stable.sum())
            if found >= FEWEST or (count >= HOPELESS and found < count):
                break
        if found < FEWEST:
            raise ModelError(
                f"only {found} of {tried} draws of material '{self.model.material.name}' are stable in "
                f"{', '.join(self.stable_in)} loading, too few to tell their posterior: the data contradict a stable "
                "material of this kind. Choose another one, measure in more loading modes, or fit without stable_in."
            )
        whole = kept[0]
        for more in kept[1:]:
            whole = whole.joined(more)
        return whole.weighted(np.full(found, 1 / found)), tried

    @property
    def component_of_draw(self) -> NDArray[np.intp]:
        """The component of every draw: there is one for each, in their order."""
        count = len(self.components.weights) // CHAINS
        return np.arange(CHAINS * count).reshape(CHAINS, count)

    @cached_property
    def draws(self) -> dict[str, FloatArray]:
        """Draws of every parameter, as many in each chain as there are for all."""
        chosen, parts = self.component_of_draw, self.components
        columns = np.moveaxis(np.concatenate([parts.settings[chosen], parts.mean[chosen]], axis=2), 2, 0)
        named = dict(
            zip((*self.model.nonlinear, *self.model.linear), columns, strict=False)
        )  # then weights of energies
        return {symbol: named[symbol] for symbol in self.model.symbols}

    @cached_property
    def drawn_discrepancy(self) -> FloatArray | None:  # type: ignore[override]  # a cached property
        """The discrepancy's stress (chains, draws, n) at the measurements in every draw."""
        chosen, parts = self.component_of_draw, self.components
        if parts.member is None:
            return None
        return discrepancy_in_draws(self.model, parts.member[chosen], parts.mean[chosen])

    @cached_property
    def members(self) -> dict[str, float]:  # type: ignore[override]  # a cached property
        """The posterior probability of every sum of blocks, its length scales together."""
        parts = self.components
        return {} if parts.member is None else shares_of_members(self.model, parts.member, parts.weights)

    def _marginal(self, symbol: str) -> Marginal:
        model, parts = self.model, self.components
        if symbol in model.linear:
            values = parts.mean[:, model.linear.index(symbol)]
        else:
            values = parts.settings[:, model.nonlinear.index(symbol)]
        return marginal_of_points(values, parts.weights, model.priors[symbol].support)


def _points(settings: FloatArray, linear: FloatArray) -> Components:
    """Return draws (M, d) and (M, p) as components without width."""
    count, p = linear.shape
    return Components(np.full(count, 1 / count), settings, linear, np.broadcast_to(0.0, (count, p, p)))


def _prior_draws(model: StatisticalModel, count: int, generator: np.random.Generator) -> Components:
    """Return draws of every parameter, and of the weights of an energy discrepancy, from their priors."""
    values = {symbol: np.asarray(prior.quantile(generator.random(count))) for symbol, prior in model.priors.items()}
    settings, linear = (
        np.array([values[symbol] for symbol in symbols]).reshape(-1, count).T
        for symbols in (model.nonlinear, model.linear)
    )
    if not model.energy_members:
        return _points(settings, linear)
    sizes = [[each.shape[1] for each in model.energy_features(k)] for k in range(len(model.energy_members))]
    odds = [member.probability for member in model.energy_members]
    chosen = generator.choice(len(odds), count, p=np.array(odds) / sum(odds))
    weights = generator.standard_normal((count, max(map(sum, sizes))))
    for place in np.unique(chosen):
        own, start = np.flatnonzero(chosen == place), 0
        for block, size in zip(model.energy_members[place].places, sizes[place], strict=True):
            weights[own, start : start + size] *= values[model.energy_symbols[block]][own, None]
            start += size
    return replace(_points(settings, np.hstack([linear, weights])), member=chosen)
