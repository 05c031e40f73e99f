"""Stresses and parameters as one Gaussian, against their moments one by one and against kernels."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.next_test.expected_variance import joint_stresses, states_of
from tissuq.prediction.moments import stress_moments

STRETCH = np.linspace(0.75, 1.5, 14)
UNIAXIAL, PLANAR, EQUIBIAXIAL = map(loading_mode, ("uniaxial", "planar", "equibiaxial"))
FAR = [(UNIAXIAL, np.linspace(0.7, 1.6, 6)), (PLANAR, np.array([1.1, 1.45])), (EQUIBIAXIAL, np.array([1.3]))]
NEAR = [(UNIAXIAL, np.array([0.8, 1.1, 1.4])), (UNIAXIAL, np.array([1.2]))]


def data_of(mode="uniaxial"):
    return tq.simulate("yeoh", {"C10": 0.5, "C20": 0.05, "C30": 0.0}, STRETCH, 0.02, seed=1, mode=mode)


@pytest.mark.parametrize(
    ("tests", "options", "every"),
    [
        (data_of(), {}, FAR),
        (data_of(), {}, NEAR),
        ([data_of(), data_of("planar")], {"discrepancy": "taylor"}, FAR),
        pytest.param([data_of(), data_of("planar")], {}, FAR, marks=pytest.mark.slow),
        (data_of(), {"discrepancy": "gp"}, NEAR),
        (data_of(), {"discrepancy": "mooney-rivlin"}, FAR),
        (data_of(), {"material": "ogden-1", "discrepancy": "taylor"}, FAR),
    ],
)
def test_means_and_variances_are_those_of_single_predictions(tests, options, every):
    solution = tq.fit(tests, noise_sd=0.02, **options).solution
    model, parts = solution.model, solution.mixture.thinned(50)
    states = states_of(model, every)
    mean, root = joint_stresses(model, parts, states)
    wanted, variance = stress_moments(model, parts, states, discrepancy=True, noise=False)
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


@pytest.mark.parametrize("name", ["taylor", "log", "second-invariant", "hencky", "valanis-landel", "spline"])
def test_beyond_the_data_stresses_of_all_modes_have_the_covariance_of_the_kernel(name):
    model = tq.fit(data_of(), discrepancy=name, noise_sd=0.02).model
    states = states_of(model, FAR)
    for member in model.energy_members:
        (block,), (reach,), (length,) = member.blocks, member.reaches, member.lengths
        ((terms, count),) = member.wide_features(states)
        z, v = block.coordinates(states)
        kernel = block.covariance(z[:, :, None, None], z[None, None], length * (reach[1] - reach[0]))
        wanted = np.einsum("ik,ikjl,jl->ij", v, kernel, v)
        sd = np.sqrt(np.diag(wanted))
        accuracy = 1e-3 if name == "spline" else 2e-5  # whose pivots leave out more
        np.testing.assert_allclose(terms @ terms.T / np.outer(sd, sd), wanted / np.outer(sd, sd), atol=accuracy)
        serving = member.stress_features(states)[0]
        np.testing.assert_allclose(terms[:, :count], serving, atol=1e-4 * np.abs(serving).max())
        assert terms.shape[1] > count or name == "hencky"
