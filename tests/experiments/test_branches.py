import numpy as np
import pytest

from tissuq.experiments.branches import unloading

UP, DOWN = np.linspace(1.0, 1.3, 10), np.linspace(1.28, 1.0, 9)


def test_both_cycles_of_a_test_come_back():
    is_back = unloading(np.concatenate([UP, DOWN, UP[1:], DOWN]), 1.0)
    np.testing.assert_array_equal(is_back, np.repeat([False, True, False, True], [10, 9, 9, 9]))


def test_a_cycle_through_rest_comes_back_to_it_and_goes_on_in_compression():
    through = np.concatenate([UP, np.linspace(1.28, 0.72, 15), np.linspace(0.74, 1.0, 8)])
    is_back = unloading(through, 1.0)
    assert is_back[10:18].all()  # 1.28 to 1.0
    assert not is_back[18:25].any()  # on to 0.72
    assert is_back[25:].all()


@pytest.mark.parametrize(
    "points",
    [
        np.linspace(0.8, 1.3, 20),  # from compression through rest: no way back is known as such
        np.concatenate([UP, UP]),  # two tests beneath one another
        np.concatenate([np.linspace(0.8, 1.3, 12)] * 2),
        np.concatenate([UP, np.linspace(1.0, 0.8, 10)]),  # tension, and beneath it compression from rest
        np.random.default_rng(3).permutation(np.linspace(1.0, 1.3, 30)),
        np.column_stack([UP, UP]),
        [1.0, 1.1, 1.0],
    ],
)
def test_what_never_turns_back_has_no_unloading(points):
    assert not unloading(points, 1.0).any()
