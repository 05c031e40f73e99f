"""Bounds of the linear parameters, one or several at once, against dense quadrature within the same bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tissuq as tq
from against import BOXES, NONLINEAR, assert_agrees, both, neo_hookean, parts
from dense import Axis, Linear, integrate
from marks import slow_but

STRETCH = np.linspace(0.6, 2.5, 12)
WAVE = 0.05 * np.sin(9 * STRETCH)
FOUR = ["none", "constant", "yeoh", "gp"]


@pytest.mark.parametrize("slope", slow_but([0.0, -0.02, -2.0], [0.05, 0.02, 0.0, -0.02, -0.2, -2.0]))
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


@pytest.mark.parametrize(
    "discrepancy",
    ["constant", "mooney-rivlin", *(pytest.param(name, marks=pytest.mark.slow) for name in ("linear", "yeoh"))],
)
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


@pytest.mark.slow
@pytest.mark.parametrize("shift", slow_but([-0.01], [0.01, -0.01]))
def test_three_parameters_that_must_be_positive_under_one_covariance(shift):
    """Evidence and moments of a Gaussian in an octant, by SciPy and by its draws; the size of the error is known."""
    boxes = {symbol: tq.Uniform(0, 5) for symbol in ("C10", "m0", "m1")} | {"S": tq.Uniform(0.01, 0.01 + 1e-9)}
    stress = 0.5 * neo_hookean(SHORT) + shift + 0.3 * (SHORT - 1) ** 2 + ERRORS
    data = tq.Experiment("uniaxial", SHORT, stress)
    posterior = tq.fit(data, discrepancy="linear", noise_sd=0.02, priors=boxes, method="exact")
    X, variance = np.column_stack([neo_hookean(SHORT), np.ones(14), SHORT]), 0.02**2 + 0.01**2
    covariance = variance * np.linalg.inv(X.T @ X)
    mean = covariance @ X.T @ stress / variance
    misfit = stress - X @ mean
    unbounded = -0.5 * misfit @ misfit / variance - 0.5 * (14 - 3) * np.log(2 * np.pi * variance)
    unbounded += 0.5 * np.linalg.slogdet(covariance / variance)[1] - 3 * np.log(5)
    inside = multivariate_normal(-mean, covariance, maxpts=1_000_000, abseps=1e-12, releps=1e-5).cdf(np.zeros(3))
    assert posterior.log_evidence == pytest.approx(unbounded + np.log(inside), abs=2e-3)
    drawn = np.random.default_rng(0).multivariate_normal(mean, covariance, 4_000_000)
    kept = drawn[(drawn > 0).all(axis=1)]
    assert len(kept) > 2000
    for symbol, own in zip(("C10", "m0", "m1"), kept.T, strict=True):
        found, error = posterior.marginals[symbol], own.std() / np.sqrt(len(own))
        assert abs(found.mean - own.mean()) < 5 * error
        assert found.sd == pytest.approx(own.std(), rel=5 / np.sqrt(len(own)))


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.01, -0.1])
@pytest.mark.parametrize("discrepancy", ["linear", "yeoh"])
def test_three_correlated_parameters_that_must_be_positive(discrepancy, shift):
    stress = 0.5 * neo_hookean(SHORT) + shift + 0.3 * (SHORT - 1) ** 2 + ERRORS
    posterior, problem = both(discrepancy, SHORT, stress, 0.02, *narrow(discrepancy))
    assert_agrees(posterior, problem, refine=2)


@pytest.mark.slow
@pytest.mark.parametrize("shift", [-0.03, -0.3])
def test_bounds_that_no_parameter_breaks_alone_but_all_do_together(shift):
    # m0 + m1 l must be positive and the data want it negative; m0 or m1 by itself may well be positive.
    posterior, problem = both("linear", SHORT, 0.5 * neo_hookean(SHORT) + shift + ERRORS, 0.02, *narrow("linear"))
    assert_agrees(posterior, problem, refine=2)


@pytest.mark.slow
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
