"""Boxes, spectra and marginals against SciPy."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.stats import beta, expon, lognorm, multivariate_normal, norm, truncnorm, uniform

import tissuq as tq
from tissuq.experiments.modes import Uniaxial
from tissuq.inference.box import Boxes
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.marginal import HermiteCubics, blended, marginal_of_mixture, marginal_of_points
from tissuq.inference.reduction import correlation_spectrum
from tissuq.inference.truncated_mixture import TruncatedMixture
from tissuq.mechanics import NeoHookean
from tissuq.model.discrepancy import Constant, GaussianProcess
from tissuq.model.statistical_model import StatisticalModel

ROOT = np.linalg.cholesky([[1.0, 0.6, 0.2], [0.6, 2.0, -0.3], [0.2, -0.3, 0.5]])


def boxes(lower, upper):
    """The bounds of one Gaussian."""
    return Boxes(np.array([lower]), np.array([upper]))


def test_the_mass_in_a_box_is_scipys():
    box = boxes([-0.5, -1.0, -np.inf], [1.0, 2.0, 0.3])
    (log_mass,), (error,) = box.log_mass(np.zeros((1, 3)), ROOT[None])
    law = multivariate_normal(np.zeros(3), ROOT @ ROOT.T, maxpts=2_000_000, abseps=1e-8, releps=1e-8)
    truth = law.cdf(box.upper[0], lower_limit=np.array([-0.5, -1.0, -40]))
    assert abs(log_mass - np.log(truth)) < error + 1e-6  # SciPy's own error is 1e-7
    assert box.beyond(np.zeros((1, 3)), ROOT[None]).sum() >= 1 - truth
    assert box.ceiling(np.zeros((1, 3)), ROOT[None])[0] >= np.log(truth)


@pytest.mark.parametrize("share", [1e-2, 1e-4])
def test_what_a_bound_cuts_counts_in_the_marginal_though_it_weighs_little(share):
    """A Gaussian far from the bound, and half of one at it, whose mean is 100 sqrt(2 / pi)."""
    free = GaussianMixture(np.array([1 - share]), np.zeros((1, 0)), np.array([[1000.0]]), np.array([[[1.0]]]))
    cut = GaussianMixture(np.array([share]), np.zeros((1, 0)), np.array([[0.0]]), np.array([[[100.0]]]))
    found = TruncatedMixture(GaussianMixture.of_all([free, cut]), boxes([0.0], [np.inf])).marginal(0)
    at_bound = 100 * np.sqrt(2 / np.pi)
    assert found.mean == pytest.approx((1 - share) * 1000 + share * at_bound, rel=1e-7)
    assert found.quantile(share / 2) < 500 < found.quantile(1.5 * share)


def test_components_that_stand_for_several_mixtures_are_those_of_all_of_them():
    generator = np.random.default_rng(2)
    mixtures = [
        GaussianMixture(
            generator.random(count), generator.random((count, 1)), generator.random((count, p)), np.ones((count, p, p))
        )
        for count, p in ((5, 1), (400, 2), (30, 1))
    ]
    few, picked = GaussianMixture.of_all(mixtures, 50), GaussianMixture.of_all(mixtures).resampled(50)
    for name in ("weights", "settings", "mean", "root"):
        np.testing.assert_array_equal(getattr(few, name), getattr(picked, name))


def test_the_mass_far_in_the_tail_keeps_its_digits():
    box = boxes([0.0], [np.inf])
    for distance in (5.0, 15.0, 30.0):
        gaussian = np.array([[-distance]]), np.ones((1, 1, 1))
        assert box.log_mass(*gaussian)[0] == pytest.approx(norm.logcdf(-distance), rel=1e-10)
        assert box.ceiling(*gaussian) == pytest.approx(norm.logcdf(-distance), rel=1e-10)


def test_parameters_far_from_their_bounds_cost_no_accuracy():
    box = boxes([-50.0, 0.0, -50.0], [50.0, 50.0, 50.0])
    log_mass, error = box.log_mass(np.array([[0.0, -1.0, 0.0]]), ROOT[None])
    assert log_mass[0] == pytest.approx(norm.logcdf(-1 / np.sqrt(2)), rel=1e-12)
    assert error[0] == 0


def test_every_gaussian_has_its_own_bounds():
    lower, upper = np.array([[-1.0, -np.inf], [0.0, 0.0], [-9.0, 0.5]]), np.array([[1.0, 2.0], [np.inf, 3.0], [9, 9]])
    means, root = np.array([[0.2, 0.1], [-0.5, 1.0], [0.0, -1.0]]), ROOT[:2, :2]
    together, _ = Boxes(lower, upper).log_mass(means, np.repeat(root[None], 3, axis=0))
    for low, high, mean, found in zip(lower, upper, means, together, strict=True):
        law = multivariate_normal(mean, root @ root.T)
        truth = law.cdf(np.minimum(high, 40.0), lower_limit=np.maximum(low, -40.0))
        assert np.exp(found) == pytest.approx(truth, rel=1e-6)


def test_points_in_a_box_have_the_moments_of_the_bounded_gaussian():
    box = boxes([0.0, -np.inf, -np.inf], [np.inf, np.inf, np.inf])
    log_weights, points = box.points(np.zeros((1, 3)), ROOT[None], 20_000)
    weights = np.exp(log_weights)
    law = truncnorm(0, np.inf)
    mean = weights[0] @ points[0] / weights[0].sum()
    assert mean == pytest.approx(law.mean() * np.array([1.0, 0.6, 0.2]), abs=5e-3)
    assert (points[0, :, 0] >= 0).all()


def spectrum(points, psi):
    """The spectrum of a squared exponential at any points, also at fewer than a whole model accepts."""
    measured = SimpleNamespace(states=Uniaxial().path.at(points, 0))
    return correlation_spectrum(
        SimpleNamespace(
            experiment=measured, discrepancy=GaussianProcess(), is_repeated=False, whitening=None, white=np.asarray
        ),
        (psi,),
    )


def test_cut_parts_of_very_different_widths_have_a_marginal_together():
    """A narrow part, far from most of the places at which a wide one is tabulated, made them no number."""
    root = np.array([[[1.0, 0.0], [0.5, 0.8]], [[1e-12, 0.0], [5e-13, 8e-13]]])
    parts = GaussianMixture(np.array([0.5, 0.5]), np.zeros((2, 0)), np.zeros((2, 2)), root)
    marginal = TruncatedMixture(parts, boxes([-np.inf, 0.0], [np.inf, np.inf])).marginal(0)
    assert np.isfinite(marginal.density).all()
    assert marginal.mean == pytest.approx(0.5 * 0.5 / np.hypot(0.5, 0.8) * np.sqrt(2 / np.pi), rel=1e-6)
    assert np.isfinite(marginal.hdi()).all()


def test_a_part_that_bounds_cut_and_that_hardly_weighs_is_kept_without_harm():
    box = boxes([0.0, 0.0], [np.inf, np.inf])
    weights = np.array([1 - 7e-8, 7e-8])
    mean, root = np.array([[9.0, 9.0], [0.5, 0.5]]), np.repeat(np.eye(2)[None], 2, axis=0)
    parts = GaussianMixture(weights, np.zeros((2, 0)), mean, root)
    found = TruncatedMixture(parts, box)
    assert len(found.crossed.weights) == 1
    for place in range(2):
        assert found.marginal(place).mean == pytest.approx(9.0, abs=1e-6)
        assert found.marginal(place).sd == pytest.approx(1.0, abs=1e-5)
    whole = found.components()
    assert whole.weights.sum() == pytest.approx(1, abs=1e-12)
    assert (whole.mean >= 0).all()


@pytest.mark.parametrize("psi", [0.05, 0.3, 1.5, 8.0])
@pytest.mark.parametrize("n", [1, 2, 30, 300])
def test_the_spectrum_rebuilds_the_correlation(n, psi):
    points = np.linspace(0.5, 4, n)
    found = spectrum(points, psi)
    dense = np.exp(-0.5 * ((points[:, None] - points) / psi) ** 2)
    np.testing.assert_allclose((found.vectors * found.values) @ found.vectors.T, dense, atol=1e-10)
    np.testing.assert_allclose(found.vectors.T @ found.vectors, np.eye(len(found.values)), atol=1e-12)


def test_a_smooth_kernel_has_a_small_rank():
    assert len(spectrum(np.linspace(0.5, 4, 300), 1.5).values) < 20


def test_repeated_points_do_not_break_the_spectrum():
    points = np.repeat([1.0, 1.5, 2.0], 3)
    assert (spectrum(points, 0.5).values > 1e-12).sum() == 3


def test_measurements_at_one_stretch_share_their_error_where_repeats_tell_the_noise():
    stretch = np.array([0.8, 1.2, 0.8, 1.5, 1.2, 0.8])
    data = tq.Experiment("uniaxial", stretch, np.ones(6))
    model = StatisticalModel(data, NeoHookean(), Constant(), "repeats")
    found = correlation_spectrum(model, ())
    dense = (found.vectors * found.values) @ found.vectors.T
    np.testing.assert_allclose(dense, stretch[:, None] == stretch, atol=1e-14)


def test_the_hpd_of_a_gaussian_is_its_central_interval():
    marginal = marginal_of_mixture(np.ones(1), np.array([2.0]), np.array([0.5]))
    assert marginal.hdi() == pytest.approx(norm(2, 0.5).interval(0.95), abs=1e-3 * 0.5)
    assert marginal.hdi(0.5) == pytest.approx(norm(2, 0.5).interval(0.5), abs=2e-3 * 0.5)


def test_a_mixture_keeps_its_moments_also_when_its_gaussians_are_merged():
    rng = np.random.default_rng(0)
    weights = rng.random(5000)
    weights /= weights.sum()
    means, sds = rng.normal(size=5000), 0.1 + rng.random(5000)
    marginal = marginal_of_mixture(weights, means, sds)
    density = (weights / sds) @ norm.pdf((marginal.points - means[:, None]) / sds[:, None])
    np.testing.assert_allclose(marginal.density, density, atol=2e-3 * density.max())


def test_the_hpd_of_an_exponential_starts_at_its_bound():
    points = expon.ppf((np.arange(100_000) + 0.5) / 100_000)
    marginal = marginal_of_points(points, np.ones(100_000), (0.0, np.inf))
    assert marginal.mean == pytest.approx(1, rel=1e-3)
    assert marginal.hdi() == pytest.approx((0, expon.ppf(0.95)), abs=0.02)


def test_the_hpd_at_a_bound_holds_its_mean_with_points_of_no_weight_far_off():
    """Half a table of 1000 bins from there, the whole posterior lay in one of them, and its HPD beside the mean."""
    points = 1 - 1e-5 * expon.ppf((np.arange(10_000) + 0.5) / 10_000)
    marginal = marginal_of_points(np.append(points, [0.0, 0.5]), np.append(np.ones(10_000), [1e-9, 1e-6]), (0.0, 1.0))
    low, high = marginal.hdi()
    assert low < marginal.mean < high == pytest.approx(1.0, abs=1e-7)
    assert low == pytest.approx(1 - 1e-5 * expon.ppf(0.95), abs=2e-6)


def test_two_peaks_of_points_stay_apart():
    """Smoothed by what both spread together, each was as wide as the gap between them."""
    of_one = norm.ppf((np.arange(60) + 0.5) / 60)
    marginal = marginal_of_points(np.concatenate([2 + 0.1 * of_one, 9 + 0.2 * of_one]), np.ones(120), (-np.inf, np.inf))
    truth = [2 + 0.1 * norm.ppf(0.1), 2 + 0.1 * norm.ppf(0.9), 9 + 0.2 * norm.ppf(0.1), 9 + 0.2 * norm.ppf(0.9)]
    assert [marginal.quantile(p) for p in (0.05, 0.45, 0.55, 0.95)] == pytest.approx(truth, abs=0.1)


def test_points_over_powers_of_ten_keep_their_quantiles():
    """Smoothed as they are, by a kernel for all powers of ten, the median of a fifth was 0.58."""
    probabilities = (np.arange(400) + 0.5) / 400
    marginal = marginal_of_points(0.01 * 1e5**probabilities, np.ones(400), (0.01, 1000.0))
    for probability in (0.05, 0.25, 0.5, 0.75, 0.95):
        assert marginal.quantile(probability) == pytest.approx(0.01 * 1e5**probability, rel=0.05)
    assert marginal.mean == pytest.approx(999.99 / np.log(1e5), rel=0.01)


@pytest.mark.parametrize("distribution", [uniform(), beta(3, 1), truncnorm(-1, np.inf), norm(), beta(2, 2)])
def test_points_keep_their_quantiles_where_their_density_is_cut_and_where_it_tails_off(distribution):
    """Smoothed over the end of a ridge, the 97.5 % point of an angle lay where there was no posterior."""
    points, probabilities = distribution.ppf((np.arange(400) + 0.5) / 400), np.array([0.025, 0.5, 0.975])
    marginal = marginal_of_points(points, np.ones(400), (-np.inf, np.inf))
    assert distribution.cdf(marginal.quantile(probabilities)) == pytest.approx(probabilities, abs=0.01)
    low, high = marginal.hdi()
    assert distribution.cdf(high) - distribution.cdf(low) == pytest.approx(0.95, abs=0.01)


def test_positive_points_with_a_long_tail_keep_their_quantiles():
    """The whole middle lay in one of 1000 even bins: for a median of 0.10 of Knowles' b the table said 0.72."""
    distribution = lognorm(2.5, scale=0.1)
    points = distribution.ppf((np.arange(4000) + 0.5) / 4000)
    probabilities = np.array([0.025, 0.25, 0.5, 0.75, 0.975])
    marginal = marginal_of_points(points, np.ones(4000), (0.0, np.inf))
    assert distribution.cdf(marginal.quantile(probabilities)) == pytest.approx(probabilities, abs=0.01)
    low, high = marginal.hdi()
    assert distribution.cdf(high) - distribution.cdf(low) == pytest.approx(0.95, abs=0.01)


def test_points_of_which_one_holds_most_have_a_marginal():
    marginal = marginal_of_points(np.array([0.0, 1.0, 2.0]), np.array([1.0, 8.0, 1.0]), (-np.inf, np.inf))
    assert marginal.quantile(0.5) == pytest.approx(1.0, abs=0.01)


def test_a_blend_is_the_mixture_of_its_parts():
    parts = [(w, marginal_of_mixture(np.ones(1), np.array([m]), np.array([1.0]))) for w, m in ((0.3, 0.0), (0.7, 2.0))]
    both = marginal_of_mixture(np.array([0.3, 0.7]), np.array([0.0, 2.0]), np.ones(2))
    found = blended(parts, (-np.inf, np.inf))
    assert found.mean == pytest.approx(both.mean)
    assert found.sd == pytest.approx(both.sd)
    assert found.hdi() == pytest.approx(both.hdi(), abs=5e-3)


def test_cubics_of_given_slopes_are_scipys():
    generator = np.random.default_rng(4)
    points = np.cumsum(generator.uniform(0.1, 2.0, 12))
    values, slopes = generator.standard_normal((2, 12))
    at = np.sort(np.append(generator.uniform(points[0], points[-1], 200), points))
    ours, scipys = HermiteCubics(points, values, slopes), CubicHermiteSpline(points, values, slopes)
    np.testing.assert_allclose(ours(at), scipys(at), rtol=0, atol=1e-14)
    np.testing.assert_allclose(ours.integral(at), scipys.antiderivative()(at), rtol=0, atol=1e-13)


def test_a_marginal_says_in_a_line_what_it_is():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.02, seed=1)
    marginal = tq.fit(data, discrepancy="none", noise_sd=0.02).marginals["C10"]
    low, high = marginal.hdi()
    assert repr(marginal) == (
        f"<Marginal: mean {marginal.mean:.4g}, sd {marginal.sd:.2g}, 95 % interval {low:.4g} to {high:.4g}>"
    )
