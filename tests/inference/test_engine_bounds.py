"""Bounds of the linear parameters, one or several at once, against dense quadrature within the same bounds."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from against import BOXES, NONLINEAR, assert_agrees, both, neo_hookean, parts
from dense import Axis, Linear, integrate

STRETCH = np.linspace(0.6, 2.5, 12)
WAVE = 0.05 * np.sin(9 * STRETCH)
FOUR = ["none", "constant", "yeoh", "gp"]


@pytest.mark.parametrize("slope", [0.05, 0.02, 0.0, -0.02, -0.2, -2.0])
@pytest.mark.parametrize("discrepancy", FOUR)
def test_one_bound_cuts_however_deep(discrepancy, slope):
    stress = slope * neo_hookean(STRETCH) + WAVE
    posterior, problem = both(discrepancy, STRETCH, stress, 0.1, *parts(discrepancy))
    truth = assert_agrees(posterior, problem)
    assert posterior.summary().loc["C10", "hdi_low"] >= 0
    if slope < 0:
        assert truth.hdi[0] < 1e-3 * truth.sd, "the bound must cut to test anything"


@pytest.mark.parametrize("discrepancy", ["none", "constant", "gp"])
def test_an_upper_bound_cuts_like_a_lower_one(discrepancy):
    boxes = BOXES | {"C10": (0.0, 0.9)}
    stress = 1.2 * neo_hookean(STRETCH) + WAVE
    posterior, problem = both(discrepancy, STRETCH, stress, 0.1, *parts(discrepancy, boxes))
    truth = assert_agrees(posterior, problem)
    assert truth.hdi[1] > 0.9 - 1e-3 * truth.sd


@pytest.mark.parametrize("wanted", ["m0", "C20", "S"])
def test_a_bound_of_c10_reaches_the_marginals_of_the_others(wanted):
    discrepancy = {"m0": "constant"}.get(wanted, "yeoh")
    stress = -0.05 * neo_hookean(STRETCH) + WAVE
    posterior, problem = both(discrepancy, STRETCH, stress, 0.1, *parts(discrepancy))
    truth = integrate(problem, wanted if wanted != "S" else "C10")
    mean, sd = (truth.means["S"], truth.sds["S"]) if wanted == "S" else (truth.mean, truth.sd)
    found = posterior.solution.marginals[wanted]
    assert abs(found.mean - mean) <= 1e-3 * sd
    assert abs(found.sd / sd - 1) <= 1e-3


@pytest.mark.parametrize("discrepancy", ["constant", "mooney-rivlin", "linear", "yeoh"])
def test_noise_so_large_that_every_bound_cuts(discrepancy):
    stress = 1.2 * neo_hookean(STRETCH) + WAVE
    posterior, problem = both(discrepancy, STRETCH, stress, 50.0, *parts(discrepancy))
    assert_agrees(posterior, problem)


def narrow(discrepancy):
    """Return a prior under which all linear parameters are positive."""
    boxes = dict.fromkeys(BOXES, (0.0, 5.0))
    return parts(discrepancy, boxes, {"S": Axis(0, 3, 0.01), "c": Axis(0, 3, 0.01), "psi": Axis(0.05, 2, 0.05)})


SHORT = np.linspace(0.75, 1.4, 14)
ERRORS = 0.02 * np.random.default_rng(0).standard_normal(14)


@pytest.mark.parametrize("shift", [0.01, -0.01, -0.1])
@pytest.mark.parametrize("discrepancy", ["constant", "mooney-rivlin"])
def test_two_parameters_that_must_be_positive(discrepancy, shift):
    stress = 0.5 * neo_hookean(SHORT) + shift + 0.3 * (SHORT - 1) ** 2 + ERRORS
    posterior, problem = both(discrepancy, SHORT, stress, 0.02, *narrow(discrepancy))
    assert_agrees(posterior, problem, refine=2)


@pytest.mark.parametrize("shift", [0.01, -0.1])
@pytest.mark.parametrize("discrepancy", ["linear", "yeoh"])
def test_three_correlated_parameters_that_must_be_positive(discrepancy, shift):
    stress = 0.5 * neo_hookean(SHORT) + shift + 0.3 * (SHORT - 1) ** 2 + ERRORS
    posterior, problem = both(discrepancy, SHORT, stress, 0.02, *narrow(discrepancy))
    assert_agrees(posterior, problem, refine=2)


@pytest.mark.parametrize("shift", [-0.03, -0.3])
def test_bounds_that_no_parameter_breaks_alone_but_all_do_together(shift):
    # m0 + m1 l must be positive and the data want it negative; m0 or m1 by itself may well be positive.
    posterior, problem = both("linear", SHORT, 0.5 * neo_hookean(SHORT) + shift + ERRORS, 0.02, *narrow("linear"))
    assert_agrees(posterior, problem, refine=2)


@pytest.mark.parametrize("discrepancy", ["linear", "yeoh"])
def test_draws_and_predictions_stay_within_all_bounds(discrepancy):
    linear, axes = narrow(discrepancy)
    posterior, _ = both(discrepancy, SHORT, 0.5 * neo_hookean(SHORT) - 0.05 + ERRORS, 0.02, linear, axes)
    for symbol in (*linear, *NONLINEAR.get(discrepancy, ("S",))):
        prior = linear.get(symbol) or axes[symbol]
        drawn = posterior.solution.draws[symbol]
        assert prior.low <= drawn.min()
        assert drawn.max() <= prior.high
    lowest = posterior.predict(SHORT, noise=False, discrepancy=False)["low"]
    assert (lowest * np.sign(SHORT - 1) >= -1e-12).all()


def test_a_prior_normal_and_cut_is_the_dense_quadrature_of_it():
    linear, axes = parts("constant")
    linear |= {"C10": Linear(0.0, 3.0, 0.1, 0.2), "m0": Linear(-1.0, 1.0, 0.0, 0.1)}
    posterior, problem = both("constant", STRETCH, 0.02 * neo_hookean(STRETCH) + WAVE, 0.3, linear, axes)
    assert_agrees(posterior, problem)
    assert isinstance(posterior.model.priors["C10"], tq.Normal)
