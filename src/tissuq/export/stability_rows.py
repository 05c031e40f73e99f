"""Stability and rising stress of a material that is linear in its parameters, as inequalities of these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray, FloatArray
from tissuq.experiments.modes import States, curve_modes
from tissuq.export.states import SeenStates
from tissuq.mechanics import Material, stress_basis
from tissuq.mechanics.invariants import MeasuredStates, farthest_stretch
from tissuq.mechanics.rays import through

Inequalities = tuple[FloatArray, FloatArray]
"""Rows (m, k) and bounds (m,): rows x >= bounds."""

LODE_ANGLES = (0.0, 15.0, 30.0, 45.0, 60.0)
MODE_ANGLES = (0.0, 30.0, 60.0)
"""Degrees: those of uniaxial, planar and equibiaxial tests are among them."""
POINTS_PER_SIDE = 40
"""Stretches of a loading mode on either side of the reference."""
LOG_STEP = 1e-4
DIRECTIONS = np.array([[1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]]) / np.sqrt([[2.0], [6.0]])
"""Orthonormal logarithmic strains without change of volume."""
MIN_TANGENT = 0.01
"""Smallest stiffness in a state, as a share of that at the reference."""
MIN_SLOPE = 0.003
"""Smallest slope of an engineering stress, as a share of the initial shear modulus."""


class StabilityStates:
    """States in which stability is asked for, and the Hessian of an energy there.

    Attributes
    ----------
    max_invariants : (float, float)
        The largest I1 - 3 and I2 - 3.
    is_along_mode : (n,) array of bool
        States of uniaxial, equibiaxial and planar tests.
    """

    def __init__(self, max_invariants: tuple[float, float]) -> None:
        self.max_invariants = max_invariants
        self.logs = SeenStates(max_invariants, LODE_ANGLES).logs
        self.is_along_mode = np.isin(np.repeat(LODE_ANGLES, len(self.logs) // len(LODE_ANGLES)), MODE_ANGLES)

    @property
    def nudged(self) -> States:
        """States around these, each with the work along both `DIRECTIONS`, from which `hessian` follows."""
        nudges = [sign * LOG_STEP * direction for direction in DIRECTIONS for sign in (1, -1)]
        logs = np.concatenate([self.logs + nudge for nudge in nudges for _ in DIRECTIONS])
        return through(logs, np.repeat(np.tile(DIRECTIONS, (len(nudges), 1)), len(self.logs), axis=0))

    def hessian(self, stress: FloatArray) -> FloatArray:
        """Return the Hessians, 11, 22 and 12, (3, n, k), of energies from their stresses (8 n, k) in `nudged`."""
        by_nudge = stress.reshape(2, 2, 2, len(self.logs), -1)  # nudged axis, sign, rate
        rates = (by_nudge[:, 0] - by_nudge[:, 1]) / (2 * LOG_STEP)
        return np.stack([rates[0, 0], rates[1, 1], (rates[0, 1] + rates[1, 0]) / 2])


def least_eigenvalues(hessian: FloatArray) -> FloatArray:
    """Return the smaller eigenvalues of symmetric matrices, 11, 22 and 12 along the first axis."""
    along_1, along_2, mixed = hessian
    return np.asarray((along_1 + along_2) / 2 - np.hypot((along_1 - along_2) / 2, mixed))


def wanted_stiffness(
    states: StabilityStates, is_beyond: BoolArray, least_stiffness: FloatArray, modulus: float
) -> FloatArray:
    """Return the smallest stiffness (n,) that a law may have in states, where a draw has the least one (n,), MPa.

    A hundredth of that at the reference, and beyond the measured range in the tests' loading modes no less. Elsewhere a
    law may be as soft as twice the draw is: draws are known to be stable in these modes alone.
    """
    share = 2 * MIN_TANGENT * modulus
    half = np.where(least_stiffness > 0, 0.5, 2.0) * least_stiffness
    return np.where(is_beyond & states.is_along_mode, share, np.minimum(share, half))


@dataclass(frozen=True, eq=False)
class StabilityRows:
    """What unit linear parameters (k) add to the stiffness in states, and to the slope of the stress in loading modes.

    A material is stable where its energy is convex in the logarithmic strains (Drucker's condition, with which the
    greater principal stress is along the greater stretch: Baker and Ericksen's).

    Attributes
    ----------
    tangents : (3, n, k) array
        The Hessian of the energy in the plane of logarithmic strains without change of volume: 11, 22 and 12.
    slopes : (m, k) array
        Of the engineering stresses of the loading modes of one stretch.
    """

    tangents: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, material: Material, setting: ArrayLike, states: StabilityStates) -> StabilityRows:
        """Return the rows of a material with given other parameters in states, and in loading modes as far as these."""
        tangents = states.hessian(stress_basis(material, states.nudged, setting))
        slopes = []
        for mode in curve_modes():
            ends = (farthest_stretch(mode, MeasuredStates(*states.max_invariants), side) for side in (-1, 1))
            stretch = np.concatenate([np.linspace(1.0, end, POINTS_PER_SIDE + 1)[1:] for end in ends])
            high, low = (stress_basis(material, mode.at(stretch + sign * LOG_STEP), setting) for sign in (1, -1))
            slopes.append((high - low) / (2 * LOG_STEP))
        return cls(tangents, np.concatenate(slopes))

    def broken(self, values: FloatArray, modulus: float, wanted: FloatArray) -> Inequalities:
        """Return the inequalities that parameters (k,) break, where these stiffnesses (n,) are wanted in the states.

        Of the stiffness they are those along its weakest direction in a state. A convex condition is the sum of all of
        them, so that parameters that break none of those which are asked for one after another are stable.
        """
        least_slope = MIN_SLOPE * modulus
        along_1, along_2, mixed = hessian = self.tangents @ values
        is_soft = least_eigenvalues(hessian) < wanted - 1e-6 * modulus
        angle = (np.arctan2(mixed, (along_1 - along_2) / 2)[is_soft] + np.pi) / 2
        weights = np.stack([np.cos(angle) ** 2, np.sin(angle) ** 2, 2 * np.sin(angle) * np.cos(angle)])
        tangent_rows = np.einsum("cn,cnk->nk", weights, self.tangents[:, is_soft])
        is_flat = self.slopes @ values < least_slope * (1 - 1e-6)
        rows = np.vstack([tangent_rows, self.slopes[is_flat]])
        return rows, np.concatenate([wanted[is_soft], np.full(int(is_flat.sum()), least_slope)])
