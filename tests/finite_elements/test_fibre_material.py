"""The material for FElupe with fibres: against its energy, under rotations, against the law, and against CalculiX."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, root_scalar

import tissuq as tq
from deformation_gradients import differences, gradients, rotations
from one_element import CCX, FREE, SHEAR, calculix
from tissuq.errors import InputError, ModelError
from tissuq.export import CardSettings, card_format
from tissuq.finite_elements import ClampedBar, FElupeMaterial, respond
from tissuq.mechanics import FibreMaterial, engineering_stress, material_named
from tissuq.parameters.parameter import Parameter

BULK = 3.0
LAWS = {
    "standard-reinforcing": [0.7, 0.9, 0.6],
    "holzapfel-gasser-ogden": [0.7, 0.5, 1.2, 0.6],
    "gasser-ogden-holzapfel": [0.7, 0.5, 1.2, 0.1, 0.6],
    "ogden-1+exponential-fibres:one@30": [0.9, 3.1, 0.5, 1.2],
    "neo-hookean+exponential-fibres:one@0": [0.7, 0.5, 1.2],
}
ALONG, SWAPPED = np.eye(3)[:2], np.eye(3)[1::-1]
ASKEW = rotations(1, 7)[0][:2]
TURN = np.deg2rad(25)
IN_PLANE = np.array([[np.cos(TURN), np.sin(TURN), 0.0], [-np.sin(TURN), np.cos(TURN), 0.0]])
"""Axes 1 and 2 of the test, turned in the plane of a cube's loads."""


def material(name, directions=ASKEW, bulk=BULK):
    return FElupeMaterial(material_named(name), bulk, LAWS[name], unit=1e-3, directions=directions)


def squared_stretches(F, directions, phi, sign):
    """I4 of a family."""
    fibre = np.cos(phi) * directions[0] + sign * np.sin(phi) * directions[1]
    return (np.einsum("ijn,j->in", F, fibre) ** 2).sum(axis=0) / np.linalg.det(F.transpose(2, 0, 1)) ** (2 / 3)


def test_the_energy_is_that_of_fibres_at_their_angles_where_they_are_stretched():
    F = gradients(8)
    I4 = [squared_stretches(F, ASKEW, 0.6, sign) for sign in (1, -1)]
    slack = np.array([each < 1 for each in I4])
    assert slack.all(axis=0).any()
    assert (slack.sum(axis=0) == 1).any()
    assert (~slack).all(axis=0).any()
    J = np.linalg.det(F.transpose(2, 0, 1))
    c10, k = LAWS["standard-reinforcing"][:2]
    expected = c10 * ((F**2).sum(axis=(0, 1)) / J ** (2 / 3) - 3) + BULK / 2 * (J - 1) ** 2
    expected += k / 2 * sum(np.maximum(each - 1, 0) ** 2 for each in I4)
    np.testing.assert_allclose(material("standard-reinforcing").function([F, None])[0], 1e3 * expected, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_stress_and_tangent_are_derivatives_of_the_energy(name):
    umat, F = material(name), gradients(8)
    stress = differences(lambda F: umat.function([F, None])[0], F)
    tangent = differences(lambda F: umat.gradient([F, None])[0], F)
    found = umat.hessian([F, None])[0]
    np.testing.assert_allclose(umat.gradient([F, None])[0], stress, atol=2e-8 * np.abs(stress).max())
    np.testing.assert_allclose(found, tangent, atol=2e-8 * np.abs(tangent).max())
    np.testing.assert_allclose(found, found.transpose(2, 3, 0, 1, 4), atol=1e-13 * np.abs(found).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_the_reference_has_no_stress_and_equal_stretches_have_a_tangent(name):
    umat = material(name)
    assert np.abs(umat.gradient([np.eye(3)[:, :, None], None])[0]).max() < 1e-12
    F = np.diag([1.2, 1.2, 0.8])[:, :, None]
    tangent = differences(lambda F: umat.gradient([F, None])[0], F, 1e-4)
    np.testing.assert_allclose(umat.hessian([F, None])[0], tangent, atol=3e-7 * np.abs(tangent).max())


@pytest.mark.parametrize("name", LAWS)
def test_the_stress_turns_with_the_body_and_with_its_directions(name):
    F, (after, before) = gradients(8), rotations(2, 5)
    P = material(name).gradient([F, None])[0]
    tolerance = 1e-12 * np.abs(P).max()
    turned = material(name).gradient([np.einsum("ai,ijn->ajn", after, F), None])[0]
    np.testing.assert_allclose(turned, np.einsum("ai,ijn->ajn", after, P), atol=tolerance)
    body = material(name, ASKEW @ before.T).gradient([np.einsum("ijn,bj->ibn", F, before), None])[0]
    np.testing.assert_allclose(body, np.einsum("ijn,bj->ibn", P, before), atol=tolerance)
    other = material(name).gradient([np.einsum("ijn,bj->ibn", F, before), None])[0]
    assert np.abs(other - body).max() > 1e-2 * np.abs(P).max()  # the directions matter


@pytest.mark.slow
def test_a_draw_has_the_free_energy_of_its_discrepancy_beside_its_fibres():
    name = "mooney-rivlin+exponential-fibres@40"
    truth = {"C10": 0.01, "C01": 0.01, "k1": 0.05, "k2": 2.0}
    points = np.array([(1.1, 1.1), (1.3, 1.3), (1.2, 1.05), (1.05, 1.2), (1.3, 1.1), (1.1, 1.3)])
    data = tq.simulate(name, truth, points, mode="biaxial", noise_sd=5e-4, seed=1)
    (draw,) = tq.fit(data, material="neo-hookean+exponential-fibres@40", noise_sd=5e-4).ensemble(1)
    assert draw.discrepancy is not None
    umat = FElupeMaterial(draw, directions=ASKEW)
    stretches = np.column_stack([points, 1 / points.prod(axis=1)])
    along = np.vstack([ASKEW, np.cross(*ASKEW)])
    F = np.einsum("ai,na,aj->ijn", along, stretches, along)  # stretched along the axes of the test
    P = np.einsum("ai,ijn,aj->an", along, umat.gradient([F, None])[0], along)
    for axis, path in enumerate(tq.loading_modes()["biaxial"]().paths):
        without_pressure = P[axis] - P[2] * stretches[:, 2] / stretches[:, axis]
        assert without_pressure == pytest.approx(engineering_stress(draw, path, points, ()), rel=1e-9)
    F = gradients(4)
    tangent = differences(lambda F: umat.gradient([F, None])[0], F)
    np.testing.assert_allclose(umat.hessian([F, None])[0], tangent, atol=2e-7 * np.abs(tangent).max())


@pytest.mark.slow
def test_directions_may_differ_from_point_to_point_and_from_cell_to_cell():
    F = gradients(6).reshape(3, 3, 2, 3)
    name, each = "holzapfel-gasser-ogden", np.array([turn[:2] for turn in rotations(6, 11)])
    everywhere = np.moveaxis(each, 0, -1).reshape(2, 3, 2, 3)
    by_cell = everywhere[:, :, :1]
    for method in ("function", "gradient", "hessian"):
        found = getattr(material(name, everywhere), method)([F, None])[0]
        of_cell = getattr(material(name, by_cell), method)([F, None])[0]
        for q, c in np.ndindex(2, 3):
            alone = F[:, :, q : q + 1, c : c + 1]
            one = getattr(material(name, everywhere[:, :, q, c]), method)([alone, None])[0]
            np.testing.assert_allclose(found[..., q, c], one[..., 0, 0], rtol=1e-12)
            one = getattr(material(name, by_cell[:, :, 0, c]), method)([alone, None])[0]
            np.testing.assert_allclose(of_cell[..., q, c], one[..., 0, 0], rtol=1e-12)
    with pytest.raises(InputError, match=r"\(2, 3\), and the body has \(4, 3\)"):
        material(name, everywhere).gradient([gradients(12).reshape(3, 3, 4, 3), None])


NO_AXES = {
    "parallel": [[1, 0, 0], [1, 0, 0]],
    "long": [[1, 0, 0], [0, 2, 0]],
    "oblique": [[1, 0, 0], [0.01, 1, 0]],
    "no number": [[1, 0, 0], [0, np.nan, 0]],
    "three": np.eye(3),
    "one": [1, 0, 0],
    "one point of two": np.stack([ALONG, ALONG * [[1], [1.01]]], axis=-1),
}


@pytest.mark.parametrize("which", NO_AXES)
def test_directions_are_two_unit_vectors_at_a_right_angle(which):
    with pytest.raises(InputError, match="two unit vectors at a right angle"):
        material("standard-reinforcing", NO_AXES[which])


@pytest.mark.slow
def test_fibres_are_compiled_once_for_all_draws_and_directions():
    traced = []

    class Counted(FibreMaterial):
        name, formula, source = "counted-fibres", "k/2 (I4 - 1)^2", "a test"
        parameters = (Parameter("k", "modulus"), Parameter("phi", "number", is_linear=False))

        def fibre_energy(self, I1, I4, values):
            if isinstance(I4, jax.core.Tracer):
                traced.append(1)
            return values[0] / 2 * jnp.square(I4 - 1)

    def tangent(k, phi, directions):
        law = material_named("neo-hookean") + Counted()
        return FElupeMaterial(law, 0.0, [0.7, k, phi], directions=directions).hessian([gradients(), None])[0]

    tangent(1.0, 0.5, ALONG)
    count = len(traced)
    assert count
    assert np.abs(tangent(2.0, 0.7, ASKEW) - tangent(1.0, 0.7, ASKEW)).max() > 0.1
    assert len(traced) == count


def test_a_volume_that_is_not_positive_has_no_stress():
    F = np.diag([1.0, 1.0, -0.1])[:, :, None]
    assert np.isnan(material("standard-reinforcing").gradient([F, None])[0]).any()


def test_a_case_has_no_directions_for_fibres_and_refuses_them():
    pytest.importorskip("felupe", reason="FElupe is not installed")
    name = "standard-reinforcing"
    with pytest.raises(ModelError, match="has fibres"):
        respond(ClampedBar(fineness=0.5), material_named(name), LAWS[name], steps=1)


PULLED = ("standard-reinforcing", "gasser-ogden-holzapfel", "neo-hookean+exponential-fibres:one@0")


def force_on_cube(felupe, umat, load, steps=4):
    """The force on the face at x = 1 of a cube with planes of symmetry, stretched along its axes or free there."""
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(felupe.Cube(n=2)), dim=3)])
    solid = felupe.SolidBody(umat, field)
    for share in np.linspace(0, 1, steps + 1)[1:]:
        boundaries = {}
        for axis, stretch in enumerate(load):
            across = {"skip": tuple(other != axis for other in range(3))}
            boundaries[f"held {axis}"] = felupe.Boundary(field[0], **{f"f{'xyz'[axis]}": 0}, **across)
            if stretch is not FREE:
                face = {f"f{'xyz'[axis]}": 1, "value": share * (stretch - 1)}
                boundaries[f"moved {axis}"] = felupe.Boundary(field[0], **face, **across)
        held, free = felupe.dof.partition(field, boundaries)
        given = felupe.dof.apply(field, boundaries, held)
        felupe.newtonraphson(items=[solid], dof0=held, dof1=free, ext0=given, verbose=0, tol=1e-10)
    return felupe.tools.force(field, solid.results.force, boundaries["moved 0"])[0]


@pytest.mark.finite_elements
@pytest.mark.parametrize("name", PULLED)
def test_a_cube_pulled_along_either_axis_of_the_test_has_the_engineering_stress_of_the_law(name):
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    law, paths = material_named(name), tq.loading_modes()["biaxial"]().paths

    def stress(axis, pulled, across, stretch):
        point = (stretch, across) if pulled == 0 else (across, stretch)
        return engineering_stress(law, paths[axis], [point], LAWS[name])[0]

    forces = []
    for pulled, directions in enumerate((ALONG, SWAPPED)):
        for stretch in (0.9, 1.2):
            across = brentq(lambda across: stress(1 - pulled, pulled, across, stretch), 0.6, 1.4, xtol=1e-13)  # noqa: B023
            expected = stress(pulled, pulled, across, stretch)
            umat = FElupeMaterial(law, 1e5, LAWS[name], directions=directions)
            found = force_on_cube(felupe, umat, (stretch, FREE, FREE))
            assert found == pytest.approx(expected, rel=1e-4)  # the volume gives way by about 1e-5
            forces.append(found)
    assert abs(forces[3] / forces[1] - 1) > 0.1


@pytest.fixture(scope="module")
def card_of():
    """The function that gives a draw of a law of fibres, CalculiX's card of it, and the card's bulk modulus."""
    data = tq.simulate(
        "neo-hookean+standard-fibres@40", {"C10": 0.02, "k": 0.05}, [(1.1, 1.05), (1.2, 1.1), (1.05, 1.2)],
        mode="biaxial", noise_sd=2e-4, seed=1,
    )  # fmt: skip
    like = tq.fit(data, material="neo-hookean+standard-fibres@40", noise_sd=2e-4, discrepancy="none").ensemble(1)

    def card(name, values):
        draw = tq.EnergyDraw(0, ((material_named(name), tuple(values)),), None)
        cards = card_format("calculix").cards(replace(like, draws=(draw,)), CardSettings())
        return draw, *cards.files.values(), cards.index[0]["bulk_modulus"]

    return card


TILTED = "neo-hookean+exponential-fibres:one@30", [0.02, 0.05, 2.0]
TWO_FAMILIES = "holzapfel-gasser-ogden", [0.02, 0.05, 2.0, 0.6]
BIAXIAL = [(1.2, 1.2, FREE), (1.3, 0.9, FREE), (0.9, 1.3, FREE)]
AMOUNTS = (0.3, -0.3)
FIRST, SECOND = (", ".join(f"{each:.15g}" for each in axis) for axis in IN_PLANE)
ORIENTATION = f"*ORIENTATION, NAME=TURNED\n{FIRST}, {SECOND}\n"


@pytest.mark.slow
@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
@pytest.mark.parametrize("case", [TILTED, TWO_FAMILIES], ids=["one family", "two families"])
def test_calculix_has_the_same_stress_in_simple_shear(card_of, tmp_path, case):
    draw, text, bulk = card_of(*case)
    umat = FElupeMaterial(draw, bulk)
    expected = []
    for amount in AMOUNTS:
        F = np.eye(3)
        F[0, 1] = amount
        expected.append((umat.gradient([F[:, :, None], None])[0][:, :, 0] @ F.T)[0, 1])
    assert calculix(text, [(SHEAR, amount) for amount in AMOUNTS], tmp_path) == pytest.approx(expected, rel=1e-5)


@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
@pytest.mark.parametrize("case", [TILTED, TWO_FAMILIES], ids=["one family", "two families"])
def test_calculix_has_the_same_stress_in_biaxial_tension_off_the_axes_of_the_test(card_of, tmp_path, case):
    draw, text, bulk = card_of(*case)
    umat = FElupeMaterial(draw, bulk, directions=IN_PLANE)

    def stress(load, thickness):
        F = np.diag([*load[:2], thickness])[:, :, None]
        return umat.gradient([F, None])[0][:, :, 0]

    expected = []
    for load in BIAXIAL:
        start = 1 / (load[0] * load[1])
        found = root_scalar(lambda l3: stress(load, l3)[2, 2], x0=start, x1=1.0001 * start, xtol=1e-14)  # noqa: B023
        expected.append(stress(load, found.root)[0, 0])
    assert calculix(text + ORIENTATION, BIAXIAL, tmp_path, orientation="TURNED") == pytest.approx(expected, rel=1e-5)


@pytest.mark.finite_elements
@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
def test_the_same_cube_in_felupe_and_in_calculix_needs_the_same_force(card_of, tmp_path):
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    draw, text, bulk = card_of(*TWO_FAMILIES)
    umat = FElupeMaterial(draw, bulk, unit=0.02, directions=IN_PLANE)
    loads = [*BIAXIAL, (1.2, 1.0, FREE)]
    found = [0.02 * force_on_cube(felupe, umat, load) for load in loads]
    assert found == pytest.approx(calculix(text + ORIENTATION, loads, tmp_path, orientation="TURNED"), rel=1e-4)
