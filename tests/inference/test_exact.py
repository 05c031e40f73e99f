"""The exact route against brute force, closed forms and dense linear algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm, truncnorm

import tissuq as tq
from marks import slow_but
from oracle import FORMULATIONS, brute_force
from tissuq.inference.enumerators.adaptive_cells import AdaptiveCells
from tissuq.inference.linear import ConditionalGaussian
from tissuq.inference.reduction import RememberedBases
from tissuq.mechanics import NeoHookean, Yeoh, material_named, stress_basis
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.statistical_model import StatisticalModel

TRUTH = {"C10": 1.2, "C20": -0.057, "C30": 0.004}


def fitted(settings, formulation, **options):
    return tq.fit(
        settings.experiment(),
        discrepancy=formulation,
        noise_sd=settings.noise_sd,
        priors=settings.priors_of(formulation),
        **options,
    )


@pytest.mark.parametrize("formulation", slow_but({*FORMULATIONS} - {"quadratic"}, FORMULATIONS))
def test_every_formulation_of_the_paper_agrees_with_brute_force(paper, boxes, formulation):
    data = paper.experiment()
    truth = brute_force(formulation, data.stretch, data.stress, paper.noise_sd, boxes)
    posterior = fitted(paper, formulation)
    c10 = posterior.solution.marginals["C10"]
    low, high = c10.hdi()
    assert posterior.log_evidence == pytest.approx(truth.log_evidence, abs=1e-4)
    assert c10.mean == pytest.approx(truth.mean, abs=0.01 * truth.sd)
    assert c10.sd == pytest.approx(truth.sd, rel=0.01)
    assert low == pytest.approx(truth.hpd_low, abs=0.03 * truth.sd)
    assert high == pytest.approx(truth.hpd_high, abs=0.03 * truth.sd)
    for symbol, mean in truth.means.items():
        assert posterior.solution.marginals[symbol].mean == pytest.approx(mean, abs=0.03 * truth.sds[symbol])
        assert posterior.solution.marginals[symbol].sd == pytest.approx(truth.sds[symbol], rel=0.02)


@pytest.mark.parametrize("formulation", ["constant", "linear", "yeoh"])
def test_six_points_whose_wide_posterior_meets_the_bounds_agree_with_brute_force(paper, boxes, formulation):
    few = paper.model_copy(update={"points": 6})
    data = few.experiment()
    truth = brute_force(formulation, data.stretch, data.stress, few.noise_sd, boxes)
    posterior = fitted(few, formulation)
    c10 = posterior.solution.marginals["C10"]
    assert posterior.log_evidence == pytest.approx(truth.log_evidence, abs=1e-3)
    assert c10.mean == pytest.approx(truth.mean, abs=0.02 * truth.sd)
    assert c10.sd == pytest.approx(truth.sd, rel=0.02)
    assert c10.hdi() == pytest.approx((truth.hpd_low, truth.hpd_high), abs=0.05 * truth.sd)


def test_the_oracle_would_see_a_noise_that_is_a_tenth_wrong(paper, boxes):
    data = paper.experiment()
    wrong = brute_force("yeoh", data.stretch, data.stress, 1.1 * paper.noise_sd, boxes)
    assert abs(fitted(paper, "yeoh").log_evidence - wrong.log_evidence) > 0.1


def test_gaussian_priors_give_the_analytic_evidence_and_posterior():
    stretch = np.linspace(0.5, 3, 25)
    data = tq.simulate("yeoh", TRUTH, stretch, 0.3, seed=4)
    priors = {"C10": tq.Normal(3.0, 0.2), "C20": tq.Normal(0.0, 0.2), "C30": tq.Normal(0.01, 0.02)}
    posterior = tq.fit(data, material="yeoh", discrepancy="none", noise_sd=0.3, priors=priors)
    X = stress_basis(Yeoh(), data.mode.at(stretch))
    prior_mean, prior_covariance = np.array([3.0, 0.0, 0.01]), np.diag([0.2, 0.2, 0.02]) ** 2
    covariance = 0.3**2 * np.eye(25) + X @ prior_covariance @ X.T
    gain = prior_covariance @ X.T @ np.linalg.inv(covariance)
    mean = prior_mean + gain @ (data.stress - X @ prior_mean)
    sd = np.sqrt(np.diag(prior_covariance - gain @ X @ prior_covariance))
    evidence = multivariate_normal(X @ prior_mean, covariance).logpdf(data.stress)
    assert posterior.log_evidence == pytest.approx(evidence, abs=1e-7)
    table = posterior.summary()
    np.testing.assert_allclose(table["mean"], mean, rtol=1e-7)
    np.testing.assert_allclose(table["sd"], sd, rtol=1e-6)
    np.testing.assert_allclose(table["hdi_low"], mean - norm.ppf(0.975) * sd, atol=2e-3 * sd.min())
    np.testing.assert_allclose(table["hdi_high"], mean + norm.ppf(0.975) * sd, atol=2e-3 * sd.max())


def test_a_normal_prior_of_a_positive_parameter_is_cut_at_zero_and_normalised():
    stretch = np.linspace(0.8, 1.3, 8)
    data = tq.simulate("neo-hookean", {"C10": 0.1}, stretch, 0.5, seed=1)
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.5, priors={"C10": tq.Normal(0.1, 0.3)})
    grid = np.linspace(1e-12, 2, 40001)
    prior = truncnorm(-1 / 3, np.inf, 0.1, 0.3)
    x = 2 * (stretch - stretch**-2)
    density = np.exp(norm(0, 0.5).logpdf(data.stress - grid[:, None] * x).sum(axis=1) + prior.logpdf(grid))
    total = np.trapezoid(density, grid)
    assert posterior.log_evidence == pytest.approx(np.log(total), abs=1e-6)
    c10 = posterior.solution.marginals["C10"]
    assert c10.mean == pytest.approx(np.trapezoid(density * grid, grid) / total, rel=2e-3)


def test_data_that_push_c10_against_zero_give_the_truncated_normal():
    stretch = np.linspace(0.8, 1.5, 20)
    data = tq.Experiment("uniaxial", stretch, -0.2 * 2 * (stretch - stretch**-2) + 0.01)
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.5, priors={"C10": tq.Uniform(0, 10)})
    x = 2 * (stretch - stretch**-2)
    centre, sd = (x @ data.stress) / (x @ x), 0.5 / np.sqrt(x @ x)
    truth = truncnorm(-centre / sd, np.inf, centre, sd)
    evidence = (
        norm(0, 0.5).logpdf(data.stress - centre * x).sum()
        + np.log(np.sqrt(2 * np.pi) * sd * norm.cdf(centre / sd))
        - np.log(10)
    )
    c10 = posterior.solution.marginals["C10"]
    assert centre < 0
    assert posterior.log_evidence == pytest.approx(evidence, abs=1e-6)
    assert c10.mean == pytest.approx(truth.mean(), rel=0.01)
    assert c10.sd == pytest.approx(truth.std(), rel=0.01)
    assert c10.hdi() == pytest.approx((0.0, truth.ppf(0.95)), abs=0.03 * truth.std())
    assert (posterior.solution.draws["C10"] >= 0).all()


def test_a_bound_twenty_standard_deviations_away_is_still_right():
    stretch = np.linspace(0.8, 1.5, 20)
    x = 2 * (stretch - stretch**-2)
    sd = 0.02 / np.sqrt(x @ x)
    data = tq.Experiment("uniaxial", stretch, -20 * sd * x)
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.02, priors={"C10": tq.Uniform(0, 10)})
    truth = truncnorm(20, np.inf, -20 * sd, sd)
    assert posterior.solution.marginals["C10"].mean == pytest.approx(truth.mean(), rel=0.02)
    evidence = norm(0, 0.02).logpdf(data.stress + 20 * sd * x).sum() + np.log(np.sqrt(2 * np.pi) * sd) - np.log(10)
    assert posterior.log_evidence == pytest.approx(evidence + norm.logcdf(-20), abs=1e-6)


def test_unknown_noise_agrees_with_a_brute_force_grid():
    stretch = np.linspace(0.7, 2, 15)
    data = tq.simulate("neo-hookean", {"C10": 0.4}, stretch, 0.1, seed=2)
    priors = {"C10": tq.Uniform(0, 2), "noise_sd": tq.HalfNormal(0.5)}
    posterior = tq.fit(data, discrepancy="none", priors=priors, tolerances="as-tested")
    c10, sd = np.meshgrid(np.linspace(0.3, 0.5, 801), np.linspace(0.02, 0.6, 1201), indexing="ij")
    x = 2 * (stretch - stretch**-2)
    squares = (data.stress @ data.stress) - 2 * c10 * (x @ data.stress) + c10**2 * (x @ x)
    log_density = -0.5 * squares / sd**2 - 15 * np.log(sd * np.sqrt(2 * np.pi))
    log_density += -0.5 * (sd / 0.5) ** 2 + np.log(np.sqrt(2 / np.pi) / 0.5) - np.log(2)
    weights = np.exp(log_density - log_density.max())
    cell = (c10[1, 0] - c10[0, 0]) * (sd[0, 1] - sd[0, 0])
    assert posterior.log_evidence == pytest.approx(log_density.max() + np.log(weights.sum() * cell), abs=1e-4)
    for symbol, values in (("C10", c10), ("noise_sd", sd)):
        mean = (weights * values).sum() / weights.sum()
        spread = np.sqrt((weights * (values - mean) ** 2).sum() / weights.sum())
        marginal = posterior.solution.marginals[symbol]
        assert marginal.mean == pytest.approx(mean, abs=1e-3 * spread)
        assert marginal.sd == pytest.approx(spread, rel=1e-3)


@pytest.mark.slow
def test_a_gaussian_process_with_unknown_noise_agrees_with_dense_tensor_quadrature():
    stretch = np.linspace(0.8, 2, 12)
    data = tq.simulate("yeoh", TRUTH, stretch, 0.1, seed=5)
    priors = {
        "C10": tq.Uniform(0, 5),
        "c": tq.Uniform(0, 2),
        "psi": tq.Uniform(0.1, 3),
        "noise_sd": tq.Uniform(0, 1),
    }
    posterior = tq.fit(data, discrepancy="gp", priors=priors)
    nodes, node_weights = np.polynomial.legendre.leggauss(24)

    def rule(low, high):  # in the logarithm, where the posterior is smooth down to small values
        a, b = np.log(low), np.log(high)
        values = np.exp(0.5 * (a + b) + 0.5 * (b - a) * nodes)
        return values, 0.5 * (b - a) * node_weights * values

    (c, wc), (psi, wp), (sd, ws) = rule(1e-4, 2), rule(0.1, 3), rule(1e-3, 1)
    kernel = np.exp(-0.5 * ((stretch[:, None] - stretch) / psi[:, None, None]) ** 2)
    covariance = c[:, None, None, None, None] ** 2 * kernel[:, None] + sd[:, None, None] ** 2 * np.eye(12)
    covariance = covariance.reshape(-1, 12, 12)
    weights = (wc[:, None, None] * wp[:, None] * ws).ravel() / (2 * 2.9 * 1)
    x = 2 * (stretch - stretch**-2)
    solved = np.linalg.solve(covariance, np.stack([x, data.stress], axis=1)[None])
    xx, xy, yy = x @ solved[:, :, 0].T, x @ solved[:, :, 1].T, data.stress @ solved[:, :, 1].T
    centre, spread = xy / xx, xx**-0.5
    inside = norm.cdf((5 - centre) / spread) - norm.cdf(-centre / spread)
    log_density = -0.5 * (yy - xy**2 / xx + np.linalg.slogdet(covariance)[1] + 11 * np.log(2 * np.pi))
    log_density += np.log(spread) + np.log(np.maximum(inside, 1e-300)) - np.log(5)
    top = log_density.max()
    total = weights @ np.exp(log_density - top)
    assert posterior.log_evidence == pytest.approx(top + np.log(total), abs=2e-3)
    shares = weights * np.exp(log_density - top) / total
    for symbol, values in (("c", np.repeat(c, 24 * 24)), ("noise_sd", np.tile(sd, 24 * 24))):
        marginal = posterior.solution.marginals[symbol]
        mean = shares @ values
        assert marginal.mean == pytest.approx(mean, abs=0.01 * marginal.sd)


def test_a_prior_that_is_not_conjugate_is_integrated_numerically():
    stretch = np.linspace(0.7, 2, 15)
    data = tq.simulate("neo-hookean", {"C10": 0.4}, stretch, 0.3, seed=2)
    prior = tq.LogNormal(0.5, 0.7)
    posterior = tq.fit(data, discrepancy="none", noise_sd=0.3, priors={"C10": prior})
    grid = np.linspace(1e-4, 2, 20001)
    x = 2 * (stretch - stretch**-2)
    log_density = norm(0, 0.3).logpdf(data.stress - grid[:, None] * x).sum(axis=1) + prior.log_density(grid)
    weights = np.exp(log_density - log_density.max())
    assert posterior.model.nonlinear == ("C10",)
    evidence = log_density.max() + np.log(np.trapezoid(weights, grid))
    assert posterior.log_evidence == pytest.approx(evidence, abs=1e-5)
    mean = np.trapezoid(weights * grid, grid) / np.trapezoid(weights, grid)
    assert posterior.solution.marginals["C10"].mean == pytest.approx(mean, rel=1e-5)


def test_errors_that_no_sum_takes_are_refused_with_the_reason(paper):
    with pytest.raises(tq.ModelError, match=r"not independent along any fixed directions.*nuts"):
        tq.fit(paper.experiment(), discrepancy="gp", noise="proportional", method="exact")


@pytest.mark.parametrize("formulation", ["none", "quadratic", "yeoh", "gp"])
def test_the_unit_of_stress_does_not_matter(formulation):
    stretch = np.linspace(0.7, 2.5, 20)
    first = tq.simulate("yeoh", TRUTH, stretch, 0.1, seed=3)
    other = tq.Experiment("uniaxial", stretch, 1000 * first.stress)
    small, large = (tq.fit(data, discrepancy=formulation, noise_sd=sd) for data, sd in ((first, 0.1), (other, 100.0)))
    assert large.log_evidence == pytest.approx(small.log_evidence - 20 * np.log(1000), abs=1e-5)
    a, b = (posterior.solution.marginals["C10"] for posterior in (small, large))
    assert b.mean == pytest.approx(1000 * a.mean, rel=1e-5)
    assert b.sd == pytest.approx(1000 * a.sd, rel=1e-5)


def test_the_order_of_the_rows_does_not_matter(paper):
    data = paper.experiment()
    shuffled = np.random.default_rng(0).permutation(len(data))
    other = tq.Experiment("uniaxial", data.stretch[shuffled], data.stress[shuffled])
    first, second = (tq.fit(each, discrepancy="gp", noise_sd=0.5).log_evidence for each in (data, other))
    assert second == pytest.approx(first, abs=1e-6)


def test_the_same_seed_gives_the_same_bits_and_draws_follow_the_marginals(paper):
    first, second, other = (fitted(paper, "yeoh", seed=seed).solution for seed in (7, 7, 8))
    for symbol, marginal in first.marginals.items():
        assert (first.draws[symbol] == second.draws[symbol]).all()
        assert (first.draws[symbol] != other.draws[symbol]).any()
        error = marginal.sd / np.sqrt(4000)
        assert first.draws[symbol].mean() == pytest.approx(marginal.mean, abs=5 * error)
        assert first.draws[symbol].std() == pytest.approx(marginal.sd, rel=0.08)


def test_four_hundred_points_with_a_gaussian_process_agree_with_a_dense_likelihood():
    stretch = np.linspace(0.7, 2.5, 400)
    data = tq.simulate("yeoh", TRUTH, stretch, 0.1, seed=3)
    model = StatisticalModel(data, NeoHookean(), discrepancy_named("gp"), 0.1, {"C10": tq.Normal(1.0, 3.0)})
    h = np.array([[[0.7, 0.5]]])  # psi, c
    x = 2 * (stretch - stretch**-2)
    kernel = 0.25 * np.exp(-0.5 * ((stretch[:, None] - stretch) / 0.7) ** 2)
    covariance = kernel + 0.01 * np.eye(400) + 9 * np.outer(x, x)
    everywhere = multivariate_normal(x, covariance).logpdf(data.stress)
    dense = everywhere - norm.logcdf(1 / 3)  # the prior of C10 is cut at zero, far below the data
    assert model.nonlinear == ("psi", "c")
    assert ConditionalGaussian([model])(h).log_likelihood[0, 0] == pytest.approx(dense, abs=1e-6)


def test_solving_twice_from_one_model_is_stateless(paper):
    model = StatisticalModel(
        paper.experiment(), NeoHookean(), discrepancy_named("constant"), 0.5, paper.priors_of("constant")
    )
    (first,), (second,) = AdaptiveCells().solve([model], 1), AdaptiveCells().solve([model], 1)
    assert first.log_evidence == second.log_evidence


@pytest.mark.parametrize("noise_sds", [(0.004, 0.02, 0.1, 0.005), (0.1, 0.004)], ids=["wider", "narrower"])
def test_similar_models_in_turn_have_the_posteriors_that_each_has_by_itself(noise_sds):
    stretch = np.linspace(0.8, 1.3, 20)
    data = tq.simulate("fung", {"mu": 0.4, "b": 1.5}, stretch, 0.005, seed=2)
    priors = {"mu": tq.Uniform(0, 5), "b": tq.LogUniform(0.02, 10)}
    models = [StatisticalModel(data, material_named("fung"), discrepancy_named("none"), sd, priors) for sd in noise_sds]
    other_priors = replace(models[0], chosen_priors=priors | {"b": tq.LogUniform(0.02, 1.2)})
    other_law = replace(models[0], material=material_named("demiray"))
    cells = AdaptiveCells(bases=RememberedBases())
    for model in (*models, other_priors, other_law):
        (in_turn,), (alone,) = cells.solve([model]), AdaptiveCells().solve([model])
        assert in_turn.log_evidence == pytest.approx(alone.log_evidence, abs=2e-6)
        for symbol in ("mu", "b"):
            first, second = in_turn.marginals[symbol], alone.marginals[symbol]
            assert first.mean == pytest.approx(second.mean, abs=1e-3 * second.sd)
            assert first.sd == pytest.approx(second.sd, rel=1e-3)
            assert first.hdi() == pytest.approx(second.hdi(), abs=0.01 * second.sd)
