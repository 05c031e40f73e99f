"""Scores of measurements that were not seen, against closed forms of a Gaussian prediction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import tissuq as tq
from tissuq.prediction.scores import interval_score, judged
from tissuq.studies.predict_run import predicted

NOISE_SD, TRUE = 0.02, 0.5
STRETCH, OTHER = np.linspace(0.8, 1.4, 12), np.array([1.0, 1.1, 1.2, 1.3, 1.4])


def uniaxial(x):
    return 2 * (x - x**-2)


def planar(x):
    return 2 * (x - x**-3)


@pytest.fixture(scope="module")
def fitted():
    noise = NOISE_SD * np.random.default_rng(2).standard_normal(len(STRETCH))
    return tq.Experiment("uniaxial", STRETCH, TRUE * uniaxial(STRETCH) + noise)


@pytest.fixture(scope="module")
def posterior(fitted):
    return tq.fit(fitted, discrepancy="none", noise_sd=NOISE_SD)


@pytest.fixture(scope="module")
def unseen():
    errors = np.array([0.0, 0.01, -0.03, 0.05, -0.1])  # the last one is far outside
    return tq.Experiment("planar", OTHER, TRUE * planar(OTHER) + errors, "unseen")


def test_an_interval_score_is_the_width_and_what_lies_outside():
    low, high, values = np.array([1.0, 1.0, 1.0]), np.array([3.0, 3.0, 3.0]), np.array([2.0, 0.5, 3.25])
    np.testing.assert_allclose(interval_score(low, high, values, 0.9), [2, 2 + 20 * 0.5, 2 + 20 * 0.25], rtol=1e-12)


def test_scores_are_those_of_the_gaussian_that_predicts(posterior, fitted, unseen):
    x, at, y = uniaxial(STRETCH), planar(OTHER[1:]), unseen.stress[1:]
    b, variance = x @ fitted.stress / (x @ x), NOISE_SD**2 / (x @ x)
    mean, sd = b * at, np.sqrt(NOISE_SD**2 + variance * at**2)
    found, half = judged(posterior.solution, unseen.curves[0], prob=0.9).summary(), norm.ppf(0.95) * sd
    outside = np.maximum(np.abs(y - mean) - half, 0)
    z, size = (y - mean) / sd, np.sqrt((y**2).mean())
    crps = sd * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi))
    assert 0 < found["inside"] == np.mean(outside == 0) < 1
    assert found["half_width"] == pytest.approx(np.sqrt((half**2).mean()) / size, rel=1e-4)
    assert found["error"] == pytest.approx(np.sqrt(((y - mean) ** 2).mean()) / size, rel=1e-4)
    assert found["crps"] == pytest.approx(crps.mean(), rel=1e-4)
    assert found["interval_score"] == pytest.approx((2 * half + 20 * outside).mean(), rel=1e-4)


def test_a_measurement_without_stress_is_left_out(posterior, unseen):
    at_rest = tq.Experiment("planar", [1.0, 1.2], [0.0, unseen.stress[2]])
    assert len(judged(posterior.solution, at_rest.curves[0]).measured) == 1
    with pytest.raises(tq.InputError, match="no stress other than zero"):
        judged(posterior.solution, tq.Experiment("planar", [1.0], [0.0]).curves[0])


def test_a_band_of_the_same_measurements_is_that_of_predict(posterior, unseen):
    found, band = judged(posterior.solution, unseen.curves[0]), posterior.predict(unseen.stretch, mode="planar")
    for end in ("median", "low", "high"):
        np.testing.assert_allclose(getattr(found, end), band[end].to_numpy()[1:], rtol=1e-12)


def test_many_measurements_are_judged_in_blocks(posterior):
    stretch = np.linspace(1.05, 1.4, 4500)
    noise = NOISE_SD * np.random.default_rng(5).standard_normal(len(stretch))
    found = judged(posterior.solution, tq.Experiment("planar", stretch, TRUE * planar(stretch) + noise).curves[0])
    assert len(found.measured) == len(found.crps) == 4500
    # The expected score of a right Gaussian is sd / sqrt(pi); C10 is known so well that it hardly matters.
    assert found.crps.mean() == pytest.approx(NOISE_SD / np.sqrt(np.pi), rel=0.1)


def test_an_error_of_the_stress_is_not_judged_in_another_mode(fitted, unseen):
    posterior = tq.fit(fitted, discrepancy="constant", noise_sd=NOISE_SD)
    with pytest.raises(tq.InputError, match="says nothing about the planar one"):
        judged(posterior.solution, unseen.curves[0])
    assert judged(posterior.solution, unseen.curves[0], discrepancy=False).summary()["error"] < 0.3


@pytest.mark.parametrize("rows", [6_000, 400])
def test_means_are_predicted_where_means_were_fitted(rows):
    """The 95 % band of a fit of means of 10 held 73 % of single measurements (1.96 over the root of 10 sds: 46 %)."""

    def measured(count, seed):
        return tq.simulate("neo-hookean", {"C10": 0.4}, np.linspace(1.01, 1.4, count), noise_sd=0.1, seed=seed)

    posterior = tq.fit(measured(20_000, 1), discrepancy="none", noise="independent")
    assert posterior.model.experiment.rows_name == "means of 10 measurements"
    (judged_rows,) = (judged(posterior.solution, curve) for curve in measured(rows, 2).curves)
    assert len(judged_rows.measured) == rows // 10
    assert judged_rows.is_inside.mean() >= 0.95
    few = measured(12, 3)  # too far apart for means
    with_few = predicted(posterior, data=few)
    assert any("single ones scatter more, so that too many" in text for text in with_few.warnings)
    assert any(text.endswith("single ones scatter more.") for text in predicted(posterior, stretch=[1.2]).warnings)
    again = predicted(posterior, data=measured(20_000, 1))
    assert any("was fitted to these measurements" in text for text in again.warnings)
