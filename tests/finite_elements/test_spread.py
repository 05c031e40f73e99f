"""Bands and shares of the variance, of samples whose moments are known."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.experiments.modes import loading_mode
from tissuq.finite_elements.spread import (
    band_of,
    band_probability,
    force_table,
    mesh_factor,
    mesh_free,
    shares_of,
    standard_errors,
)

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


def test_the_error_of_the_mesh_is_one_more_share_of_the_variance_of_what_is_corrected():
    """Against draws that are corrected one by one, with an error of their own of a quarter of the correction."""
    complete, alone = 5 + GENERATOR.standard_normal((2, 40, 2))
    factor = mesh_factor(np.array([1.0, 2.0]), [(1.0, -0.1), (2.0, -0.2)], 4.0)
    assert factor == pytest.approx([1 - 4 / 30, 1 - 8 / 30])
    table = mesh_free(force_table(np.array([1.0, 2.0]), complete, alone, None, 0.3), factor)
    scaled = shares_of(factor * complete, factor * alone, 0.3)
    spread = complete.mean(axis=0) * (1 - factor) / 4
    own = (factor * complete).var(axis=0, ddof=1) + 0.3**2
    total = own + spread**2
    np.testing.assert_allclose(table["mesh"], spread**2 / total)
    for name in ("parameters", "discrepancy", "noise"):
        np.testing.assert_allclose(table[name], getattr(scaled, name) * own / total)
    np.testing.assert_allclose(table[["parameters", "discrepancy", "noise", "mesh"]].sum(axis=1), 1)
    np.testing.assert_allclose(table["mesh_free_sd"] ** 2, total - 0.3**2)
    assert (table["mesh_error"] > 0).all()


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


def test_independent_sources_are_taken_out_of_parameters_and_discrepancy():
    """A quantity whose parts have variances 4, 1, 0.09 (linear) + 0.5 (square), 0.25, all independent."""
    generator = np.random.default_rng(5)
    own, rest, score, scale = generator.standard_normal((4, 40000, 1))
    beyond = 0.3 * score + 0.5 * (score**2 - 1)
    complete = 2 * own + rest + beyond + 0.5 * scale
    sources = {"extrapolation": np.hstack([score, score**2 - 1]), "test_scale": 0.05 * scale}
    found = shares_of(complete, 2 * own + 0.4 * scale, 1.0, sources)
    total = 4 + 1 + 0.59 + 0.25 + 1
    for name, variance in {"parameters": 4, "discrepancy": 1, "extrapolation": 0.59, "test_scale": 0.25}.items():
        assert getattr(found, name)[0] == pytest.approx(variance / total, abs=0.012), name
    names = "parameters", "discrepancy", "extrapolation", "test_scale", "noise"
    assert sum(getattr(found, name)[0] for name in names) == pytest.approx(1.0, rel=1e-12)
    few = shares_of(complete[:19], complete[:19], 0.0, {name: values[:19] for name, values in sources.items()})
    assert np.isnan(few.extrapolation).all()
    assert few.parameters[0] == pytest.approx(1.0)


def test_what_grows_as_an_exponential_of_the_score_is_due_to_it():
    """Q = A exp(z): Var E[Q | z] = E[A]^2 Var exp(z), of which straight line and square leave a tenth unexplained."""
    generator = np.random.default_rng(9)
    score, size = generator.standard_normal((20000, 1)), 1 + 0.1 * generator.standard_normal((20000, 1))
    force = size * np.exp(score)
    found = shares_of(force, force, 0.0, {"extrapolation": np.hstack([score, score**2 - 1])})
    variance = np.exp(1) * (np.exp(1) - 1)
    assert found.extrapolation[0] == pytest.approx(variance / (variance + 0.01 * np.exp(2)), abs=0.01)
    assert found.parameters[0] + found.extrapolation[0] == pytest.approx(1, rel=1e-9)


def test_draws_of_a_posterior_tell_how_they_go_on_and_what_their_tests_share(posterior):
    """The quantity is the planar stress beyond the data, of which the score is all that is random at the end."""
    ensemble = posterior.ensemble(64)
    assert set(ensemble.sources) <= {"extrapolation", "test_scale"}
    score = ensemble.sources["extrapolation"][:, 0]
    assert score.mean() == pytest.approx(0, abs=0.1)
    assert score.std() == pytest.approx(1, abs=0.15)
    _, high = ensemble.ranges["planar"]
    at_both = (1 + share * (high - 1) for share in (0.9, 1.5))
    within, beyond = (ensemble.stress(loading_mode("planar"), np.array([at])) for at in at_both)
    shares = [shares_of(stress, stress, 0.0, ensemble.sources).extrapolation[0] for stress in (within, beyond)]
    assert shares[0] < 0.1
    assert 0.8 < shares[1] <= 1
