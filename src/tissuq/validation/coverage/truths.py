"""True materials of a campaign: random members of families, and materials that are the same in every replicate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode
from tissuq.validation.coverage import laws
from tissuq.validation.coverage.laws import Law

__all__ = ["FAMILIES", "FIXED", "FURTHER", "MIN_LOCKING_LIMIT", "TRUTHS", "Truth", "draw_truth"]

Generator = np.random.Generator

MIN_LOCKING_LIMIT = 20.0
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
    "gent": lambda generator: laws.gent(generator.uniform(MIN_LOCKING_LIMIT, 60)),
    "demiray": lambda generator: laws.demiray(generator.uniform(0.02, 0.25)),
    "knowles": lambda generator: laws.knowles(generator.uniform(0.6, 1.6), generator.uniform(0.1, 1)),
    "arruda-boyce": lambda generator: laws.arruda_boyce(generator.uniform(8, 30)),
    "veronda-westmann": lambda generator: laws.veronda_westmann(generator.uniform(0.02, 0.2)),
    "coupled": lambda generator: laws.coupled(0.05 * abs(generator.standard_normal())),
}
"""Laws with random parameters, by name."""

FURTHER: dict[str, Callable[[Generator], Law]] = {
    "gent-gent": lambda generator: laws.gent_gent(generator.uniform(MIN_LOCKING_LIMIT, 60), generator.uniform(0, 0.5)),
    "carroll": lambda generator: laws.carroll(generator.uniform(0, 0.1), generator.uniform(0, 0.4)),
    "exp-ln": lambda generator: laws.exp_ln(generator.uniform(0.02, 0.15), generator.uniform(0, 0.3)),
    "hart-smith": lambda generator: laws.hart_smith(generator.uniform(5e-4, 5e-3), generator.uniform(0, 0.5)),
    "lopez-pamies": lambda generator: laws.lopez_pamies(*generator.uniform([0.6, 1.5, 0.0], [1.2, 4.0, 0.3])),
    "recruitment": lambda generator: laws.recruitment(generator.uniform(0.2, 2), generator.uniform(0.2, 2)),
}
"""Families on which no default was chosen."""


FloatArray = NDArray[np.float64]

C10_SPREAD = 0.5
"""Standard deviation of log C10 (MPa), where no scale is given."""

FIXED: dict[str, tuple[float, Law]] = {
    "paper-yeoh": (1.2, laws.yeoh(-0.057 / 1.2, 0.004 / 1.2)),
    "fixed-neo-hookean": (1.0, laws.neo_hookean()),
    "fixed-mooney-rivlin": (1.0, laws.mooney_rivlin(0.3)),
    "fixed-ogden": (1.0, laws.ogden((1.0, 3.0))),
    "fixed-gent": (1.0, laws.gent(30.0)),
    "fixed-demiray": (1.0, laws.demiray(0.1)),
    "fixed-knowles": (1.0, laws.knowles(0.75, 0.5)),
}
"""C10 (MPa) and law of materials of which there is one each; the first is that of Zeraatpisheh et al. (2021)."""

TRUTHS = (*FAMILIES, *FIXED, *FURTHER)
"""The names of all families and fixed materials."""


@dataclass(frozen=True, eq=False)
class Truth:
    """A material: C10 (half its initial shear modulus, MPa), and its law."""

    C10: float
    law: Law

    def stress(self, mode: LoadingMode, stretch: FloatArray) -> FloatArray:
        """Return the engineering stress (n,), MPa."""
        return self.C10 * self.law(mode, stretch)

    def nearer(self, strength: float) -> Truth:
        """Return the material between the neo-Hookean one with the same C10 (strength zero) and this one (one)."""
        law, plain = self.law, laws.neo_hookean()
        return Truth(self.C10, lambda mode, points: strength * law(mode, points) + (1 - strength) * plain(mode, points))


def draw_truth(name: str, seed: tuple[int, ...], scale: Sequence[float] = ()) -> Truth:
    """Return the member of a family that a seed fixes, or a fixed material.

    C10 of a random member is log-normal about 1 MPa, or log-uniform between the ends of a scale (MPa).
    """
    if name in FIXED:
        return Truth(*FIXED[name])
    generator = np.random.default_rng(seed)
    log_C10 = generator.uniform(*np.log(scale)) if scale else C10_SPREAD * generator.standard_normal()
    return Truth(float(np.exp(log_C10)), (FAMILIES | FURTHER)[name](generator))
