"""Several tests as one experiment: every stress has the deformation of its own test."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.modes import Biaxial, Equibiaxial, Planar, SimpleShearNormal, States, Uniaxial
from tissuq.mechanics.invariants import invariant_rates, invariants
from tissuq.mechanics.stress import stresses_at
from tissuq.mechanics.user_law import values_within_reach

TESTS = [
    tq.Experiment(Uniaxial(), [0.8, 1.1, 1.3], [-0.5, 0.2, 0.6], name="first"),
    tq.Experiment(Planar(), [1.05, 1.2], [0.1, 0.4], name="second", source="a file", specimen="heart"),
    tq.Experiment(Equibiaxial(), [1.1], [300.0], name="third", stress_unit="kPa"),
]
TOGETHER = tq.Experiment.of(TESTS)
SHEET = tq.Experiment(Biaxial(), [[1.1, 1.0], [1.2, 0.9]], [[0.3, 0.2], [0.5, 0.1]], name="sheet")


@pytest.mark.parametrize("name", [name for name, kind in tq.materials().items() if kind.is_isotropic])
def test_the_stress_of_several_tests_is_that_of_each(name):
    material = tq.materials()[name]()
    values = values_within_reach(material, np.array([0.8, 1.3]))
    expected = np.concatenate([tq.engineering_stress(material, test.mode, test.stretch, values) for test in TESTS])
    assert np.allclose(stresses_at(material, TOGETHER.states, values), expected, rtol=1e-12)


@pytest.mark.parametrize("function", [lambda states: states.log_stretches, invariants, invariant_rates])
def test_invariants_and_rates_are_those_of_each_test(function):
    of_tests = zip(*(function(test.states) for test in TESTS), strict=True)
    for values, expected in zip(function(TOGETHER.states), of_tests, strict=True):
        assert np.allclose(values, np.concatenate(expected), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("repetitions", [1, 4000])
def test_many_states_on_paths_in_any_order_are_differentiated_by_the_compiler_alike(repetitions):
    shear, normal = SimpleShearNormal().paths
    points = [np.array([0.1, 0.3]), np.array([1.2]), np.array([0.2]), np.array([0.9, 1.4, 1.1])]
    paths = [shear, Uniaxial().path, normal, Uniaxial().path]
    parts = [path.at(np.repeat(own, repetitions)) for path, own in zip(paths, points, strict=True)]
    stresses = stresses_at(tq.materials()["yeoh"](), States.joined(parts), [1.0, 0.2, 0.1])
    yeoh = tq.materials()["yeoh"]()
    pairs = zip(paths, points, strict=True)
    of_each = [tq.engineering_stress(yeoh, path, own, [1.0, 0.2, 0.1]) for path, own in pairs]
    assert np.allclose(stresses.reshape(-1, repetitions), np.concatenate(of_each)[:, None], rtol=1e-12)


def test_it_has_the_curves_of_all_tests():
    assert (TOGETHER.name, TOGETHER.source, TOGETHER.stress_unit) == ("first + second + third", "a file", "MPa")
    assert (len(TOGETHER), TOGETHER.size) == (6, 6)
    assert TOGETHER.measured.tolist() == [-0.5, 0.2, 0.6, 0.1, 0.4, 0.3]
    assert TOGETHER.states.abscissa.tolist() == [0.8, 1.1, 1.3, 1.05, 1.2, 1.1]
    assert TOGETHER.states.curve.tolist() == [0, 0, 0, 1, 1, 2]
    assert TOGETHER.modes == (Uniaxial(), Planar(), Equibiaxial())
    assert [test.name for test in TOGETHER.tests] == ["first", "second", "third"]
    assert [test.specimen for test in TOGETHER.tests] == ["", "heart", ""]


def test_two_stresses_of_one_test_are_two_curves_of_it():
    both = tq.Experiment.of([SHEET, *TESTS[:1]])
    assert (len(SHEET), SHEET.size, len(both), both.size) == (2, 4, 5, 7)
    assert SHEET.measured.tolist() == [0.3, 0.5, 0.2, 0.1]
    assert SHEET.states.abscissa.tolist() == [1.1, 1.2, 1.0, 0.9]
    first, second = both.tests
    assert first.has_measurements_of(SHEET)
    assert first.stress.tolist() == [[0.3, 0.2], [0.5, 0.1]]
    assert second.stretch.tolist() == [0.8, 1.1, 1.3]


def test_measurements_are_the_same_in_any_unit():
    stress = [0.1 * 3, 0.7, 1.1]
    test = tq.Experiment("uniaxial", [1.1, 1.2, 1.3], stress)
    in_pa = tq.Experiment("uniaxial", [1.1, 1.2, 1.3], [value * 1e6 / 3 * 3 for value in stress], stress_unit="Pa")
    assert not np.array_equal(test.stress, in_pa.stress)
    assert test.has_measurements_of(in_pa)
    assert not test.has_measurements_of(tq.Experiment("uniaxial", [1.1, 1.2, 1.3], [0.3, 0.7, 1.1001]))


def test_a_single_test_stays_as_it_is():
    assert tq.Experiment.of(TESTS[0]) is TESTS[0]
    assert tq.Experiment.of(TESTS[:1]) is TESTS[0]
    assert tq.Experiment.of([TOGETHER, SHEET]).size == 10


def test_several_tests_have_no_one_mode_stretch_or_stress():
    for name in ("mode", "stretch", "stress"):
        with pytest.raises(tq.InputError, match=r"'first . second . third' are 3 tests, .* take one of its tests"):
            getattr(TOGETHER, name)


def test_points_of_a_mode_are_states_of_its_first_test_or_of_none():
    states = TOGETHER.states_at(np.array([1.3]), Planar())
    assert (states.curves, states.abscissa.tolist()) == ((1,), [1.3])
    elsewhere = tq.Experiment.of(TESTS[:2]).states_at(np.array([1.3]), Equibiaxial())
    assert not elsewhere.is_measured
    assert SHEET.states_at(np.array([[1.3, 1.2]]), Biaxial(), 1).curves == (1,)


def test_single_states_and_thinned_ones_are_those_of_their_paths():
    states = tq.Experiment.of([SHEET, *TESTS]).states
    for number in range(len(states)):
        assert states.among([number]).abscissa == states.abscissa[number : number + 1]
        assert states.among([number]).curve == states.curve[number]
    for numbers in ([0, 1], [1, 3, 4], list(range(len(states)))):
        assert states.among(numbers).abscissa.tolist() == states.abscissa[numbers].tolist()
        assert states.among(numbers).curve.tolist() == states.curve[numbers].tolist()
    assert states.thinned(2).abscissa.tolist() == [1.1, 1.0, 0.8, 1.3, 1.05, 1.1]


def test_states_are_equal_where_paths_points_and_curves_are():
    alike = tq.Experiment(Uniaxial(), TESTS[0].stretch, [1.0, 2.0, 3.0]).states
    assert alike == TESTS[0].states
    assert hash(alike) == hash(TESTS[0].states)
    assert alike != Planar().path.at(TESTS[0].stretch, 0)
    assert alike != Uniaxial().at(TESTS[0].stretch)
    assert alike != Uniaxial().path.at(TESTS[0].stretch + 0.1, 0)


def test_what_is_no_experiment_is_refused():
    with pytest.raises(tq.InputError, match="there is no experiment to fit"):
        tq.Experiment.of([])
    with pytest.raises(tq.InputError, match="experiment number 2 is no"):
        tq.Experiment.of([TESTS[0], "uniaxial.csv"])
    with pytest.raises(tq.InputError, match="cannot be added to a fit of several tests"):
        TOGETHER.joined(TESTS[0])
    with pytest.raises(tq.InputError, match=r"number 1 \('first'\) and 4 \('first'\) hold the same measurements"):
        tq.Experiment.of([*TESTS, TESTS[0]])
