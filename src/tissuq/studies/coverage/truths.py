"""True materials of a campaign: random members of families, and materials that are the same in every replicate.

Everything follows from the seed, so that every worker draws the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tissuq.experiments.modes import LoadingMode
from tissuq.studies.coverage import laws
from tissuq.studies.coverage.families import FAMILIES, FURTHER
from tissuq.studies.coverage.laws import Law

__all__ = ["FIXED", "TRUTHS", "Truth", "draw_truth"]

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
        own, plain = self.law, laws.neo_hookean()
        return Truth(self.C10, lambda mode, points: strength * own(mode, points) + (1 - strength) * plain(mode, points))


def draw_truth(name: str, seed: tuple[int, ...], scale: Sequence[float] = ()) -> Truth:
    """Return the member of a family that a seed fixes, or a fixed material.

    C10 of a random member is log-normal about 1 MPa, or log-uniform between the ends of a scale (MPa).
    """
    if name in FIXED:
        return Truth(*FIXED[name])
    generator = np.random.default_rng(seed)
    log_C10 = generator.uniform(*np.log(scale)) if scale else C10_SPREAD * generator.standard_normal()
    return Truth(float(np.exp(log_C10)), (FAMILIES | FURTHER)[name](generator))
