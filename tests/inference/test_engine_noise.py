"""Noise that is unknown, grows with the stress, or is told by repeated measurements, against dense quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tissuq as tq
from against import AXES, TRUTH, assert_agrees, both, neo_hookean, parts
from dense import Axis, Linear, columns, integrate, problem_of
from marks import slow_but

GENERATOR = np.random.default_rng(11)
STRETCH = np.linspace(0.7, 2.2, 14)
REPEATED = np.repeat([0.7, 0.85, 1.15, 1.4, 1.7, 2.0], [2, 3, 1, 2, 3, 1])
NOISE_SD = Axis(1e-3, 1.5, 0.01)
SHARE = Axis(0, 1, 0.01)


def yeoh(stretch):
    return columns(list(TRUTH), stretch) @ np.array(list(TRUTH.values()))


def growing(stretch, seed, floor=0.03, share=0.08):
    level = np.abs(yeoh(stretch))
    return yeoh(stretch) + (floor + share * level) * np.random.default_rng(seed).standard_normal(len(stretch))


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", ["none", "constant"])
def test_unknown_noise(discrepancy):
    linear, axes = parts(discrepancy)
    stress = growing(STRETCH, 1)
    axes = axes | {"noise_sd": NOISE_SD}
    posterior, problem = both(discrepancy, STRETCH, stress, None, linear, axes, noise="unknown")
    truth = assert_agrees(posterior, problem, nodes=0 if discrepancy == "none" else 8)
    found = posterior.solution.marginals["noise_sd"]
    assert abs(found.mean - truth.means["noise_sd"]) <= 1e-3 * truth.sds["noise_sd"]
    assert abs(found.sd / truth.sds["noise_sd"] - 1) <= 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", ["none", pytest.param("mooney-rivlin", marks=pytest.mark.slow)])
def test_noise_that_grows_with_the_stress(discrepancy):
    linear, axes = parts(discrepancy)
    axes = axes | {"noise_sd": NOISE_SD, "noise_share": SHARE}
    stress = growing(STRETCH, 2)
    data = tq.Experiment("uniaxial", STRETCH, stress)
    model = tq.fit(data, discrepancy="none", noise="proportional").model
    options = {"noise": "proportional", "level": model.levels}
    posterior, problem = both(discrepancy, STRETCH, stress, None, linear, axes, **options)
    truth = assert_agrees(posterior, problem, nodes=0 if discrepancy == "none" else 6)
    for symbol, mean in truth.means.items():
        found = posterior.solution.marginals[symbol]
        assert abs(found.mean - mean) <= 2e-3 * truth.sds[symbol]
        assert abs(found.sd / truth.sds[symbol] - 1) <= 2e-3


def test_the_level_matters_to_the_evidence():
    linear, axes = parts("none")
    axes = axes | {"noise_sd": NOISE_SD, "noise_share": SHARE}
    stress = growing(STRETCH, 2, 0.01, 0.3)
    level = tq.fit(tq.Experiment("uniaxial", STRETCH, stress), discrepancy="none", noise="proportional").model.levels
    posterior, right = both("none", STRETCH, stress, None, linear, axes, noise="proportional", level=level)
    _, wrong = both("none", STRETCH, stress, None, linear, axes, noise="proportional", level=np.full(14, level.mean()))
    assert abs(posterior.log_evidence - integrate(right).log_evidence) < 1e-4
    assert abs(posterior.log_evidence - integrate(wrong).log_evidence) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    "discrepancy", ["constant", *(pytest.param(name, marks=pytest.mark.slow) for name in ("mooney-rivlin", "yeoh"))]
)
def test_repeated_measurements_share_the_independent_discrepancy(discrepancy):
    linear, axes = parts(discrepancy)
    stress = yeoh(REPEATED) + 0.2 * np.repeat(GENERATOR.standard_normal(6), [2, 3, 1, 2, 3, 1])
    stress = stress + 0.05 * GENERATOR.standard_normal(len(stress))
    axes = axes | {"noise_sd": NOISE_SD}
    posterior, problem = both(discrepancy, REPEATED, stress, None, linear, axes, noise="repeats", shared=True)
    tolerance = 0.02 if discrepancy == "yeoh" else 1e-3  # there several bounds cut the tails of C10
    truth = assert_agrees(posterior, problem, tolerance, nodes=8)
    for symbol in ("S", "noise_sd"):
        found = posterior.solution.marginals[symbol]
        assert abs(found.mean - truth.means[symbol]) <= 2e-3 * truth.sds[symbol]
        assert abs(found.sd / truth.sds[symbol] - 1) <= 2e-3
    unshared = problem_of(discrepancy, REPEATED, stress, linear, axes)
    assert abs(integrate(unshared, nodes=6).log_evidence - truth.log_evidence) > 0.1, (
        "sharing must matter to test anything"
    )


@pytest.mark.slow
def test_repeats_of_a_process_and_of_no_discrepancy_are_plain_unknown_noise():
    stress = yeoh(REPEATED) + 0.05 * np.random.default_rng(1).standard_normal(len(REPEATED))
    linear, axes = parts("none")
    posterior, problem = both("none", REPEATED, stress, None, linear, axes | {"noise_sd": NOISE_SD}, noise="repeats")
    assert_agrees(posterior, problem)
    data = tq.Experiment("uniaxial", REPEATED, stress)
    few = {"psi": tq.Uniform(0.2, 1.0), "c": tq.Uniform(0, 0.3), "noise_sd": tq.Uniform(0.01, 0.3)}
    plain, other = (tq.fit(data, discrepancy="gp", noise=each, priors=few) for each in ("unknown", "repeats"))
    assert abs(plain.log_evidence - other.log_evidence) < 1e-9


@pytest.mark.slow
def test_a_process_with_unknown_noise_on_three_axes():
    linear, axes = parts("gp")
    stretch = np.linspace(0.8, 2, 8)
    stress = yeoh(stretch) + 0.1 * np.random.default_rng(5).standard_normal(8)
    axes = axes | {"psi": Axis(0.1, 3, 0.1), "noise_sd": Axis(1e-3, 1, 0.02)}
    posterior, problem = both("gp", stretch, stress, None, linear, axes, noise="unknown")
    assert_agrees(posterior, problem, nodes=6)


def test_given_noise_and_share_the_posterior_is_that_of_a_dense_covariance():
    # Priors so narrow that they are values: then everything is one multivariate normal.
    stress = growing(STRETCH, 4)
    near = {"noise_sd": (0.05, 0.05 + 1e-9), "noise_share": (0.1, 0.1 + 1e-9), "S": (0.2, 0.2 + 1e-9)}
    priors = {symbol: tq.Uniform(*ends) for symbol, ends in near.items()}
    priors |= {"C10": tq.Normal(1.0, 0.5), "m0": tq.Normal(0.0, 0.3)}
    data = tq.Experiment("uniaxial", STRETCH, stress)
    posterior = tq.fit(data, discrepancy="constant", noise="proportional", priors=priors)
    X = columns(["C10", "m0"], STRETCH)
    sd = 0.05 + 0.1 * posterior.model.levels
    covariance = np.diag(sd**2 + 0.04) + X @ np.diag([0.25, 0.09]) @ X.T
    dense = multivariate_normal(X @ [1.0, 0.0], covariance).logpdf(stress)
    inside = -np.log(0.977249868051821)  # the prior of C10 is cut at zero, two of its sds below the mean
    assert posterior.log_evidence == pytest.approx(dense + inside, abs=1e-6)


@pytest.mark.parametrize("seed", slow_but([0], [0, 1, 2]))
def test_repeats_separate_noise_from_discrepancy_where_unknown_noise_cannot(seed):
    generator = np.random.default_rng(seed)
    stretch = np.repeat(np.linspace(0.7, 2.2, 12), 4)
    stress = 1.2 * neo_hookean(stretch) + np.repeat(0.3 * generator.standard_normal(12), 4)
    stress = stress + 0.05 * generator.standard_normal(48)
    data = tq.Experiment("uniaxial", stretch, stress)
    told, untold = (tq.fit(data, discrepancy="constant", noise=noise) for noise in ("repeats", "unknown"))
    # 36 degrees of freedom: the estimate's relative sd is 1/sqrt(72) = 12 %; five of them, false chance 1e-6.
    noise = told.summary().loc["noise_sd"]
    assert abs(noise["mean"] - 0.05) < 5 * 0.12 * 0.05
    assert noise["hdi_high"] < 0.1 < told.summary().loc["S", "hdi_low"]
    assert untold.summary().loc["noise_sd", "hdi_high"] > 2 * noise["hdi_high"]
    assert any("noise_sd^2 + S^2" in text for text in untold.warnings)
    assert not any("noise" in text for text in told.warnings)


def test_repeats_without_a_repeated_stretch_are_refused():
    data = tq.Experiment("uniaxial", STRETCH, growing(STRETCH, 1))
    with pytest.raises(tq.InputError, match="no two measurements at the same stretch"):
        tq.fit(data, discrepancy="constant", noise="repeats")


@pytest.mark.parametrize("points", slow_but([8], [8, 12, 24]))
def test_a_process_as_short_as_the_spacing_is_said_to_be_inseparable_from_noise(points):
    stretch = np.linspace(0.7, 2.2, points)
    spacing = stretch[1] - stretch[0]
    stress = 1.2 * neo_hookean(stretch) + 0.2 * np.random.default_rng(points).standard_normal(points)
    priors = {"psi": tq.Uniform(0.02 * spacing, 0.2 * spacing)}  # correlation of neighbours below exp(-12)
    priors |= {symbol: tq.Uniform(0.02, 0.4) for symbol in ("c", "noise_sd")}
    posterior = tq.fit(tq.Experiment("uniaxial", stretch, stress), discrepancy="gp", priors=priors)
    assert any("cannot separate noise from discrepancy" in text for text in posterior.warnings)


@pytest.mark.parametrize("points", slow_but([12], [12, 24]))
def test_a_process_much_longer_than_the_spacing_is_separable_from_noise(points):
    stretch = np.linspace(0.7, 2.2, points)
    stress = yeoh(stretch) + 0.05 * np.random.default_rng(points).standard_normal(points)
    priors = {"psi": tq.Uniform(0.5, 1.0)}
    posterior = tq.fit(tq.Experiment("uniaxial", stretch, stress), discrepancy="gp", priors=priors)
    assert not any("noise" in text for text in posterior.warnings)


def test_linear_prior_and_wide_noise_priors_of_other_families():
    linear = {"C10": Linear(0.0, np.inf, 1.0, 0.4)}
    normal = Axis(0.0, 3.0, 0.01, lambda x: -0.5 * (x / 0.3) ** 2 + 0.5 * np.log(2 / np.pi) - np.log(0.3))
    stress = growing(STRETCH, 6)
    data = tq.Experiment("uniaxial", STRETCH, stress)
    priors = {"C10": tq.Normal(1.0, 0.4), "noise_sd": tq.HalfNormal(0.3)}
    posterior = tq.fit(data, discrepancy="none", priors=priors, tolerances="as-tested")
    assert_agrees(posterior, problem_of("none", STRETCH, stress, linear, {"noise_sd": normal}))


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_axes_of_the_paper_still_hold_with_proportional_noise_of_little_share(share):
    linear, axes = parts("gp", axes=AXES)
    assert set(axes) == {"psi", "c"}
    stress = growing(STRETCH, 8, share=share)
    with pytest.raises(tq.ModelError, match="not independent along any fixed directions"):
        both("gp", STRETCH, stress, None, linear, axes, noise="proportional")
