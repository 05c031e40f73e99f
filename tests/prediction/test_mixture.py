"""Quantiles and the score of mixtures of Gaussians, against closed forms, quadrature and samples."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.special
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import norm

from tissuq.prediction.bands import Mixtures


def one_place(weights, means, sds):
    return Mixtures(np.array(weights), np.array(means)[:, None], np.array(sds)[:, None] ** 2)


def random_mixture(seed, count=5):
    generator = np.random.default_rng(seed)
    weights = generator.dirichlet(np.ones(count))
    return weights, 3 * generator.standard_normal(count), generator.uniform(0.05, 2.0, count)


@pytest.mark.parametrize("value", [-3.0, 0.2, 1.0, 40.0])
def test_the_score_of_one_gaussian_is_that_of_gneiting_and_raftery(value):
    z = (value - 1.0) / 0.7
    expected = 0.7 * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi))
    assert one_place([1.0], [1.0], [0.7]).crps(np.array([value]))[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_the_score_is_the_integral_of_the_squared_difference_of_distributions(seed):
    weights, means, sds = random_mixture(seed)
    value = np.random.default_rng(seed + 100).normal(0, 4)

    def cdf(x):
        return weights @ norm.cdf(x, means, sds)

    places = sorted([*means, value])
    below = quad(lambda x: cdf(x) ** 2, -30, value, points=[p for p in places if p < value], limit=400)[0]
    above = quad(lambda x: (1 - cdf(x)) ** 2, value, 30, points=[p for p in places if p > value], limit=400)[0]
    assert one_place(weights, means, sds).crps(np.array([value]))[0] == pytest.approx(below + above, rel=1e-7)


def test_the_score_is_the_mean_distance_less_half_that_of_two_draws():
    weights, means, sds = random_mixture(9)
    generator, count, value = np.random.default_rng(1), 400_000, 1.3
    first, second = (
        generator.normal(means[chosen], sds[chosen]) for chosen in generator.choice(5, (2, count), p=weights)
    )
    each = np.abs(first - value) - 0.5 * np.abs(first - second)
    found = one_place(weights, means, sds).crps(np.array([value]))[0]
    assert found == pytest.approx(each.mean(), abs=5 * each.std() / np.sqrt(count))


def test_the_score_of_points_is_that_of_an_ensemble():
    # Distances from 1: 1, 0 and 2; between the points: 1, 3 and 2, each pair twice.
    found = one_place([1 / 3] * 3, [0.0, 1.0, 3.0], [0.0] * 3).crps(np.array([1.0]))[0]
    assert found == pytest.approx(1.0 - 0.5 * 2 * (1 + 3 + 2) / 9, rel=1e-12)


def test_few_gaussians_stand_for_many_at_many_places():
    generator = np.random.default_rng(3)
    means = np.sort(generator.standard_normal(1500))[:, None] + np.zeros(600)
    values = generator.standard_normal(600)
    whole = Mixtures(np.full(1500, 1 / 1500), means, np.full((1500, 600), 0.3))
    z, sd = values / np.sqrt(1.3), np.sqrt(1.3)  # N(0, 1) and N(0, 0.3) together, known to the scatter of 1500 means
    expected = sd * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi))
    np.testing.assert_allclose(whole.crps(values), expected, atol=5 / np.sqrt(1500) * 0.6)


@pytest.mark.parametrize("probability", [0.001, 0.025, 0.5, 0.975])
def test_a_quantile_is_where_the_distribution_reaches_it(probability):
    for seed in range(4):
        weights, means, sds = random_mixture(seed)
        expected = brentq(lambda x, w=weights, m=means, s=sds: w @ norm.cdf(x, m, s) - probability, -40, 40, xtol=1e-12)
        found = one_place(weights, means, sds).quantile(probability)[0]
        assert found == pytest.approx(expected, abs=1e-6)


def test_places_that_have_converged_stay_while_others_do_not(monkeypatch):
    weights, sds = np.array([0.3, 0.7]), np.linspace(0.02, 2, 60) * np.ones((2, 1))
    means = np.array([[-1.0], [1.0]]) * np.ones(60)
    evaluated, ndtr = [], scipy.special.ndtr
    monkeypatch.setattr(scipy.special, "ndtr", lambda scores: evaluated.append(scores) or ndtr(scores))
    quantiles = Mixtures(weights, means, sds**2).quantile(0.25)
    assert len(evaluated) < 15  # by halving an interval of many sds to 1e-9, more than thirty
    np.testing.assert_allclose(weights @ ndtr((quantiles - means) / sds), 0.25, rtol=0, atol=1e-9)


@pytest.mark.parametrize("probability", [0.025, 0.5, 0.975])
def test_a_quantile_of_very_many_gaussians_is_where_their_distribution_reaches_it(probability):
    generator = np.random.default_rng(5)
    units = np.array([0.01, 1.0, 50.0, 1.0])
    means, sds = (
        np.clip(generator.standard_t(2, (3000, 4)), -90, 90) * units,
        generator.uniform(1, 2, (3000, 4)) * units,
    )
    weights = generator.dirichlet(np.ones(3000))
    quantiles = Mixtures(weights, means, sds**2).quantile(probability)
    np.testing.assert_allclose(weights @ norm.cdf((quantiles - means) / sds), probability, rtol=0, atol=1e-9)
