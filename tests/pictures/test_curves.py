import numpy as np
import pytest

import gallery
import tissuq as tq
from tissuq.pictures.curves import described, held_along, share_along, ways_of

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


def test_a_test_that_jumps_to_another_held_stretch_follows_a_path_at_each():
    hoop = np.linspace(0.9, 1.3, 20)
    points = np.concatenate([np.column_stack([hoop - 0.1 * n, np.full(20, 1.2 + 0.2 * n)]) for n in range(3)])
    ways = ways_of(tq.loading_modes()["thin-tube"](), points, points[:, 0])
    assert [way.indices.tolist() for way in ways] == [list(range(20 * n, 20 * n + 20)) for n in range(3)]
    assert all(way.is_curve for way in ways)
    assert [held_along(BIAXIAL, points[way.indices]) for way in ways] == [
        f"stretch of axis 2 {at}" for at in ("1.2", "1.4", "1.6")
    ]


@pytest.mark.parametrize("channel", [0, 1])
def test_a_stress_is_drawn_against_its_own_stretch_unless_that_is_held(channel):
    up = np.linspace(1.0, 1.2, 8)
    stress = np.column_stack([up, up])
    both = tq.Experiment("biaxial", np.column_stack([up, 1 + 0.5 * (up - 1)]), stress).curves[channel]
    assert (both.drawn_name, both.drawn_at().tolist()) == (
        f"stretch of axis {channel + 1}",
        both.points[:, channel].tolist(),
    )
    held = 1 + 1e-3 * np.sin(np.arange(8))
    strip = tq.Experiment("biaxial", np.column_stack([up, held]), stress).curves[channel]
    assert (strip.drawn_name, strip.drawn_at().tolist()) == ("stretch of axis 1", up.tolist())


def test_a_tube_is_drawn_along_a_curve_at_each_axial_stretch():
    """In whatever order the rows are, and though one axial stretch is measured with a little scatter."""
    hoop, axial = np.tile(np.linspace(0.9, 1.2, 10), 2), np.repeat([1.3, 1.5], 10)
    order = np.random.default_rng(3).permutation(20)
    points = np.column_stack([hoop, axial + 0.001 * np.sin(np.arange(20))])[order]
    data = tq.Experiment("inflated-tube", points, 0.04 * (hoop - hoop**-3 * axial**-2)[order])
    posterior = gallery.fit(data, discrepancy="none", noise_sd=1e-4)
    (drawn,) = described(posterior.solution)
    assert [way.is_curve for way in drawn.ways] == [True, True]
    for way, rows, at in zip(drawn.ways, drawn.measured_rows, (1.3, 1.5), strict=True):
        on_way = drawn.points[way.indices]
        np.testing.assert_allclose(on_way[:, 1], at, atol=0.001)
        np.testing.assert_allclose(on_way[[0, -1], 0], [0.9, 1.2])
        np.testing.assert_allclose(data.stretch[rows, 1], at, atol=0.001)
        assert len(rows) == 10
    expected = 0.04 * (drawn.points[:, 0] - drawn.points[:, 0] ** -3 * drawn.points[:, 1] ** -2)
    np.testing.assert_allclose(drawn.stress.median, expected, atol=2e-4)
