"""Cases of finite elements: a body of revolution or a solid, its mesh, what holds it and what moves it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from math import inf
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.registry import variants

AXIAL, ACROSS = 0, 1
"""Columns of points and displacements."""


def felupe() -> Any:
    """Return FElupe, imported when it is first needed.

    Raises
    ------
    InputError
        When it is not installed.
    """
    try:
        import felupe as library
    except ImportError as error:
        raise InputError(
            "finite elements need FElupe: install tissuq with its extra 'fe' (pip install 'tissuq[fe]')."
        ) from error
    return library


class CellKind(NamedTuple):
    """Cells of one form: their name in meshio, FElupe's region, their plural, and the corners of their faces."""

    meshio: str
    region: str
    plural: str
    faces: tuple[tuple[int, ...], ...]


QUAD, TRIANGLE = ((0, 1, 2, 3),), ((0, 1, 2),)
HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
CELL_KINDS = {
    (2, 4): CellKind("quad", "RegionQuad", "quadrilaterals", QUAD),
    (2, 8): CellKind("quad8", "RegionQuadraticQuad", "quadrilaterals of 8 points", QUAD),
    (2, 6): CellKind("triangle6", "RegionQuadraticTriangle", "triangles of 6 points", TRIANGLE),
    (3, 8): CellKind("hexahedron", "RegionHexahedron", "hexahedra", HEXAHEDRON),
    (3, 20): CellKind("hexahedron20", "RegionQuadraticHexahedron", "hexahedra of 20 points", HEXAHEDRON),
    (3, 10): CellKind("tetra10", "RegionQuadraticTetra", "tetrahedra of 10 points", TETRAHEDRON),
}
"""By dimensions and points of a cell; with one pressure a cell, linear triangles and tetrahedra would lock."""


class Mesh(NamedTuple):
    """Cells of one kind, in a half plane through the axis of a body of revolution, in a plane, or of a solid.

    Attributes
    ----------
    points : (n, 2) or (n, 3) array, mm
        Along the axis, and the distance from it; of solids also the height over the plane in which a section is shown.
    cells : (c, k) integer array
        Points of every cell in the order of VTK; those of `CELL_KINDS`.
    is_plane : bool
        Whether cells with two dimensions are of a body in plane strain, 1 mm thick, not of a body of revolution.
    is_half : bool
        Whether what lies on the other side of the axis is the mirror image.
    xyz : tuple of int
        The columns of points that are x, y and z in files; unless given, x is across, y along the axis.
    """

    points: FloatArray
    cells: IndexArray
    is_plane: bool = False
    is_half: bool = True
    xyz: tuple[int, ...] = ()

    @property
    def is_solid(self) -> bool:
        """Whether cells have three dimensions."""
        return bool(self.points.shape[1] == 3)

    @property
    def kind(self) -> CellKind:
        """The kind of its cells."""
        return CELL_KINDS[self.points.shape[1], self.cells.shape[1]]

    @property
    def parts(self) -> IndexArray:
        """The number (n,) of the part that a point is of: parts share no points with each other."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        first = np.repeat(self.cells[:, 0], self.cells.shape[1])
        links = coo_array((np.ones(len(first)), (first, self.cells.ravel())), shape=(len(self.points),) * 2)
        return np.asarray(connected_components(links, directed=False)[1], dtype=np.intp)

    def region(self, kind: str = "", **options: Any) -> Any:
        """Return FElupe's region of its cells, or one of a further kind, such as ``Boundary``, with its options."""
        library = felupe()
        cells = library.Mesh(self.points, self.cells, self.kind.meshio)
        return getattr(library, f"{self.kind.region}{kind}")(cells, **options)

    def field_on(self, region: Any) -> Any:
        """Return displacements on a region: of a solid, in plane strain, or around an axis."""
        library = felupe()
        if self.is_solid:
            return library.Field(region, dim=3)
        return (library.FieldPlaneStrain if self.is_plane else library.FieldAxisymmetric)(region, dim=2)

    def vectors(self, values: FloatArray) -> FloatArray:
        """Return points or displacements (n, 2 or 3) with the axes of files (n, 3), right-handed."""
        if self.xyz:
            return np.asarray(np.pad(values[:, self.xyz], ((0, 0), (0, 3 - len(self.xyz)))))
        height = values[:, 2] if self.is_solid else np.zeros(len(values))
        return np.stack([values[:, ACROSS], values[:, AXIAL], -height], axis=-1)

    @property
    def words(self) -> str:
        """What its cells are, as in a sentence."""
        return f"{'' if self.is_solid else 'plane ' if self.is_plane else 'axisymmetric '}{self.kind.plural}"

    @property
    def section_is(self) -> str:
        """What `section` is, as a sentence begins."""
        if self.is_half:
            return "A section through the axis"
        return "The body" if self.is_plane else "The side of the body across its thinnest direction"

    @property
    def section(self) -> tuple[IndexArray, IndexArray]:
        """Faces (p, 3 or 4) by their points that show a section, and the cells (p,) that they are of: the lowest."""
        faces = np.concatenate([self.cells[:, face] for face in self.kind.faces])
        lowest = self.points[:, 2:].min(axis=0)
        shown = np.isclose(self.points[faces, 2:], lowest, atol=1e-9 * float(np.ptp(self.points))).all(axis=(1, 2))
        return faces[shown], np.tile(np.arange(len(self.cells)), len(self.kind.faces))[shown]


class RigidTip(NamedTuple):
    """A smooth rigid body that is pressed against points, without friction: they may touch it or come off.

    Attributes
    ----------
    points : (n,) boolean array
        Points of the mesh that may touch it.
    start : float, mm
        Where its tip is at first, along the axis.
    radius : float, mm
        Of a sphere whose centre is on the axis; infinite: a plane across it.
    """

    points: BoolArray
    start: float
    radius: float = inf


class Inflation(NamedTuple):
    """A pressure on a part of the surface, which follows it.

    Attributes
    ----------
    points : (n,) boolean array
        Faces of which all points are among these are under pressure; the travel is the pressure, kPa.
    watched : (n,) boolean array
        Points whose mean displacement is the response.
    column : int
        Its direction, a column of the points.
    """

    points: BoolArray
    watched: BoolArray
    column: int


class Supports(NamedTuple):
    """What holds the body, and what moves it along the axis.

    Attributes
    ----------
    fixed : (n, 2) or (n, 3) boolean array
        Displacements that stay zero.
    moved : (n,) boolean array
        Points whose displacement along the axis is given; none where there is a load.
    direction : float
        1 or -1: along the axis or against it; less where symmetry leaves the points a part of the way.
    parts : float
        Number of such bodies, by symmetry, that bear the force side by side.
    load : RigidTip or Inflation, optional
        What is pressed against the body, or the pressure on it.
    """

    fixed: BoolArray
    moved: BoolArray
    direction: float
    parts: float = 1.0
    load: RigidTip | Inflation | None = None


@dataclass(frozen=True)
class Case(ABC):
    """A body of revolution, or a solid, that something moves along an axis, and the force that this needs.

    A new case is one subclass in one file: its sizes as fields, a mesh, and its supports. Everything that takes a case,
    figures and report included, then takes it. All lengths are in mm and positive, forces in N.
    Where a size is called ``fineness``, twice as much of it halves all cells.
    """

    entry_point_group: ClassVar[str] = "tissuq.cases"
    name: ClassVar[str]
    description: ClassVar[str]
    travel_name: ClassVar[str]
    """What the travel is called: a depth, an elongation; of a body under pressure that pressure."""
    travel_unit: ClassVar[str] = "mm"
    response: ClassVar[str] = "force"
    """What the body answers with: a force, or the displacement of points."""
    response_unit: ClassVar[str] = "N"
    mesh_order: ClassVar[int] = 1
    """Power of the size of the cells in which the force errs: one where strains are singular, as at sharp edges."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, str) and not 0 < value < inf:
                raise InputError(f"case '{self.name}': {field.name} must be a positive number, not {value!r}.")

    @property
    def travel(self) -> float:
        """How far the moved points go, mm, or the pressure, kPa: the size that `travel_name` is, unless overridden."""
        return float(getattr(self, self.travel_name))

    @property
    def travel_column(self) -> str:
        """The name of the travel in tables."""
        return f"{self.travel_name}_{self.travel_unit}"

    def shown(self, travel: float) -> str:
        """Return a travel as text, with its unit."""
        return f"{travel:.3g} {self.travel_unit}"

    @abstractmethod
    def mesh(self) -> Mesh:
        """Return the mesh."""

    @abstractmethod
    def supports(self, points: FloatArray) -> Supports:
        """Return what holds the points of the mesh, and what moves them."""

    def steps(self, count: int) -> FloatArray:
        """Return travels (count,) at equal distances, the last one all of it."""
        return np.linspace(0, self.travel, count + 1)[1:]


def cases() -> dict[str, type[Case]]:
    """Return every case by name."""
    return variants(Case)
