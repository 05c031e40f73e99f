"""What a next test is for: a parameter, the modulus, a stress, or a quantity of a finite-element model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment.modulus import modulus_moments
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import checked_points
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.model.statistical_model import StatisticalModel
from tissuq.next_test.candidates import Candidate
from tissuq.prediction.moments import values_of

MODULUS = "modulus"
MIN_DRAWS = 8
"""Draws that give a quantity, at the least, from which it is learned."""
DRAWS_PER_COMPONENT = 4
"""Draws, at the least, for each principal component of the stresses that is used."""


class Stresses(NamedTuple):
    """K stresses in M components.

    Attributes
    ----------
    mean, root : (M, K) and (M, K, r) arrays
    scatter : (M,) array
        Standard deviation of what is independent from stress to stress.
    """

    mean: FloatArray
    root: FloatArray
    scatter: FloatArray


@dataclass(frozen=True)
class Target(ABC):
    """A quantity that is linear in the linear parameters, given the others.

    Attributes
    ----------
    name : str
        As `target_named` reads it.
    title : str
        What it is in words.
    unit : str
        Of its values: MPa, or nothing.
    is_stiffness : bool
        Whether an error of all stresses multiplies it.
    states : tuple of (LoadingMode, float)
        A mode and a stretch of it for each of the K engineering stresses that it is made of.
    offset : float
        The part of its mean that no error of all stresses multiplies.
    """

    name: str
    title: str
    unit: str = "MPa"
    is_stiffness: bool = True
    states: tuple[tuple[LoadingMode, float], ...] = ()
    offset: float = 0.0

    @abstractmethod
    def moments(
        self, model: StatisticalModel, components: GaussianMixture, stresses: Stresses
    ) -> tuple[FloatArray, FloatArray]:
        """Return means (M,) and roots (M, q) in every component, in which the stresses at its states are given."""


class ParameterTarget(Target):
    """A parameter of the model, by its symbol."""

    def moments(
        self, model: StatisticalModel, components: GaussianMixture, stresses: Stresses
    ) -> tuple[FloatArray, FloatArray]:
        mean, root = values_of(model, components, [self.name])
        return mean[:, 0], root[:, 0]


class ModulusTarget(Target):
    """The material's initial shear modulus."""

    def moments(
        self, model: StatisticalModel, components: GaussianMixture, stresses: Stresses
    ) -> tuple[FloatArray, FloatArray]:
        return modulus_moments(model, components)


@dataclass(frozen=True)
class QuantityTarget(Target):
    """A stress, discrepancy included, without noise, or a quantity of a finite-element model, which follows several.

    To first order it is offset + sum of weight_k * stress_k + an error. A model's units are the user's.

    Attributes
    ----------
    weights : tuple of K floats, unit of the quantity / MPa
    residual_sd : float
        Of the error: that of draws which are left out of the fit.
    explained : float
        Share of the quantity's variance over draws that is not error.
    """

    weights: tuple[float, ...] = ()
    residual_sd: float = 0.0
    explained: float = 1.0

    def moments(
        self, model: StatisticalModel, components: GaussianMixture, stresses: Stresses
    ) -> tuple[FloatArray, FloatArray]:
        weights = np.array(self.weights)
        error = np.hypot(stresses.scatter * np.linalg.norm(weights), self.residual_sd)
        root = np.einsum("mkr,k->mr", stresses.root, weights)
        return self.offset + stresses.mean @ weights, np.concatenate([root, error[:, None]], axis=1)


def target_named(text: str | Target, model: StatisticalModel) -> Target:
    """Return the target of a text: a parameter, ``modulus``, or a stress such as ``planar:1.5``.

    Raises
    ------
    InputError, ModelError
        When there is no such parameter or mode, or a parameter has no standard deviation.
    """
    if isinstance(text, Target):
        return text
    if text in model.symbols:
        if text in model.energy_symbols and not model.priors[text].has_moments:
            raise InputError(f"{text} has no standard deviation under its prior {model.priors[text]}: choose another.")
        unit = next(parameter.unit for parameter in model.parameters if parameter.symbol == text)
        return ParameterTarget(text, text, unit, text in model.column_symbols)
    name, colon, stretch = text.partition(":")
    if text == MODULUS:
        return ModulusTarget(MODULUS, "initial shear modulus")
    if not colon:
        raise InputError(
            f"there is no target '{text}': write {MODULUS}, a parameter ({', '.join(model.symbols)}), or a stress as "
            "MODE:STRETCH, such as planar:1.5."
        )
    mode = loading_mode(name.strip())
    if len(mode.controls) > 1 or len(mode.stresses) > 1:
        raise InputError(f"target '{text}': mode '{mode.name}' has several controls or stresses; choose one with one.")
    try:
        value = float(stretch)
    except ValueError:
        raise InputError(
            f"target '{text}': '{stretch}' is not a stretch; write MODE:STRETCH, such as planar:1.5."
        ) from None
    point = float(checked_points(mode, [value])[0])
    title = f"{mode.name} stress at {point:g}"
    return QuantityTarget(f"{mode.name}:{point:g}", title, states=((mode, point),), weights=(1.0,))


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
        When few draws have a value, or all have the same, or a mode has several controls.
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
    tests = [Candidate(mode, stretch) for mode, stretch in states]
    of_modes = tuple((test.mode, test.stretch.item()) for test in tests)
    return QuantityTarget(
        text, words, "", True, of_modes, intercept, tuple(weights.tolist()), float(np.sqrt(error)), explained
    )
