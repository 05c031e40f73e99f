"""A flat rigid punch is pressed into a disc of tissue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError
from tissuq.finite_elements.case import AXIAL, RADIAL, Case, Mesh, Supports, graded, grid

__all__ = ["Indentation"]

FloatArray = NDArray[np.float64]

Contact = Literal["bonded", "frictionless"]

SMALLEST_CELL, GROWTH = 0.05, 1.3
"""Size of the cells at the punch's edge with fineness 1, in punch radii, and ratio of neighbouring cells' sizes."""


@dataclass(frozen=True)
class Indentation(Case):
    """Indentation by a flat rigid punch along the axis of a disc that is glued to a rigid base.

    The tissue under the punch sticks to it, or slides on it without friction; which points touch it does not change, so
    that without friction the punch must not go deep. The rest of the surface is free. Strains are singular at the edge,
    as under any sharp punch: a finer mesh goes less deep.

    Attributes
    ----------
    depth, punch_radius, height, radius : float
        Sizes in mm. Defaults are those of tests of brain slices: a punch 1.5 mm wide, a slice 5 mm thick.
    contact : str
        ``"bonded"`` or ``"frictionless"``.
    fineness : float
        Twice as fine halves all cells.
    """

    name: ClassVar[str] = "indentation"
    description: ClassVar[str] = "a flat rigid punch in a disc of tissue on a rigid base"
    travel_name: ClassVar[str] = "depth"

    depth: float = 0.4
    punch_radius: float = 0.75
    height: float = 5.0
    radius: float = 7.5
    contact: Contact = "bonded"
    fineness: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contact not in get_args(Contact):
            contacts = " or ".join(get_args(Contact))
            raise InputError(f"case '{self.name}': contact must be {contacts}, not {self.contact!r}.")
        if self.depth >= self.height or self.punch_radius >= self.radius:
            raise InputError(
                f"case '{self.name}': the depth ({self.depth:g} mm) must be less than the height ({self.height:g} mm), "
                f"and the punch radius ({self.punch_radius:g} mm) less than the radius ({self.radius:g} mm)."
            )

    @property
    def travel(self) -> float:
        return self.depth

    def mesh(self) -> Mesh:
        a, smallest_cell, growth = (
            self.punch_radius,
            self.punch_radius * SMALLEST_CELL / self.fineness,
            GROWTH ** (1 / self.fineness),
        )
        inside, outside = graded(a, smallest_cell, growth), graded(self.radius - a, smallest_cell, growth)
        radial = np.concatenate([a - inside[::-1], a + outside[1:]])
        return grid(self.height - graded(self.height, smallest_cell, growth)[::-1], radial)

    def supports(self, points: FloatArray) -> Supports:
        axial, radial = points[:, AXIAL], points[:, RADIAL]
        tolerance = 1e-9 * self.radius
        base = axial < tolerance
        punch = (axial > self.height - tolerance) & (radial < self.punch_radius + tolerance)
        sticks = punch & (self.contact == "bonded")
        fixed = np.stack([base, base | (radial < tolerance) | sticks], axis=-1)
        return Supports(fixed, punch, -1.0)
