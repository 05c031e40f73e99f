"""What is said of tests in one loading mode whose stresses are not one factor apart."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment import measurement_warnings
from tissuq.assessment.measurements import stresses_apart
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


def test_a_posterior_warns_of_its_measurements():
    tests = two_tests(FALLING)
    posterior = tq.fit(tests, discrepancy="none")
    (warning,) = told(tests)
    assert warning in posterior.warnings
    assert warning not in posterior.warnings_of_fit
    assert "one-direction" in {warning.code for warning in posterior.warnings}


def stretched(factor, end=2.0, name="test", noise=0.003, seed=0):
    stretch = np.linspace(1.0, end, 25)
    scatter = noise * np.random.default_rng(seed).standard_normal(25)
    return tq.Experiment("uniaxial", stretch, factor * (stretch - stretch**-2) + scatter, name)


@pytest.mark.parametrize("order", [1, -1])
def test_a_test_that_was_loaded_less_far_is_compared_where_both_were(order):
    tests = [stretched(1.0, name="far"), stretched(0.2, 1.1, "near", noise=1e-4, seed=1)][::order]
    words = stresses_apart(tq.Experiment.of(tests))
    ratio = float(words.split(" times ")[0].split()[-1])
    assert ("of 'far' is" in words) == (ratio > 1)
    assert max(ratio, 1 / ratio) == pytest.approx(5, rel=0.05)
    assert "where they were loaded alike" in words


@pytest.mark.parametrize(
    "tests",
    [
        [stretched(1.0), stretched(2.5, seed=1)],
        [stretched(1.0), stretched(5.0, 0.8)],  # compressed
        [stretched(factor, seed=seed) for seed, factor in enumerate((0.45, 0.7, 1.0, 1.4, 2.2))],  # specimens
    ],
)
def test_what_tissues_differ_by_is_no_contradiction(tests):
    assert stresses_apart(tq.Experiment.of(tests)) == ""


def test_scatter_larger_than_the_stress_tells_no_ratio():
    pairs = ([stretched(1.0), stretched(0.6, 1.1, noise=0.5, seed=seed)] for seed in range(20))
    assert not any(stresses_apart(tq.Experiment.of(pair)) for pair in pairs)


def test_a_test_in_another_unit_is_told_from_all_others():
    tests = [stretched(factor, name=f"S{seed}", seed=seed) for seed, factor in enumerate((1.0, 1.3, 1000.0, 0.8))]
    assert "of 'S2' is 1e+03 times the median of 3 other tests" in stresses_apart(tq.Experiment.of(tests))


def test_tests_of_one_path_that_differ_by_a_factor_give_no_modulus():
    """Neither fewer points nor another noise is the cure."""
    posterior = tq.fit([stretched(1.0, name="S1"), stretched(0.2, 1.3, "S2", seed=1)], discrepancy="none")
    codes = [warning.code for warning in posterior.warnings]
    assert "tests-apart" in codes
    assert not {"correlated-residuals", "unmodelled-curve"} & {*codes}
    assert posterior.answer.uses[0].verdict.name == "NO"
