"""``tissuq ensemble`` with fibres: CalculiX itself in a deck of one element, and what a deck must be like."""

from __future__ import annotations

import pytest

from one_element import CCX, CORNERS, FREE, calculix

from .conftest import rows_of

MATERIAL = "neo-hookean+exponential-fibres@30"
LINES = [f"{n + 1}, {x}., {y}., {z}." for n, (x, y, z) in enumerate(CORNERS)]
DECK = "\n".join(
    [
        "*NODE, NSET=ALL", *LINES, "*NSET, NSET=TIP", "2, 3, 6, 7", "*ELEMENT, TYPE=C3D8, ELSET=CUBE",
        "1, 1, 2, 3, 4, 5, 6, 7, 8", "*MATERIAL, NAME=ELASTIC_FIBER_WALL", "*ELASTIC", "1., 0.3",
        "*ORIENTATION, NAME=AXES", "0., 1., 0., -1., 0., 0.",
        "*SOLID SECTION, ELSET=CUBE, MATERIAL=ELASTIC_FIBER_WALL, ORIENTATION=AXES", "*STEP, NLGEOM, INC=1000",
        "*STATIC", "0.05, 1., 1e-6, 0.1", "*BOUNDARY",
        *(f"{n}, {axis}, {axis}" for axis in (1, 2, 3) for n, corner in enumerate(CORNERS, 1) if not corner[axis - 1]),
        "TIP, 1, 1, 0.15", "*NODE FILE", "U, RF", "*EL FILE", "S", "*END STEP", "",
    ]
)  # fmt: skip


@pytest.fixture
def sheet(done, here):
    """Return the function that fits fibres to a sheet, into runs/sheet."""
    rows = [
        f"{x},{y},{150 * (x - 1) + 900 * (x - 1) ** 2:.3f},{90 * (y - 1) + 200 * (y - 1) ** 2:.3f}"
        for x in (1.05, 1.1, 1.15, 1.2)
        for y in (1.02, 1.1, 1.15)
    ]
    (here / "sheet.csv").write_text("stretch x,stretch y,stress x (kPa),stress y (kPa)\n" + "\n".join(rows) + "\n")

    def fit(material, discrepancy="none"):
        words = ["--mode", "biaxial", "--material", material, "--noise-sd", 5, "--no-figures"]
        words += ["--discrepancy", discrepancy]
        done("fit", "sheet.csv", *words)

    return fit


@pytest.mark.slow
@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
def test_calculix_pulls_a_cube_of_fibres_along_the_axes_of_the_deck(done, here, sheet):
    sheet(MATERIAL)
    (here / "cube.inp").write_text(DECK)
    words = ["--qoi", "force=RF1@TIP", "--draws", 2, "--max-jobs", 1, "--no-figures", "--out", "out"]
    done("ensemble", "runs/sheet", "cube.inp", "--replace", "ELASTIC_FIBER_WALL", *words)
    done("export", "runs/sheet", "--format", "calculix", "--draws", 2, "--out", "cards")
    forces = [float(row["force"]) for row in rows_of(here / "out" / "draws.csv")]
    for force, card in zip(forces, sorted((here / "cards").glob("*.inp")), strict=True):
        turned = card.read_text() + "*ORIENTATION, NAME=TURNED\n0., 1., 0., -1., 0., 0.\n"
        (wanted,) = calculix(turned, [(1.15, FREE, FREE)], here, orientation="TURNED")
        assert force == pytest.approx(wanted, rel=1e-5)
        (along,) = calculix(card.read_text(), [(1.15, FREE, FREE)], here)
        assert abs(along / force - 1) > 0.1


@pytest.mark.slow
def test_a_deck_must_name_its_material_as_calculix_asks(cli, here, sheet):
    sheet(MATERIAL)
    (here / "cube.inp").write_text(DECK.replace("ELASTIC_FIBER_WALL", "Wall"))
    said = cli("ensemble", "runs/sheet", "cube.inp", "--replace", "wall", "--qoi", "force=RF1@TIP", "--dry-run")
    assert said.status == 2
    assert "rename 'Wall' to 'ELASTIC_FIBER_Wall'" in " ".join(said.err.split())


def test_a_draw_of_fibres_is_chosen_for_a_finer_model(done, here, sheet):
    sheet(MATERIAL)
    (here / "cube.inp").write_text(DECK)
    (here / "fine.inp").write_text(f"** of smaller elements\n{DECK}")
    words = ["--qoi", "force=RF1@TIP", "--draws", 4, "--finer-model", "fine.inp", "--cell-ratio", 2, "--dry-run"]
    done("ensemble", "runs/sheet", "cube.inp", "--replace", "ELASTIC_FIBER_WALL", *words)


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", ["none", "auto"])
def test_axes_of_a_material_of_febio_stay(done, here, sheet, discrepancy):
    sheet("neo-hookean+exponential-fibres@30", discrepancy)
    axes = '<mat_axis type="vector"><a>0,1,0</a><d>1,0,0</d></mat_axis>'
    deck = (
        '<?xml version="1.0"?>\n<febio_spec version="4.0">\n<Material>\n'
        '<material id="1" name="Wall" type="Mooney-Rivlin">\n'
        f"<density>2</density>\n{axes}\n<c1>1</c1>\n</material>\n</Material>\n</febio_spec>\n"
    )
    (here / "wall.feb").write_text(deck)
    (here / "mine.py").write_text("def first(folder):\n    return 1.0\n")
    words = ["--qoi", "first=mine.py:first", "--solver", "febio4", "--dry-run", "--draws", 2, "--all-draws"]
    said = done("ensemble", "runs/sheet", "wall.feb", "--replace", "Wall", *words)
    assert ('+      <solid type="Holzapfel-Gasser-Ogden">' in said.out) == (discrepancy == "auto")
    assert "<gamma>3.0000000000e+01</gamma>" in said.out
    assert f"-{axes}" not in said.out
    assert axes in said.out
