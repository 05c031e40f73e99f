"""Unknown noise beside errors of whole tests: against dense covariances on a grid of the noise, written out here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import halfcauchy, halfnorm, multivariate_normal, norm

import tissuq as tq
from tissuq.prediction.densities import joint_log_likelihood, leave_one_out, pointwise_log_likelihood

STRETCH = np.linspace(0.85, 1.4, 12)
X = 2 * (STRETCH - STRETCH**-2)
STRAIN = STRETCH**2 + 2 / STRETCH - 3
STRESS = 0.5 * X * (1 + 0.2 * STRAIN) + 0.01 * np.random.default_rng(4).standard_normal(12)
PRIORS = {"C10": tq.Uniform(0, 5), "noise_sd": tq.HalfNormal(0.1)}
TOLERANCES = tq.Tolerances(slack=0.01, length=0.02, smooth=0.03, zero=0.005, resolution=0.004)
LOG_NOISE = np.linspace(np.log(1e-5), np.log(0.4), 500)
LOG_AMPLITUDE = np.linspace(-9, 7, 321)


def errors(model, tolerances=TOLERANCES):
    """The covariance of the errors of the test, along the model's own curve."""
    curve, slopes = model.fitted_errors.curve, model.fitted_errors.slopes
    slope = np.zeros(12) if slopes is None else slopes[:, 0]  # where none is needed
    smooth = np.exp(-0.5 * ((STRETCH[:, None] - STRETCH) / (np.ptp(STRETCH) / 3)) ** 2)
    columns = {"slack": STRETCH * slope, "length": (STRETCH - 1) * slope, "zero": np.ones(12)}
    of_unit = {name: np.outer(column, column) for name, column in columns.items()}
    of_unit |= {"smooth": smooth * np.outer(curve, curve), "resolution": np.abs(curve).max() ** 2 * np.eye(12)}
    return sum(size**2 * of_unit[name] for name, size in tolerances.sizes.items())


def given(covariance, column=X, stress=STRESS):
    """Log densities of the data, and means and variances of the factor of a column, for covariances (..., 12, 12).

    Its prior has a width of 5, and ends far away.
    """
    inverse = np.linalg.inv(covariance)
    precision, pull = column @ inverse @ column, column @ inverse @ stress
    rest = stress @ inverse @ stress - pull**2 / precision
    constant = 11 * np.log(2 * np.pi) + 2 * np.log(5)
    density = -0.5 * (rest + np.linalg.slogdet(covariance)[1] + np.log(precision) + constant)
    return density, pull / precision, 1 / precision


def assert_agrees(posterior, log_noise, log_weights, mean, variance):
    """Compare with log weights (noise, ...) on a grid of the noise, and the stiffness's means and variances there."""
    weights = np.exp(log_weights - log_weights.max())
    total = weights.sum()
    weights = weights / total
    evidence = log_weights.max() + np.log(total)
    centre = (weights * mean).sum()
    sd = np.sqrt((weights * (variance + (mean - centre) ** 2)).sum())
    assert posterior.log_evidence == pytest.approx(evidence, abs=0.02)
    assert abs(posterior.log_evidence - evidence) < max(posterior.log_evidence_error, 0.01)
    found = posterior.marginals[posterior.model.headline]
    assert abs(found.mean - centre) < 0.01 * sd
    assert found.sd == pytest.approx(sd, rel=0.01)
    of_noise = weights.reshape(len(log_noise), -1).sum(axis=1)
    noise = posterior.marginals["noise_sd"]
    assert noise.mean == pytest.approx(of_noise @ np.exp(log_noise), rel=0.02)
    for probability in (0.1, 0.5, 0.9):
        expected = np.exp(np.interp(probability, np.cumsum(of_noise), log_noise))
        assert noise.quantile(probability) == pytest.approx(expected, rel=0.05)


@pytest.fixture(scope="module")
def data():
    return tq.Experiment("uniaxial", STRETCH, STRESS)


@pytest.mark.parametrize("tolerances", [TOLERANCES, tq.Tolerances(zero=0.005)], ids=["many", "one"])
def test_errors_of_the_test_do_not_grow_with_the_noise(data, tolerances):
    posterior = tq.fit(data, discrepancy="none", priors=PRIORS, tolerances=tolerances)
    fixed = errors(posterior.model) if tolerances is TOLERANCES else 0.005**2 * np.ones((12, 12))
    noise = np.exp(LOG_NOISE)
    density, mean, variance = given(noise[:, None, None] ** 2 * np.eye(12) + fixed)
    prior = halfnorm(scale=0.1).logpdf(noise) + LOG_NOISE + np.log(LOG_NOISE[1] - LOG_NOISE[0])
    assert_agrees(posterior, LOG_NOISE, density + prior, mean, variance)


def test_a_parameter_of_a_curved_law_is_integrated_at_every_noise(data):
    """Each value of the noise begins at the cells of another one: all are right, and so is their sum."""
    priors = {"mu": tq.Uniform(0, 5), "b": tq.LogUniform(0.02, 5), "noise_sd": tq.HalfNormal(0.1)}
    posterior = tq.fit(data, material="demiray", discrepancy="none", priors=priors, tolerances=TOLERANCES)
    noise, log_b = np.exp(LOG_NOISE[::4]), np.linspace(np.log(0.02), np.log(5), 201)
    covariances = noise[:, None, None] ** 2 * np.eye(12) + errors(posterior.model)
    of_b = [given(covariances, X / 2 * np.exp(b * STRAIN)) for b in np.exp(log_b)]
    weights, mean, variance = (np.transpose(part) for part in zip(*of_b, strict=True))
    cells = np.full(201, 1 / 200)
    cells[[0, -1]] /= 2
    of_noise = halfnorm(scale=0.1).logpdf(noise) + np.log(noise) + np.log(4 * (LOG_NOISE[1] - LOG_NOISE[0]))
    assert_agrees(posterior, np.log(noise), weights + np.log(cells) + of_noise[:, None], mean, variance)
    of_b = np.exp(weights + np.log(cells) + of_noise[:, None] - posterior.log_evidence).sum(axis=0)
    for probability in (0.1, 0.5, 0.9):
        expected = np.exp(np.interp(probability, np.cumsum(of_b), log_b))
        assert posterior.marginals["b"].quantile(probability) == pytest.approx(expected, rel=0.03)


def test_an_energy_beside_them_is_summed_over_its_amplitudes_and_lengths(data):
    posterior = tq.fit(data, discrepancy="taylor", priors=PRIORS, tolerances=TOLERANCES)
    fixed, scale = errors(posterior.model), posterior.model.priors["c1"].quantile(0.5)
    noise, amplitudes = np.exp(LOG_NOISE[::4]), np.exp(LOG_AMPLITUDE[::3])
    log_weights, means, variances = [], [], []
    for length in (1.4, 2.8):
        energy = np.outer(X, X) * np.expm1(np.outer(STRAIN, STRAIN) / (length * STRAIN.max()) ** 2)
        for c in amplitudes:
            density, mean, variance = given(noise[:, None, None] ** 2 * np.eye(12) + fixed + c**2 * energy)
            prior = halfcauchy(scale=scale).logpdf(c) + np.log(c) + np.log(3 * (LOG_AMPLITUDE[1] - LOG_AMPLITUDE[0]))
            log_weights.append(density + prior - np.log(2))
            means.append(mean)
            variances.append(variance)
    of_noise = halfnorm(scale=0.1).logpdf(noise) + np.log(noise) + np.log(4 * (LOG_NOISE[1] - LOG_NOISE[0]))
    weights, mean, variance = (np.array(part).T for part in (log_weights, means, variances))
    assert_agrees(posterior, np.log(noise), weights + of_noise[:, None], mean, variance)


@pytest.mark.parametrize("ends", [(0.012, 0.014), (0.03, 0.2), (1e-4, 0.02), (0.003, 0.2), (0.006, 0.2)], ids=str)
def test_bounds_of_the_noise_are_obeyed(data, ends):
    priors = {"C10": tq.Uniform(0, 5), "noise_sd": tq.Uniform(*ends)}
    posterior = tq.fit(data, discrepancy="none", priors=priors, tolerances=TOLERANCES)
    log_noise = np.linspace(*np.log(ends), 2001)
    noise = np.exp(log_noise)
    density, mean, variance = given(noise[:, None, None] ** 2 * np.eye(12) + errors(posterior.model))
    cell = np.full(2001, log_noise[1] - log_noise[0])
    cell[[0, -1]] /= 2
    assert_agrees(posterior, log_noise, density + log_noise + np.log(cell) - np.log(ends[1] - ends[0]), mean, variance)


@pytest.mark.parametrize("seed", range(6))
def test_the_mass_of_noise_less_than_the_resolution_is_in_the_evidence(seed):
    stress = 0.5 * X + 0.005 * np.random.default_rng(seed).standard_normal(12)
    data = tq.Experiment("uniaxial", STRETCH, stress)
    posterior = tq.fit(data, discrepancy="none", priors=PRIORS, tolerances=TOLERANCES)
    noise = np.exp(LOG_NOISE)
    density, *_ = given(noise[:, None, None] ** 2 * np.eye(12) + errors(posterior.model), stress=stress)
    log_weights = density + halfnorm(scale=0.1).logpdf(noise) + LOG_NOISE + np.log(LOG_NOISE[1] - LOG_NOISE[0])
    assert posterior.log_evidence == pytest.approx(np.logaddexp.reduce(log_weights), abs=0.006)


def test_noise_far_below_the_resolution_of_the_test_does_not_matter(data):
    """Measurements without any scatter: the posterior of C10 is that of the errors of the test alone."""
    smooth = tq.Experiment("uniaxial", STRETCH, 0.5 * X)
    posterior = tq.fit(smooth, discrepancy="none", priors=PRIORS, tolerances=TOLERANCES)
    inverse = np.linalg.inv(errors(posterior.model))
    found = posterior.marginals["C10"]
    assert found.mean == pytest.approx(0.5, rel=1e-3)
    assert found.sd == pytest.approx((X @ inverse @ X) ** -0.5, rel=0.05)


def test_very_different_noise_levels_are_both_found():
    """An exact curve explained by errors of the test, not by noise as large as its misfit of the material."""
    stress = 0.5 * X * (1 + 0.05 * STRAIN)
    posterior = tq.fit(
        tq.Experiment("uniaxial", STRETCH, stress), discrepancy="none", tolerances=tq.Tolerances(smooth=0.05)
    )
    alone = tq.fit(tq.Experiment("uniaxial", STRETCH, stress), discrepancy="none", tolerances="as-tested")
    assert posterior.marginals["noise_sd"].quantile(0.5) < 0.1 * alone.marginals["noise_sd"].quantile(0.5)


def test_densities_of_the_data_are_those_of_the_covariance_at_the_noise_of_the_draw(data):
    posterior = tq.fit(data, discrepancy="none", priors=PRIORS, tolerances=TOLERANCES)
    solution, fixed = posterior.solution, errors(posterior.model)
    joint, pointwise = joint_log_likelihood(solution), pointwise_log_likelihood(solution)
    noise = solution.draws["noise_sd"]
    assert np.ptp(np.log(noise)) > 1
    for place in ((0, 0), (1, 10), (3, 999), np.unravel_index(noise.argmin(), noise.shape)):
        covariance = noise[place] ** 2 * np.eye(12) + fixed
        mean = solution.draws["C10"][place] * X
        assert joint[place] == pytest.approx(multivariate_normal(mean, covariance).logpdf(STRESS), abs=1e-5)
        solved, precision = np.linalg.solve(covariance, STRESS - mean), np.diag(np.linalg.inv(covariance))
        expected = norm(0, precision**-0.5).logpdf(solved / precision)
        assert np.allclose(pointwise[place], expected, atol=1e-5)
    replicate = posterior.data["posterior_predictive"]["stress"].to_numpy().reshape(-1, 12)
    scale = np.sqrt((noise**2).mean() + np.diag(fixed) + solution.draws["C10"].var() * X**2)
    assert np.allclose(replicate.std(axis=0), scale, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "tolerances", [tq.Tolerances(slack=0.01), tq.Tolerances(resolution=0.01), TOLERANCES], ids=["slack", "one", "many"]
)
@pytest.mark.parametrize("outlier", [0.0, 0.02])
def test_leaving_one_out_is_what_dense_covariances_without_it_say(tolerances, outlier):
    """Values of the noise that the posterior hardly holds are those of the posterior without a measurement."""
    stress = 0.5 * X + 0.01 * np.random.default_rng(1).standard_normal(12)
    stress[5] += outlier
    data = tq.Experiment("uniaxial", STRETCH, stress)
    posterior = tq.fit(data, discrepancy="none", noise="independent", tolerances=tolerances, priors=PRIORS)
    model, noises = posterior.model, np.exp(np.linspace(np.log(1e-5), np.log(0.4), 2000))
    covariances = errors(model, tolerances) + noises[:, None, None] ** 2 * np.eye(12)
    prior = np.log(noises) + halfnorm.logpdf(noises, scale=0.1)

    def log_evidence(rows):
        """Of some measurements, C10 integrated without bounds."""
        precision = np.linalg.inv(covariances[:, rows][:, :, rows])
        of_unit, of_data = precision @ X[rows], precision @ stress[rows]
        information = of_unit @ X[rows]
        misfit = of_data @ stress[rows] - (of_data @ X[rows]) ** 2 / information
        log_det = np.linalg.slogdet(precision)[1]
        return np.logaddexp.reduce(
            prior + 0.5 * (log_det - misfit - np.log(information) - (len(rows) - 1) * np.log(2 * np.pi))
        )

    wanted = [log_evidence(np.arange(12)) - log_evidence(np.delete(np.arange(12), row)) for row in range(12)]
    found = leave_one_out(posterior.solution)
    assert np.abs(found.log_density - wanted)[~found.is_rough] == pytest.approx(0, abs=0.2)
    assert found.log_density == pytest.approx(wanted, abs=0.5)
    assert found.is_rough.sum() <= 2
