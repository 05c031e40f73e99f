"""The pieces of a population: mixtures on the line, few Gaussians for many, and integrals over a specimen."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

import tissuq as tq
from tissuq.inference.gaussian_mixture import GaussianMixture
from tissuq.population.hierarchy import Hierarchy, _log_posterior, _root, _terms
from tissuq.population.likelihoods import Coordinates, _split, coordinates_of, likelihoods_of, mixtures_of, reduced

STRETCH = np.linspace(0.8, 1.5, 12)


def log_likelihood(found, theta):
    """Evaluate one specimen's likelihood (n,) at places (n, d)."""
    quadratic = np.einsum("ni,kij,nj->nk", theta, found.precision[0], theta)
    return logsumexp(found.log_factor[0] + theta @ found.pull[0].T - 0.5 * quadratic, axis=1)


def random_mixture(count=400, seed=1):
    """Return Gaussians as posteriors have them: wider ones lie further away."""
    generator = np.random.default_rng(seed)
    score = generator.standard_normal(count)
    root = np.array([[1.0, 0.0], [0.7, 0.3]]) * np.exp(0.7 * score)[:, None, None]
    means = np.array([0.5, -0.2]) * score[:, None] + 0.1 * generator.standard_normal((count, 2))
    return GaussianMixture.of_covariances(generator.random(count), means, root @ root.swapaxes(1, 2))


@pytest.mark.parametrize("count", [1, 16, 200])
def test_few_gaussians_keep_the_moments_of_many(count):
    many = random_mixture()
    few = reduced(many, count)
    assert len(few.weights) <= count
    assert few.weights.sum() == pytest.approx(many.weights.sum())
    for own, expected in zip(few.moments(), many.moments(), strict=True):
        assert own == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_more_gaussians_come_nearer_to_the_density():
    many = random_mixture()
    generator = np.random.default_rng(2)
    chosen = generator.choice(len(many.weights), 500, p=many.weights / many.weights.sum())
    points = np.array([generator.multivariate_normal(many.mean[k], many.covariance[k]) for k in chosen])

    def log_density(mixture):
        each = [multivariate_normal(m, c).logpdf(points) for m, c in zip(mixture.mean, mixture.covariance, strict=True)]
        return logsumexp(np.log(mixture.weights / mixture.weights.sum())[:, None] + each, axis=0)

    errors = [np.std(log_density(reduced(many, count)) - log_density(many)) for count in (1, 8, 64)]
    assert errors[0] > 2 * errors[1] > 2 * errors[2]
    assert errors[2] < 0.2


@pytest.mark.parametrize(("modulus", "noise_sd", "error"), [(0.5, 0.005, 0.05), (0.5, 0.1, 0.1), (0.05, 0.2, 0.5)])
def test_the_likelihood_of_a_modulus_is_that_of_the_data(modulus, noise_sd, error):
    """Known noise and no discrepancy: Gaussian in C10, and for the last one, which is drawn, level below.

    The log likelihood is right up to a constant and the error that is given where it is within three of its top, from
    a thirtieth of the middle on.
    """
    data = tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd, seed=3)
    posterior = tq.fit(data, discrepancy="none", noise_sd=noise_sd)
    coordinates = coordinates_of([posterior], ["C10"])
    found = likelihoods_of(*mixtures_of([posterior], coordinates), 200)
    theta = np.linspace(-3.4, 3.4, 2001)[:, None]
    basis = 2 * (STRETCH - STRETCH**-2)
    residual = data.stress - coordinates.from_line(theta) * basis
    expected = norm.logpdf(residual, 0, noise_sd).sum(axis=1)
    expected -= expected.max()
    near = expected > -3
    assert near[0] == (modulus < 0.1)
    assert np.ptp((log_likelihood(found, theta) - expected)[near]) < error


def test_a_gaussian_that_is_split_keeps_its_weight_and_its_moments_under_the_logarithm():
    """Against quadrature of log b and its products with a correlated c over the Gaussian of both."""
    mean, covariance = np.array([0.5, 1.0]), np.array([[0.0025, 0.003], [0.003, 0.01]])
    coordinates = Coordinates(("C10", "C01"), np.array([True, False]), np.array([1.0, 2.0]), np.array([-0.5, 0.25]))
    found = _split(GaussianMixture.of_covariances(np.array([3.0]), mean[None], covariance[None]), coordinates)
    score, weights = np.polynomial.hermite_e.hermegauss(20)
    b, c = mean[0] + 0.05 * score, mean[1] + 0.06 * score
    log_mean, c_mean = (weights @ each / weights.sum() for each in (np.log(b), c / 2))
    expected = weights @ ((np.log(b) - log_mean) * (c / 2 - c_mean)) / weights.sum()
    own_mean, own = found.moments()
    assert found.weights.sum() == pytest.approx(3, rel=1e-4)
    assert own_mean == pytest.approx([log_mean + 0.5, c_mean - 0.25], abs=1e-3)
    assert own[0, 0] == pytest.approx(weights @ (np.log(b) - log_mean) ** 2 / weights.sum(), rel=0.02)
    assert own[0, 1] == pytest.approx(expected, rel=0.02)
    assert own[1, 1] == pytest.approx(0.01 / 4, rel=0.02)


@pytest.mark.slow
def test_two_parameters_under_an_energy_are_represented_jointly():
    """Against the mixture that the fit gives, evaluated by itself: sd of the log ratio at its own draws below 0.1."""
    truth = {"C10": 0.5, "C20": 0.05, "C30": 0.0}
    data = tq.simulate("yeoh", truth, np.linspace(0.6, 2, 30), 0.02, seed=1)
    posterior = tq.fit(data, material="yeoh", noise_sd=0.02)
    coordinates = coordinates_of([posterior], ["C10", "C20"])
    found = likelihoods_of(*mixtures_of([posterior], coordinates), 200)
    draws = np.column_stack([posterior.solution.draws[s].ravel()[::20] for s in ("C10", "C20")])
    parts = posterior.solution.mixture
    own = parts.root[:, :2] @ parts.root[:, :2].swapaxes(1, 2)
    is_wide = np.linalg.eigvalsh(own)[:, 0] > 0
    assert parts.weights[is_wide].sum() > 0.999
    each = [
        multivariate_normal(mean[:2], covariance, allow_singular=True).logpdf(draws)
        for mean, covariance in zip(parts.mean[is_wide], own[is_wide], strict=True)
    ]
    expected = logsumexp(np.log(parts.weights[is_wide])[:, None] + each, axis=0)
    ratio = log_likelihood(found, coordinates.to_line(draws)) - expected
    assert np.std(ratio) < 0.1


def test_a_prior_that_was_given_is_divided_out():
    """Up to its curvature within a Gaussian of the posterior, which is why it must be wide."""
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, 0.05, seed=3)
    theta = np.log(0.5) + np.linspace(-0.2, 0.2, 41)[:, None]
    curves = []
    for priors in ({}, {"C10": tq.LogNormal(0.3, 0.7)}):
        posterior = tq.fit(data, discrepancy="none", noise_sd=0.05, priors=priors)
        coordinates = coordinates_of([posterior], ["C10"])
        found = likelihoods_of(*mixtures_of([posterior], coordinates), 200)
        values = log_likelihood(found, theta - coordinates.centre)
        curves.append(values - values.max())
    inside = curves[0] > -3
    assert inside.sum() >= 5
    assert curves[1][inside] == pytest.approx(curves[0][inside], abs=0.3)


def test_specimens_are_integrated_over_as_multivariate_normals():
    generator = np.random.default_rng(4)
    root = np.tril(generator.standard_normal((3, 3))) + 2 * np.eye(3)
    mean, middle = generator.standard_normal((2, 3))
    side = generator.standard_normal((3, 3))
    own = side @ side.T + 0.1 * np.eye(3)
    precision = np.linalg.inv(own)
    terms, _, _ = _terms(mean, root, np.zeros((1, 1)), (precision @ middle)[None, None], precision[None, None])
    at_zero = multivariate_normal(middle, own).logpdf(np.zeros(3))
    expected = multivariate_normal(mean, root @ root.T + own).logpdf(middle) - at_zero
    assert float(terms[0, 0]) == pytest.approx(expected, rel=1e-9)


def test_partial_correlations_make_a_correlation_matrix():
    """Against the recursion of Joe (2006) for three parameters, written out."""
    tau, first, second, given = np.array([0.5, 1.0, 2.0]), 0.6, -0.4, 0.7
    root = _root(jnp.asarray(tau), jnp.array([first, second, given]))
    covariance = np.asarray(root @ root.T)
    expected = first * second + given * np.sqrt((1 - first**2) * (1 - second**2))
    assert np.sqrt(np.diag(covariance)) == pytest.approx(tau)
    correlation = covariance / np.outer(tau, tau)
    assert correlation[1, 0] == pytest.approx(first)
    assert correlation[2, 0] == pytest.approx(second)
    assert correlation[2, 1] == pytest.approx(expected)


def test_a_new_specimen_has_the_covariance_of_the_population():
    """20,000 of them: each entry of the sample covariance within five of its standard errors."""
    root, shape = np.array([[1.0, 0.0], [2.0, 0.5]]), (4, 5000)
    mean = np.array([3.0, -1.0])
    population = Hierarchy(np.broadcast_to(mean, (*shape, 2)), np.broadcast_to(root, (*shape, 2, 2)),
                           np.zeros((*shape, 0, 2)), None, 1.0)  # fmt: skip
    drawn = population.new(np.random.default_rng(0)).reshape(-1, 2)
    covariance = np.array([[1.0, 2.0], [2.0, 4.25]])
    sds = np.sqrt(np.diag(covariance))
    error = np.sqrt((covariance**2 + np.outer(sds, sds) ** 2) / len(drawn))
    assert (np.abs(drawn.mean(axis=0) - mean) < 5 * sds / np.sqrt(len(drawn))).all()
    assert (np.abs(np.cov(drawn.T) - covariance) < 5 * error).all()


@pytest.mark.slow
def test_correlations_have_the_prior_of_lewandowski_kurowicka_and_joe_and_effects_a_normal_one():
    """Its density is det(Omega)^(2 - 1) over the correlations, here brought to the partial ones by their Jacobian."""
    generator, spread = np.random.default_rng(4), 0.7
    flat = {name: np.zeros(shape) for name, shape in
            (("log_factor", (1, 1)), ("pull", (1, 1, 3)), ("precision", (1, 1, 3, 3)), ("design", (1, 2)))}  # fmt: skip
    lower = np.tril_indices(3, -1)

    def correlations(point):
        root = np.asarray(_root(jnp.asarray(point[3:6]), jnp.asarray(point[6:]))) / point[3:6, None]
        return root @ root.T

    def expected(whole):
        point, effects = whole[:9], whole[9:]
        steps = 1e-5 * np.eye(9)[6:]
        jacobian = [(correlations(point + step) - correlations(point - step))[lower] / 2e-5 for step in steps]
        of_correlations = np.linalg.slogdet(correlations(point))[1] + np.linalg.slogdet(jacobian)[1]
        of_scales = norm.logpdf(point[:3], 0, 5).sum() + norm.logpdf(point[3:6], 0, spread).sum()
        return of_correlations + of_scales + norm.logpdf(effects, 0, 1).sum()

    points = np.column_stack([generator.normal(size=(6, 3)), generator.random((6, 3)) + 0.1,
                              generator.uniform(-0.9, 0.9, (6, 3)), generator.normal(size=(6, 6))])  # fmt: skip
    found = [float(_log_posterior(jnp.asarray(point), flat | {"spread": spread})) for point in points]
    wanted = [expected(point) for point in points]
    assert np.diff(found) == pytest.approx(np.diff(wanted), abs=1e-6)


def test_a_parameter_that_alone_is_the_modulus_is_positive_and_one_of_several_terms_of_either_sign():
    stretch = np.linspace(0.7, 1.6, 12)
    one = tq.simulate("ogden-1", {"mu1": 0.5, "alpha1": 5.0}, stretch, noise_sd=0.02, seed=1)
    data = tq.simulate("mooney-rivlin", {"C10": 0.4, "C01": 0.1}, stretch, noise_sd=0.02, seed=1)
    laws = {"ogden-1": (one, [True, False]), "mooney-rivlin": (data, [True, False]), "rivlin:C01": (data, [True])}
    for law, (test, expected) in laws.items():
        posterior = tq.fit(test, material=law, discrepancy="none", noise_sd=0.02)
        symbols = [parameter.symbol for parameter in posterior.model.material.parameters]
        assert coordinates_of([posterior] * 3, symbols).is_log.tolist() == expected, law
