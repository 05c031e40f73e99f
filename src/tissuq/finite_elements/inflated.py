"""Bodies from files under a pressure that follows their surface: tubes, membranes, hollow organs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tissuq.errors import InputError
from tissuq.finite_elements.body_from_file import BodyFromFile
from tissuq.finite_elements.case import FloatArray, Inflation, Mesh, Supports
from tissuq.finite_elements.library import region_of
from tissuq.finite_elements.mesh_file import AXES

__all__ = ["InflatedBody"]

WITHOUT_PRESSURE = ("triangle6", "tetra10")
"""Cells whose faces FElupe has no pressure for."""


@dataclass(frozen=True)
class InflatedBody(BodyFromFile):
    """A body whose mesh is in a file, a part of its surface under pressure; it answers with a displacement.

    Parameters are those of `BodyFromFile`, but for these.

    Parameters
    ----------
    press : str
        The set of points whose faces are under pressure.
    distance : float
        The pressure, kPa.
    watch : str
        The set of points whose mean displacement, mm, is the answer.
    direction : str
        Its direction, ``"x"``, ``"y"`` or ``"z"``.

    Raises
    ------
    InputError
        As `BodyFromFile`, and for cells of triangles or tetrahedra.
    """

    name: ClassVar[str] = "inflated"
    description: ClassVar[str] = "a body whose mesh is in a file, under pressure"
    travel_name: ClassVar[str] = "pressure"
    travel_unit: ClassVar[str] = "kPa"
    response: ClassVar[str] = "displacement"
    response_unit: ClassVar[str] = "mm"

    watch: str = ""
    direction: str = "x"

    def __post_init__(self) -> None:
        super().__post_init__()
        mesh, _ = self._mesh_and_sets()
        if mesh.kind.meshio in WITHOUT_PRESSURE:
            raise InputError(f"a pressure cannot act on {mesh.kind.plural}; use quadrilaterals or hexahedra.")
        self._check_faces(mesh)

    def _check_faces(self, mesh: Mesh) -> None:
        """Refuse a set that has every face of the surface: a pressure all around only squeezes."""
        region = region_of(mesh, "Boundary", ensure_3d=not mesh.is_solid)
        if len(np.setdiff1d(region.mesh.cells_faces, self._found().sets[self.press])):
            return
        raise InputError(
            f"the set '{self.press}' holds all points of the surface of '{self.file}', so that the pressure would act "
            "all around the body: give --inflate the set of the points of the pressed faces alone, as a physical group "
            f"of Gmsh or an *NSET; the sets are {', '.join(sorted(self._found().sets))}."
        )

    def _check_pressed(self) -> None:
        axes = AXES[: self._found().points.shape[1]]
        if not self.direction or self.direction not in axes:
            raise InputError(
                f"the displacement of the set '{self.watch}' is along {', '.join(axes)}, not '{self.direction}'."
            )

    @property
    def _named(self) -> tuple[str, ...]:
        return (self.press, self.watch)

    def supports(self, points: FloatArray) -> Supports:
        fixed, sets = self._held(points), self._mesh_and_sets()[1]
        pressed, watched = np.zeros((2, len(points)), dtype=bool)
        pressed[sets[self.press]] = watched[sets[self.watch]] = True
        load = Inflation(pressed, watched, self._columns.index(AXES.index(self.direction)))
        return Supports(fixed, np.zeros(len(points), dtype=bool), float(np.sign(self.distance)), self.parts, load)
