"""The material for FElupe: its stress and tangent, against its energy and against FElupe's own materials."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from deformation_gradients import differences, gradients, rotations
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements import FElupeMaterial
from tissuq.finite_elements.material import distortional_energy
from tissuq.mechanics import Material, engineering_stress, initial_shear_modulus, material_named
from tissuq.parameters.parameter import Parameter

BULK = 3.0
LAWS = {
    "neo-hookean": [0.7],
    "yeoh": [0.7, -0.1, 0.02],
    "gent": [1.4, 30.0],
    "ogden-2": [0.7, 0.2, 3.1, -2.3],
    "demiray": [1.0, 0.8],
}
EQUAL = {
    "the reference": np.eye(3),
    "equibiaxial": np.diag([1.2, 1.2, 0.8]),
    "uniaxial": np.diag([1.3, 0.9, 0.9]),
    "all equal": 1.1 * np.eye(3),
    "nearly equal": np.diag([1.2, 1.2 + 3e-6, 0.8]),
    "equal but for a little": np.diag([1.2, 1.2 + 1e-4, 0.8]),
}


def turned(F, seed=3):
    """The same stretches along other axes, before and after."""
    first, second = rotations(2, seed)
    return np.einsum("ai,ij...,jb->ab...", first, F, second)


def materials(draws):
    """The laws with values, and a draw with its discrepancy."""
    stiff = {name: FElupeMaterial(material_named(name), BULK, values) for name, values in LAWS.items()}
    return stiff | {"draw": FElupeMaterial(draws[1], 1.5 * BULK * 1e-3, unit=1e-3)}


@pytest.mark.parametrize("name", [*LAWS, "draw"])
def test_the_stress_is_the_derivative_of_the_energy(draws, name):
    material, F = materials(draws)[name], gradients()
    expected = differences(lambda F: material.function([F, None])[0], F)
    np.testing.assert_allclose(material.gradient([F, None])[0], expected, atol=2e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", [*LAWS, "draw"])
def test_the_tangent_is_the_derivative_of_the_stress(draws, name):
    material, F = materials(draws)[name], gradients()
    expected = differences(lambda F: material.gradient([F, None])[0], F)
    np.testing.assert_allclose(material.hessian([F, None])[0], expected, atol=2e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", [*LAWS, "draw"])
@pytest.mark.parametrize("state", EQUAL)
def test_equal_stretches_have_their_stress_and_tangent(draws, name, state):
    material, F = materials(draws)[name], turned(EQUAL[state])[:, :, None]
    stress = differences(lambda F: material.function([F, None])[0], F)
    tangent = differences(lambda F: material.gradient([F, None])[0], F, 1e-4)
    scale = np.abs(tangent).max()
    np.testing.assert_allclose(material.gradient([F, None])[0], stress, atol=2e-8 * scale)
    np.testing.assert_allclose(material.hessian([F, None])[0], tangent, atol=3e-7 * scale)


def test_digits_are_not_lost_where_stretches_become_equal():
    """Of the component A_1212, which is (w_1 - w_2) / (l_1 - l_2) and more: 2 C10 J^(-2/3) for a neo-Hookean material.

    Its distortional energy C10 (J^(-2/3) F:F - 3) has A_ijij = 2 C10 J^(-2/3) for diagonal F.
    """
    apart = 10.0 ** np.arange(-16, 0, 0.25)
    F = np.array([np.diag([1.2, 1.2 + each, 0.8]) for each in apart]).transpose(1, 2, 0)
    found = FElupeMaterial(material_named("neo-hookean"), 0.0, [0.7]).hessian([F, None])[0][0, 1, 0, 1]
    expected = 1.4 * np.linalg.det(F.transpose(2, 0, 1)) ** (-2 / 3)
    np.testing.assert_allclose(found, expected, rtol=3e-9)


@pytest.mark.parametrize("name", [*LAWS, "draw"])
def test_the_tangent_has_its_major_symmetry(draws, name):
    found = materials(draws)[name].hessian([gradients(), None])[0]
    np.testing.assert_allclose(found, found.transpose(2, 3, 0, 1, 4), atol=1e-13 * np.abs(found).max())


@pytest.mark.parametrize("name", [*LAWS, "draw"])
def test_the_stress_turns_with_the_body_and_not_with_the_material(draws, name):
    material, F = materials(draws)[name], gradients()
    after, before = rotations(2, 5)
    found = material.gradient([np.einsum("ai,ijn,jb->abn", after, F, before), None])[0]
    expected = np.einsum("ai,ijn,jb->abn", after, material.gradient([F, None])[0], before)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_arrays_have_the_shape_of_quadrature_points_and_cells():
    material = FElupeMaterial(material_named("yeoh"), BULK, LAWS["yeoh"])
    F = gradients(24).reshape(3, 3, 4, 6)
    P, state = material.gradient([F, "kept"])
    assert (P.shape, material.hessian([F, None])[0].shape, state) == ((3, 3, 4, 6), (3, 3, 3, 3, 4, 6), "kept")
    np.testing.assert_array_equal(P[:, :, 2, 3], material.gradient([F[:, :, 2:3, 3:4], None])[0][:, :, 0, 0])


def test_the_initial_shear_modulus_is_that_of_the_material(draws):
    for name, values in LAWS.items():
        law = material_named(name)
        assert distortional_energy(law, values).initial_shear_modulus == pytest.approx(
            initial_shear_modulus(law, values), rel=1e-10
        )
    assert distortional_energy(draws[2]).initial_shear_modulus == pytest.approx(2 * draws[2].values["C10"], rel=1e-6)


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar"])
def test_a_draw_has_the_engineering_stress_that_its_ensemble_says(draws, mode):
    path, stretch = loading_mode(mode), np.array([0.9, 1.1, 1.15])
    F = np.array([[np.diag([float(each) for each in path.deformation(at).stretches])] for at in stretch])[:, 0]
    for number, draw in enumerate(draws):
        P = FElupeMaterial(draw).gradient([F.transpose(1, 2, 0), None])[0]
        free = P[2, 2] * F[:, 2, 2] / F[:, 0, 0]  # the pressure that keeps the third axis free
        np.testing.assert_allclose(P[0, 0] - free, draws.stress(path, stretch)[number], rtol=2e-5, atol=1e-12)


@pytest.mark.slow
def test_an_energy_that_only_jax_differentiates_is_compiled_once(draws):
    traced = []

    class Counted(Material):
        name, formula, source = "counted", "mu/2 (I1 - 3)", "a test"
        parameters = (Parameter("mu", "modulus"),)

        def strain_energy(self, I1, I2, values):
            if isinstance(I1, jax.core.Tracer):
                traced.append(1)
            return jnp.asarray(values[0] / 2 * (I1 - 3))

    F, law = gradients(), Counted()
    FElupeMaterial(law, values=[1.0]).hessian([F, None])
    count = len(traced)
    twice = FElupeMaterial(law, values=[2.0]).hessian([F, None])[0]
    np.testing.assert_allclose(twice, 2 * FElupeMaterial(Counted(), values=[1.0]).hessian([F, None])[0], rtol=1e-14)
    assert count
    assert len(traced) == count


def test_what_is_no_material_for_it_is_refused():
    with pytest.raises(ModelError, match="isotropic matrix and fibres"):
        FElupeMaterial(material_named("standard-fibres"), values=[1.0, 0.5])
    with pytest.raises(ModelError, match="one value for each of C10, C20, C30"):
        FElupeMaterial(material_named("yeoh"), values=[1.0])
    with pytest.raises(InputError, match="bulk modulus"):
        FElupeMaterial(material_named("neo-hookean"), -1.0, [1.0])


def test_a_volume_that_is_not_positive_has_no_stress():
    F = np.diag([1.0, 1.0, -0.1])[:, :, None]
    assert np.isnan(FElupeMaterial(material_named("neo-hookean"), BULK, [1.0]).gradient([F, None])[0]).any()


PAIRS = [  # a name and values here, a function and its arguments in FElupe, and how near it comes
    ("neo-hookean", [0.7], "neo_hooke", {"mu": 1.4}, 1e-12),
    ("mooney-rivlin", [0.7, 0.2], "mooney_rivlin", {"C10": 0.7, "C01": 0.2}, 1e-12),
    ("yeoh", [0.7, -0.1, 0.02], "yeoh", {"C10": 0.7, "C20": -0.1, "C30": 0.02}, 1e-12),
    (
        "ogden-2",
        [0.7, 0.2, 3.1, -2.3],
        "ogden",
        {"mu": [0.7, 0.2], "alpha": [3.1, -2.3]},
        1e-6,
    ),  # FElupe shifts equal roots
]


@pytest.mark.parametrize(("name", "values", "function", "arguments", "near"), PAIRS, ids=[pair[0] for pair in PAIRS])
def test_felupe_has_the_same_stress_and_tangent(name, values, function, arguments, near):
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    theirs = felupe.Hyperelastic(getattr(felupe, function), **arguments)
    ours, F = FElupeMaterial(material_named(name), 0.0, values), gradients()[..., None]
    for method in ("gradient", "hessian"):
        expected = getattr(theirs, method)([F, None])[0]
        np.testing.assert_allclose(getattr(ours, method)([F, None])[0], expected, atol=near * np.abs(expected).max())


def test_the_volumetric_part_is_that_of_felupe():
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    ours, theirs = FElupeMaterial(material_named("neo-hookean"), 7.0, [0.7]), felupe.NeoHooke(mu=1.4, bulk=7.0)
    F = gradients()[..., None]
    for method in ("gradient", "hessian"):
        expected = getattr(theirs, method)([F, None])[0]
        np.testing.assert_allclose(getattr(ours, method)([F, None])[0], expected, atol=1e-12 * np.abs(expected).max())


def cube(felupe, make, stretch):
    """A cube pulled along x in FElupe: the solid, its boundaries, and the load case."""
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(felupe.Cube(n=2)), dim=3)])
    boundaries, case = felupe.dof.uniaxial(field, move=stretch - 1, clamped=False, return_loadcase=True)
    return make(field), boundaries, case


@pytest.mark.finite_elements
def test_a_cube_under_tension_has_the_engineering_stress_of_its_draw(draws):
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    modulus = distortional_energy(draws[0]).initial_shear_modulus
    for stretch in (0.85, 1.2):
        umat = FElupeMaterial(draws[0], 1e5 * modulus, unit=modulus)
        solid, boundaries, case = cube(felupe, lambda field, umat=umat: felupe.SolidBody(umat, field), stretch)
        felupe.newtonraphson(items=[solid], verbose=0, **case)
        force = felupe.tools.force(solid.field, solid.results.force, boundaries["move"])[0] * modulus
        expected = engineering_stress(draws[0], loading_mode("uniaxial"), [stretch], ())[0]
        assert force == pytest.approx(expected, rel=1e-4)  # the volume gives way by about 1e-5


@pytest.mark.finite_elements
def test_newtons_method_converges_quadratically(draws):
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    modulus = distortional_energy(draws[1]).initial_shear_modulus
    umat = FElupeMaterial(draws[1], 20 * modulus, unit=modulus)
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(felupe.Cube(n=3)), dim=3)])
    _, case = felupe.dof.uniaxial(field, move=0.15, clamped=True, return_loadcase=True)
    found = felupe.newtonraphson(items=[felupe.SolidBody(umat, field)], tol=1e-12, verbose=0, **case)
    norms = np.array(found.fnorms)
    orders = np.log(norms[1:]) / np.log(norms[:-1])
    assert norms[-1] < 1e-12
    assert max(orders[(norms[:-1] < 1e-2) & (norms[1:] > 1e-14)]) > 1.7, norms


@pytest.mark.finite_elements
def test_it_goes_into_the_mixed_formulations_of_felupe(draws):
    felupe = pytest.importorskip("felupe", reason="FElupe is not installed")
    modulus = distortional_energy(draws[3]).initial_shear_modulus
    bulk = 500.0
    alone, both = FElupeMaterial(draws[3], unit=modulus), FElupeMaterial(draws[3], bulk * modulus, unit=modulus)
    region = felupe.RegionHexahedron(felupe.Cube(n=3))
    forces = []
    for make in (
        lambda: felupe.SolidBodyNearlyIncompressible(
            alone, felupe.FieldContainer([felupe.Field(region, dim=3)]), bulk=bulk
        ),
        lambda: felupe.SolidBody(felupe.NearlyIncompressible(alone, bulk=bulk), felupe.FieldsMixed(region, n=3)),
        lambda: felupe.SolidBody(felupe.ThreeFieldVariation(both), felupe.FieldsMixed(region, n=3)),
    ):
        solid = make()
        boundaries, case = felupe.dof.uniaxial(solid.field, move=0.1, clamped=True, return_loadcase=True)
        felupe.newtonraphson(items=[solid], x0=solid.field, verbose=0, **case)
        forces.append(felupe.tools.force(solid.field, solid.results.force, boundaries["move"])[0])
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)
    assert forces[2] == pytest.approx(forces[0], rel=2e-3)  # it evaluates the law at the mean volume of a cell
