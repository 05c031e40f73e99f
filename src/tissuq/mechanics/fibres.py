"""Fibres in the plane of a test: an energy of I1 and of I4, the squared stretch along each family of fibres."""

from __future__ import annotations

import re
from abc import abstractmethod
from dataclasses import dataclass, replace
from math import radians
from typing import Any

from tissuq.errors import ModelError
from tissuq.experiments.modes import Deformation
from tissuq.mechanics.arithmetic import cos, sin
from tissuq.mechanics.material import Material
from tissuq.registry import variants

__all__ = ["FibreMaterial"]

NAME = re.compile(r"(?P<law>[\w-]+?)(?P<one>:one)?(@(?P<degrees>\d+(\.\d+)?))?")


@dataclass(frozen=True)
class FibreMaterial(Material):
    """Fibres in the plane of the test, at angles phi and -phi from axis 1; the sum over families of W(I1, I4).

    I4 = C11 cos^2 phi + C22 sin^2 phi + 2 C12 sin phi cos phi is the squared stretch along a family. A subclass writes
    `fibre_energy` of one family, zero with its first derivative where the fibres are at rest, and names its parameters,
    the angle phi (radians) last. Fibres are part of a sum, beside an isotropic matrix.

    Parameters
    ----------
    families : int
        Two, symmetric about axis 1, or one at phi.
    degrees : float, optional
        The angle where it is known; phi is then no parameter.

    Raises
    ------
    ModelError
        When there are not one or two families, or the angle is not from 0 to 90 degrees.
    """

    families: int = 2
    degrees: float | None = None

    form = "exponential-fibres:one@30 (one family of fibres, not two; at 30 degrees, a known angle; any law of fibres)"
    is_isotropic = False
    needs_matrix = True

    def __post_init__(self) -> None:
        if self.families not in (1, 2):
            raise ModelError(f"material '{self.name}' has one family of fibres or two, not {self.families}.")
        if self.degrees is not None and not 0 <= self.degrees <= 90:
            raise ModelError(f"the fibres of '{self.name}' lie at 0 to 90 degrees from axis 1, not {self.degrees:g}.")
        if (self.families, self.degrees) == (2, None):
            return
        known = self.parameters if self.degrees is None else self.parameters[:-1]
        name = f"{self.name}{':one' if self.families == 1 else ''}"
        name += f"@{self.degrees:.15g}" if self.degrees is not None else ""
        parameters = tuple(replace(each, description=f"{each.description} ({name})") for each in known)
        for attribute, value in (("name", name), ("parameters", parameters)):
            object.__setattr__(self, attribute, value)

    @classmethod
    def named(cls, name: str) -> FibreMaterial | None:
        """Return the fibres of a name such as ``exponential-fibres:one@30``; None for other names."""
        match = NAME.fullmatch(name)
        if match is None or not (match["one"] or match["degrees"]) or match["law"] not in variants(FibreMaterial):
            return None
        degrees = None if match["degrees"] is None else float(match["degrees"])
        return variants(FibreMaterial)[match["law"]](1 if match["one"] else 2, degrees)

    @abstractmethod
    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        """Return the energy (MPa) of one family for parameter values without the angle: plain arithmetic."""

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        raise ModelError(f"material '{self.name}' has fibres: its energy is not known from I1 and I2, use energy_of.")

    def energy(self, stretches: tuple[Any, Any, Any], values: Any) -> Any:
        raise ModelError(f"material '{self.name}' has fibres: its energy is not known from stretches, use energy_of.")

    def energy_of(self, deformation: Deformation, values: Any) -> Any:
        if problem := self.why_not(deformation):
            raise ModelError(problem)
        I1 = sum(stretch * stretch for stretch in deformation.stretches)
        first, second, both = deformation.plane
        if self._is_along_axis:
            return self.fibre_energy(I1, first, values)
        own, angle = (values[:-1], values[-1]) if self.degrees is None else (values, radians(self.degrees))
        across, along = sin(angle), cos(angle)
        I4 = 1 + (first - 1) * along**2 + (second - 1) * across**2
        tilt = 2 * both * across * along
        signs = (1, -1)[: self.families]
        return sum(self.fibre_energy(I1, I4 + sign * tilt, own) for sign in signs)

    def why_not(self, deformation: Deformation) -> str:
        if all(each is not None for each in deformation.plane[: 1 if self._is_along_axis else 3]):
            return ""
        return (
            f"material '{self.name}' has fibres, and this loading mode says how the specimen deforms only of an "
            "isotropic material: give both stresses of 'biaxial' instead of 'equibiaxial'; 'uniaxial' is for one "
            "family along the axis (:one@0), as otherwise the lateral stretches differ and depend on the parameters."
        )

    @property
    def _is_along_axis(self) -> bool:
        return (self.families, self.degrees) == (1, 0)
