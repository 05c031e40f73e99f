"""Stresses and parameters as one Gaussian, against their moments one by one and against kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics.rays import share_to_end
from tissuq.next_test.expected_variance import joint_stresses, states_of
from tissuq.prediction.moments import drawn_stress, stress_moments

STRETCH = np.linspace(0.75, 1.5, 14)
UNIAXIAL, PLANAR, EQUIBIAXIAL = map(loading_mode, ("uniaxial", "planar", "equibiaxial"))
FAR = [(UNIAXIAL, np.linspace(0.7, 1.6, 6)), (PLANAR, np.array([1.1, 1.45])), (EQUIBIAXIAL, np.array([1.3]))]
OTHER = [(UNIAXIAL, np.linspace(0.76, 1.49, 6)), (PLANAR, np.array([0.9, 1.1])), (EQUIBIAXIAL, np.array([1.1]))]
NEAR = [(UNIAXIAL, np.array([0.8, 1.1, 1.4])), (UNIAXIAL, np.array([1.2]))]


def data_of(mode="uniaxial"):
    return tq.simulate("yeoh", {"C10": 0.5, "C20": 0.05, "C30": 0.0}, STRETCH, 0.02, seed=1, mode=mode)


@pytest.mark.parametrize(
    ("tests", "options", "every"),
    [
        (data_of(), {}, OTHER),
        (data_of(), {}, NEAR),
        ([data_of(), data_of("planar")], {"discrepancy": "taylor"}, OTHER),
        pytest.param([data_of(), data_of("planar")], {}, OTHER, marks=pytest.mark.slow),
        (data_of(), {"discrepancy": "gp"}, NEAR),
        (data_of(), {"discrepancy": "mooney-rivlin"}, FAR),
        (data_of(), {"material": "ogden-1", "discrepancy": "taylor"}, OTHER),
    ],
)
def test_means_and_variances_are_those_of_single_predictions(tests, options, every):
    solution = tq.fit(tests, noise_sd=0.02, **options).solution
    model, parts = solution.model, solution.mixture.thinned(50)
    states = states_of(model, every)
    mean, root = joint_stresses(model, parts, states)
    wanted, variance = stress_moments(model, parts, states)
    values = {symbol: own[:, None] for symbol, own in zip(model.nonlinear, parts.settings.T, strict=True)}
    np.testing.assert_allclose(mean, wanted, rtol=1e-5, atol=1e-6)
    own = (root**2).sum(axis=2) + model.discrepancy.independent_variance(values)
    np.testing.assert_allclose(own, variance, rtol=1e-4, atol=1e-12)


def test_a_parameter_and_a_stress_are_correlated_as_least_squares_says():
    solution = tq.fit(data_of(), discrepancy="none", noise_sd=0.02).solution
    _, root = joint_stresses(solution.model, solution.mixture, states_of(solution.model, FAR))
    x = 2 * (STRETCH - STRETCH**-2)
    covariance = root[0] @ solution.mixture.root[0, 0]
    unit = np.array([2 * (FAR[0][1] - FAR[0][1] ** -2)]).ravel()
    np.testing.assert_allclose(covariance[:6], unit * 0.02**2 / (x @ x), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["taylor", "log", "second-invariant", "hencky", "auto"])
def test_beyond_the_data_roots_are_derivatives_of_draws(name):
    solution = tq.fit(data_of(), discrepancy=name, noise_sd=0.02).solution
    model, parts = solution.model, solution.mixture.thinned(20)
    states, step, median = states_of(model, FAR), 1e-3, np.full(len(parts), 0.5)
    mean, root = joint_stresses(model, parts, states)
    np.testing.assert_allclose(mean, drawn_stress(model, parts, states, median), rtol=1e-6, atol=1e-9)
    for column, direction in enumerate(np.moveaxis(parts.root, 2, 0)):
        moved = [
            drawn_stress(model, replace(parts, mean=parts.mean + sign * step * direction), states, median)
            for sign in (1, -1)
        ]
        expected = (moved[0] - moved[1]) / (2 * step)
        assert (np.abs(root[:, :, column] - expected) < 0.02 * np.abs(expected) + 2e-3 * np.abs(mean)).all()


def test_the_error_of_the_exponent_is_one_in_all_modes_and_none_within_the_data():
    solution = tq.fit(data_of(), discrepancy="taylor", noise_sd=0.02).solution
    model, parts = solution.model, solution.mixture.thinned(5)
    states = states_of(model, FAR)
    mean, root = joint_stresses(model, parts, states)
    (limits,) = (limits for limits, _ in model.by_limits(parts.member))
    is_beyond = share_to_end(states.log_stretches[0], limits) < 1
    assert is_beyond.any()
    assert not root[:, ~is_beyond, -1].any()
    assert (root[:, is_beyond, -1] * mean[:, is_beyond] > 0).all()
    # To first order a change of the score, here at the probability 0.51, has the same effect on all stresses.
    little = drawn_stress(model, parts, states, np.full(len(parts), 0.51))[:, is_beyond] / mean[:, is_beyond] - 1
    ratio = little / (root[:, is_beyond, -1] / mean[:, is_beyond])
    np.testing.assert_allclose(ratio, ratio.mean(axis=1, keepdims=True) * np.ones_like(ratio), rtol=2e-2)
