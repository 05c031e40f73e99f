"""Meshes with fields as files for ParaView, in the XML format of VTK."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np
from numpy.typing import NDArray

from tissuq.finite_elements.case import AXIAL, RADIAL, Mesh

__all__ = ["write_collection", "write_vtu"]

QUADRILATERAL = 9
"""VTK's number for it."""


def write_vtu(
    path: Path, mesh: Mesh, points: Mapping[str, NDArray[np.float64]], cells: Mapping[str, NDArray[np.float64]]
) -> None:
    """Write a mesh with fields of its points and its cells; x is the distance from the axis, y is along it.

    Fields of points with two columns are displacements (along the axis, from it), and become vectors.
    """
    file = Element("VTKFile", type="UnstructuredGrid", version="0.1", byte_order="LittleEndian")
    piece = SubElement(
        SubElement(file, "UnstructuredGrid"),
        "Piece", NumberOfPoints=str(len(mesh.points)), NumberOfCells=str(len(mesh.cells)),
    )  # fmt: skip
    _array(SubElement(piece, "Points"), "Points", _vectors(mesh.points))
    topology = SubElement(piece, "Cells")
    _array(topology, "connectivity", mesh.cells.astype(np.int64))
    _array(topology, "offsets", 4 * np.arange(1, len(mesh.cells) + 1))
    _array(topology, "types", np.full(len(mesh.cells), QUADRILATERAL, dtype=np.uint8))
    for kind, fields in (("PointData", points), ("CellData", cells)):
        parent = SubElement(piece, kind)
        for name, values in fields.items():
            _array(parent, name, _vectors(values) if values.ndim > 1 else values)
    _write(file, path)


def write_collection(path: Path, files: Sequence[tuple[float, str]]) -> None:
    """Write what ParaView opens as one series: times, and files relative to this one."""
    file = Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = SubElement(file, "Collection")
    for time, name in files:
        SubElement(collection, "DataSet", timestep=f"{time:.12g}", part="0", file=name)
    _write(file, path)


def _vectors(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([values[:, RADIAL], values[:, AXIAL], np.zeros(len(values))], axis=-1)


def _array(parent: Any, name: str, values: NDArray[Any]) -> None:
    options = {"NumberOfComponents": str(values.shape[1])} if values.ndim > 1 and name != "connectivity" else {}
    kind = {"f": "Float64", "i": "Int64", "u": "UInt8"}[values.dtype.kind]
    array = SubElement(parent, "DataArray", {"type": kind, "Name": name, "format": "ascii"} | options)
    rows = values.reshape(len(values), -1).tolist()
    array.text = "\n" + "\n".join(" ".join(f"{each:.9g}" for each in row) for row in rows) + "\n"


def _write(file: Element, path: Path) -> None:
    indent(file)
    ElementTree(file).write(path, encoding="utf-8", xml_declaration=True)
