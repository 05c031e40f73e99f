"""The mesh in a deck or a file that meshio reads: points, cells of one kind and sets of points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tissuq.arrays import FloatArray, IndexArray
from tissuq.errors import InputError
from tissuq.finite_elements.case import CELL_KINDS
from tissuq.finite_elements.deck_mesh import mesh_of_deck

AXES = "xyz"
NEARLY = 1e-6
"""Distance from the end of a body within which a point is at it, over the size of the body."""


class MeshFile(NamedTuple):
    """What a file holds: points (n, 2 or 3), mm, cells (c, k) of one kind, and sets of points by name."""

    points: FloatArray
    cells: IndexArray
    sets: Mapping[str, IndexArray]


def read_mesh(path: Path) -> MeshFile:
    """Return the mesh in a file, with the sets in it and those at its ends, ``xmin`` to ``zmax``.

    Sets are those of points, and the points of named groups of cells (physical groups of Gmsh). A cell that stands
    there several times counts once.

    Raises
    ------
    InputError
        When the file cannot be read, or has no cells of a kind that can be used, or several.
    """
    import meshio

    if path.is_file() and not path.stat().st_size:
        raise InputError(f"the mesh '{path}' is empty: write it again with the program that made it.")
    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            is_deck = path.suffix.lower() == ".inp"
            mesh = mesh_of_deck(path) if is_deck else meshio.read(path)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"the mesh '{path}' cannot be read: {error.strerror or error}.") from error
    except (Exception, SystemExit) as error:  # meshio's readers raise whatever a damaged file leads to, or exit
        raise InputError(f"'{path}' cannot be read as a mesh: {_why_unreadable(path, error)}") from error
    return _used(path, mesh)


def _why_unreadable(path: Path, error: BaseException) -> str:
    """Return what is wrong with a file that meshio's reader failed at, and what to do, as sentences."""
    again, reason = "Write it again with the program that made it", str(error)
    if "deduce file format" in reason:
        return f"no format of meshes is known by the name '{path.suffix}'. {again}, as .msh, .inp or .vtu."
    if isinstance(error, KeyError) and isinstance(error.args[0], int | np.integer):
        return f"its elements or sets have the node {error.args[0]}, which it lacks. {again}, with all nodes."
    if isinstance(error, ValueError) and "include each other" in reason:
        return "its files include each other. Take out one *INCLUDE."
    return f"it is damaged, cut short, or no {path.suffix} file. {again}."


def _used(path: Path, mesh: Any) -> MeshFile:
    """Return the cells with most dimensions, the points that they use, and the sets among these."""
    names = {kind.meshio: dimensions for (dimensions, _), kind in CELL_KINDS.items()}
    highest = max((block.dim for block in mesh.cells if len(block)), default=0)
    blocks = [block for block in mesh.cells if block.dim == highest and len(block)]
    kinds = sorted({block.type for block in blocks})
    usable_kinds = ", ".join(names)
    if highest < 2:
        has = f"only {', '.join(kinds)}" if kinds else "no cells"
        raise InputError(f"'{path}' has {has}: mesh the body, and save its cells ({usable_kinds}).")
    used = np.unique(np.concatenate([block.data.ravel() for block in blocks])).astype(np.intp)
    if used[0] < 0 or used[-1] >= len(mesh.points):
        raise InputError(f"'{path}' has cells with points that it does not hold; write the mesh again.")
    if highest == 2 and _is_in_space(np.asarray(mesh.points, dtype=np.float64)[used]):
        raise InputError(
            f"'{path}' has only the cells of a surface in space ({', '.join(kinds)}): mesh the volume, too, and save "
            "its cells (gmsh -3 -order 2); a plane or axisymmetric body lies in the x-y plane."
        )
    if len(kinds) != 1 or kinds[0] not in names:
        linear = " Make triangles and tetrahedra of second order (gmsh -order 2)." * bool(
            {"triangle", "tetra"} & {*kinds}
        )
        raise InputError(f"'{path}' has cells {', '.join(kinds)}; use one of {usable_kinds}.{linear}")
    cells = np.searchsorted(used, np.concatenate([block.data for block in blocks]).astype(np.intp))
    _, first_places = np.unique(np.sort(cells, axis=1), axis=0, return_index=True)
    cells = cells[np.sort(first_places)]  # older files of Gmsh have a cell once for each of its physical groups
    dimensions = names[kinds[0]]
    points = np.asarray(mesh.points, dtype=np.float64)[used]
    if not np.isfinite(points).all():
        raise InputError(f"'{path}' has points whose coordinates are no numbers; write the mesh again.")
    size = float(np.ptp(points, axis=0).max())
    points = points[:, :dimensions]
    numbers = np.full(len(mesh.points), -1)
    numbers[used] = np.arange(len(used))
    sets = {name: numbers[members] for name, members in _sets(mesh)}
    ends = {
        f"{AXES[axis]}{end}": np.flatnonzero(np.abs(points[:, axis] - value) < NEARLY * size)
        for axis in range(dimensions)
        for end, value in (("min", points[:, axis].min()), ("max", points[:, axis].max()))
    }
    return MeshFile(points, cells, ends | {name: members[members >= 0] for name, members in sets.items()})


def _is_in_space(points: FloatArray) -> bool:
    """Return whether points (n, 2 or 3) are not all in a plane of the same z."""
    sizes = np.ptp(points, axis=0)
    return bool(len(sizes) > 2 and sizes[2] > NEARLY * sizes.max())


def _sets(mesh: Any) -> Iterator[tuple[str, IndexArray]]:
    """Yield the sets of points of a file, and the points of its named groups of cells."""
    for name, members in mesh.point_sets.items():
        yield name, np.asarray(members, dtype=np.intp)
    numbers = mesh.cell_data.get("gmsh:physical", ())
    groups: dict[str, Any] = {}
    for name, (number, dimensions) in mesh.field_data.items():
        blocks = zip(mesh.cells, numbers, strict=False)
        groups[name] = [np.flatnonzero((of_block == number) & (block.dim == dimensions)) for block, of_block in blocks]
    # Later than those numbers, of which a cell has one: in version 4.1 of Gmsh's format it may be of several groups.
    groups |= {name: rows for name, rows in mesh.cell_sets.items() if not name.startswith("gmsh:")}
    for name, rows in groups.items():
        blocks = zip(mesh.cells, rows, strict=False)
        of_blocks = [block.data[np.asarray(row, dtype=np.intp)].ravel() for block, row in blocks if row is not None]
        yield name, np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *of_blocks]))
