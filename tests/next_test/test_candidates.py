"""Tests that could be made: their texts, and the usual ones."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.mechanics import material_named
from tissuq.mechanics.invariants import invariants
from tissuq.next_test.candidates import EXTENDED_REACH, candidate_named, default_candidates, reach_of

DATA = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.8, 1.3, 12), 0.02, seed=1)


def usual(**options):
    chosen = {"is_energy": True} | options
    return list(default_candidates(DATA, material_named("neo-hookean"), **chosen))


def test_a_text_names_a_test():
    found = candidate_named("planar 0.8:1.5 8")
    assert found.mode.name == "planar"
    np.testing.assert_allclose(found.stretch, np.linspace(0.8, 1.5, 8))
    assert found.name == "planar 0.8 to 1.5, 8 points"


@pytest.mark.parametrize("text", ["", "planar", "planar 1.5 8", "planar 1.5:1.2 8", "planar 1:1.5 0", "planar 1:1.5 x"])
def test_other_texts_are_refused(text):
    with pytest.raises(tq.InputError, match="write MODE LOW:HIGH POINTS"):
        candidate_named(text)


def test_a_test_in_percent_is_refused():
    with pytest.raises(tq.InputError, match="begins at 110: write stretches"):
        candidate_named("planar 110:130 6")


def test_a_test_has_one_control_and_stretches_that_can_be_set():
    with pytest.raises(tq.InputError, match="2 controls"):
        candidate_named("biaxial 1:1.5 8")
    with pytest.raises(tq.InputError, match="not positive"):
        candidate_named("planar -1:1.5 8")
    assert candidate_named("simple-shear -1:1.5 8").mode.name == "simple-shear"
    assert len(tq.Candidate("constrained-uniaxial", [1.1, 1.2]).mode.stresses) == 2


def test_the_usual_tests_reach_as_far_as_the_data_and_somewhat_beyond():
    tests = [each for each in usual() if not each.is_repeat]
    assert {each.mode.name for each in tests} == {"uniaxial", "equibiaxial", "planar", "simple-shear"}
    most = [each.max() for each in invariants(DATA.mode.at(DATA.stretch))]
    far = []
    for test in tests:
        ratio = max(each.max() / end for each, end in zip(invariants(test.mode.at(test.stretch)), most, strict=True))
        assert reach_of(DATA, test.mode, test.stretch).max() == pytest.approx(ratio)
        far.append(ratio)
        assert len(test.stretch) == 12
    near = [ratio for ratio in far if ratio <= 1 + 1e-9]
    assert len(near) == len(far) / 2
    assert min(near) > 0.8
    assert max(far) <= EXTENDED_REACH * (1 + 1e-9)


def test_the_tests_of_the_data_are_there_again():
    again = [each for each in usual() if each.is_repeat]
    assert [len(each.stretch) for each in again] == [12, 36]
    np.testing.assert_array_equal(again[0].stretch, DATA.stretch)


def test_an_error_of_the_stress_leaves_the_mode_of_the_data():
    assert {each.mode.name for each in usual(is_energy=False)} == {"uniaxial"}
    assert {len(each.stretch) for each in usual(points=(5, 7)) if not each.is_repeat} == {5, 7}
