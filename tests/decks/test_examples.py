"""The example decks, run by CalculiX with a draw: against FElupe on the same mesh, and against a closed form."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import tissuq as tq
from command_line import done_in
from tissuq.decks import Deck, parse_quantity
from tissuq.decks.abaqus import AbaqusDeck
from tissuq.decks.calculix_results import read_frd
from tissuq.decks.fields import element_invariants, final_fields, share_beyond
from tissuq.decks.model_run import ModelRun, carried_out
from tissuq.decks.solver import CalculiXSolver
from tissuq.export import CardSettings, card_format
from tissuq.finite_elements import BodyFromFile, FElupeMaterial, PlateWithHole, respond
from tissuq.mechanics import material_named
from tissuq.mechanics.laws import Rivlin

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
pytestmark = [
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed: make system"),
    pytest.mark.finite_elements,
]

BULK = 1.0
LAWS = {"yeoh": [0.0005, 0.0004, 0.0002], "ogden-2": [0.0009, 0.0002, 3.0, -4.0]}
"""MPa: soft, as the tissue of the decks."""


@pytest.fixture(scope="module")
def draws():
    """The laws as draws, on a model of their range."""
    from dataclasses import replace

    stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3]
    data = tq.simulate("neo-hookean", {"C10": 0.0005}, stretch, noise_sd=2e-5, seed=1)
    like = tq.fit(data, discrepancy="none", noise_sd=2e-5).ensemble(1)

    def draw(law, scale=1.0):
        energy = tq.EnergyDraw(0, ((material_named(law), tuple(scale * value for value in LAWS[law])),), None)
        return replace(like, draws=(energy,))

    return draw


def run(ensemble, deck, material, quantities, folder, source=EXAMPLES, card=None):
    card = card or card_format("calculix").cards(ensemble, CardSettings(bulk_modulus=BULK)).blocks[0]
    task = ModelRun(
        "complete", 0, source, deck, "abaqus", ((material, card),), CalculiXSolver(),
        tuple(parse_quantity(name, text) for name, text in quantities.items()),
        ((material.upper(), ensemble.most),), folder / "draw",
    )  # fmt: skip
    result = carried_out(task)
    assert not result["problem"], result["lines"]
    assert not result["misread"]
    return result


def mesh_of(deck):
    """Return points, cells (hexahedra of 20 nodes) and sets of nodes of a deck, read here by themselves."""
    text = "".join(content.decode() for content in Deck.read(EXAMPLES / deck).files.values())
    nodes = re.search(r"\*NODE, NSET=ALL\n(.*?)(?=\n\*)", text, re.DOTALL)[1]
    elements = "\n".join(re.findall(r"\*ELEMENT, TYPE=C3D20R[^\n]*\n(.*?)(?=\n\*)", text, re.DOTALL))
    points = np.array([[float(word) for word in line.split(",")[1:]] for line in nodes.splitlines()])
    numbers = np.array([int(word) for word in re.findall(r"\d+", elements)]).reshape(-1, 21)
    sets = {
        name: np.isin(np.arange(len(points)) + 1, sorted(each))
        for name, each in AbaqusDeck().node_sets([text.encode()]).items()
    }
    return points, numbers[:, 1:] - 1, sets


def plate_in_felupe(material, travel=1.0):
    """Return the force on the plate's upper edge, and the displacements, from FElupe with the same reduced elements."""
    felupe = pytest.importorskip("felupe")
    points, cells, sets = mesh_of("plate.inp")
    mesh = felupe.Mesh(points, cells, "hexahedron20")
    region = felupe.RegionQuadraticHexahedron(mesh, quadrature=felupe.GaussLegendre(order=1, dim=3))
    field = felupe.FieldContainer([felupe.Field(region, dim=3)])
    body = felupe.SolidBody(material, field)
    fixed = {"LEFT": 0, "BOTTOM": 1, "BACK": 2, "TOP": 1}
    bounds = {
        name: felupe.Boundary(field[0], mask=sets[name], skip=[axis != own for axis in range(3)])
        for name, own in fixed.items()
    }
    steps = np.linspace(0, travel, 6)[1:]
    step = felupe.Step([body], ramp={bounds["TOP"]: steps}, boundaries=bounds)
    felupe.CharacteristicCurve([step], boundary=bounds["TOP"]).evaluate(verbose=0, tol=1e-8)
    force = felupe.tools.force(field, body.results.force, bounds["TOP"])
    return 1e-3 * force[1], field


def invariants_of(field):
    """Return I1 - 3 and I2 - 3 (q, c) of the distortion, from the deformation gradients."""
    gradient = np.moveaxis(field.extract()[0], (0, 1), (-2, -1))
    right = np.swapaxes(gradient, -1, -2) @ gradient
    volume = np.linalg.det(gradient)
    first = np.trace(right, axis1=-2, axis2=-1) * volume ** (-2 / 3) - 3
    inverse = np.trace(np.linalg.inv(right), axis1=-2, axis2=-1) * volume ** (2 / 3) - 3
    return first, inverse


@pytest.mark.parametrize("law", LAWS)
def test_the_plate_has_the_force_and_the_states_that_felupe_finds_on_its_mesh(draws, tmp_path, law):
    pytest.importorskip("felupe")
    ensemble = draws(law)
    result = run(
        ensemble, "plate.inp", "tissue", {"force": "RF2@TOP", "down": "RF2@BOTTOM", "pull": "U2@TOP"}, tmp_path
    )
    times, force = result["curves"]["force"]
    wanted, field = plate_in_felupe(FElupeMaterial(ensemble[0], BULK, unit=1e-3))
    assert times[-1] == 1.0
    assert force[-1] == pytest.approx(wanted, rel=1e-4)
    assert result["curves"]["down"][1][-1] == pytest.approx(-force[-1], rel=1e-4)
    assert result["curves"]["pull"][1][-1] == pytest.approx(1.0)

    body = BodyFromFile(
        str(EXAMPLES / "plate.inp"), {"LEFT": "x", "BOTTOM": "y", "BACK": "z"}, move="TOP", axis="y", distance=1.0
    )  # with one pressure a cell, where CalculiX integrates at fewer points
    assert respond(body, ensemble[0], steps=1).force[0] == pytest.approx(force[-1], rel=5e-3)

    frd = read_frd(tmp_path / "draw" / "plate.frd")
    fields = final_fields(frd)
    np.testing.assert_allclose(fields.displacement, field[0].values, atol=2e-5)
    first, inverse = invariants_of(field)
    assert fields.materials.tolist() == ["TISSUE"] * 40
    ours = fields.invariants.T
    for found, theirs in zip(ours, (first, inverse), strict=True):  # nodes of an element against its points
        assert np.corrcoef(found, theirs.mean(axis=0))[0, 1] > 0.99
        np.testing.assert_allclose(found.mean(), theirs.mean(), rtol=0.05)
    median = float(np.median(ours[0])), 1e9
    shares = share_beyond(frd, {"TISSUE": median})
    assert shares.values[-1] == pytest.approx(0.5)
    assert shares.values[0] == 0
    assert share_beyond(frd, {"FAT": median}) is None
    assert element_invariants(frd, 0).shape == (40, 2)


@pytest.mark.parametrize("law", LAWS)
def test_the_case_of_a_plate_has_the_force_that_calculix_finds_on_its_mesh(draws, tmp_path, law):
    """Cells of eight nodes, for cells without size, against those of twenty with the same corners, which also err."""
    pytest.importorskip("felupe")
    force = run(draws(law), "plate.inp", "tissue", {"force": "RF2@TOP"}, tmp_path)["curves"]["force"][1][-1]
    cases = PlateWithHole(fineness=0.5), PlateWithHole()
    points, cells, _ = mesh_of("plate.inp")
    corners = points[np.unique(cells[:, :8])][:, [1, 0, 2]]
    apart = np.linalg.norm(corners[:, None] - cases[0].mesh().points, axis=-1)
    assert apart.shape[0] == apart.shape[1]
    assert apart.min(axis=1).max() < 2e-6
    values = np.array(LAWS[law])
    shear = 2 * values[0] if law == "yeoh" else values[:2].sum()
    coarse, fine = (
        respond(case, material_named(law), values, steps=2, bulk_ratio=BULK / shear).force[-1] for case in cases
    )
    assert 4 * force == pytest.approx(fine + (fine - coarse) / 3, rel=3e-3)


@pytest.fixture(scope="module")
def cortex():
    """Two draws of a free energy, for which CalculiX has no law."""
    return tq.fit(tq.datasets.load("brain-cortex-uniaxial")).ensemble(2)


@pytest.mark.parametrize(("travel", "reach"), [(0.5, 1.0), (0.69, 1.5)])
def test_a_projected_card_has_the_force_of_its_draw_within_the_error_that_it_states(cortex, tmp_path, travel, reach):
    """The draw in FElupe, its card in FElupe and its card in CalculiX, inside of what was measured and beyond."""
    pytest.importorskip("felupe")
    deck = (EXAMPLES / "plate.inp").read_text(encoding="utf-8")
    assert "\nTOP, 2, 2, 1.\n" in deck
    (tmp_path / "plate.inp").write_text(deck.replace("\nTOP, 2, 2, 1.\n", f"\nTOP, 2, 2, {travel}\n"), encoding="utf-8")
    cards = card_format("calculix").cards(cortex, CardSettings(bulk_modulus=BULK, law="polynomial", order=3))
    for number, (draw, row) in enumerate(zip(cortex, cards.index, strict=True)):
        wanted, field = plate_in_felupe(FElupeMaterial(draw, BULK, unit=1e-3), travel)
        reached = max(each.max() / most for each, most in zip(invariants_of(field), cortex.most, strict=True))
        assert reach - 0.25 < reached < reach
        terms = {name.removeprefix("card_"): row[name] for name in row if name.startswith("card_C")}
        card_material = FElupeMaterial(Rivlin(tuple(terms)), BULK, list(terms.values()), unit=1e-3)
        by_card, _ = plate_in_felupe(card_material, travel)
        result = run(
            cortex, "plate.inp", "tissue", {"force": "RF2@TOP"}, tmp_path / str(number), tmp_path, cards.blocks[number]
        )
        force = result["curves"]["force"][1][-1]
        assert force == pytest.approx(by_card, rel=1e-3)
        assert force == pytest.approx(wanted, rel=row[f"error_within_{reach:g}_max"])


def test_the_tube_opens_as_the_closed_form_says(draws, tmp_path):
    """A thick tube in plane strain: p is the integral of the difference of its principal stresses over ln r."""
    inner, outer, pressure = 2.0, 3.0, 7e-5
    ensemble = draws("yeoh")

    def held(radius):
        def integrand(reference):
            r = np.sqrt(reference**2 + radius**2 - inner**2)
            hoop = r / reference
            slope = sum((n + 1) * value * (hoop**2 + hoop**-2 - 2) ** n for n, value in enumerate(LAWS["yeoh"]))
            return 2 * slope * (hoop**2 - hoop**-2) * reference / r**2

        return quad(integrand, inner, outer)[0]

    wanted = brentq(lambda radius: held(radius) - pressure, inner, 2 * inner) - inner
    result = run(ensemble, "tube.inp", "Wall", {"opening": "U1@INNER", "outer": "U1@OUTER"}, tmp_path)
    assert result["curves"]["opening"][1][-1] == pytest.approx(wanted, rel=2e-3)
    outside = np.sqrt(outer**2 + (inner + wanted) ** 2 - inner**2) - outer
    assert result["curves"]["outer"][1][-1] == pytest.approx(outside, rel=2e-3)


def two_tissues_in_felupe(skin, fat, travel=1.0):
    """Return the force on the punch, and the field, from FElupe with the same reduced elements of both materials."""
    felupe = pytest.importorskip("felupe")
    points, cells, sets = mesh_of("two-tissues.inp")
    is_skin = points[cells, 1].min(axis=1) >= 8.0
    assert is_skin.sum() == 14

    def field_of(cells):
        mesh = felupe.Mesh(points, cells, "hexahedron20")
        region = felupe.RegionQuadraticHexahedron(mesh, quadrature=felupe.GaussLegendre(order=1, dim=3))
        return felupe.FieldContainer([felupe.Field(region, dim=3)])

    field = field_of(cells)
    bodies = [felupe.SolidBody(skin, field_of(cells[is_skin])), felupe.SolidBody(fat, field_of(cells[~is_skin]))]
    fixed = {"MIDDLE": 0, "BOTTOM": 1, "PLANE": 2, "PUNCH": 1}
    bounds = {
        name: felupe.Boundary(field[0], mask=sets[name], skip=[axis != own for axis in range(3)])
        for name, own in fixed.items()
    }
    step = felupe.Step(bodies, ramp={bounds["PUNCH"]: np.linspace(0, -travel, 6)[1:]}, boundaries=bounds)
    felupe.Job([step]).evaluate(x0=field, verbose=0, tol=1e-8)
    total = sum(body.results.force.toarray() for body in bodies)
    return 1e-3 * total.reshape(-1, 3)[sets["PUNCH"], 1].sum(), field


def mixed_run(draws, folder, laws):
    """Run the deck of two tissues with a law in each."""
    formatting = card_format("calculix")
    cards = {
        name: formatting.cards(draws(law, scale), CardSettings(bulk_modulus=BULK)).blocks[0]
        for name, (law, scale) in laws.items()
    }
    quantities = {"force": "RF2@PUNCH", "edge": "U2@SURFACE:max"}
    task = ModelRun(
        "complete", 0, EXAMPLES, "two-tissues.inp", "abaqus", tuple(cards.items()), CalculiXSolver(),
        tuple(parse_quantity(name, text) for name, text in quantities.items()), (), folder,
    )  # fmt: skip
    result = carried_out(task)
    assert (result["problem"], result["misread"]) == ("", "")
    return {name: values[-1] for name, (_, values) in result["curves"].items()}


SKIN_AND_FAT = {"SKIN": ("yeoh", 20.0), "FAT": ("ogden-2", 1.0)}


def test_skin_on_fat_has_the_force_and_the_surface_that_felupe_finds_on_its_mesh(draws, tmp_path):
    """With a card in each of the two materials; with the cards exchanged the force is another."""
    found = mixed_run(draws, tmp_path / "draw", SKIN_AND_FAT)
    skin, fat = (FElupeMaterial(draws(*law)[0], BULK, unit=1e-3) for law in SKIN_AND_FAT.values())
    force, field = two_tissues_in_felupe(skin, fat)
    assert found["force"] == pytest.approx(force, rel=1e-4)
    assert found["edge"] == pytest.approx(field[0].values[mesh_of("two-tissues.inp")[2]["SURFACE"], 1].max(), abs=2e-5)
    fields = final_fields(read_frd(tmp_path / "draw" / "two-tissues.frd"))
    np.testing.assert_allclose(fields.displacement, field[0].values, atol=2e-5)
    assert sorted(set(fields.materials)) == ["FAT", "SKIN"]
    exchanged = mixed_run(
        draws, tmp_path / "exchanged", dict(zip(SKIN_AND_FAT, [*SKIN_AND_FAT.values()][::-1], strict=True))
    )
    assert abs(exchanged["force"] / found["force"] - 1) > 0.5


def test_from_data_to_the_band_of_a_force_with_the_fields(tmp_path):
    """The commands of docs/ensembles.md with few draws."""
    shutil.copy(EXAMPLES / "plate.inp", tmp_path)
    done_in(tmp_path, "fit", "brain-cortex-uniaxial", "--no-figures", "--out", "runs/brain")
    options = [
        "--material",
        "TISSUE",
        "--qoi",
        "force=RF2@TOP",
        "--qoi",
        "peak=MISES:max",
        "--draws",
        3,
        "--max-jobs",
        2,
    ]
    done_in(tmp_path, "ensemble", "runs/brain", "plate.inp", *options)
    folder = tmp_path / "runs" / "brain-plate"
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["quantities"]["force"]["parameters"] + summary["quantities"]["force"][
        "discrepancy"
    ] == pytest.approx(1)
    assert 0 < summary["elements_beyond"] < 1
    mesh = meshio.read(folder / "fields.vtu")
    points, cells, sets = mesh_of("plate.inp")
    np.testing.assert_allclose(mesh.points, points, atol=1e-5)
    np.testing.assert_array_equal(mesh.cells_dict["hexahedron20"], cells)
    np.testing.assert_allclose(mesh.point_data["mean displacement"][sets["TOP"], 1], 1.0)
    np.testing.assert_allclose(mesh.point_data["sd of displacement"][sets["TOP"], 1], 0.0, atol=1e-12)
    assert mesh.point_data["sd of displacement"].max() > 0
    assert mesh.cell_data["mean I1 - 3"][0].shape == (40,)
    assert (folder / "figures" / "states.png").stat().st_size > 1000
