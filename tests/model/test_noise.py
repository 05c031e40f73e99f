"""Kinds of noise: names, standard deviations, and the level of the stress that some depend on."""

from __future__ import annotations

import numpy as np
import pint
import pytest

import tissuq as tq
from marks import slow_but
from tissuq.model.noise import noise_named, stress_level

Q = pint.UnitRegistry().Quantity


def test_a_number_is_known_noise_and_a_name_finds_its_kind():
    assert noise_named(0.3) == tq.KnownNoise(0.3)
    for text in ("0.3 MPa", "300 kPa", "0.3 N/mm2", Q(300.0, "kPa")):
        assert noise_named(text) == tq.KnownNoise(0.3)
    assert noise_named(["200 kPa", 0.3]).sds == noise_named(Q([200.0, 300.0], "kPa")).sds == (0.2, 0.3)
    for text, message in (("0.3", "'0.3' has no unit"), ("0.3 N", "is a force"), ("-1 kPa", "must be a positive")):
        with pytest.raises(tq.InputError, match=message):
            noise_named(text)
    assert isinstance(noise_named("unknown"), tq.UnknownNoise)
    assert isinstance(noise_named("proportional"), tq.ProportionalNoise)
    assert isinstance(noise_named("repeats"), tq.RepeatNoise)
    kept = tq.ProportionalNoise()
    assert noise_named(kept) is kept


@pytest.mark.parametrize("value", [0, -1.0, np.inf, np.nan, True, None, [0.1, -0.2], 1j])
def test_noise_that_is_no_positive_number_is_refused(value):
    with pytest.raises(tq.InputError, match="noise"):
        noise_named(value)


def test_noise_of_several_tests_is_not_that_of_one():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.05)
    with pytest.raises(tq.InputError, match="noise_sd has 2 values for 1 tests"):
        tq.fit(data, noise_sd=[0.1, 0.2])


@pytest.mark.parametrize("name", ["none", "known", "gaussian", ""])
def test_a_name_that_is_no_noise_is_refused_with_the_options(name):
    with pytest.raises(tq.InputError, match=r"unknown.*|proportional.*repeats"):
        noise_named(name)


def test_standard_deviations_are_those_of_the_descriptions():
    values = {"noise_sd": np.array([0.1, 0.2]), "noise_share": np.array([0.5, 0.0])}
    level = np.array([2.0, 3.0])
    assert tq.KnownNoise(0.3).sd(values, level) == 0.3
    assert (tq.UnknownNoise().sd(values, level) == values["noise_sd"]).all()
    np.testing.assert_allclose(tq.ProportionalNoise().sd(values, level), [1.1, 0.2])


def test_known_and_named_noise_give_one_posterior():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.7, 1.5, 8), 0.05, seed=1)
    by_sd, by_name, by_object = (
        tq.fit(data, discrepancy="constant", **given).log_evidence
        for given in ({"noise_sd": 0.05}, {"noise": 0.05}, {"noise": tq.KnownNoise(0.05)})
    )
    assert by_sd == by_name == by_object
    with pytest.raises(tq.InputError, match="not both"):
        tq.fit(data, discrepancy="constant", noise_sd=0.05, noise="unknown")


def test_the_level_at_few_stretches_is_the_mean_measured_stress():
    data = tq.Experiment("uniaxial", [0.8, 1.2, 0.8, 1.3, 1.2], [-1.0, 2.0, -3.0, 5.0, -4.0])
    np.testing.assert_allclose(stress_level(data), [2.0, 1.0, 2.0, 5.0, 1.0])


@pytest.mark.parametrize("points", slow_but([40, 300], [40, 300, 1000, 5000]))
def test_the_level_follows_the_true_stress_and_not_its_errors(points):
    stretch = np.random.default_rng(0).permutation(np.linspace(0.6, 2.5, points))
    truth = np.abs(tq.simulate("yeoh", {"C10": 1.2, "C20": -0.057, "C30": 0.004}, stretch).stress)
    data = tq.simulate("yeoh", {"C10": 1.2, "C20": -0.057, "C30": 0.004}, stretch, 0.2, seed=2)
    error = stress_level(data) - truth
    away = truth > 0.6  # nearer to zero the absolute value of an error of either sign adds
    # A smooth fit leaves a fraction of the errors; far fewer than 30 free numbers fit a curve of this kind.
    assert np.sqrt(np.mean(error[away] ** 2)) < 0.2 * np.sqrt(30 / points)
    assert (stress_level(data) >= 0).all()


def test_the_level_depends_on_neither_the_order_nor_the_unit_of_measurements():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.repeat(np.linspace(0.7, 1.5, 9), 2), 0.05, seed=3)
    order = np.random.default_rng(1).permutation(18)
    shuffled = tq.Experiment("uniaxial", data.stretch[order], data.stress[order])
    larger = tq.Experiment("uniaxial", data.stretch, 1e3 * data.stress)
    np.testing.assert_allclose(stress_level(shuffled), stress_level(data)[order], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(stress_level(larger), 1e3 * stress_level(data), rtol=1e-6, atol=1e-6)


def test_measurements_at_one_stretch_have_one_level():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.repeat(np.linspace(0.7, 1.5, 9), 3), 0.2, seed=3)
    assert np.ptp(stress_level(data).reshape(9, 3), axis=1).max() == 0


@pytest.mark.parametrize("sd", [np.nan, np.inf, -1.0, np.ones(7)])
def test_a_noise_whose_sizes_are_no_numbers_is_refused(sd):
    name = property(lambda self: "wrong")  # that of an object is not kept
    noise = type("Wrong", (tq.UnknownNoise,), {"sd": lambda self, values, level: sd, "name": name})()
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(1, 1.5, 16), noise_sd=0.01, seed=1)
    with pytest.raises(tq.ModelError, match="noise 'wrong' cannot be used: sd "):
        tq.fit(data, discrepancy="none", noise_sd=noise)
