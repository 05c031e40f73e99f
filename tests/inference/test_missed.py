"""Mass that a quadrature has not seen is found by climbing from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.inference.enumerators.quadrature import has_missed

BOUNDS = np.array([[-np.inf, np.inf], [-4.0, 4.0]])
STARTS = np.array([[-2.0, 0.0, 2.0], [-2.0, 0.0, 2.0]])


def gaussian(places):
    return -0.5 * (places**2).sum(axis=1)


def bent_ridge(places):
    """Along y = x^2 / 2, a hundredth wide, within the bounds of y."""
    x, y = places.T
    return -0.5 * ((y - 0.5 * x**2) / 0.01) ** 2 - 0.1 * x**2


def sample(log_density, near, width, count=4000):
    """Points around a place with the weights that a quadrature would give them."""
    points = near + width * np.random.default_rng(0).uniform(-1, 1, (count, 2))
    weights = np.exp(log_density(points) - log_density(points).max())
    return points, weights / weights.sum()


def test_a_posterior_that_was_seen_whole_passes():
    assert not has_missed(gaussian, BOUNDS, *sample(gaussian, np.zeros(2), 6.0), STARTS)


def test_a_part_of_a_thin_ridge_is_not_the_whole():
    points, weights = sample(bent_ridge, np.array([0.3, 0.045]), np.array([0.3, 0.05]))
    assert has_missed(bent_ridge, BOUNDS, points, weights, STARTS)


def test_a_mode_elsewhere_is_found_and_one_of_no_mass_is_not_counted():
    def with_second(height):
        return lambda places: np.logaddexp(gaussian(places), height + 50 * gaussian(places - [8.0, 1.0]))

    starts = np.array([[-2.0, 7.5], [0.0, 0.8]])
    seen = sample(gaussian, np.zeros(2), 5.0)
    assert has_missed(with_second(1.0), BOUNDS, *seen, starts)
    assert not has_missed(with_second(-12.0), BOUNDS, *seen, starts)


@pytest.mark.parametrize("slope", [0.0, 3.0])
def test_what_lies_beyond_the_bounds_does_not_count(slope):
    def towards_the_bound(places):
        return gaussian(places) + slope * np.maximum(places[:, 1], 0.0) ** 2

    points, weights = sample(towards_the_bound, np.zeros(2), np.array([6.0, 4.0]), 40_000)
    assert not has_missed(towards_the_bound, BOUNDS, points, weights, STARTS)
