"""The processes behind an emulator, held against the textbook's formulas with plain inverses."""

import numpy as np
import pytest
from scipy.stats import norm

from tissuq.emulation.kriging import LENGTH_BOUNDS, NUGGET_BOUNDS, Kriging, LengthScales, fitted, leave_one_out, moments


def dense(kernel, one, other, lengths):
    distance = np.sqrt((((one[:, None] - other[None]) / lengths) ** 2).sum(axis=-1))
    if kernel == "squared-exponential":
        return np.exp(-0.5 * distance**2)
    r = np.sqrt(5) * distance
    return (1 + r + r**2 / 3) * np.exp(-r)


def textbook(model, values, point, settings=0):
    """Universal kriging with mean coefficients (flat) and variance (1 / variance) integrated: mean and variance."""
    points, lengths, nugget = model.points, model.lengths[0, settings], model.nugget[0]
    H, h = np.column_stack([np.ones(len(points)), points]), np.append(1, point)
    R = dense(model.kernel, points, points, lengths) + nugget * np.eye(len(points))
    r = dense(model.kernel, points, point[None], lengths)[:, 0]
    inverse = np.linalg.inv(R)
    gram = np.linalg.inv(H.T @ inverse @ H)
    beta = gram @ H.T @ inverse @ values
    rest = values - H @ beta
    free = len(points) - H.shape[1]
    variance = rest @ inverse @ rest / (free - 2)
    u = h - H.T @ inverse @ r
    return h @ beta + r @ inverse @ rest, variance * (1 + nugget - r @ inverse @ r + u @ gram @ u)


def case(kernel, seed=0, m=14):
    points = np.random.default_rng(seed).random((m, 2))
    values = np.sin(3 * points[:, 0]) + points[:, 1] ** 2
    model = Kriging(points, values[:, None], np.ones((1, 1)), np.array([[[0.5, 0.9]]]), np.array([1e-6]), kernel,
                    "linear")  # fmt: skip
    return model, values


@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["squared-exponential", "matern-5/2"])
def test_predictions_are_those_of_the_textbook(kernel):
    import jax

    jax.config.update("jax_enable_x64", True)
    model, values = case(kernel)
    for point in np.array([[0.2, 0.7], [0.95, 0.05]]):
        mean, variance = moments(kernel, "linear", model.arrays, jax.numpy.asarray(point))
        expected = textbook(model, values, point)
        assert float(mean[0]) == pytest.approx(expected[0], rel=1e-7)
        assert float(variance[0]) == pytest.approx(expected[1], rel=1e-4)


@pytest.mark.parametrize("kernel", ["squared-exponential", "matern-5/2"])
def test_a_run_left_out_is_predicted_as_if_it_had_never_been_made(kernel):
    model, values = case(kernel)
    error, sd = leave_one_out(model)
    for k in range(len(values)):
        others = np.arange(len(values)) != k
        less = Kriging(model.points[others], values[others, None], model.weights, model.lengths, model.nugget,
                       kernel, "linear")  # fmt: skip
        mean, variance = textbook(less, values[others], model.points[k])
        assert error[k, 0] == pytest.approx(values[k] - mean, rel=1e-4, abs=1e-8)
        assert sd[k, 0] ** 2 == pytest.approx(variance, rel=1e-3)


def log_posterior(kernel, logs, points, values, trend="linear"):
    """The textbook's integrated likelihood (Berger, De Oliveira & Sanso 2001) times the prior of the length scales."""
    H = {"constant": np.ones((len(points), 1)), "linear": np.column_stack([np.ones(len(points)), points])}[trend]
    R = dense(kernel, points, points, np.exp(logs[:-1])) + np.exp(logs[-1]) * np.eye(len(points))
    inverse = np.linalg.inv(R)
    gram = H.T @ inverse @ H
    rest = values - H @ np.linalg.solve(gram, H.T @ inverse @ values)
    free = len(points) - H.shape[1]
    value = -0.5 * np.linalg.slogdet(R)[1] - 0.5 * np.linalg.slogdet(gram)[1]
    return value - 0.5 * free * np.log(rest @ inverse @ rest) + norm.logpdf(logs[:-1], np.log(0.7), 1).sum()


@pytest.mark.parametrize("kernel", ["squared-exponential", "matern-5/2"])
@pytest.mark.parametrize("trend", ["constant", "linear"])
def test_the_density_of_length_scales_is_that_of_the_textbook(kernel, trend):
    points = np.random.default_rng(3).random((14, 2))
    values = np.cos(4 * points[:, 0]) * (1 + points[:, 1])
    settings = np.log([[0.4, 0.8, 1e-4], [1.4, 0.3, 1e-5]])
    one, other = (LengthScales(points, kernel, trend).log_density(logs, values)[0] for logs in settings)
    expected = [log_posterior(kernel, logs, points, values, trend) for logs in settings]
    assert one - other == pytest.approx(expected[0] - expected[1], rel=1e-6)


@pytest.mark.parametrize("kernel", ["squared-exponential", "matern-5/2"])
@pytest.mark.parametrize("trend", ["constant", "linear", "quadratic"])
def test_the_slope_of_the_density_is_that_of_finite_differences(kernel, trend):
    points = np.random.default_rng(3).random((14, 2))
    values = np.cos(4 * points[:, 0]) * (1 + points[:, 1])
    logs = np.log([0.4, 0.8, 1e-4])
    scales = LengthScales(points, kernel, trend)
    _, slope = scales.log_density(logs, values)
    for k, of_parameter in enumerate(slope):
        step = 1e-5 * np.eye(3)[k]
        high, low = (scales.log_density(logs + way * step, values)[0] for way in (1, -1))
        assert of_parameter == pytest.approx((high - low) / 2e-5, rel=1e-5, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_no_setting_of_a_dense_grid_is_more_probable_than_the_mode(seed):
    points = np.random.default_rng(seed).random((12, 2))
    values = np.sin((3 + seed) * points[:, 0]) + points[:, 1] ** 2
    mode = LengthScales(points, "matern-5/2", "linear").mode(values)
    lengths, nuggets = np.geomspace(*LENGTH_BOUNDS, 30), np.geomspace(*NUGGET_BOUNDS, 6)
    grid = np.log([[a, b, nugget] for a in lengths for b in lengths for nugget in nuggets])
    best = max(log_posterior("matern-5/2", logs, points, values) for logs in grid)
    assert log_posterior("matern-5/2", mode.logs, points, values) > best - 1e-6


def test_a_function_without_structure_is_left_to_the_remainder():
    generator = np.random.default_rng(4)
    points = generator.random((30, 2))
    smooth, noise = np.sin(3 * points[:, :1]), generator.standard_normal((30, 3))
    model, is_predicted = fitted(points, np.hstack([smooth, noise, smooth]), "squared-exponential", "linear")
    assert is_predicted.tolist() == [True, False, False, False, False]
    assert model.values.shape == (30, 1)


def test_length_scales_follow_the_function_and_the_weights_are_a_distribution():
    points = np.random.default_rng(1).random((30, 2))
    found, _ = fitted(points, np.sin(6 * points[:, :1]), "squared-exponential", "linear")
    best = found.lengths[0, 0]
    assert best[0] < 0.6 < 2 < best[1]
    assert found.weights.sum() == pytest.approx(1)
    assert NUGGET_BOUNDS[0] <= found.nugget[0] < 1e-6


def test_noise_of_a_solver_is_found_in_the_nugget():
    generator = np.random.default_rng(2)
    points = generator.random((40, 1))
    values = np.sin(3 * points) + 0.02 * generator.standard_normal((40, 1))
    model, _ = fitted(points, values, "squared-exponential", "linear")
    variance = float(model.weights[0] @ [terms.variance for terms in model.terms[0]])
    assert np.sqrt(model.nugget[0] * variance) == pytest.approx(0.02, rel=0.5)
