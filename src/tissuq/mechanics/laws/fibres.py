"""Fibres in the plane of a test, energies of I1 and of I4: the standard reinforcing model, Holzapfel's and Gasser's."""

from __future__ import annotations

import re
from abc import abstractmethod
from dataclasses import dataclass, replace
from math import inf, pi, radians
from typing import Any

from tissuq.errors import ModelError
from tissuq.experiments.modes import Deformation
from tissuq.mechanics.arithmetic import cos, expm1, positive_part, sin
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import LogUniform, Uniform
from tissuq.registry import variants

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
    felt_axes = (0, 1)

    def __post_init__(self) -> None:
        if self.families not in (1, 2):
            raise ModelError(f"material '{self.name}' has one family of fibres or two, not {self.families}.")
        if self.degrees is not None and not 0 <= self.degrees <= 90:
            raise ModelError(f"the fibres of '{self.name}' lie at 0 to 90 degrees from axis 1, not {self.degrees:g}.")
        if (self.families, self.degrees) == (2, None):
            return
        parameters = self.parameters if self.degrees is None else self.parameters[:-1]
        name = f"{self.name}{':one' if self.families == 1 else ''}"
        name += f"@{self.degrees:.15g}" if self.degrees is not None else ""
        parameters = tuple(replace(free, description=f"{free.description} ({name})") for free in parameters)
        self._describe(
            name=name,
            parameters=parameters,
            felt_axes=(0,) if self._is_along_axis else (0, 1),
            shears=self.families == 1 and self.degrees not in (0, 90),
        )

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
        return self.energy_in_plane(I1, deformation.plane, values)

    def energy_in_plane(self, I1: Any, plane: tuple[Any, Any, Any], values: Any) -> Any:
        """Return the energy (MPa) from I1 and C11, C22, C12 in the plane of the fibres."""
        C11, C22, C12 = plane
        if self._is_along_axis:
            return self.fibre_energy(I1, C11, values)
        law_values, angle = (values[:-1], values[-1]) if self.degrees is None else (values, radians(self.degrees))
        across, along = sin(angle), cos(angle)
        I4 = 1 + (C11 - 1) * along**2 + (C22 - 1) * across**2
        tilt = 2 * C12 * across * along
        signs = (1, -1)[: self.families]
        return sum(self.fibre_energy(I1, I4 + sign * tilt, law_values) for sign in signs)

    def why_not(self, deformation: Deformation) -> str:
        if all(component is not None for component in deformation.plane[: 1 if self._is_along_axis else 3]):
            return ""
        return (
            f"material '{self.name}' has fibres, and this loading mode says how the specimen deforms only of an "
            "isotropic material: give both stresses of 'biaxial' instead of 'equibiaxial'. In 'uniaxial' the lateral "
            "stretch depends on the stiffness of the fibres over that of their matrix: such a test is predicted for "
            "two families, or one along an axis (:one@0, :one@90), as one at an angle shears, too; and fitted where "
            "the matrix has one stiffness, as neo-hookean."
        )

    @property
    def _is_along_axis(self) -> bool:
        return (self.families, self.degrees) == (1, 0)


def _stiffness(symbol: str, law: str) -> Parameter:
    return Parameter(symbol, f"stiffness of {law} fibres", support=(0.0, inf))


def _rate(law: str) -> Parameter:
    description = f"how fast {law} fibres stiffen"
    return Parameter("k2", description, "rate", (0.0, inf), is_linear=False, relative_prior=LogUniform(0.01, 10.0))


def _angle(law: str) -> Parameter:
    description = f"angle of {law} fibres from axis 1, radians"
    return Parameter("phi", description, "number", (0.0, pi / 2), is_linear=False, relative_prior=Uniform(0.0, pi / 2))


CAUTION = (
    "Fibres have no stiffness at rest, so they are added to a matrix, whose initial shear modulus is that of the sum; "
    "in tension the stiffness is higher. Compressed fibres have neither stress nor energy. The two families lie at phi "
    "and -phi from axis 1, in radians (degrees in FEBio). One stress of one test hardly tells their angle from their "
    "stiffness: give the angle where it is known, as in exponential-fibres@30."
)


class StandardFibres(FibreMaterial):
    """W = k/2 sum over families of <I4 - 1>^2, the standard reinforcing model; <x> is x where positive, else 0.

    Where a family is stretched the tangent along it is 4 k more than that of the matrix. The sum with neo-Hooke is
    ``standard-reinforcing``. Differs from the sources, where fibres bear compression, too.
    """

    name = "standard-fibres"
    formula = "k/2 sum over families of <I4 - 1>^2"
    source = "Triantafyllidis & Abeyaratne 1983; Qiu & Pence 1997"
    caution = CAUTION
    parameters = (_stiffness("k", "quadratic"), _angle("quadratic"))

    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        return 0.5 * values[0] * positive_part(I4 - 1) ** 2


class ExponentialFibres(FibreMaterial):
    """W = k1/(2 k2) sum over families of (exp(k2 <I4 - 1>^2) - 1); <x> is x where positive, else 0.

    With neo-Hooke, C10 = c/2, it is the law of Holzapfel, Gasser and Ogden, ``holzapfel-gasser-ogden``. As k2 goes to
    zero it becomes `standard-fibres` with k = k1.
    """

    name = "exponential-fibres"
    formula = "k1/(2 k2) sum over families of (exp(k2 <I4 - 1>^2) - 1)"
    source = "Holzapfel, Gasser & Ogden 2000"
    caution = CAUTION
    parameters = (_stiffness("k1", "exponential"), _rate("exponential"), _angle("exponential"))

    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        k1, k2 = values
        return 0.5 * k1 / k2 * expm1(k2 * positive_part(I4 - 1) ** 2)


class DispersedFibres(FibreMaterial):
    """W = k1/(2 k2) sum over families of (exp(k2 <E>^2) - 1), E = kappa (I1 - 3) + (1 - 3 kappa) (I4 - 1).

    With neo-Hooke, C10 = c/2, it is the law of Gasser, Ogden and Holzapfel, ``gasser-ogden-holzapfel``. Without
    dispersion, kappa = 0, it is `exponential-fibres`; with kappa = 1/3 it is isotropic. Differs from the source, where
    fibres are off below I4 = 1 and the energy jumps there: here they are off where E is negative, as in Abaqus.
    """

    name = "dispersed-fibres"
    formula = "k1/(2 k2) sum over families of (exp(k2 <kappa (I1 - 3) + (1 - 3 kappa) (I4 - 1)>^2) - 1)"
    source = "Gasser, Ogden & Holzapfel 2006"
    caution = CAUTION
    parameters = (
        _stiffness("k1", "dispersed"),
        _rate("dispersed"),
        Parameter("kappa", "dispersion of the fibres", "number", (0.0, 1 / 3), False, Uniform(0.0, 1 / 3)),
        _angle("dispersed"),
    )

    def fibre_energy(self, I1: Any, I4: Any, values: Any) -> Any:
        k1, k2, kappa = values
        strain = kappa * (I1 - 3) + (1 - 3 * kappa) * (I4 - 1)
        return 0.5 * k1 / k2 * expm1(k2 * positive_part(strain) ** 2)
