"""Curves of draws on common times, whatever increments the solver chose."""

from __future__ import annotations

import numpy as np

from tissuq.decks.model_ensemble import TIMES, ModelEnsemble, on_common_times


def test_curves_with_the_same_times_stay_as_they_are():
    times, rows = on_common_times([([1, 2, 3], [1, 4, 9]), ([1, 2 * (1 + 1e-7), 3], [2, 3, 4])])
    assert times.tolist() == [1, 2, 3]
    np.testing.assert_array_equal(rows, [[1, 4, 9], [2, 3, 4]])


def test_a_curve_that_stopped_is_not_a_number_from_there_on():
    times, rows = on_common_times([([1, 2], [5, 6]), ([1, 2, 3], [1, 2, 3]), ([], []), None])
    assert times.tolist() == [1, 2, 3]
    np.testing.assert_array_equal(rows, [[5, 6, np.nan], [1, 2, 3], [np.nan] * 3, [np.nan] * 3])


def test_curves_with_other_times_are_interpolated_where_they_are():
    times, rows = on_common_times([([0.1, 0.4, 1.0], [1, 4, 10]), ([0.2, 0.5], [3, 6]), ([0.1, 1 + 1e-7], [0, 9])])
    assert (len(times), times[0], times[-1]) == (TIMES, 0.2, 1 + 1e-7)
    np.testing.assert_allclose(rows[0], 10 * times, rtol=1e-6)
    np.testing.assert_allclose(rows[1][times <= 0.5], 1 + 10 * times[times <= 0.5])
    assert np.isnan(rows[1][times > 0.5]).all()
    assert np.isfinite(rows[2]).all()


def test_few_increments_of_a_curve_that_stiffens_are_enough():
    """Chords between these, of a force that grows like e^(3 t), are off by 5 % of the largest."""
    own = [np.array([0.15, 0.35, 0.6, 0.8, 1.0]), np.array([0.1, 0.3, 0.5, 0.75, 1.0])]
    times, rows = on_common_times([(ticks, np.expm1(3 * ticks)) for ticks in own])
    np.testing.assert_allclose(rows, np.tile(np.expm1(3 * times), (2, 1)), atol=0.012 * np.expm1(3))


def test_a_draw_that_fails_without_its_discrepancy_stays_in_the_band():
    generator = np.random.default_rng(0)
    alone = generator.normal(size=(50, 2))
    complete = alone + generator.normal(size=(50, 2))
    alone[:20, 1] = np.nan
    families = {"complete": complete, "alone": alone}
    table = ModelEnsemble({"force": np.array([0.5, 1.0])}, {"force": families}, None, (), (), 0.0).table("force")
    assert table["draws"].tolist() == [50, 50]
    assert table["shared_draws"].tolist() == [50, 30]
    np.testing.assert_allclose(table["mean"], complete.mean(axis=0))
    np.testing.assert_allclose(table["sd"], complete.std(axis=0, ddof=1))
    rows = slice(20, None)
    wanted = np.cov(complete[rows, 1], alone[rows, 1])[0, 1] / complete[rows, 1].var(ddof=1)
    np.testing.assert_allclose(table["parameters"][1], wanted)
    np.testing.assert_allclose(table["parameters"] + table["discrepancy"], 1)


def test_short_times_are_told_apart():
    """Of steps of a microsecond, as in a model of an impact."""
    times, rows = on_common_times([([1e-9, 2e-9], [1, 2]), ([1e-9, 4e-9], [1, 4])])
    assert len(times) == TIMES
    assert np.isnan(rows[0][-1])


def test_the_share_beyond_is_a_whole_per_cent():
    curve = {"complete": np.linspace(1, 2, 50)[:, None]}
    beyond = (np.ones(1), np.ones((50, 1)))
    (text,) = ModelEnsemble({"q": np.ones(1)}, {"q": curve}, beyond, (), (), 0.0).warnings
    assert "At the end 100 % of the elements" in text


def of_one_time(values):
    return ModelEnsemble({"q": np.ones(1)}, {"q": {"complete": np.array(values)[:, None]}}, None, (), (), 0.0)


def test_a_quantity_that_no_draw_changes_is_said():
    same = [text for text in of_one_time([3.5] * 50).warnings if "All draws give the same q" in text]
    assert len(same) == 1
    assert not of_one_time([3.5] * 49 + [3.6]).without_spread
    assert not of_one_time([0.0] * 50).without_spread  # a support that does not move


def test_the_band_is_that_of_the_draws_that_reached_the_end():
    curves = np.column_stack([np.arange(8.0), np.r_[np.arange(5.0), [np.nan] * 3]])
    ensemble = ModelEnsemble({"q": np.array([0.5, 1.0])}, {"q": {"complete": curves}}, None, (), (), 0.0)
    (text,) = ensemble.warnings
    assert text == "5 draws are too few for a 95 % band: the band is their range, which holds 67 %."
