import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from tissuq.drawing import pieces
from tissuq.drawing.style import inline_svg, new_figure


@pytest.fixture
def axis():
    return Figure().subplots()


def test_a_band_is_an_area_or_bars_at_points_that_follow_no_path(axis):
    x, low, high = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 1.5]), np.array([1.0, 3.0, 4.0])
    pieces.band(axis, x, low, high, label="area")
    (path,) = axis.collections[0].get_paths()
    corners = {tuple(vertex) for vertex in path.vertices.tolist()}
    assert corners == {*zip(x, low, strict=True), *zip(x, high, strict=True)}
    pieces.band(axis, x, low, high, ways=[(slice(None), False)])
    bars = np.array(axis.collections[1].get_segments())
    np.testing.assert_array_equal(bars[:, :, 0].T, [x, x])
    np.testing.assert_array_equal(bars[:, :, 1].T, [low, high])


def test_measurements_have_their_standard_errors(axis):
    x, y, error = np.array([1.0, 2.0]), np.array([3.0, 5.0]), np.array([0.5, 0.25])
    pieces.points(axis, x, y, error=error)
    (drawn,) = axis.containers
    ends = np.array(drawn[2][0].get_segments())[:, :, 1]
    np.testing.assert_allclose(ends, np.column_stack([y - error, y + error]))
    assert drawn.get_label() == "measured ± standard error"
    pieces.points(axis, x, y, error=0 * error)
    assert len(axis.containers) == 1  # nothing where there are none


def test_measurements_of_unloading_look_different_and_are_named(axis):
    x, y = np.array([1.0, 1.2, 1.1]), np.array([0.0, 2.0, 0.7])
    pieces.points(axis, x, y, is_back=np.array([False, False, True]))
    loading, back = axis.lines
    assert [loading.get_label(), back.get_label()] == ["measured, loading", "measured, unloading"]
    assert list(back.get_xdata()) == [1.1]
    assert (back.get_marker(), back.get_markerfacecolor()) != (loading.get_marker(), loading.get_markerfacecolor())
    pieces.points(axis, x, y, is_back=np.zeros(3, dtype=bool))
    assert axis.lines[-1].get_label() == "measured"


def test_the_line_at_the_end_of_what_was_measured_is_explained_once(axis):
    axis.set_xlim(0.5, 2.0)
    pieces.outside(axis, 0.8, 1.5, "extrapolated")
    assert axis.get_legend_handles_labels()[1] == ["extrapolated", "end of the measured strains"]


def test_very_many_measurements_are_summed_up_in_bins(axis):
    x = np.linspace(0, 1, 12_000)
    pieces.points(axis, x, 2 * x)
    (means,) = axis.lines
    assert len(means.get_xdata()) == 120
    np.testing.assert_allclose(means.get_ydata(), 2 * means.get_xdata(), atol=1e-9)
    assert means.get_label().startswith("measured (12000, in bins)")


def test_intervals_have_a_mark_in_their_middle_and_one_label(axis):
    levels = pieces.rows(axis, ["top", "below"])
    assert levels.tolist() == [1.0, 0.0]
    assert [label.get_text() for label in axis.get_yticklabels()] == ["top", "below"]
    pieces.forest(axis, levels, [1.0, 2.0], [1.5, 2.5], [3.0, 4.0], label="95 %")
    *bars, marks = axis.lines
    np.testing.assert_array_equal([bar.get_xdata() for bar in bars], [[1.0, 3.0], [2.0, 4.0]])
    np.testing.assert_array_equal([bar.get_ydata() for bar in bars], [[1.0, 1.0], [0.0, 0.0]])
    assert list(marks.get_xdata()) == [1.5, 2.5]
    assert axis.get_legend_handles_labels()[1] == ["95 %"]


def test_a_density_keeps_its_heights_unless_it_is_to_be_so_tall(axis):
    x, height = np.array([0.0, 1.0, 2.0]), np.array([0.0, 4.0, 0.0])
    for level, top, highest in ((0.0, None, 4.0), (2.0, 0.5, 2.5)):
        pieces.density(axis, x, height, level=level, top=top)
        vertices = axis.collections[-1].get_paths()[0].vertices
        assert vertices[:, 1].max() == highest
        assert vertices[:, 1].min() == level


def test_a_table_of_colours_says_the_numbers_that_are_known(axis):
    values = np.array([[0.2, np.nan], [0.9, 1.0]])
    colors = LinearSegmentedColormap.from_list("two", ["white", "black"])
    pieces.heat(axis, values, 100 * values, ["a", "b"], ["one", "two"], colors)
    assert {text.get_position(): text.get_text() for text in axis.texts} == {(0, 0): "20", (0, 1): "90", (1, 1): "100"}
    assert [label.get_text() for label in axis.get_xticklabels()] == ["a", "b"]


def test_only_what_is_outside_is_hatched(axis):
    axis.set_xlim(0.0, 10.0)
    pieces.outside(axis, -1.0, 6.0, "extrapolated")
    (patch,) = axis.patches
    assert (patch.get_x(), patch.get_x() + patch.get_width()) == (6.0, 10.0)
    assert patch.get_hatch()


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        ([0.1, 0.2], [0.8, 0.9], []),
        ([-3.14, 0.2], [0.8, 0.9], ["bands go on to -3.1 kPa"]),
        ([-2.0, np.nan], [2.5e7, 0.9], ["bands go on to -2e+00 and 2e+07 kPa"]),
    ],
)
def test_bands_that_leave_the_axis_are_said_to(axis, low, high, words):
    axis.set_ylim(0, 1)
    pieces.cut_off(axis, low, high, "kPa")
    assert [text.get_text() for text in axis.texts] == words


def test_widths_go_with_the_size_of_letters(axis):
    for size in (10, 20):
        with mpl.rc_context({"font.size": size}):
            pieces.line(axis, [0, 1], [0, 1])
    thin, thick = (drawn.get_linewidth() for drawn in axis.lines)
    assert thick == pytest.approx(2 * thin)


def test_an_inline_figure_is_one_svg_element_with_words_and_text():
    with new_figure(3, 2) as figure:
        figure.subplots().set_xlabel("stretch & more")
    text = inline_svg(figure, "Measurements")
    assert text.startswith('<svg role="img" aria-label="Measurements" ')
    assert text.rstrip().endswith("</svg>")
    assert "stretch &amp; more" in text
