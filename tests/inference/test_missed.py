"""Mass that a quadrature has not seen is found by climbing from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
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


def test_a_thin_ridge_is_followed_through_cells_whose_points_it_misses():
    """Of knowles' law and precise data, mu integrated, against a grid that is fine along the ridge.

    In one cell the ridge had gone between the points: there the density of n was a third of what it is beside.
    """
    stretch, sd = np.linspace(0.8, 1.5, 7), 1e-4
    unit, x = stretch - stretch**-2, stretch**2 + 2 / stretch - 3
    stress = 0.1 * unit * (1 + x / 2) + sd * np.random.default_rng(3).standard_normal(7)
    options = {"material": "knowles", "discrepancy": "none", "noise_sd": sd, "tolerances": "as-tested"}
    solution = tq.fit(tq.Experiment("uniaxial", stretch, stress), **options).solution

    def log_density(power, log_b):
        column = unit * (1 + np.exp(log_b)[..., None] * x / power[..., None]) ** (power[..., None] - 1)
        inner, with_data = (column**2).sum(axis=-1), column @ stress
        return -0.5 * (stress @ stress - with_data**2 / inner) / sd**2 - 0.5 * np.log(inner)

    powers, coarse = np.linspace(1.3, 6, 600)[:, None], np.linspace(-6, 6, 3000)
    best = coarse[log_density(*np.broadcast_arrays(powers, coarse)).argmax(axis=1)]
    fine = best[:, None] + np.linspace(-0.3, 0.3, 2001)
    priors = solution.model.priors
    heights = log_density(*np.broadcast_arrays(powers, fine)) - 6 * np.log(sd * np.sqrt(2 * np.pi)) + fine
    heights += priors["b"].log_density(np.exp(fine)) + priors["n"].log_density(powers) - np.log(priors["mu"].high)
    cell = (powers[1, 0] - powers[0, 0]) * (fine[0, 1] - fine[0, 0])
    weights = np.exp(heights - heights.max())
    assert solution.log_evidence == pytest.approx(heights.max() + np.log(weights.sum() * cell), abs=0.003)
    density = weights.sum(axis=1) / weights.sum() / (powers[1, 0] - powers[0, 0])
    at = np.linspace(1.6, 2.2, 31)
    assert solution.marginals["n"].pdf(at) == pytest.approx(np.interp(at, powers[:, 0], density), abs=0.1)
