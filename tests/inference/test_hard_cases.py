"""Inputs at the edge: few points, tiny noise, wrong signs, far bounds. Each once gave a wrong number or a crash."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

import tissuq as tq

TRUTH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}


@pytest.mark.parametrize(
    "material", [pytest.param(name, marks=pytest.mark.slow) for name in ("neo-hookean", "mooney-rivlin", "yeoh")]
)
def test_a_process_with_unknown_noise_is_fitted_to_twelve_points(material):
    """The short version is in `test_exact.py`, against dense quadrature."""
    data = tq.simulate("yeoh", TRUTH, np.linspace(0.6, 2.5, 12), 0.02, seed=1)
    posterior = tq.fit(data, material=material, discrepancy="gp", method="exact")
    assert np.isfinite(posterior.log_evidence)
    assert np.isfinite(posterior.summary().to_numpy()).all()


@pytest.mark.parametrize("noise_sd", [0.05, 0.005])
@pytest.mark.parametrize("discrepancy", ["none", "constant"])
def test_stresses_of_the_wrong_sign_press_c10_to_zero_without_a_crash(noise_sd, discrepancy):
    stretch = np.linspace(0.7, 1.6, 12)
    x = 2 * (stretch - stretch**-2)
    data = tq.Experiment("uniaxial", stretch, -0.2 * x)
    posterior = tq.fit(data, discrepancy=discrepancy, noise_sd=noise_sd, priors={"C10": tq.Uniform(0, 10)})
    c10 = posterior.solution.marginals["C10"]
    assert c10.hdi()[0] == pytest.approx(0, abs=1e-3)
    if discrepancy == "none":  # far beyond the bound the posterior is exponential with this rate
        rate = 0.2 * (x @ x) / noise_sd**2
        assert c10.mean == pytest.approx(1 / rate, rel=0.01)


@pytest.mark.parametrize("n", [3, 4, 6])
def test_with_unknown_noise_and_few_points_c10_has_its_heavy_tails(n):
    stretch = np.linspace(0.8, 1.6, n)
    x = 2 * (stretch - stretch**-2)
    data = tq.Experiment("uniaxial", stretch, 1.5 * x + 1e-4 * np.cos(np.arange(n)))
    priors = {"C10": tq.Uniform(0, 10), "noise_sd": tq.Uniform(0, 10)}
    posterior = tq.fit(data, discrepancy="none", priors=priors, tolerances="as-tested")
    centre = x @ data.stress / (x @ x)
    residual = data.stress - centre * x
    # a flat prior of the noise's sd gives Student's t with n - 2 degrees of freedom
    law = student(n - 2, centre, np.sqrt(residual @ residual / (n - 2) / (x @ x)))
    low, high = posterior.solution.marginals["C10"].hdi()
    expected = law.interval(0.95)
    assert (low, high) == pytest.approx(expected, abs=0.03 * (expected[1] - expected[0]))


def test_a_process_keeps_its_digits_when_the_noise_is_a_millionth_of_it():
    stretch = np.linspace(0.6, 2.5, 12)
    data = tq.simulate("yeoh", TRUTH, stretch, 1e-6, seed=1)
    posterior = tq.fit(data, discrepancy="gp", noise_sd=1e-6)
    at_reference = posterior.predict([1.0], noise=False).iloc[0]
    assert abs(at_reference["median"]) < 0.05
    assert at_reference["high"] - at_reference["low"] < 0.2


def test_a_normal_prior_far_below_zero_is_normalised():
    prior = tq.Normal(-10, 1, low=0.0)
    mean, precision, log_constant = prior.gaussian
    assert (mean, precision) == (-10, 1)
    assert log_constant == pytest.approx(-norm.logsf(10) - 0.5 * np.log(2 * np.pi), rel=1e-12)
    assert prior.quantile(0.5) == pytest.approx(norm.isf(norm.sf(10) / 2) - 10, rel=1e-6)


def test_many_measurements_do_not_fill_the_memory():
    data = tq.simulate("yeoh", TRUTH, np.linspace(0.6, 2.5, 50_000), 0.1, seed=1)
    tree = tq.fit(data, discrepancy="quadratic", noise_sd=0.1).data
    assert tree["posterior_predictive"]["stress"].size <= 40_000_000
    assert tree["posterior"]["C10"].size == 4000


def test_one_stretch_only_is_refused_for_a_process():
    data = tq.Experiment("uniaxial", [1.2] * 6, [0.5, 0.4, 0.6, 0.5, 0.5, 0.4])
    with pytest.raises(tq.ModelError, match="one stretch only"):
        tq.fit(data, discrepancy="gp", noise_sd=0.1)


@pytest.mark.parametrize("prob", [0.0, 1.0, 95, -1])
def test_a_summary_of_an_impossible_probability_is_refused(prob):
    data = tq.simulate("neo-hookean", {"C10": 1.0}, [0.8, 1.2, 1.5], 0.1)
    with pytest.raises(tq.InputError, match="between 0 and 1"):
        tq.fit(data, discrepancy="none", noise_sd=0.1).summary(prob)
