"""The nearest material of a family that finite-element codes know, where the draws are no material of their own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.modes import SimpleShear
from tissuq.export.draw_stresses import DrawStresses
from tissuq.export.laws import Law
from tissuq.export.nearest_law import Candidate, nearest_values, squared_distance
from tissuq.export.stability_rows import StabilityRows
from tissuq.export.states import SHEARS, PrincipalStates, initial_slope
from tissuq.mechanics import Material, stress_basis
from tissuq.mechanics.laws import Ogden, Rivlin

LADDER = (-4, -3, -2, -1, 1, 2, 3, 4)
"""Multiples of one step among which Ogden's exponents are chosen."""
SINGLE_TERM_LADDER = tuple(step / 16 for step in range(-64, 65) if step)
"""The same for a single Ogden term, which needs a finer step."""
EXPONENT_REACHES = (2.0, 4.0, 8.0, 12.0)
"""The largest exponent of the ladder, times the largest logarithmic strain that was measured."""
MAX_ORDER = 4
"""Order of a polynomial of both invariants, beyond which terms cancel to their last digits at small strains."""
MAX_REDUCED_ORDER = 6
"""Order of a polynomial of I1, beyond which no code goes."""

COMMON_WEIGHT_BEYOND = 0.1
"""Weight of states beyond the measured ones where exponents are chosen, which all draws share."""


@dataclass(frozen=True)
class Projection(ABC):
    """A family of materials of some order, of which the one nearest to a draw is found by weighted least squares.

    The stresses are those of the states that were measured and, with smaller weights, of those up to 1.5 times as large
    invariants; each is relative to the draw's own. The initial shear modulus is exactly the draw's, and a law for a
    stable draw is stable and its stresses rise up to there.
    """

    family: ClassVar[str]

    @classmethod
    @abstractmethod
    def of_order(cls, order: int) -> Self:
        """Return the projection of an order that a user gave."""

    @property
    @abstractmethod
    def order(self) -> int:
        """The order, as a user gives it."""

    @property
    @abstractmethod
    def material(self) -> Material:
        """The material whose values are found."""

    def candidates(self, states: PrincipalStates) -> Iterator[Candidate]:
        """Return the values of the parameters that are not linear, among which the best are taken for all draws."""
        yield Candidate((), *_columns(self.material, states, ()))

    def law(self, draws: DrawStresses) -> Law:
        """Return the nearest law to each draw.

        Candidates are compared with weights that all draws share; given the best, every draw has its own.
        """
        wanted, is_beyond = draws.of_states, draws.shell > 0
        is_borne = np.isfinite(wanted.stress).all(axis=0)
        common = np.where(
            is_borne, np.where(is_beyond, COMMON_WEIGHT_BEYOND, 1.0) / draws.size_in_fits.mean(axis=0), 0.0
        )
        stress = np.where(is_borne, wanted.stress, 0.0)

        def loss(candidate: Candidate) -> float:
            return squared_distance(candidate, common, stress.T, draws.modulus)

        best = min(self.candidates(draws.states), key=loss)
        rows = StabilityRows.of(self.material, best.setting, draws.stability_states)
        values = np.array([nearest_values(best, rows, draws, number) for number in range(len(draws.ensemble))])
        return Law(self.material, np.hstack([values, np.tile(best.setting, (len(values), 1))]))


@dataclass(frozen=True)
class PolynomialFit(Projection):
    """A Rivlin polynomial of some terms."""

    terms: tuple[str, ...]

    family = "polynomial"

    @classmethod
    def of_order(cls, order: int) -> Self:
        return cls(full_terms(_checked(order, MAX_ORDER, "a polynomial")))

    @property
    def order(self) -> int:
        return max(int(term[1]) + int(term[2]) for term in self.terms)

    @property
    def material(self) -> Material:
        return Rivlin(self.terms)


class ReducedFit(PolynomialFit):
    """A polynomial of I1 alone, such as Yeoh's."""

    family = "reduced-polynomial"

    @classmethod
    def of_order(cls, order: int) -> Self:
        return cls(reduced_terms(_checked(order, MAX_REDUCED_ORDER, "a reduced polynomial")))


@dataclass(frozen=True)
class OgdenFit(Projection):
    """An Ogden sum, with exponents in equal steps to either side of zero, the same for all draws."""

    terms: int

    family = "ogden"

    @classmethod
    def of_order(cls, order: int) -> Self:
        return cls(_checked(order, len(LADDER), "an Ogden projection"))

    @property
    def order(self) -> int:
        return self.terms

    @property
    def material(self) -> Material:
        return Ogden(self.terms)

    def candidates(self, states: PrincipalStates) -> Iterator[Candidate]:
        return _on_ladders(self.terms, states)


class MixtureFit(OgdenFit):
    """A polynomial of I1 and an Ogden sum added, each of so many terms, for a code that adds materials."""

    family = "mixture"

    @classmethod
    def of_order(cls, order: int) -> Self:
        return cls(_checked(order, MAX_REDUCED_ORDER, "a mixture"))

    @property
    def material(self) -> Material:
        return Rivlin(reduced_terms(self.terms)) + Ogden(self.terms)

    def candidates(self, states: PrincipalStates) -> Iterator[Candidate]:
        polynomial, polynomial_moduli = _columns(Rivlin(reduced_terms(self.terms)), states, ())
        for ogden in super().candidates(states):
            unit_moduli = np.concatenate([polynomial_moduli, ogden.unit_moduli])
            yield Candidate(ogden.setting, np.hstack([polynomial, ogden.columns]), unit_moduli)


def projections() -> dict[str, type[Projection]]:
    """Return the families by name."""
    return {kind.family: kind for kind in (ReducedFit, PolynomialFit, OgdenFit, MixtureFit)}


def full_terms(order: int) -> tuple[str, ...]:
    """Return the coefficients of a polynomial in I1 and I2 as FE codes order them: C10, C01, C20, C11, C02 ..."""
    return tuple(f"C{total - power}{power}" for total in range(1, order + 1) for power in range(total + 1))


def reduced_terms(order: int) -> tuple[str, ...]:
    """Return the coefficients of a polynomial in I1: C10, C20 and so on."""
    return tuple(f"C{power}0" for power in range(1, order + 1))


def _checked(order: int, max_order: int, kind: str) -> int:
    if not 1 <= order <= max_order:
        raise InputError(f"{kind} has an order from 1 to {max_order}, not {order}.")
    return order


def _on_ladders(terms: int, states: PrincipalStates) -> Iterator[Candidate]:
    """Return Ogden sums of so many terms, with all choices of exponents from each ladder."""
    max_log_strain = float(np.abs(np.log(states.base)).max())
    ladder = np.array(SINGLE_TERM_LADDER if terms == 1 else LADDER, dtype=np.float64)
    for reach in EXPONENT_REACHES:
        exponents = reach / (ladder[-1] * max_log_strain) * ladder
        blocks = [_columns(Ogden(len(LADDER)), states, block) for block in exponents.reshape(-1, len(LADDER))]
        columns, unit_moduli = (np.concatenate(arrays, axis=-1) for arrays in zip(*blocks, strict=True))
        for selection in map(list, combinations(range(len(ladder)), terms)):
            yield Candidate(tuple(exponents[selection]), columns[:, selection], unit_moduli[selection])


def _columns(material: Material, states: PrincipalStates, setting: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the stresses (n, k) and the initial shear moduli (k,), integers, of unit linear parameters."""
    shear_stress = stress_basis(material, SimpleShear().at(SHEARS), setting)
    return stress_basis(material, states.at(states.points), setting), np.round(initial_slope(shear_stress), 4)
