from dataclasses import FrozenInstanceError, replace

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
    data = replace(Experiment("uniaxial", [1.1], [0.1], stress_unit="kPa"), name="other")
    assert (data.name, data.stress[0], data.stress_unit) == ("other", 0.1, "kPa")


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
