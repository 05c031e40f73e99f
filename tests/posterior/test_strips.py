"""Fibres fitted to uniaxial tests along both axes of a tissue: the posterior, its draws, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import material_named
from tissuq.prediction.stress import Stress

STRETCH, NOISE = np.linspace(1.05, 1.4, 8), 5e-4
TRUTH = {"C10": 0.01, "k": 0.05}
LAW = "neo-hookean+standard-fibres@40"
AS_TESTED = tq.Tolerances("as-tested")
RATIO = tq.Uniform(1.0, 15.0)


@pytest.fixture(scope="module")
def strips():
    modes = ("uniaxial", "uniaxial@2")
    return [tq.simulate(LAW, TRUTH, STRETCH, NOISE, seed=seed, mode=mode) for seed, mode in enumerate(modes)]


@pytest.fixture(scope="module")
def fitted(strips):
    options = {"noise_sd": NOISE, "tolerances": AS_TESTED, "priors": {"k_over_C10": RATIO}}
    return tq.fit(strips, material=LAW, discrepancy="none", **options)


def pulled(stretch, axis, ratio):
    """Return the stress over C10 of W = C10 (I1 - 3 + ratio <I4 - 1>^2) along an axis, without lateral stress."""
    cosine, sine = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    own, other = (cosine, sine) if axis == 1 else (sine, cosine)

    def stresses(lateral):
        third, strain = 1 / (stretch * lateral), max((stretch * own) ** 2 + (lateral * other) ** 2 - 1, 0.0)
        matrix = 2 * (stretch - third**2 / stretch), 2 * (lateral - third**2 / lateral)
        return matrix[0] + 4 * ratio * strain * stretch * own**2, matrix[1] + 4 * ratio * strain * lateral * other**2

    lateral = brentq(lambda x: stresses(x)[1], 0.1, 1.5, xtol=1e-14)
    return stresses(lateral)[0]


def test_the_posterior_is_that_of_sums_over_both_parameters(strips, fitted):
    ratios = np.linspace(1.0, 15.0, 561)
    columns = np.array([[pulled(x, axis, ratio) for axis in (1, 2) for x in STRETCH] for ratio in ratios])
    stress = np.concatenate([test.stress for test in strips])
    C10 = np.linspace(0.006, 0.014, 1601)[:, None]
    misfit = (columns**2).sum(axis=1) * C10**2 - 2 * (columns @ stress) * C10 + (stress**2).sum()
    weights = np.exp(-0.5 * (misfit - misfit.min()) / NOISE**2)
    weights /= weights.sum()
    assert weights[[0, -1]].sum() < 1e-8
    assert weights[:, [0, -1]].sum() < 1e-8
    quantities = {"C10": C10 + 0 * ratios, "k_over_C10": 0 * C10 + ratios, "k": C10 * ratios}
    summary = fitted.summary(unit="MPa")
    for symbol, values in quantities.items():
        mean = (weights * values).sum()
        sd = np.sqrt((weights * (values - mean) ** 2).sum())
        assert summary.loc[symbol, "mean"] == pytest.approx(mean, abs=0.01 * sd), symbol
        assert summary.loc[symbol, "sd"] == pytest.approx(sd, rel=0.01), symbol


def test_draws_are_of_the_law_in_the_literature(fitted):
    draws = fitted.data_in("MPa")["posterior"]
    np.testing.assert_allclose(draws["k"], draws["k_over_C10"] * draws["C10"], rtol=1e-12)
    assert draws["k"].attrs["units"] == "MPa"
    ensemble = fitted.ensemble(4)
    for draw in ensemble:
        assert set(draw.values) == {"C10", "k"}
        ratio = draw.values["k"] / draw.values["C10"]
        found = draw.values["C10"] * np.array([pulled(1.3, axis, ratio) for axis in (1, 2)])
        of_draws = [ensemble.stress(mode, np.array([1.3]))[draw.number, 0] for mode in ("uniaxial", "uniaxial@2")]
        np.testing.assert_allclose(of_draws, found, rtol=1e-9)


def test_a_saved_posterior_has_the_same_parameters(fitted, tmp_path):
    fitted.save(tmp_path / "strips.nc")
    loaded = tq.load(tmp_path / "strips.nc")
    assert loaded.model.material == fitted.model.material
    np.testing.assert_allclose(loaded.summary(), fitted.summary(), rtol=1e-12)


def test_predictions_go_on_in_other_modes_with_a_known_deformation(fitted):
    band = fitted.predict([1.2], mode="planar", noise=False)
    law = material_named(LAW)
    truth = tq.simulate(law, TRUTH, [1.2], mode="planar").stress[0]
    assert band["low"].iloc[0] < truth < band["high"].iloc[0]


def test_a_further_energy_is_refused_in_words(strips):
    with pytest.raises(tq.ModelError, match=r"lateral stretch of 'neo-hookean\+standard-fibres@40' would depend on"):
        tq.fit(strips, material=LAW)


@pytest.mark.slow
def test_an_error_of_the_stress_goes_with_them(strips):
    posterior = tq.fit(strips, material=LAW, discrepancy="gp-pinned", noise_sd=NOISE)
    low, high = posterior.marginals["C10"].hdi()
    assert low < TRUTH["C10"] < high
    band = posterior.predict([1.1, 1.3], mode="uniaxial@2", noise=False)
    for (_, row), stretch in zip(band.iterrows(), (1.1, 1.3), strict=True):
        assert row["low"] < TRUTH["C10"] * pulled(stretch, 2, 5.0) < row["high"]


@pytest.fixture(scope="module")
def sheet():
    stretch = [[1 + a * t, 1 + b * t] for a, b in ((1, 1), (1, 0.5), (0.5, 1)) for t in np.linspace(0.05, 0.3, 4)]
    return tq.simulate(LAW, TRUTH, stretch, 2e-3, seed=1, mode="biaxial")


@pytest.mark.parametrize("axis", [1, 2])
def test_a_fit_of_two_stresses_predicts_strips_by_the_lateral_stretch_of_every_draw(sheet, axis):
    """Against the closed form at draws of the Gaussian posterior of two linear parameters."""
    posterior = tq.fit(sheet, material=LAW, discrepancy="none", noise_sd=2e-3)
    assert list(posterior.model.symbols) == ["C10", "k"]
    at = [1.0, 1.1, 1.3]
    design = posterior.model.design
    covariance = 2e-3**2 * np.linalg.inv(design.T @ design)
    mean = covariance @ design.T @ posterior.model.stress / 2e-3**2
    draws = np.random.default_rng(5).multivariate_normal(mean, covariance, 4000)
    assert (draws > 0).all()
    stress = np.array([[C10 * pulled(x, axis, k / C10) for x in at] for C10, k in draws])
    spread = stress.std(axis=0)
    assert spread[1] > 0.01 * stress.mean(axis=0)[1]
    band = posterior.predict(at, mode=f"uniaxial@{axis}", noise=False)
    for name, probability in (("low", 0.025), ("median", 0.5), ("high", 0.975)):
        expected = np.quantile(stress, probability, axis=0)
        np.testing.assert_allclose(band[name], expected, rtol=0, atol=0.12 * spread.max())
        assert np.abs(band[name] - expected)[1:].max() < 0.12 * spread[1:].max()
    noisy = posterior.predict(at, mode=f"uniaxial@{axis}")
    np.testing.assert_allclose(noisy["high"] - noisy["low"], 2 * 1.96 * np.hypot(spread, 2e-3), rtol=0.05)


def test_a_fit_and_a_prediction_refuse_a_further_energy_in_the_same_words(strips, sheet):
    fitted = tq.fit(sheet, material=LAW, discrepancy="yeoh", noise_sd=2e-3)
    with pytest.raises(tq.ModelError) as of_prediction:
        fitted.predict([1.2], mode="uniaxial")
    with pytest.raises(tq.ModelError) as of_fit:
        tq.fit(strips, material=LAW, discrepancy="yeoh")
    messages = [str(refusal.value).split("the lateral stretch") for refusal in (of_prediction, of_fit)]
    assert messages[0][1] == messages[1][1]
    assert messages[0][0] == "in mode 'uniaxial' "


def test_the_slopes_of_a_predicted_strip_are_those_of_its_draws(sheet):
    """By which slack and errors of the length add to the band of a new test."""
    posterior = tq.fit(sheet, material=LAW, discrepancy="none", noise_sd=2e-3)
    stress = Stress(posterior.model, posterior.solution.mixture.thinned(4), True)
    states = posterior.model.experiment.states_at(np.array([1.2]), loading_mode("uniaxial"), 0)
    drawn, mean, _ = stress.at(states)
    slopes = stress.slopes(states, mean)[:, 0, 0]
    for number in (0, 50, 700):
        C10, k = drawn.mean[number]
        ends = [C10 * pulled(1.2 + step, 1, k / C10) for step in (-1e-5, 1e-5)]
        assert mean[number, 0] == pytest.approx(np.mean(ends), rel=1e-7)
        assert slopes[number] == pytest.approx((ends[1] - ends[0]) / 2e-5, rel=1e-3)


def test_a_fit_with_a_further_energy_does_not_predict_strips(sheet):
    posterior = tq.fit(sheet, material=LAW, discrepancy="yeoh", noise_sd=2e-3)
    with pytest.raises(tq.ModelError, match="would depend on the discrepancy 'yeoh', too"):
        posterior.predict([1.1], mode="uniaxial")
    assert posterior.predict([1.1], mode="uniaxial", discrepancy=False)["median"].iloc[0] > 0


def test_a_fit_of_two_stresses_whose_fibres_shear_does_not_predict_strips(sheet):
    law = LAW.replace("@40", ":one@40")
    posterior = tq.fit(sheet, material=law, discrepancy="none", noise_sd=2e-3)
    with pytest.raises(tq.ModelError, match="as one at an angle shears, too"):
        posterior.predict([1.1], mode="uniaxial")


def test_directions_along_one_axis_are_warned_of_and_along_two_are_not(strips):
    labelled = [test.labelled(direction=name) for test, name in zip(strips, ("circ", "axial"), strict=True)]
    options = {"material": LAW, "discrepancy": "none", "noise_sd": NOISE, "tolerances": AS_TESTED}
    assert not any("several directions" in warning for warning in tq.fit(labelled, **options).warnings)
    along_1 = [
        tq.Experiment("uniaxial", test.stretch, test.stress).labelled(direction=test.direction) for test in labelled
    ]
    warnings = tq.fit(along_1, **options).warnings
    assert any(
        "several directions of the tissue (circ, axial)" in w and "--mode uniaxial@2" in w.shell for w in warnings
    )


def test_a_law_that_is_wrong_is_sent_to_a_discrepancy_that_may_be_fitted():
    truth, stretch = {"C10": 0.01, "k1": 0.05, "k2": 8.0}, np.linspace(1.05, 1.5, 30)
    law = "neo-hookean+exponential-fibres@40"
    stiffening = [
        tq.simulate(law, truth, stretch, 2e-4, seed=seed, mode=mode)
        for seed, mode in enumerate(("uniaxial", "uniaxial@2"))
    ]
    posterior = tq.fit(stiffening, material=LAW, discrepancy="none", tolerances=AS_TESTED)
    (warning,) = (warning for warning in posterior.warnings if warning.code == "unmodelled-curve")
    assert warning.shell.endswith("Fit with --discrepancy gp-pinned.")


def test_an_isotropic_material_of_both_axes_is_noted(strips):
    options = {"discrepancy": "none", "noise_sd": NOISE, "tolerances": AS_TESTED}
    shells = [warning.shell for warning in tq.fit(strips, **options).warnings]
    assert any("--material holzapfel-gasser-ogden and --discrepancy gp-pinned" in shell for shell in shells)
    assert not any("axis 2 of the tissue are taken" in warning for warning in tq.fit(strips[1], **options).warnings)


def test_the_next_step_where_both_axes_are_no_isotropic_material_is_a_law_with_fibres(strips):
    posterior = tq.fit(strips, noise_sd=NOISE, tolerances=AS_TESTED, discrepancy="log")
    assert "--discrepancy gp-pinned" in posterior.answer.next_step.shell
