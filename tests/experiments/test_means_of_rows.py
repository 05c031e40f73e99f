"""Very many measurements as means of consecutive ones: on the same curve, whatever the order of the rows."""

import numpy as np
import pytest

import tissuq as tq

UP = np.linspace(1.0, 1.5, 9_000)
ORDERS = {
    "a ramp": UP,
    "up and down": np.concatenate([UP, UP[::-1]]),
    "ramps one after another": np.tile(UP, 3),
    "shuffled": np.random.default_rng(0).permutation(UP),
    "repeats": np.repeat(np.linspace(1.0, 1.5, 7), 3_000),
}


@pytest.mark.parametrize("order", ORDERS)
def test_means_lie_on_the_curve(order):
    stretch = ORDERS[order]
    data = tq.Experiment("uniaxial", stretch, np.exp(2 * stretch), standard_error=0.1 * stretch).averaged(2000)
    (curve,) = data.curves
    assert len(stretch) / 30 < len(data) < 2010
    np.testing.assert_allclose(curve.stress, np.exp(2 * curve.points), rtol=1e-6)
    np.testing.assert_allclose(curve.standard_error, 0.1 * curve.points, rtol=1e-12)


def test_consecutive_measurements_are_averaged_by_hand():
    generator = np.random.default_rng(1)
    stress = generator.normal(size=9_000)
    (curve,) = tq.Experiment("uniaxial", UP, stress).averaged(3_000).curves
    np.testing.assert_allclose(curve.stress, stress.reshape(3_000, 3).mean(axis=1), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(curve.points, UP.reshape(3_000, 3).mean(axis=1), rtol=1e-12)


def test_protocols_one_after_another_do_not_mix():
    stretch = np.column_stack([np.tile(UP, 2), np.concatenate([UP, np.ones_like(UP)])])
    stress = np.column_stack([stretch[:, 0] ** 2, stretch[:, 1] ** 3])
    data = tq.Experiment("biaxial", stretch, stress).averaged(2_000)
    assert len(data) < 1_100
    np.testing.assert_allclose(data.stress, data.stretch ** [2, 3], rtol=1e-6)
    np.testing.assert_array_equal(data.curves[0].points, data.curves[1].points)


def test_shuffled_points_of_two_controls_stay_single():
    generator = np.random.default_rng(2)
    stretch = generator.uniform(1.0, 1.5, (9_000, 2))
    data = tq.Experiment("biaxial", stretch, stretch)
    assert len(data.averaged(2_000)) == 9_000


def test_few_measurements_stay_as_they_are_and_short_curves_beside_long_ones():
    short, long = (tq.Experiment("uniaxial", UP[::step], UP[::step] - 1, name=f"{step}") for step in (90, 2))
    assert short.averaged(2_000) is short
    both = tq.Experiment.of([short, long]).averaged(2_000)
    assert [len(curve) for curve in both.curves] == [100, 900]
    assert (both.rows_name, short.rows_name) == ("means of up to 5 measurements", "measurements")


def test_means_are_joined_with_means_of_as_many_measurements_alone():
    long, more = (tq.simulate("neo-hookean", {"C10": 0.5}, UP[::step], 0.05, seed=step) for step in (3, 30))
    of_means = tq.fit(long, discrepancy="none", noise_sd=0.05, tolerances=tq.Tolerances(stress=0.1))
    with pytest.raises(tq.InputError, match=r"\(measurements\) cannot be added .*\(means of 2 measurements\)"):
        of_means.update(more)
    as_many = tq.simulate("neo-hookean", {"C10": 0.5}, UP[::3], 0.05, seed=2).averaged(2000)
    assert of_means.update(as_many).model.experiment.rows_name == "means of 2 measurements"
