"""What a test is to tell of a quantity of a finite-element model."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.next_test.candidates import candidate_named
from tissuq.next_test.next_test import NextTest
from tissuq.next_test.targets import quantity_target, target_named

STRETCH = np.linspace(0.8, 1.3, 12)
STATES = [(mode, np.array([stretch])) for mode in ("uniaxial", "planar") for stretch in (0.85, 1.1, 1.2)]
CANDIDATE = candidate_named("planar 1:1.25 10")


@pytest.fixture(scope="module")
def posterior():
    data = tq.simulate("mooney-rivlin", {"C10": 0.5, "C01": 0.1}, STRETCH, 0.02, seed=1)
    return tq.fit(data, material="mooney-rivlin", discrepancy="none", noise_sd=0.02, tolerances="as-tested")


@pytest.fixture(scope="module")
def draws(posterior):
    """Stresses of draws at the states, and their planar stress at 1.15."""
    ensemble = posterior.ensemble(40, admissible=False)
    stresses = np.concatenate([ensemble.stress(mode, stretch) for mode, stretch in STATES], axis=1)
    return stresses, ensemble.stress("planar", np.array([1.15]))[:, 0]


@pytest.mark.parametrize("specimen", ["same", "other"])
def test_a_quantity_that_is_a_stress_is_expected_as_that_stress(posterior, draws, specimen):
    stresses, planar = draws
    model = posterior.model
    quantity = quantity_target("q", "a force", STATES, stresses, 7 + 3 * planar)
    assert quantity.explained == pytest.approx(1, abs=1e-12)
    targets = [target_named("C10", model), quantity, target_named("planar:1.15", model)]
    next_test = NextTest(posterior.solution, targets, specimen)
    expected = next_test.expected(CANDIDATE)
    assert expected.sd_now[1] == pytest.approx(3 * expected.sd_now[2], rel=1e-6)
    assert expected.sd_after[1] == pytest.approx(3 * expected.sd_after[2], rel=1e-6)
    assert expected.reduction[1] > 0.05


def test_what_is_no_stress_of_the_material_stays_after_every_test(posterior, draws):
    stresses, planar = draws
    error = planar.std() * np.random.default_rng(2).standard_normal(len(planar))
    quantity = quantity_target("q", "a force", STATES, stresses, planar + error)
    stress = target_named("planar:1.15", posterior.model)
    expected = NextTest(posterior.solution, [quantity, stress], "same").expected(CANDIDATE)
    residual = quantity.residual_sd
    assert residual == pytest.approx(planar.std(), rel=0.35)
    assert quantity.explained == pytest.approx(0.5, abs=0.3)
    assert expected.sd_after[0] > residual
    assert expected.reduction[0] < 0.7 * expected.reduction[1]


def test_two_parameters_by_the_normal_equations(posterior, draws):
    """The quantity 2 C10 + C01 in closed form: covariance of least squares with the rows of both tests."""
    stresses, _ = draws
    weights, of_states = np.array([2.0, 1.0]), np.concatenate([_rows(mode, stretch) for mode, stretch in STATES])
    values = stresses @ np.linalg.pinv(of_states).T @ weights  # of the parameters from which these stresses are
    quantity = quantity_target("q", "a displacement", STATES, stresses, values)
    expected = NextTest(posterior.solution, [quantity], "same").expected(CANDIDATE)
    now = _rows("uniaxial", STRETCH)
    after = np.concatenate([now, _rows(CANDIDATE.mode.name, CANDIDATE.stretch)])
    for rows, sd in ((now, expected.sd_now), (after, expected.sd_after)):
        covariance = 0.02**2 * np.linalg.inv(rows.T @ rows)
        assert sd[0] == pytest.approx(float(np.sqrt(weights @ covariance @ weights)), rel=1e-3)


def _rows(mode, stretch):
    """Stresses of unit C10 and C01: 2 (l - 1/l^2) (C10 + C01/l) in tension, 2 (l - 1/l^3) (C10 + C01) in a plane."""
    if mode == "planar":
        column = 2 * (stretch - stretch**-3.0)
        return np.stack([column, column], axis=1)
    column = 2 * (stretch - stretch**-2.0)
    return np.stack([column, column / stretch], axis=1)


@pytest.mark.parametrize(
    ("values", "words"),
    [(np.full(40, 2.0), "1 different values"), (np.where(np.arange(40) < 5, np.arange(40.0), np.nan), "5 draws")],
)
def test_too_few_different_draws_are_refused(draws, values, words):
    with pytest.raises(tq.InputError, match=words):
        quantity_target("ensemble:runs/e:force", "a force", STATES, draws[0], values)


def test_a_stress_of_a_mode_with_several_controls_is_refused(draws):
    with pytest.raises(tq.InputError, match="'biaxial' sets 2 controls"):
        quantity_target("q", "a force", [("biaxial", np.array([[1.1, 1.0]])), *STATES[1:]], draws[0], draws[1])
