"""The stated error of the evidence is never too small: the exact route against dense quadrature, all over the place."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from against import AXES, BOXES, TRUTH, assert_agrees, both, neo_hookean, parts
from dense import Axis, integrate
from marks import slow_but

STRETCH = np.linspace(0.6, 2.5, 12)
WITH_ERROR = ["constant", "linear", "mooney-rivlin", "yeoh", "gp"]
ALL = ["none", *WITH_ERROR]
NOISE = np.random.default_rng(3).standard_normal(12)


def yeoh(stretch):
    C10, C20, C30 = TRUTH.values()
    x = stretch**2 + 2 / stretch - 3
    return neo_hookean(stretch) * (C10 + 2 * C20 * x + 3 * C30 * x**2)


@pytest.mark.parametrize("discrepancy", [*ALL, "quadratic"])
def test_data_with_a_discrepancy(discrepancy):
    wide = BOXES | dict.fromkeys(("m0", "m1", "m2"), (-1e3, 1e3))  # out of reach, or the oracle takes minutes
    posterior, problem = both(discrepancy, STRETCH, yeoh(STRETCH) + 0.1 * NOISE, 0.1, *parts(discrepancy, wide))
    assert_agrees(posterior, problem)


@pytest.mark.parametrize(
    ("discrepancy", "noise_sd"),
    slow_but([("constant", 0.1), ("linear", 0.1), ("yeoh", 0.1), ("gp", 0.5)], product(WITH_ERROR, (0.1, 0.5))),
)
def test_data_without_any_discrepancy_whose_amplitude_is_pressed_to_zero(discrepancy, noise_sd):
    stress = 1.2 * neo_hookean(STRETCH) + 0.1 * NOISE  # a noise of 0.5 is overstated: nothing is left for S or c
    posterior, problem = both(discrepancy, STRETCH, stress, noise_sd, *parts(discrepancy))
    assert_agrees(posterior, problem)


@pytest.mark.parametrize("discrepancy", slow_but(["none", "constant", "yeoh", "gp"], ALL))
def test_noise_of_a_ten_thousandth_of_the_stress(discrepancy):
    stress = (yeoh(STRETCH) if discrepancy != "none" else 1.2 * neo_hookean(STRETCH)) + 1e-4 * NOISE
    axes = AXES | {symbol: Axis(0, AXES[symbol].high, 1e-4) for symbol in ("S", "c")}
    posterior, problem = both(discrepancy, STRETCH, stress, 1e-4, *parts(discrepancy, axes=axes))
    assert_agrees(posterior, problem)


@pytest.mark.parametrize("discrepancy", ["none", "gp"])
def test_noise_so_large_that_the_priors_decide(discrepancy):
    posterior, problem = both(discrepancy, STRETCH, yeoh(STRETCH), 50.0, *parts(discrepancy))
    assert_agrees(posterior, problem)


@pytest.mark.parametrize(
    ("discrepancy", "factor"),
    slow_but([("none", 1e-3), ("yeoh", 1e-3), ("constant", 1e3), ("gp", 1e3)], product(ALL, (1e-3, 1e3))),
)
def test_stresses_of_kilopascals_and_gigapascals(discrepancy, factor):
    boxes = {symbol: (low * factor, high * factor) for symbol, (low, high) in BOXES.items()}
    axes = AXES | {symbol: Axis(0, AXES[symbol].high * factor, 0.01 * factor) for symbol in ("S", "c")}
    stress = factor * (yeoh(STRETCH) + 0.1 * NOISE)
    posterior, problem = both(discrepancy, STRETCH, stress, 0.1 * factor, *parts(discrepancy, boxes, axes))
    assert_agrees(posterior, problem)


@pytest.mark.parametrize("points", slow_but([4], [4, 5, 6]))
@pytest.mark.parametrize("discrepancy", ["none", "constant", "mooney-rivlin", "gp"])
def test_few_points(discrepancy, points):
    stretch = np.linspace(0.7, 2, points)
    posterior, problem = both(discrepancy, stretch, yeoh(stretch) + 0.1 * NOISE[:points], 0.1, *parts(discrepancy))
    assert_agrees(posterior, problem)


def test_a_residual_of_a_long_wave_and_large_errors_has_two_correlation_lengths():
    errors = np.random.default_rng(2).standard_normal(12)
    stress = 1.2 * neo_hookean(STRETCH) + np.sin(2 * (STRETCH - 0.6)) + 0.15 * errors
    posterior, problem = both("gp", STRETCH, stress, 0.1, *parts("gp"))
    truth = assert_agrees(posterior, problem)
    share, _ = np.histogram(np.log(truth.settings["psi"]), bins=24, weights=truth.weights)
    valleys = [share[i] < 0.6 * min(share[:i].max(), share[i + 1 :].max()) for i in range(1, 23)]
    assert np.array(valleys)[share[1:-1] > 1e-3].any(), "the case must have two modes to test anything"


def test_a_rough_residual_presses_the_correlation_length_to_its_lower_bound():
    stress = 1.2 * neo_hookean(STRETCH) + 0.3 * NOISE
    posterior, problem = both("gp", STRETCH, stress, 0.05, *parts("gp"))
    assert_agrees(posterior, problem)


def test_a_straight_residual_presses_the_correlation_length_to_its_upper_bound():
    axes = AXES | {"psi": Axis(0.05, 1.0, 0.05)}
    posterior, problem = both("gp", STRETCH, 1.2 * neo_hookean(STRETCH) + 0.5 * STRETCH, 0.05, *parts("gp", axes=axes))
    assert_agrees(posterior, problem)


def test_the_oracle_would_see_a_thousandth_of_the_noise():
    linear, axes = parts("constant")
    posterior, _ = both("constant", STRETCH, yeoh(STRETCH), 0.1, linear, axes)
    _, wrong = both("constant", STRETCH, yeoh(STRETCH), 0.1, linear, {"S": Axis(0, 3.01, 0.01)})
    assert abs(posterior.log_evidence - integrate(wrong).log_evidence) > 1e-4 + posterior.log_evidence_error
