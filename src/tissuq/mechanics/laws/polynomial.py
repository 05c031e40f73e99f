"""Rivlin polynomials: neo-Hookean, Mooney-Rivlin, Isihara, Biderman, Yeoh, and any other."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf
from typing import Any, Self

from tissuq.errors import ModelError
from tissuq.mechanics.material import Material
from tissuq.parameters.parameter import Parameter

C10 = Parameter("C10", "half the initial shear modulus of the neo-Hookean term", support=(0.0, inf))
C01 = Parameter("C01", "coefficient of I2 - 3")
C20 = Parameter("C20", "coefficient of (I1 - 3)^2")
C30 = Parameter("C30", "coefficient of (I1 - 3)^3")


class NeoHookean(Material):
    """W = C10 (I1 - 3); initial shear modulus 2 C10 (Zeraatpisheh et al. 2021, eq. 6)."""

    name = "neo-hookean"
    formula = "C10 (I1 - 3)"
    source = "Treloar 1943"
    parameters = (C10,)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return values[0] * (I1 - 3)


class MooneyRivlin(Material):
    """W = C10 (I1 - 3) + C01 (I2 - 3); initial shear modulus 2 (C10 + C01), so C10 alone is not the modulus."""

    name = "mooney-rivlin"
    formula = "C10 (I1 - 3) + C01 (I2 - 3)"
    source = "Mooney 1940, Rivlin 1948"
    caution = "The initial shear modulus is 2 (C10 + C01), so do not read C10 alone as half of it."
    parameters = (C10, C01)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        return values[0] * (I1 - 3) + values[1] * (I2 - 3)


class Yeoh(Material):
    """W = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3; initial shear modulus 2 C10."""

    name = "yeoh"
    formula = "C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3"
    source = "Yeoh 1993"
    parameters = (C10, C20, C30)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        x = I1 - 3
        return x * (values[0] + x * (values[1] + x * values[2]))


class Isihara(Material):
    """W = C10 (I1 - 3) + C01 (I2 - 3) + C20 (I1 - 3)^2; initial shear modulus 2 (C10 + C01)."""

    name = "isihara"
    formula = "C10 (I1 - 3) + C01 (I2 - 3) + C20 (I1 - 3)^2"
    source = "Isihara, Hashitsume & Tatibana 1951"
    caution = MooneyRivlin.caution
    parameters = (C10, C01, C20)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        x = I1 - 3
        return x * (values[0] + x * values[2]) + values[1] * (I2 - 3)


class Biderman(Material):
    """W = C10 (I1 - 3) + C01 (I2 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3; initial shear modulus 2 (C10 + C01)."""

    name = "biderman"
    formula = "C10 (I1 - 3) + C01 (I2 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3"
    source = "Biderman 1958"
    caution = MooneyRivlin.caution
    parameters = (C10, C01, C20, C30)

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        x = I1 - 3
        return x * (values[0] + x * (values[2] + x * values[3])) + values[1] * (I2 - 3)


@dataclass(frozen=True)
class Rivlin(Material):
    """W = sum of C_ij (I1 - 3)^i (I2 - 3)^j over some terms; initial shear modulus 2 (C10 + C01).

    Parameters
    ----------
    terms : tuple of str
        The coefficients, such as ``("C10", "C01", "C11")``, or ``rivlin:C10,C01,C11`` by name.

    Raises
    ------
    ModelError
        When a term is no coefficient, or comes twice.

    Examples
    --------
    >>> Rivlin(("C10", "C11")).formula
    'C10 (I1 - 3) + C11 (I1 - 3) (I2 - 3)'
    """

    terms: tuple[str, ...]

    form = "rivlin:C10,C01,C11 (any coefficients Cij of a Rivlin polynomial)"
    source = "Rivlin & Saunders 1951"

    def __post_init__(self) -> None:
        is_known = all(re.fullmatch(r"C(?!00)\d\d", term) for term in self.terms)
        if not self.terms or not is_known or len(set(self.terms)) < len(self.terms):
            raise ModelError(
                "a Rivlin polynomial needs its coefficients, each once, such as rivlin:C10,C01,C11 for C11 (I1 - 3) "
                f"(I2 - 3) beside Mooney and Rivlin's terms; it was given '{','.join(self.terms)}'."
            )
        products = {term: _product(*map(int, term[1:])) for term in self.terms}
        shared = {parameter.symbol: parameter for parameter in (C10, C01, C20, C30)}
        self._describe(
            name=f"rivlin:{','.join(self.terms)}",
            formula=" + ".join(f"{term} {product}" for term, product in products.items()),
            caution=MooneyRivlin.caution if "C01" in self.terms else "",
            parameters=tuple(
                shared.get(term) or Parameter(term, f"coefficient of {product}") for term, product in products.items()
            ),
        )

    @classmethod
    def named(cls, name: str) -> Self | None:
        """Return the polynomial of a name such as ``rivlin:C10,C11``; None for other names."""
        family, _, terms = name.partition(":")
        return cls(tuple(term.strip() for term in terms.split(","))) if family == "rivlin" else None

    def strain_energy(self, I1: Any, I2: Any, values: Any) -> Any:
        x, y = I1 - 3, I2 - 3
        return sum(values[k] * x ** int(term[1]) * y ** int(term[2]) for k, term in enumerate(self.terms))


def _product(power_1: int, power_2: int) -> str:
    powers = (("I1", power_1), ("I2", power_2))
    return " ".join(f"({invariant} - 3)" + (f"^{power}" if power > 1 else "") for invariant, power in powers if power)
