"""Expected variances against closed forms and brute-force integrals over the outcome."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, qmc

from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.next_test.expected_variance import expected_variances

RNG = np.random.default_rng(3)


def mixture_of(weights, mean, root, target_mean, target_root):
    both = np.concatenate([mean, target_mean], axis=1), np.concatenate([root, target_root], axis=1)
    return GaussianMixture(weights, np.zeros((len(weights), 0)), *both)


def uniforms(mixture, noise_sd, power=13):
    size = 1 + mixture.root.shape[2] + noise_sd.shape[1]
    return qmc.Sobol(size, rng=np.random.default_rng(1)).random_base2(power)


def test_one_gaussian_has_the_variance_of_the_textbook():
    X, root, sd = RNG.normal(size=(5, 3)), RNG.normal(size=(3, 3)), RNG.uniform(0.5, 2, 5)
    target = RNG.normal(size=(2, 3))
    covariance = root @ root.T
    after = np.linalg.inv(np.linalg.inv(covariance) + X.T @ np.diag(sd**-2.0) @ X)
    arrays = np.ones(1), np.zeros((1, 5)), (X @ root)[None], np.zeros((1, 2)), (target @ root)[None]
    found = expected_variances(mixture_of(*arrays), sd[None], np.zeros((0, 9)))
    np.testing.assert_allclose(found.prior, np.diag(target @ covariance @ target.T), rtol=1e-12)
    np.testing.assert_allclose(found.expected, np.diag(target @ after @ target.T), rtol=1e-10)


def mixture_of_three():
    """One measurement of y, one target t, with another mean, covariance and noise in each component."""
    weights, mean, target = np.array([0.2, 0.5, 0.3]), np.array([-1.0, 0.0, 2.0]), np.array([0.5, -0.5, 1.0])
    root_y, root_t = RNG.normal(size=(3, 1, 2)), RNG.normal(size=(3, 1, 2))
    noise = np.array([[0.3], [1.0], [0.6]])
    return (weights, mean[:, None], root_y, target[:, None], root_t), noise


def test_a_mixture_agrees_with_an_integral_over_what_is_measured():
    (weights, mean, root, target_mean, target_root), noise_sd = mixture_of_three()
    y = np.linspace(-25, 25, 40001)
    variance_y = (root**2).sum(axis=2)[:, 0] + noise_sd[:, 0] ** 2
    covariance = (root * target_root).sum(axis=2)[:, 0]
    variance_t = (target_root**2).sum(axis=2)[:, 0]
    each = weights[:, None] * norm.pdf(y, mean, np.sqrt(variance_y)[:, None])
    density = each.sum(axis=0)
    share = each / density
    given = target_mean + (covariance / variance_y)[:, None] * (y - mean)
    left = (variance_t - covariance**2 / variance_y)[:, None]
    middle = (share * given).sum(axis=0)
    posterior = (share * (left + given**2)).sum(axis=0) - middle**2
    exact = np.trapezoid(density * posterior, y)
    mixture = mixture_of(weights, mean, root, target_mean, target_root)
    found = expected_variances(mixture, noise_sd, uniforms(mixture, noise_sd))
    assert found.expected[0] == pytest.approx(exact, rel=2e-3)
    assert found.within_components[0] == pytest.approx(weights @ left[:, 0], rel=1e-12)
    whole = weights @ (variance_t + target_mean[:, 0] ** 2)
    assert found.prior[0] == pytest.approx(whole - (weights @ target_mean[:, 0]) ** 2, rel=1e-12)


def test_measurements_that_say_nothing_leave_everything_as_it_was():
    (weights, _, _, *target), _ = mixture_of_three()
    silent, noise_sd = mixture_of(weights, np.zeros((3, 1)), np.zeros((3, 1, 2)), *target), np.ones((3, 1))
    found = expected_variances(silent, noise_sd, uniforms(silent, noise_sd, 5))
    np.testing.assert_allclose(found.expected, found.prior, rtol=1e-12)
    assert found.effective == pytest.approx(1 / (weights @ weights))


def test_many_components_in_blocks_give_the_same(monkeypatch):
    arrays, noise_sd = mixture_of_three()
    mixture = mixture_of(*arrays)
    asked = mixture, noise_sd, uniforms(mixture, noise_sd, 5)
    whole = expected_variances(*asked)
    monkeypatch.setattr("tissuq.next_test.expected_variance.MAX_ARRAY_VALUES", 1)
    np.testing.assert_allclose(expected_variances(*asked).expected, whole.expected, rtol=1e-12)
