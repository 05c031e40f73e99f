"""The one algebra of linear parameters, against dense covariances, for NumPy and JAX."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tissuq.inference.coordinates  # noqa: F401 (double precision of JAX)
from tissuq.inference.linear import Fit, SpectralCovariance, condition, integrated
from tissuq.inference.reduction import Spectrum

N, P = 9, 2


def problem(seed: int = 1):
    """Return a design (n, p), data (n,), a covariance (n, n) and a Gaussian prior's means and sds (p,)."""
    generator = np.random.default_rng(seed)
    design, data = generator.normal(size=(N, P)), generator.normal(size=N)
    root = generator.normal(size=(N, N))
    return design, data, root @ root.T + np.eye(N), np.array([0.3, -0.2]), np.array([0.7, 1.5])


def conditioned(arrays):
    """Return what `condition` makes of the problem with arrays of a library."""
    design, data, covariance, mean, sd = problem()
    basis, triangle = np.linalg.qr(design)
    inverse = np.linalg.inv(triangle)
    fit = Fit(inverse, np.log(np.abs(np.diag(triangle))).sum(), inverse @ (basis.T @ data))
    columns = np.column_stack([basis, data - design @ fit.centre])
    moments = columns.T @ np.linalg.solve(covariance, columns)
    constant = -np.log(sd).sum() - 0.5 * P * np.log(2 * np.pi)
    prior = (arrays.asarray(mean), arrays.asarray(sd**-2), constant)
    fit = Fit(*map(arrays.asarray, fit))
    log_determinant = np.linalg.slogdet(covariance)[1]
    return condition(arrays.asarray(moments), log_determinant, fit, arrays.ones(1), prior, N)


@pytest.mark.parametrize("arrays", [np, jnp])
def test_density_mean_and_root_are_those_of_the_dense_gaussian(arrays):
    design, data, covariance, mean, sd = problem()
    whole = covariance + design @ np.diag(sd**2) @ design.T
    gain = np.diag(sd**2) @ design.T @ np.linalg.inv(whole)
    found = conditioned(arrays)
    assert float(found.log_likelihood) == pytest.approx(
        multivariate_normal(design @ mean, whole).logpdf(data), rel=1e-12
    )
    np.testing.assert_allclose(found.mean, mean + gain @ (data - design @ mean), rtol=1e-11)
    expected = np.diag(sd**2) - gain @ design @ np.diag(sd**2)
    np.testing.assert_allclose(found.root @ found.root.T, expected, rtol=1e-11)


def test_several_data_sets_share_one_precision():
    design, _, covariance, _, _ = problem()
    data = np.random.default_rng(2).normal(size=(N, 3))
    solved = np.linalg.solve(covariance, np.column_stack([design, data]))
    precision, pull = np.split(design.T @ solved, [P], axis=1)
    found = integrated(precision, pull, np.einsum("nk,nk->k", data, solved[:, P:]))
    for place, column in enumerate(data.T):
        best = np.linalg.solve(precision, design.T @ np.linalg.solve(covariance, column))
        away = column - design @ best
        assert found.misfit[place] == pytest.approx(away @ np.linalg.solve(covariance, away), rel=1e-11)
        np.testing.assert_allclose(found.root @ found.scores[:, place], best, rtol=1e-11)
    assert found.log_volume == pytest.approx(-0.5 * np.linalg.slogdet(precision)[1], rel=1e-12)


def test_spectral_covariance_is_the_dense_one():
    generator = np.random.default_rng(3)
    vectors, _ = np.linalg.qr(generator.normal(size=(N, 3)))
    values, size = np.array([4.0, 1.0, 0.1]), generator.uniform(0.5, 2.0, N)
    amplitude, white = np.array([0.5, 2.0]), np.array([0.3, 1.2])
    own = SpectralCovariance(Spectrum(vectors, values), size, amplitude, white)
    columns = generator.normal(size=(2, N, 2))
    for place in range(2):
        inside = white[place] * np.eye(N) + amplitude[place] * (vectors * values) @ vectors.T
        dense = size[:, None] * inside * size
        np.testing.assert_allclose(own.solved(columns)[place], np.linalg.solve(dense, columns[place]), rtol=1e-10)
        np.testing.assert_allclose(own.precision[place], np.diag(np.linalg.inv(dense)), rtol=1e-11)
        assert own.log_determinant[place] == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-11)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_linear_parameters_are_integrated_as_by_solving_and_a_determinant(count):
    """Few parameters entry by entry, more by the library: both against another way, on matrices of condition 1e6."""
    generator = np.random.default_rng(count)
    columns = generator.standard_normal((3, 2, 12, count)) * np.logspace(0, -3, count)
    precision, pull = columns.swapaxes(2, 3) @ columns, generator.standard_normal((3, 2, count, 4))
    found = integrated(precision, pull, np.full((3, 2, 4), 50.0))
    means = np.linalg.solve(precision, pull)
    assert found.log_volume == pytest.approx(-0.5 * np.linalg.slogdet(precision)[1], rel=1e-9)
    assert found.root @ found.scores == pytest.approx(means, rel=1e-8)
    assert found.root @ found.root.swapaxes(2, 3) == pytest.approx(np.linalg.inv(precision), rel=1e-8)
    assert found.misfit == pytest.approx(50.0 - (pull * means).sum(axis=2), rel=1e-8)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("entry", [0.0, -1.0])
def test_a_precision_that_is_not_positive_is_refused(count, entry):
    precision = np.stack([np.eye(count), np.diag([*[1.0] * (count - 1), entry])])
    with pytest.raises(np.linalg.LinAlgError):
        integrated(precision, np.ones((2, count, 1)), np.ones((2, 1)))


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_precision_that_is_no_number_spoils_no_other(count):
    """A law that locks has no stress at some exponents, which the search leaves out."""
    precision = np.stack([np.eye(count), np.full((count, count), np.nan)])
    found = integrated(precision, np.ones((2, count, 1)), np.full((2, 1), 50.0))
    assert found.misfit[0] == pytest.approx(50.0 - count)
    assert np.isnan(found.misfit[1])
