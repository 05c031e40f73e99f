"""Lateral stretches that a test leaves to a material with fibres, against roots of closed forms of its stresses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import tissuq as tq
from tissuq.experiments.modes import AlongAxis2, Planar, Uniaxial, loading_mode
from tissuq.mechanics import engineering_stress, initial_shear_modulus, material_named, stress_basis
from tissuq.mechanics.relative_stiffness import RelativeStiffness, for_states
from tissuq.mechanics.stress import differentiator, path_energy

STRETCH = np.array([0.8, 0.95, 1.05, 1.2, 1.4])
STIFF, SOFT, ACROSS = [0.01, 0.05, 2.0, 0.6], [0.02, 0.0005, 0.1, 0.1], [0.01, 0.02, 5.0, 1.3]


def nominal_stresses(first, second, C10, k1, k2, phi):
    """Holzapfel, Gasser & Ogden (2000) in the plane, the thickness free: the energy's derivatives by both stretches."""
    third, I4 = 1 / (first * second), (first * np.cos(phi)) ** 2 + (second * np.sin(phi)) ** 2
    strain = max(I4 - 1, 0.0)
    pull = 4 * k1 * strain * np.exp(k2 * strain**2)
    return (
        2 * C10 * (first - third**2 / first) + pull * first * np.cos(phi) ** 2,
        2 * C10 * (second - third**2 / second) + pull * second * np.sin(phi) ** 2,
    )


def pulled(stretch, axis, values):
    """Return the stress of the pulled axis where that of the other one is zero."""
    if axis == 1:
        lateral = brentq(lambda x: nominal_stresses(stretch, x, *values)[1], 0.05, 2.0, xtol=1e-15)
        return nominal_stresses(stretch, lateral, *values)[0]
    lateral = brentq(lambda x: nominal_stresses(x, stretch, *values)[0], 0.05, 2.0, xtol=1e-15)
    return nominal_stresses(lateral, stretch, *values)[1]


@pytest.mark.parametrize("values", [STIFF, SOFT, ACROSS], ids=["stiff", "soft", "across"])
@pytest.mark.parametrize("axis", [1, 2])
def test_the_stress_is_that_where_no_lateral_stress_acts(values, axis):
    found = engineering_stress(
        material_named("holzapfel-gasser-ogden"), loading_mode(f"uniaxial@{axis}"), STRETCH, values
    )
    np.testing.assert_allclose(found, [pulled(stretch, axis, values) for stretch in STRETCH], rtol=1e-9)


def test_axis_2_of_an_angle_is_axis_1_of_the_other():
    law = material_named("gasser-ogden-holzapfel")
    along_1, along_2 = (
        engineering_stress(law, loading_mode(name), STRETCH, [0.01, 0.05, 1.0, 0.1, phi])
        for name, phi in (("uniaxial", 0.4), ("uniaxial@2", np.pi / 2 - 0.4))
    )
    np.testing.assert_allclose(along_1, along_2, rtol=1e-10)


def test_fibres_without_a_direction_are_isotropic():
    C10, k1, k2 = 0.01, 0.05, 1.2
    found = engineering_stress(material_named("gasser-ogden-holzapfel"), Uniaxial(), STRETCH, [C10, k1, k2, 1 / 3, 0.5])
    strain = (STRETCH**2 + 2 / STRETCH - 3) / 3  # W = C10 (I1 - 3) + k1/k2 (exp(k2 ((I1 - 3)/3)^2) - 1)
    slope = C10 + 2 / 3 * k1 * strain * np.exp(k2 * strain**2)
    np.testing.assert_allclose(found, 2 * slope * (STRETCH - STRETCH**-2), rtol=1e-10)


def test_fibres_along_axis_1_are_felt_across_it_by_their_matrix_alone():
    law, values = material_named("neo-hookean+exponential-fibres:one@0"), [0.01, 0.05, 2.0]
    tension = STRETCH[STRETCH > 1]
    np.testing.assert_allclose(
        engineering_stress(law, AlongAxis2(Uniaxial()), tension, values), 0.02 * (tension - tension**-2), rtol=1e-9
    )


def locking(first, second, mu, limit, k, phi):
    """Return the stresses of both axes of Gent's law with standard fibres, the thickness free."""
    third, I4 = 1 / (first * second), (first * np.cos(phi)) ** 2 + (second * np.sin(phi)) ** 2
    slope = mu / 2 * limit / (limit - (first**2 + second**2 + third**2 - 3))
    pull = 4 * k * max(I4 - 1, 0.0)
    return (
        2 * slope * (first - third**2 / first) + pull * first * np.cos(phi) ** 2,
        2 * slope * (second - third**2 / second) + pull * second * np.sin(phi) ** 2,
    )


@pytest.mark.parametrize("use_jax", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_matrix_that_locks_not_far_from_there_is_in_equilibrium_too(use_jax):
    values = [0.02, 0.7, 0.1, 0.7]
    law, tension = material_named("gent+standard-fibres"), STRETCH[STRETCH > 1]
    free = [brentq(lambda x, stretch=each: locking(stretch, x, *values)[1], 0.7, 1.0) for each in tension]
    expected = [locking(stretch, lateral, *values)[0] for stretch, lateral in zip(tension, free, strict=True)]
    found = engineering_stress(law, Uniaxial(), tension, values)
    if use_jax:
        grad = differentiator().grad(path_energy, argnums=4)
        found = [
            float(grad(law, Uniaxial().path, float(x), differentiator().numpy.array(values), 0.0)) for x in tension
        ]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_many_parameter_values_are_those_of_each():
    law, values = material_named("holzapfel-gasser-ogden"), np.array([STIFF, SOFT, ACROSS])
    together = engineering_stress(law, Uniaxial(), STRETCH, values)
    np.testing.assert_allclose(
        together, [engineering_stress(law, Uniaxial(), STRETCH, row) for row in values], rtol=1e-12
    )


@pytest.mark.slow
@pytest.mark.parametrize("values", [STIFF, ACROSS], ids=["stiff", "across"])
def test_jax_has_the_same_stress_with_its_derivatives_by_the_parameters(values):
    jax, law = differentiator(), material_named("holzapfel-gasser-ogden")

    def stress(values, stretch):
        return jax.grad(path_energy, argnums=4)(law, Uniaxial().path, stretch, values, 0.0)

    for stretch in (0.9, 1.3):
        assert float(stress(jax.numpy.array(values), stretch)) == pytest.approx(pulled(stretch, 1, values), rel=1e-8)
        slopes = jax.grad(stress)(jax.numpy.array(values), stretch)
        for number, value in enumerate(values):
            low, high = ([*values[:number], value * (1 + step), *values[number + 1 :]] for step in (-1e-5, 1e-5))
            expected = (pulled(stretch, 1, high) - pulled(stretch, 1, low)) / (2e-5 * value)
            assert float(slopes[number]) == pytest.approx(expected, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("name", ["standard-fibres", "neo-hookean+standard-fibres:one@30"])
def test_what_does_not_say_how_it_deforms_is_refused(name):
    law = material_named(name)
    with pytest.raises(tq.ModelError, match="one at an angle shears"):
        engineering_stress(law, Uniaxial(), [1.1], np.full(len(law.parameters), 0.1))


def test_two_stiffnesses_have_no_basis_there_and_their_ratio_does():
    law, states = material_named("holzapfel-gasser-ogden"), Uniaxial().at(STRETCH)
    with pytest.raises(tq.ModelError, match="lateral stretch depends on the stiffness of the fibres over that"):
        stress_basis(law, states, [2.0, 0.6])
    relative = for_states(law, states)
    assert [p.symbol for p in relative.parameters] == ["C10", "k1_over_C10", "k2", "phi"]
    basis = stress_basis(relative, states, [5.0, 2.0, 0.6])
    np.testing.assert_allclose(0.01 * basis[:, 0], [pulled(stretch, 1, STIFF) for stretch in STRETCH], rtol=1e-9)
    assert relative.plain_values([0.01, 5.0, 2.0, 0.6]) == [0.01, 0.05, 2.0, 0.6]
    assert initial_shear_modulus(relative, [0.01, 5.0, 2.0, 0.6]) == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("name", "states"),
    [
        ("neo-hookean", Uniaxial().at(STRETCH)),
        ("holzapfel-gasser-ogden", Planar().at(STRETCH)),
        ("neo-hookean+standard-fibres:one@0", Uniaxial().at(STRETCH)),
        ("mooney-rivlin+standard-fibres", Uniaxial().at(STRETCH)),
    ],
)
def test_other_materials_and_modes_keep_their_parameters(name, states):
    assert not isinstance(for_states(material_named(name), states), RelativeStiffness)
