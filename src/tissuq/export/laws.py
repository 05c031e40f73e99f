"""Draws as one closed law with other values for each, where they are one: what a finite-element code may know."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from tissuq.ensemble import EnergyDraw, Ensemble
from tissuq.mechanics import Material
from tissuq.mechanics.materials import (
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

__all__ = ["Law", "exact_law", "parts_of"]

FloatArray = NDArray[np.float64]

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
        draws = tuple(EnergyDraw(place, ((self.material, row),), None) for place, row in enumerate(rows))
        return replace(like, draws=draws)

    def scaled(self, factor: float) -> Law:
        """Return the same law in a unit of stress of which one MPa is ``factor``."""
        is_stress = np.array([parameter.unit == "MPa" for parameter in self.material.parameters])
        return Law(self.material, self.values * np.where(is_stress, factor, 1.0))


def exact_law(ensemble: Ensemble) -> Law | None:
    """Return the one law that all draws are, exactly; None where they have a free energy, or are no such sum.

    Polynomials add up to a Rivlin polynomial, Ogden terms (with those of Mooney and Rivlin, if any) to an Ogden sum;
    any other material stands alone.
    """
    if any(draw.discrepancy is not None for draw in ensemble):
        return None
    parts = list(parts_of(ensemble))
    if all(isinstance(material, POLYNOMIALS) for material, _ in parts):
        return _polynomial(parts)
    terms = [_ogden_terms(material, values) for material, values in parts]
    if all(each is not None for each in terms):
        moduli, exponents = (np.hstack([each[k] for each in terms if each is not None]) for k in (0, 1))
        return Law(Ogden(moduli.shape[1]), np.hstack([moduli, exponents]))
    return Law(*parts[0]) if len(parts) == 1 else None


def parts_of(ensemble: Ensemble) -> Iterator[tuple[Material, FloatArray]]:
    """Return the materials that draws are sums of, one by one, with their values (N, k)."""
    for place, (material, _) in enumerate(ensemble[0].parts):
        values = np.array([draw.parts[place][1] for draw in ensemble])
        own = material.parts if isinstance(material, MaterialSum) else (material,)
        ends = pairwise(accumulate((len(each.parameters) for each in own), initial=0))
        yield from ((each, values[:, start:end]) for each, (start, end) in zip(own, ends, strict=True))


def _polynomial(parts: list[tuple[Material, FloatArray]]) -> Law:
    """Return the sum of polynomials, its terms by their order and then by the power of I1 - 3, the highest first."""
    found: dict[str, FloatArray] = {}
    for material, values in parts:
        for parameter, column in zip(material.parameters, values.T, strict=True):
            found[parameter.symbol] = found.get(parameter.symbol, 0.0) + column
    terms = sorted(found, key=lambda term: (int(term[1]) + int(term[2]), int(term[2])))
    return Law(Rivlin(tuple(terms)), np.stack([found[term] for term in terms], axis=1))


def _ogden_terms(material: Material, values: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Return moduli and exponents (N, n) of the Ogden terms that a material is, or None."""
    if isinstance(material, OGDEN):
        first, second = np.split(values, 2, axis=1)
        return first, second
    symbols = [parameter.symbol for parameter in material.parameters]
    if isinstance(material, POLYNOMIALS) and set(symbols) <= set(MOONEY):
        return 2 * values, np.broadcast_to([MOONEY[symbol] for symbol in symbols], values.shape)
    return None
