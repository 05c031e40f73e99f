"""Families of true materials, half of which the library cannot fit: random members, from a generator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tissuq.studies.coverage import laws
from tissuq.studies.coverage.laws import Law

__all__ = ["FAMILIES", "FURTHER", "LEAST_LIMIT"]

Generator = np.random.Generator

LEAST_LIMIT = 20.0
"""The smallest I1 - 3 at which a Gent material locks."""


def _yeoh(generator: Generator) -> Law:
    return laws.yeoh(0.05 * generator.standard_normal(), 0.005 * abs(generator.standard_normal()))


def _ogden_two(generator: Generator) -> Law:
    share = generator.uniform(0.2, 0.8)
    return laws.ogden((share, generator.uniform(1, 5)), (1 - share, -generator.uniform(1, 4)))


FAMILIES: dict[str, Callable[[Generator], Law]] = {
    "neo-hookean": lambda generator: laws.neo_hookean(),
    "mooney-rivlin": lambda generator: laws.mooney_rivlin(generator.uniform(0, 1)),
    "yeoh": _yeoh,
    "ogden": lambda generator: laws.ogden((1.0, generator.uniform(1, 6))),
    "ogden-negative": lambda generator: laws.ogden((1.0, -generator.uniform(1, 6))),
    "ogden-two": _ogden_two,
    "gent": lambda generator: laws.gent(generator.uniform(LEAST_LIMIT, 60)),
    "demiray": lambda generator: laws.demiray(generator.uniform(0.02, 0.25)),
    "knowles": lambda generator: laws.knowles(generator.uniform(0.6, 1.6), generator.uniform(0.1, 1)),
    "arruda-boyce": lambda generator: laws.arruda_boyce(generator.uniform(8, 30)),
    "veronda-westmann": lambda generator: laws.veronda_westmann(generator.uniform(0.02, 0.2)),
    "coupled": lambda generator: laws.coupled(0.05 * abs(generator.standard_normal())),
}
"""Laws with random parameters, by name."""

FURTHER: dict[str, Callable[[Generator], Law]] = {
    "gent-gent": lambda generator: laws.gent_gent(generator.uniform(LEAST_LIMIT, 60), generator.uniform(0, 0.5)),
    "carroll": lambda generator: laws.carroll(generator.uniform(0, 0.1), generator.uniform(0, 0.4)),
    "exp-ln": lambda generator: laws.exp_ln(generator.uniform(0.02, 0.15), generator.uniform(0, 0.3)),
    "hart-smith": lambda generator: laws.hart_smith(generator.uniform(5e-4, 5e-3), generator.uniform(0, 0.5)),
    "lopez-pamies": lambda generator: laws.lopez_pamies(*generator.uniform([0.6, 1.5, 0.0], [1.2, 4.0, 0.3])),
    "recruitment": lambda generator: laws.recruitment(generator.uniform(0.2, 2), generator.uniform(0.2, 2)),
}
"""Families on which no default was chosen."""
