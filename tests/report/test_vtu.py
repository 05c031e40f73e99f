"""Files for ParaView."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from tissuq.finite_elements import PlateWithHole
from tissuq.finite_elements.bodies import grid
from tissuq.report.finite_element_figures import write_collection, write_vtu


def numbers(array):
    return np.array(array.text.split(), dtype=float).reshape(-1, int(array.get("NumberOfComponents", 1)))


def test_a_mesh_is_written_with_its_fields(tmp_path):
    mesh = grid(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0]))
    temperature, move = np.arange(6.0), np.arange(12.0).reshape(6, 2)
    write_vtu(tmp_path / "one.vtu", mesh, {"temperature": temperature, "move": move}, {"size": np.array([2.0, 4.0])})
    root = ElementTree.parse(tmp_path / "one.vtu").getroot()
    piece = root.find("UnstructuredGrid/Piece")
    arrays = {array.get("Name"): numbers(array) for array in root.iter("DataArray")}
    assert (piece.get("NumberOfPoints"), piece.get("NumberOfCells")) == ("6", "2")
    np.testing.assert_array_equal(arrays["Points"], np.c_[mesh.points[:, ::-1], np.zeros(6)])
    np.testing.assert_array_equal(arrays["connectivity"].reshape(2, 4), mesh.cells)
    np.testing.assert_array_equal(arrays["offsets"].ravel(), [4, 8])
    np.testing.assert_array_equal(arrays["types"].ravel(), [9, 9])
    np.testing.assert_array_equal(arrays["temperature"].ravel(), temperature)
    np.testing.assert_array_equal(arrays["move"], np.c_[move[:, ::-1], np.zeros(6)])
    np.testing.assert_array_equal(arrays["size"].ravel(), [2, 4])


def test_a_solid_is_written_with_cells_of_positive_volume_and_its_section_is_its_middle_plane(tmp_path):
    mesh = PlateWithHole(fineness=0.25).mesh()
    move = 0.1 * mesh.points
    write_vtu(tmp_path / "solid.vtu", mesh, {"move": move}, {"size": np.arange(float(len(mesh.cells)))})
    arrays = {each.get("Name"): numbers(each) for each in ElementTree.parse(tmp_path / "solid.vtu").iter("DataArray")}
    np.testing.assert_allclose(arrays["move"], 0.1 * arrays["Points"], atol=1e-9)
    np.testing.assert_array_equal(arrays["types"].ravel(), 12)
    corners = arrays["Points"][arrays["connectivity"].astype(int).reshape(-1, 8)]
    edges = corners[:, [1, 3, 4]] - corners[:, :1]
    assert (np.linalg.det(edges) > 0).all()
    faces, cells = mesh.section
    assert (mesh.points[faces][..., 2] == 0).all()
    assert sorted(cells) == [
        number for number in range(len(mesh.cells)) if mesh.points[mesh.cells[number], 2].min() == 0
    ]


def test_cells_go_round_one_way():
    mesh = grid(np.linspace(0, 1, 3), np.linspace(0, 2, 4))
    x, y = mesh.points[mesh.cells].transpose(2, 0, 1)
    area = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2
    np.testing.assert_allclose(area, 2 / 6)


def test_a_series_names_its_files(tmp_path):
    write_collection(tmp_path / "all.pvd", [(0.1, "steps/a.vtu"), (0.2, "steps/b.vtu")])
    sets = ElementTree.parse(tmp_path / "all.pvd").getroot().iter("DataSet")
    assert [(each.get("timestep"), each.get("file")) for each in sets] == [
        ("0.1", "steps/a.vtu"),
        ("0.2", "steps/b.vtu"),
    ]
