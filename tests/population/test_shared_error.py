"""A model error that all specimens share: against dense covariances that share no code with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

import tissuq as tq
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.population.covariates import covariates_of
from tissuq.population.hierarchy import sample_hierarchy
from tissuq.population.likelihoods import coordinates_of
from tissuq.population.shared_error import _given_discrepancy, biased, shared_covariance
from tissuq.report.population import _note

STRETCH = np.linspace(0.8, 1.4, 15)
POINTS = np.linspace(0, 1, 8)
COUNT, NOISE_SD, PRIOR_SD = 8, 0.01, 0.2


def exact_sd_of_the_mean(y, covariance_of_error, is_shared):
    """Return the sd of m of y_ij = theta_i + delta_j + noise by dense covariances and a sum over tau.

    theta_i ~ N(m, tau^2), m ~ N(0, 5^2), tau half-normal.
    """
    count, size = y.shape
    ones, of_specimens = np.ones(count * size), np.kron(np.eye(count), np.ones((size, size)))
    error = np.kron(np.ones((count, count)) if is_shared else np.eye(count), covariance_of_error)
    error = error + NOISE_SD**2 * np.eye(count * size)
    taus = np.geomspace(1e-3, 4, 300)
    log_weight, mean, variance = np.zeros((3, len(taus)))
    for place, tau in enumerate(taus):
        covariance = error + tau**2 * of_specimens
        solved = np.linalg.solve(covariance, np.column_stack([ones, y.ravel()]))
        precision = ones @ solved[:, 0] + 5.0**-2
        mean[place], variance[place] = ones @ solved[:, 1] / precision, 1 / precision
        log_weight[place] = norm.logpdf(tau) + np.log(tau) - 0.5 * np.linalg.slogdet(covariance)[1]
        log_weight[place] += -0.5 * y.ravel() @ solved[:, 1] + 0.5 * mean[place] ** 2 * precision
        log_weight[place] -= 0.5 * np.log(precision)
    weights = np.exp(log_weight - log_weight.max())
    weights /= weights.sum()
    return np.sqrt(weights @ (variance + mean**2) - (weights @ mean) ** 2)


@pytest.mark.slow
def test_a_median_is_known_as_well_as_the_exact_posterior_says_and_its_share_of_the_error_allows():
    """The independent part stays in, a share 1 / n of the variance; 1000 effective draws, sds within 10 %."""
    generator = np.random.default_rng(5)
    covariance = 0.3**2 * np.exp(-0.5 * (POINTS[:, None] - POINTS) ** 2 / 0.3**2)
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(POINTS)))
    theta, noise = 0.4 * generator.standard_normal(COUNT), NOISE_SD * generator.standard_normal((COUNT, len(POINTS)))
    of_each, of_all = (root @ generator.standard_normal((len(POINTS), count)) for count in (COUNT, 1))
    whole = covariance + NOISE_SD**2 * np.eye(len(POINTS))
    pull = np.linalg.solve(whole, np.ones(len(POINTS)))
    own = 1 / pull.sum()  # of theta_i, given y_i alone
    due_to_error = own - NOISE_SD**2 / len(POINTS)

    def hierarchy(y):
        reference = np.array([5.0])
        shrunk = 1 / (1 / own + 1 / reference[0] ** 2)
        mixtures = [
            GaussianMixture.of_covariances(np.ones(1), np.array([[mean * shrunk / own]]), np.array([[[shrunk]]]))
            for mean in y @ pull * own
        ]
        none = covariates_of(None, [f"s{place}" for place in range(COUNT)])
        return sample_hierarchy(mixtures, reference, ["theta"], none, 1.0, 0)

    apart = hierarchy(theta[:, None] + of_each.T + noise)
    exact = exact_sd_of_the_mean(theta[:, None] + of_each.T + noise, covariance, is_shared=False)
    assert apart.mean.std() == pytest.approx(exact, rel=0.1)
    y = theta[:, None] + of_all.T + noise
    without = hierarchy(y)
    found = biased(without, np.array([[due_to_error]]), 0)
    exact = exact_sd_of_the_mean(y, covariance, is_shared=True)
    assert 0.9 * exact < found.mean.std() < 1.1 * exact * np.sqrt(1 + 1 / COUNT)
    assert without.mean.std() < 0.8 * exact


def dense_of_energy(posterior, basis):
    """Return the part of the covariance that is due to an energy, from the weights of its amplitudes alone.

    Given amplitude and noise, parameters and terms of the energy are Gaussian together: the covariance of the
    parameters is a block of the inverse of their precision, and given the terms the inverse of a block.
    """
    model, mixture, size = posterior.model, posterior.solution.mixture, basis.shape[1]
    y = posterior.model.experiment.measured
    means, covariances, given = [], [], []
    for settings, member in zip(mixture.settings, mixture.member, strict=True):
        values = dict(zip(model.nonlinear, settings, strict=True))
        energy = model.energy_members[member]
        features = energy.stress_features(model.states)
        amplitudes = [values[model.energy_symbols[place]] for place in energy.amplitude_indices]
        columns = [a * each for a, each in zip(amplitudes, features, strict=True)]
        joint = np.hstack([basis, *columns])
        prior = np.r_[0.0, np.full(size - 1, PRIOR_SD**-2), np.ones(joint.shape[1] - size)]
        precision = joint.T @ joint / NOISE_SD**2 + np.diag(prior)
        inverse = np.linalg.inv(precision)
        means.append((inverse @ joint.T @ y)[:size] / NOISE_SD**2)
        covariances.append(inverse[:size, :size])
        given.append(np.linalg.inv(precision[:size, :size]))
    average = lambda each: np.einsum("m,m...->...", mixture.weights, np.array(each))  # noqa: E731
    deviation = np.array(means) - average(means)
    return average(covariances) + average(deviation[:, :, None] * deviation[:, None]) - average(given)


@pytest.mark.parametrize("discrepancy", ["taylor", "auto"])
def test_the_part_that_is_due_to_an_energy_is_that_of_dense_covariances(discrepancy):
    """C10, narrow, so that its logarithm is Gaussian, too, and C20; Gaussian priors, because bounds would cut tails."""
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.02}, STRETCH, noise_sd=NOISE_SD, seed=1)
    priors = {symbol: tq.Normal(0.0, PRIOR_SD) for symbol in ("C20", "C30")}
    posterior = tq.fit(data, material="yeoh", discrepancy=discrepancy, noise_sd=NOISE_SD, priors=priors)
    coordinates = coordinates_of([posterior], ["C10", "C20"])
    found = shared_covariance([posterior], coordinates)
    invariant, slope = STRETCH**2 + 2 / STRETCH - 3, 2 * (STRETCH - STRETCH**-2)
    expected = dense_of_energy(posterior, np.column_stack([slope * k * invariant ** (k - 1) for k in (1, 2, 3)]))
    scale = np.array([posterior.marginals["C10"].mean, coordinates.scale[1]])
    expected = expected[:2, :2] / np.outer(scale, scale)
    sds = np.sqrt(np.diag(expected))
    assert found / np.outer(sds, sds) == pytest.approx(expected / np.outer(sds, sds), abs=0.05)


def test_the_part_that_is_due_to_a_process_is_that_of_dense_covariances():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=NOISE_SD, seed=1)
    posterior = tq.fit(data, discrepancy="gp", noise_sd=NOISE_SD)
    model, mixture = posterior.model, posterior.solution.mixture
    basis, covariances, means = 2 * (STRETCH - STRETCH**-2), [], []
    for settings in mixture.settings:
        values = dict(zip(model.nonlinear, settings, strict=True))
        covariance = model.correlated_variance(values) * model.correlation(model.states, model.states, values)
        pull = np.linalg.solve(covariance + NOISE_SD**2 * np.eye(len(STRETCH)), basis)
        covariances.append(1 / (pull @ basis))
        means.append(pull @ data.stress * covariances[-1])
    mean = mixture.weights @ means
    expected = mixture.weights @ (np.array(covariances) + (means - mean) ** 2) - NOISE_SD**2 / (basis @ basis)
    found = shared_covariance([posterior], coordinates_of([posterior], ["C10"]))
    assert found[0, 0] == pytest.approx(expected / mean**2, rel=0.1)


def test_given_its_discrepancy_a_law_with_an_exponent_is_known_as_without_one():
    """Well measured, so that the posterior is Gaussian; its sds to 10 %."""
    data = tq.simulate("demiray", {"mu": 0.5, "b": 4.0}, STRETCH, noise_sd=0.002, seed=2)
    posterior = tq.fit(data, material="demiray", discrepancy="none", noise_sd=0.002)
    symbols = posterior.model.material_symbols
    drawn = np.column_stack([posterior.solution.draws[symbol].ravel() for symbol in symbols])
    sds = drawn.std(axis=0)
    found = _given_discrepancy(posterior.model, posterior.solution.mixture, symbols)
    assert found / np.outer(sds, sds) == pytest.approx(np.corrcoef(drawn.T), abs=0.1)


def test_what_locks_within_the_data_does_not_count():
    data = tq.simulate("gent", {"mu": 0.5, "Jm": 8.0}, STRETCH, noise_sd=0.002, seed=2)
    solution = tq.fit(data, material="gent", discrepancy="none", noise_sd=0.002).solution
    model, mixture = solution.model, solution.mixture.thinned(3)
    locked = mixture.settings.copy()
    locked[0, model.nonlinear.index("Jm")] = 0.5 * float((STRETCH**2 + 2 / STRETCH - 3).max())
    found = _given_discrepancy(model, replace(mixture, settings=locked), model.material_symbols)
    assert found == pytest.approx(_given_discrepancy(model, mixture[1:], model.material_symbols), rel=1e-12)


@pytest.fixture(scope="module")
def specimens():
    moduli = [0.4, 0.45, 0.5, 0.55]
    return {f"s{k}": tq.simulate("neo-hookean", {"C10": C10}, STRETCH, NOISE_SD, k) for k, C10 in enumerate(moduli)}


@pytest.fixture(scope="module")
def found(specimens):
    return tq.fit_population(specimens, discrepancy="gp", noise_sd=NOISE_SD, shared_discrepancy=True)


@pytest.fixture(scope="module")
def apart(specimens):
    return tq.fit_population(specimens, discrepancy="gp", noise_sd=NOISE_SD)


@pytest.mark.slow
def test_the_bias_is_that_of_median_specimens_and_new_patient_in_the_same_draw(found, apart):
    """4000 draws: their sd within five standard errors."""
    bias = found.hierarchy.mean - apart.hierarchy.mean
    assert (apart.hierarchy.mean == apart.hierarchy.sampled.values[..., :1]).all()
    assert (found.hierarchy.root == apart.hierarchy.root).all()
    assert found.hierarchy.specimens - bias[:, :, None] == pytest.approx(apart.hierarchy.specimens, abs=1e-12)
    assert np.log(found.new / apart.new) == pytest.approx(bias, abs=1e-9)
    variance = found.shared_covariance[0, 0]
    assert bias.std() == pytest.approx(np.sqrt(variance), rel=5 / np.sqrt(2 * bias.size))
    widths = apart.median_half_widths().loc["C10"]
    assert found.median_half_widths().loc["C10"].to_numpy() == pytest.approx(widths.to_numpy())
    low, high = np.log(found.summary().loc[("C10", "median"), ["hdi_low", "hdi_high"]].to_numpy(float))
    assert np.sinh((high - low) / 2) == pytest.approx(widths["shared"], rel=0.1)
    assert widths["shared"] > widths["independent"]
    needed = found.specimens_needed(0.9 * np.sinh(1.96 * np.sqrt(variance))).loc["C10"]
    assert needed["specimens"].isna().all()  # however many there are
    assert needed["floor"]["median"] == pytest.approx(np.sinh(1.96 * np.sqrt(variance)), rel=1e-3)


@pytest.mark.slow
def test_the_page_says_how_wide_the_interval_would_be_otherwise(found, apart):
    independent, shared = (f"{100 * width:.2g} %" for width in found.median_half_widths().loc["C10"])
    assert f"C10 {shared} ({independent}); in brackets if the model error is independent." in _note(found)
    assert "independent" not in _note(apart)
    assert found.data.attrs["shared_discrepancy"] == "True"
    assert "shared_discrepancy" not in apart.data.attrs
    assert found.given({}).shared_covariance is found.shared_covariance


def test_without_a_discrepancy_there_is_nothing_to_share(specimens):
    with pytest.raises(tq.InputError, match="a shared discrepancy needs specimens that are fitted with one"):
        tq.fit_population(specimens, discrepancy="none", shared_discrepancy=True)
