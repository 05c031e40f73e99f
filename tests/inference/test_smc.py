"""Tempered SMC against evidences and posteriors that are known.

Log evidences must lie within five of their own standard errors, and these must be small; means and standard
deviations within five Monte-Carlo standard errors, widened by the spread between the runs. With the few
degrees of freedom of an error from eight runs, one such comparison fails for a correct sampler with
probability below 1e-3, all those below with less than 2 %. Seeds are fixed, so a pass stays a pass.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from bridge import bridge_log_evidence
from tissuq.errors import ConvergenceError, InputError
from tissuq.inference.coordinates import Box, log_density_on_line
from tissuq.inference.enumerators import smc
from tissuq.inference.enumerators.mutation import compiled_program
from tissuq.inference.enumerators.smc import SmcDraws, SmcSettings, sample_smc
from tissuq.inference.quasi_monte_carlo import resampled_at_random

ERRORS_ALLOWED = 5.0
RUNS = 8


def flat(x):
    return 0.0


def uniform_draws(lower, upper, count=2000, seed=0):
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))


def sample_uniform(log_likelihood, lower, upper, settings=None, seed=0):
    settings = settings or SmcSettings(seed=seed)
    draws = uniform_draws(lower, upper, settings.particles, seed)
    return sample_smc(log_likelihood, flat, lower, upper, draws, settings)


def assert_log_evidence(draws, expected, largest_error):
    assert draws.log_evidence_error < largest_error
    assert abs(draws.log_evidence - expected) < ERRORS_ALLOWED * draws.log_evidence_error


def assert_moments(draws, mean, sd):
    by_run = draws.values.mean(1), draws.values.std(1)
    for found, expected in zip(by_run, (mean, sd), strict=True):
        error = found.std(0, ddof=1) / np.sqrt(RUNS)
        assert np.all(error < 0.2 * np.asarray(sd))
        assert np.all(np.abs(found.mean(0) - expected) < ERRORS_ALLOWED * error)


class Line:
    """Data on a polynomial with known noise under uniform priors: all Gaussian but for the walls of the box."""

    def __init__(self, terms, noise, half_width, centre=0.0):
        abscissa = np.linspace(0.0, 1.0, 40)
        self.design = np.vander(abscissa, terms, increasing=True)
        self.noise = noise
        self.data = self.design @ np.ones(terms) + noise * np.random.default_rng(1).standard_normal(40)
        self.covariance = noise**2 * np.linalg.inv(self.design.T @ self.design)
        self.mean = self.covariance @ self.design.T @ self.data / noise**2
        self.sd = np.sqrt(np.diag(self.covariance))
        middle = self.mean + centre * self.sd
        self.lower, self.upper = middle - half_width * self.sd, middle + half_width * self.sd

    def log_likelihood(self, x):
        residual = self.data - self.design @ x
        return -0.5 * residual @ residual / self.noise**2 - len(self.data) * jnp.log(self.noise * jnp.sqrt(2 * jnp.pi))

    @property
    def log_evidence(self):
        normal = stats.multivariate_normal(self.mean, self.covariance)
        inside = normal.cdf(self.upper, lower_limit=self.lower, rng=np.random.default_rng(0))
        best = stats.norm.logpdf(self.data - self.design @ self.mean, scale=self.noise).sum()
        return best - normal.logpdf(self.mean) + np.log(inside) - np.log(self.upper - self.lower).sum()


@pytest.mark.slow
@pytest.mark.parametrize(("terms", "largest_error"), [(2, 0.2), pytest.param(6, 0.3, marks=pytest.mark.slow)])
def test_a_posterior_a_thousandth_as_wide_as_the_prior_is_found_with_its_evidence(terms, largest_error):
    line = Line(terms, noise=0.01, half_width=500.0)
    draws = sample_uniform(line.log_likelihood, line.lower, line.upper)
    assert draws.converged, draws.verdict
    assert_log_evidence(draws, line.log_evidence, largest_error)
    assert_moments(draws, line.mean, line.sd)
    # Correlations up to -0.999 between the coefficients of a polynomial.
    covariance = np.cov(draws.values.reshape(-1, terms).T)
    assert stats.multivariate_normal(np.zeros(terms), line.covariance).entropy() == pytest.approx(
        stats.multivariate_normal(np.zeros(terms), covariance).entropy(), abs=0.3
    )


@pytest.mark.slow
def test_a_posterior_cut_by_the_walls_of_its_box_has_the_evidence_that_scipy_integrates():
    line = Line(3, noise=0.1, half_width=1.0, centre=1.5)
    draws = sample_uniform(line.log_likelihood, line.lower, line.upper)
    assert draws.converged, draws.verdict
    assert_log_evidence(draws, line.log_evidence, 0.1)


@pytest.mark.slow
def test_a_missing_jacobian_would_be_caught(monkeypatch):
    line = Line(3, noise=0.1, half_width=1.0, centre=1.5)
    monkeypatch.setattr(Box, "log_jacobian", lambda self, line: 0.0)
    draws = sample_uniform(line.log_likelihood, line.lower, line.upper)
    assert abs(draws.log_evidence - line.log_evidence) > ERRORS_ALLOWED * draws.log_evidence_error


@pytest.mark.slow
def test_a_normal_pushed_against_its_bound_is_recovered():
    draws = sample_uniform(lambda x: -0.5 * ((x[0] + 1) / 0.5) ** 2, [0.0], [10.0])
    exact = stats.truncnorm(2.0, 22.0, -1.0, 0.5)
    assert draws.converged, draws.verdict
    assert_log_evidence(draws, np.log(0.5 * np.sqrt(2 * np.pi) * stats.norm.sf(2.0) / 10), 0.2)
    assert_moments(draws, [exact.mean()], [exact.std()])
    # Kolmogorov's distance of 2000 independent draws exceeds 0.06 with probability 1e-6.
    assert stats.kstest(draws.values.ravel(), exact.cdf).statistic < 0.06


@pytest.mark.slow
def test_a_banana_agrees_with_quadrature():
    lower, upper = [-5.0, -5.0], [5.0, 15.0]

    def log_likelihood(x):
        return -0.5 * x[0] ** 2 - 0.5 * ((x[1] - x[0] ** 2) / 0.1) ** 2

    draws = sample_uniform(log_likelihood, lower, upper)
    assert draws.converged, draws.verdict

    grid = np.stack(np.meshgrid(np.linspace(-5, 5, 1001), np.linspace(-5, 15, 4001), indexing="ij"))
    density = np.exp(log_likelihood(grid))
    assert_log_evidence(draws, np.log(density.sum() * 0.01 * 0.005 / 200), 0.2)
    mean = np.array([np.average(part, weights=density) for part in grid])
    spread = np.array([np.average((part - m) ** 2, weights=density) for part, m in zip(grid, mean, strict=True)])
    assert_moments(draws, mean, np.sqrt(spread))


@pytest.mark.slow
def test_two_far_modes_keep_their_masses():
    def log_likelihood(x):
        squares = jnp.array([jnp.sum((x - centre) ** 2) for centre in (0.25, 0.7)])
        sds = jnp.array([0.01, 0.03])
        normals = -0.5 * squares / sds**2 - 2 * jnp.log(sds) - jnp.log(2 * jnp.pi)
        return jnp.logaddexp(jnp.log(0.8) + normals[0], jnp.log(0.2) + normals[1])

    draws = sample_uniform(log_likelihood, [0.0, 0.0], [1.0, 1.0])
    assert draws.converged, draws.verdict
    assert_log_evidence(draws, 0.0, 0.2)
    shares = (draws.values[..., 0] < 0.5).mean(1)
    error = shares.std(ddof=1) / np.sqrt(RUNS)
    assert error < 0.05
    assert abs(shares.mean() - 0.8) < ERRORS_ALLOWED * error
    narrow = draws.values[draws.values[..., 0] < 0.5]
    # The standard error of a standard deviation from some 1600 draws is below 2 %.
    assert narrow.std(0) == pytest.approx(0.01, rel=0.1)


@pytest.mark.slow
def test_a_likelihood_without_slope_that_is_zero_or_undefined_on_most_of_the_prior_is_integrated():
    def log_likelihood(x):
        steps = -jnp.floor(jnp.sum(jnp.abs(x - 0.8)) * 40.0)
        return jnp.where(x[0] < 0.5, jnp.nan, jnp.where(x[1] < 0.5, -jnp.inf, steps))

    draws = sample_uniform(log_likelihood, [0.0, 0.0], [1.0, 1.0])
    middles = (np.arange(4000) + 0.5) / 4000
    values = np.exp(-np.floor((np.abs(middles - 0.8)[:, None] + np.abs(middles - 0.8)) * 40.0))
    values[middles < 0.5], values[:, middles < 0.5] = 0.0, 0.0
    assert draws.converged, draws.verdict
    assert_log_evidence(draws, np.log(values.mean()), 0.3)
    assert draws.values.min() > 0.5


@pytest.mark.slow
def test_bridge_sampling_agrees_on_a_correlated_posterior_with_unknown_noise():
    line = Line(4, noise=0.1, half_width=100.0)
    lower, upper = np.append(line.lower, 0.0), np.append(line.upper, np.inf)

    def log_likelihood(x):
        residual = line.data - line.design @ x[:4]
        return -0.5 * residual @ residual / x[4] ** 2 - len(line.data) * jnp.log(x[4] * jnp.sqrt(2 * jnp.pi))

    def log_prior(x):
        return jnp.log(2.0) - 0.5 * x[4] ** 2 - 0.5 * jnp.log(2 * jnp.pi) - np.log(line.upper - line.lower).sum()

    noises = np.abs(np.random.default_rng(1).standard_normal((2000, 1)))
    prior_draws = np.hstack([uniform_draws(line.lower, line.upper), noises])
    draws = sample_smc(log_likelihood, log_prior, lower, upper, prior_draws)
    assert draws.converged, draws.verdict

    box = Box(lower, upper)
    on_line = jax.jit(jax.vmap(log_density_on_line(lambda x: log_likelihood(x) + log_prior(x), box)))
    lines = np.stack([box.to_line(point) for point in draws.values.reshape(-1, 5)])
    estimate, error = bridge_log_evidence(on_line, lines)
    assert error < 0.05
    assert abs(estimate - draws.log_evidence) < ERRORS_ALLOWED * np.hypot(error, draws.log_evidence_error)


def test_bridge_sampling_finds_a_known_integral():
    draws = stats.t(8, 1.0, 2.0).rvs((4000, 2), random_state=np.random.default_rng(0))
    estimate, error = bridge_log_evidence(lambda x: stats.t(8, 1.0, 2.0).logpdf(x).sum(1) + 7.0, draws)
    assert error < 0.05
    assert abs(estimate - 7.0) < ERRORS_ALLOWED * error


SMALL = Line(2, noise=0.1, half_width=30.0)


@pytest.fixture(scope="module")
def small_program():
    return compiled_program(SMALL.log_likelihood, flat, Box(SMALL.lower, SMALL.upper))


@pytest.fixture
def compiled_once(monkeypatch, small_program):
    """Compile the small problem once for all its runs."""
    monkeypatch.setattr(smc, "compiled_program", lambda *problem: small_program)


def small_run(seed, prior_seed=None, **changes):
    settings = replace(SmcSettings(particles=400, seed=seed), **changes)
    draws = uniform_draws(SMALL.lower, SMALL.upper, 400, seed if prior_seed is None else prior_seed)
    return sample_smc(SMALL.log_likelihood, flat, SMALL.lower, SMALL.upper, draws, settings)


@pytest.mark.statistical
@pytest.mark.usefixtures("compiled_once")
def test_the_stated_error_is_the_spread_of_the_log_evidence():
    runs = [small_run(seed) for seed in range(24)]
    scores = [(draws.log_evidence - SMALL.log_evidence) / draws.log_evidence_error for draws in runs]
    # For standard normal scores the limits of their root mean square are passed with probability 2e-4, that of
    # their mean with 1e-5.
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.55
    assert abs(np.mean(scores)) < 4.4 / np.sqrt(24)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not(monkeypatch, small_program):
    compiled_anew = small_run(3)
    monkeypatch.setattr(smc, "compiled_program", lambda *problem: small_program)
    again = small_run(3)
    assert compiled_anew.values.tobytes() == again.values.tobytes()
    assert compiled_anew.log_evidence == again.log_evidence
    assert small_run(4, prior_seed=3).log_evidence != again.log_evidence


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_once")
def test_what_is_wrong_is_said_with_what_to_try():
    draws = small_run(0, max_sweeps=1)
    assert not draws.converged
    assert draws.verdict.startswith("Not converged: ")
    assert "effective sample size is" in draws.verdict
    assert "temperatures the particles still remember their start after 1 sweeps" in draws.verdict
    assert draws.verdict.endswith("Try more particles, or more sweeps (max_sweeps).")


def made_draws(values, increments=None, drifts=None):
    zeros = np.zeros((3, len(values)))
    increments, drifts = (zeros if array is None else array for array in (increments, drifts))
    sweeps, moved = np.ones(3, dtype=int), np.ones(3, dtype=bool)
    return SmcDraws(values, ("a",), increments, drifts, np.array([0.1, 0.5, 1.0]), sweeps, moved, np.ones((3, 2)))


def test_relatives_are_discounted_in_the_effective_sample_size():
    distinct = np.random.default_rng(0).standard_normal((RUNS, 100, 1))
    # Over seeds, ArviZ's estimate for 800 independent values keeps within a third of it.
    assert made_draws(distinct).ess_bulk == pytest.approx(800, rel=0.33)
    repeated = made_draws(np.repeat(distinct, 10, axis=1))
    assert repeated.ess_bulk == pytest.approx(800, rel=0.33)
    assert max(repeated.ess_bulk, repeated.ess_tail) <= repeated.distinct == 800
    assert made_draws(np.tile(distinct[:1], (RUNS, 1, 1)) + 10 * np.arange(RUNS)[:, None, None]).rhat > 1.1


def test_resampling_follows_the_weights_and_keeps_relatives_together():
    weights = np.random.default_rng(0).exponential(size=(RUNS, 250))
    weights[:, :5] = 0.0
    with np.errstate(divide="ignore"):
        chosen = resampled_at_random(np.log(weights) - 1e4, np.random.default_rng(1))
    assert chosen.shape == (RUNS, 250)
    assert np.all(np.diff(chosen, axis=1) >= 0)
    counts = np.stack([np.bincount(run, minlength=250) for run in chosen])
    # Systematic resampling rounds every expected count up or down.
    assert np.all(np.abs(counts - 250 * weights / weights.sum(1, keepdims=True)) < 1)


def test_runs_whose_means_differ_a_little_have_not_converged():
    """Centres 0.3 standard deviations apart: R-hat is about sqrt(1 + 0.3^2) = 1.044, over the threshold of 1.01."""
    values = np.random.default_rng(0).standard_normal((RUNS, 1000, 1))
    apart = made_draws(values + 0.3 * np.array([-1.0, 1.0] * (RUNS // 2))[:, None, None])
    assert apart.rhat[0] == pytest.approx(np.sqrt(1 + 0.3**2), abs=0.01)
    assert not apart.converged
    assert "R-hat between runs is 1.05" in apart.verdict
    assert made_draws(values).converged


def test_the_error_of_the_evidence_is_the_jackknife_over_the_runs():
    """Temperatures that err alike: to first order in so small a spread the jackknife is the plain standard error."""
    alike = np.tile(np.random.default_rng(2).normal(0.0, 1e-4, RUNS), (3, 1))
    student = stats.t(RUNS - 1).ppf(stats.norm.cdf(1))
    expected = student * 3 * alike[0].std(ddof=1) / np.sqrt(RUNS)
    assert made_draws(np.zeros((RUNS, 4, 1)), alike).log_evidence_error == pytest.approx(expected, rel=1e-3)


def test_the_error_of_the_evidence_shows_disagreement_luck_and_drift():
    values = np.random.default_rng(0).standard_normal((RUNS, 250, 1))
    disagreeing = np.random.default_rng(1).normal(0.0, 0.05, (3, RUNS))
    draws = made_draws(values, disagreeing)
    assert draws.log_evidence == pytest.approx(np.log(np.mean(np.exp(disagreeing.sum(0)))))
    expected = disagreeing.sum(0).std(ddof=1) / np.sqrt(RUNS) * stats.t(RUNS - 1).ppf(stats.norm.cdf(1))
    by_temperature = np.sqrt(disagreeing.var(1, ddof=1).sum() / RUNS)
    # The jackknife of a logarithm equals the plain standard error to first order in the spread of 0.1.
    assert draws.log_evidence_error == pytest.approx(max(expected, by_temperature), rel=0.1)

    agreeing_by_luck = np.stack([disagreeing[0], -disagreeing[0], np.zeros(RUNS)])
    lucky = made_draws(values, agreeing_by_luck)
    assert lucky.log_evidences == pytest.approx(0.0)
    assert lucky.log_evidence_error == pytest.approx(np.sqrt(2 * disagreeing[0].var(ddof=1) / RUNS))

    drifting = made_draws(values, disagreeing, np.full((3, RUNS), 0.2))
    assert drifting.log_evidence_error == pytest.approx(0.6)
    assert "standard error of the log evidence is 0.60" in drifting.verdict


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"runs": 3}, "runs: 3"),
        ({"particles": 200}, "particles: 200"),
        ({"particles": 2001}, "not a multiple"),
        ({"max_sweeps": 0}, "max_sweeps: 0"),
        ({"seed": -1}, "seed: -1"),
        ({"ess_fraction": 0.95}, "ess_fraction: 0.95"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        SmcSettings(**changes)


def test_what_does_not_fit_is_refused():
    draws = uniform_draws([0.0, 0.0], [1.0, 1.0], 400)
    settings = SmcSettings(400)

    def sample(log_likelihood=flat, log_prior=flat, draws=draws, **options):
        return sample_smc(log_likelihood, log_prior, [0.0, 0.0], [1.0, 1.0], draws, settings, **options)

    with pytest.raises(InputError, match=r"shape \(399, 2\); \(400, 2\)"):
        sample(draws=draws[1:])
    with pytest.raises(InputError, match="prior draw 7 is"):
        sample(draws=np.where(np.arange(400)[:, None] == 7, 1.5, draws))
    with pytest.raises(InputError, match="names"):
        sample(names=["one"])
    with pytest.raises(InputError, match="log prior is -inf at prior draw"):
        sample(log_prior=lambda x: jnp.where(x[0] < 0.5, -jnp.inf, 0.0))
    with pytest.raises(ConvergenceError, match="zero at all 50 prior draws"):
        sample(log_likelihood=lambda x: -jnp.inf)
