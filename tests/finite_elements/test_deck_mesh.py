"""Decks of Abaqus and CalculiX as meshes: every way to write nodes, elements, sets, parts and instances."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.finite_elements import BodyFromFile, respond
from tissuq.finite_elements.mesh_file import read_mesh
from tissuq.mechanics import material_named

pytest.importorskip("felupe", reason="FElupe is not installed")
pytest.importorskip("meshio", reason="meshio is not installed")

NODES = [(x, y, z) for z in (0, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
BLOCK = "*NODE, NSET=ALL\n" + "".join(f"{n}, {x}, {y}., {z}.\n" for n, (x, y, z) in enumerate(NODES, 1))
CELLS = "*ELEMENT, TYPE=C3D8, ELSET=LOWER\n1, 1, 2, 3, 4, 5, 6, 7, 8\n*ELEMENT, TYPE=C3D8, ELSET=UPPER\n"
CELLS += "2, 5, 6, 7, 8,\n9, 10, 11, 12\n"


def _read(tmp_path, text):
    (tmp_path / "body.inp").write_text(text, encoding="utf-8")
    return read_mesh(tmp_path / "body.inp")


def _set(mesh, name):
    """The places of a set, sorted."""
    return sorted(map(tuple, mesh.points[mesh.sets[name]].tolist()))


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("*NSET, NSET=TOP, GENERATE\n1, 11, 5\n", [1, 6, 11]),
        ("*NSET, NSET=TOP, GENERATE\n1, 3\n9, 10, 1\n", [1, 2, 3, 9, 10]),
        ("*nset, nset=top\n1, 2,\n** in between\n3\n", [1, 2, 3]),
        ("*NSET,\nNSET=TOP\n1, 2\n*NSET, NSET=Top\n3\n", [1, 2, 3]),
        ("*NSET, NSET=A\n1, 2\n*NSET, NSET=TOP\nA, 7\n", [1, 2, 7]),
        ("*NSET, NSET=TOP, ELSET=UPPER\n", [5, 6, 7, 8, 9, 10, 11, 12]),
        ("*ELSET, ELSET=TOP\n2\n", [5, 6, 7, 8, 9, 10, 11, 12]),
        ("*ELSET, ELSET=TOP, GENERATE\n1, 2, 1\n", list(range(1, 13))),
        ("*ELSET, ELSET=TOP\nUPPER\n", [5, 6, 7, 8, 9, 10, 11, 12]),
        ("*NSET, NSET=TOP\n9, 10\n*ELSET, ELSET=TOP\n2\n", [9, 10]),
        ("*ELSET, ELSET=TOP\n2\n*NSET, NSET=TOP\n9, 10\n", [9, 10]),
    ],
)
def test_a_set_has_the_nodes_that_it_names(tmp_path, text, numbers):
    mesh = _read(tmp_path, BLOCK + CELLS + text)
    assert _set(mesh, "TOP" if "TOP" in mesh.sets else "top") == sorted(NODES[n - 1] for n in numbers)
    assert _set(mesh, "LOWER") == sorted(NODES[:8])


def test_nodes_and_elements_may_stand_in_several_blocks_and_files_with_comments(tmp_path):
    lines = BLOCK.splitlines(keepends=True)
    (tmp_path / "more.txt").write_text("** the others\n" + "".join(lines[6:]), encoding="utf-8")
    text = "".join([*lines[:3], "** in between\n", *lines[3:6], "*NODE, INPUT=more.txt, NSET=REST\n"])
    cells = CELLS.replace("*ELEMENT, TYPE=C3D8, ELSET=UPPER\n", "** another one\n")
    mesh = _read(tmp_path, f"{text}{cells}*AMPLITUDE, NAME=RAMP, INPUT=none.txt\n*ELEMENT, TYPE=MASS\n3, 1\n")
    assert len(mesh.cells) == 2
    np.testing.assert_array_equal(mesh.points, NODES)
    assert _set(mesh, "REST") == sorted(NODES[5:])


@pytest.mark.parametrize(("kind", "nodes"), [("T3D2", "1, 4"), ("B32", "1, 4, 2"), ("CPS4", "1, 4, 8, 5")])
def test_edges_and_faces_name_their_nodes_as_decks_of_gmsh_have_them(tmp_path, kind, nodes):
    text = f"{BLOCK}*ELEMENT, type={kind}, ELSET=Line1\n30, {nodes}\n{CELLS}*ELSET, ELSET=left\n30,\n"
    mesh = _read(tmp_path, text)
    assert len(mesh.cells) == 2
    for name in ("left", "Line1"):
        assert _set(mesh, name) == sorted(NODES[int(word) - 1] for word in nodes.split(","))


def _part(name, size):
    nodes = "".join(f"{n}, {size * x}, {y}, {z}\n" for n, (x, y, z) in enumerate(NODES, 1))
    return f"*Part, name={name}\n*Node\n{nodes}{CELLS}*Nset, nset=End\n9, 10, 11, 12\n*End Part\n"


ASSEMBLY = """*Assembly, name=Assembly
*Instance, name=A-1, part=A
*End Instance
*Instance, name=B-1, part=B
5., 0., 0.
5., 0., 0., 5., 1., 0., 90.
*End Instance
*Node
1, 50., 0., 0.
*Nset, nset=Both, instance=A-1
9, 10
*Nset, nset=Both, instance=B-1
9
*Nset, nset=Named
A-1.1, B-1.End
*End Assembly
"""


def test_instances_have_their_own_nodes_moved_and_turned_as_they_say(tmp_path):
    """B is twice as wide; moved by 5 and turned by 90 degrees around the y axis at x = 5, (x, y, z) is at (5 + z, y,
    -x).
    """
    mesh = _read(tmp_path, f"*Heading\n{_part('A', 1)}{_part('B', 2)}{ASSEMBLY}")
    of_b = [(5.0 + z, y, -2.0 * x) for x, y, z in NODES]
    np.testing.assert_allclose(mesh.points, [*NODES, *of_b], atol=1e-12)
    assert (mesh.cells[:, 0] // 12).tolist() == [0, 0, 1, 1]
    for name, wanted in {
        "A-1.End": NODES[8:],
        "B-1.End": of_b[8:],
        "Both": [*NODES[8:10], of_b[8]],
        "Named": [NODES[0], *of_b[8:]],
    }.items():
        np.testing.assert_allclose(_set(mesh, name), sorted(wanted), atol=1e-12)


def test_a_body_of_two_instances_of_a_part_has_twice_its_force(tmp_path):
    second = "*Instance, name=A-2, part=A\n5., 0., 0.\n*End Instance\n"
    lone = _part("A", 1) + "*Assembly, name=All\n*Instance, name=A-1, part=A\n*End Instance\n*End Assembly\n"
    forces = []
    for text in (lone, lone.replace("*End Assembly", f"{second}*End Assembly")):
        (tmp_path / "body.inp").write_text(text, encoding="utf-8")
        hold = {"xmin": "x", "ymin": "y", "zmin": "z", "zmax": "z"} | ({"xmax": "x"} if second in text else {})
        body = BodyFromFile(str(tmp_path / "body.inp"), hold, move="ymax", distance=0.1)
        forces.append(respond(body, material_named("neo-hookean"), [0.5], steps=1).force[-1])
    assert forces[0] == pytest.approx(2 * (1.1 - 1.1**-3), rel=2e-3)  # planar tension, 2 mm2
    assert forces[1] == pytest.approx(2 * forces[0], rel=1e-6)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (BLOCK.replace("*NODE", "*NODE, SYSTEM=C") + CELLS, r"by \*NODE with SYSTEM=C, which is not followed"),
        (f"*SYSTEM\n0, 0, 0, 0, 1, 0\n{BLOCK}{CELLS}", r"by \*SYSTEM, which is not followed"),
        (f"{BLOCK}{CELLS}*ELGEN, ELSET=ALL\n1, 2, 4, 1\n", r"by \*ELGEN, which is not followed"),
        (f"{BLOCK}{CELLS}*NCOPY, OLD SET=ALL, CHANGE NUMBER=20, SHIFT\n0, 0, 2\n", r"by \*NCOPY, which is"),
        (_part("A", 1) + _part("B", 2), r"has several parts and no \*INSTANCE"),
        (f"{BLOCK}{CELLS}*NSET, NSET=TOP\nLATER\n", "names the set 'LATER' in another one before it has been made"),
        (f"{BLOCK}{CELLS}*NSET, NSET=TOP\n99\n", "elements or sets have the node 99, which it lacks"),
        (BLOCK + CELLS.replace("C3D8", "CPEG4"), "its elements 'CPEG4' are not known"),
        (BLOCK + CELLS.replace("9, 10, 11, 12", "9, 10, 11"), "damaged, cut short, or no .inp file"),
    ],
)
def test_what_is_not_followed_is_refused(tmp_path, text, reason):
    with pytest.raises(InputError, match=reason):
        _read(tmp_path, text)
