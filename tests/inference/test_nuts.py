"""NUTS against targets whose moments are known.

Means and standard deviations must lie within five Monte-Carlo standard errors: for a correct sampler, one
comparison fails with probability 6e-7, all those below with less than 1e-4. Seeds are fixed, so a pass stays
a pass.
"""

from dataclasses import replace

import jax.numpy as jnp
import jax.scipy as jsp
import numpy as np
import pytest
from arviz_stats.base import array_stats
from scipy import stats
from scipy.special import gammaln

from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.enumerators.nuts import NutsDraws, NutsSettings, sample_nuts

ERRORS_ALLOWED = 5.0


def assert_moments(draws, mean, sd):
    axes = {"chain_axis": 0, "draw_axis": 1}
    error_of_mean = array_stats.mcse(draws.values, method="mean", **axes)
    error_of_sd = array_stats.mcse(draws.values, method="sd", **axes)
    assert np.all(np.abs(draws.values.mean((0, 1)) - mean) < ERRORS_ALLOWED * error_of_mean)
    assert np.all(np.abs(draws.values.std((0, 1)) - sd) < ERRORS_ALLOWED * error_of_sd)


def assert_reaches_the_bar(draws):
    assert draws.converged, draws.verdict
    assert draws.rhat.max() < 1.01
    assert min(draws.ess_bulk.min(), draws.ess_tail.min()) > 400
    assert draws.divergences == 0


@pytest.mark.slow
def test_a_correlated_normal_of_very_different_scales_is_recovered_in_a_wide_box():
    mean, sds = np.array([0.5, -20.0, 0.0, 5.0]), np.array([1e-3, 0.1, 1.0, 10.0])
    precision = np.linalg.inv(np.outer(sds, sds) * (0.2 * np.eye(4) + 0.8))

    def log_density(x):
        return -0.5 * (x - mean) @ precision @ (x - mean)

    draws = sample_nuts(log_density, [-100.0] * 4, [100.0] * 4, [50.0, 50.0, -50.0, 0.0])
    assert_reaches_the_bar(draws)
    assert_moments(draws, mean, sds)
    assert draws.leapfrogs_per_draw < 20
    correlation = np.corrcoef(draws.values.reshape(-1, 4).T)
    # Fisher's z has standard error 1 / sqrt(effective size); 1000 is far below it here.
    assert np.abs(np.arctanh(correlation[0, 1:]) - np.arctanh(0.8)).max() < ERRORS_ALLOWED / np.sqrt(1000)


@pytest.mark.slow
def test_a_normal_pushed_against_its_bound_is_recovered():
    draws = sample_nuts(lambda x: -0.5 * ((x[0] + 1) / 0.5) ** 2, [0.0], [10.0], [5.0])
    exact = stats.truncnorm(2.0, 22.0, -1.0, 0.5)
    assert_reaches_the_bar(draws)
    assert_moments(draws, exact.mean(), exact.std())


@pytest.mark.slow
def test_a_density_piled_up_at_zero_is_recovered():
    draws = sample_nuts(lambda x: -x[0] / 1e-3, [0.0], [10.0], [5.0])
    assert_reaches_the_bar(draws)
    assert_moments(draws, 1e-3, 1e-3)
    low = draws.values < -1e-3 * np.log(0.99)
    assert low.mean() == pytest.approx(0.01, abs=ERRORS_ALLOWED * np.sqrt(0.01 / 400))


@pytest.mark.slow
def test_half_bounded_and_free_coordinates_are_recovered():
    def log_density(x):
        above, below = x[0] - 2.0, -3.0 - x[1]
        return 2 * jnp.log(above) - above + 4 * jnp.log(below) - 10 * below - 0.5 * (x[2] / 7.0) ** 2

    draws = sample_nuts(log_density, [2.0, -np.inf, -np.inf], [np.inf, -3.0, np.inf], [9.0, -9.0, 1.0])
    assert_reaches_the_bar(draws)
    assert_moments(draws, [2.0 + 3.0, -3.0 - 0.5, 0.0], [np.sqrt(3.0), np.sqrt(0.05), 7.0])


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.05, 1e-4])
def test_a_stiff_polynomial_with_unknown_noise_reaches_the_bar(noise):
    count, terms = 30, 3
    stretch = np.linspace(1.02, 1.5, count)
    I1 = stretch**2 + 2 / stretch
    design = np.stack([2 * k * (I1 - 3) ** (k - 1) * (stretch - stretch**-2) for k in (1, 2, 3)], axis=1)
    stress = design @ [0.5, 0.3, 0.2] + noise * np.random.default_rng(1).standard_normal(count)

    def log_density(x):
        residual = stress - design @ x[:terms]
        return -count * jnp.log(x[terms]) - 0.5 * residual @ residual / x[terms] ** 2

    draws = sample_nuts(log_density, [-50.0] * terms + [0.0], [50.0] * terms + [10.0], [0.0] * terms + [5.0])
    assert_reaches_the_bar(draws)
    assert draws.leapfrogs_per_draw < 20

    # The boxes cut nothing off: 1 / S^2 is a gamma variable, the coefficients are Student's t.
    coefficients, (squares,), _, _ = np.linalg.lstsq(design, stress)
    shape, rate = 0.5 * (count - terms - 1), 0.5 * squares
    mean_square = rate / (shape - 1)
    mean_noise = np.sqrt(rate) * np.exp(gammaln(shape - 0.5) - gammaln(shape))
    variances = np.append(mean_square * np.diag(np.linalg.inv(design.T @ design)), mean_square - mean_noise**2)
    assert_moments(draws, np.append(coefficients, mean_noise), np.sqrt(variances))


@pytest.mark.slow
def test_the_amplitude_and_length_of_a_gaussian_process_reach_the_bar():
    count, noise = 30, 0.02
    stretch = np.linspace(1.0, 2.0, count)
    stress = 0.1 * np.sin(5 * stretch) + noise * np.random.default_rng(0).standard_normal(count)
    squared_distance = (stretch[:, None] - stretch) ** 2
    lower, upper = [0.0, 0.05], [1.0, 10.0]

    def log_density(x):
        covariance = x[0] ** 2 * jnp.exp(-0.5 * squared_distance / x[1] ** 2) + noise**2 * jnp.eye(count)
        root = jnp.linalg.cholesky(covariance)
        whitened = jsp.linalg.solve_triangular(root, stress, lower=True)
        return -0.5 * whitened @ whitened - jnp.log(jnp.diag(root)).sum()

    draws = sample_nuts(log_density, lower, upper, [0.5, 5.0])
    assert draws.converged, draws.verdict

    # Gauss-Legendre quadrature in amplitude and log length, with NumPy's own normal density.
    nodes, weights = np.polynomial.legendre.leggauss(80)
    amplitude, log_length = 0.5 * (nodes + 1), np.log(0.05) + 0.5 * (nodes + 1) * np.log(10 / 0.05)
    c, psi = (grid.ravel() for grid in np.meshgrid(amplitude, np.exp(log_length), indexing="ij"))
    covariance = c[:, None, None] ** 2 * np.exp(-0.5 * squared_distance / psi[:, None, None] ** 2)
    covariance += noise**2 * np.eye(count)
    fit = np.einsum("i,kij,j->k", stress, np.linalg.inv(covariance), stress)
    log_values = -0.5 * fit - 0.5 * np.linalg.slogdet(covariance)[1] + np.log(psi)
    mass = np.outer(weights, weights).ravel() * np.exp(log_values - log_values.max())
    points, mass = np.stack([c, psi]), mass / mass.sum()
    mean = points @ mass
    assert_moments(draws, mean, np.sqrt((points - mean[:, None]) ** 2 @ mass))


def two_modes(x):
    return jnp.logaddexp(-50 * (x[0] + 5) ** 2, -50 * (x[0] - 5) ** 2)


@pytest.mark.slow
def test_two_far_modes_are_reported_as_not_converged():
    draws = sample_nuts(two_modes, [-10.0], [10.0], [1.0], names=["C10"])
    assert not draws.converged
    assert draws.verdict.startswith("Not converged: R-hat is ")
    assert "for C10" in draws.verdict
    assert "the chains stay in different places" in draws.verdict


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not():
    first, again, other = (
        sample_nuts(two_modes, [-10.0], [10.0], [1.0], NutsSettings(seed=seed)).values for seed in (3, 3, 4)
    )
    assert first.shape == (4, 1000, 1)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.slow
def test_a_curved_ridge_whose_ends_no_chain_enters_is_reported():
    """Its first coordinate is standard normal; the ridge along it turns too sharply for the steps where it is steep."""

    def log_density(x):
        return -0.5 * x[0] ** 2 - 0.5 * ((x[1] - 3 * x[0] ** 2) / 0.05) ** 2

    draws = sample_nuts(log_density, [-np.inf] * 2, [np.inf] * 2, [0.0, 0.0], NutsSettings(seed=2))
    assert draws.values[..., 0].std() < 0.9
    assert not draws.converged
    assert "trajectories diverged" in draws.verdict


def independent_draws(**changes):
    generator = np.random.default_rng(0)
    sound = NutsDraws(
        generator.standard_normal((4, 1000, 2)), ("C10", "S"), generator.standard_normal((4, 2000)), 0, 3.0
    )
    return replace(sound, **changes)


def test_independent_draws_converge_and_the_verdict_gives_the_numbers():
    verdict = independent_draws(divergences=5).verdict
    assert verdict.startswith("Converged: R-hat at most 1.00")
    assert "5 of 8000 trajectories divergent" in verdict


def shifted_chain():
    values = independent_draws().values.copy()
    values[0, :, 1] += 1.0
    return values


def frozen():
    return np.zeros((4, 1000, 2))


def drifting_energies():
    return np.random.default_rng(0).standard_normal((4, 2000)).cumsum(axis=1)


@pytest.mark.parametrize(
    ("fault", "reported"),
    [
        ({"values": shifted_chain()}, r"R-hat is 1\.\d+ for S"),
        ({"values": frozen()}, "R-hat is nan for C10"),
        ({"values": drifting_energies().reshape(4, 1000, 2)}, "bulk effective sample size"),
        ({"divergences": 16}, "16 of 8000 trajectories diverged.*target acceptance"),
        ({"energies": drifting_energies()}, r"BFMI is 0\.0"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_every_planted_fault_is_reported(fault, reported):
    draws = independent_draws(**fault)
    assert not draws.converged
    with pytest.raises(AssertionError, match=reported):
        raise AssertionError(draws.verdict)


@pytest.mark.parametrize(
    "setting", [{"chains": 1}, {"draws": 0}, {"warmup": 0}, {"thinning": 0}, {"target_acceptance": 1.0}]
)
def test_settings_without_meaning_are_refused(setting):
    with pytest.raises(InputError, match=f"NUTS {next(iter(setting))}"):
        NutsSettings(**setting)


def test_names_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="2 names"):
        sample_nuts(lambda x: -x[0], [0.0], [1.0], [0.5], names=["a", "b"])


def test_a_density_finite_only_at_its_start_cannot_be_sampled():
    with pytest.raises(ConvergenceError, match="not finite anywhere"):
        sample_nuts(lambda x: jnp.where(x[0] == 0.5, -((x[0] - 0.5) ** 2), jnp.nan), [-np.inf], [np.inf], [0.5])
