"""Predictions against closed forms and dense linear algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal, norm

import gallery
import tissuq as tq
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.inference.quasi_monte_carlo import systematic
from tissuq.inference.solution import Representation
from tissuq.prediction.bands import predict_band
from tissuq.prediction.densities import pointwise_log_likelihood
from tissuq.prediction.moments import borne, drawn_curves, stress_moments, variance_of_noise

TRUTH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
STRETCH = np.linspace(0.6, 2.2, 14)
DATA = tq.simulate("yeoh", TRUTH, STRETCH, 0.2, seed=6)
NEW = np.array([0.7, 1.0, 1.55, 2.5])


def x(stretch):
    return 2 * (stretch - stretch**-2)


def kernel(first, second, c, psi):
    return c**2 * np.exp(-0.5 * ((first[:, None] - second) / psi) ** 2)


@pytest.mark.parametrize("prob", [0.5, 0.95])
@pytest.mark.parametrize("noise", [False, True])
def test_without_discrepancy_the_band_is_the_normal_one(noise, prob):
    posterior = gallery.fit(DATA, discrepancy="none", noise_sd=0.2, priors={"C10": tq.Uniform(0, 10)})
    centre = x(STRETCH) @ DATA.stress / (x(STRETCH) @ x(STRETCH))
    sd = np.sqrt(0.04 / (x(STRETCH) @ x(STRETCH)) * x(NEW) ** 2 + noise * 0.04)
    table = posterior.predict(NEW, noise=noise, prob=prob)
    half = norm.ppf(0.5 + prob / 2) * sd
    np.testing.assert_allclose(table["median"], centre * x(NEW), atol=1e-9)
    np.testing.assert_allclose(table["low"], centre * x(NEW) - half, atol=1e-6)
    np.testing.assert_allclose(table["high"], centre * x(NEW) + half, atol=1e-6)


@pytest.mark.parametrize("noise", [False, True])
def test_a_conditioned_process_agrees_with_dense_linear_algebra(noise):
    model = gallery.fit(DATA, discrepancy="gp", noise_sd=0.2, priors={"C10": tq.Normal(1.0, 0.7)}).model
    psi, c = 0.6, 0.8
    V = kernel(STRETCH, STRETCH, c, psi) + 0.04 * np.eye(14)
    precision = x(STRETCH) @ np.linalg.solve(V, x(STRETCH)) + 0.7**-2
    b = (x(STRETCH) @ np.linalg.solve(V, DATA.stress) + 0.7**-2) / precision
    components = GaussianMixture(np.ones(1), np.array([[psi, c]]), np.array([[b]]), np.array([[[precision**-0.5]]]))
    states = model.experiment.states_at(NEW)
    mean, variance = stress_moments(model, components, states)
    variance = variance + noise * variance_of_noise(model, components, model.relative_noise(states), mean)

    joint = kernel(STRETCH, STRETCH, c, psi) + 0.49 * np.outer(x(STRETCH), x(STRETCH)) + 0.04 * np.eye(14)
    cross = kernel(NEW, STRETCH, c, psi) + 0.49 * np.outer(x(NEW), x(STRETCH))
    own = kernel(NEW, NEW, c, psi) + 0.49 * np.outer(x(NEW), x(NEW))
    expected = x(NEW) + cross @ np.linalg.solve(joint, DATA.stress - x(STRETCH))
    covariance = own - cross @ np.linalg.solve(joint, cross.T)
    np.testing.assert_allclose(mean[0], expected, atol=1e-8)
    np.testing.assert_allclose(variance[0], np.diag(covariance) + noise * 0.04, atol=1e-8)


def test_drawn_curves_have_the_covariance_of_the_posterior():
    """20,000 curves under one setting of a process: each entry within five of its standard errors."""
    model = gallery.fit(DATA, discrepancy="gp", noise_sd=0.2, priors={"C10": tq.Normal(1.0, 0.7)}).model
    psi, c, count = 0.6, 0.8, 20_000
    V = kernel(STRETCH, STRETCH, c, psi) + 0.04 * np.eye(14)
    precision = x(STRETCH) @ np.linalg.solve(V, x(STRETCH)) + 0.7**-2
    b = (x(STRETCH) @ np.linalg.solve(V, DATA.stress) + 0.7**-2) / precision
    one = GaussianMixture(np.ones(1), np.array([[psi, c]]), np.array([[b]]), np.array([[[precision**-0.5]]]))
    alone, other = drawn_curves(model, one[np.zeros(count, dtype=int)], model.experiment.states_at(NEW), seed=3)
    joint = V + 0.49 * np.outer(x(STRETCH), x(STRETCH))
    cross = kernel(NEW, STRETCH, c, psi) + 0.49 * np.outer(x(NEW), x(STRETCH))
    own = kernel(NEW, NEW, c, psi) + 0.49 * np.outer(x(NEW), x(NEW))
    whole = own - cross @ np.linalg.solve(joint, cross.T)
    for drawn, expected in ((alone, np.outer(x(NEW), x(NEW)) / precision), (alone + other, whole)):
        sds = np.sqrt(np.diag(expected))
        error = np.sqrt((expected**2 + np.outer(sds, sds) ** 2) / count)
        assert (np.abs(np.cov(drawn.T) - expected) <= 5 * error + 1e-12).all()


def test_a_stress_is_predicted_only_where_the_material_locks_with_a_probability_below_one_in_a_million():
    model = gallery.fit(DATA, discrepancy="none", noise_sd=0.2).model
    basis = np.array([[[1.0], [2.0]], [[1.0], [np.inf]]])
    for share in (2e-6, 1e-3, 0.5):
        with pytest.raises(tq.ModelError, match=r"has no stress at a stretch .*of 2: .*a probability of"):
            borne(model, np.array([1.0, 2.0]), basis, np.array([1 - share, share]))
    shears = np.array([[[np.inf], [1.0], [np.inf]], [[1.0], [1.0], [np.inf]]])
    with pytest.raises(tq.ModelError, match=r"of 0\.5: .* \(with a probability of 0\.25\)"):
        borne(model, np.array([0.5, 0.4, 0.9]), shears, np.array([0.25, 0.75]))
    kept = borne(model, np.array([1.0, 2.0]), basis, np.array([1 - 5e-7, 5e-7]))
    np.testing.assert_array_equal(kept[:, :, 0], [[1.0, 2.0], [1.0, 0.0]])


@pytest.mark.parametrize("name", ["constant", "yeoh", "gp"])
def test_bands_agree_with_replicated_data(name):
    posterior = gallery.fit(DATA, discrepancy=name, noise_sd=0.2)
    replicated = posterior.data["posterior_predictive"]["stress"].values.reshape(-1, 14)
    band = posterior.predict(STRETCH)
    below, above = (
        (replicated < band["low"].to_numpy()).mean(0),
        (replicated > band["high"].to_numpy()).mean(0),
    )
    error = 5 * np.sqrt(0.025 * 0.975 / 4000)
    np.testing.assert_allclose(below, 0.025, atol=error)
    np.testing.assert_allclose(above, 0.025, atol=error)


def test_the_model_alone_has_no_share_of_the_discrepancy():
    posterior = gallery.fit(DATA, discrepancy="yeoh", noise_sd=0.2)
    table = posterior.predict(NEW, discrepancy=False, noise=False)
    c10 = posterior.solution.marginals["C10"]
    np.testing.assert_allclose(table["median"], c10.mean * x(NEW), rtol=1e-6, atol=1e-9)
    width = (table["high"] - table["low"]).to_numpy()
    assert width[1] == pytest.approx(0, abs=1e-9)
    assert width[3] > 0


@pytest.mark.parametrize("name", ["none", "constant", "gp"])
def test_the_pointwise_density_is_that_of_leaving_one_out(name):
    posterior = gallery.fit(DATA, discrepancy=name, noise_sd=0.2)
    draws = {symbol: values[2, 5] for symbol, values in posterior.solution.draws.items()}
    mean = draws["C10"] * x(STRETCH) + draws.get("m0", 0.0)
    covariance = (0.04 + draws.get("S", 0.0) ** 2) * np.eye(14)
    if name == "gp":
        covariance = covariance + kernel(STRETCH, STRETCH, draws["c"], draws["psi"])
    whole = multivariate_normal(mean, covariance).logpdf(DATA.stress)
    found = pointwise_log_likelihood(posterior.solution)[2, 5]
    for i in range(14):
        rest = np.delete(np.arange(14), i)
        others = multivariate_normal(mean[rest], covariance[np.ix_(rest, rest)]).logpdf(DATA.stress[rest])
        assert found[i] == pytest.approx(whole - others, abs=1e-6)


def test_coverage_counts_the_measurements_inside():
    posterior = gallery.fit(DATA, discrepancy="none", noise_sd=0.2)
    table = posterior.predict(STRETCH)
    inside = ((table["low"] <= DATA.stress) & (DATA.stress <= table["high"])).mean()
    assert posterior.predictive_coverage() == inside


@pytest.mark.parametrize(("stretch", "prob"), [([0.0], 0.95), ([-1.0], 0.95), ([np.nan], 0.95), ([1.0], 1.0)])
def test_bad_requests_are_refused(stretch, prob):
    with pytest.raises(tq.InputError):
        gallery.fit(DATA, discrepancy="none", noise_sd=0.2).predict(stretch, prob=prob)


@pytest.mark.slow
def test_the_band_at_a_stretch_does_not_depend_on_where_else_it_is_asked_for():
    stretch = np.linspace(0.9, 1.3, 20)
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.01, seed=1)
    posterior = tq.fit(data, tolerances="tissue")
    near, far = (
        posterior.predict([1.1, 1.2], mode="equibiaxial"),
        posterior.predict([1.1, 1.2, 2.5], mode="equibiaxial"),
    )
    assert np.allclose(near, far[:2], rtol=1e-6)


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_every_test_of_one_mode_is_compared_with_the_band_of_its_own_noise_and_error(shift):
    """Known noise and, with a shift, a constant error of each test: bands are material + error +- 1.96 sd."""
    stretch, sds = np.linspace(0.85, 1.4, 40), (0.004, 0.05)
    shape, generator = stretch - stretch**-2, np.random.default_rng(1)
    errors = (-shift, shift) if shift else (0.0, 0.0)
    tests = [
        tq.Experiment("uniaxial", stretch, shape + error + sd * generator.standard_normal(40), f"test {sd}")
        for sd, error in zip(sds, errors, strict=True)
    ]
    options = {"discrepancy": "constant", "priors": {"S": tq.HalfNormal(1e-5)}} if shift else {"discrepancy": "none"}
    posterior = tq.fit(tests, **options, noise_sd=sds, tolerances="as-tested")
    for test, curve, sd, error in zip(tests, posterior.model.experiment.curves, sds, errors, strict=True):
        band = predict_band(posterior.solution, stretch, curve=curve)
        assert np.allclose(band.low, shape + error - 1.96 * sd, atol=0.5 * sd)
        assert np.allclose(band.high, shape + error + 1.96 * sd, atol=0.5 * sd)
        inside = (band.low <= test.stress) & (test.stress <= band.high)
        assert np.array_equal(posterior.inside_bands()[tests.index(test)], inside)
        assert inside.mean() > 0.85
    assert "measurements are inside" not in " ".join(posterior.warnings)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_a_new_test_has_the_geometric_mean_of_the_noise_of_its_mode_whatever_the_order(order):
    stretch, sds = np.linspace(0.85, 1.4, 40), (0.004, 0.05, 0.3)
    modes = "uniaxial", "uniaxial", "planar"
    tests = [
        tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=sd, mode=mode, seed=number)
        for number, (sd, mode) in enumerate(zip(sds, modes, strict=True))
    ]
    noises = [sds[number] for number in order]
    posterior = tq.fit([tests[number] for number in order], discrepancy="none", noise_sd=noises, tolerances="as-tested")
    for mode, expected in (
        ("uniaxial", 0.004 * 0.05),
        ("planar", 0.3**2),
        ("equibiaxial", (0.004 * 0.05 * 0.3) ** (2 / 3)),
    ):
        half_widths = [
            np.diff(posterior.predict([1.2], mode=mode, noise=noise)[["low", "high"]].to_numpy()).item() / 2
            for noise in (True, False)
        ]
        assert half_widths[0] ** 2 - half_widths[1] ** 2 == pytest.approx(1.96**2 * expected, rel=1e-3)
    designed = posterior.design(["uniaxial 1:1.4 20"]).query("~is_repeat").iloc[0]
    path = np.linspace(1, 1.4, 20)
    more = (4 / designed["sd_after"] ** 2 - 4 / designed["sd_now"] ** 2) / (4 * (path - path**-2) ** 2).sum()
    assert more == pytest.approx(1 / (0.004 * 0.05), rel=1e-3)  # the modulus is 2 C10


def test_a_band_of_some_draws_is_that_of_all():
    """The draws of a sampler are in no order: some of them, taken in it, had ends a tenth of the half width off."""
    fitted = tq.fit(tq.simulate("ogden-1", {"mu1": 1.0, "alpha1": -9.0}, np.linspace(0.75, 1.2, 12), 0.05, seed=1),
                    material="ogden-1", discrepancy="none", noise_sd=0.05)  # fmt: skip
    mixture, generator = fitted.solution.mixture, np.random.default_rng(0)
    rows = systematic(mixture.weights[None], 4000)[0]
    linear = mixture.mean[rows] + np.einsum("nij,nj->ni", mixture.root[rows], generator.standard_normal((4000, 1)))
    points = GaussianMixture.of_points(mixture.settings[rows], linear)[generator.permutation(4000)]
    drawn = replace(fitted.solution, representation=Representation.of(points), sampled=points.mean.reshape(4, 1000, 1))
    band = predict_band(drawn, [0.8, 1.1], noise=False)
    stress = np.array([2 * m / a * (np.array([0.8, 1.1]) ** (a - 1) - np.array([0.8, 1.1]) ** (-0.5 * a - 1))
                       for m, a in zip(points.mean[:, 0], points.settings[:, 0], strict=True)])  # fmt: skip
    low, high = np.quantile(stress, [0.025, 0.975], axis=0)
    np.testing.assert_allclose(band.low, low, atol=0.01 * (high - low).max())
    np.testing.assert_allclose(band.high, high, atol=0.01 * (high - low).max())


def test_a_band_of_all_draws_of_a_sampler_has_the_ends_of_its_parameters():
    """Along an axis on which draws differ as along others some of them are any of them: ends a seventh off."""
    model = gallery.fit(DATA, material="yeoh", discrepancy="none", noise_sd=0.2).solution
    values = np.random.default_rng(1).standard_t(4, (4000, 3)) * [0.02, 0.01, 0.001] + [1.2, -0.05, 0.004]
    points = GaussianMixture.of_points(np.zeros((4000, 0)), values)
    drawn = replace(model, representation=Representation.of(points), sampled=values.reshape(4, 1000, 3))
    stretch = np.array([0.6, 1.2, 2.2])
    excess = stretch**2 + 2 / stretch - 3
    stress = values @ (x(stretch) * np.stack([np.ones(3), 2 * excess, 3 * excess**2]))
    low, high = np.quantile(stress, [0.025, 0.975], axis=0)
    band = predict_band(drawn, stretch, noise=False)
    assert np.abs(np.stack([band.low - low, band.high - high]) / (high - low)).max() < 0.005


def test_a_band_beyond_the_data_has_draws_where_the_posterior_has_weight():
    """Every component had as many draws as any other, and one with nearly all of the weight a handful."""
    fitted = gallery.fit(DATA, discrepancy="auto-isotropic", noise_sd=0.2).solution
    heaviest = np.argsort(fitted.mixture.weights)[::-1][:1000]
    weights = np.r_[0.999, np.full(999, 1e-3 / 999)]
    one, many = (
        predict_band(replace(fitted, representation=Representation.of(mixture)), [0.5, 2.5, 3.0], noise=False)
        for mixture in (
            fitted.mixture[heaviest[:1]].weighted(np.ones(1)),
            fitted.mixture[heaviest].weighted(weights),
        )
    )
    for name in ("median", "low", "high"):  # of 6000 draws, ends known to 2 or 3 % of the width
        np.testing.assert_allclose((vars(many)[name] - vars(one)[name]) / (one.high - one.low), 0, atol=0.08)


def test_the_name_of_a_discrepancy_is_not_taken_for_a_prediction_with_it():
    posterior = gallery.fit(DATA, discrepancy="none", noise_sd=0.2)
    for option in ("discrepancy", "noise"):
        with pytest.raises(tq.InputError, match=f"{option} must be True or False, not 'none'"):
            posterior.predict(NEW, **{option: "none"})
    pd.testing.assert_frame_equal(posterior.predict(NEW, noise=np.False_), posterior.predict(NEW, noise=False))
