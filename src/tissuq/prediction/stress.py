"""The predicted stress of a posterior's components at any states, within the range of the data and beyond."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import ModelError
from tissuq.experiments.modes import States
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.mechanics.equilibrium import has_free_axis
from tissuq.mechanics.rays import TINY, Range, drawn_back, share_to_end
from tissuq.mechanics.stress import stresses_by_basis
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import drawn_stress, slopes_of, stress_moments, stresses_beyond, values_of

MIN_DRAWS = 6000
"""Draws, at the least, that stand for a posterior beyond the range of its data."""


@dataclass(frozen=True, eq=False)
class Stress:
    """The predicted stress of a posterior's components, without noise.

    Beyond the range in which a discrepancy's blocks were measured, the energy of material and discrepancy goes on along
    rays (`tissuq.mechanics.rays`): there the stress has draws, several for each component.

    Attributes
    ----------
    model : StatisticalModel
    components : GaussianMixture
    with_discrepancy : bool
        Whether the discrepancy's share is in it.
    errs_beyond : bool
        Whether the exponents with which the energy goes on beyond the range have errors; else they are the medians.
    """

    model: StatisticalModel
    components: GaussianMixture
    with_discrepancy: bool
    errs_beyond: bool = True

    def at(self, states: States) -> tuple[GaussianMixture, FloatArray, FloatArray]:
        """Return components (M,) with means and variances (M, g) of the stress at states (g,).

        They are more than those of the posterior where some of the states lie beyond its range, or have a lateral
        stretch that depends on the ratio of several linear parameters: it is found for every draw.
        """
        if self._follows_draws(states):
            drawn, _ = self._drawn
            return drawn, self._in_equilibrium(states), np.zeros((len(drawn), len(states)))
        logs, tilt = states.log_stretches[0], states.tilt[0]
        shares = np.array([share_to_end(logs, limits, tilt) for limits in self._limits or [Range()]])
        farthest = shares.max(axis=0)
        inside = drawn_back(states, farthest) if (farthest < 1).any() else states
        mean, variance = stress_moments(self.model, self.components, inside, discrepancy=self.with_discrepancy)
        if (shares == 1).all():
            return self.components, mean, variance
        drawn, probability = self._drawn
        mean, variance = (np.repeat(moment, self._copies, axis=0) for moment in (mean, variance))
        for index, stress in stresses_beyond(self.model, drawn, states, probability):
            mean[index], variance[index] = stress, 0.0
        return drawn, mean, variance

    def slopes(self, states: States, mean: FloatArray) -> FloatArray:
        """Return the slopes (M, g, c) of the means (M, g) along the controls of their paths, MPa; zero beyond these."""
        if self._follows_draws(states):
            return slopes_of(self._in_equilibrium, states, mean)
        if len(mean) == len(self.components):
            of_moments = partial(stress_moments, self.model, self.components, discrepancy=self.with_discrepancy)
            return slopes_of(lambda moved: of_moments(moved)[0], states, mean)
        drawn, probability = self._drawn
        of_draws = partial(drawn_stress, self.model, drawn, probability=probability)
        return slopes_of(of_draws, states, of_draws(states))

    def _follows_draws(self, states: States) -> bool:
        """Return whether the stress is linear in no parameters, as the material finds its lateral stretch by them."""
        return self.model.material.linear_mask.sum() > 1 and has_free_axis(self.model.material, states)

    def _in_equilibrium(self, states: States) -> FloatArray:
        """Return the stresses (M, g) of the material's draws where no lateral stress acts.

        Raises
        ------
        ModelError
            When draws have parameters that they must not have, so that there may be no lateral stretch of least energy,
            or no stress.
        """
        material = self.model.material
        values, _ = values_of(self.model, self._drawn[0], self.model.material_symbols)
        stress = stresses_by_basis(material, states, values)
        least = [parameter.support[0] for parameter in material.parameters]
        if (values < least).any() or not np.isfinite(stress).all():
            symbols = ", ".join(self.model.material_symbols)
            raise ModelError(
                f"material '{material.name}' has no lateral stretch with some of the values of {symbols} that the data "
                "allow: give priors of positive stiffnesses (--prior), or predict at smaller stretches."
            )
        return stress

    @cached_property
    def _limits(self) -> list[Range]:
        """The ranges of the components' blocks."""
        member = self.components.member
        if member is None or not self.with_discrepancy:
            return []
        return [limits for limits, _ in self.model.by_limits(member)]

    @cached_property
    def _copies(self) -> IndexArray:
        """How many draws (M,) stand for each component, in proportion to its weight, so that none counts for many."""
        weights = self.components.weights
        return np.asarray(np.maximum(1, np.ceil(MIN_DRAWS * weights / max(weights.sum(), TINY))), dtype=np.intp)

    @cached_property
    def _drawn(self) -> tuple[GaussianMixture, FloatArray]:
        """Draws of every component, and probabilities of the errors of their exponents."""
        from scipy.special import ndtri

        copies, scores = self._copies, self.components.root.shape[2]
        # A Latin hypercube of our own, as importing `scipy.stats` for one takes a tenth of the time of a fit.
        generator, cells = np.random.default_rng(0), np.tile(np.arange(copies.sum()), (scores + 1, 1))
        uniform = (generator.permuted(cells, axis=1) + generator.random(cells.shape)).T / copies.sum()
        drawn = self.components[np.repeat(np.arange(len(copies)), copies)]
        values = drawn.mean + np.einsum("mps,ms->mp", drawn.root, ndtri(uniform[:, 1:]))
        weights, no_root = drawn.weights / np.repeat(copies, copies), np.zeros((*values.shape, 0))
        probability = uniform[:, 0] if self.errs_beyond else np.full(len(uniform), 0.5)
        return replace(drawn, weights=weights, mean=values, root=no_root), probability
