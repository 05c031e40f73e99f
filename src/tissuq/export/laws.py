"""Closed laws of draws, and the forms in which finite-element codes write strain energies."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.mechanics import Material
from tissuq.mechanics.laws import (
    Biderman,
    Isihara,
    MaterialSum,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    Ogden1,
    Ogden2,
    Ogden3,
    Rivlin,
    Yeoh,
)
from tissuq.posterior.ensemble import EnergyDraw, Ensemble

Constants = dict[str, float]

POLYNOMIALS = Biderman, Isihara, MooneyRivlin, NeoHookean, Rivlin, Yeoh
OGDEN = Ogden, Ogden1, Ogden2, Ogden3
MOONEY = {"C10": 2.0, "C01": -2.0}
"""Exponents of the Ogden terms that some terms of a polynomial are, with twice their coefficients as moduli."""


@dataclass(frozen=True, eq=False)
class Law:
    """A material of the library with values for each of N draws.

    Attributes
    ----------
    material : Material
    values : (N, k) array
        In the material's order, MPa.
    """

    material: Material
    values: FloatArray

    def ensemble(self, like: Ensemble) -> Ensemble:
        """Return the draws of this law in the place of others."""
        rows = (tuple(map(float, row)) for row in self.values)
        draws = tuple(EnergyDraw(number, ((self.material, row),), None) for number, row in enumerate(rows))
        return replace(like, draws=draws)

    @property
    def summands(self) -> list[Law]:
        """The laws that it is the sum of, or itself."""
        materials = summands(self.material)
        ends = np.cumsum([len(material.parameters) for material in materials])[:-1]
        return list(map(Law, materials, np.split(self.values, ends, axis=1)))

    def plus(self, law: Law) -> Law:
        """Return the sum of both."""
        return Law(MaterialSum.of(self.material, law.material), np.hstack([self.values, law.values]))

    def scaled(self, factor: float) -> Law:
        """Return the same law in a unit of stress of which one MPa is ``factor``."""
        is_stress = np.array([parameter.unit == "MPa" for parameter in self.material.parameters])
        return Law(self.material, self.values * np.where(is_stress, factor, 1.0))


def exact_law(ensemble: Ensemble) -> Law | None:
    """Return the one law that all draws are, exactly; None where they have a free energy, or are no such sum.

    Polynomials add up to a Rivlin polynomial, Ogden terms (with those of Mooney and Rivlin, if any) to an Ogden sum;
    any other material stands alone. Fibres are added to a polynomial.
    """
    return None if any(draw.discrepancy is not None for draw in ensemble) else sum_of(parts_of(ensemble))


def sum_of(laws: Sequence[Law]) -> Law | None:
    """Return the one law that laws add up to, as `exact_law` says, if there is one."""
    matrix, fibres = [law for law in laws if law.material.is_isotropic], fibres_among(laws)
    if all(isinstance(law.material, POLYNOMIALS) for law in matrix):
        return _polynomial(matrix) if fibres is None else _polynomial(matrix).plus(fibres)
    if fibres is not None:
        return None
    terms = [_ogden_terms(law.material, law.values) for law in laws]
    if all(term is not None for term in terms):
        moduli, exponents = (np.hstack([term[k] for term in terms if term is not None]) for k in (0, 1))
        return Law(Ogden(moduli.shape[1]), np.hstack([moduli, exponents]))
    return laws[0] if len(laws) == 1 else None


def matrix_and_fibres(ensemble: Ensemble) -> tuple[Ensemble, Law | None]:
    """Return draws without their fibres, discrepancy included, and the sum of these, if there are any."""
    laws = parts_of(ensemble)
    matrix = [law for law in laws if law.material.is_isotropic]
    draws = (
        replace(draw, parts=tuple((law.material, tuple(law.values[row])) for law in matrix))
        for row, draw in enumerate(ensemble)
    )
    return replace(ensemble, draws=tuple(draws)), fibres_among(laws)


def fibres_among(laws: Sequence[Law]) -> Law | None:
    """Return the sum of the fibres among laws, if there are any."""
    fibres = [law for law in laws if not law.material.is_isotropic]
    return reduce(Law.plus, fibres) if fibres else None


def parts_of(ensemble: Ensemble) -> list[Law]:
    """Return the laws that draws are sums of, one by one."""
    parts = (
        Law(material, np.array([draw.parts[index][1] for draw in ensemble]))
        for index, (material, _) in enumerate(ensemble[0].parts)
    )
    return [law for part in parts for law in part.summands]


def summands(material: Material) -> tuple[Material, ...]:
    """Return the materials that one is the sum of, or itself."""
    return material.summands if isinstance(material, MaterialSum) else (material,)


def _polynomial(laws: Sequence[Law]) -> Law:
    """Return the sum of polynomials, its terms by their order and then by the power of I1 - 3, the highest first."""
    coefficients: dict[str, FloatArray] = {}
    for law in laws:
        for parameter, column in zip(law.material.parameters, law.values.T, strict=True):
            coefficients[parameter.symbol] = coefficients.get(parameter.symbol, 0.0) + column
    terms = sorted(coefficients, key=lambda term: (int(term[1]) + int(term[2]), int(term[2])))
    return Law(Rivlin(tuple(terms)), np.stack([coefficients[term] for term in terms], axis=1))


def _ogden_terms(material: Material, values: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return moduli and exponents (N, n) of the Ogden terms that a material is, or None."""
    if isinstance(material, OGDEN):
        moduli, exponents = np.split(values, 2, axis=1)
        return moduli, exponents
    symbols = [parameter.symbol for parameter in material.parameters]
    if isinstance(material, POLYNOMIALS) and set(symbols) <= set(MOONEY):
        return 2 * values, np.broadcast_to([MOONEY[symbol] for symbol in symbols], values.shape)
    return None


@dataclass(frozen=True)
class Form(ABC):
    """A law in the notation of a code.

    Attributes
    ----------
    keyword : str
        What the code calls it.
    formula : str
        The isochoric part of its energy, in the constants of its card.
    """

    keyword: str
    formula: str

    @abstractmethod
    def holds(self, material: Material) -> bool:
        """Return whether every energy of that material can be written so, exactly."""

    @abstractmethod
    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        """Return the constants of the card by the names that the code gives them, in their order."""


@dataclass(frozen=True)
class PolynomialForm(Form):
    """A Rivlin polynomial with fixed places for its coefficients.

    Parameters
    ----------
    symbols : tuple of str
        The coefficients in the order of the card, as C10 and so on; those that the material has not are zero.
    names : tuple of str
        What the code calls them, where it is something else.
    factor : float
        The constants over the coefficients.
    """

    symbols: tuple[str, ...]
    names: tuple[str, ...] = ()
    factor: float = 1.0

    def holds(self, material: Material) -> bool:
        return isinstance(material, Rivlin) and set(material.terms) <= set(self.symbols)

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        coefficients = {parameter.symbol: value for parameter, value in zip(material.parameters, values, strict=True)}
        numbers = (self.factor * coefficients.get(symbol, 0.0) for symbol in self.symbols)
        return dict(zip(self.names or self.symbols, numbers, strict=True))


@dataclass(frozen=True)
class OgdenForm(Form):
    """A sum of Ogden terms.

    Parameters
    ----------
    min_terms, max_terms : int
        Numbers of terms between which it is right.
    modulus : callable
        From mu and alpha as they are here (factors 2 mu/alpha^2), the code's own constant.
    names : (str, str)
        What the code calls the two constants of a term, before their number.
    """

    min_terms: int
    max_terms: int
    modulus: Callable[[float, float], float]
    names: tuple[str, str] = ("mu", "alpha")

    def holds(self, material: Material) -> bool:
        return isinstance(material, Ogden) and self.min_terms <= material.terms <= self.max_terms

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        count = len(values) // 2
        pairs = enumerate(zip(values[:count], values[count:], strict=True), start=1)
        modulus_name, exponent_name = self.names
        constants: Constants = {}
        for number, (mu, alpha) in pairs:
            constants |= {f"{modulus_name}{number}": self.modulus(mu, alpha), f"{exponent_name}{number}": alpha}
        return constants


@dataclass(frozen=True)
class LibraryForm(Form):
    """A law of the library that the code has, too, under its own constants.

    Parameters
    ----------
    material : type of Material
    convert : callable
        From the material's values to the constants.
    """

    material: type[Material]
    convert: Callable[..., Constants]

    def holds(self, material: Material) -> bool:
        return isinstance(material, self.material)

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        return self.convert(*values)


@dataclass(frozen=True)
class MixtureForm(Form):
    """A sum of materials, each as a form writes it; its constants have the keyword of theirs before their names."""

    summands: tuple[Form, ...]

    def holds(self, material: Material) -> bool:
        if not isinstance(material, MaterialSum) or len(material.summands) != len(self.summands):
            return False
        return all(form.holds(summand) for form, summand in zip(self.summands, material.summands, strict=True))

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        constants: Constants = {}
        for form, law in zip(self.summands, Law(material, np.array([values])).summands, strict=True):
            of_summand = form.constants(law.material, tuple(map(float, law.values[0])))
            constants |= {f"{form.keyword}_{name}": value for name, value in of_summand.items()}
        return constants

    def of_summand(self, form: Form, constants: Mapping[str, float]) -> Constants:
        """Return the constants of one summand, by the names that its form gives them."""
        prefix = f"{form.keyword}_"
        return {name.removeprefix(prefix): value for name, value in constants.items() if name.startswith(prefix)}
