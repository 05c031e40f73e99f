"""Adaptive quadrature finds known integrals, says how well, and gives right marginals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import norm

from tissuq.errors import ConvergenceError
from tissuq.inference.enumerators.quadrature import integrate
from tissuq.inference.enumerators.survey import Warp, survey, warp_along
from tissuq.parameters.priors import HalfNormal, Normal, Uniform


def narrow(centre, sd):
    """A normalised log density on the cube, a product of Gaussians, and its integral."""
    centre, sd = np.asarray(centre), np.asarray(sd)
    total = np.log(ndtr((1 - centre) / sd) - ndtr(-centre / sd)).sum()
    return (lambda u: norm(centre, sd).logpdf(u).sum(axis=1)[None]), total


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
    assert result.log_integral[0] == pytest.approx(total, abs=1e-4)
    assert abs(result.log_integral[0] - total) <= result.log_error[0] + 1e-12


def test_two_far_modes_are_both_found():
    def function(u):
        return np.logaddexp(norm(0.2, 0.02).logpdf(u[:, 0]), norm(0.9, 0.03).logpdf(u[:, 0]))[None]

    total = np.log(1 + ndtr((1 - 0.9) / 0.03))
    assert integrate(function, 1).log_integral[0] == pytest.approx(total, abs=1e-4)


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_functions_integrated_together_have_each_its_own_integral_moments_and_error(dimension):
    cases = [narrow([0.3] * dimension, [0.2] * dimension), narrow(np.linspace(0.7, 0.5, dimension), [0.05] * dimension)]
    far_apart = 1000.0 * np.arange(2)
    result = integrate(lambda u: np.concatenate([f(u) for f, _ in cases]) + far_apart[:, None], dimension)
    totals = np.array([total for _, total in cases]) + far_apart
    np.testing.assert_allclose(result.log_integral, totals, rtol=0, atol=1e-4)
    assert (np.abs(result.log_integral - totals) <= result.log_error + 1e-11).all()
    np.testing.assert_allclose(result.weights.sum(axis=1), 1)
    np.testing.assert_allclose(result.weights[1] @ result.points, np.linspace(0.7, 0.5, dimension), atol=1e-5)
    for index in range(2):
        lines = result.lines(dimension - 1, index)
        assert lines.integrate_to(np.ones((len(lines.start), 1))) == pytest.approx(1)


def test_weighted_points_have_the_moments_of_the_function():
    function, _ = narrow([0.3, 0.8], [0.1, 0.02])
    result = integrate(function, 2)
    (weights,) = result.weights
    assert weights.sum() == pytest.approx(1)
    mean = weights @ result.points
    assert mean == pytest.approx([0.3, 0.8], abs=5e-4)  # the bounds cut the first a little
    assert np.sqrt(weights @ (result.points[:, 1] - mean[1]) ** 2) == pytest.approx(0.02, rel=1e-3)


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
        integrate(lambda u: np.full((1, len(u)), -np.inf), 1)


WARPS = Warp(  # of two data sets
    is_log=np.array([True, False, True]),
    lower=np.array([[-np.inf, -2.0, np.log(0.1)], [-np.inf, -1.0, np.log(0.1)]]),
    upper=np.array([[np.log(3.0), 5.0, np.inf], [np.log(2.0), 4.0, np.inf]]),
    anchor=np.array([[-1.0, 1.0, 0.5], [-1.2, 0.5, 0.0]]),
    centre=np.array([[-1.0, 1.0, 0.5], [-1.0, 0.7, 0.1]]),
    slope=np.array([[[0, 0, 0], [0.7, 0, 0], [-0.4, 0.3, 0]], [[0, 0, 0], [-0.2, 0, 0], [0.1, 0.8, 0]]]),
    scale=np.array([[0.5, 1.2, 0.3], [0.4, 0.6, 0.5]]),
)
EVERY_WARP = pytest.mark.parametrize("warp", [WARPS[0], WARPS[1]], ids=["first", "second"])


@EVERY_WARP
def test_the_warp_stays_in_its_bounds_and_is_inverted_by_its_coordinates(warp):
    u = np.random.default_rng(0).random((200, 3))
    (h,), _ = warp.parameters(u)
    for j in range(3):
        low, high = warp.bounds(j)
        assert ((h[:, j] >= low) & (h[:, j] <= high)).all()
        coordinate, _ = warp.coordinate(j, h[:, j], u[:, :j])
        np.testing.assert_allclose(np.diag(coordinate) if j else coordinate[0], u[:, j], atol=1e-10)
    assert [WARPS[0].bounds(j) for j in range(3)] == [pytest.approx(ends) for ends in ((0, 3), (-2, 5), (0.1, np.inf))]


@EVERY_WARP
def test_the_density_of_the_warp_is_one_over_its_jacobian(warp):
    u = 0.1 + 0.8 * np.random.default_rng(1).random((20, 3))
    _, (log_density,) = warp.parameters(u)
    step = 1e-6
    for point, expected in zip(u, log_density, strict=True):
        (beyond,), (before,) = (warp.parameters(point + sign * step * np.eye(3))[0] for sign in (1, -1))
        jacobian = np.linalg.det((beyond - before).T / (2 * step))
        assert -np.log(jacobian) == pytest.approx(expected, abs=1e-5)


@EVERY_WARP
def test_the_slope_of_a_coordinate_is_its_derivative(warp):
    u = 0.1 + 0.8 * np.random.default_rng(2).random((20, 3))
    (h,), _ = warp.parameters(u)
    for j in range(3):
        value, step = h[:, j], 1e-6 * np.abs(h[:, j])
        ends = [warp.coordinate(j, value + sign * step, u[:, :j])[0] for sign in (1, -1)]
        _, slope = warp.coordinate(j, value, u[:, :j])
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-4)


def test_data_sets_warped_together_are_warped_as_they_are_alone():
    u = np.random.default_rng(3).random((50, 3))
    h, log_density = WARPS.parameters(u)
    for index in range(2):
        alone, its_density = WARPS[index].parameters(u)
        np.testing.assert_array_equal(h[index], alone[0])
        np.testing.assert_array_equal(log_density[index], its_density[0])


RIDGE = np.array([[0.04, 0.03], [0.03, 0.05]])


def ridge(h, centre):  # Gaussian in the logarithms, flat prior in the logarithm undone
    g = np.log(h) - centre
    return -0.5 * np.einsum("bni,ij,bnj->bn", g, np.linalg.inv(RIDGE), g) - np.log(h).sum(axis=2)


def test_the_warp_finds_the_modes_of_every_data_set_and_their_ridge():
    centres = np.array([[0.2, -0.5], [-1.0, 0.3]])
    seen = survey([[Uniform(0, 50)] * 2] * 2, 0, lambda h: ridge(h, centres[:, None]))
    np.testing.assert_allclose(seen.covariance, [RIDGE, RIDGE], rtol=1e-2)
    warp = warp_along(seen)
    np.testing.assert_allclose(warp.centre, centres, atol=1e-3)
    np.testing.assert_allclose(warp.slope[:, 1, 0], 0.75, rtol=1e-2)
    np.testing.assert_allclose(warp.scale, [[0.2, np.sqrt(0.05 - 0.03**2 / 0.04)]] * 2, rtol=1e-2)


def test_the_survey_of_a_structure_zooms_in_on_the_mass_and_follows_its_ridge():
    centre = np.array([0.2, -0.5])
    seen = survey([[Uniform(0, 50), Uniform(0, 50)]], 1, lambda h: ridge(h, centre))
    assert seen.mean[0] == pytest.approx(centre, abs=1e-3)
    assert seen.covariance[0, 1] == pytest.approx(RIDGE[1], rel=1e-2)
    # the spacing of the lattice widens the parameter of the structure a little
    assert RIDGE[0, 0] < seen.covariance[0, 0, 0] < 1.3 * RIDGE[0, 0]


@pytest.mark.parametrize("structure", [0, 1])
@pytest.mark.parametrize("prior", [HalfNormal(2.0), Uniform(-3, 3), Normal(0.5, 1.0)], ids=str)
def test_a_flat_likelihood_integrates_to_one_under_any_prior(prior, structure):
    warp = warp_along(survey([[prior]], structure, lambda h: np.zeros(h.shape[:2])))

    def log_integrand(u):
        h, log_density = warp.parameters(u)
        return prior.log_density(h[:, :, 0]) - log_density

    assert integrate(log_integrand, 1).log_integral[0] == pytest.approx(0, abs=1e-5)
