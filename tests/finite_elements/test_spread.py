"""Bands and shares of the variance, of samples whose moments are known."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.finite_elements.spread import band_of, band_probability, shares_of, standard_errors

GENERATOR = np.random.default_rng(0)


def correlated(count, covariance):
    """Draws (count, 1) of two quantities that have exactly this covariance."""
    plain = GENERATOR.standard_normal((count, 2))
    plain -= plain.mean(axis=0)
    white = plain @ np.linalg.inv(np.linalg.cholesky(np.cov(plain.T))).T
    first, second = (white @ np.linalg.cholesky(covariance).T).T
    return first[:, None], second[:, None]


def test_shares_are_covariances_over_the_variance_with_noise():
    own, rest = correlated(50, np.array([[4.0, -1.5], [-1.5, 1.0]]))
    found = shares_of(7 + own + rest, 5 + own, noise_sd=2.0)
    total = 4 + 1 - 2 * 1.5 + 4
    assert [float(each[0]) for each in (found.parameters, found.discrepancy, found.noise)] == pytest.approx(
        [2.5 / total, -0.5 / total, 4 / total]
    )
    assert found.correlation[0] == pytest.approx(-0.75)


def test_shares_add_up_to_one():
    complete, alone = GENERATOR.standard_normal((2, 20, 3))
    found = shares_of(complete, alone, 0.3)
    np.testing.assert_allclose(found.parameters + found.discrepancy + found.noise, 1.0, rtol=1e-13)


def test_without_discrepancy_all_is_due_to_the_parameters():
    force = GENERATOR.standard_normal((20, 2))
    found = shares_of(force, force)
    parts = [found.parameters, found.discrepancy, found.noise]
    np.testing.assert_allclose(parts, [[1, 1], [0, 0], [0, 0]], rtol=1e-14)
    assert np.isnan(found.correlation).all()


@pytest.mark.parametrize("count", [5, 16, 64, 200])
def test_a_band_holds_a_further_draw_as_often_as_it_says(count):
    """2000 bands, so that the share is within 3 sd, 0.015 and less, but once in 370."""
    draws = np.random.default_rng(count).standard_gamma(2.0, (count + 1, 2000))
    band = band_of(draws[1:])
    held = ((band.low <= draws[0]) & (draws[0] <= band.high)).mean()
    expected = band_probability(count)
    assert held == pytest.approx(expected, abs=3 * np.sqrt(expected * (1 - expected) / 2000))


def test_one_draw_has_no_band():
    with pytest.raises(InputError, match="two draws or more"):
        band_of(np.ones((1, 3)))


def test_bootstrap_errors_are_the_spread_between_samples_of_every_column():
    """Four hundred resamples tell an error to a twenty-eighth; arrays that are resampled alike differ by no more."""

    def statistics(draws, same):
        return {"mean": draws.mean(axis=0), "difference": (draws - same).mean(axis=0)}

    sd = np.array([2.0, 20.0, 0.2])
    draws = np.random.default_rng(1).normal(3.0, sd, (400, 3))
    found = standard_errors(statistics, draws, draws - 1)
    np.testing.assert_allclose(found["mean"], sd / 20, rtol=0.2)
    np.testing.assert_allclose(found["difference"], 0, atol=1e-12)
