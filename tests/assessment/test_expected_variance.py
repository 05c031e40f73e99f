"""Expected variances against closed forms and brute-force integrals over the outcome."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, qmc

from tissuq.assessment.expected_variance import GaussianMixture, expected_variances

RNG = np.random.default_rng(3)


def uniforms(mixture, power=13):
    size = 1 + mixture.root.shape[2] + mixture.mean.shape[1]
    return qmc.Sobol(size, rng=np.random.default_rng(1)).random_base2(power)


def test_one_gaussian_has_the_variance_of_the_textbook():
    X, root, sd = RNG.normal(size=(5, 3)), RNG.normal(size=(3, 3)), RNG.uniform(0.5, 2, 5)
    target = RNG.normal(size=(2, 3))
    covariance = root @ root.T
    after = np.linalg.inv(np.linalg.inv(covariance) + X.T @ np.diag(sd**-2.0) @ X)
    arrays = np.ones(1), np.zeros((1, 5)), (X @ root)[None], sd[None], np.zeros((1, 2)), (target @ root)[None]
    found = expected_variances(GaussianMixture(*arrays), np.zeros((0, 9)))
    np.testing.assert_allclose(found.before, np.diag(target @ covariance @ target.T), rtol=1e-12)
    np.testing.assert_allclose(found.after, np.diag(target @ after @ target.T), rtol=1e-10)


def mixture_of_three():
    """One measurement of y, one target t, with another mean, covariance and noise in each component."""
    weights, mean, target = np.array([0.2, 0.5, 0.3]), np.array([-1.0, 0.0, 2.0]), np.array([0.5, -0.5, 1.0])
    root_y, root_t = RNG.normal(size=(3, 1, 2)), RNG.normal(size=(3, 1, 2))
    noise = np.array([[0.3], [1.0], [0.6]])
    return GaussianMixture(weights, mean[:, None], root_y, noise, target[:, None], root_t)


def test_a_mixture_agrees_with_an_integral_over_what_is_measured():
    mixture = mixture_of_three()
    y = np.linspace(-25, 25, 40001)
    variance_y = (mixture.root**2).sum(axis=2)[:, 0] + mixture.noise_sd[:, 0] ** 2
    covariance = (mixture.root * mixture.target_root).sum(axis=2)[:, 0]
    variance_t = (mixture.target_root**2).sum(axis=2)[:, 0]
    each = mixture.weights[:, None] * norm.pdf(y, mixture.mean, np.sqrt(variance_y)[:, None])
    density = each.sum(axis=0)
    share = each / density
    given = mixture.target_mean + (covariance / variance_y)[:, None] * (y - mixture.mean)
    left = (variance_t - covariance**2 / variance_y)[:, None]
    middle = (share * given).sum(axis=0)
    posterior = (share * (left + given**2)).sum(axis=0) - middle**2
    exact = np.trapezoid(density * posterior, y)
    found = expected_variances(mixture, uniforms(mixture))
    assert found.after[0] == pytest.approx(exact, rel=2e-3)
    assert found.within[0] == pytest.approx(mixture.weights @ left[:, 0], rel=1e-12)
    whole = mixture.weights @ (variance_t + mixture.target_mean[:, 0] ** 2)
    assert found.before[0] == pytest.approx(whole - (mixture.weights @ mixture.target_mean[:, 0]) ** 2, rel=1e-12)


def test_measurements_that_say_nothing_leave_everything_as_it_was():
    mixture = mixture_of_three()
    silent = GaussianMixture(
        mixture.weights,
        np.zeros((3, 1)),
        np.zeros((3, 1, 2)),
        np.ones((3, 1)),
        mixture.target_mean,
        mixture.target_root,
    )
    found = expected_variances(silent, uniforms(silent, 5))
    np.testing.assert_allclose(found.after, found.before, rtol=1e-12)
    assert found.effective == pytest.approx(1 / (mixture.weights @ mixture.weights))


def test_many_components_in_blocks_give_the_same(monkeypatch):
    mixture = mixture_of_three()
    whole = expected_variances(mixture, uniforms(mixture, 5))
    monkeypatch.setattr("tissuq.assessment.expected_variance.AT_ONCE", 1)
    np.testing.assert_allclose(expected_variances(mixture, uniforms(mixture, 5)).after, whole.after, rtol=1e-12)
