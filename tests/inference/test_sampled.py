"""NUTS on the joint density and the exact route are two independent ways to the same posterior."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import gallery
import tissuq as tq
from tissuq.inference.densities import conditional_density, joint_density
from tissuq.inference.enumerators.adaptive_cells import AdaptiveCells
from tissuq.inference.enumerators.sampled import sample_by_nuts, sample_joint
from tissuq.inference.linear import ConditionalGaussian
from tissuq.mechanics import NeoHookean, Ogden1, Ogden2, Ogden3
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.validation.paper import FORMULATIONS


def model_of(settings, formulation):
    return StatisticalModel(
        settings.experiment(),
        NeoHookean(),
        discrepancy_named(formulation),
        settings.noise_sd,
        settings.priors_of(formulation),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "formulation", [name if name == "none" else pytest.param(name, marks=pytest.mark.slow) for name in FORMULATIONS]
)
def test_nuts_converges_and_agrees_with_the_exact_route(paper, formulation):
    model = model_of(paper, formulation)
    sampled, (exact,) = sample_joint(model, seed=1, draws=4000), AdaptiveCells().solve([model])
    found = sampled.diagnostics
    assert found.converged
    assert max(found.rhat.values()) < 1.01
    # with an ESS above 4000 the ends of the HPD have a Monte Carlo error below 0.04 sd
    assert min(found.ess_bulk["C10"], found.ess_tail["C10"]) > 4000
    a, b = exact.marginals["C10"], sampled.marginals["C10"]
    assert b.mean == pytest.approx(a.mean, abs=0.1 * a.sd)
    assert b.sd == pytest.approx(a.sd, rel=0.05)
    assert b.hdi() == pytest.approx(a.hdi(), abs=0.15 * a.sd)


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["quadratic", "yeoh"])
def test_the_stiff_formulations_converge_in_four_thousand_draws(paper, formulation):
    found = sample_joint(model_of(paper, formulation), seed=2).diagnostics
    assert max(found.rhat.values()) < 1.01
    assert min(*found.ess_bulk.values(), *found.ess_tail.values()) > 400


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_joint_density_is_that_of_scipy(paper, formulation):
    model = model_of(paper, formulation)
    values = {"C10": 1.1, "m0": -1.0, "m1": 0.4, "m2": 0.1, "C01": 0.2, "C20": -0.05, "C30": 0.003}
    values |= {"S": 0.6, "c": 0.8, "psi": 0.9}
    point = np.array([values[symbol] for symbol in model.symbols])
    covariance = 0.25 * np.eye(30)
    if formulation == "gp":
        x = model.experiment.stretch
        covariance = covariance + 0.64 * np.exp(-0.5 * ((x[:, None] - x) / 0.9) ** 2)
    elif formulation != "none":
        covariance = covariance + 0.36 * np.eye(30)
    mean = sum(values[s] * column for s, column in zip(model.column_symbols, model.design.T, strict=True))
    widths = [np.ptp(model.priors[symbol].support) for symbol in model.symbols]
    expected = multivariate_normal(mean, covariance).logpdf(model.experiment.stress) - np.log(widths).sum()
    density, data = joint_density(model)
    assert float(density(point, data)) == pytest.approx(expected, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("formulation", [name for name in FORMULATIONS if name != "none"])
def test_the_density_with_linear_parameters_integrated_is_that_of_the_exact_route(paper, formulation):
    model = model_of(paper, formulation)
    h = np.array([{"S": 0.6, "c": 0.8, "psi": 0.9}[symbol] for symbol in model.nonlinear])
    expected = ConditionalGaussian([model])(h[None, None])
    density, data = conditional_density(model)
    log_likelihood, log_prior, mean, root = map(np.asarray, density(h, data))
    assert log_likelihood == pytest.approx(expected.log_likelihood[0, 0], rel=1e-10)
    assert log_prior == pytest.approx(-sum(np.log(np.ptp(model.priors[s].support)) for s in model.nonlinear))
    np.testing.assert_allclose(mean, expected.mean[0, 0], rtol=1e-8)
    covariance = expected.root[0, 0] @ expected.root[0, 0].T
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-8 * np.abs(covariance).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "material",
    [Ogden1(), *(pytest.param(own, marks=pytest.mark.slow) for own in (Ogden2(), Ogden3()))],
    ids=lambda material: material.name,
)
def test_the_integrated_density_keeps_its_digits_for_every_exponent(material):
    data = tq.simulate("yeoh", {"C10": 1.2, "C20": -0.057, "C30": 0.004}, np.linspace(0.5, 2.5, 25), 0.05, seed=1)
    moduli = {p.symbol: tq.Uniform(-50, 50) for p in material.parameters if p.is_linear}
    model = StatisticalModel(data, material, discrepancy_named("none"), 0.05, moduli)
    uniforms = np.random.default_rng(0).random((30, len(model.nonlinear)))
    h = np.column_stack([model.priors[s].quantile(u) for s, u in zip(model.nonlinear, uniforms.T, strict=True)])
    expected = ConditionalGaussian([model])(h[None]).log_likelihood[0]
    density, given = conditional_density(model)
    found = np.array([density(each, given)[0] for each in h])
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["constant", "yeoh", "gp"])
def test_nuts_on_the_nonlinear_parameters_alone_agrees_with_the_exact_route(paper, formulation):
    model = model_of(paper, formulation)
    sampled, (exact,) = sample_by_nuts(model, seed=3), AdaptiveCells().solve([model])
    found = sampled.diagnostics
    assert sampled.route == "nuts"
    assert found.converged
    assert sampled.log_evidence is None
    for symbol in model.symbols:
        a, b = exact.marginals[symbol], sampled.marginals[symbol]
        # with an ESS above 1000 five standard errors are 0.16 sd for the mean, and 0.11 of a Gaussian's sd
        assert min(found.ess_bulk[symbol], found.ess_tail[symbol]) > 1000
        assert b.mean == pytest.approx(a.mean, abs=0.16 * a.sd)
        assert sampled.draws[symbol].mean() == pytest.approx(a.mean, abs=0.16 * a.sd)
        assert b.sd == pytest.approx(a.sd, rel=0.15)


@pytest.mark.slow
def test_the_joint_method_gives_no_evidence_and_says_how_it_converged():
    posterior = gallery.sampled_jointly()
    assert posterior.log_evidence is None
    assert {"ess", "rhat"} <= set(posterior.summary().columns)
    assert "onverged" in posterior.solution.diagnostics.verdict


def test_what_no_sum_takes_goes_to_nuts_on_auto(paper, monkeypatch):
    class Asked(Exception):
        pass

    def asked(model, seed, refusal):
        raise Asked(refusal)

    monkeypatch.setattr("tissuq.inference.enumerators.sampled.sample_by_nuts", asked)
    with pytest.raises(Asked, match="not independent along any fixed directions"):
        tq.fit(paper.experiment(), discrepancy="gp", noise="proportional")


@pytest.mark.slow
def test_four_nonlinear_parameters_are_sampled_as_they_are_summed(paper):
    priors = {"C10": tq.LogNormal(1.0, 1.0)}
    summed, sampled = (
        tq.fit(paper.experiment(), discrepancy="gp", priors=priors, method=method) for method in ("auto", "nuts")
    )
    assert (summed.solution.route, sampled.solution.route) == ("exact", "nuts")
    for symbol in summed.model.symbols:
        a, b = (posterior.solution.marginals[symbol] for posterior in (summed, sampled))
        assert b.mean == pytest.approx(a.mean, abs=0.25 * a.sd)
        assert b.sd == pytest.approx(a.sd, rel=0.25)


def test_a_dense_covariance_that_is_too_large_is_refused():
    stretch = np.linspace(0.7, 2, 1001)
    data = tq.simulate("yeoh", {"C10": 1.2, "C20": 0.0, "C30": 0.0}, stretch, 0.1)
    with pytest.raises(tq.ModelError, match="use the method"):
        tq.fit(data, discrepancy="gp", noise_sd=0.1, method="joint")
