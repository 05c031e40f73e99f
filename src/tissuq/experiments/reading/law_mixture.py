"""A mixture of many laws that a wall may be of, each with a modulus that is not negative: their slopes, and its fit."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.experiments.modes.path import STEP

ANGLES, COUPLINGS = np.linspace(0, np.pi / 2, 19), (0.0, 0.5, 1.0)
RATES_OF_FIBRES, RATES_OF_MATRIX = np.geomspace(0.1, 60, 16), np.geomspace(0.1, 20, 10)
EXPONENTS = (3, 4, 5, 7, 9, 11, 14, 18)
STEEPEST = 30.0
"""Logarithm by which an exponential law may grow over a wall and a test: a steeper one follows single measurements."""


@dataclass(frozen=True, eq=False)
class LawMixture:
    """Strain energies of the hoop and the axial stretch: s, or (exp(rate s) - 1)/rate, where s is a sum of measures.

    Parameters
    ----------
    shares : (m, k) array
        What every measure has in the s of every law.
    rates : (k,) array
        Zero of a law that is s itself.
    """

    shares: FloatArray
    rates: FloatArray

    def taken(self, which: BoolArray) -> LawMixture:
        """Return some of the laws."""
        return LawMixture(self.shares[:, which], self.rates[which])

    def are_known(self, hoop: FloatArray, axial: FloatArray) -> BoolArray:
        """Tell of which laws (k,) measurements at some stretches (n,) can say more than at the last of them."""
        grown = np.stack(_measures(hoop, axial), axis=-1) @ self.shares * self.rates
        return np.asarray(grown.max(axis=0) <= STEEPEST)

    def slopes(self, hoop: FloatArray, axial: FloatArray) -> FloatArray:
        """Return the derivatives of the energies by the hoop and the axial stretch (2, ..., k), by a complex step."""
        grown = np.stack(_measures(hoop, axial), axis=-1) @ self.shares * self.rates
        factor = np.exp(np.minimum(grown, 2 * STEEPEST))
        moved = _measures(hoop + 1j * STEP, axial), _measures(hoop, axial + 1j * STEP)
        return np.stack([np.stack(measures, axis=-1).imag / STEP @ self.shares * factor for measures in moved])


@np.errstate(over="ignore", invalid="ignore")
def _measures(hoop: Any, axial: Any) -> list[Any]:
    """Return what energies are functions of, all zero in the undeformed wall."""
    a, b = hoop**2, axial**2
    first, second = a + b + 1 / (a * b) - 3, 1 / a + 1 / b + a * b - 3
    around, along = a - 1, b - 1
    powers = [hoop**k + axial**k + (hoop * axial) ** -float(k) - 3 for k in EXPONENTS]
    return [first, second, first**2, around**2, along**2, 2 * around * along, *powers]


def _every_law() -> LawMixture:
    alone = np.eye(len(_measures(1.0, 1.0)))
    laws = [(share, 0.0) for share in alone] + [(alone[0], rate) for rate in RATES_OF_MATRIX]
    for angle, coupling, rate in product(ANGLES, COUPLINGS, (0.0, *RATES_OF_FIBRES)):
        around, along = np.cos(angle), np.sin(angle)
        square = around**2 * alone[3] + along**2 * alone[4] + coupling * around * along * alone[5]
        laws.append((square, rate))
    shares, rates = zip(*laws, strict=True)
    return LawMixture(np.array(shares).T, np.array(rates))


EVERY_LAW = _every_law()
"""Neo-Hookean, Mooney-Rivlin, Ogden's and Demiray's laws, and Fung's, of whose exponents fibres have one.

That is a square form of Green's strains around and along the tube; where both are fully coupled it is the square of one
strain, as of two families of fibres at an angle to the axis.
"""


def not_negative(columns: FloatArray, measured: FloatArray) -> tuple[FloatArray, float]:
    """Return the factors (k,), none negative, with which columns (n, k) are nearest to what is measured (n,).

    And the misfit over the size of what is measured (root mean squares).
    """
    from scipy.optimize import nnls

    if not columns.size:  # with which SciPy's function ends the program
        return np.zeros(columns.shape[1]), 1.0
    lengths = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    factors, misfit = nnls(columns / lengths, measured)
    return factors / lengths, float(misfit) / max(float(np.linalg.norm(measured)), np.finfo(float).tiny)
