"""Priors that go together, against SciPy's joint normal density, and in a posterior that no data change."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tissuq as tq
from tissuq.emulation.problem import correlated
from tissuq.errors import InputError
from tissuq.studies.earlier_run import load_law, priors_of

PRIORS = {"mu": tq.LogNormal(2.0, 0.3), "alpha": tq.Normal(-8.0, 1.5), "b": tq.Uniform(0.0, 1.0)}
CORRELATION = -0.8
COVARIANCE = np.array([[0.3**2, CORRELATION * 0.3 * 1.5], [CORRELATION * 0.3 * 1.5, 1.5**2]])
DEPTH = np.linspace(0.1, 1.0, 6)


def test_the_density_is_that_of_jointly_normal_scores():
    found = correlated(PRIORS, {("mu", "alpha"): CORRELATION})
    generator = np.random.default_rng(1)
    for mu, alpha, b in zip(
        np.exp(generator.normal(0.7, 0.4, 20)), generator.normal(-8, 2, 20), generator.uniform(0, 1, 20), strict=True
    ):
        priors = zip(PRIORS.values(), (mu, alpha, b), strict=True)
        own = sum(prior.log_density(value) for prior, value in priors)
        joint = multivariate_normal([np.log(2.0), -8.0], COVARIANCE).logpdf([np.log(mu), alpha]) - np.log(mu)
        assert own + found.log_density((mu, alpha, b), np) == pytest.approx(joint, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["importance", pytest.param("nuts", marks=pytest.mark.slow)])
def test_where_the_data_say_nothing_the_posterior_is_the_prior(method):
    """Within four standard errors of 800 effective draws."""
    priors = {name: PRIORS[name] for name in ("mu", "alpha")}
    found = tq.calibrate(
        DEPTH, DEPTH, lambda p, x: p["mu"] * x - 0.01 * p["alpha"] * x**2, priors, noise_sd=1e3, runs=16, method=method,
        discrepancy="none", correlations={("mu", "alpha"): CORRELATION},
    )  # fmt: skip
    draws = found.draws(4000)
    line = np.stack([np.log(draws[:, 0]), draws[:, 1]])
    assert np.corrcoef(line)[0, 1] == pytest.approx(CORRELATION, abs=4 * (1 - CORRELATION**2) / np.sqrt(800))
    assert line.mean(axis=1) == pytest.approx([np.log(2), -8], abs=4 * 1.5 / np.sqrt(800))
    assert line.std(axis=1) == pytest.approx([0.3, 1.5], rel=4 / np.sqrt(1600))


def test_the_runs_lie_where_the_priors_are_together():
    from tissuq.emulation.runs import space_filling

    points = space_filling(PRIORS, 256, correlation=correlated(PRIORS, {("mu", "alpha"): CORRELATION}))
    assert np.corrcoef(np.log(points[:, 0]), points[:, 1])[0, 1] == pytest.approx(CORRELATION, abs=0.06)
    assert abs(np.corrcoef(points[:, 1], points[:, 2])[0, 1]) < 0.15


def test_a_posterior_as_prior_has_its_means_sds_and_correlations():
    """The modulus of one Ogden term is positive, and known so badly here that a normal prior would have negative ones.

    Its logarithm counts, as it does in a population.
    """
    data = tq.simulate("ogden-1", {"mu1": 0.5, "alpha1": 9.0}, [0.8, 0.9, 1.1, 1.2, 1.3], noise_sd=0.1, seed=2)
    posterior = tq.fit(data, material="ogden-1", discrepancy="none", noise_sd=0.1)
    priors, correlations = priors_of(posterior, "kPa")
    draws = posterior.data_in("kPa")["posterior"]
    mu, alpha = (draws[name].values.ravel() for name in ("mu1", "alpha1"))
    assert priors["alpha1"].mean == pytest.approx(posterior.marginals["alpha1"].mean, abs=0.1 * alpha.std())
    assert priors["alpha1"].sd == pytest.approx(posterior.marginals["alpha1"].sd, rel=0.05)
    assert priors["mu1"].name == "log-normal"
    assert priors["mu1"].median == pytest.approx(np.exp(np.log(mu).mean()), rel=1e-9)
    assert priors["mu1"].sd_log == pytest.approx(np.log(mu).std(), rel=1e-9)
    assert correlations["mu1", "alpha1"] == pytest.approx(np.corrcoef(np.log(mu), alpha)[0, 1], abs=1e-9)


def test_a_posterior_that_a_bound_of_its_prior_cuts_is_no_prior():
    """The default prior of the exponent is of positive ones, and that of the data is negative."""
    data = tq.simulate("ogden-1", {"mu1": 0.5, "alpha1": -5.0}, np.linspace(0.75, 1.4, 14), noise_sd=0.01, seed=2)
    posterior = tq.fit(data, material="ogden-1", discrepancy="none", noise_sd=0.01)
    with pytest.raises(InputError, match=r"a bound of its prior cuts the posterior of alpha1, .* --prior alpha1=unif"):
        priors_of(posterior, stated=["alpha1"])


def test_a_posterior_near_a_bound_of_the_parameter_is_a_prior_of_the_others_where_one_is_stated():
    law = "neo-hookean+dispersed-fibres@0"
    truth = {"C10": 0.01, "k1": 0.02, "k2": 2.0, "kappa": 0.02}
    data = tq.simulate(law, truth, np.linspace(1.02, 1.4, 20), noise_sd=4e-4, seed=2)
    posterior = tq.fit(data, material=law, discrepancy="none", noise_sd=4e-4)
    with pytest.raises(InputError, match=r"of kappa lies near a bound of the parameter, .* --prior kappa=uniform"):
        priors_of(posterior)
    assert "kappa" not in priors_of(posterior, stated=["kappa"])[0]


@pytest.mark.parametrize(
    ("pairs", "words"),
    [
        ({("mu", "b"): 0.5}, "can have no correlation"),
        ({("mu", "x"): 0.5}, "two parameters of the model"),
        ({("mu", "mu"): 0.5}, "two parameters of the model"),
        ({("mu", "alpha"): 1.0}, "between -1 and 1"),
    ],
)
def test_pairs_that_cannot_be_correlated_are_refused(pairs, words):
    with pytest.raises(InputError, match=words):
        correlated(PRIORS, pairs)


def test_correlations_that_contradict_each_other_are_refused():
    normal = {name: tq.Normal(0.0, 1.0) for name in "abc"}
    with pytest.raises(InputError, match="contradict"):
        correlated(normal, {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9})


def test_of_a_run_of_several_laws_the_one_of_the_model_is_the_prior_and_of_several_discrepancies_a_file(tmp_path):
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.01, seed=1)
    for folder, names in (("laws", ("neo-hookean", "yeoh")), ("several", ("gp", "none"))):
        (tmp_path / folder / "posterior").mkdir(parents=True)
        for name in names:
            law, discrepancy = (name, "none") if folder == "laws" else ("neo-hookean", name)
            posterior = tq.fit(data, material=law, discrepancy=discrepancy, noise_sd=0.01)
            posterior.save(tmp_path / folder / "posterior" / f"{name}.nc")
    assert list(priors_of(load_law(tmp_path / "laws", "yeoh"), "MPa")[0]) == ["C10", "C20", "C30"]
    (tmp_path / "laws" / "run.toml").write_text('laws = ["neo-hookean", "yeoh"]\n')
    with pytest.raises(InputError, match=r"of the materials neo-hookean, yeoh, .* --material gent"):
        priors_of(load_law(tmp_path / "laws", "gent"), "MPa")
    file = tmp_path / "several" / "posterior" / "none.nc"
    with pytest.raises(InputError, match=f"several posteriors: .* --prior-run .* or {re.escape(str(file))}"):
        priors_of(load_law(tmp_path / "several", "neo-hookean"), "MPa")
    (prior,) = priors_of(load_law(file, "neo-hookean"), "MPa")[0].values()
    assert prior.median == pytest.approx(0.5, rel=0.05)
    with pytest.raises(InputError, match="fit the tests with --material yeoh"):
        priors_of(load_law(file, "yeoh"), "MPa")
