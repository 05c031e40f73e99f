"""A density along one coordinate, known at few places, against closed forms; and parameters that take such places."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

import tissuq as tq
from tissuq.inference.enumerators.line import FINE, ROUGH, first_places, known_along, peaks
from tissuq.mechanics.arithmetic import expm1

END = 8.0
DENSITIES = {
    "narrow": ([1.0], [1.37], [0.003]),
    "wide": ([1.0], [-0.2], [1.0]),
    "spike on a broad one": ([0.5, 0.5], [0.4, 0.0], [0.02, 1.0]),
    "two modes": ([0.3, 0.7], [-1.6, 2.2], [0.1, 0.3]),
    "beyond the first places": ([1.0], [5.5], [0.2]),
}


def log_density_of(name):
    weights, means, sds = map(np.array, DENSITIES[name])
    return lambda places: logsumexp(norm.logpdf(places[:, None], means, sds), axis=1, b=weights)


@pytest.mark.parametrize("name", DENSITIES)
def test_mass_and_quantiles_are_those_of_the_density(name):
    first = known_along(log_density_of(name), first_places(), END)
    likely = peaks(log_density_of(name), END / 2)
    line = known_along(log_density_of(name), np.concatenate([first.spread(FINE), likely]), END)
    assert logsumexp(line.log_masses) == pytest.approx(0.0, abs=0.02)
    assert len(line.places) < 40
    weights, means, sds = map(np.array, DENSITIES[name])
    points, _, cumulative = line.distribution
    expected = norm.cdf(points[:, None], means, sds) @ weights
    np.testing.assert_allclose(cumulative, expected, atol=0.015)
    shares = np.exp(line.log_masses)
    assert shares @ line.places / shares.sum() == pytest.approx(weights @ means, abs=0.1 * np.sqrt(weights @ sds**2))


def test_peaks_are_found_with_a_standard_deviation_on_either_side():
    found = peaks(log_density_of("spike on a broad one"), END / 2)
    np.testing.assert_allclose(found[3:], [0.38, 0.4, 0.42], atol=1e-3)


def test_the_error_tells_how_far_the_mass_is_off():
    line = known_along(log_density_of("wide"), first_places(), END, ROUGH)
    coarse = known_along(log_density_of("wide"), [-2.5, -0.3, 2.1], END, ROUGH)
    assert line.error < coarse.error
    assert abs(logsumexp(coarse.log_masses)) < 3 * coarse.error


def test_places_without_a_density_are_none():
    line = known_along(lambda places: np.where(places < 0.8, -0.5 * places**2, np.nan), first_places(), END)
    cumulative = norm.cdf(line.distribution[0]) / norm.cdf(0.8)
    np.testing.assert_allclose(line.distribution[2], np.minimum(cumulative, 1), atol=0.02)


def test_a_density_that_does_not_fall_before_the_end_stops_there():
    line = known_along(lambda places: places, first_places(), END)
    assert line.places[-1] == END
    assert line.distribution[2][-1] == 1


STRETCH = np.linspace(0.75, 1.6, 18)
RATES = np.linspace(0.02, 1.98, 40)


def law(rate):
    def demiray(I1, I2, mu):
        return mu / (2 * rate) * expm1(rate * (I1 - 3))

    return tq.FunctionLaw(demiray)


@pytest.mark.slow
def test_a_parameter_is_summed_as_fits_with_it_known_are():
    data = tq.simulate("demiray", {"mu": 1.0, "b": 0.8}, STRETCH, noise_sd=0.02, seed=2)
    options = {"discrepancy": "taylor", "priors": {"mu": tq.Uniform(0, 5)}}
    known = [tq.fit(data, material=law(rate), **options) for rate in RATES]
    evidences = np.array([posterior.log_evidence for posterior in known])
    weights = np.exp(evidences - evidences.max())
    options["priors"] |= {"b": tq.Uniform(0, 2)}
    found = tq.fit(data, material="demiray", **options)
    assert found.log_evidence == pytest.approx(evidences.max() + np.log(weights.mean()), abs=0.05)
    weights /= weights.sum()
    mean, table = weights @ RATES, found.summary()
    sd = np.sqrt(weights @ (RATES - mean) ** 2)
    assert table.loc["b", "mean"] == pytest.approx(mean, abs=0.05 * sd)
    assert table.loc["b", "sd"] == pytest.approx(sd, rel=0.05)
    below = np.interp([0.1, 0.5, 0.9], np.cumsum(weights) - 0.5 * weights, RATES)
    np.testing.assert_allclose(found.marginals["b"].quantile([0.1, 0.5, 0.9]), below, atol=0.15 * sd)
    moduli = np.array([posterior.marginals["mu"].mean for posterior in known])
    assert table.loc["mu", "mean"] == pytest.approx(weights @ moduli, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("material", ["gent", "arruda-boyce"])
def test_a_law_that_locks_is_fitted_where_the_data_do_not_show_it(material):
    data = tq.simulate("yeoh", {"C10": 0.01, "C20": 0.002, "C30": 0.001}, np.linspace(0.8, 1.6, 40), 0.0005, seed=1)
    posterior = tq.fit(data, material=material, discrepancy="taylor")
    modulus = posterior.assess().modulus
    assert modulus[1] < 0.02 < modulus[2]
    low, high = posterior.summary().loc["Jm", ["hdi_low", "hdi_high"]]
    assert high > 3 * low


@pytest.mark.slow
@pytest.mark.parametrize("noise_sd", [1e-3, None])
def test_the_middle_of_a_prior_may_have_no_stress(noise_sd):
    """Ogden's energy divides by its exponent."""
    data = tq.simulate("ogden-1", {"mu1": 0.4, "alpha1": 3.0}, np.linspace(0.8, 1.4, 12), 1e-3, 1)
    found = [
        tq.fit(
            data, material="ogden-1", discrepancy="taylor", noise_sd=noise_sd, priors={"alpha1": tq.Uniform(low, 10)}
        )
        for low in (-10, -10.01)
    ]
    assert found[0].log_evidence == pytest.approx(found[1].log_evidence, abs=0.01)
    means = [posterior.summary().loc["alpha1", "mean"] for posterior in found]
    assert means[0] == pytest.approx(means[1], rel=1e-3)
