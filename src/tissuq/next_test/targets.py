"""Targets of the next test: a parameter, the initial shear modulus, or a stress."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.assessment.modulus import modulus_moments
from tissuq.errors import InputError
from tissuq.experiments.experiment import checked_points
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.moments import values_of

__all__ = ["MODULUS", "ModulusTarget", "ParameterTarget", "StressTarget", "Target", "target_named"]

FloatArray = NDArray[np.float64]

MODULUS = "modulus"


@dataclass(frozen=True)
class Target(ABC):
    """A quantity that is linear in the linear parameters, given the others."""

    @property
    @abstractmethod
    def name(self) -> str:
        """The name, as `target_named` reads it."""

    @abstractmethod
    def title(self, model: StatisticalModel) -> str:
        """Return what it is in words."""

    def unit(self, model: StatisticalModel) -> str:
        """Return the unit of its values: MPa, or nothing."""
        return "MPa"

    def is_stiffness(self, model: StatisticalModel) -> bool:
        """Return whether an error of all stresses multiplies it."""
        return True

    @property
    def points(self) -> Iterator[tuple[LoadingMode, FloatArray]]:
        """A mode and a stretch (1,) of it, where it is the stress there."""
        return iter(())

    @abstractmethod
    def moments(self, model: StatisticalModel, components: GaussianMixture) -> tuple[FloatArray, FloatArray]:
        """Return means (M,) and roots (M, p) in every component, where it is no stress."""


@dataclass(frozen=True)
class ParameterTarget(Target):
    """A parameter of the model."""

    symbol: str

    @property
    def name(self) -> str:
        """Its symbol."""
        return self.symbol

    def title(self, model: StatisticalModel) -> str:
        return self.symbol

    def unit(self, model: StatisticalModel) -> str:
        return next(p.unit for p in model.parameters if p.symbol == self.symbol)

    def is_stiffness(self, model: StatisticalModel) -> bool:
        return self.symbol in model.column_symbols

    def moments(self, model: StatisticalModel, components: GaussianMixture) -> tuple[FloatArray, FloatArray]:
        mean, root = values_of(model, components, [self.symbol])
        return mean[:, 0], root[:, 0]


@dataclass(frozen=True)
class ModulusTarget(Target):
    """The material's initial shear modulus."""

    @property
    def name(self) -> str:
        """The word for it."""
        return MODULUS

    def title(self, model: StatisticalModel) -> str:
        return "initial shear modulus"

    def moments(self, model: StatisticalModel, components: GaussianMixture) -> tuple[FloatArray, FloatArray]:
        return modulus_moments(model, components)


@dataclass(frozen=True)
class StressTarget(Target):
    """The engineering stress at a stretch of a mode, discrepancy included, without noise."""

    mode: LoadingMode
    stretch: float

    @property
    def name(self) -> str:
        """Mode and stretch."""
        return f"{self.mode.name}:{self.stretch:g}"

    def title(self, model: StatisticalModel) -> str:
        return f"{self.mode.name} stress at {self.stretch:g}"

    @property
    def points(self) -> Iterator[tuple[LoadingMode, FloatArray]]:
        """The mode, and the stretch."""
        yield self.mode, np.array([self.stretch])

    def moments(self, model: StatisticalModel, components: GaussianMixture) -> tuple[FloatArray, FloatArray]:
        raise NotImplementedError("a stress is predicted together with the others")


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
        return ParameterTarget(text)
    name, colon, stretch = text.partition(":")
    if text == MODULUS:
        return ModulusTarget()
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
    return StressTarget(mode, float(checked_points(mode, [value])[0]))
