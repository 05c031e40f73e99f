"""Gaussians within several bounds, however deep: against dense panels, in any order of parameters, by moments."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from dense import log_interval
from tissuq.inference.box import Boxes
from tissuq.inference.nested import nested_draws, nested_log_mass, nested_points


def gaussians(count, k, seed=0):
    """Return triangles, and bounds that cut from not at all to 60 standard deviations deep."""
    generator = np.random.default_rng(seed)
    factors = generator.normal(size=(count, k, k)) * np.array([1.0, 0.3, 0.05])[:k]
    covariance = factors @ factors.swapaxes(1, 2)
    sd = np.sqrt(np.einsum("mii->mi", covariance))
    depth = generator.choice([0.5, 3.0, 10.0, 60.0][: 6 - k], size=count)[:, None]
    low = generator.normal(size=(count, k)) * depth * sd
    high = low + np.exp(2 * generator.normal(size=(count, k))) * 4 * sd
    high[generator.random((count, k)) < 0.4] = np.inf
    low[generator.random((count, k)) < 0.2] = -np.inf
    return covariance, low, high


def log_mass_by_panels(covariance, low, high):
    """Return the log mass of two parameters within bounds by 100 000 nodes where the integrand is not negligible."""
    triangle = np.linalg.cholesky(covariance)

    def log_density(score):
        ends = ((end[1] - triangle[1, 0] * score) / triangle[1, 1] for end in (low, high))
        return log_interval(*ends) - 0.5 * score**2 - 0.5 * np.log(2 * np.pi)

    start, end = (np.clip(bound[0] / triangle[0, 0], -2000, 2000) for bound in (low, high))
    for _ in range(30):
        grid = np.linspace(start, end, 4001)
        value = log_density(grid)
        seen = np.flatnonzero(value > value.max() - 45)
        start, end = grid[max(seen[0] - 1, 0)], grid[min(seen[-1] + 1, 4000)]
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(start, end, 5001)
    half = 0.5 * np.diff(edges)[:, None]
    value = log_density(edges[:-1, None] + half * (1 + nodes))
    return value.max() + np.log((np.exp(value - value.max()) * weights * half).sum())


def test_the_mass_within_two_bounds_is_that_of_dense_panels():
    covariance, low, high = (each[:40] for each in gaussians(200, 2))
    log_mass, error = nested_log_mass(np.linalg.cholesky(covariance), low, high)
    truth = np.array([log_mass_by_panels(*each) for each in zip(covariance, low, high, strict=True)])
    assert truth.min() < -1000
    assert truth.max() > -0.1
    rounding = 1e-13 * (1 + np.abs(truth))
    assert (np.abs(log_mass - truth) <= error + rounding).all()
    assert np.abs(log_mass - truth).max() < 1e-6
    assert error.max() < 1e-3


@pytest.mark.slow
def test_the_mass_within_three_bounds_does_not_depend_on_their_order():
    covariance, low, high = gaussians(16, 3)
    first, error = nested_log_mass(np.linalg.cholesky(covariance), low, high)
    assert first.min() < -1000
    assert error.max() < 2e-3
    for order in map(list, permutations(range(3))):
        triangle = np.linalg.cholesky(covariance[:, order][:, :, order])
        again, other_error = nested_log_mass(triangle, low[:, order], high[:, order])
        assert (np.abs(again - first) <= error + other_error + 1e-13 * np.abs(first)).all()


def test_independent_parameters_have_the_product_of_their_masses():
    low, high = np.array([[-0.3, 20.0, -1.0]]), np.array([[0.5, np.inf, 1.0]])
    log_mass, error = nested_log_mass(np.eye(3)[None], low, high)
    assert log_mass[0] == pytest.approx(log_interval(low, high).sum(), abs=1e-9)
    assert error[0] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(("k", "shift"), list(product((2, 3), (0.0, 3.0, 30.0))))
def test_draws_have_the_moments_of_the_bounded_gaussian(k, shift):
    size = 40_000
    covariance = (0.8 * np.ones((k, k)) + 0.2 * np.eye(k))[None]
    triangle, low, high = np.linalg.cholesky(covariance), np.full((1, k), shift), np.full((1, k), np.inf)
    uniforms = np.random.default_rng(0).random((1, size, k))
    drawn = nested_draws(triangle, low, high, uniforms)[0] @ triangle[0].T
    assert (drawn >= shift - 1e-9).all()
    score, log_terms = nested_points(triangle, low, high)
    weights = np.exp(log_terms - log_terms.max())
    mean = (weights * score).sum() / weights.sum()
    sd = np.sqrt((weights * (score - mean) ** 2).sum() / weights.sum())
    assert np.abs(drawn.mean(axis=0) - mean).max() < 5 * sd / np.sqrt(size)  # all parameters are alike
    assert np.abs(drawn.std(axis=0) / sd - 1).max() < 6 / np.sqrt(size)


def test_draws_of_parameters_far_from_their_bounds_follow_those_that_are_cut():
    root = np.linalg.cholesky(np.array([[1.0, 0.9, 0.5], [0.9, 1.0, 0.4], [0.5, 0.4, 1.0]]))
    box = Boxes(np.array([[-np.inf, 0.0, 0.0]]), np.full((1, 3), np.inf))
    mean = np.array([[0.0, -3.0, -2.0]])
    drawn = box.draws(mean, root[None], np.random.default_rng(1).random((1, 20_000, 3)))[0]
    free = np.random.default_rng(2).standard_normal((4_000_000, 3)) @ root.T + mean[0]
    kept = free[(free[:, 1:] >= 0).all(axis=1)]
    assert len(kept) > 1000
    error = kept.std(axis=0) / np.sqrt(len(kept))
    assert (np.abs(drawn.mean(axis=0) - kept.mean(axis=0)) < 5 * error).all()
    assert np.abs(np.cov(drawn.T) - np.cov(kept.T)).max() < 0.05


@pytest.mark.slow
def test_four_bounds_go_by_points_and_sweeps():
    covariance = 0.5 * np.ones((4, 4)) + 0.5 * np.eye(4)
    box = Boxes(np.zeros((1, 4)), np.full((1, 4), np.inf))
    root = np.linalg.cholesky(covariance)[None]
    log_mass, error = box.log_mass(np.zeros((1, 4)), root)
    assert abs(log_mass[0] - np.log(0.2)) < 3 * error[0] + 1e-4  # 1 / (k + 1) for correlations of one half
    drawn = box.draws(np.zeros((1, 4)), root, np.random.default_rng(0).random((1, 4000, 4)))[0]
    free = np.random.default_rng(2).standard_normal((100_000, 4)) @ root[0].T
    kept = free[(free >= 0).all(axis=1)]
    assert np.abs(drawn.mean(axis=0) - kept.mean(axis=0)).max() < 0.06
    assert np.abs(np.cov(drawn.T) - np.cov(kept.T)).max() < 0.06


def test_four_bounds_among_parameters_with_roots_of_less_rank():
    root = np.zeros((1, 6, 6))
    root[0, :4, :4] = np.linalg.cholesky(0.5 * np.ones((4, 4)) + 0.5 * np.eye(4))
    root[0, 4, 4] = 1.0
    lower = np.array([[0.0, 0.0, 0.0, 0.0, -np.inf, -np.inf]])
    box = Boxes(lower, np.full((1, 6), np.inf))
    drawn = box.draws(np.zeros((1, 6)), root, np.random.default_rng(0).random((1, 2000, 6)))[0]
    assert (drawn[:, :4] >= 0).all()
    assert drawn[:, 4].std() == pytest.approx(1.0, abs=0.1)
    assert np.abs(drawn[:, 5]).max() < 1e-6
