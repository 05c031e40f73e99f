"""Densities of measurements: against refitting without each, and against full covariance matrices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

import gallery
import tissuq as tq
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.prediction.densities import joint_log_likelihood, leave_one_out, left_out_log_density
from tissuq.prediction.moments import stress_moments, variance_of_noise

STRETCH = np.linspace(0.7, 1.9, 14)
DATA = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, STRETCH, noise_sd=0.05, seed=1)
INSIDE = [1, 4, 7, 12]
"""Measurements that may be left out without changing the range, on which length scales rest."""


def x(stretch):
    return 2 * (stretch - stretch**-2)


def refitted(name, noise_sd, priors, out):
    """Return the log density of one measurement under a fit of the others with the same priors."""
    rest = np.delete(np.arange(len(STRETCH)), out)
    data = tq.Experiment("uniaxial", STRETCH[rest], DATA.stress[rest])
    solution = tq.fit(data, discrepancy=name, noise_sd=noise_sd, priors=priors, tolerances="as-tested").solution
    parts = solution.mixture
    states = solution.model.experiment.states_at(STRETCH[[out]])
    mean, variance = stress_moments(solution.model, parts, states)
    variance = variance + variance_of_noise(solution.model, parts, solution.model.relative_noise(states), mean)
    return np.log(parts.weights @ norm.pdf(DATA.stress[out], mean[:, 0], np.sqrt(variance[:, 0])))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "tolerance", "noise_sd"),
    [
        ("none", 1e-4, "unknown"),
        ("yeoh", 1e-3, "unknown"),
        ("gp", 2e-3, 0.05),
        ("taylor", 0.03, 0.05),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in
          [("auto", 0.03, 0.05), ("none", 1e-4, 0.05), ("yeoh", 1e-3, 0.05),
           ("gp", 2e-3, "unknown"), ("auto", 0.03, "unknown")]),
    ],
)  # fmt: skip
def test_leaving_one_out_is_refitting_without_it(name, tolerance, noise_sd):
    posterior = gallery.fit(DATA, discrepancy=name, noise_sd=noise_sd, tolerances="as-tested")
    found = leave_one_out(posterior.solution)
    assert not found.is_rough[INSIDE].any()  # the last one ends the range, which is another without it
    expected = [refitted(name, noise_sd, posterior.model.priors, out) for out in INSIDE]
    np.testing.assert_allclose(found.log_density[INSIDE], expected, atol=tolerance)


@pytest.mark.slow
def test_a_sampled_posterior_leaves_out_a_measurement_at_rest():
    # There a material alone has no stress, so that no draw of its parameters explains it better than another.
    posterior = gallery.sampled_jointly()
    found = leave_one_out(posterior.solution)
    at_rest = -0.5 * (posterior.model.experiment.stress[2] / 0.05) ** 2 - np.log(0.05 * np.sqrt(2 * np.pi))
    assert found.log_density[2] == pytest.approx(at_rest, abs=1e-9)
    assert not found.is_rough.any()


@pytest.mark.slow
def test_a_sampled_posterior_leaves_out_like_an_exact_one():
    # 4000 draws that PSIS weights: errors of a few hundredths.
    exact = leave_one_out(gallery.fit(DATA, discrepancy="constant", noise_sd=0.05).solution)
    for method in ("nuts", "joint"):
        sampled = leave_one_out(gallery.fit(DATA, discrepancy="constant", noise_sd=0.05, method=method).solution)
        np.testing.assert_allclose(sampled.log_density, exact.log_density, atol=0.1)


def test_a_measurement_that_decides_the_posterior_is_rough():
    stress = DATA.stress.copy()
    stress[7] += 3.0
    posterior = tq.fit(tq.Experiment("uniaxial", STRETCH, stress), discrepancy="yeoh", noise_sd="unknown")
    assert leave_one_out(posterior.solution).is_rough[7]


def test_many_measurements_take_little_memory_and_time():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.7, 1.9, 60_000), noise_sd=0.05, seed=1)
    found = leave_one_out(gallery.fit(data, discrepancy="none", tolerances="as-tested").solution).log_density
    expected = norm.logpdf(data.stress, 0.5 * x(data.stretch), 0.05)
    assert found.sum() == pytest.approx(expected.sum(), abs=3.0)  # two parameters cost about one


def covariance_of(name, values):
    """Return the covariance of noise and random discrepancy at given parameters."""
    whole = (values.get("noise_sd", 0.05) ** 2 + values.get("S", 0.0) ** 2) * np.eye(14)
    if name == "gp":
        whole = whole + values["c"] ** 2 * np.exp(-0.5 * ((STRETCH[:, None] - STRETCH) / values["psi"]) ** 2)
    return whole


@pytest.mark.parametrize("name", ["none", "constant", "gp"])
def test_with_the_parameters_given_it_is_conditioning_of_the_full_covariance(name):
    priors = {"C10": tq.Normal(0.4, 0.3)} | ({"m0": tq.Normal(0.0, 0.2)} if name == "constant" else {})
    model = gallery.fit(DATA, discrepancy=name, noise_sd=0.05, priors=priors).model
    values = {"S": 0.1, "c": 0.3, "psi": 0.4}
    columns = np.column_stack([x(STRETCH), np.ones(14)])[:, : len(model.linear)]
    centre, spread = (np.array([0.4, 0.0])[: len(model.linear)], np.diag([0.09, 0.04])[: len(model.linear)])
    spread = spread[:, : len(model.linear)]
    errors = covariance_of(name, {symbol: values[symbol] for symbol in model.nonlinear})
    whole = errors + columns @ spread @ columns.T
    precision = np.linalg.inv(spread) + columns.T @ np.linalg.solve(errors, columns)
    pull = np.linalg.solve(spread, centre) + columns.T @ np.linalg.solve(errors, DATA.stress)
    mean, root = np.linalg.solve(precision, pull), np.linalg.cholesky(np.linalg.inv(precision))
    settings = np.array([[values[symbol] for symbol in model.nonlinear]])
    found = left_out_log_density(model, GaussianMixture(np.ones(1), settings, mean[None], root[None]))[0]
    joint = multivariate_normal(columns @ centre, whole).logpdf(DATA.stress)
    for i in range(14):
        rest = np.delete(np.arange(14), i)
        others = multivariate_normal((columns @ centre)[rest], whole[np.ix_(rest, rest)]).logpdf(DATA.stress[rest])
        assert found[i] == pytest.approx(joint - others, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["none", "constant", "gp", "taylor+zero-modulus", "auto-sharp"])
def test_the_joint_likelihood_is_that_of_the_full_covariance(name):
    solution = gallery.fit(DATA, discrepancy=name, noise_sd="unknown", tolerances="as-tested").solution
    found = joint_log_likelihood(solution)
    for place in ((0, 0), (1, 10), (3, 999)):
        values = {symbol: drawn[place] for symbol, drawn in solution.draws.items()}
        covariance = covariance_of(name, values)
        if solution.mixture.member is not None:
            member = solution.model.energy_members[solution.mixture.member[solution.component_of_draw[place]]]
            features = member.stress_features(solution.model.experiment.states)
            for symbol, each in zip(np.array(["c1", "c2"])[list(member.amplitude_indices)], features, strict=True):
                covariance = covariance + values[symbol] ** 2 * each @ each.T
        mean = values["C10"] * x(STRETCH) + values.get("m0", 0.0)
        expected = multivariate_normal(mean, covariance).logpdf(DATA.stress)
        assert found[place] == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_the_joint_likelihood_knows_that_noise_grows_with_the_stress():
    solution = gallery.fit(DATA, discrepancy="taylor+second-invariant", noise="proportional").solution
    found = joint_log_likelihood(solution)
    for place in ((0, 0), (2, 500)):
        values = {symbol: drawn[place] for symbol, drawn in solution.draws.items()}
        member = solution.model.energy_members[solution.mixture.member[solution.component_of_draw[place]]]
        noise = values["noise_sd"] + values["noise_share"] * solution.model.levels
        features = member.stress_features(solution.model.experiment.states)
        energies = sum(values[symbol] ** 2 * each @ each.T for symbol, each in zip(("c1", "c2"), features, strict=True))
        expected = multivariate_normal(values["C10"] * x(STRETCH), np.diag(noise**2) + energies).logpdf(DATA.stress)
        assert found[place] == pytest.approx(expected, abs=1e-6)
