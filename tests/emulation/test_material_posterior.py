"""The posterior of the material in a forward model, beside the draws and closed forms of its stress."""

import numpy as np
import pytest

import tissuq as tq
from tissuq.emulation import Calibration
from tissuq.errors import InputError, ModelError

DEPTH = np.linspace(0.02, 0.3, 10)


def force(parameters, depth):
    """Compression of an Ogden cube, moduli in kPa."""
    mu, alpha, stretch = parameters["mu1"], parameters["alpha1"], 1 - depth
    return 2 * mu / alpha * (stretch ** (-alpha / 2 - 1) - stretch ** (alpha - 1)) + parameters["friction"] * depth


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    priors = {"friction": tq.Uniform(0, 1), "mu1": tq.Uniform(0.5, 4), "alpha1": tq.Uniform(-20, -2)}
    truth = {"mu1": 1.5, "alpha1": -9.0, "friction": 0.3}
    measured = force(truth, DEPTH) + 0.05 * np.random.default_rng(0).standard_normal(len(DEPTH))
    return tq.calibrate(DEPTH, measured, force, priors, discrepancy="gp-pinned", noise_sd=0.05, runs=24)


@pytest.mark.slow
def test_it_predicts_the_stress_of_the_draws_in_any_mode(calibration):
    posterior = calibration.posterior_of("ogden-1", (0.7, 1.2), unit="kPa")
    mu, alpha = (calibration.posterior.draws[:, :, calibration.problem.symbols.index(s)].ravel()[:, None]
                 for s in ("mu1", "alpha1"))  # fmt: skip
    stretch = np.array([0.75, 0.9, 1.1])
    for mode, lateral in (("uniaxial", -0.5), ("equibiaxial", -2.0), ("planar", -1.0)):
        stress = 2 * mu / alpha * (stretch ** (alpha - 1) - stretch ** (lateral * alpha - 1))  # MPa like the rest: kPa
        band = posterior.predict(stretch, mode=mode, noise=False)
        for column, level in (("low", 0.025), ("median", 0.5), ("high", 0.975)):
            expected = np.quantile(stress, level, axis=0)
            np.testing.assert_allclose(band[column].to_numpy().ravel(), expected, rtol=0.02)


@pytest.mark.slow
def test_its_marginals_are_those_of_the_calibration_in_the_unit_of_stress(calibration):
    posterior = calibration.posterior_of("ogden-1", (0.7, 1.2), unit="kPa")
    for symbol, factor in (("mu1", 1e-3), ("alpha1", 1.0)):
        before, after = calibration.marginals[symbol], posterior.solution.marginals[symbol]
        assert after.mean == pytest.approx(factor * before.mean)
        np.testing.assert_allclose(after.hdi(), factor * np.array(before.hdi()), rtol=1e-6)
    assert posterior.summary().loc["mu1", "mean"] == pytest.approx(calibration.marginals["mu1"].mean)
    assert not any("measured" in text for text in posterior.warnings)


@pytest.mark.slow
def test_it_is_saved_whole_and_goes_to_finite_elements(calibration, tmp_path):
    posterior = calibration.posterior_of("ogden-1", (0.7, 1.2), unit="kPa")
    posterior.save(tmp_path / "tissue.nc")
    loaded = tq.load(tmp_path / "tissue.nc")
    assert loaded.summary().equals(posterior.summary())
    one, other = (each.ensemble(4).stress(tq.loading_modes()["planar"](), [1.1]) for each in (posterior, loaded))
    np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_what_was_not_calibrated_is_told(calibration):
    with pytest.raises(InputError, match=r"yeoh has the parameters C10, C20, C30, and .* without C10, C20, C30"):
        calibration.posterior_of("yeoh", (0.7, 1.2))
    with pytest.raises(InputError, match=r"two rising positive numbers, not 1\.2:0\.7"):
        calibration.posterior_of("ogden-1", (1.2, 0.7))
    with pytest.raises(InputError, match="several controls"):
        calibration.posterior_of("ogden-1", (0.7, 1.2), mode="biaxial")
    with pytest.raises(ModelError, match="rubbery"):
        calibration.posterior_of("rubbery", (0.7, 1.2))
