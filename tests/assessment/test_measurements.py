"""What is said of tests in one loading mode whose stresses are not one factor apart."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment import measurement_warnings
from tissuq.result_warning import Severity

STRETCH = np.linspace(1.0, 2.0, 25)
STRESS = STRETCH - STRETCH**-2


def two_tests(other, specimens=("x", "x"), modes=("uniaxial", "uniaxial"), noise=0.01, seed=0):
    """Return two tests of these specimens whose stresses have the factor ``other`` (n,), and noise."""
    rng = np.random.default_rng(seed)
    tests = [
        tq.Experiment(mode, STRETCH, factor * STRESS + noise * rng.standard_normal(25), name, specimen=specimen)
        for mode, factor, name, specimen in zip(modes, (1.0, other), ("along", "across"), specimens, strict=True)
    ]
    return tq.Experiment.of(tests)


def told(experiment):
    return [warning for warning in measurement_warnings(experiment) if "'along'" in warning]


FALLING = 1 / np.linspace(1.1, 1.7, 25)
"""Factor of the stress from rest to stretch 2: no error of load or area."""


def test_tests_of_one_specimen_that_drift_apart_contradict_each_other():
    (warning,) = told(two_tests(FALLING))
    assert (warning.code, warning.severity) == ("contradicting-tests", Severity.CAUTION)
    assert "the stress of 'along' over that of 'across' is 1.1 near rest and 1.7 at stretch 2," in warning


def test_of_two_specimens_it_is_a_note():
    for specimens in (("x", "y"), ("", "")):
        (note,) = told(two_tests(FALLING, specimens))
        assert note.severity is Severity.NOTE
        assert "taken for a difference between two specimens" in note


def test_one_factor_an_error_of_the_stretch_and_noise_are_nothing_to_tell():
    """Of 60 pairs; slack of 1 % of the strain, a factor of 1.3 and noise of 3 % of the largest stress."""
    slack = np.where(STRETCH > 1.01, (STRETCH - 0.01) - (STRETCH - 0.01) ** -2.0, 0.0) / np.maximum(STRESS, 1e-9)
    assert not any(told(two_tests(1.3 * slack, noise=0.05, seed=seed)) for seed in range(60))


@pytest.mark.parametrize("modes", [("uniaxial", "planar"), ("simple-shear", "uniaxial")])
def test_tests_in_different_modes_are_not_compared(modes):
    assert told(two_tests(FALLING, modes=modes)) == []
