"""What a next test may be for: a quantity of a finite-element model, linear in stresses of the material."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.model.statistical_model import StatisticalModel
from tissuq.next_test.candidates import Stresses, Target

States = Sequence[tuple[LoadingMode, FloatArray]]

MIN_DRAWS = 8
"""Draws that give a quantity, at the least, from which it is learned."""
DRAWS_PER_COMPONENT = 4
"""Draws, at the least, for each principal component of the stresses that is used."""


@dataclass(frozen=True, eq=False)
class QuantityTarget(Target):
    """A quantity of a model, to first order: intercept + sum of weight_k * stress_k + an error.

    Attributes
    ----------
    text, words : str
        Its name, and what it is.
    states : sequence of (LoadingMode, (1,) array)
        K of them, whose stresses it follows.
    weights : (K,) array, unit of the quantity / MPa
    intercept, residual_sd : float
        The latter of the error: that of draws which are left out of the fit.
    explained : float
        Share of the quantity's variance over draws that is not error.
    """

    text: str
    words: str
    states: States
    weights: FloatArray
    intercept: float
    residual_sd: float
    explained: float

    @property
    def name(self) -> str:
        """As it was asked for."""
        return self.text

    def title(self, model: StatisticalModel) -> str:
        return self.words

    def unit(self, model: StatisticalModel) -> str:
        """Return nothing: the units of the model are the user's."""
        return ""

    @property
    def points(self) -> Iterator[tuple[LoadingMode, FloatArray]]:
        """The modes and stretches (1,) of the stresses."""
        yield from self.states

    @property
    def offset(self) -> float:
        """The intercept."""
        return self.intercept

    def moments(
        self, model: StatisticalModel, components: GaussianMixture, stresses: Stresses
    ) -> tuple[FloatArray, FloatArray]:
        error = np.hypot(stresses.scatter * np.linalg.norm(self.weights), self.residual_sd)
        root = np.einsum("mkr,k->mr", stresses.root, self.weights)
        return self.intercept + stresses.mean @ self.weights, np.concatenate([root, error[:, None]], axis=1)


def quantity_target(
    text: str,
    words: str,
    states: Sequence[tuple[str | LoadingMode, FloatArray]],
    stresses: FloatArray,
    values: FloatArray,
) -> QuantityTarget:
    """Return the target that draws of a posterior tell: a regression on principal components of their stresses.

    Their number is that which predicts draws best that are left out, one at a time.

    Parameters
    ----------
    text, words : str
        Its name, and what it is.
    states : sequence of (str or LoadingMode, (1,) array)
    stresses : (N, K) array, MPa
        Of every draw at the states.
    values : (N,) array
        Of the quantity; not a number where a draw has none.

    Raises
    ------
    InputError
        When few draws have a value, or all have the same.
    """
    is_present = np.isfinite(values)
    stresses, values = stresses[is_present], values[is_present]
    if len(values) < MIN_DRAWS or not np.ptp(values):
        raise InputError(
            f"target '{text}': {len(values)} draws give it, of which {len(np.unique(values))} different values; at "
            f"least {MIN_DRAWS} draws are needed that differ. Make an ensemble of more (tissuq ensemble --draws)."
        )
    count, centre = len(values), values.mean()
    left_vectors, singular, right_vectors = np.linalg.svd(stresses - stresses.mean(axis=0), full_matrices=False)
    rank = min(int((singular > 1e-10 * singular[0]).sum()), count // DRAWS_PER_COMPONENT)
    scores = left_vectors[:, :rank].T @ (values - centre)
    errors = []
    for used in range(1, rank + 1):
        leverage = 1 / count + (left_vectors[:, :used] ** 2).sum(axis=1)
        residual = values - centre - left_vectors[:, :used] @ scores[:used]
        errors.append(float(np.mean((residual / (1 - leverage)) ** 2)))
    used = int(np.argmin(errors)) + 1
    weights = right_vectors[:used].T @ (scores[:used] / singular[:used])
    intercept, error = float(centre - stresses.mean(axis=0) @ weights), errors[used - 1]
    explained = max(0.0, 1 - error / float(values.var()))
    modes_and_points = [(loading_mode(mode), points) for mode, points in states]
    return QuantityTarget(text, words, modes_and_points, weights, intercept, float(np.sqrt(error)), explained)
