"""Predictions, replicates and leave-one-out densities at given parameters, against dense conditioning."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import tissuq as tq
from dense import columns
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.model.statistical_model import StatisticalModel
from tissuq.prediction.densities import pointwise_log_likelihood, replicate_data
from tissuq.prediction.moments import stress_moments, variance_of_noise

REPEATED = np.repeat([0.7, 0.9, 1.2, 1.5, 1.9], [2, 1, 3, 2, 2])
NEW = np.array([0.7, 0.8, 1.2, 1.7, 1.9])
STRESS = columns(["C10", "C20"], REPEATED) @ [1.2, -0.05] + 0.1 * np.random.default_rng(0).standard_normal(10)
VALUES = {"C10": 1.1, "m0": 0.05, "S": 0.3, "c": 0.4, "psi": 0.6, "noise_sd": 0.1, "noise_share": 0.2}
KINDS = [
    ("constant", "repeats"),
    ("constant", "unknown"),
    ("constant", "proportional"),
    ("gp", "unknown"),
    ("gp", "proportional"),
    ("gp", "repeats"),
    ("none", "proportional"),
]


class Fixed:
    """A solution whose every draw has the given parameters."""

    drawn_discrepancy = None

    def __init__(self, model, values, draws=3000):
        self.model = model
        self.draws = {symbol: np.full((4, draws), values[symbol]) for symbol in model.symbols}
        self.shape = (4, draws)


def model_of(discrepancy, noise):
    data = tq.Experiment("uniaxial", REPEATED, STRESS)
    return StatisticalModel(data, tq.materials()["neo-hookean"](), tq.discrepancies()[discrepancy](), noise)


def kernel(discrepancy, noise, first, second, same=None):
    """Return the covariance of what is shared between measurements: the process, or S at equal stretches."""
    if discrepancy == "gp":
        return VALUES["c"] ** 2 * np.exp(-0.5 * ((first[:, None] - second) / VALUES["psi"]) ** 2)
    if discrepancy == "constant" and noise == "repeats":
        return VALUES["S"] ** 2 * (first[:, None] == second)
    return np.zeros((len(first), len(second)))


def white(discrepancy, noise, level):
    sd = VALUES["noise_sd"] + (VALUES["noise_share"] * level if noise == "proportional" else 0.0 * level)
    own = VALUES["S"] ** 2 if discrepancy == "constant" and noise != "repeats" else 0.0
    return sd**2, own


def mean_of(discrepancy, stretch):
    mean = VALUES["C10"] * columns(["C10"], stretch)[:, 0]
    return mean + (VALUES["m0"] if discrepancy == "constant" else 0.0)


def conditioned(discrepancy, noise, stretch):
    """Return mean and variance of the discrepancy-and-material stress at new stretches, given the data."""
    levels = model_of(discrepancy, noise).levels
    sd2, own = white(discrepancy, noise, levels)
    K = kernel(discrepancy, noise, REPEATED, REPEATED) + np.diag(sd2 + own)
    cross = kernel(discrepancy, noise, stretch, REPEATED)
    gain = np.linalg.solve(K, cross.T).T
    mean = mean_of(discrepancy, stretch) + gain @ (STRESS - mean_of(discrepancy, REPEATED))
    return mean, kernel(discrepancy, noise, stretch, stretch) - gain @ cross.T


def components(model):
    """Return one component at the values: the linear parameters without spread."""
    settings = np.array([[VALUES[symbol] for symbol in model.nonlinear]])
    mean = np.array([[VALUES[symbol] for symbol in model.linear]])
    return GaussianMixture(np.ones(1), settings, mean, np.zeros((1, mean.shape[1], mean.shape[1])))


@pytest.mark.parametrize(("discrepancy", "noise"), KINDS)
@pytest.mark.parametrize("noisy", [True, False])
def test_moments_at_new_stretches_are_those_of_dense_conditioning(discrepancy, noise, noisy):
    model = model_of(discrepancy, noise)
    states = model.experiment.states_at(NEW)
    mean, variance = stress_moments(model, components(model), states)
    variance = variance + noisy * variance_of_noise(model, components(model), 1.0, mean)
    expected, spread = conditioned(discrepancy, noise, NEW)
    sd2, own = white(discrepancy, noise, np.abs(expected))
    np.testing.assert_allclose(mean[0], expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(variance[0], np.diag(spread) + own + (sd2 if noisy else 0), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("discrepancy", "noise"), KINDS)
def test_the_model_alone_is_the_material(discrepancy, noise):
    model = model_of(discrepancy, noise)
    mean, variance = stress_moments(model, components(model), model.experiment.states_at(NEW), discrepancy=False)
    np.testing.assert_allclose(mean[0], VALUES["C10"] * columns(["C10"], NEW)[:, 0], rtol=1e-12)
    np.testing.assert_allclose(variance[0], 0.0, atol=1e-15)


@pytest.mark.parametrize(("discrepancy", "noise"), KINDS)
def test_leave_one_out_densities_are_those_of_dense_conditioning(discrepancy, noise):
    model = model_of(discrepancy, noise)
    found = pointwise_log_likelihood(Fixed(model, VALUES, draws=2))
    sd2, own = white(discrepancy, noise, model.levels)
    K = kernel(discrepancy, noise, REPEATED, REPEATED) + np.diag(sd2 + own)
    residual = STRESS - mean_of(discrepancy, REPEATED)
    for i in range(len(residual)):
        rest = np.delete(np.arange(len(residual)), i)
        gain = np.linalg.solve(K[np.ix_(rest, rest)], K[rest, i])
        spread = np.sqrt(K[i, i] - gain @ K[rest, i])
        expected = norm(gain @ residual[rest], spread).logpdf(residual[i])
        np.testing.assert_allclose(found[:, :, i], expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(("discrepancy", "noise"), KINDS)
def test_replicates_have_the_moments_of_dense_conditioning(discrepancy, noise):
    # 12000 draws; each of 10 means and 55 covariances within 5 of its standard errors: false chance 4e-5 a case.
    model = model_of(discrepancy, noise)
    drawn = replicate_data(Fixed(model, VALUES), seed=1).reshape(-1, 10)
    expected, spread = conditioned(discrepancy, noise, REPEATED)
    sd2, own = white(discrepancy, noise, model.levels)
    covariance = spread + np.diag(sd2 + own)
    sd = np.sqrt(np.diag(covariance))
    count = len(drawn)
    assert (np.abs(drawn.mean(axis=0) - expected) < 5 * sd / np.sqrt(count)).all()
    error = np.sqrt((covariance**2 + np.outer(sd, sd) ** 2) / count)
    assert (np.abs(np.cov(drawn.T) - covariance) < 5 * error).all()


def test_a_known_repeat_is_predicted_with_its_shared_error_and_a_new_stretch_without():
    # Conditioning on what was measured at the same stretch must narrow the prediction; elsewhere S stays whole.
    model = model_of("constant", "repeats")
    _, variance = stress_moments(model, components(model), model.experiment.states_at(np.array([1.2, 1.3])))
    assert variance[0, 1] == pytest.approx(0.09, rel=1e-9)
    assert variance[0, 0] == pytest.approx(1 / (1 / 0.09 + 3 / 0.01), rel=1e-9)


def test_a_process_with_proportional_noise_is_not_integrated_exactly():
    data = tq.Experiment("uniaxial", REPEATED, STRESS)
    with pytest.raises(tq.ModelError, match="not independent along any fixed directions"):
        tq.fit(data, discrepancy="gp", noise="proportional", method="exact")


@pytest.mark.slow
def test_a_process_with_proportional_noise_goes_to_nuts_and_predicts():
    data = tq.Experiment("uniaxial", REPEATED, STRESS)
    posterior = tq.fit(data, discrepancy="gp", noise="proportional", method="nuts")
    band = posterior.predict([0.8, 1.3])
    assert posterior.solution.route == "nuts"
    assert (band["low"] < band["median"]).all()
    assert (band["median"] < band["high"]).all()
