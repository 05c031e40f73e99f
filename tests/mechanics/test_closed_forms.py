"""Every material in every loading mode has the stress that tensors and closed forms give."""

from __future__ import annotations

import numpy as np
import pytest

from closed_forms import (
    EVERY,
    ISOTROPIC,
    OF_FIBRES,
    OF_INVARIANTS,
    OF_STRETCHES,
    RELATIVE,
    TURN,
    in_every_mode,
    inverse_langevin,
    langevin,
    tensor_stress,
    values_of,
)
from loading import sheared
from tissuq.mechanics import engineering_stress, initial_shear_modulus
from tissuq.mechanics.material import SUMS
from tissuq.mechanics.user_law import checked

EVERY_MATERIAL = pytest.mark.parametrize("material", EVERY, ids=lambda material: material.name)
EVERY_ISOTROPIC = pytest.mark.parametrize("material", ISOTROPIC, ids=lambda material: material.name)


def test_every_material_has_a_closed_form():
    names = {part for material in EVERY for part in SUMS.get(material.name, material.name).split("+")}
    fibres = {name.partition("@")[0].partition(":")[0] for name in names if "fibres" in name}
    assert fibres == OF_FIBRES.keys()
    assert {name for name in names if "fibres" not in name} <= OF_INVARIANTS.keys() | OF_STRETCHES.keys()


@in_every_mode
def test_stress_is_that_of_the_full_tensors(material, measured):
    assert_stress_of_tensors(material, measured, seed=0)


@pytest.mark.slow
@in_every_mode
def test_stress_is_that_of_the_full_tensors_for_further_values(material, measured):
    for seed in (1, 2):
        assert_stress_of_tensors(material, measured, seed)


def assert_stress_of_tensors(material, measured, seed):
    # In turned axes a component has the rounding errors of the largest one; in those of the test it has its own. A
    # stress of next to nothing has those of the moduli, which are of size one.
    values = values_of(material, seed)
    found = engineering_stress(material, measured.path, measured.points, values)
    for turn, rounding in ((np.eye(3), 1e-13), (TURN, RELATIVE)):
        tensors = [tensor_stress(material.name, values, measured.gradient(each), turn) for each in measured.points]
        for stress, tensor in zip(found, tensors, strict=True):
            least = rounding * np.abs(tensor).max() + 3e-14
            assert stress == pytest.approx(tensor[measured.component], RELATIVE, least)


@pytest.mark.parametrize(
    "material",
    [own if k % 12 == 1 else pytest.param(own, marks=pytest.mark.slow) for k, own in enumerate(EVERY)],
    ids=lambda material: material.name,
)
def test_the_contract_for_materials_holds(material):
    assert [check for check in checked(material) if check.problem] == []


@EVERY_ISOTROPIC
def test_the_initial_modulus_is_the_slope_of_the_tensors_in_shear(material):
    # The moduli are one, so that no two of them cancel; differences of three steps extrapolate to a step of zero.
    values = values_of(material)
    values[[p.is_linear for p in material.parameters]] = 1.0
    steps = np.array([1e-3, 2e-3, 4e-3])
    ends = [[tensor_stress(material.name, values, sheared(sign * h))[0, 1] for h in steps] for sign in (1, -1)]
    slopes = (np.array(ends[0]) - ends[1]) / (2 * steps)
    found = initial_shear_modulus(material, values)
    assert found == pytest.approx(np.polynomial.polynomial.polyfit(steps, slopes, 2)[0], rel=1e-5)


def test_the_inverse_langevin_function_is_as_near_as_stated():
    x = np.geomspace(1e-3, 1e3, 2001)
    error = np.abs(inverse_langevin(langevin(x)) / x - 1)
    assert 2.5e-3 < error.max() < 2.8e-3
