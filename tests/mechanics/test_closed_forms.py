"""Every material in every loading mode has the stress that tensors and closed forms give."""

from __future__ import annotations

import numpy as np
import pytest

from closed_forms import (
    EVERY,
    MODES,
    OF_INVARIANTS,
    OF_STRETCHES,
    RELATIVE,
    STRETCH,
    inverse_langevin,
    langevin,
    tensor_stress,
    values_of,
)
from tissuq.mechanics import engineering_stress, initial_shear_modulus
from tissuq.mechanics.contract import checked

EVERY_MATERIAL = pytest.mark.parametrize("material", EVERY, ids=lambda material: material.name)
EVERY_MODE = pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)


def test_every_material_has_a_closed_form():
    names = {part for material in EVERY for part in material.name.split("+")}
    assert names <= OF_INVARIANTS.keys() | OF_STRETCHES.keys()


@EVERY_MODE
@EVERY_MATERIAL
@pytest.mark.parametrize("seed", range(3))
def test_stress_is_that_of_the_full_tensors(material, mode, seed):
    values = values_of(material, seed)
    found = engineering_stress(material, mode, STRETCH, values)
    expected = np.array([tensor_stress(material.name, values, mode, each) for each in STRETCH])
    np.testing.assert_allclose(found, expected, rtol=RELATIVE)


@EVERY_MATERIAL
def test_the_contract_for_materials_holds(material):
    assert [check for check in checked(material) if check.problem] == []


@EVERY_MATERIAL
def test_the_initial_modulus_is_a_third_of_the_slope_of_the_tensors(material):
    # The moduli are one, so that no two of them cancel; differences of three steps extrapolate to a step of zero.
    values = values_of(material)
    values[[p.is_linear for p in material.parameters]] = 1.0
    steps = np.array([1e-3, 2e-3, 4e-3])
    ends = [[tensor_stress(material.name, values, MODES[0], 1 + sign * h) for h in steps] for sign in (1, -1)]
    slopes = (np.array(ends[0]) - ends[1]) / (2 * steps) / 3
    found = initial_shear_modulus(material, values)
    assert found == pytest.approx(np.polynomial.polynomial.polyfit(steps, slopes, 2)[0], rel=1e-5)


def test_the_inverse_langevin_function_is_as_near_as_stated():
    x = np.geomspace(1e-3, 1e3, 2001)
    error = np.abs(inverse_langevin(langevin(x)) / x - 1)
    assert 2.5e-3 < error.max() < 2.8e-3
