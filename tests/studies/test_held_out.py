"""Every test predicted from the others, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from marks import slow_but
from tissuq.assessment.measurements import factors_of_tests

STRETCH = {"uniaxial": np.linspace(0.8, 1.4, 12), "planar": np.linspace(1.02, 1.4, 9)}
UNIT = {
    "uniaxial": 2 * (STRETCH["uniaxial"] - STRETCH["uniaxial"] ** -2),
    "planar": 2 * (STRETCH["planar"] - STRETCH["planar"] ** -3),
}
SCALE = {"uniaxial": 1.1, "planar": 0.95}
NOISE_SD = 0.01


@pytest.fixture(scope="module")
def tests_of_two():
    rng = np.random.default_rng(4)
    return [
        tq.Experiment(
            mode, STRETCH[mode], 0.5 * SCALE[mode] * UNIT[mode] + NOISE_SD * rng.standard_normal(len(UNIT[mode])), mode
        )
        for mode in UNIT
    ]


def test_a_test_is_predicted_with_an_error_of_its_own(tests_of_two):
    first, second = tests_of_two
    found = tq.held_out_tests(
        tests_of_two, discrepancy="none", noise_sd=NOISE_SD, tolerances=tq.Tolerances(stress=0.1)
    ).set_index("test")
    x = UNIT["planar"]
    mean, sd = x @ second.stress / (x @ x), NOISE_SD / np.sqrt(x @ x)
    unit = UNIT["uniaxial"]
    # C10 of one specimen is off by its own error, and so is the new test.
    half = 1.959964 * np.sqrt(NOISE_SD**2 + unit**2 * (sd**2 + 2 * (0.1 * mean) ** 2))
    size = np.sqrt((first.stress**2).mean())
    row = found.loc["uniaxial"]
    assert row["half_width"] == pytest.approx(np.sqrt((half**2).mean()) / size, rel=1e-4)
    assert row["error"] == pytest.approx(np.sqrt(((mean * unit - first.stress) ** 2).mean()) / size, rel=1e-6)
    assert row["inside"] == np.mean(np.abs(first.stress - mean * unit) <= half)
    assert row["C10_median"] == pytest.approx(mean, rel=1e-3)


def test_what_lies_beyond_the_other_tests_is_told_and_left_out(tests_of_two):
    first = tests_of_two[0]
    far = tq.Experiment("planar", [1.1, 1.2, 3.0], [0.1, 0.2, 9.0], "far")
    found = tq.held_out_tests(
        [first, far], discrepancy="none", noise_sd=NOISE_SD, tolerances=tq.Tolerances(stress=0.18)
    )
    found = found.set_index("test")
    assert found.loc["far", "beyond"] == pytest.approx(1 / 3)
    assert found.loc["far", "half_width"] < 2
    assert found.loc["uniaxial", "beyond"] == 0


def test_one_test_cannot_be_predicted_from_others(tests_of_two):
    with pytest.raises(tq.InputError, match="needs two or more tests"):
        tq.held_out_tests(tests_of_two[:1])


@pytest.mark.parametrize("discrepancy", slow_but(["taylor"], ["taylor", "auto"]))
def test_how_far_tests_are_apart_is_told(tests_of_two, discrepancy):
    posterior = tq.fit(tests_of_two, discrepancy="none", noise_sd=NOISE_SD)
    factors = tq.fit(tests_of_two, discrepancy=discrepancy, noise_sd=NOISE_SD).assess().factors
    ratio = factors["uniaxial"] / factors["planar"]
    assert ratio == pytest.approx(1.1 / 0.95, rel=0.06)
    assert posterior.model.tolerances.stress > 0
    assert tq.fit(tests_of_two[0], discrepancy=discrepancy, noise_sd=NOISE_SD).assess().factors == {}


def test_tests_of_one_name_are_numbered_in_their_order(tests_of_two):
    first, second = tests_of_two
    stiffer = tq.Experiment("uniaxial", first.stretch, 1.2 * first.stress, first.name)
    posterior = tq.fit([first, second, stiffer], discrepancy="none", noise_sd=NOISE_SD)
    factors = factors_of_tests(posterior.solution)
    assert list(factors) == ["uniaxial (1)", "planar", "uniaxial (3)"]
    assert factors["uniaxial (3)"] / factors["uniaxial (1)"] == pytest.approx(1.2, rel=1e-3)


def specimens(spread):
    """Five specimens whose stresses have this standard deviation, relative."""
    found = []
    for number, score in enumerate((-1.3, -0.5, 0.5, 1.3, 0.0)):
        noise = NOISE_SD * np.random.default_rng(number).standard_normal(len(UNIT["uniaxial"]))
        stress = 0.5 * (1 + spread * score) * UNIT["uniaxial"] + noise
        found.append(tq.Experiment("uniaxial", STRETCH["uniaxial"], stress, f"specimen {number}"))
    return found


def test_four_specimens_tell_how_far_they_are_apart():
    found = [
        tq.fit(specimens(spread), discrepancy="none", noise_sd=NOISE_SD).model.tolerances for spread in (0.02, 0.4)
    ]
    near, far = (np.hypot(tolerances.stress, tolerances.test) for tolerances in found)
    assert near < 0.06
    assert 0.25 < far < 0.7
