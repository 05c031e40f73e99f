"""CalculiX's result files: those it wrote itself, and small ones written by hand after its manual."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

from tissuq.decks.abaqus import AbaqusDeck
from tissuq.decks.calculix_results import CELL_TYPES, CalculiXResults, read_dat, read_frd
from tissuq.decks.result_file import Results
from tissuq.errors import InputError

CCX = shutil.which("ccx")
DAT = """
 displacements (vx,vy,vz) for set TOP and time  0.5000000E+00

         3  1.0E-01-2.0E-01 0.0E+00

 total force (fx,fy,fz) for set TOP and time  0.5000000E+00

        1.0E+00  2.0E+00  3.0E+00

 stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set EALL and time  0.5000000E+00

         1   1  1.0  2.0  3.0  4.0  5.0  6.0
         1   2  7.0  8.0  9.0  1.0  2.0  3.0

 total force (fx,fy,fz) for set TOP and time  0.1000000E+01

        4.0E+00  5.0E+00  6.0E+00
""".replace("1.0E-01-2.0E-01", "1.0E-01 -2.0E-01")
FRD = """    1C
    1UMAT    1TISSUE
    1UMAT    2MY FAT
    2C                             5                                     1
 -1         2 0.00000E+00 0.00000E+00 0.00000E+00
 -1         5 1.00000E+00 0.00000E+00-1.00000E+00
 -1         7 0.00000E+00 1.00000E+00 0.00000E+00
 -1         8 0.00000E+00 0.00000E+00 1.00000E+00
 -1         9 2.00000E+00 0.00000E+00 0.00000E+00
 -3
    3C                             2                                     1
 -1         1    3    0    1
 -2         2         5         7         8
 -1         4    3    0    2
 -2         9         5         7         8
 -3
    1PSTEP                         1           1           1
  100CL  101 5.00000E-01           5                     0    1           1
 -4  DISP        4    1
 -5  D1          1    2    1    0
 -5  D2          1    2    2    0
 -5  D3          1    2    3    0
 -5  ALL         1    2    0    0    1ALL
 -1         2 1.00000E-01-2.00000E-01 3.00000E-01
 -1         5 0.00000E+00 0.00000E+00 0.00000E+00
 -1         7 0.00000E+00 0.00000E+00 0.00000E+00
 -1         9 0.00000E+00 0.00000E+00 7.00000E-01
 -3
  100CL  102 6.00000E-01           5                     0    2           1
 -4  DISP        4    1
 -5  D1          1    2    1    0
 -5  D2          1    2    2    0
 -5  D3          1    2    3    0
 -5  ALL         1    2    0    0    1ALL
 -1         2 9.00000E-01 9.00000E-01 9.00000E-01
 -3
 9999
"""


def test_tables_have_their_columns_at_every_time(tmp_path):
    (tmp_path / "job.dat").write_text(DAT)
    tables = read_dat(tmp_path / "job.dat")
    assert set(tables) == {("displacements", "TOP"), ("total force", "TOP"), ("stresses", "EALL")}
    force = tables["total force", "TOP"]
    np.testing.assert_array_equal(force.times, [0.5, 1.0])
    np.testing.assert_array_equal(force.values, [[[1, 2, 3]], [[4, 5, 6]]])
    stress = tables["stresses", "EALL"]
    assert stress.columns == ("sxx", "syy", "szz", "sxy", "sxz", "syz")
    np.testing.assert_array_equal(stress.values[0], [[1, 2, 3, 4, 5, 6], [7, 8, 9, 1, 2, 3]])
    np.testing.assert_array_equal(tables["displacements", "TOP"].values, [[[0.1, -0.2, 0.0]]])


def test_numbers_whose_exponent_has_no_letter_do_not_end_a_table(tmp_path):
    (tmp_path / "job.dat").write_text(DAT.replace("  1   1  1.0  2.0", "  1   1  1.0-100 -2.0+101"))
    stress = read_dat(tmp_path / "job.dat")["stresses", "EALL"].values[0]
    np.testing.assert_array_equal(stress, [[1e-100, -2e101, 3, 4, 5, 6], [7, 8, 9, 1, 2, 3]])


def test_mesh_materials_and_fields_are_read_up_to_a_time(tmp_path):
    (tmp_path / "job.frd").write_text(FRD)
    found = read_frd(tmp_path / "job.frd", last_time=0.5)
    assert found.nodes.tolist() == [2, 5, 7, 8, 9]
    assert found.points[1].tolist() == [1, 0, -1]
    assert found.materials == {1: "TISSUE", 2: "MY FAT"}
    members, materials = found.cells[3]
    assert (members.tolist(), materials.tolist()) == ([[0, 1, 2, 3], [4, 1, 2, 3]], [1, 2])
    ((time, field),) = found.fields["DISP"]
    assert time == 0.5
    np.testing.assert_array_equal(field["D3"], [0.3, 0, 0, np.nan, 0.7])
    assert len(read_frd(tmp_path / "job.frd").fields["DISP"]) == 2


@pytest.mark.parametrize("damage", [lambda text: text[:900], lambda text: text.replace("1.00000E-01-2", "binary")])
def test_a_damaged_file_is_told(tmp_path, damage):
    (tmp_path / "job.frd").write_text(damage(FRD))
    with pytest.raises(InputError, match=r"'job\.frd' cannot be read"):
        read_frd(tmp_path / "job.frd")


HEXAHEDRON = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
WEDGE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]]
TETRAHEDRON = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
EDGES = {
    "hexahedron20": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    "wedge15": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "tetra10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
}
"""The corners between which VTK's nodes on edges lie, in its order, which is that of Abaqus and CalculiX, too."""
SOLIDS = {
    "C3D8": ("hexahedron", HEXAHEDRON, []), "C3D20": ("hexahedron20", HEXAHEDRON, EDGES["hexahedron20"]),
    "C3D6": ("wedge", WEDGE, []), "C3D15": ("wedge15", WEDGE, EDGES["wedge15"]),
    "C3D4": ("tetra", TETRAHEDRON, []), "C3D10": ("tetra10", TETRAHEDRON, EDGES["tetra10"]),
}  # fmt: skip


def shifted(corners, edges, distance):
    """Return corners and the middles of edges, moved along x."""
    points = [*corners, *(np.mean([corners[a], corners[b]], axis=0) for a, b in edges)]
    return np.array(points) + np.array([distance, 0, 0])


@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
def test_the_nodes_of_every_solid_are_in_the_order_of_vtk(tmp_path):
    nodes, elements = [], []
    for place, (kind, (_, corners, edges)) in enumerate(SOLIDS.items()):
        points = shifted(corners, edges, 5 * place)
        numbers = list(range(len(nodes) + 1, len(nodes) + len(points) + 1))
        nodes += [f"{n}, {x}, {y}, {z}" for n, (x, y, z) in zip(numbers, points, strict=True)]
        elements += [f"*ELEMENT, TYPE={kind}, ELSET=E{place}", ",\n".join(map(str, [place + 1, *numbers]))]
    sections = [f"*SOLID SECTION, ELSET=E{place}, MATERIAL=A" for place in range(len(SOLIDS))]
    deck = ["*NODE, NSET=ALL", *nodes, *elements, "*MATERIAL, NAME=A", "*ELASTIC", "1., 0.3", *sections]
    deck += ["*STEP", "*STATIC", "*BOUNDARY", "ALL, 1, 3", "*NODE FILE", "U", "*END STEP", ""]
    (tmp_path / "solids.inp").write_text("\n".join(deck))
    subprocess.run([CCX, "-i", "solids"], cwd=tmp_path, check=True, capture_output=True, timeout=120)
    found = read_frd(tmp_path / "solids.frd")
    cells = {CELL_TYPES[kind][0]: found.points[members[0]] for kind, (members, _) in found.cells.items()}
    for place, (name, corners, edges) in enumerate(SOLIDS.values()):
        np.testing.assert_allclose(cells[name], shifted(corners, edges, 5 * place), err_msg=name)


CYLINDER = """*NODE, NSET=NALL
1, 0., 0.
2, 5., 0.
3, 5., 4.
4, 0., 4.
5, 2.5, 0.
6, 5., 2.
7, 2.5, 4.
8, 0., 2.
*ELEMENT, TYPE=CAX8R, ELSET=EALL
1, 1, 2, 3, 4, 5, 6, 7, 8
*NSET, NSET=TOP
3, 4, 7
*MATERIAL, NAME=GEL
*HYPERELASTIC, NEO HOOKE
0.5, 0.02
*SOLID SECTION, ELSET=EALL, MATERIAL=GEL
*STEP, NLGEOM
*STATIC
0.25, 1.
*BOUNDARY
1, 2, 2
2, 2, 2
5, 2, 2
4, 1, 1
8, 1, 1
1, 1, 1
TOP, 2, 2, 0.8
*NODE PRINT, NSET=TOP
RF
*NODE FILE
U, RF
*END STEP
"""


@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
def test_forces_of_an_axisymmetric_body_are_the_same_in_both_files(tmp_path):
    (tmp_path / "job.inp").write_text(CYLINDER)
    subprocess.run([CCX, "-i", "job"], cwd=tmp_path, check=True, capture_output=True)
    sets = {"TOP": {3, 4, 7}}
    is_ring = AbaqusDeck().is_axisymmetric([CYLINDER.encode()])
    in_dat = CalculiXResults(tmp_path / "job.frd", Results(tmp_path, "job", node_sets=sets, is_axisymmetric=is_ring))
    force = in_dat.of_set("RF", "TOP", "sum").values[-1, :, 1].sum()
    (tmp_path / "job.dat").unlink()
    in_frd = CalculiXResults(tmp_path / "job.frd", Results(tmp_path, "job", node_sets=sets, is_axisymmetric=is_ring))
    assert in_frd.of_set("RF", "TOP", "sum").values[-1, :, 1].sum() == pytest.approx(force, rel=1e-4)
    # A cylinder of radius 5 in tension by a fifth, nearly incompressible: 2 C10 (l - 1/l^2) pi r^2, over 180 sectors.
    assert force == pytest.approx(2 * 0.5 * (1.2 - 1.2**-2) * np.pi * 25 / 180, rel=0.02)


def test_rows_in_the_axes_of_a_transform_are_told(tmp_path):
    head = " displacements (vx,vy,vz) for set TOP and time  0.1000000E+01\n\n"
    (tmp_path / "job.dat").write_text(
        f"{head}         1  1.0E-01  0.0E+00  0.0E+00 L\n         2  1.0E-01  0.0E+00  0.0E+00 L\n"
    )
    assert read_dat(tmp_path / "job.dat")["displacements", "TOP"].is_local
    results = CalculiXResults(tmp_path / "job.dat", Results(tmp_path, "job", node_sets={"TOP": {1, 2}}))
    with pytest.raises(InputError, match=r"in the axes of [*]TRANSFORM: add GLOBAL=YES"):
        results.of_set("U", "TOP", "mean")
