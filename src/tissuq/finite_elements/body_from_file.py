"""Bodies of the user's own: a mesh in a file, by whose sets of points it is held, and moved, pressed or inflated."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import ClassVar, Literal, cast, get_args

import numpy as np

from tissuq.arrays import BoolArray, FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.finite_elements.case import AXIAL, Case, Inflation, Mesh, RigidTip, Supports
from tissuq.finite_elements.deck_mesh import deck_text
from tissuq.finite_elements.mesh_file import AXES, NEARLY, MeshFile, read_mesh

Shape = Literal["axisymmetric", "plane", "solid"]

ORIENTATIONS = {
    "quad": ((1, 3), (0, 3, 2, 1)),
    "quad8": ((1, 3), (0, 3, 2, 1, 7, 6, 5, 4)),
    "triangle6": ((1, 2), (0, 2, 1, 5, 4, 3)),
    "hexahedron": ((1, 3, 4), (0, 3, 2, 1, 4, 7, 6, 5)),
    "hexahedron20": ((1, 3, 4), (0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17)),
    "tetra10": ((1, 2, 3), (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)),
}
"""Points that lie along the axes of a cell from its first one, and the order of its points in its mirror image."""
WITHOUT_CONTACT = ("quad8", "hexahedron20")
"""Cells whose corners a constant pressure pulls outwards, so that points cannot be held by contact one by one."""
WITHOUT_PRESSURE = ("triangle6", "tetra10")
"""Cells whose faces FElupe has no pressure for."""
MESHES = 2
"""That are remembered: a mesh, and a finer one."""


@dataclass(frozen=True)
class BodyFromFile(Case):
    """A body whose mesh is in a file: sets of points are held, and one is moved, or a rigid tip is pressed against it.

    Coordinates are in mm. A body of revolution lies in the x-y plane, y being its axis; a plane one is in plane strain,
    1 mm thick. Its error of the mesh is not known, unless it is computed with another mesh, too.

    Parameters
    ----------
    file : str
        Of a format that meshio reads: ``.msh``, ``.inp``, ``.vtu`` and others.
    hold : mapping of str to str
        The directions in which sets of points are held: ``{"BASE": "xyz"}``.
    move : str, optional
        The set that moves along ``axis`` by ``distance``.
    press : str, optional
        Instead: the set against which a tip is pressed without friction, which begins at its outermost point.
    axis : str
        ``"x"``, ``"y"`` or ``"z"``; of a body of revolution ``"y"``.
    distance : float
        How far, mm; negative: against the axis.
    tip_radius : float
        Of a sphere whose centre is where the other coordinates are zero, mm; zero: a plane.
    shape : str, optional
        ``"axisymmetric"`` or ``"plane"``, of a mesh with two dimensions.
    parts : float
        Number of such bodies, by symmetry, that bear the force side by side.

    Raises
    ------
    InputError
        When the file cannot be used, there is no such set, or the body is left free to move as a whole.

    Examples
    --------
    >>> import meshio, tempfile, tissuq as tq
    >>> corners = [[0, 0], [2, 0], [2, 1], [0, 1]]
    >>> path = tempfile.mkdtemp() + "/disc.vtu"
    >>> meshio.Mesh([[*p, 0] for p in corners], [("quad", [[0, 1, 2, 3]])]).write(path)
    >>> disc = tq.finite_elements.BodyFromFile(
    ...     path, {"ymin": "y", "xmin": "x"}, move="ymax", axis="y", distance=-0.1, shape="axisymmetric"
    ... )
    >>> tq.finite_elements.respond(disc, tq.materials()["neo-hookean"](), [0.0005], steps=1).force.round(5).tolist()
    [0.0042]
    """

    name: ClassVar[str] = "mesh"
    description: ClassVar[str] = "a body whose mesh is in a file"
    travel_name: ClassVar[str] = "travel"

    file: str = field(default="", repr=False)
    hold: Mapping[str, str] | None = None
    move: str = ""
    press: str = ""
    axis: str = "y"
    distance: float = 0.0
    tip_radius: float = 0.0
    shape: str = ""
    parts: float = 1.0
    digest: str = ""

    def __post_init__(self) -> None:
        if bool(self.move) == bool(self.press) or not self.file:
            raise InputError("a body from a file needs its mesh, and either a set that moves or one that is pressed.")
        if not (np.isfinite(self.distance) and self.distance and self.parts > 0 and self.tip_radius >= 0):
            raise InputError(
                f"a body from a file moves by a number of mm other than zero, not {self.distance:g}; its parts "
                f"({self.parts:g}) and the radius of the tip ({self.tip_radius:g} mm) are positive numbers."
            )
        object.__setattr__(self, "hold", dict(self.hold or {}))
        object.__setattr__(self, "digest", sha256(self.content()).hexdigest()[:16])
        mesh_file = self._found()
        dimensions = mesh_file.points.shape[1]
        shape = self.shape or ("solid" if dimensions == 3 else "")
        if shape not in get_args(Shape) or (shape == "solid") != (dimensions == 3):
            wanted = "solid" if dimensions == 3 else "axisymmetric or plane"
            raise InputError(
                f"the mesh '{self.file}' has {dimensions} dimensions: its shape is {wanted}, not '{shape}'."
            )
        object.__setattr__(self, "shape", shape)
        if self.axis not in (("y",) if shape == "axisymmetric" else tuple(AXES[:dimensions])):
            wanted = "y, its axis" if shape == "axisymmetric" else ", ".join(AXES[:dimensions])
            raise InputError(f"a body of the shape {shape} moves along {wanted}, not '{self.axis}'.")
        if shape == "axisymmetric" and mesh_file.points[:, 0].min() < -NEARLY * float(np.ptp(mesh_file.points)):
            raise InputError(f"the mesh '{self.file}' has points at negative x, the distance from the axis.")
        self._check_cells()
        self._check_sets()
        self._check_pressed()
        self._check_held()

    def content(self) -> bytes:
        """Return the file, or a deck together with the files that it includes."""
        try:
            is_deck = self.file.lower().endswith(".inp")
            return deck_text(Path(self.file)).encode() if is_deck else Path(self.file).read_bytes()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"the mesh '{self.file}' cannot be read: {reason}.") from error

    @property
    def travel(self) -> float:
        return abs(self.distance)

    def mesh(self) -> Mesh:
        return self._mesh_and_sets()[0]

    @property
    def _named(self) -> tuple[str, ...]:
        """The sets that do something, besides those that are held."""
        return (self.move or self.press,)

    def _held(self, points: FloatArray) -> BoolArray:
        """Return which displacements of points are held."""
        sets, columns, fixed = self._mesh_and_sets()[1], self._columns, np.zeros(points.shape, dtype=bool)
        for name, axes in (self.hold or {}).items():
            for axis in axes:
                fixed[sets[name], columns.index(AXES.index(axis))] = True
        return fixed

    def supports(self, points: FloatArray) -> Supports:
        fixed, sets = self._held(points), self._mesh_and_sets()[1]
        is_loaded = np.zeros(len(points), dtype=bool)
        is_loaded[sets[self.move or self.press]] = True
        direction = float(np.sign(self.distance))
        if self.move:
            fixed[is_loaded, AXIAL] = False
            return Supports(fixed, is_loaded, direction, self.parts)
        outermost = float((direction * points[is_loaded, AXIAL]).min() * direction)
        tip = RigidTip(is_loaded, outermost, self.tip_radius or inf)
        return Supports(fixed, np.zeros(len(points), dtype=bool), direction, self.parts, tip)

    @property
    def _columns(self) -> tuple[int, ...]:
        """The coordinates of the file that are along the axis, across it, and up, where the body is thinner."""
        axis, sizes = AXES.index(self.axis), np.ptp(self._found().points, axis=0)
        return axis, *sorted(set(range(len(sizes))) - {axis}, key=lambda across: -sizes[across])

    def _found(self) -> MeshFile:
        return _read_once(self.file, self.digest)

    def _mesh_and_sets(self) -> tuple[Mesh, Mapping[str, IndexArray]]:
        return _mesh_once(self.file, self.digest, self._columns, self.shape), self._found().sets

    def _check_cells(self) -> None:
        """Refuse cells that are folded or have no volume."""
        mesh = self._mesh_and_sets()[0]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of negative volumes, which are refused here
            region = mesh.region()
        folded = np.flatnonzero(~(region.dV > 0).all(axis=0))
        if len(folded):
            corner = ", ".join(f"{value:.4g}" for value in mesh.vectors(mesh.points[mesh.cells[folded[0], :1]])[0])
            raise InputError(
                f"the mesh '{self.file}' has cells that are folded or have no volume ({len(folded)} of "
                f"{len(mesh.cells)}, the first at x, y, z = {corner}): mend them in the program that made the mesh."
            )

        self._check_merged(mesh)

    def _check_merged(self, mesh: Mesh) -> None:
        """Refuse parts with points at the same places, where they only look as if they were one."""
        from scipy.spatial import KDTree

        parts = mesh.parts
        if not parts.any():
            return
        pairs = KDTree(mesh.points).query_pairs(NEARLY * float(np.ptp(mesh.points)), output_type="ndarray")
        loose = pairs[parts[pairs[:, 0]] != parts[pairs[:, 1]]]
        if len(loose):
            place = ", ".join(f"{value:.4g}" for value in mesh.vectors(mesh.points[loose[0, :1]])[0])
            raise InputError(
                f"the mesh '{self.file}' has parts that touch and share no points ({len(loose)} places, the first at "
                f"x, y, z = {place}), so that they would come apart: merge the points there (Gmsh: Coherence) and "
                "write the mesh again."
            )

    def _check_sets(self) -> None:
        """Refuse sets, and directions in which they are held, that there are not."""
        mesh, sets = self._mesh_and_sets()
        axes = AXES[: mesh.points.shape[1]]
        for name in (*(self.hold or {}), *self._named):
            if name not in sets or not len(sets[name]):
                near = get_close_matches(name.casefold(), [set_name.casefold() for set_name in sets])
                meant = [set_name for set_name in sets if set_name.casefold() in near]
                hint = f" Did you mean {' or '.join(map(repr, meant))}?" if meant else ""
                raise InputError(
                    f"the mesh '{self.file}' has no set of points '{name}'; its sets are {', '.join(sets)}.{hint}"
                )
        for name, directions in (self.hold or {}).items():
            if not directions or set(directions) - set(axes):
                raise InputError(f"the set '{name}' is held in directions such as {axes}, not '{directions}'.")

    def _check_pressed(self) -> None:
        """Refuse a tip that cannot be pressed against cells, begins on the wrong side of them, or meets held points."""
        if not self.press:
            if self.tip_radius:
                raise InputError("a tip has a radius where it is pressed against a set: give press, not move.")
            return
        mesh, _ = self._mesh_and_sets()
        if mesh.kind.meshio in WITHOUT_CONTACT:
            raise InputError(f"a tip cannot be pressed against cells of the mesh '{self.file}'; use linear ones.")
        supports = self.supports(mesh.points)
        tip, heights = cast(RigidTip, supports.load), supports.direction * mesh.points[:, AXIAL]
        begun = heights - supports.direction * tip.start
        touched = (tip.points & (begun < NEARLY * np.ptp(mesh.points)))[mesh.cells]
        if (touched * (heights[mesh.cells] - heights[mesh.cells].mean(axis=1, keepdims=True))).sum() >= 0:
            raise InputError(
                f"a tip that moves along {'-' * (self.distance < 0)}{self.axis} would begin inside the body at the set "
                f"'{self.press}': change the sign of the distance, or the set."
            )
        across = np.linalg.norm(np.delete(mesh.points, AXIAL, axis=1), axis=1)
        behind = tip.radius - np.sqrt(np.maximum(tip.radius**2 - across**2, 0)) if np.isfinite(tip.radius) else 0.0
        in_reach = tip.points & (begun + behind < self.travel) & (across <= tip.radius)
        if not in_reach.any():
            raise InputError(
                f"the tip comes to no point of the set '{self.press}': a sphere's centre is where the coordinates "
                f"across {self.axis} are zero. Move the mesh there, or give a longer distance or a larger radius."
            )
        if (in_reach & supports.fixed[:, AXIAL]).any():
            raise InputError(f"points of the set '{self.press}' that the tip comes to are held along {self.axis}.")

    def _check_held(self) -> None:
        """Refuse supports that leave the body free to move as a whole, or a part of it that shares no points."""
        mesh = self._mesh_and_sets()[0]
        supports = self.supports(mesh.points)
        held = supports.fixed.copy()
        held[:, AXIAL] |= supports.moved
        parts = mesh.parts
        for number in np.unique(parts):
            points = parts == number
            motions = _rigid_motions(mesh.points[points], self.shape)
            free = len(motions) - np.linalg.matrix_rank(motions[:, held[points]], tol=1e-6)
            if free:
                count = parts.max() + 1
                whole = "as a whole" if count == 1 else f"in one of its {count} parts, which share no points"
                raise InputError(
                    f"the supports leave the body of '{self.file}' free to move or turn {whole} ({free} of "
                    f"{len(motions)} ways): hold more sets, such as ymin={AXES[: mesh.points.shape[1]]}."
                )


@lru_cache(maxsize=MESHES)
def _read_once(file: str, digest: str) -> MeshFile:
    """Return the mesh of a file whose content has this digest."""
    return read_mesh(Path(file))


@lru_cache(maxsize=MESHES)
def _mesh_once(file: str, digest: str, columns: tuple[int, ...], shape: str) -> Mesh:
    """Return the mesh of a file with these coordinates of it, and with cells that are no mirror images."""
    mesh_file = _read_once(file, digest)
    points = mesh_file.points[:, columns]
    xyz = tuple(columns.index(axis) for axis in range(len(columns)))
    mesh = Mesh(points, mesh_file.cells, shape == "plane", shape == "axisymmetric", xyz)
    ends, order = map(list, ORIENTATIONS[mesh.kind.meshio])
    corners = points[mesh_file.cells]
    turned = np.linalg.det(corners[:, ends] - corners[:, :1]) < 0
    cells = np.where(turned[:, None], mesh_file.cells[:, order], mesh_file.cells)
    for shared in (points, cells):
        shared.setflags(write=False)
    return mesh._replace(cells=cells)


def _rigid_motions(points: FloatArray, shape: str) -> FloatArray:
    """Return the displacements (m, n, d) of the motions that leave a body as it is, of a size of one."""
    centred = (points - points.mean(axis=0)) / np.ptp(points)
    count, dimensions = points.shape
    if shape == "axisymmetric":
        return np.asarray(np.broadcast_to(np.eye(2)[AXIAL], (1, count, 2)))
    shifts = [np.broadcast_to(axis, points.shape) for axis in np.eye(dimensions)]
    turns = []
    for from_axis in range(dimensions):
        for to_axis in range(from_axis):
            turn = np.zeros_like(points)
            turn[:, from_axis], turn[:, to_axis] = -centred[:, to_axis], centred[:, from_axis]
            turns.append(turn)
    return np.stack([*shifts, *turns])


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
        region = mesh.region("Boundary", ensure_3d=not mesh.is_solid)
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
