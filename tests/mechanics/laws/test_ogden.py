"""Ogden's materials: closed forms in every mode, special cases, conventions, default priors."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from tissuq.experiments.modes import Equibiaxial, Planar, Uniaxial
from tissuq.mechanics import (
    MooneyRivlin,
    NeoHookean,
    Ogden1,
    Ogden2,
    Ogden3,
    engineering_stress,
    initial_shear_modulus,
    stress_basis,
)
from tissuq.mechanics.stress import path_energy

STRETCH = np.concatenate([np.linspace(0.4, 0.95, 12), np.linspace(1.05, 4.25, 30)])
EVERY_OGDEN = pytest.mark.parametrize("material", [Ogden1(), Ogden2(), Ogden3()], ids=str)

CLOSED = {  # stress of a unit modulus: Ogden 1972, section 4, with 2 mu / alpha for his mu
    Uniaxial(): lambda x, a: 2 / a * (x ** (a - 1) - x ** (-a / 2 - 1)),
    Equibiaxial(): lambda x, a: 2 / a * (x ** (a - 1) - x ** (-2 * a - 1)),
    Planar(): lambda x, a: 2 / a * (x ** (a - 1) - x ** (-a - 1)),
}
EVERY_MODE = pytest.mark.parametrize("mode", CLOSED, ids=str)


@EVERY_MODE
@pytest.mark.parametrize("alpha", [-20.0, -4.7, -2.0, -0.5, 0.5, 1.3, 2.0, 5.0, 12.7, 20.0])
def test_stress_is_its_closed_form(mode, alpha):
    (column,) = stress_basis(Ogden1(), mode.at(STRETCH), [alpha]).T
    np.testing.assert_allclose(column, CLOSED[mode](STRETCH, alpha), rtol=1e-12)


@EVERY_MODE
def test_terms_add_up(mode):
    moduli, exponents = [0.63, -0.2, 0.1], [1.3, 5.0, -2.0]
    expected = sum(mu * CLOSED[mode](STRETCH, alpha) for mu, alpha in zip(moduli, exponents, strict=True))
    found = engineering_stress(Ogden3(), mode, STRETCH, moduli + exponents)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


@EVERY_MODE
def test_exponent_two_is_neo_hookean(mode):
    ogden = engineering_stress(Ogden1(), mode, STRETCH, [2 * 1.2, 2.0])
    np.testing.assert_allclose(ogden, engineering_stress(NeoHookean(), mode, STRETCH, [1.2]), rtol=1e-12)


@EVERY_MODE
def test_exponents_two_and_minus_two_are_mooney_rivlin(mode):
    ogden = engineering_stress(Ogden2(), mode, STRETCH, [2 * 1.2, 2 * 0.3, 2.0, -2.0])
    np.testing.assert_allclose(ogden, engineering_stress(MooneyRivlin(), mode, STRETCH, [1.2, 0.3]), rtol=1e-12)


@EVERY_OGDEN
def test_the_initial_shear_modulus_is_the_sum_of_the_moduli(material):
    terms = len(material.parameters) // 2
    moduli, exponents = np.array([0.4, -0.1, 0.3])[:terms], np.array([14.5, -20.0, 1.3])[:terms]
    found = initial_shear_modulus(material, [*moduli, *exponents])
    assert found == pytest.approx(moduli.sum(), rel=1e-13)


@EVERY_OGDEN
def test_energy_and_stress_vanish_exactly_at_the_reference(material):
    values = np.arange(1.0, 1 + len(material.parameters)) / 3
    for mode in CLOSED:
        assert path_energy(material, mode.path, 1.0, values) == 0.0
        assert engineering_stress(material, mode, [1.0], values) == pytest.approx(0.0, abs=1e-15)


@EVERY_MODE
@EVERY_OGDEN
def test_the_energy_of_the_invariants_is_that_of_the_stretches(material, mode):
    terms = len(material.parameters) // 2
    values = [*[0.4, -0.1, 0.3][:terms], *[3.3, -2.1, 7.0][:terms]]
    stretches = mode.principal_stretches(STRETCH)
    squares = [stretch**2 for stretch in stretches]
    I1, I2 = sum(squares), sum(1 / square for square in squares)  # I2 of C is I1 of its inverse, as det C = 1
    expected = material.energy(stretches, values)
    found = material.strain_energy(I1, I2, values)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)
    assert material.strain_energy(3.0, 3.0, values) == pytest.approx(0.0, abs=1e-15)


@EVERY_OGDEN
def test_default_exponents_are_disjoint_and_away_from_zero(material):
    intervals = [p.relative_prior.support for p in material.parameters if not p.is_linear]
    assert all(low * high > 0 for low, high in intervals)
    assert all(first[1] <= second[0] or second[1] <= first[0] for first, second in combinations(intervals, 2))


@EVERY_OGDEN
def test_moduli_come_first_and_exponents_after(material):
    terms = range(1, 1 + len(material.parameters) // 2)
    assert [p.symbol for p in material.parameters] == [f"mu{i}" for i in terms] + [f"alpha{i}" for i in terms]
    assert [p.unit for p in material.parameters] == ["MPa" for _ in terms] + ["" for _ in terms]
