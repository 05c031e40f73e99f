"""Bodies from files: every kind of cell against closed forms, contact against Hertz, and what is refused."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements import BodyFromFile, InflatedBody, SphericalIndentation, first_order, respond, simulate
from tissuq.finite_elements.mesh_file import read_mesh
from tissuq.finite_elements.response import Solve
from tissuq.finite_elements.solver import Solver
from tissuq.mechanics import engineering_stress, material_named

fem = pytest.importorskip("felupe", reason="FElupe is not installed")
meshio = pytest.importorskip("meshio", reason="meshio is not installed")

YEOH, VALUES = material_named("yeoh"), [1e-3, 2e-3, 1e-3]
WIDTH, HEIGHT, DEPTH = 2.0, 3.0, 1.5


def _meshes():
    """Blocks and rectangles of every kind of cell, by name."""
    cube = fem.Cube(b=(WIDTH, HEIGHT, DEPTH), n=3)
    square = fem.Rectangle(b=(WIDTH, HEIGHT), n=3)
    return {
        "hexahedron": cube,
        "hexahedron20": cube.add_midpoints_edges(),
        "tetra10": cube.triangulate().add_midpoints_edges(),
        "quad": square,
        "quad8": square.add_midpoints_edges(),
        "triangle6": square.triangulate().add_midpoints_edges(),
    }


def _written(path, name, mirrored=False):
    mesh = _meshes()[name]
    points = np.pad(mesh.points, ((0, 1), (0, 3 - mesh.dim)))  # the last point is in no cell
    points[-1] = 50.0, 0.0, 0.0
    points = points * [1, -1 if mirrored else 1, 1]
    meshio.Mesh(points, [(name, mesh.cells)]).write(path)
    return str(path)


def _stress(mode, stretch):
    return float(np.ravel(engineering_stress(YEOH, loading_mode(mode), [stretch], [VALUES]))[0])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("name", ["hexahedron", "hexahedron20", "tetra10"])
def test_a_block_that_is_pulled_is_in_uniaxial_tension(tmp_path, name, axis):
    path = _written(tmp_path / "block.vtu", name, mirrored=axis == "x")
    hold = {"xmin": "x", "ymax" if axis == "x" else "ymin": "y", "zmin": "z"}
    length = dict(zip("xyz", (WIDTH, HEIGHT, DEPTH), strict=True))[axis]
    case = BodyFromFile(path, hold, move=f"{axis}max", axis=axis, distance=0.2 * length, parts=4.0)
    found = respond(case, YEOH, VALUES, steps=2, bulk_ratio=1e5)
    area = WIDTH * HEIGHT * DEPTH / length
    expected = [4 * area * _stress("uniaxial", stretch) for stretch in (1.1, 1.2)]
    np.testing.assert_allclose(found.force, expected, rtol=1e-4)
    assert found.fields.largest == pytest.approx(1.2, rel=1e-4)


@pytest.mark.parametrize("shape", ["axisymmetric", "plane"])
@pytest.mark.parametrize("name", ["quad", "quad8", "triangle6"])
def test_a_cylinder_and_a_sheet_have_the_force_of_their_state(tmp_path, name, shape):
    path = _written(tmp_path / "block.vtu", name)
    case = BodyFromFile(path, {"ymin": "y", "xmin": "x"}, move="ymax", distance=-0.3, shape=shape)
    found = respond(case, YEOH, VALUES, steps=1, bulk_ratio=1e5)
    stress, area = (_stress("uniaxial", 0.9), np.pi * WIDTH**2) if shape == "axisymmetric" else (
        _stress("planar", 0.9), WIDTH)  # fmt: skip
    assert found.force[0] == pytest.approx(-stress * area, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hexahedron", "tetra10", "quad", "triangle6"])
def test_a_plane_that_is_pressed_on_a_block_compresses_it(tmp_path, name):
    """The penalty lets the block be a little longer than the way of the plane."""
    path = _written(tmp_path / "block.vtu", name)
    is_solid = _meshes()[name].dim == 3
    hold = {"xmin": "x", "ymin": "y"} | ({"zmin": "z"} if is_solid else {})
    case = BodyFromFile(path, hold, press="ymax", distance=-0.3, shape="" if is_solid else "axisymmetric")
    found = respond(case, YEOH, VALUES, steps=2, bulk_ratio=1e5)
    area = WIDTH * DEPTH if is_solid else np.pi * WIDTH**2
    expected = [-area * _stress("uniaxial", 1 - travel / HEIGHT) for travel in found.travel]
    np.testing.assert_allclose(found.force, expected, rtol=0.01)
    assert (found.force < expected).all()


@pytest.mark.finite_elements
def test_a_shallow_sphere_has_the_force_of_hertz():
    """F = 16/9 E sqrt(R) d^1.5 of an incompressible half space, E = 3 mu."""
    modulus = 2e-3
    case = SphericalIndentation(depth=0.01, tip_radius=1.0, height=15.0, radius=15.0, fineness=2.0)
    found = respond(case, material_named("neo-hookean"), [modulus / 2], steps=2)
    np.testing.assert_allclose(found.force, 16 / 9 * 3 * modulus * found.travel**1.5, rtol=3e-3)


@pytest.mark.slow
def test_a_sphere_is_also_one_of_a_mesh(tmp_path):
    sizes = {"depth": 0.3, "fineness": 0.3}
    wanted = SphericalIndentation(**sizes)
    points = wanted.mesh().points[:, ::-1]
    flipped = wanted.mesh().cells[:, [0, 3, 2, 1]]
    meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), [("quad", flipped)]).write(tmp_path / "disc.vtu")
    case = BodyFromFile(
        str(tmp_path / "disc.vtu"), {"ymin": "xy", "xmin": "x"}, press="ymax", distance=-0.3, tip_radius=1.5,
        shape="axisymmetric",
    )  # fmt: skip
    one, other = (respond(kind, YEOH, VALUES, steps=2).force for kind in (wanted, case))
    np.testing.assert_allclose(one, other, rtol=1e-9)


@pytest.mark.slow
def test_the_power_of_stresses_on_the_rates_of_strain_is_the_force_under_a_tip(posterior):
    """What follows to first order from a draw is exact for that draw itself."""
    case, draws = SphericalIndentation(depth=0.3, fineness=0.3), posterior.ensemble(4)
    followed = first_order.first_order_forces(case, draws, draws[1], 2, 2000.0)
    np.testing.assert_allclose(followed.forces[1], respond(case, draws[1], steps=2).force, rtol=1e-6)


def test_forces_are_the_same_with_the_axes_in_another_order(tmp_path):
    """A clamped block, whose fields are not uniform, lying in three ways."""
    mesh = _meshes()["hexahedron"]
    forces = []
    for axis in range(3):
        points = np.roll(mesh.points, axis, axis=1)
        meshio.Mesh(points, [("hexahedron", mesh.cells)]).write(tmp_path / f"{axis}.vtu")
        name = "xyz"[(axis + 1) % 3]
        case = BodyFromFile(
            str(tmp_path / f"{axis}.vtu"), {f"{name}min": "xyz", f"{name}max": "xyz".replace(name, "")},
            move=f"{name}max", axis=name, distance=0.4,
        )  # fmt: skip
        forces.append(respond(case, YEOH, VALUES, steps=1).force[0])
        assert Solver(case, YEOH, VALUES, 100.0)._volumes.sum() == pytest.approx(WIDTH * HEIGHT * DEPTH)
        vectors = case.mesh().vectors(case.mesh().points)
        np.testing.assert_allclose(np.sort(vectors, axis=0), np.sort(points, axis=0))
    np.testing.assert_allclose(forces, forces[0], rtol=1e-7)


def _ring(path, cells=24):
    """A ring of a tube with radii 1 and 1.5, of a quarter of a circle or of its section."""
    mesh = fem.Rectangle(a=(1.0, 0.0), b=(1.5, 0.1), n=(cells + 1, 2))
    meshio.Mesh(np.pad(mesh.points, ((0, 0), (0, 1))), [("quad", mesh.cells)]).write(path)
    return str(path)


def _pressure_of_tube(widening, inner=1.0, outer=1.5):
    """The pressure (kPa) of a thick incompressible tube in plane strain whose inside moves outwards, by quadrature."""
    radii = np.linspace(inner, outer, 20001)
    hoop = np.sqrt(radii**2 + (inner + widening) ** 2 - inner**2) / radii
    C10, C20, C30 = VALUES
    x = hoop**2 + hoop**-2 - 2  # I1 - 3
    slope = 2 * (C10 + 2 * C20 * x + 3 * C30 * x**2) * (hoop**2 - hoop**-2)
    return 1e3 * np.trapezoid(slope / (radii * hoop**2), radii)


@pytest.mark.parametrize("shape", ["axisymmetric", "solid", "solid of 20 points"])
def test_a_tube_under_pressure_widens_as_its_closed_form_says(tmp_path, shape):
    """In the solid a sector of three degrees, whose flat sides are held across themselves, is nearly the tube."""
    expected = _pressure_of_tube(0.2)
    if shape == "axisymmetric":
        case = InflatedBody(
            _ring(tmp_path / "ring.vtu"), {"ymin": "y", "ymax": "y"}, press="xmin", distance=expected,
            shape=shape, watch="xmin", direction="x",
        )  # fmt: skip
        mean_cosine = 1.0
    else:
        kind, n = ("hexahedron", (13, 31, 2)) if shape == "solid" else ("hexahedron20", (4, 11, 2))
        ring = fem.Cube(a=(1.0, 0.0, 0.0), b=(1.5, np.pi / 2, 0.1), n=n)
        ring = ring if shape == "solid" else ring.add_midpoints_edges()
        radius, angle, height = ring.points.T
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
        inside = np.flatnonzero(np.isclose(radius, 1.0))
        written = meshio.Mesh(points, [(kind, ring.cells)], point_sets={"inside": inside})
        written.write(tmp_path / "tube.inp")
        hold = {"xmin": "x", "ymin": "y", "zmin": "z", "zmax": "z"}
        case = InflatedBody(str(tmp_path / "tube.inp"), hold, press="inside", distance=expected, watch="inside")
        mean_cosine = np.cos(angle[inside]).mean()
    found = respond(case, YEOH, VALUES, steps=2, bulk_ratio=1e5)
    assert found.force[-1] / mean_cosine == pytest.approx(0.2, rel=5e-3)
    assert found.problem == ""


def test_draws_under_pressure_are_not_followed_to_first_order_and_not_scaled(posterior, tmp_path):
    case = InflatedBody(
        _ring(tmp_path / "ring.vtu", 4), {"ymin": "y", "ymax": "y"}, press="xmin", distance=0.05, shape="axisymmetric",
        watch="xmax",
    )  # fmt: skip
    draws = posterior.ensemble(4)
    with pytest.raises(InputError, match="answers with a displacement: compute all draws in full"):
        first_order.first_order_forces(case, draws, draws[1], 1, 2000.0)
    neo_hookean = Solve.of(case, replace(draws[1], discrepancy=None), 1, 2000.0)
    assert neo_hookean.modulus == 1.0


DECK = """*INCLUDE, INPUT=points.inp
*ELEMENT, TYPE=CAX4H, ELSET=DISC
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*NSET, NSET=Bottom
1, 2, 3
"""


@pytest.mark.parametrize("written", [str, str.lower])
def test_a_deck_gives_its_mesh_and_its_sets(tmp_path, written):
    (tmp_path / "points.inp").write_text(
        "*NODE\n" + "".join(f"{n + 1}, {n % 3}., {n // 3}.\n" for n in range(6)), encoding="utf-8"
    )
    elements = "*ELEMENT, TYPE=CAX4H"
    (tmp_path / "disc.inp").write_text(DECK.replace(elements, written(elements)), encoding="utf-8")
    found = read_mesh(tmp_path / "disc.inp")
    assert found.cells.tolist() == [[0, 1, 4, 3], [1, 2, 5, 4]]
    assert {name: members.tolist() for name, members in found.sets.items()} == {
        "xmin": [0, 3], "xmax": [2, 5], "ymin": [0, 1, 2], "ymax": [3, 4, 5],
        "Bottom": [0, 1, 2], "DISC": [0, 1, 2, 3, 4, 5],
    }  # fmt: skip


def test_groups_of_gmsh_are_sets(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    text = '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 "base"\n2 2 "body"\n$EndPhysicalNames\n'
    text += "$Nodes\n4\n" + "".join(f"{n} {x} {y} {z}\n" for n, (x, y, z) in enumerate(points, 1)) + "$EndNodes\n"
    text += "$Elements\n2\n1 1 2 1 1 1 2\n2 3 2 2 1 1 2 3 4\n$EndElements\n"
    (tmp_path / "disc.msh").write_text(text, encoding="utf-8")
    sets = read_mesh(tmp_path / "disc.msh").sets
    assert (sets["base"].tolist(), sets["body"].tolist()) == ([0, 1], [0, 1, 2, 3])


def test_a_cell_of_two_physical_groups_bears_its_force_once(tmp_path):
    """Version 2 of Gmsh's format has such a cell twice; the force is that of uniaxial tension."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    text = '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 "inner"\n2 2 "body"\n$EndPhysicalNames\n'
    text += "$Nodes\n4\n" + "".join(f"{n} {x} {y} {z}\n" for n, (x, y, z) in enumerate(points, 1)) + "$EndNodes\n"
    text += "$Elements\n2\n1 3 2 1 1 1 2 3 4\n2 3 2 2 1 1 2 3 4\n$EndElements\n"
    (tmp_path / "disc.msh").write_text(text, encoding="utf-8")
    hold = {"xmin": "x", "ymin": "y"}
    disc = BodyFromFile(str(tmp_path / "disc.msh"), hold, move="ymax", distance=0.3, shape="axisymmetric")
    found = respond(disc, material_named("neo-hookean"), [0.0005], steps=1)
    assert found.force[-1] == pytest.approx(np.pi * 2 * 0.0005 * (1.3 - 1.3**-2), rel=1e-3)
    assert set(read_mesh(tmp_path / "disc.msh").sets) >= {"inner", "body"}


@pytest.mark.parametrize("groups", [("3 4", "1 2"), ("4 3", "2 1")])
def test_an_edge_of_two_physical_groups_is_of_both(tmp_path, groups):
    """Version 4.1: the edge at x = 0 and the cell beside it are of two groups, in whatever order they stand."""
    entities = f"1 0 0 0 0 1 0 2 {groups[0]} 0\n2 2 0 0 2 1 0 1 4 0\n1 0 0 0 1 1 0 2 {groups[1]} 0\n2 1 0 0 2 1 0 1 2 0"
    names = '1 3 "left"\n1 4 "ends"\n2 1 "half"\n2 2 "body"'
    nodes = "\n".join(f"{x} {y} 0" for y in (0, 1) for x in (0, 1, 2))
    cells = "1 1 1 1\n1 1 4\n1 2 1 1\n2 3 6\n2 1 3 1\n3 1 2 5 4\n2 2 3 1\n4 2 3 6 5"
    text = f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n4\n{names}\n$EndPhysicalNames\n"
    text += f"$Entities\n0 2 2 0\n{entities}\n$EndEntities\n"
    text += f"$Nodes\n1 6 1 6\n2 1 0 6\n1\n2\n3\n4\n5\n6\n{nodes}\n$EndNodes\n"
    text += f"$Elements\n4 4 1 4\n{cells}\n$EndElements\n"
    (tmp_path / "strip.msh").write_text(text, encoding="utf-8")
    sets = read_mesh(tmp_path / "strip.msh").sets
    wanted = {"left": [0, 3], "ends": [0, 2, 3, 5], "half": [0, 1, 3, 4], "body": [0, 1, 2, 3, 4, 5]}
    assert {name: sets[name].tolist() for name in wanted} == wanted


def test_parts_that_only_touch_and_parts_that_are_free_are_refused(tmp_path):
    cube = fem.Cube(n=3)
    hold = {"xmin": "x", "ymin": "y", "zmin": "z"}
    for gap, reason in ((0.0, r"share no points \(9 places, the first at x, y, z = 1, 0, 0\)"), (0.5, "its 2 parts")):
        points = np.concatenate([cube.points, cube.points + np.array([1 + gap, 0, 0])])
        cells = np.concatenate([cube.cells, cube.cells + len(cube.points)])
        meshio.Mesh(points, [("hexahedron", cells)]).write(tmp_path / "two.vtu")
        with pytest.raises(InputError, match=reason):
            BodyFromFile(str(tmp_path / "two.vtu"), hold, move="ymax", distance=0.1)


@pytest.mark.parametrize(
    ("name", "options", "reason"),
    [
        ("quad", {"hold": {"TOP": "y"}}, r"no set of points 'TOP'; its sets are xmin, xmax, ymin, ymax"),
        ("quad", {"hold": {"ymin": "z"}}, "'ymin' is held in directions such as xy, not 'z'"),
        ("quad", {"shape": ""}, "has 2 dimensions: its shape is axisymmetric or plane, not ''"),
        ("quad", {"axis": "x"}, "axisymmetric moves along y, its axis, not 'x'"),
        ("quad", {"distance": 0.0}, "a number of mm other than zero, not 0"),
        ("quad", {"press": "ymin"}, "either a set that moves or one that is pressed"),
        ("quad8", {"move": "", "press": "ymax"}, "cannot be pressed against cells"),
        ("quad", {"tip_radius": 1.0}, "give press, not move"),
        ("quad", {"move": "", "press": "ymax"}, "moves along y would begin inside the body at the set 'ymax'"),
        ("quad", {"move": "", "press": "ymin", "distance": -0.1}, "moves along -y would begin inside the body"),
        ("quad", {"move": "", "press": "ymin"}, "'ymin' that the tip comes to are held along y"),
        ("hexahedron", {"shape": "", "hold": {"ymin": "y"}}, r"free to move or turn as a whole \(3 of 6 ways\)"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, name, options, reason):
    options = {"hold": {"ymin": "y", "xmin": "x"}, "move": "ymax", "distance": 0.1, "shape": "axisymmetric"} | options
    with pytest.raises(InputError, match=reason):
        BodyFromFile(_written(tmp_path / "block.vtu", name), **options)


def test_a_rim_that_is_held_may_be_of_the_set_that_a_sphere_is_pressed_on_in_its_middle(tmp_path):
    file = _written(tmp_path / "block.vtu", "quad")
    options = {"hold": {"xmax": "xy", "xmin": "x"}, "press": "ymax", "distance": -0.3, "shape": "axisymmetric"}
    assert BodyFromFile(file, tip_radius=1.0, **options).supports(_meshes()["quad"].points).load.radius == 1.0
    with pytest.raises(InputError, match="are held along y"):
        BodyFromFile(file, **options)


def test_a_sphere_that_comes_to_no_point_is_refused(tmp_path):
    """A mesh that does not lie around the axis: Newton's method had nothing to converge to."""
    cube = fem.Cube(n=3)
    meshio.Mesh(cube.points + np.array([5.0, 0, 5.0]), [("hexahedron", cube.cells)]).write(tmp_path / "off.vtu")
    with pytest.raises(InputError, match="comes to no point of the set 'ymax': a sphere's centre is where"):
        BodyFromFile(str(tmp_path / "off.vtu"), {"ymin": "xyz"}, press="ymax", distance=-0.1, tip_radius=1.0)


@pytest.mark.parametrize(
    ("name", "watch", "reason"),
    [
        ("quad", "q", "displacement of the set 'xmax' is along x, y, not 'q'"),
        ("quad", "", "displacement of the set 'xmax' is along x, y, not ''"),
        ("triangle6", "x", "a pressure cannot act on triangles of 6 points"),
    ],
)
def test_a_pressure_that_cannot_be_is_refused(tmp_path, name, watch, reason):
    with pytest.raises(InputError, match=reason):
        InflatedBody(
            _written(tmp_path / "block.vtu", name), {"ymin": "y"}, press="xmin", distance=0.1, shape="axisymmetric",
            watch="xmax", direction=watch,
        )  # fmt: skip


def test_a_pressure_on_all_of_the_surface_is_refused(tmp_path):
    cube, hold = fem.Cube(n=3), {"xmin": "xyz"}
    points, cells = cube.points, [("hexahedron", cube.cells)]
    outer = np.flatnonzero((np.abs(points - 0.5) == 0.5).any(axis=1))
    sets = {"BODY": np.arange(len(points)), "SKIN": outer, "OPEN": np.flatnonzero(points[:, 0] < 1)}
    meshio.Mesh(points, cells, point_sets=sets).write(tmp_path / "cube.inp")
    for name in ("BODY", "SKIN"):
        with pytest.raises(InputError, match=f"the set '{name}' holds all points of the surface .* alone"):
            InflatedBody(str(tmp_path / "cube.inp"), hold, press=name, distance=1.0, watch="xmax")
    for name in ("OPEN", "zmax"):
        InflatedBody(str(tmp_path / "cube.inp"), hold, press=name, distance=1.0, watch="xmax")


def test_files_that_hold_no_such_mesh_are_refused(tmp_path, capfd):
    (tmp_path / "text.msh").write_text("nothing\n", encoding="utf-8")
    linear = fem.Rectangle(n=2).triangulate()
    meshio.Mesh(linear.points, [("triangle", linear.cells)]).write(tmp_path / "linear.vtu")
    points = np.pad(_meshes()["quad"].points, ((0, 0), (0, 1)))
    points[3, 0] = np.nan
    meshio.Mesh(points, [("quad", _meshes()["quad"].cells)]).write(tmp_path / "nan.vtu")
    cube = fem.Cube(n=3)
    written = {suffix: tmp_path / f"cube.{suffix}" for suffix in ("msh", "inp", "vtu")}
    for file in written.values():
        meshio.Mesh(cube.points, [("hexahedron", cube.cells)]).write(file)
    lines = written["inp"].read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "gap.inp").write_text("".join(line for line in lines if not line.startswith("5,")), encoding="utf-8")
    (tmp_path / "cut.msh").write_bytes(written["msh"].read_bytes()[:900])
    (tmp_path / "cut.vtu").write_bytes(written["vtu"].read_bytes()[:900])
    (tmp_path / "empty.inp").write_bytes(b"")
    (tmp_path / "empty.vtu").write_bytes(b"")
    (tmp_path / "nodes.inp").write_text("".join(lines[:20]), encoding="utf-8")
    faces = fem.RegionHexahedronBoundary(cube).mesh.cells_faces
    meshio.Mesh(cube.points, [("quad", faces)]).write(tmp_path / "surface.vtu")
    meshio.Mesh(cube.points, [("line", faces[:, :2])]).write(tmp_path / "lines.vtu")
    capfd.readouterr()
    for file, reason in (
        ("text.msh", "cannot be read as a mesh: it is damaged, cut short, or no .msh file. Write it again"),
        ("cut.msh", "it is damaged, cut short, or no .msh file"),
        ("cut.vtu", "it is damaged, cut short, or no .vtu file"),
        ("gap.inp", "elements or sets have the node 5, which it lacks"),
        ("empty.inp", "is empty: write it again"),
        ("empty.vtu", "is empty: write it again"),
        ("nodes.inp", "has no cells: mesh the body"),
        ("lines.vtu", "has only line: mesh the body"),
        ("surface.vtu", "only the cells of a surface in space .quad.: mesh the volume"),
        ("nan.vtu", "points whose coordinates are no numbers"),
        ("linear.vtu", r"cells triangle; use one of quad, .*gmsh -order 2"),
        ("none.msh", "none.msh' cannot be read"),
    ):
        with pytest.raises(InputError, match=reason):
            BodyFromFile(str(tmp_path / file), {"ymin": "xy"}, move="ymax", distance=1.0, shape="plane")
    assert capfd.readouterr() == ("", "")  # what meshio prints is no second message


def test_the_mesh_of_a_file_is_read_and_its_cells_are_ordered_once(tmp_path, monkeypatch):
    orders = []
    monkeypatch.setattr(np.linalg, "det", lambda corners, det=np.linalg.det: (orders.append(1), det(corners))[1])
    file = _written(tmp_path / "block.vtu", "hexahedron", mirrored=True)
    body = BodyFromFile(file, {"ymin": "xyz"}, move="ymax", distance=0.1)
    assert body.mesh() is body.mesh()
    assert sum(orders) == 1
    other = replace(body, axis="z", hold={"zmin": "xyz"}, move="zmax")
    assert other.mesh().xyz != body.mesh().xyz
    assert set(vars(body)) == {field.name for field in fields(body)}  # tables of sizes are made of these


def test_a_folded_cell_is_refused_with_its_place(tmp_path):
    mesh = fem.Rectangle(b=(WIDTH, HEIGHT), n=3)
    points = np.pad(mesh.points, ((0, 0), (0, 1)))
    points[4] = 1.9, 2.9, 0.0  # the middle, nearly in the corner of one of four cells
    meshio.Mesh(points, [("quad", mesh.cells)]).write(tmp_path / "folded.vtu")
    with pytest.raises(InputError, match=r"folded or have no volume \(\d of 4, the first at x, y, z = "):
        BodyFromFile(str(tmp_path / "folded.vtu"), {"ymin": "xy"}, move="ymax", distance=0.1, shape="plane")


def test_few_full_runs_under_pressure_are_refused(posterior, tmp_path):
    case = InflatedBody(
        _ring(tmp_path / "ring.vtu", 4), {"ymin": "y", "ymax": "y"}, press="xmin", distance=0.05, shape="axisymmetric",
        watch="xmax",
    )  # fmt: skip
    with pytest.raises(InputError, match="compute all draws in full"):
        simulate(posterior, case, draws=6, steps=1, full_runs=4)


@pytest.mark.parametrize(("factor", "shift"), [(1.1, 0.0), (1.0, 0.5), (1000.0, 0.0)])
def test_a_finer_mesh_of_another_body_is_refused(posterior, tmp_path, factor, shift):
    bodies = []
    for name, points, scale in (("coarse", 3, 1.0), ("fine", 5, factor)):
        square = fem.Rectangle(b=(WIDTH, HEIGHT), n=points)
        places = np.pad(scale * square.points + (shift if name == "fine" else 0.0), ((0, 0), (0, 1)))
        meshio.Mesh(places, [("quad", square.cells)]).write(tmp_path / f"{name}.vtu")
        file = str(tmp_path / f"{name}.vtu")
        bodies.append(BodyFromFile(file, {"ymin": "xy"}, move="ymax", distance=0.1, shape="axisymmetric"))
    with pytest.raises(InputError, match=r"the finer mesh is of another body: it reaches from .* to 2, 3, 0"):
        simulate(posterior, bodies[0], 2, steps=1, finer=bodies[1])
