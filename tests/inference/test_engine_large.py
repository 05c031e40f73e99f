"""Many measurements: what they say follows from few numbers, and must not lose digits on the way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

import tissuq as tq
from against import TRUTH, columns_of
from dense import columns
from marks import slow_but
from tissuq.inference.linear import ConditionalGaussian
from tissuq.model.statistical_model import StatisticalModel

STRETCH = np.linspace(0.6, 2.0, 500)


@pytest.fixture(scope="module")
def million():
    """Return 2000 replicates at 500 stretches: the stresses (2000, 500) and the experiment."""
    stress = columns_of(TRUTH, STRETCH) + 0.1 * np.random.default_rng(0).standard_normal((2000, 500))
    return stress, tq.Experiment("uniaxial", np.tile(STRETCH, 2000), stress.ravel())


def sufficient(names, stress):
    """Return least-squares solution, X'X and residual sum of squares, from replicate means and their scatter."""
    X, mean, m = columns(names, STRETCH), stress.mean(axis=0), len(stress)
    solution = np.linalg.lstsq(X, mean, rcond=None)[0]
    residual = m * float(((mean - X @ solution) ** 2).sum()) + float(((stress - mean) ** 2).sum())
    return solution, m * X.T @ X, residual


def test_a_million_points_with_known_noise_give_the_closed_form(million):
    stress, data = million
    names = ["C10", "C20", "C30"]
    priors = {"C10": tq.Uniform(0, 10), "C20": tq.Uniform(-1, 1), "C30": tq.Uniform(-1, 1)}
    posterior = tq.fit(data, material="yeoh", discrepancy="none", noise_sd=0.1, priors=priors)
    solution, gram, residual = sufficient(names, stress)
    covariance = 0.01 * np.linalg.inv(gram)
    n = len(data)
    evidence = -0.5 * (n - 3) * np.log(2 * np.pi) - n * np.log(0.1) - 0.5 * residual / 0.01
    evidence += 0.5 * np.linalg.slogdet(covariance)[1] - np.log(10 * 2 * 2)
    table = posterior.summary()
    sd = np.sqrt(np.diag(covariance))
    assert (np.abs(table["mean"].to_numpy() - solution) < 1e-6 * sd).all()
    np.testing.assert_allclose(table["sd"], sd, rtol=1e-8)
    assert posterior.log_evidence == pytest.approx(evidence, abs=1e-10 * abs(evidence))


def test_a_million_points_with_a_free_amplitude_give_a_one_dimensional_integral(million):
    stress, data = million
    names = ["C10", "C20", "C30"]
    priors = {"C10": tq.Uniform(0, 10), "C20": tq.Uniform(-1, 1), "C30": tq.Uniform(-1, 1), "S": tq.Uniform(0, 1)}
    posterior = tq.fit(data, discrepancy="yeoh", noise_sd=0.08, priors=priors)
    _, gram, residual = sufficient(names, stress)
    n = len(data)

    def log_likelihood(S):
        return -0.5 * (n - 3) * np.log(2 * np.pi * (0.0064 + S**2)) - 0.5 * residual / (0.0064 + S**2)

    best = np.sqrt(residual / (n - 3) - 0.0064)
    top = log_likelihood(best)
    # The spread of S is noise^2 / (S sqrt(2n)) or so, 1e-4: the integral lies within twenty of those.
    reach = 20 * (0.0064 + best**2) / best / np.sqrt(2 * n)
    share = quad(lambda S: np.exp(log_likelihood(S) - top), best - reach, best + reach, epsabs=0, epsrel=1e-10)[0]
    evidence = top + np.log(share) - 0.5 * np.linalg.slogdet(gram)[1] - np.log(10 * 2 * 2 * 1)
    assert abs(posterior.log_evidence - evidence) < posterior.log_evidence_error + 1e-10 * abs(evidence)
    assert posterior.log_evidence_error < 1e-4
    found = posterior.solution.marginals["S"]
    assert found.mean == pytest.approx(best, abs=0.01 * found.sd + 1 / n)


@pytest.mark.slow
def test_the_same_measurements_in_pieces_are_those_at_once(million):
    stress, data = million
    options = {"discrepancy": "yeoh", "noise_sd": 0.08}
    posterior = tq.fit(tq.Experiment("uniaxial", np.tile(STRETCH, 500), stress[:500].ravel()), **options)
    for start in (500, 1000, 1500):
        more = stress[start : start + 500].ravel()
        posterior = posterior.update(tq.Experiment("uniaxial", np.tile(STRETCH, 500), more))
    whole = tq.fit(data, **options)
    assert posterior.log_evidence == pytest.approx(whole.log_evidence, abs=1e-10 * abs(whole.log_evidence))
    sd = whole.summary()["sd"]
    assert (np.abs(posterior.summary()["mean"] - whole.summary()["mean"]) < 1e-6 * sd).all()


@pytest.mark.slow
@pytest.mark.parametrize("noise_sd", slow_but([0.1], [0.1, 0.001]))
def test_two_thousand_points_of_a_process_are_those_of_a_dense_cholesky_factor(noise_sd):
    generator = np.random.default_rng(3)
    stretch = np.sort(generator.uniform(0.7, 2.5, 2000))
    x = columns(["C10"], stretch)[:, 0]
    stress = columns_of(TRUTH, stretch) + noise_sd * generator.standard_normal(2000)
    data = tq.Experiment("uniaxial", stretch, stress)
    kinds = tq.materials()["neo-hookean"](), tq.discrepancies()["gp"]()
    model = StatisticalModel(data, *kinds, noise_sd, {"C10": tq.Normal(1.0, 0.3)})
    settings = np.array([[0.05, 0.3], [0.3, 1.0], [2.0, 5.0]])  # psi, c
    found = ConditionalGaussian([model])(settings[None])
    assert model.nonlinear == ("psi", "c")
    for place, (psi, c) in enumerate(settings):
        own = c**2 * np.exp(-0.5 * ((stretch[:, None] - stretch) / psi) ** 2) + noise_sd**2 * np.eye(2000)
        factor = np.linalg.cholesky(own + 0.09 * np.outer(x, x))
        white = np.linalg.solve(factor, stress - x)
        dense = -0.5 * white @ white - np.log(np.diag(factor)).sum() - 1000 * np.log(2 * np.pi)
        dense -= norm.logcdf(1 / 0.3)  # the prior of C10 is cut at zero
        # Digits of the dense factor itself: its condition is c^2 n / noise^2, up to 5e10.
        tolerance = 1e-6 + 1e-15 * c**2 * 2000 / noise_sd**2 * (white @ white)
        assert abs(found.log_likelihood[0, place] - dense) < tolerance
        solved = np.linalg.solve(own, np.column_stack([x, stress]))
        precision = x @ solved[:, 0] + 1 / 0.09
        mean = (x @ solved[:, 1] + 1 / 0.09) / precision
        assert abs(found.mean[0, place, 0] - mean) < 1e-3 / np.sqrt(precision)
        assert abs(found.root[0, place, 0, 0]) == pytest.approx(precision**-0.5, rel=1e-4)


def test_nearly_equal_stretches_give_a_process_the_likelihood_of_scipy():
    stretch = np.repeat(np.linspace(0.8, 1.6, 6), 2) + np.tile([0, 1e-9], 6)
    stress = columns_of(TRUTH, stretch) + 0.05 * np.random.default_rng(1).standard_normal(12)
    data = tq.Experiment("uniaxial", stretch, stress)
    kinds = tq.materials()["neo-hookean"](), tq.discrepancies()["gp"]()
    model = StatisticalModel(data, *kinds, 0.05, {"C10": tq.Normal(1.0, 0.1)})
    x = columns(["C10"], stretch)[:, 0]
    own = 0.25 * np.exp(-0.5 * ((stretch[:, None] - stretch) / 0.4) ** 2) + 0.0025 * np.eye(12)
    dense = multivariate_normal(x, own + 0.01 * np.outer(x, x)).logpdf(stress)
    found = ConditionalGaussian([model])(np.array([[[0.4, 0.5]]]))
    assert found.log_likelihood[0, 0] == pytest.approx(dense, abs=1e-8)
