"""Adaptive quadrature finds known integrals, says how well, and gives right marginals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import norm

from tissuq.errors import ConvergenceError
from tissuq.inference.quadrature import integrate
from tissuq.inference.warp import Warp, warp_around_mode
from tissuq.priors import HalfNormal, Normal, Uniform


def narrow(centre, sd):
    """A normalised log density on the cube, a product of Gaussians, and its integral."""
    centre, sd = np.asarray(centre), np.asarray(sd)
    total = np.log(ndtr((1 - centre) / sd) - ndtr(-centre / sd)).sum()
    return (lambda u: norm(centre, sd).logpdf(u).sum(axis=1)), total


@pytest.mark.parametrize(
    ("centre", "sd"),
    [
        ([0.3], [0.05]),
        ([0.01], [0.003]),
        ([0.0], [0.02]),
        ([0.3, 0.8], [0.1, 0.02]),
        ([0.0, 1.0], [0.05, 0.05]),
        ([0.4, 0.5, 0.6], [0.1, 0.05, 0.2]),
        ([0.0, 0.5, 1.0], [0.1, 0.1, 0.1]),
    ],
)
def test_peaks_inside_and_on_the_boundary_are_integrated_within_the_stated_error(centre, sd):
    function, total = narrow(centre, sd)
    result = integrate(function, len(centre))
    assert result.log_integral == pytest.approx(total, abs=1e-4)
    assert abs(result.log_integral - total) <= result.log_error + 1e-12


def test_two_far_modes_are_both_found():
    def function(u):
        return np.logaddexp(norm(0.2, 0.02).logpdf(u[:, 0]), norm(0.9, 0.03).logpdf(u[:, 0]))

    total = np.log(1 + ndtr((1 - 0.9) / 0.03))
    assert integrate(function, 1).log_integral == pytest.approx(total, abs=1e-4)


def test_weighted_points_have_the_moments_of_the_function():
    function, _ = narrow([0.3, 0.8], [0.1, 0.02])
    result = integrate(function, 2)
    assert result.weights.sum() == pytest.approx(1)
    mean = result.weights @ result.points
    assert mean == pytest.approx([0.3, 0.8], abs=5e-4)  # the bounds cut the first a little
    assert np.sqrt(result.weights @ (result.points[:, 1] - mean[1]) ** 2) == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize("side", [0, 1, 2])
def test_lines_give_the_marginal_distribution(side):
    centre, sd = [0.4, 0.5, 0.6], [0.1, 0.05, 0.2]
    function, _ = narrow(centre, sd)
    lines = integrate(function, 3).lines(side)
    x = np.linspace(0.05, 0.95, 19)
    coordinates = np.broadcast_to(x, (len(lines.start), 19))
    law = norm(centre[side], sd[side])
    inside = law.cdf(1) - law.cdf(0)
    expected = (law.cdf(x) - law.cdf(0)) / inside
    np.testing.assert_allclose(lines.integrate_to(coordinates), expected, atol=1e-4)
    density = lines.evaluate(coordinates, np.ones_like(coordinates))
    np.testing.assert_allclose(density, law.pdf(x) / inside, atol=5e-3 * law.pdf(centre[side]))


def test_a_function_that_vanishes_everywhere_is_an_error():
    with pytest.raises(ConvergenceError, match="contradict"):
        integrate(lambda u: np.full(len(u), -np.inf), 1)


WARP = Warp(
    is_log=np.array([True, False, True]),
    lower=np.array([-np.inf, -2.0, np.log(0.1)]),
    upper=np.array([np.log(3.0), 5.0, np.inf]),
    centre=np.array([-1.0, 1.0, 0.5]),
    slope=np.array([[0, 0, 0], [0.7, 0, 0], [-0.4, 0.3, 0]]),
    scale=np.array([0.5, 1.2, 0.3]),
)


def test_the_warp_stays_in_its_bounds_and_is_inverted_by_its_coordinates():
    u = np.random.default_rng(0).random((200, 3))
    h, _ = WARP.parameters(u)
    assert (h[:, 0] <= 3).all()
    assert (h[:, 0] >= 0).all()
    assert ((h[:, 1] >= -2) & (h[:, 1] <= 5)).all()
    assert (h[:, 2] >= 0.1).all()
    for j in range(3):
        coordinate, _ = WARP.coordinate(j, h[:, j], u[:, :j])
        np.testing.assert_allclose(np.diag(coordinate) if j else coordinate[0], u[:, j], atol=1e-10)


def test_the_density_of_the_warp_is_one_over_its_jacobian():
    u = 0.1 + 0.8 * np.random.default_rng(1).random((20, 3))
    _, log_density = WARP.parameters(u)
    step = 1e-6
    for point, expected in zip(u, log_density, strict=True):
        columns = [
            (WARP.parameters(point[None] + step * e)[0] - WARP.parameters(point[None] - step * e)[0])[0] / (2 * step)
            for e in np.eye(3)
        ]
        jacobian = np.linalg.det(np.array(columns).T)
        assert -np.log(jacobian) == pytest.approx(expected, abs=1e-5)


def test_the_warp_finds_the_mode_and_its_ridge():
    covariance = np.array([[0.04, 0.03], [0.03, 0.05]])

    def log_likelihood(h):  # Gaussian in the logarithms, flat prior in the logarithm undone
        g = np.log(h) - [0.2, -0.5]
        return -0.5 * np.einsum("ni,ij,nj->n", g, np.linalg.inv(covariance), g) - np.log(h).sum(axis=1)

    warp = warp_around_mode([Uniform(0, 50), Uniform(0, 50)], log_likelihood)
    np.testing.assert_allclose(warp.centre, [0.2, -0.5], atol=1e-3)
    assert warp.slope[1, 0] == pytest.approx(0.75, rel=1e-2)
    assert warp.scale == pytest.approx([0.2, np.sqrt(0.05 - 0.03**2 / 0.04)], rel=1e-2)


@pytest.mark.parametrize("prior", [HalfNormal(2.0), Uniform(-3, 3), Normal(0.5, 1.0)], ids=str)
def test_a_flat_likelihood_integrates_to_one_under_any_prior(prior):
    warp = warp_around_mode([prior], lambda h: np.zeros(len(h)))

    def log_integrand(u):
        h, log_density = warp.parameters(u)
        return prior.log_density(h[:, 0]) - log_density

    assert integrate(log_integrand, 1).log_integral == pytest.approx(0, abs=1e-5)
