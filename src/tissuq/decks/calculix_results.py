"""Result files of CalculiX: the tables of ``.dat``, and the mesh and the fields of ``.frd``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.arrays import FloatArray
from tissuq.decks.result_file import SAME_TIME, ResultFile, Values
from tissuq.errors import InputError

TABLE = re.compile(
    r"^\s*(?P<what>[a-z][a-z ]*?)\s*\((?P<columns>[^)]*)\) for set (?P<set>\S+) and time\s+(?P<time>\S+)"
)
WITHOUT_LETTER = re.compile(r"(?<=\d)(?=[+-]\d{3}\b)")
"""Where Fortran leaves out the E of an exponent of three digits, such as 1.2-100."""
CELL_TYPES = {
    1: ("hexahedron", 8), 2: ("wedge", 6), 3: ("tetra", 4), 4: ("hexahedron20", 20), 5: ("wedge15", 15),
    6: ("tetra10", 10), 7: ("triangle", 3), 8: ("triangle6", 6), 9: ("quad", 4), 10: ("quad8", 8), 11: ("line", 2),
    12: ("line3", 3),
}  # fmt: skip
"""Names of cells in meshio and their numbers of nodes, by the types of ``.frd``."""
ORDERS = {
    4: [*range(12), *range(16, 20), *range(12, 16)],
    5: [*range(9), *range(12, 15), *range(9, 12)],
}
"""Nodes of ``.frd`` in the order of VTK, where it is another: there the edges across stand last."""
SECTORS_OF_RING = 180
"""Sectors of 2 degrees, of which CalculiX computes one: its forces are in ``.dat``, those of the ring in ``.frd``."""
NUMBER = 12
"""Columns of a number, and of what stands before the first."""
LEADING = 13


AXES = (("x", "1"), ("y", "2"), ("z", "3"))
"""Of a vector, as the names of columns end in ``.dat`` and in ``.frd``."""
TABLES = {"U": ("displacements",), "RF": ("total force", "forces"), "S": ("stresses",), "E": ("strains",)}
"""What the tables of a field are called in ``.dat``, and below its name in ``.frd``."""
FIELDS = {"U": "DISP", "RF": "FORC", "S": "STRESS", "E": "TOSTRAIN"}


class CalculiXResults(ResultFile):
    """The tables of CalculiX's ``.dat``, else the fields of its ``.frd``."""

    name = "calculix"
    suffixes = (".frd", ".dat")
    requests = {  # noqa: RUF012  (as in the base class)
        "U": r"*NODE PRINT, NSET={set}\n U",
        "RF": r"*NODE PRINT, NSET={set}, TOTALS=ONLY\n RF",
        "S": r"*EL FILE\n S",
        "E": r"*EL FILE\n E",
    }

    @property
    def label(self) -> str:
        return f"the results '{self.path.stem}.dat' and '{self.path.stem}.frd'"

    @cached_property
    def tables(self) -> Mapping[tuple[str, str], Table]:
        """The tables of the ``.dat`` file; none where there is no such file."""
        path = self.path.with_suffix(".dat")
        try:
            return read_dat(path) if path.is_file() else {}
        except ValueError as error:
            raise InputError(f"'{path.name}' cannot be read: a set has other rows at other times.") from error

    @cached_property
    def frd(self) -> Frd | None:
        """Mesh and fields of the ``.frd`` file; None where there is no such file."""
        path = self.path.with_suffix(".frd")
        return read_frd(path, self.results.last_time) if path.is_file() else None

    @property
    def nodes(self) -> NDArray[np.int64]:
        return self.frd.nodes if self.frd is not None else np.zeros(0, dtype=np.int64)

    def field(self, kind: str) -> Values | None:
        steps = self.frd.fields.get(FIELDS[kind], []) if self.frd is not None else []
        if not steps:
            return None
        values = np.array([_components(fields, kind) for _, fields in steps])
        if kind == "RF" and self.results.is_axisymmetric:
            values /= SECTORS_OF_RING
        return Values(np.array([time for time, _ in steps]), values)

    def of_set(self, kind: str, set_name: str, how: str) -> Values | None:
        is_local = False
        for what in TABLES[kind]:
            table = self.tables.get((what, set_name))
            if table is not None and (how == "sum" or not what.startswith("total")):
                if not table.is_local:
                    columns = dict(zip(table.columns, np.moveaxis(table.values, -1, 0), strict=True))
                    return Values(table.times, _components(columns, kind))
                is_local = True
        values = super().of_set(kind, set_name, how)
        if values is None and is_local:
            raise InputError(
                f"'{self.path.stem}.dat' has it in the axes of *TRANSFORM: add GLOBAL=YES to '*NODE PRINT, "
                f"NSET={set_name}', or write *NODE FILE, too."
            )
        return values


def _components(columns: Mapping[str, FloatArray], kind: str) -> FloatArray:
    """Return the components (..., 3) or (..., 6) of columns by their names."""
    if kind in ("S", "E"):
        return np.stack(tensor_of(columns), axis=-1)
    by_axis = {name[-1]: values for name, values in columns.items()}
    return np.stack([by_axis[axis] if axis in by_axis else by_axis[number] for axis, number in AXES], axis=-1)


def tensor_of(columns: Mapping[str, FloatArray]) -> list[FloatArray]:
    """Return the components 11, 22, 33, 12, 13, 23 of columns that end in the letters of their axes, such as SZX."""
    by_axes = {"".join(sorted(name[-2:].lower())): values for name, values in columns.items()}
    return [by_axes[axes] for axes in ("xx", "yy", "zz", "xy", "xz", "yz")]


class Table(NamedTuple):
    """A quantity of a set in ``.dat``: its times (t,), and the columns of the rows then, (t, rows, columns).

    It is local where the rows are in the axes of a ``*TRANSFORM``.
    """

    columns: tuple[str, ...]
    times: FloatArray
    values: FloatArray
    is_local: bool = False


def read_dat(path: Path) -> dict[tuple[str, str], Table]:
    """Return the tables of a file by what they hold and the set, both as in the file: ("total force", "TOP").

    Numbers of nodes, elements and integration points are left out.
    """
    by_table: dict[tuple[str, str], tuple[tuple[str, ...], list[float], list[list[list[float]]]]] = {}
    rows: list[list[float]] | None = None
    local: set[tuple[str, str]] = set()
    skip = 0
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        head = TABLE.match(line)
        if head is not None:
            names = [name.strip() for name in head["columns"].split(",")]
            skip = 0 if head["what"].startswith("total") else 1
            if names[:2] == ["elem", "integ.pnt."]:
                names, skip = names[2:], 2
            key = head["what"], head["set"]
            _, times, tables = by_table.setdefault(key, (tuple(names), [], []))
            rows = []
            times.append(float(head["time"]))
            tables.append(rows)
        elif rows is not None and line.strip():
            words = WITHOUT_LETTER.sub("E", line).split()[skip:]
            if words[-1:] == ["L"]:
                local.add(key)
                words.pop()
            try:
                rows.append([float(word) for word in words])
            except ValueError:
                rows = None
    return {
        key: Table(names, np.array(times), np.array(values), key in local)
        for key, (names, times, values) in by_table.items()
    }


@dataclass(frozen=True)
class Frd:
    """The content of a ``.frd`` file.

    Attributes
    ----------
    nodes : (n,) int array
        Numbers of the nodes.
    points : (n, 3) array
    cells : mapping of int to (int array, int array)
        By the type of ``.frd``, places in ``nodes`` (c, k), in the order of VTK, and numbers of materials (c,).
    materials : mapping of int to str
        Names of the materials by their numbers.
    fields : mapping of str to list of (time, {component: (n,) array})
        By the name of the field, such as DISP, in the order of time.
    """

    nodes: NDArray[np.int64]
    points: FloatArray
    cells: Mapping[int, tuple[NDArray[np.int64], NDArray[np.int64]]]
    materials: Mapping[int, str]
    fields: Mapping[str, list[tuple[float, dict[str, FloatArray]]]]


def read_frd(path: Path, last_time: float = np.inf) -> Frd:
    """Return mesh and fields of a file in text form, up to a time.

    Raises
    ------
    InputError
        When the file is binary or is damaged.
    """
    lines = path.read_bytes().splitlines()
    try:
        return _read(lines, last_time)
    except (ValueError, LookupError) as error:
        raise InputError(
            f"'{path.name}' cannot be read: it must be text (*NODE FILE and *EL FILE, not *NODE OUTPUT), and whole."
        ) from error


def _read(lines: list[bytes], last_time: float) -> Frd:
    nodes, points = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    elements: dict[int, list[tuple[list[int], int]]] = {}
    materials: dict[int, str] = {}
    fields: dict[str, list[tuple[float, dict[str, FloatArray]]]] = {}
    row = 0
    while row < len(lines):
        line = lines[row]
        if line.startswith(b"    1UMAT"):
            materials[int(line[9:14])] = line[14:].strip().decode("utf-8", "replace")
        elif line.startswith(b"    2C"):
            count = int(line.split()[1])
            nodes, points = _numbers(lines[row + 1 : row + 1 + count], 3)
            row += count
        elif line.startswith(b"    3C"):
            row = _read_elements(lines, row + 1, int(line.split()[1]), elements)
        elif line.startswith(b"  100C"):
            row = _read_field(lines, row, last_time, nodes, fields)
        row += 1
    row_of = {int(node): index for index, node in enumerate(nodes)}
    cells = {}
    for kind, rows in elements.items():
        corners = np.array([[row_of[node] for node in members] for members, _ in rows], dtype=np.int64)
        cells[kind] = corners[:, ORDERS.get(kind, slice(None))], np.array([number for _, number in rows])
    return Frd(nodes, points, cells, materials, fields)


def _numbers(lines: list[bytes], count: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the nodes and the numbers (n, count) of lines with fixed columns, of which as many as there are."""
    width = LEADING + NUMBER * count
    text = np.frombuffer(b"".join(line[:width].ljust(width) for line in lines), dtype="S1").reshape(-1, width)
    nodes = np.ascontiguousarray(text[:, 3:LEADING]).view(f"S{LEADING - 3}").astype(np.int64).ravel()
    values = np.ascontiguousarray(text[:, LEADING:]).view(f"S{NUMBER}").astype(np.float64)
    return nodes, values


def _read_elements(lines: list[bytes], row: int, count: int, elements: dict[int, list[tuple[list[int], int]]]) -> int:
    for _ in range(count):
        kind, material = int(lines[row][13:18]), int(lines[row][23:28])
        wanted, members = CELL_TYPES[kind][1], list[int]()
        while len(members) < wanted:
            row += 1
            members += [int(lines[row][start : start + 10]) for start in range(3, len(lines[row].rstrip()), 10)]
        elements.setdefault(kind, []).append((members, material))
        row += 1
    return row - 1


def _read_field(
    lines: list[bytes], row: int, last_time: float, nodes: NDArray[np.int64], fields: dict[str, list[Any]]
) -> int:
    """Read one field at one time; return where it ends. Components that are not stored (ALL) are passed over."""
    time = float(lines[row][12:24])
    row += 1
    name = lines[row].split()[1].decode()
    components = []
    row += 1
    while lines[row].startswith(b" -5"):
        words = lines[row].split()
        if words[1] != b"ALL":
            components.append(words[1].decode())
        row += 1
    end = row
    while not lines[end].startswith(b" -3"):
        end += 1
    if time <= last_time * (1 + SAME_TIME):
        rows = [line for line in lines[row:end] if line.startswith(b" -1")]
        numbers, values = _numbers(rows, min(len(components), 6))
        if not np.array_equal(numbers, nodes):
            order = {int(node): index for index, node in enumerate(numbers)}
            at_all_nodes = np.full((len(nodes), values.shape[1]), np.nan)
            present = [index for index, node in enumerate(nodes) if int(node) in order]
            at_all_nodes[present] = values[[order[int(nodes[index])] for index in present]]
            values = at_all_nodes
        fields.setdefault(name, []).append((time, dict(zip(components, values.T, strict=False))))
    return end
