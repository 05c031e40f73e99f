"""Ogden materials, whose exponents bend the stress: exact against dense quadrature, and the routes to each other."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from against import assert_agrees
from dense import Axis, Linear, Problem
from marks import slow_but

STRETCH = np.linspace(0.75, 1.6, 12)


def ogden(stretch, alpha):
    """Return the uniaxial stress of mu = 1: d/dl of 2/alpha^2 (l^alpha + 2 l^(-alpha/2) - 3)."""
    return 2 / alpha * (stretch ** (alpha - 1) - stretch ** (-alpha / 2 - 1))


def problem_of_ogden(stress, linear, axes, exponents, noise_sd, others=None):
    eye = np.eye(len(STRETCH))

    def design(h):
        own = [ogden(STRETCH, h[symbol][:, None]) for symbol in exponents]
        rest = [np.broadcast_to(column, own[0].shape) for column in (others or [])]
        return np.stack([*own, *rest], axis=2)

    def covariance(h):
        count = len(next(iter(h.values())))
        variance = h.get("noise_sd", np.full(count, noise_sd)) ** 2 + h.get("S", np.zeros(count)) ** 2
        return variance[:, None, None] * eye

    return Problem(stress, design, covariance, linear, axes)


def stress(seed=0, noise_sd=0.05):
    errors = noise_sd * np.random.default_rng(seed).standard_normal(len(STRETCH))
    return 0.8 * ogden(STRETCH, 3.0) + 0.2 * ogden(STRETCH, -2.0) + errors


def test_one_term_with_known_noise():
    linear, axes = {"mu1": Linear(-10, 10)}, {"alpha1": Axis(0.5, 40, 1.0)}
    priors = {"mu1": tq.Uniform(-10, 10), "alpha1": tq.Uniform(0.5, 40)}
    data = tq.Experiment("uniaxial", STRETCH, stress())
    posterior = tq.fit(data, material="ogden-1", discrepancy="none", noise_sd=0.05, priors=priors)
    truth = assert_agrees_for("mu1", posterior, problem_of_ogden(stress(), linear, axes, ["alpha1"], 0.05))
    agrees("alpha1", posterior, truth)


def assert_agrees_for(symbol, posterior, problem, nodes=0):
    """Hold the evidence and the marginal of mu1 in place of C10's against the oracle."""
    from types import SimpleNamespace

    alias = SimpleNamespace(
        log_evidence=posterior.log_evidence,
        log_evidence_error=posterior.log_evidence_error,
        solution=SimpleNamespace(marginals={"C10": posterior.solution.marginals[symbol]}),
    )
    return assert_agrees(alias, problem, nodes=nodes, width=5e-3)


def agrees(symbol, posterior, truth):
    found = posterior.solution.marginals[symbol]
    assert abs(found.mean - truth.means[symbol]) <= 2e-3 * truth.sds[symbol]
    assert abs(found.sd / truth.sds[symbol] - 1) <= 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["S", "noise_sd"])
def test_one_term_with_an_amplitude_or_unknown_noise(kind):
    linear, axes = {"mu1": Linear(-10, 10)}, {"alpha1": Axis(0.5, 40, 1.0), kind: Axis(1e-4, 2, 0.02)}
    priors = {"mu1": tq.Uniform(-10, 10), "alpha1": tq.Uniform(0.5, 40), kind: tq.Uniform(1e-4, 2)}
    others = None
    if kind == "S":
        linear["m0"], priors["m0"], others = Linear(-20, 20), tq.Uniform(-20, 20), [np.ones(len(STRETCH))]
    data = tq.Experiment("uniaxial", STRETCH, stress())
    posterior = tq.fit(
        data,
        material="ogden-1",
        discrepancy="constant" if kind == "S" else "none",
        noise_sd=0.05 if kind == "S" else "unknown",
        priors=priors,
        tolerances="as-tested",
    )
    problem = problem_of_ogden(stress(), linear, axes, ["alpha1"], 0.05, others)
    truth = assert_agrees_for("mu1", posterior, problem, nodes=14)
    agrees("alpha1", posterior, truth)
    agrees(kind, posterior, truth)


@pytest.mark.slow
def test_two_terms():
    """The short version is one term with an amplitude, which has two nonlinear parameters, too."""
    linear = {"mu1": Linear(-20, 20), "mu2": Linear(-20, 20)}
    axes = {"alpha1": Axis(0.5, 10, 1.0), "alpha2": Axis(-10, -0.5, 1.0)}
    priors = {"mu1": tq.Uniform(-20, 20), "mu2": tq.Uniform(-20, 20)}
    priors |= {"alpha1": tq.Uniform(0.5, 10), "alpha2": tq.Uniform(-10, -0.5)}
    data = tq.Experiment("uniaxial", STRETCH, stress())
    posterior = tq.fit(data, material="ogden-2", discrepancy="none", noise_sd=0.05, priors=priors)
    problem = problem_of_ogden(stress(), linear, axes, ["alpha1", "alpha2"], 0.05)
    truth = assert_agrees_for("mu1", posterior, problem, nodes=14)
    agrees("alpha1", posterior, truth)
    agrees("alpha2", posterior, truth)


@pytest.mark.slow
def test_exact_nuts_and_smc_agree_on_two_terms():
    # Five standard errors each for eight comparisons: false chance below 1e-5.
    data = tq.Experiment("uniaxial", STRETCH, stress())
    priors = {"alpha1": tq.Uniform(0.5, 10), "alpha2": tq.Uniform(-10, -0.5)}
    options = {"material": "ogden-2", "discrepancy": "none", "noise_sd": 0.05, "priors": priors}
    exact, nuts, smc = (tq.fit(data, method=method, **options) for method in ("exact", "nuts", "smc"))
    assert smc.log_evidence_error < 0.3
    error = np.hypot(smc.log_evidence_error, exact.log_evidence_error)
    assert abs(smc.log_evidence - exact.log_evidence) < 5 * error
    reference = exact.summary()
    for sampled in (nuts, smc):
        table = sampled.summary()
        assert sampled.solution.diagnostics.converged
        error = reference["sd"] / np.sqrt(table["ess"])
        assert (np.abs(table["mean"] - reference["mean"]) < 5 * error).all()


@pytest.mark.slow
def test_a_process_beside_growing_noise_goes_to_nuts_with_an_evidence_by_smc(monkeypatch):
    from dataclasses import replace

    from tissuq.inference.enumerators import sampled

    few = {"SmcSettings": {"particles": 400, "max_sweeps": 2, "ess_fraction": 0.5}}
    few |= {"NutsSettings": {"warmup": 60, "draws": 30}}
    for name, short in few.items():
        kind = getattr(sampled, name)
        monkeypatch.setattr(sampled, name, lambda kind=kind, short=short, **options: replace(kind(**options), **short))
    data = tq.simulate("ogden-1", {"mu1": 0.5, "alpha1": 1.3}, np.linspace(0.7, 1.6, 14), 0.3, seed=1)
    posterior = tq.fit(data, material="ogden-1", discrepancy="gp", noise="proportional")
    assert posterior.solution.route in ("nuts", "joint")
    reason = posterior.solution.reason
    assert "are not independent along any fixed directions" in reason
    assert "evidence by tempered SMC" in reason
    assert np.isfinite(posterior.log_evidence)
    assert posterior.log_evidence_error > 0
    assert posterior.data.attrs["method_reason"] == reason


@pytest.mark.parametrize("discrepancy", slow_but(["constant"], ["constant", "yeoh"]))
def test_three_terms_with_everything_unknown_are_summed(discrepancy):
    truth = {"mu1": 0.5, "mu2": 0.1, "mu3": 0.2, "alpha1": 1.3, "alpha2": 5.0, "alpha3": -2.0}
    data = tq.simulate("ogden-3", truth, np.linspace(0.7, 1.6, 14), 0.3, seed=1)
    posterior = tq.fit(data, material="ogden-3", discrepancy=discrepancy)
    assert posterior.model.nonlinear == ("alpha1", "alpha2", "alpha3", "S", "noise_sd")
    assert posterior.solution.route == "exact"
    assert 0 < posterior.log_evidence_error < 0.1
    assert posterior.data.attrs["method_reason"] == posterior.solution.reason


@pytest.mark.parametrize("prior", [tq.Uniform(-40, 40), tq.Normal(0, 10)], ids=str)
def test_a_prior_of_an_exponent_about_zero_where_the_law_divides_by_it_is_no_obstacle(prior):
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.03, seed=1)
    tables = [
        tq.fit(data, material="ogden-1", discrepancy="none", noise_sd=0.03, priors={"alpha1": each}).summary()
        for each in (prior, tq.Uniform(0.5, 40))
    ]
    sd = tables[1].loc["mu1", "sd"]
    assert tables[0].loc["mu1", "mean"] == pytest.approx(tables[1].loc["mu1", "mean"], abs=0.05 * sd)
