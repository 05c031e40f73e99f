"""Lengths, areas and forces as laboratories write them, in mm, mm² and N."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from tissuq.errors import InputError
from tissuq.experiments.reading.layout import NUMBER

__all__ = ["AREA", "FORCE", "LENGTH", "MASSES", "Kind", "number_and_unit"]


MASSES = ("g", "kg")


@dataclass(frozen=True)
class Kind:
    """A kind of quantity: its name, the unit of the values here, and what other units are in it."""

    name: str
    unit: str
    factors: Mapping[str, float]

    def known(self, text: str) -> float | None:
        """Return what one unit of that name is in the unit of this kind; None when it is not one of this kind."""
        return self.factors.get(re.sub(r"[\s^]", "", text).replace("µ", "u").replace("μ", "u").replace("²", "2"))

    def factor(self, text: str) -> float:
        """Return what one unit of that name is in the unit of this kind.

        Raises
        ------
        InputError
            When it is not a unit of this kind.

        Examples
        --------
        >>> FORCE.factor("mN")
        0.001
        """
        factor = self.known(text)
        if factor is None and self.name == "force" and text in MASSES:
            raise InputError(f"'{text}' is a mass, not a force; if the unit of force is meant, write {text}f.")
        if factor is None:
            raise InputError(f"'{text}' is not a unit of {self.name}; write one of {', '.join(self.factors)}.")
        return factor

    def value(self, text: str) -> float:
        """Return a positive number with its unit, such as ``1.5 mm``, in the unit of this kind.

        Raises
        ------
        InputError
            When the number or its unit is missing, not positive, or not of this kind.

        Examples
        --------
        >>> LENGTH.value("1.5 cm")
        15.0
        """
        number, unit = number_and_unit(text)
        if number is None or number <= 0:
            raise InputError(f"'{text}' is not a {self.name}; write a positive number with its unit: '10 {self.unit}'.")
        if not unit:
            raise InputError(f"the {self.name} '{text}' has no unit; write it with one, such as '{text} {self.unit}'.")
        return number * self.factor(unit)


LENGTH = Kind("length", "mm", {"mm": 1.0, "cm": 10.0, "m": 1e3, "um": 1e-3, "in": 25.4})
AREA = Kind("area", "mm2", {f"{unit}2": factor**2 for unit, factor in LENGTH.factors.items()})
FORCE = Kind(
    "force",
    "N",
    {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605},
)


def number_and_unit(text: str) -> tuple[float | None, str]:
    """Return the number at the head of a text, if there is one, and what follows it."""
    match = re.fullmatch(rf"\s*({NUMBER.pattern})\s*\[?\(?([^\d\s\[\]()][^\s\[\]()]*)?[\])]?\s*", text)
    return (float(match[1].replace(",", ".")), match[2] or "") if match else (None, "")
