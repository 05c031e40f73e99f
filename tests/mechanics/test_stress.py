"""Stress is the derivative of the energy: closed forms, finite differences, the reference state."""

from __future__ import annotations

import numpy as np
import pytest

from closed_forms import ISOTROPIC, in_every_mode, values_of
from loading import MEASURED
from tissuq.experiments.modes import Equibiaxial, Planar, Uniaxial
from tissuq.mechanics import (
    MooneyRivlin,
    NeoHookean,
    Ogden1,
    Ogden2,
    Ogden3,
    Yeoh,
    engineering_stress,
    initial_shear_modulus,
    stress_basis,
)
from tissuq.mechanics.stress import path_energy

STRETCH = np.concatenate([np.linspace(0.4, 0.95, 12), np.linspace(1.05, 4.25, 30)])

EVERY_ISOTROPIC = pytest.mark.parametrize("material", ISOTROPIC, ids=lambda material: material.name)

UNIAXIAL = {  # the paper's eq. 7, 9 and 11, as corrected
    "C10": lambda x: 2 * (x - x**-2),
    "C01": lambda x: 2 * (1 - x**-3),
    "C20": lambda x: 4 * (x**3 - 3 * x + 1 + 3 * x**-2 - 2 * x**-3),
    "C30": lambda x: 6 * (x**5 - 6 * x**3 + 3 * x**2 + 9 * x - 6 - 9 * x**-2 + 12 * x**-3 - 4 * x**-4),
}


def some_values(material, seed):
    """Return values for every parameter: linear ones of size one, the others drawn from their default prior."""
    return values_of(material, seed, largest=36.4)  # I1 - 3 at an equibiaxial stretch of 0.4


def is_linear(material):
    return np.array([parameter.is_linear for parameter in material.parameters])


@pytest.mark.parametrize("material", [NeoHookean(), MooneyRivlin(), Yeoh()], ids=str)
def test_uniaxial_stress_is_its_closed_form(material):
    basis = stress_basis(material, Uniaxial().at(STRETCH))
    for column, parameter in zip(basis.T, material.parameters, strict=True):
        closed = UNIAXIAL[parameter.symbol](STRETCH)  # loses a few digits itself where its terms cancel
        np.testing.assert_allclose(column, closed, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(
    ("mode", "first", "second"),
    [
        (Equibiaxial(), lambda x: 2 * (x - x**-5), lambda x: 2 * (x**3 - x**-3)),
        (Planar(), lambda x: 2 * (x - x**-3), lambda x: 2 * (x - x**-3)),
    ],
    ids=["equibiaxial", "planar"],
)
def test_mooney_rivlin_stress_in_other_modes_is_its_closed_form(mode, first, second):
    basis = stress_basis(MooneyRivlin(), mode.at(STRETCH))
    np.testing.assert_allclose(basis[:, 0], first(STRETCH), rtol=1e-12)
    np.testing.assert_allclose(basis[:, 1], second(STRETCH), rtol=1e-12)


@in_every_mode
def test_stress_is_the_finite_difference_of_the_energy(material, measured):
    values = some_values(material, seed=0)
    step = 1e-6
    energy = [path_energy(material, measured.path, measured.points, values, shift) for shift in (-step, step)]
    slope = (energy[1] - energy[0]) / (2 * step) / measured.path.loaded_axes
    stress = engineering_stress(material, measured.path, measured.points, values)
    # An energy such as a (z^n - 1) is rounded like a, however small it is itself: its rounding error is measured by
    # how much it changes where the points change by a few units in the last place, and reaches the slope over the step.
    nearby = [measured.points * (1 + k * np.finfo(float).eps) for k in range(-8, 9)]
    rounding = np.ptp([path_energy(material, measured.path, points, values) for points in nearby], axis=0).max()
    tolerance = 1e-6 * np.abs(stress).max() + 4 * rounding / (2 * step)
    np.testing.assert_allclose(stress, slope, rtol=1e-6, atol=tolerance)


@in_every_mode
def test_energy_and_stress_vanish_at_the_reference_beside_another_point(material, measured):
    # the short version: by the complex step, which needs a point with a stress, and not by JAX, which compiles each
    values = some_values(material, seed=1)
    rest = measured.mode.reference
    points = np.stack([np.broadcast_to(rest, measured.points[0].shape), measured.points[0]])
    assert path_energy(material, measured.path, rest, values) == pytest.approx(0.0, abs=1e-14)
    assert engineering_stress(material, measured.path, points, values)[0] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.slow
@in_every_mode
def test_energy_and_stress_vanish_at_the_reference(material, measured):
    values = some_values(material, seed=1)
    rest = measured.mode.reference
    assert path_energy(material, measured.path, rest, values) == pytest.approx(0.0, abs=1e-14)
    assert engineering_stress(material, measured.path, [rest], values) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("measured", MEASURED, ids=str)
def test_the_invariants_are_those_of_the_deformation_gradient(measured):
    seen = {}

    class Spy(NeoHookean):
        name = None  # not a material of the library

        def strain_energy(self, I1, I2, values):
            seen["I1"], seen["I2"] = I1, I2
            return I1

    del Spy.name
    path_energy(Spy(), measured.path, measured.points[-2], [1.0])
    F = measured.gradient(measured.points[-2])
    C = F.T @ F
    assert np.linalg.det(F) == pytest.approx(1.0, rel=1e-14)
    assert seen["I1"] == pytest.approx(np.trace(C), rel=1e-14)
    assert seen["I2"] == pytest.approx(0.5 * (np.trace(C) ** 2 - np.trace(C @ C)), rel=1e-13)


@in_every_mode
def test_declared_linear_parameters_really_are_linear(material, measured):
    first, second, both = (some_values(material, seed=2) for _ in range(3))
    linear = is_linear(material)
    second[linear] = np.random.default_rng(5).normal(size=linear.sum())
    both[linear] = 2 * first[linear] - 3 * second[linear]
    first, second, both = engineering_stress(material, measured.path, measured.points, np.stack([first, second, both]))
    np.testing.assert_allclose(both, 2 * first - 3 * second, rtol=1e-10, atol=1e-10 * np.abs(both).max() + 1e-12)


@in_every_mode
def test_the_basis_times_the_linear_parameters_is_the_stress(material, measured):
    values, linear = some_values(material, seed=6), is_linear(material)
    expected = engineering_stress(material, measured.path, measured.points, values)
    found = stress_basis(material, measured.path.at(measured.points), values[~linear]) @ values[linear]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13 * np.abs(expected).max() + 1e-12)


@pytest.mark.parametrize(
    ("material", "values", "modulus"),
    [
        (NeoHookean(), [1.2], 2.4),
        (MooneyRivlin(), [1.2, 0.3], 3.0),
        (Yeoh(), [1.2, -0.057, 0.004], 2.4),
        (Ogden1(), [0.7, -20.0], 0.7),
        (Ogden2(), [0.7, -0.2, 3.7, -11.0], 0.5),
        (Ogden3(), [0.7, 0.4, -0.2, 1.3, 5.0, -2.0], 0.9),
    ],
    ids=str,
)
def test_initial_shear_modulus_is_the_sum_of_the_first_order_terms(material, values, modulus):
    assert initial_shear_modulus(material, values) == pytest.approx(modulus, rel=1e-14)


@EVERY_ISOTROPIC
def test_initial_slope_in_tension_is_three_times_the_shear_modulus(material):
    values = some_values(material, seed=3)
    values[is_linear(material)] = np.abs(values[is_linear(material)])
    step = 1e-5
    below, above = engineering_stress(material, Uniaxial(), [1 - step, 1 + step], values)
    slope = (above - below) / (2 * step)
    # Not nearer, because van der Waals' stress has a term in |stretch - 1|, which this difference does not remove.
    assert slope == pytest.approx(3 * initial_shear_modulus(material, values), rel=2e-5)
