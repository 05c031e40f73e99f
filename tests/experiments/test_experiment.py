from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import loading_mode


def test_an_experiment_holds_its_values_as_float64_in_the_given_order():
    data = Experiment("uniaxial", stretch=[2, 1, 1], stress=[3, 0, 1])
    assert data.stretch.dtype == data.stress.dtype == np.float64
    assert data.stretch.tolist() == [2.0, 1.0, 1.0]
    assert data.stress.tolist() == [3.0, 0.0, 1.0]
    assert len(data) == 3


def test_a_mode_may_be_given_by_name_or_as_object():
    planar = loading_mode("planar")
    assert Experiment("planar", [1.1], [0.1]).mode == Experiment(planar, [1.1], [0.1]).mode == planar


def test_an_unknown_mode_is_refused():
    with pytest.raises(ModelError, match="no loading mode named 'torsion'"):
        Experiment("torsion", [1.1], [0.1])


def test_an_experiment_cannot_be_changed():
    data = Experiment("uniaxial", [1.1], [0.1])
    with pytest.raises(FrozenInstanceError):
        data.name = "other"
    with pytest.raises(ValueError, match="read-only"):
        data.stress[0] = 1.0


def test_an_experiment_does_not_follow_changes_of_the_array_it_was_made_from():
    stress = np.array([0.1])
    data = Experiment("uniaxial", [1.1], stress)
    stress[0] = 9.0
    assert data.stress[0] == 0.1


def test_a_copy_with_another_name_keeps_the_values():
    data = Experiment("uniaxial", [1.1], [100], stress_unit="kPa").labelled(name="other")
    assert (data.name, data.stress[0], data.stress_unit) == ("other", 0.1, "kPa")


@pytest.mark.parametrize(("unit", "in_mpa"), [("kPa", 1e-3), ("MPa", 1.0), ("psi", 0.006894757293168361), ("Pa", 1e-6)])
def test_numbers_are_in_the_unit_that_is_said_with_them(unit, in_mpa):
    data = Experiment("uniaxial", [1.0, 1.1], [0.0, 25.0], stress_unit=unit)
    np.testing.assert_allclose(data.stress, [0.0, 25.0 * in_mpa], rtol=1e-12)
    assert data.stress_unit == unit


def test_without_a_unit_numbers_are_in_mpa():
    data = Experiment("uniaxial", [1.1], [0.1])
    assert (data.stress[0], data.stress_unit) == (0.1, "MPa")


def test_a_unit_converts_once_however_often_the_experiment_is_used_again():
    data = Experiment("biaxial", [[1.1, 1.2]], [[2.0, 4.0]], stress_unit="kPa")
    again = Experiment.of([data.joined(data), data.labelled(stress_unit="Pa")])
    for test in again.tests:
        np.testing.assert_allclose(test.stress[0], [2e-3, 4e-3])
    assert [test.stress_unit for test in again.tests] == ["kPa", "Pa"]


def test_quantities_of_pint_are_taken_in_their_units():
    pint = pytest.importorskip("pint")
    units = pint.UnitRegistry()
    lengths = np.array([20.0, 25.0]) * units.mm
    data = Experiment("uniaxial", lengths / (2 * units.cm), np.array([0.0, 40.0]) * units.kPa)
    np.testing.assert_allclose(data.stretch, [1.0, 1.25])
    np.testing.assert_allclose(data.stress, [0.0, 0.04])
    assert data.stress_unit == "kPa"
    shown = Experiment("uniaxial", [1.1], [0.2] * units.newton / units.mm**2, stress_unit="kPa")
    assert (shown.stress[0], shown.stress_unit) == (0.2, "kPa")


@pytest.mark.slow
@pytest.mark.parametrize(("stretch_unit", "stress_unit"), [("mm", "kPa"), ("", "mm"), ("", "N")])
def test_quantities_of_another_dimension_are_refused(stretch_unit, stress_unit):
    units = pytest.importorskip("pint").UnitRegistry()
    with pytest.raises(InputError, match=r"were given where|is not a unit of stress|is a force"):
        Experiment("uniaxial", units.Quantity([1.1], stretch_unit), units.Quantity([0.1], stress_unit))


@pytest.mark.parametrize("unit", ["N", "mPa", "kilo"])
def test_what_is_no_unit_of_stress_is_refused(unit):
    with pytest.raises(InputError, match=unit):
        Experiment("uniaxial", [1.1], [0.1], stress_unit=unit)


@pytest.mark.parametrize(
    ("stretch", "stress", "words"),
    [
        ([1.0, 1.1], [0.0], "2 stretches but 1 stresses"),
        ([], [], "stretch must be a one-dimensional array with values"),
        ([[1.0]], [[0.0]], "stretch must be a one-dimensional array with values"),
        (["a"], [0.0], "stretch must be an array of numbers"),
        (None, [0.0], "stretch"),
        ([1.0, np.nan], [0.0, 1.0], "stretch is nan at position 1"),
        ([1.0, 1.1], [0.0, np.inf], "stress is inf at position 1"),
        ([1.0, 0.0], [0.0, 1.0], "stretch 0 at position 1 is not positive.*if this is a strain, add 1"),
        ([1.0, -1.1], [0.0, 1.0], "stretch -1.1 at position 1 is not positive"),
    ],
)
def test_values_that_are_no_measurement_are_refused_with_their_position(stretch, stress, words):
    with pytest.raises(InputError, match=words):
        Experiment("uniaxial", stretch, stress)


def test_several_controls_and_stresses_are_columns():
    data = Experiment("biaxial", [[1.1, 1.0], [1.2, 0.9]], [[0.2, 0.1], [0.4, 0.0]])
    assert (data.stretch.shape, data.stress.shape, len(data)) == ((2, 2), (2, 2), 2)
    assert len(data.joined(data)) == 4
    held = Experiment("constrained-uniaxial", [1.1, 1.2, 1.3], [[0.2, 0.1], [0.4, 0.2], [0.5, 0.3]])
    assert (held.stretch.shape, held.stress.shape) == ((3,), (3, 2))


def test_an_amount_of_shear_has_either_sign():
    data = Experiment("simple-shear", [-0.2, 0.0, 0.2], [-0.1, 0.0, 0.1])
    assert data.stretch.tolist() == [-0.2, 0.0, 0.2]


@pytest.mark.parametrize(
    ("mode", "stretch", "stress", "words"),
    [
        ("biaxial", [1.1, 1.2], [[0.1, 0.2]], r"2 columns \(stretch of axis 1, stretch of axis 2\).*of shape \(2,\)"),
        ("biaxial", [[1.1, 1.2]], [0.1], r"stress must be an array with 2 columns.*of shape \(1,\)"),
        ("biaxial", [[1.1, -1.2]], [[0.1, 0.1]], "stretch of axis 2 -1.2 at position 0 is not positive"),
        ("thin-tube", [[1.1, 1.2]], [[0.1, np.nan]], "axial engineering stress is nan at position 0"),
        ("thin-tube", np.ones((2, 3)), np.ones((2, 2)), r"2 columns \(hoop stretch, axial stretch\)"),
        ("constrained-uniaxial", [1.1, 1.2], [0.1, 0.2], "stress must be an array with 2 columns"),
        ("biaxial", [[1.1, 1.2]], [[0.1, 0.1], [0.1, 0.1]], "1 stretches but 2 stresses"),
        ("simple-shear", [0.1, np.nan], [0.1, 0.1], "amount of shear is nan at position 1"),
    ],
)
def test_what_a_mode_does_not_measure_is_refused_in_its_words(mode, stretch, stress, words):
    with pytest.raises(InputError, match=words):
        Experiment(mode, stretch, stress)
