"""The posterior of emulated models beside closed forms, quadrature, another sampler, and simulation."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import binom, multivariate_normal, norm

import tissuq as tq
from forward_models import DEPTH, OGDEN, designed, neo_hooke, ogden
from marks import slow_but
from tissuq.emulation import emulate
from tissuq.emulation.likelihood import Likelihood
from tissuq.emulation.problem import pose
from tissuq.emulation.sampling import sample_posterior
from tissuq.errors import InputError, ModelError
from tissuq.model.discrepancy import PinnedProcess
from tissuq.result_warning import symbols_in

TRUTH = {"mu": 1.5, "alpha": -9.0}


def measured(function, truth, noise, seed=0):
    return function(truth) + noise * np.random.default_rng(seed).standard_normal(len(DEPTH))


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", slow_but(["none", "gp-pinned"], ["none", "gp", "gp-pinned"]))
def test_the_density_is_that_of_a_gaussian_with_all_three_errors(discrepancy):
    data = measured(ogden, TRUTH, 0.02)
    emulator = emulate(designed(ogden, OGDEN, 8), DEPTH)
    likelihood = Likelihood(pose(DEPTH, data, OGDEN, discrepancy, "unknown"), emulator)
    own = {"none": [], "gp": [0.3, 0.2], "gp-pinned": [0.3, 0.2]}[discrepancy]
    values = np.array([1.4, -8.0, *own, 0.03])
    mean, cov = (each[0] for each in emulator.moments(values[None, :2]))
    s = DEPTH[:, None] / 0.2
    apart = np.exp(-0.5 * (s - s.T) ** 2)
    kernel = {"none": 0.0, "gp": apart, "gp-pinned": apart - np.exp(-0.5 * (s**2 + s.T**2)) * (1 + s * s.T)}
    cov = cov + 0.3**2 * kernel[discrepancy] + 0.03**2 * np.eye(len(DEPTH))
    expected = multivariate_normal(mean, cov, allow_singular=True).logpdf(data)
    assert likelihood.log_density(values[None])[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_a_proportional_model_gives_the_closed_form():
    data = measured(neo_hooke, {"C10": 1.2}, 0.05)
    priors = {"C10": tq.Normal(1.0, 0.4)}
    found = tq.calibrate(DEPTH, data, neo_hooke, priors, discrepancy="none", noise_sd=0.05, runs=8)
    column = neo_hooke({"C10": 1.0})
    precision = 0.4**-2 + column @ column / 0.05**2
    mean = (1.0 / 0.4**2 + column @ data / 0.05**2) / precision
    own = found.marginals["C10"]
    assert own.mean == pytest.approx(mean, abs=0.02 * precision**-0.5)
    assert own.sd == pytest.approx(precision**-0.5, rel=0.02)
    cov = 0.05**2 * np.eye(len(DEPTH)) + 0.4**2 * np.outer(column, column)
    assert found.log_evidence == pytest.approx(multivariate_normal(column, cov).logpdf(data), abs=0.02)
    assert found.emulator_share["C10"] < 0.02
    band = found.predict(noise=False)
    sd = np.abs(column) * precision**-0.5
    np.testing.assert_allclose(band["mean"], column * mean, atol=0.12 * sd.max())
    np.testing.assert_allclose(band["high"] - band["low"], 2 * norm.ppf(0.975) * sd, rtol=0.06)


@pytest.mark.slow
def test_what_two_samples_differ_by_is_not_owed_to_the_emulator():
    """The share is that which the same draws have, weighted as if the emulator were exact."""
    data, emulator = measured(ogden, TRUTH, 0.02), emulate(designed(ogden, OGDEN, 16), DEPTH)
    found = tq.calibrate(DEPTH, data, ogden, OGDEN, noise_sd="unknown", emulator=emulator)
    draws = found.draws(8192)
    exact = Likelihood(found.problem, emulator, has_error=False)
    weights = np.exp(exact.log_density(draws) - found.likelihood.log_density(draws))
    for place, symbol in enumerate(found.problem.symbols):
        shares = 1 - np.cov(draws[:, place], aweights=weights) / draws[:, place].var()
        assert found.emulator_share[symbol] == pytest.approx(max(0.0, float(shares)), abs=0.002)


@pytest.mark.slow
def test_two_parameters_and_a_few_runs_agree_with_brute_force_quadrature():
    data = measured(ogden, TRUTH, 0.2)
    emulator = emulate(designed(ogden, OGDEN, 9), DEPTH)
    found = tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", noise_sd=0.2, emulator=emulator)
    mu, alpha = np.meshgrid(np.linspace(0.7, 2.4, 60), np.linspace(-13, -5.5, 60), indexing="ij")
    mean, cov = emulator.moments(np.column_stack([mu.ravel(), alpha.ravel()]))
    cov = cov + 0.2**2 * np.eye(len(DEPTH))
    score = np.linalg.solve(cov, (data - mean)[..., None])[..., 0]
    logs = -0.5 * ((data - mean) * score).sum(axis=1) - 0.5 * np.linalg.slogdet(2 * np.pi * cov)[1]
    weights = np.exp(logs - logs.max()).reshape(mu.shape)
    for symbol, grid in (("mu", mu), ("alpha", alpha)):
        centre = (weights * grid).sum() / weights.sum()
        sd = np.sqrt((weights * (grid - centre) ** 2).sum() / weights.sum())
        own = found.marginals[symbol]
        assert own.mean == pytest.approx(centre, abs=0.03 * sd)
        assert own.sd == pytest.approx(sd, rel=0.03)
    cell = (2.4 - 0.7) / 59 * (13 - 5.5) / 59 / (4.8 * 24)
    assert found.log_evidence == pytest.approx(np.log(weights.sum() * cell) + logs.max(), abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", slow_but(["gp"], ["gp", "gp-pinned"]))
def test_a_process_beside_the_model_agrees_with_the_exact_posterior_on_a_dense_grid(discrepancy):
    """The grid computes the model itself, which is linear in mu; the emulator has 40 runs of it.

    Means are off by no more than 0.06 sd, and sds by 6 %, where nothing is wrong. Half the variance of the process
    moves the mean of c by more than is allowed.
    """
    priors = {"mu": tq.Uniform(0.5, 3.0), "alpha": tq.Uniform(-20.0, -2.0)}
    data = ogden(TRUTH) * (1 + 2 * DEPTH**2) + 0.05 * np.random.default_rng(3).standard_normal(len(DEPTH))
    found = tq.calibrate(DEPTH, data, ogden, priors, discrepancy=discrepancy, noise_sd=0.05, runs=40)
    middles, alpha = (np.arange(60) + 0.5) / 60, np.linspace(-13.5, -7.0, 300)
    columns = np.array([data, *(ogden({"mu": 1.0, "alpha": value}) for value in alpha)]).T
    # the priors that are documented: uniform to the largest measurement, and 0.02 to 3 times the range of the controls
    c, psi = data.max() * middles**3, np.ptp(DEPTH) * (0.02 + 2.98 * middles**1.5)
    logs, mean_mu, precision = (np.empty((len(c), len(psi), len(alpha))) for _ in range(3))
    for k, length in enumerate(psi):
        s = DEPTH[:, None] / length
        kernel = np.exp(-0.5 * (s - s.T) ** 2)
        if discrepancy == "gp-pinned":
            kernel -= np.exp(-0.5 * (s**2 + s.T**2)) * (1 + s * s.T)
        for i, amplitude in enumerate(c):
            root = np.linalg.cholesky(amplitude**2 * kernel + 0.05**2 * np.eye(len(s)))
            whitened = np.linalg.solve(root, columns)
            precision[i, k] = (whitened[:, 1:] ** 2).sum(axis=0)
            mean_mu[i, k] = whitened[:, 0] @ whitened[:, 1:] / precision[i, k]
            logs[i, k] = 0.5 * (precision[i, k] * mean_mu[i, k] ** 2 - whitened[:, 0] @ whitened[:, 0])
            logs[i, k] -= 0.5 * np.log(precision[i, k]) + np.log(np.diag(root)).sum()
    logs += 2 * np.log(middles)[:, None, None] + 0.5 * np.log(middles)[:, None]  # widths of the cells
    weights = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    exact = {"mu": (mean_mu, 1 / precision), "alpha": (alpha, 0.0), "c": (c[:, None, None], 0.0),
             "psi": (psi[:, None], 0.0)}  # fmt: skip
    for symbol, (values, variance) in exact.items():
        mean = (weights * values).sum()
        sd = np.sqrt((weights * ((values - mean) ** 2 + variance)).sum())
        assert found.marginals[symbol].mean == pytest.approx(mean, abs=0.2 * sd)
        assert found.marginals[symbol].sd == pytest.approx(sd, rel=0.1)


def test_parameters_that_act_by_their_product_lie_all_along_its_hyperbola():
    """Of a b = B under uniform priors the density of a is as 1 / a; half of the hyperbola had been missed."""

    def force(parameters, depth):
        return parameters["a"] * parameters["b"] * depth * np.exp(parameters["c"] * depth)

    depth, truth = np.linspace(0.1, 1, 12), {"a": 1.0, "b": 1.0, "c": 0.5}
    data = force(truth, depth) + 0.003 * np.random.default_rng(0).standard_normal(12)
    priors = dict.fromkeys(truth, tq.Uniform(0.2, 3.0))
    found = tq.calibrate(depth, data, force, priors, discrepancy="none", noise_sd=0.003, runs=40)
    low, high = 1 / 3.0, 3.0
    mean, square = ((high**power - low**power) / power / np.log(high / low) for power in (1, 2))
    for symbol in ("a", "b"):
        assert found.marginals[symbol].mean == pytest.approx(mean, abs=0.05)
        assert found.marginals[symbol].sd == pytest.approx(np.sqrt(square - mean**2), abs=0.05)


@pytest.mark.slow
def test_importance_sampling_and_nuts_agree():
    data = measured(neo_hooke, {"C10": 1.2}, 0.05)
    problem = pose(DEPTH, data, {"C10": tq.Uniform(0.2, 5.0)})
    likelihood = Likelihood(problem, emulate(designed(neo_hooke, problem.forward_priors, 8), DEPTH))
    one, other = (sample_posterior(likelihood, 0, method) for method in ("importance", "nuts"))
    assert one.converged
    assert other.converged
    for symbol in ("C10", "noise_sd"):
        first, second = one.marginals[symbol], other.marginals[symbol]
        assert first.mean == pytest.approx(second.mean, abs=0.1 * first.sd)  # 4 standard errors of NUTS's mean
        assert first.sd == pytest.approx(second.sd, rel=0.1)
        assert other.rhat[symbol] < 1.01


def test_a_wrong_model_does_not_take_the_initial_stiffness_unless_it_is_said_to_be_right():
    emulator = emulate(designed(neo_hooke, {"C10": tq.Uniform(0.2, 5.0)}, 8), DEPTH)
    wrong = measured(lambda p: neo_hooke(p) * (1 + DEPTH), {"C10": 1.2}, 0.01)
    options = {"priors": {"C10": tq.Uniform(0.2, 5.0)}, "noise_sd": 0.01, "emulator": emulator}
    found = tq.calibrate(DEPTH, wrong, neo_hooke, **options)
    low, high = found.marginals["C10"].hdi()
    assert found.problem.discrepancy.name == "gp-pinned"
    assert low < 1.2 < high
    assert not [warning for warning in found.warnings if warning.code == "no-discrepancy"]
    taken_for_right = tq.calibrate(DEPTH, wrong, neo_hooke, **options, discrepancy="none")
    assert taken_for_right.marginals["C10"].hdi()[0] > 1.2
    assert [warning for warning in taken_for_right.warnings if warning.code == "no-discrepancy"]


def test_data_in_another_unit_are_no_discrepancy():
    priors = {"C10": tq.Uniform(0.2, 5.0)}
    emulator = emulate(designed(neo_hooke, priors, 8), DEPTH)
    data = measured(neo_hooke, {"C10": 1.2}, 0.01)
    for factor, noise_sd in ((1, "unknown"), (1e3, "unknown"), (1e-3, 1e-5)):
        found = tq.calibrate(DEPTH, factor * data, neo_hooke, priors, noise_sd=noise_sd, emulator=emulator)
        assert any(warning.code == "unmodelled-curve" for warning in found.warnings) == (factor != 1)


@pytest.mark.slow
def test_the_discrepancy_is_conditioned_on_the_data():
    wrong = measured(lambda p: neo_hooke(p) * (1 + 3 * DEPTH**2), {"C10": 1.2}, 0.01)
    found = tq.calibrate(DEPTH, wrong, neo_hooke, {"C10": tq.Uniform(0.2, 5.0)}, discrepancy="gp-pinned",
                         noise_sd=0.01, runs=8)  # fmt: skip
    assert found.predictive_coverage() > 0.9
    assert found.predictive_coverage(discrepancy=False) <= found.predictive_coverage()
    values = found.draws(200)
    mean, variance = found.likelihood.predictions(values, discrepancy=True, noise=False)
    C10, c, psi = values[17]
    process = PinnedProcess(references=(0.0,)).kernel(0, DEPTH, DEPTH, {"c": c, "psi": psi}) * c**2
    gain = process @ np.linalg.inv(process + 0.01**2 * np.eye(len(DEPTH)))
    model = neo_hooke({"C10": C10})
    np.testing.assert_allclose(mean[17], model + gain @ (wrong - model), atol=1e-4)
    np.testing.assert_allclose(variance[17], np.diag(process - gain @ process), atol=1e-6)


@pytest.mark.statistical  # quick: the errors that an emulator states, in test_emulator.py
def test_intervals_hold_the_truth_as_often_as_they_say_with_few_runs_and_the_emulator_knows_why():
    """Truths from the prior, an emulator of seven runs each.

    A correct 95 % fails this once in 1e4; without the emulator's error there are fewer than a correct 95 % has but
    once in 1e4.
    """
    generator, inside, exact, count = np.random.default_rng(11), [], [], 20
    for number in range(count):
        truth = {symbol: float(prior.quantile(generator.random())) for symbol, prior in OGDEN.items()}
        emulator = emulate(designed(ogden, OGDEN, 7, seed=number), DEPTH)
        noise = 1e-3 * ogden(truth).max()
        data = measured(ogden, truth, noise, seed=number)
        found = tq.calibrate(
            DEPTH, data, ogden, OGDEN, discrepancy="none", noise_sd=noise, emulator=emulator, seed=number
        )
        for each, results in ((found, inside), (found.without_emulator_error, exact)):
            low, high = each.marginals["alpha"].hdi()
            results.append(low <= truth["alpha"] <= high)
    assert sum(inside) >= binom.ppf(1e-4, count, 0.95)
    assert sum(exact) < binom.ppf(1e-4, count, 0.95)


@pytest.mark.slow
def test_further_runs_are_made_where_the_posterior_is_until_the_emulator_is_good_enough():
    data = measured(ogden, TRUTH, 0.02)
    few = tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", noise_sd=0.02, runs=8)
    more = tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", noise_sd=0.02, runs=8, refine=24)
    assert more.error_ratio < 0.02 < few.error_ratio
    assert 8 < len(more.runs) < 8 + 24
    added = more.runs.points[8:]
    assert np.abs(added[:, 1] - -9.0).max() < 3.0  # of a prior 24 wide
    assert len(more.held_out) == len(added) / 4
    np.testing.assert_array_equal(more.runs.points[:8], few.runs.points)


@pytest.mark.slow
def test_further_runs_keep_away_from_those_that_failed():
    """The measurements lie where the model fails; without a word of it the same points would be run again and again."""
    priors, depth = {"mu": tq.Uniform(0.1, 1.0), "b": tq.Uniform(0.5, 3.0)}, np.linspace(0.1, 1, 10)

    def stiffening(parameters):
        mu, b = parameters["mu"], parameters["b"]
        return mu * (np.sin(3 * b) * np.expm1(b * depth) + depth)

    def failing(parameters):
        if parameters["b"] > 2.2:
            raise RuntimeError("no convergence")
        return stiffening(parameters)

    data = stiffening({"mu": 0.4, "b": 2.3}) + 0.01 * np.random.default_rng(1).standard_normal(10)
    found = tq.calibrate(depth, data, failing, priors, discrepancy="none", noise_sd=0.01, runs=12, refine=4)
    assert len(found.runs) == 16
    assert len(np.unique(found.runs.points, axis=0)) == 16


@pytest.mark.slow
def test_a_likelihood_by_itself_is_computed_in_double_precision():
    code = """
import numpy as np
import tissuq as tq
from tissuq.emulation import emulate, gathered
from tissuq.emulation.likelihood import Likelihood
from tissuq.emulation.problem import pose
column, points, at = np.linspace(0.5, 1.5, 5), np.linspace(0.5, 2, 12), np.array([[1.2]])
outputs = [c * (1 + 0.1 * c) * column for c in points]
results = [{"parameters": {"C10": c}, "outputs": y, "error": "", "seconds": 0} for c, y in zip(points, outputs)]
emulator = emulate(gathered(["C10"], results, 5), column)
measured = 1.2 * 1.12 * column + 1e-3
problem = pose(column, measured, {"C10": tq.Uniform(0.5, 2)}, "none", noise_sd=1e-3)
found = Likelihood(problem, emulator).log_density(at)[0]
mean, cov = (each[0] for each in emulator.moments(at))
apart, cov = measured - mean, cov + 1e-6 * np.eye(5)
print(found + 0.5 * apart @ np.linalg.solve(cov, apart) + 0.5 * np.linalg.slogdet(2 * np.pi * cov)[1])
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert abs(float(found.stdout)) < 1e-6


@pytest.mark.slow
def test_the_search_does_not_end_where_the_emulator_knows_nothing():
    """The logarithm of b reaches far beyond the runs, where anything is possible: a decoy beside a narrow posterior."""
    priors = {"k": tq.Uniform(0.1, 4.0), "b": tq.Uniform(0.0, 2.0)}

    def spring(parameters):
        return parameters["k"] * (DEPTH + 3 * parameters["b"] * DEPTH**2)

    emulator = emulate(designed(spring, priors, 12), DEPTH)
    data = measured(spring, {"k": 1.5, "b": 0.8}, 0.001)
    found = tq.calibrate(DEPTH, data, spring, priors, discrepancy="none", noise_sd=0.001, emulator=emulator)
    assert abs(found.marginals["k"].mean - 1.5) < 0.05
    assert abs(found.marginals["b"].mean - 0.8) < 0.1


@pytest.mark.slow
def test_warnings_tell_a_poor_emulator_and_a_narrow_prior():
    data = measured(ogden, TRUTH, 0.001)
    poor = tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", noise_sd=0.001, runs=7)
    assert any("emulator's error is large beside the noise" in text for text in poor.warnings)
    data = measured(neo_hooke, {"C10": 1.2}, 0.02)
    found = tq.calibrate(
        DEPTH, data, neo_hooke, {"C10": tq.Uniform(0.2, 1.18)}, discrepancy="none", noise_sd=0.02, runs=6
    )
    assert any("reaches the bound of the prior of C10 (upper)" in text for text in found.warnings)
    assert symbols_in(found.warnings, "prior-bound") == ("C10",)


def test_a_parameter_that_the_model_does_not_use_is_named_and_one_that_is_hardly_known_is_not():
    priors = {"C10": tq.Uniform(0.2, 5.0), "c10": tq.Uniform(0.2, 5.0)}
    data = measured(neo_hooke, {"C10": 1.2}, 0.02)
    found = tq.calibrate(DEPTH, data, neo_hooke, priors, discrepancy="none", noise_sd=0.02, runs=10)
    (text,) = [text for text in found.warnings if "hardly depends on" in text]
    assert text.startswith("the model hardly depends on c10, and")
    both = tq.calibrate(
        DEPTH,
        data,
        lambda p: neo_hooke({"C10": p["C10"] + 0.1 * p["c10"]}),
        priors,
        discrepancy="none",
        noise_sd=0.02,
        runs=10,
    )
    assert not any("hardly depends on" in text for text in both.warnings)


@pytest.mark.slow
def test_an_emulator_that_hides_what_the_measurements_tell_is_told_and_no_parameter_said_to_have_no_effect():
    """The outputs differ by powers of ten over the priors, so that what k does is nothing beside them.

    With the emulator's error and without it the posterior is about the prior: neither is wider than the other.
    """
    depth = np.linspace(0.1, 1.0, 12)
    priors = {"mu": tq.HalfNormal(3), "b": tq.LogNormal(1.0, 1.0), "k": tq.Normal(0, 1)}

    def exponential(parameters):
        return parameters["mu"] * np.expm1(parameters["b"] * depth) + parameters["k"] * depth**2

    noise = 0.02 * np.random.default_rng(5).standard_normal(12)
    data = exponential({"mu": 0.4, "b": 1.5, "k": 0.3}) + noise
    found = tq.calibrate(depth, data, exponential, priors, discrepancy="none", noise_sd=0.02, runs=40, seed=1)
    assert found.error_ratio > 1000
    assert any("the emulator's error is large" in text for text in found.warnings)
    assert not any("hardly depends on" in text for text in found.warnings)


@pytest.mark.parametrize(("zero_load", "is_told"), slow_but([(0.0, True)], [(0.0, True), (1.0, False)]))
def test_a_process_pinned_far_from_the_measurements_is_told(zero_load, is_told):
    stretch = np.linspace(1.02, 1.3, 8)

    def tension(parameters, stretch):
        return 2 * parameters["C10"] * (stretch - stretch**-2)

    data = tension({"C10": 1.2}, stretch) + 0.02 * np.random.default_rng(2).standard_normal(8)
    usual = {"forward": tension, "priors": {"C10": tq.Uniform(0.2, 5.0)}, "noise_sd": 0.02, "runs": 8}
    found = tq.calibrate(stretch, data, **usual, discrepancy="gp-pinned", zero_load=zero_load)
    assert len([text for text in found.warnings if "of stretches --zero-load 1" in text]) == is_told


@pytest.mark.slow
def test_measurements_that_no_parameters_give_are_told():
    """The model is proportional to C10: beyond the prior's end, or of another shape, nothing comes near."""
    priors = {"C10": tq.Uniform(0.2, 1.0)}
    emulator = emulate(designed(neo_hooke, priors, 8), DEPTH)
    words = "no parameters that the priors allow give the measurements"
    for data, is_told in (
        (measured(neo_hooke, {"C10": 0.6}, 0.02), False),
        (measured(neo_hooke, {"C10": 2.0}, 0.02), True),
        (measured(lambda p: neo_hooke(p) * (1 + 5 * DEPTH), {"C10": 0.4}, 0.02), True),
    ):
        found = tq.calibrate(DEPTH, data, neo_hooke, priors, discrepancy="none", noise_sd=0.02, emulator=emulator)
        told = [text for text in found.warnings if words in text]
        assert len(told) == is_told
    unknown = tq.calibrate(DEPTH, 3 * neo_hooke({"C10": 1.0}), neo_hooke, priors, discrepancy="none", emulator=emulator)
    (text,) = [text for text in unknown.warnings if words in text]
    assert "15 of 15 measurements are beyond the outputs of all runs" in text
    admitted = tq.calibrate(DEPTH, data, neo_hooke, priors, noise_sd=0.02, emulator=emulator, discrepancy="gp-pinned")
    assert not any(words in text for text in admitted.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.02, "unknown"])
def test_where_no_parameters_fit_the_nearest_run_is_named_and_no_shift_of_means(noise):
    """A force that falls with the depth, which within its range no parameters of the model do."""
    data = 2.0 - 5.0 * DEPTH + 0.02 * np.random.default_rng(3).standard_normal(len(DEPTH))
    found = tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", noise_sd=noise, runs=20)
    (text,) = [text for text in found.warnings if "no parameters that the priors allow" in text]
    points, outputs = found.runs.good
    off = np.sqrt(((outputs - data) ** 2).mean(axis=1))
    values = ", ".join(f"{name} {value:.3g}" for name, value in zip(OGDEN, points[off.argmin()], strict=True))
    assert f"Of 20 runs the nearest ({values}) is off by {off.min():.3g} (root mean square)" in text
    assert "emulator's error is large beside the noise" not in " ".join(found.warnings)
    for marginal in found.marginals.values():
        assert marginal.hdi()[0] < marginal.mean < marginal.hdi()[1]


@pytest.mark.slow
def test_a_small_error_of_the_model_is_left_to_an_unknown_noise():
    data = measured(ogden, TRUTH, 0.005) * (1 + 0.05 * np.sin(20 * DEPTH))
    found = tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", runs=16)
    assert not any("no parameters" in text for text in found.warnings)


@pytest.mark.slow
def test_the_table_of_runs_left_out_has_the_worst_first():
    found = tq.calibrate(DEPTH, measured(ogden, TRUTH, 0.05), ogden, OGDEN, discrepancy="none", noise_sd=0.05, runs=12)
    table, check = found.leave_one_out, found.check
    assert list(table.columns) == ["mu", "alpha", "error", "sd", "standardised"]
    assert table["error"].is_monotonic_decreasing
    assert np.sqrt((table["error"] ** 2).mean()) == pytest.approx(check.relative_error)
    assert np.sqrt((table["standardised"] ** 2).mean()) == pytest.approx(check.rms_standardised)
    worst = np.abs(check.computed - check.predicted).max(axis=1).argmax()
    assert table[["mu", "alpha"]].iloc[0].tolist() == check.points[worst].tolist()


@pytest.mark.slow
def test_measurements_are_simulated_together():
    """The mean of all is as uncertain as a Gaussian process given the data says, at one value of every parameter."""
    data = measured(neo_hooke, {"C10": 1.2}, 0.05)
    emulator = emulate(designed(neo_hooke, {"C10": tq.Uniform(0.5, 3.0)}, 8), DEPTH)
    likelihood = Likelihood(pose(DEPTH, data, {"C10": tq.Uniform(0.5, 3.0)}, "gp", 0.05), emulator)
    values = np.tile([1.2, 0.3, 0.5], (4000, 1))
    drawn = likelihood.replicates(values, np.random.default_rng(0).standard_normal((4000, len(DEPTH))))
    own = 0.3**2 * np.exp(-0.5 * ((DEPTH[:, None] - DEPTH) / 0.5) ** 2)
    pull = own @ np.linalg.inv(own + 0.05**2 * np.eye(len(DEPTH)))
    cov = own - pull @ own + 0.05**2 * np.eye(len(DEPTH))
    truth = neo_hooke({"C10": 1.2})
    np.testing.assert_allclose(drawn.mean(axis=0), truth + pull @ (data - truth), atol=5 * 0.07 / 4000**0.5)
    assert drawn.mean(axis=1).std() == pytest.approx(cov.mean() ** 0.5, rel=0.05)
    np.testing.assert_allclose(np.cov(drawn.T), cov, atol=5 * cov.max() * (2 / 4000) ** 0.5)


@pytest.mark.slow
def test_a_saved_calibration_is_read_by_xarray(tmp_path):
    import xarray as xr

    data = measured(neo_hooke, {"C10": 1.2}, 0.05)
    found = tq.calibrate(DEPTH, data, neo_hooke, {"C10": tq.Uniform(0.2, 5.0)}, discrepancy="none", runs=8)
    found.save(tmp_path / "found.nc")
    tree = xr.open_datatree(tmp_path / "found.nc", engine="h5netcdf")
    assert tree["posterior"]["C10"].dims == ("chain", "draw")
    assert float(tree["posterior"]["C10"].mean()) == pytest.approx(found.marginals["C10"].mean, rel=1e-3)
    simulated = tree["posterior_predictive"]["measured"]
    band = found.predict()
    assert np.abs(simulated.mean(("chain", "draw")) - band["mean"]).max() < 0.2 * (band["high"] - band["low"]).max()
    assert tree["forward_runs"]["outputs"].shape == (8, len(DEPTH))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"control": DEPTH[:4]}, "4 controls and 15 measured"),
        ({"measured": np.zeros_like(DEPTH)}, "measured values are zero"),
        ({"measured": [1.0, np.nan] * 8, "control": np.arange(16)}, "measured is nan at position 1"),
        ({"priors": {}}, "give a prior for every parameter"),
        ({"priors": [tq.Uniform(0, 5)]}, "priors must be by parameter"),
        ({"priors": {"C10": tq.Flat()}}, "flat and improper"),
        ({"priors": {"C10": 3.0}}, "must be a prior"),
        ({"priors": {"C10": tq.Uniform(0.2, 5.0), "noise_sd": tq.Uniform(0, 1)}}, r"prior of noise_sd .* \(0.1\)"),
        ({"noise_sd": -1.0}, "noise_sd must be a positive number"),
        ({"discrepancy": "auto"}, "'auto' cannot be used with a forward model"),
        ({"forward": 3}, "must be a function"),
        ({"forward": lambda parameters: [1.0, 2.0]}, r"shape \(2,\); there are 15 measurements"),
        ({"forward": lambda parameters: "words"}, "no array of numbers"),
        ({"runs": 3}, "needs 6 runs or more, and 3 are requested"),
        ({"rnus": 3}, "no option 'rnus'"),
        ({"refine": -1}, "further runs"),
        ({"workers": 2, "forward": lambda parameters: DEPTH}, "cannot be sent to other processes"),
        ({"workers": 0}, "workers must be at least 1"),
        ({"method": "guess"}, "method must be one of"),
    ],
)
def test_what_does_not_fit_is_told(changes, words):
    usual = {"control": DEPTH, "measured": neo_hooke({"C10": 1.0}), "forward": neo_hooke,
             "priors": {"C10": tq.Uniform(0.2, 5.0)}, "noise_sd": 0.1, "runs": 8}  # fmt: skip
    with pytest.raises((InputError, ModelError), match=words):
        tq.calibrate(**(usual | changes))


def test_an_emulator_of_other_controls_or_parameters_is_refused():
    emulator = emulate(designed(neo_hooke, {"C10": tq.Uniform(0.2, 5.0)}, 8), DEPTH)
    data = neo_hooke({"C10": 1.0})
    with pytest.raises(InputError, match="other controls"):
        tq.calibrate(2 * DEPTH, data, neo_hooke, {"C10": tq.Uniform(0.2, 5.0)}, discrepancy="none", emulator=emulator)
    with pytest.raises(InputError, match="emulator is one of C10"):
        tq.calibrate(DEPTH, data, ogden, OGDEN, discrepancy="none", emulator=emulator)


@pytest.mark.parametrize("prior", [tq.HalfNormal(2.0), tq.Normal(1.0, 2.0), tq.LogNormal(1.0, 0.5), tq.Uniform(0, 3)])
def test_scores_of_heavy_tails_are_finite_parameters(prior):
    """A half-normal prior once gave infinite ones, and a marginal that could not be drawn."""
    problem = pose(np.ones(2), np.ones(2), {"a": prior}, noise_sd=0.1)
    values = problem.values_of(np.array([[-60.0], [-9.0], [0.0], [9.0], [60.0]]))[:, 0]
    assert np.isfinite(values).all()
    assert (np.diff(values) >= 0).all()
    assert values[2] == pytest.approx(prior.quantile(0.5))


@pytest.mark.parametrize("seed", range(4))
def test_a_posterior_like_its_prior_is_not_beyond_the_runs_that_lie_as_it_does(seed):
    """Of 8 runs either end leaves out about a sixteenth of the prior, and of the posterior as much."""
    data = neo_hooke({"C10": 2.0})
    noise_sd = 0.2 * float(np.linalg.norm(neo_hooke({"C10": 1.0})))  # says as much as a prior with the sd 0.2, or 10 %
    found = tq.calibrate(
        DEPTH,
        data,
        neo_hooke,
        {"C10": tq.LogNormal(2.0, 0.05)},
        discrepancy="none",
        noise_sd=noise_sd,
        runs=8,
        seed=seed,
    )
    draws, runs = found.draws(2000)[:, 0], found.runs.points
    assert max(np.mean(draws < runs.min()), np.mean(draws > runs.max())) > 0.02
    assert not any("beyond the runs" in text for text in found.warnings)


@pytest.mark.slow
def test_a_posterior_beyond_all_runs_is_told_as_such_and_not_as_the_bound_of_a_prior():
    data = measured(neo_hooke, {"C10": 1.2}, 0.02)
    found = tq.calibrate(
        DEPTH, data, neo_hooke, {"C10": tq.LogNormal(2.0, 0.05)}, discrepancy="none", noise_sd=0.02, runs=6
    )
    assert any("lies beyond the runs of the model in C10 (lower)" in text for text in found.warnings)
    assert not any("bound of the prior" in text for text in found.warnings)


def test_an_emulator_of_narrower_priors_is_told_where_it_extrapolates():
    """Runs with C10 up to 1, and a posterior at 2.5 of a prior up to 5: nothing was said."""
    emulator = emulate(designed(neo_hooke, {"C10": tq.Uniform(0.2, 1.0)}, 8), DEPTH)
    for C10, is_told in ((2.5, True), (0.7, False)):
        data = measured(neo_hooke, {"C10": C10}, 0.02)
        found = tq.calibrate(
            DEPTH, data, neo_hooke, {"C10": tq.Uniform(0.2, 5.0)}, discrepancy="none", noise_sd=0.02, emulator=emulator
        )
        assert any("lies beyond the runs of the model in C10 (upper)" in text for text in found.warnings) == is_told
