"""Smooth curves through measurements, and how far these scatter about them."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.experiments.smoothing import scatter, smoothed

PLACE = np.sort(np.random.default_rng(1).uniform(0.6, 2.0, 60))


def curve(place):
    return 2 * (place - place**-2)


def test_a_parabola_has_no_scatter():
    assert scatter(PLACE, 3 - 2 * PLACE + 0.7 * PLACE**2) < 1e-9


@pytest.mark.parametrize("copies", [1, 3])
def test_the_scatter_is_the_noise_of_single_measurements(copies):
    place, found = np.repeat(PLACE, copies), []
    for seed in range(200):
        noise = 0.05 * np.random.default_rng(seed).standard_normal(len(place))
        found.append(scatter(place, curve(place) + noise) ** 2)
    mean, error = np.mean(found), np.std(found) / np.sqrt(len(found))
    assert abs(mean - 0.05**2) < 4 * error + 0.01 * 0.05**2  # the curve itself adds a little


def test_few_places_tell_no_scatter():
    assert scatter(np.repeat([1.0, 1.1, 1.2, 1.3, 1.4, 1.5], 2), np.arange(12.0)) is None


def test_stress_and_slope_are_those_of_the_curve():
    found = smoothed(PLACE, curve(PLACE) + 0.001 * np.random.default_rng(2).standard_normal(60))
    inner = slice(3, -3)
    assert np.allclose(found.stress[inner], curve(PLACE)[inner], atol=0.004)
    assert np.allclose(found.slope[inner], 2 * (1 + 2 * PLACE[inner] ** -3), rtol=0.03)


def test_few_places_have_their_means_and_the_slope_between():
    found = smoothed(np.array([1.0, 2.0, 2.0, 3.0]), np.array([0.0, 3.0, 5.0, 8.0]))
    assert found.stress.tolist() == [0.0, 4.0, 4.0, 8.0]
    assert found.slope.tolist() == [4.0, 4.0, 4.0, 4.0]


def test_places_that_hardly_differ_have_their_means_too():
    copies = [4, 4, 5, 4, 4]
    place, stress = np.repeat(1 + 1e-6 * np.arange(5), copies), np.repeat([1.0, 2.0, 2.0, 3.0, 3.0], copies)
    assert smoothed(place, stress).stress.tolist() == pytest.approx(stress.tolist())


@pytest.mark.slow
def test_thousands_of_places_are_smoothed_in_groups():
    place = np.linspace(0.6, 2.0, 30_000)
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(place))
    found = smoothed(place, curve(place) + noise)
    assert np.abs(found.stress - curve(place)).max() < 0.02
    assert scatter(place, curve(place) + noise) == pytest.approx(0.05, rel=0.05)
