"""Several tests as one: every row has the stress and the deformation of its own test."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.modes import Equibiaxial, Planar, Uniaxial
from tissuq.mechanics.contract import some_values
from tissuq.mechanics.joint import JointExperiment, joined
from tissuq.mechanics.path import invariant_rates, invariants, log_stretches

PARTS = [
    tq.Experiment(Uniaxial(), [0.8, 1.1, 1.3], [-0.5, 0.2, 0.6], name="first"),
    tq.Experiment(Planar(), [1.05, 1.2], [0.1, 0.4], name="second", source="a file"),
    tq.Experiment(Equibiaxial(), [1.1], [0.3], name="third", stress_unit="kPa"),
]
BOTH = joined(PARTS)


@pytest.mark.parametrize("name", [name for name, kind in tq.materials().items() if kind.is_isotropic])
def test_the_stress_of_rows_is_that_of_each_test(name):
    material = tq.materials()[name]()
    values = some_values(material, np.array([0.8, 1.3]))
    expected = np.concatenate([tq.engineering_stress(material, part.mode, part.stretch, values) for part in PARTS])
    assert np.allclose(tq.engineering_stress(material, BOTH.mode, BOTH.stretch, values), expected, rtol=1e-12)


@pytest.mark.parametrize("function", [log_stretches, invariants, invariant_rates])
def test_invariants_and_rates_are_those_of_each_test(function):
    every = zip(*(function(part.mode, part.stretch) for part in PARTS), strict=True)
    for found, expected in zip(function(BOTH.mode, BOTH.stretch), every, strict=True):
        assert np.allclose(found, np.concatenate(expected), rtol=1e-12, atol=1e-15)


def test_many_rows_are_differentiated_by_the_compiler_alike():
    rows = np.repeat(BOTH.stretch, 4000, axis=0)
    found = tq.engineering_stress(tq.materials()["yeoh"](), BOTH.mode, rows, [1.0, 0.2, 0.1])
    few = tq.engineering_stress(tq.materials()["yeoh"](), BOTH.mode, BOTH.stretch, [1.0, 0.2, 0.1])
    assert np.allclose(found.reshape(-1, 4000), few[:, None], rtol=1e-12)


def test_it_looks_like_an_experiment():
    assert isinstance(BOTH, JointExperiment)
    assert (BOTH.name, BOTH.source, BOTH.stress_unit) == ("first + second + third", "a file", "MPa")
    assert len(BOTH) == 6
    assert BOTH.stress.tolist() == [-0.5, 0.2, 0.6, 0.1, 0.4, 0.3]
    assert BOTH.mode.abscissa(BOTH.stretch).tolist() == [0.8, 1.1, 1.3, 1.05, 1.2, 1.1]
    assert BOTH.modes == (Uniaxial(), Planar(), Equibiaxial())
    assert BOTH.mode.name not in tq.loading_modes()


def test_a_single_test_stays_as_it_is():
    assert joined(PARTS[0]) is PARTS[0]
    assert joined(PARTS[:1]) is PARTS[0]


def test_points_of_a_mode_are_rows_of_its_first_test_or_of_none():
    path, rows = BOTH.along(Planar(), np.array([1.3]))
    assert path == BOTH.mode
    assert rows[0, :2].tolist() == [1.0, 1.3]
    _, elsewhere = joined(PARTS[:2]).along(Equibiaxial(), np.array([1.3]))
    assert elsewhere[0, 0] == -1


def test_what_is_no_experiment_is_refused():
    with pytest.raises(tq.InputError, match="there is no experiment to fit"):
        joined([])
    with pytest.raises(tq.InputError, match="experiment number 2 is no"):
        joined([PARTS[0], "uniaxial.csv"])
    with pytest.raises(tq.InputError, match="cannot be added to a fit of several tests"):
        BOTH.joined(PARTS[0])
