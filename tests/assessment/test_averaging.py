"""Averages of fits by evidence: against mixtures by hand and pooled draws, and what must be refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import tissuq as tq
from tissuq.prediction.bands import predictive_mixtures

STRETCH = np.linspace(0.7, 1.9, 14)
DATA = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.01, "C30": 0.0}, STRETCH, noise_sd=0.1, seed=1)
NAMES = ("none", "constant", "yeoh", "gp")


@pytest.fixture(scope="module")
def fits():
    return {name: tq.fit(DATA, discrepancy=name, noise_sd=0.1) for name in NAMES}


def test_two_gaussian_models_average_as_by_hand():
    # Without discrepancy, with two normal priors of C10: everything is Gaussian, in closed form.
    x, sd = 2 * (STRETCH - STRETCH**-2), 0.1
    priors = {"low": (0.3, 0.1), "high": (0.55, 0.02)}
    fits = {
        name: tq.fit(DATA, discrepancy="none", noise_sd=sd, priors={"C10": tq.Normal(*prior)})
        for name, prior in priors.items()
    }
    evidence, means, sds = {}, {}, {}
    for name, (mean, spread) in priors.items():
        covariance = sd**2 * np.eye(len(x)) + spread**2 * np.outer(x, x)
        residual = DATA.stress - mean * x
        _, log_determinant = np.linalg.slogdet(covariance)
        evidence[name] = -0.5 * (residual @ np.linalg.solve(covariance, residual) + log_determinant)
        evidence[name] -= norm.logcdf(mean / spread)  # C10 is positive
        sds[name] = (x @ x / sd**2 + spread**-2) ** -0.5
        means[name] = sds[name] ** 2 * (x @ DATA.stress / sd**2 + mean / spread**2)
    odds = np.exp(evidence["low"] - evidence["high"])
    weights = {"low": odds / (1 + odds), "high": 1 / (1 + odds)}
    found = tq.average(fits)
    assert found.weights == pytest.approx(weights, rel=1e-6)
    assert 0.01 < weights["low"] < 0.99, "both must matter to test anything"
    c10 = found.marginals["C10"]
    mean = sum(weights[name] * means[name] for name in weights)
    variance = sum(weights[name] * (sds[name] ** 2 + (means[name] - mean) ** 2) for name in weights)
    assert c10.mean == pytest.approx(mean, rel=1e-5)
    assert c10.sd == pytest.approx(np.sqrt(variance), rel=1e-5)
    grid = np.linspace(mean - 3 * sds["low"], mean + 3 * sds["low"], 50)
    density = sum(weights[name] * norm(means[name], sds[name]).pdf(grid) for name in weights)
    np.testing.assert_allclose(c10.pdf(grid), density, atol=5e-3 * density.max())
    row = found.summary().loc["C10"]
    inside = sum(weights[n] * np.diff(norm(means[n], sds[n]).cdf(row[["hdi_low", "hdi_high"]]))[0] for n in weights)
    assert inside == pytest.approx(0.95, abs=1e-3)


def test_weights_are_the_probabilities_that_a_comparison_gives(fits):
    found, table = tq.average(fits), tq.compare(fits)
    assert sum(found.weights.values()) == pytest.approx(1)
    for name, weight in found.weights.items():
        assert weight == pytest.approx(table.loc[name, "probability"], rel=1e-9)


def test_the_average_is_what_draws_pooled_by_weight_are(fits):
    # 200000 draws of draws; mean and quantiles within five standard errors of 4000 independent ones: 6e-7 each.
    found, generator = tq.average(fits), np.random.default_rng(0)
    names = generator.choice(list(fits), size=200_000, p=list(found.weights.values()))
    pooled = np.concatenate(
        [
            generator.choice(posterior.solution.draws["C10"].ravel(), size=(names == name).sum())
            for name, posterior in fits.items()
        ]
    )
    c10 = found.marginals["C10"]
    assert abs(pooled.mean() - c10.mean) < 5 * c10.sd / np.sqrt(4000)
    below = np.mean(pooled[:, None] < c10.quantile([0.05, 0.5, 0.95]), axis=0)
    np.testing.assert_allclose(below, [0.05, 0.5, 0.95], atol=5 * 0.5 / np.sqrt(4000))
    low, high = c10.hdi()
    assert np.mean((low < pooled) & (pooled < high)) == pytest.approx(0.95, abs=5 * 0.22 / np.sqrt(4000))


def probability_below(values, posterior, points):
    """Return the probabilities of measurements below some values, by a fit."""
    options = {"discrepancy": True, "noises": (True,)}
    ((mixture,),) = predictive_mixtures([(1.0, posterior.solution)], np.array(points), DATA.mode, 0, **options)
    return mixture.weights @ norm.cdf(values, mixture.means, np.sqrt(mixture.variances))


def test_predictions_are_mixtures_of_the_fits(fits):
    at = [0.8, 1.0, 1.5, 2.2]
    found = tq.average(fits)
    band = found.predict(at)
    apart = {name: posterior.predict(at) for name, posterior in fits.items()}
    below = [
        found.weights[name] * probability_below(band["median"].to_numpy(), posterior, at)
        for name, posterior in fits.items()
    ]
    np.testing.assert_allclose(np.sum(below, axis=0), 0.5, atol=1e-6)
    assert (band["low"] >= np.min([each["low"] for each in apart.values()], axis=0) - 1e-9).all()
    assert (band["high"] <= np.max([each["high"] for each in apart.values()], axis=0) + 1e-9).all()
    same = tq.average({"one": fits["yeoh"], "other": fits["yeoh"]}).predict(at, discrepancy=False)
    np.testing.assert_allclose(same, fits["yeoh"].predict(at, discrepancy=False), rtol=1e-6, atol=1e-8)
    with pytest.raises(tq.InputError, match="says nothing about the planar one"):
        found.predict(at, mode="planar")


def test_a_fit_of_no_weight_changes_nothing(fits):
    bad = tq.fit(DATA, discrepancy="none", noise_sd=0.001)
    found = tq.average({"yeoh": fits["yeoh"], "bad": bad})
    assert found.weights["bad"] < 1e-12
    assert found.marginals["C10"].hdi() == pytest.approx(fits["yeoh"].solution.marginals["C10"].hdi())


def test_what_cannot_be_averaged_is_refused(fits):
    def refused(words, **others):
        with pytest.raises(tq.InputError, match=words):
            tq.average({"none": fits["none"], **others})

    refused("two fits or more")
    other = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.1, seed=2)
    refused("fits of different data", other=tq.fit(other, discrepancy="none", noise_sd=0.1))
    planar = tq.Experiment("planar", STRETCH, DATA.stress)
    refused("fits of different data", planar=tq.fit(planar, discrepancy="none", noise_sd=0.1))
    rich = tq.fit(DATA, material="mooney-rivlin", discrepancy="none", noise_sd=0.1)
    refused(r"different materials \(neo-hookean and mooney-rivlin\)", rich=rich)
    refused("'flat' has no evidence", flat=tq.fit(DATA, discrepancy="none", noise_sd=0.1, priors={"C10": tq.Flat()}))
    with pytest.raises(tq.InputError, match="prob must be between 0 and 1"):
        tq.average({"a": fits["none"], "b": fits["gp"]}).summary(prob=1.0)
