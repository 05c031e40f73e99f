"""The stresses of unit linear parameters, given the others: shapes, derivatives, compilations, words."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import tissuq as tq
from loading import MEASURED
from tissuq.experiments.modes import Biaxial, Equibiaxial, Planar, SimpleShearNormal, Uniaxial
from tissuq.mechanics import (
    Material,
    NeoHookean,
    Ogden1,
    Ogden2,
    Ogden3,
    StretchMaterial,
    material_named,
    stress_basis,
    traced_stress_basis,
)
from tissuq.mechanics.stress import complex_step_stress, differentiator, engineering_stress

jax = differentiator()

STRETCH = np.linspace(0.6, 2.0, 15)
MANY = np.linspace(0.6, 2.0, 500_000)
EVERY_STRESS = pytest.mark.parametrize("measured", MEASURED, ids=str)


class LikeNeoHookean(StretchMaterial):
    """What laws of these tests say of themselves."""

    parameters = (tq.Parameter("mu", "shear modulus"),)
    formula = "mu / 2 (I1 - 3)"
    source = "this file"


def test_several_settings_give_several_bases():
    settings = np.array([[1.3, -2.0], [5.0, -0.7], [20.0, -20.0]])
    bases = stress_basis(Ogden2(), Uniaxial().at(STRETCH), settings)
    assert bases.shape == (3, 15, 2)
    for basis, setting in zip(bases, settings, strict=True):
        np.testing.assert_allclose(stress_basis(Ogden2(), Uniaxial().at(STRETCH), setting), basis, rtol=1e-14)


@pytest.mark.parametrize("name", ["ogden-2+gent+yeoh", "neo-hookean+ogden-4", "holzapfel-gasser-ogden"])
def test_the_basis_of_a_sum_times_its_moduli_is_the_stress_of_its_energy(name):
    material, generator = material_named(name), np.random.default_rng(4)
    linear, path = material.linear_mask, Biaxial().paths[1]
    values = generator.uniform(0.5, 1.2, (6, len(linear)))
    values[:, [p.dimension == "limit" for p in material.parameters]] += 20.0
    points = generator.uniform(0.8, 1.4, (11, 2))
    expected = engineering_stress(material, path, points, values)
    bases = stress_basis(material, path.at(points), values[:, ~linear])
    np.testing.assert_allclose(np.einsum("mnk,mk->mn", bases, values[:, linear]), expected, rtol=1e-12, atol=1e-12)


def test_fibres_at_rest_need_no_compiler():
    points = np.linspace([1.0, 1.0], [1.1, 1.05], 9)
    states, value = Biaxial().paths[0].at(points), np.array([[2.0, 3.0, 0.7]])
    found = complex_step_stress(material_named("exponential-fibres"), states, value)
    I4 = points[:, 0] ** 2 * np.cos(0.7) ** 2 + points[:, 1] ** 2 * np.sin(0.7) ** 2
    slope = 2 * 2.0 * (I4 - 1) * np.exp(3.0 * (I4 - 1) ** 2) * 2 * points[:, 0] * np.cos(0.7) ** 2
    np.testing.assert_allclose(found[0], slope, rtol=1e-12)


def test_a_material_without_nonlinear_parameters_needs_no_setting():
    assert stress_basis(NeoHookean(), Planar().at(STRETCH)).shape == (15, 1)
    assert stress_basis(NeoHookean(), Planar().at(STRETCH), np.empty((4, 0))).shape == (4, 15, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "measured",
    [own if k % 4 == 0 else pytest.param(own, marks=pytest.mark.slow) for k, own in enumerate(MEASURED)],
    ids=str,
)
def test_the_derivative_in_the_exponents_is_the_finite_difference(measured):
    alpha, step = np.array([1.3, 5.0, -2.0]), 1e-5
    basis = partial(traced_stress_basis, Ogden3(), measured.path.at(measured.points))
    found = jax.jit(jax.jacobian(basis))(alpha)
    moved = alpha + step * np.stack([np.eye(3), -np.eye(3)])
    above, below = (stress_basis(Ogden3(), measured.path.at(measured.points), settings) for settings in moved)
    expected = np.moveaxis((above - below) / (2 * step), 0, -1)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-8)


def test_the_gradient_of_a_compiled_density_is_its_finite_difference():
    stress = stress_basis(Ogden1(), Equibiaxial().at(STRETCH), [4.0])[:, 0]

    @jax.jit
    def misfit(alpha):
        return ((traced_stress_basis(Ogden1(), Equibiaxial().at(STRETCH), alpha)[:, 0] - stress) ** 2).sum()

    alpha, step = np.array([3.0]), 1e-6
    slope = (misfit(alpha + step) - misfit(alpha - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(misfit)(alpha), slope, rtol=1e-7)


def test_new_values_compile_nothing_new():
    traced = []

    class Counted(Ogden1):
        """Ogden's one term; it counts how often it is traced."""

        def energy(self, stretches, values):
            traced.append(values)
            return super().energy(stretches, values)

    for alpha in (2.0, 3.0, 4.0):
        stress_basis(Counted(), Uniaxial().at(MANY), [alpha])
    assert len(traced) == 1


@pytest.mark.parametrize(("material", "nonlinear"), [(NeoHookean(), []), (Ogden1(), [3.3])])
@EVERY_STRESS
def test_few_points_and_many_give_the_same_stress(material, nonlinear, measured):
    # Few are differentiated by an imaginary step, many by JAX.
    points = measured.points
    repeated = np.concatenate([points] * (1 + MANY.size // len(points)))
    few, many = (stress_basis(material, measured.path.at(each), nonlinear) for each in (points, repeated))
    np.testing.assert_allclose(few, many[: len(points)], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("material", "nonlinear"), [(NeoHookean(), []), (Ogden1(), [3.3])])
def test_the_compiled_normal_stress_of_no_shear_is_nothing_although_two_stretches_are_equal(material, nonlinear):
    shear, normal = SimpleShearNormal().paths
    for path in (shear, normal):
        at_rest = jax.jit(partial(traced_stress_basis, material, path.at(np.zeros(1))))(np.array(nonlinear))
        assert np.asarray(at_rest) == pytest.approx(0.0, abs=1e-15)


def test_what_an_imaginary_step_cannot_differentiate_is_left_to_jax():
    class WithAbsolute(LikeNeoHookean):
        """Neo-Hookean, in a way that loses the imaginary part."""

        name = "with-absolute"

        def energy(self, stretches, values):
            return 0.5 * values[0] * abs(sum(stretch**2 for stretch in stretches) - 3) + 0 * stretches[0]

    strained = STRETCH[np.abs(STRETCH - 1) > 1e-9]
    for count in (1, 40):
        assert complex_step_stress(WithAbsolute(), Uniaxial().at(strained), np.ones((count, 1))) is None
    expected = stress_basis(NeoHookean(), Uniaxial().at(strained)) / 2
    np.testing.assert_allclose(stress_basis(WithAbsolute(), Uniaxial().at(strained)), expected, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 5, 6, 7, 12, 30, 60, 101])
def test_what_an_imaginary_step_loses_of_one_parameter_is_seen_among_many_settings(count):
    class WithAbsolute(Material):
        """The second term loses the imaginary part, of whichever settings."""

        parameters = (
            tq.Parameter("a", "stiffness"),
            tq.Parameter("b", "stiffness"),
            tq.Parameter("k", "exponent", "number", is_linear=False),
        )
        name = "with-absolute-term"
        formula = "a (I1 - 3) + b |I1 - 3|^k"
        source = "this test"

        def strain_energy(self, I1, I2, values):
            a, b, k = values
            return a * (I1 - 3) + b * abs(I1 - 3) ** k

    states = Uniaxial().at([1.2, 1.5, 1.9])
    exponents = np.linspace(1.5, 2.5, count)[:, None]
    together = stress_basis(WithAbsolute(), states, exponents)
    one_by_one = [stress_basis(WithAbsolute(), states, exponent) for exponent in exponents]
    np.testing.assert_allclose(together, one_by_one, rtol=1e-9)
    assert (together[..., 1] > 0.05).all()


def test_stretches_that_the_caller_changes_are_computed_anew():
    stretch = np.linspace(1.1, 1.6, 5)
    states = []
    for largest in (1.6, 1.5):
        stretch[2] = largest
        states.append(engineering_stress(NeoHookean(), Uniaxial(), stretch, [1.0])[2])
    assert states == pytest.approx([2 * (x - x**-2) for x in (1.6, 1.5)], rel=1e-12)


def test_a_law_that_writes_to_the_stretches_changes_nobody_elses():
    class Writing(LikeNeoHookean):
        """Neo-Hookean, with the squares in place of the stretches."""

        name = "writing"

        def energy(self, stretches, values):
            squares = 0.0
            for stretch in stretches:
                stretch *= stretch
                squares = squares + stretch
            return 0.5 * values[0] * (squares - 3)

    states = Uniaxial().at(STRETCH)
    for _ in range(2):
        expected = stress_basis(NeoHookean(), states) / 2
        np.testing.assert_allclose(stress_basis(Writing(), states), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("material", "nonlinear", "words"),
    [
        (Ogden2(), (), "'ogden-2' is linear in its parameters only at given values of alpha1, alpha2"),
        (Ogden2(), [2.0], "needs 2 of them"),
        (Ogden1(), np.ones((3, 2)), "needs 1 of them"),
        (NeoHookean(), [2.0], "needs 0 of them"),
    ],
)
def test_a_wrong_number_of_values_is_refused_in_words(material, nonlinear, words):
    with pytest.raises(tq.ModelError, match=words):
        stress_basis(material, Uniaxial().at(STRETCH), nonlinear)


def test_an_energy_of_stretches_that_jax_cannot_differentiate_is_refused_in_words():
    class WithNumpy(StretchMaterial):
        """W = mu (ln l1)^2 + ..., written with the wrong library."""

        parameters = (tq.Parameter("mu", "shear modulus"),)
        name = "logarithmic-with-numpy"
        formula = "mu (ln(l1)^2 + ln(l2)^2 + ln(l3)^2)"
        source = "this test"

        def energy(self, stretches, values):
            return values[0] * sum(np.log(stretch) ** 2 for stretch in stretches)

    with pytest.raises(tq.ModelError, match=r"jax\.numpy"):
        stress_basis(WithNumpy(), Uniaxial().at(MANY))
    with pytest.raises(tq.ModelError, match=r"jax\.numpy"):
        tq.initial_shear_modulus(WithNumpy(), [1.0])
