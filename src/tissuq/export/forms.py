"""How finite-element codes write strain energies: which laws a form holds, and the constants of its card."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tissuq.mechanics import Material
from tissuq.mechanics.materials import Ogden, Rivlin

__all__ = ["Constants", "Form", "OgdenForm", "OwnForm", "PolynomialForm"]

Constants = dict[str, float]


@dataclass(frozen=True)
class Form(ABC):
    """A law as a code knows it.

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
        known = {parameter.symbol: value for parameter, value in zip(material.parameters, values, strict=True)}
        numbers = (self.factor * known.get(symbol, 0.0) for symbol in self.symbols)
        return dict(zip(self.names or self.symbols, numbers, strict=True))


@dataclass(frozen=True)
class OgdenForm(Form):
    """A sum of Ogden terms.

    Parameters
    ----------
    fewest, most : int
        Numbers of terms between which it is right.
    modulus : callable
        From mu and alpha as they are here (factors 2 mu/alpha^2), the code's own constant.
    names : (str, str)
        What the code calls the two constants of a term, before their number.
    """

    fewest: int
    most: int
    modulus: Callable[[float, float], float]
    names: tuple[str, str] = ("mu", "alpha")

    def holds(self, material: Material) -> bool:
        return isinstance(material, Ogden) and self.fewest <= material.terms <= self.most

    def constants(self, material: Material, values: Sequence[float]) -> Constants:
        count = len(values) // 2
        pairs = enumerate(zip(values[:count], values[count:], strict=True), start=1)
        first, second = self.names
        found: Constants = {}
        for place, (mu, alpha) in pairs:
            found |= {f"{first}{place}": self.modulus(mu, alpha), f"{second}{place}": alpha}
        return found


@dataclass(frozen=True)
class OwnForm(Form):
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
