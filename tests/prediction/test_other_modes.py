"""What is learnt in one loading mode and holds in others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import tissuq as tq
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics.invariants import invariant_rates, invariants

STRETCH = np.linspace(0.6, 2.2, 24)
TRUTH = {"C10": 0.4, "C20": 0.03, "C30": 0.002}


@pytest.fixture(scope="module")
def data():
    return tq.simulate("yeoh", TRUTH, STRETCH, noise_sd=0.03, seed=1)


@pytest.mark.parametrize("mode", ["equibiaxial", "planar"])
def test_an_energy_of_i1_is_the_same_wherever_i1_is(data, mode):
    # Stress over dI1/dl is W1(I1) in every mode, so the bands are one band.
    posterior = tq.fit(data, discrepancy="taylor", noise_sd=0.03)
    other = loading_mode(mode)
    uniaxial = np.array([1.3, 1.6, 2.0])
    same = np.array(
        [
            brentq(lambda end, x=x: invariants(other.at([end]))[0][0] - x, 1.0001, 3)
            for x in invariants(data.mode.at(uniaxial))[0]
        ]
    )
    first, second = posterior.predict(uniaxial, noise=False), posterior.predict(same, noise=False, mode=mode)
    rates = invariant_rates(data.mode.at(uniaxial))[0], invariant_rates(other.at(same))[0]
    for end in ("median", "low", "high"):
        np.testing.assert_allclose(first[end] / rates[0], second[end] / rates[1], rtol=1e-5)


@pytest.mark.parametrize("mode", ["equibiaxial", "planar"])
@pytest.mark.parametrize("discrepancy", ["auto", "yeoh"])
def test_other_modes_are_predicted(data, discrepancy, mode):
    posterior = tq.fit(data, discrepancy=discrepancy, noise_sd=0.03)
    stretch = np.linspace(0.8, 1.4, 13)
    band = posterior.predict(stretch, noise=False, mode=mode)
    exact = tq.simulate("yeoh", TRUTH, stretch, mode=mode).stress
    assert np.mean((band["low"] <= exact + 1e-9) & (exact <= band["high"] + 1e-9)) > 0.9
    assert np.abs(band["median"] - exact).max() < 0.15 * np.abs(exact).max()


def test_the_material_alone_is_predicted_in_every_mode(data):
    posterior = tq.fit(data, discrepancy="gp", noise_sd=0.03)
    band = posterior.predict([1.2], noise=False, discrepancy=False, mode="planar")
    unit = tq.simulate("neo-hookean", {"C10": 1.0}, [1.2, 1.3, 1.4], mode="planar").stress[0]
    assert band["median"][0] == pytest.approx(unit * posterior.summary().loc["C10", "mean"], rel=1e-3)


@pytest.mark.parametrize("discrepancy", ["gp", "quadratic", "constant"])
def test_an_error_of_the_stress_says_nothing_of_other_modes(data, discrepancy):
    posterior = tq.fit(data, discrepancy=discrepancy, noise_sd=0.03)
    with pytest.raises(tq.InputError, match="says nothing about the planar one"):
        posterior.predict([1.2], mode="planar")
    assert posterior.predict([1.2], mode="uniaxial").equals(posterior.predict([1.2]))


def test_far_beyond_the_data_the_band_is_wide_and_finite(data):
    band = tq.fit(data, discrepancy="auto", noise_sd=0.03).predict([1.5, 3.0, 6.0], mode="equibiaxial")
    width = (band["high"] - band["low"]).to_numpy()
    assert np.isfinite(band.to_numpy()).all()
    assert (np.diff(width) > 0).all()


@pytest.mark.parametrize("discrepancy", ["constant", "quadratic", "gp"])
def test_the_material_alone_is_predicted_in_modes_of_two_stresses(data, discrepancy):
    posterior = tq.fit(data, discrepancy=discrepancy, noise_sd=0.03)
    band = posterior.predict([[1.2, 1.1]], noise=False, discrepancy=False, mode="biaxial", channel=1)
    unit = 2 * (1.1 - 1 / (1.2**2 * 1.1**3))  # neo-Hooke: 2 (l2 - 1 / (l1^2 l2^3))
    assert band["median"][0] == pytest.approx(unit * posterior.summary().loc["C10", "mean"], rel=1e-3)
