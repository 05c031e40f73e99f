"""The wall of a tube under pressure and axial force: what stresses are in its middle where loads tell their means."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi, sqrt

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.experiments.reading.law_mixture import EVERY_LAW, LawMixture, not_negative

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
"""Of Gauss quadrature through the wall, from the outer to the inner face."""
MOST_ROWS = 400
"""Number of rows that a mixture is fitted to: of more every second, third ..."""
THICKEST = 0.5
"""Thickness over radius up to which the accuracy of stresses is tested."""
SAME_STRETCH = 0.01
"""Difference of axial stretches up to which they count as one."""
LARGEST_MISFIT = 0.5
"""Share of loads that no wall bears, from which a sign or a column is wrong."""
NOTABLE_MISFIT = 0.1
"""Share from which they are doubted."""
LITTLE_STRESS = 0.1
"""Share of the largest stress up to which the ratio of that in the middle to the mean says nothing."""
NOT_WIDER = "the tube is not wider where the pressure is larger: check which columns are read."
OTHER_SIGN = (
    "a wall bears a force of the other sign, and hardly this one. If the load cell counts tension as negative, give "
    "--turn load (in Python turn='load'), which turns the force alone."
)
NO_WALL = (
    "no wall bears such pressures and forces at such stretches: check the columns and their units, the sizes of the "
    "tube and its axial stretch."
)


@dataclass(frozen=True)
class Tube:
    """An undeformed tube with a wall that keeps its volume and does not twist; its radii in mm.

    With the hoop stretch l = r/R at an undeformed radius R and the axial stretch z, x = z l^2 - 1 is inversely
    proportional to R^2. With the energy W(l, z) of a volume, equilibrium under the pressure p inside and the force f
    with which the machine pulls in addition to the pressure on the closed ends (the reduced force) is

        z p / ln(B/A) = mean of (dW/dl)/l over ln R,
        f / (pi (B^2 - A^2)) = mean of dW/dz - l/(2 z) dW/dl over R^2.

    References
    ----------
    Haughton & Ogden (1979), J. Mech. Phys. Solids 27, 179 and 489.
    """

    inner: float
    outer: float

    @property
    def middle(self) -> float:
        """The radius of the middle of the wall, sqrt(AB)."""
        return sqrt(self.inner * self.outer)

    @property
    def relative_thickness(self) -> float:
        """The thickness over the radius of the middle of the wall."""
        return (self.outer - self.inner) / self.middle

    @property
    def note(self) -> str:
        """What to know of stresses in a wall that is thicker than tested; an empty text of others."""
        if self.relative_thickness <= THICKEST:
            return ""
        return (
            f"The wall is {self.relative_thickness:.2g} times as thick as the radius of its middle, beyond the "
            f"{THICKEST:g} up to which the stress there is known to be right within about 1 %."
        )

    @property
    def log_ratio(self) -> float:
        """ln(B/A), what the pressure is divided by."""
        return log(self.outer / self.inner)

    @property
    def section(self) -> float:
        """The undeformed cross-section of the wall, mm²."""
        return pi * (self.outer**2 - self.inner**2)

    def stretch(self, radius: FloatArray, undeformed: float, axial_stretch: FloatArray | float = 1.0) -> FloatArray:
        """Return the hoop stretch (n,) of the middle of the wall for radii (n,) of the face of an undeformed radius.

        l_z l^2 - 1 = (l_z r^2 - R^2)/(AB) for either face, as the wall keeps its volume.

        Raises
        ------
        InputError
            When the wall is thicker than such a tube.
        """
        square = (axial_stretch * radius**2 - undeformed**2) / self.middle**2
        if (square <= -self.inner / self.outer).any():
            narrowest = 2 * float(radius[np.argmin(square)])
            is_stretched = bool(np.any(np.asarray(axial_stretch) != 1))
            raise InputError(
                f"at a diameter of {narrowest:g} mm the inside of the tube would be closed: a wall of "
                f"{self.outer - self.inner:g} mm has the same "
                f"{'volume' if is_stretched else 'cross-section'} at every diameter. Check the undeformed "
                "diameter and the thickness of the wall (--diameter, --thickness), "
                f"{'the axial stretch, ' * is_stretched}and the unit of the column."
            )
        return np.asarray(np.sqrt((1 + square) / axial_stretch))

    def of_ends(self, hoop: FloatArray, axial: FloatArray, pressure: FloatArray) -> FloatArray:
        """Return the force of the pressure on the closed ends, pi a^2 p over the cross-section (n,), for p/ln(B/A)."""
        inner_square = (self.inner**2 + self.middle**2 * (axial * hoop**2 - 1)) / axial
        return np.asarray(pi * inner_square * pressure * self.log_ratio / self.section)

    def engineering_stresses(self, hoop: FloatArray, axial: FloatArray, loads: FloatArray) -> FloatArray:
        """Return the engineering stresses (k, n) in the middle of the wall: around it, and along it if k is 2.

        A mixture of laws, each with a modulus that is not negative, is fitted to the loads by least squares. What it
        has in the middle takes the place of its mean over the wall; what loads differ from it by goes with the
        stresses. A wall of a law in the mixture is exact.

        Parameters
        ----------
        hoop, axial : (n,) array, dimensionless
            Stretches of the middle of the wall.
        loads : (k, n) array, MPa
            The pressure over ln(B/A), and the reduced force over the cross-section.

        Raises
        ------
        InputError
            When no wall bears such loads.
        """
        laws, moduli, misfit = self._fitted(hoop, axial, loads)
        has_force = len(loads) > 1
        if has_force and misfit > NOTABLE_MISFIT and self._fitted(hoop, axial, loads * [[1], [-1]])[2] < misfit / 3:
            raise InputError(OTHER_SIGN)
        if misfit > LARGEST_MISFIT:
            raise InputError(NO_WALL if has_force else NOT_WIDER)
        means, in_middle = self._loads(hoop, axial, laws) @ moduli, laws.slopes(hoop, axial) @ moduli
        around = _moved(loads[0] * axial * hoop, means[0] * axial * hoop, in_middle[0])
        if not has_force:
            return around[None]
        along = loads[1] + hoop * around / (2 * axial)
        return np.stack([around, _moved(along, means[1] + hoop * in_middle[0] / (2 * axial), in_middle[1])])

    def doubt(self, hoop: FloatArray, axial: FloatArray, loads: FloatArray) -> str:
        """Return by how much loads (k, n) differ from those that a wall bears; an empty text where that is little.

        Pressure and force at all stretches follow from one energy, which those of another force or of another tube
        hardly do. A pressure alone tells nothing.
        """
        if len(loads) == 1 or (misfit := self._fitted(hoop, axial, loads)[2]) <= NOTABLE_MISFIT:
            return ""
        return (
            f"pressure and force differ by {100 * misfit:.0f} % from those that a wall of one elastic material bears "
            "at these stretches: check which force the file holds, units, the sizes of the tube, and its axial stretch."
        )

    def _fitted(self, hoop: FloatArray, axial: FloatArray, loads: FloatArray) -> tuple[LawMixture, FloatArray, float]:
        """Return the laws whose moduli are not zero, these, and the share of the loads that they leave."""
        thinned = slice(None, None, 1 + len(hoop) // MOST_ROWS)
        hoop, axial, loads = hoop[thinned], axial[thinned], loads[:, thinned]
        stresses = loads[0], loads[-1] + loads[0] * hoop**2 / 2  # a force may be little beside the pressure on the ends
        largest = np.array([np.abs(stress).max() for stress in stresses[: len(loads)]])[:, None]
        sizes = np.where(largest > 0, largest, largest.max() or 1.0)
        inside = np.sqrt((1 + (axial * hoop**2 - 1) * self.outer / self.inner) / axial)
        laws = EVERY_LAW.taken(EVERY_LAW.are_known(np.append(hoop, inside), np.append(axial, axial)))
        columns = (self._loads(hoop, axial, laws)[: len(loads)] / sizes[..., None]).reshape(loads.size, -1)
        moduli, misfit = not_negative(columns, (loads / sizes).ravel())
        return laws.taken(moduli > 0), moduli[moduli > 0], misfit

    def _loads(self, hoop: FloatArray, axial: FloatArray, laws: LawMixture) -> FloatArray:
        """Return the pressure over ln(B/A) and the force over the cross-section (2, n, k) of laws of modulus one."""
        depth = np.exp(self.log_ratio * NODES)  # AB/R^2
        through = np.sqrt((1 + (axial * hoop**2 - 1)[:, None] * depth) / axial[:, None])
        held = np.broadcast_to(axial[:, None], through.shape)
        around, along = laws.slopes(through, held)
        of_area = WEIGHTS * self.log_ratio * self.middle**2 / depth / (self.outer**2 - self.inner**2)
        pressure = np.einsum("nqk,nq->nk", around, WEIGHTS / 2 / (through * held))
        force = np.einsum("nqk,q->nk", along, of_area)
        return np.stack([pressure, force - np.einsum("nqk,nq->nk", around, of_area * through / (2 * held))])


def _moved(measured: FloatArray, mean: FloatArray, in_middle: FloatArray) -> FloatArray:
    """Return stresses in the middle of the wall for means over it, by those of a mixture that is fitted to them.

    What the mixture leaves of a mean is multiplied by its ratio of the two stresses, but made no larger, and left as it
    is where both are near zero.
    """
    little = max(LITTLE_STRESS * float(np.abs(mean).max()), np.finfo(float).tiny)
    ratio = np.minimum(np.hypot(in_middle, little) / np.hypot(mean, little), 1)
    return np.asarray(in_middle + ratio * (measured - mean))


def rows_at_each_stretch(axial_stretch: FloatArray) -> list[IndexArray]:
    """Return the rows at each axial stretch, of which those within a hundredth of one another are one."""
    order = np.argsort(axial_stretch, kind="stable")
    return np.split(order, 1 + np.flatnonzero(np.diff(axial_stretch[order]) > SAME_STRETCH))
