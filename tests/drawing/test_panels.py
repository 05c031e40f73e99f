import matplotlib.pyplot as plt
import numpy as np
import pytest

from tissuq.drawing.panels import limits_of, panels, shortened, small_panels
from tissuq.errors import InputError


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def test_axes_that_are_given_are_drawn_on_and_no_figure_is_made():
    figure, given = plt.subplots(1, 2)
    before = plt.get_fignums()
    with panels(given, 2, has_strips=True) as drawn:
        assert drawn.axes == list(given)
        assert not drawn.strips
        assert not drawn.is_new
    assert list(drawn.result) == list(given)
    with panels(given[0], 1) as drawn:
        pass
    assert drawn.result is given[0]
    assert plt.get_fignums() == before
    assert figure.axes == list(given)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7])
def test_a_new_figure_has_as_many_panels_as_are_asked_for_each_above_its_strip(count):
    with panels(None, count, has_strips=True) as drawn:
        figure = drawn.axes[0].figure
    assert len(drawn.axes) == len(drawn.strips) == count
    assert len(figure.axes) == 2 * count
    figure.draw_without_rendering()
    for axis, strip in zip(drawn.axes, drawn.strips, strict=True):
        assert axis.get_position().y0 > strip.get_position().y0
        assert axis.get_position().x0 == pytest.approx(strip.get_position().x0, abs=1e-6)
        axis.set_xlim(2.0, 5.0)
        assert strip.get_xlim() == (2.0, 5.0)


def test_a_new_figure_is_as_wide_as_a_column_or_a_page_of_a_paper():
    widths = []
    for count in (1, 3):
        with panels(None, count) as drawn:
            widths.append(25.4 * drawn.axes[0].figure.get_figwidth())
    assert widths == pytest.approx([89, 183])


def test_what_is_no_axes_or_too_few_is_refused_with_what_to_write():
    with pytest.raises(InputError, match=r"plt\.subplots\(\)\[1\], not 'figure\.png'"), panels("figure.png", 1):
        pass
    few = pytest.raises(InputError, match=r"3 panels, and ax holds 1: give ax=plt\.subplots\(1, 3\)\[1\]")
    with few, panels(plt.subplots()[1], 3):
        pass


def test_a_figure_whose_drawing_fails_is_not_left_open():
    before = plt.get_fignums()
    with pytest.raises(ZeroDivisionError), panels(None, 1):
        raise ZeroDivisionError
    assert plt.get_fignums() == before


def test_the_users_settings_are_as_before():
    before = dict(plt.rcParams)
    with panels(None, 2):
        pass
    with small_panels(1):
        pass
    assert dict(plt.rcParams) == before


def test_a_small_figure_is_unknown_to_windows():
    with small_panels(2) as (figure, drawn):
        assert len(drawn.axes) == len(figure.axes) == 2
    assert not plt.get_fignums()


@pytest.mark.parametrize("far", [1e3, 1e300, np.inf])
def test_what_is_far_beyond_does_not_set_the_limits(far):
    low, high = limits_of([[0.0, 2.0], [1.0]], [[-0.5, 0.0], [2.1, far]])
    assert -0.7 < low < -0.5
    assert 3.0 < high < 3.3 or far == np.inf


def test_all_of_the_core_is_within_the_limits():
    core = np.random.default_rng(1).normal(5, 2, 50)
    low, high = limits_of([core], [[4.9]])
    assert low < core.min() < core.max() < high
    assert limits_of([[2.0, 2.0]], [])[0] < 2 < limits_of([[2.0, 2.0]], [])[1]


def test_a_long_text_loses_its_middle():
    assert shortened("uniaxial", 8) == "uniaxial"
    for letters in (3, 4, 9, 20):
        text = shortened("a-very-long-name-of-a-file", letters)
        assert len(text) == letters
        assert "…" in text
