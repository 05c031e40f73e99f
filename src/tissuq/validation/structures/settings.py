"""What a campaign on the force of structures runs over."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from pydantic import field_validator

from tissuq.errors import ModelError
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements import Case, ClampedBar, Indentation, PlateWithHole
from tissuq.model.tolerances import Tolerances
from tissuq.parameters.priors import Prior, Uniform
from tissuq.studies.campaign_settings import StructureStudyOptions
from tissuq.studies.settings import there_is

__all__ = ["KNOWN_LAWS", "STRUCTURES", "KnownLaw", "StructureStudySettings"]


class KnownLaw(NamedTuple):
    """A law with its parameters, MPa where they are stresses, and what priors an oracle has that differ."""

    material: str
    values: tuple[float, ...]
    priors: Mapping[str, Prior] = MappingProxyType({})


KNOWN_LAWS = {
    "gent": KnownLaw("gent", (0.01, 0.8)),
    "ogden": KnownLaw("ogden-1", (0.01, -9.0), MappingProxyType({"alpha1": Uniform(-40.0, -0.5)})),
}
"""The truths: one that locks at I1 - 3 = 0.8, and one that is much stiffer in compression than in tension."""
STRUCTURES: dict[str, Case] = {
    "bar": ClampedBar(elongation=1.5, fineness=0.5),
    "indentation": Indentation(depth=0.3, fineness=0.5),
    "plate": PlateWithHole(elongation=2.0, fineness=0.5),
}
"""Structures by name, with meshes that are the same for the truth: errors of a mesh have no part in coverage."""


def _with_one_control(name: str) -> None:
    if len(loading_mode(name).controls) > 1:
        raise ModelError(f"the mode {name!r} has several controls; choose among those with one")


class StructureStudySettings(StructureStudyOptions):
    """Everything that a campaign on the force of structures depends on.

    Attributes
    ----------
    truths, structures : tuple of str
        Of `KNOWN_LAWS` and `STRUCTURES`.
    replicates : int
        Sets of tests of every truth.
    modes : tuple of str
        A test in each.
    low, high : float
        Stretches between which they are made.
    points : int
        Of every test.
    noise : float
        Standard deviation over the largest stress of a test.
    estimand : str
        Whose errors of tests are simulated, and told to the fits.
    draws, full_runs, steps : int
        As of `tissuq structure`.
    seed : int
    """

    @field_validator("truths")
    @classmethod
    def _known_truths(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        return _all_of(names, KNOWN_LAWS, "law")

    @field_validator("structures")
    @classmethod
    def _known_structures(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        return _all_of(names, STRUCTURES, "structure")

    _known_modes = field_validator("modes")(there_is(_with_one_control))
    _known_estimand = field_validator("estimand")(there_is(Tolerances))

    @property
    def tolerances(self) -> Tolerances:
        """Sizes of the errors of tests."""
        return Tolerances(self.estimand)


def _all_of(names: tuple[str, ...], available: Mapping[str, object], what: str) -> tuple[str, ...]:
    """Return names, each of which is known and given once."""
    for name in names:
        if name not in available:
            raise ValueError(f"there is no {what} {name!r}; choose from {', '.join(available)}")
    if len(set(names)) < len(names):
        raise ValueError(f"give every {what} once")
    return names
