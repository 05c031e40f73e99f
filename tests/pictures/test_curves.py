import numpy as np
import pytest

import gallery
import tissuq as tq
from tissuq.pictures.curves import share_along, ways_of

BIAXIAL = tq.loading_modes()["biaxial"]()


def test_the_share_of_a_discrepancy_is_that_of_the_true_energies():
    stretch = np.linspace(0.7, 1.6, 40)
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=1e-5, seed=1)
    posterior = gallery.fit(data, material="neo-hookean", discrepancy="yeoh", noise_sd=1e-5)
    (way,), at, (low, median, high) = share_along(posterior.solution, data.curves[0])
    assert way.is_curve
    excess = at**2 + 2 / at - 3
    true = 2 * 0.1 * excess / (0.5 + 2 * 0.1 * excess)  # of dW/dI1
    known = np.isfinite(median)
    assert np.abs(at[~known] - 1).max() < 0.05  # where there is next to no stress
    np.testing.assert_allclose(median[known], true[known], atol=2e-3)
    assert (low[known] <= high[known]).all()


def test_two_controls_follow_a_path_until_the_test_goes_back():
    up = np.linspace(1.02, 1.2, 8)
    first, second = np.column_stack([up, up]), np.column_stack([up, 1 + 0.5 * (up - 1)])
    points = np.concatenate([first, second])
    ways = ways_of(BIAXIAL, points, points[:, 0])
    assert [way.indices.tolist() for way in ways] == [list(range(8)), list(range(8, 16))]
    assert all(way.is_curve for way in ways)


@pytest.mark.parametrize(
    "points",
    [
        np.column_stack([np.full(6, 1.1), np.linspace(1.0, 1.2, 6)]),  # nothing changes along the axis
        1 + 0.2 * np.random.default_rng(2).random((40, 2)),  # no path at all
    ],
)
def test_points_that_follow_no_path_are_drawn_by_themselves(points):
    ways = ways_of(BIAXIAL, points, points[:, 0])
    assert not any(way.is_curve for way in ways)
    assert sorted(np.concatenate([way.indices for way in ways])) == list(range(len(points)))
