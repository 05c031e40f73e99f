from itertools import cycle, islice

import numpy as np
import pytest

import tissuq as tq
from tissuq.drawing.style import save_figure
from tissuq.experiments.units import StressUnit
from tissuq.pictures.answer import answer_on_new_figure
from tissuq.report.figures import described_curves, marginal_figure, predictive_figure

KPA = StressUnit("kPa", 1e-3)


def first(posteriors, count):
    """Return so many posteriors by name, further ones under further names."""
    names = (f"{name}{' again' * turn}" for turn in range(count) for name in posteriors)
    return dict(islice(zip(names, cycle(posteriors.values()), strict=False), count))


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 7, *(pytest.param(count, marks=pytest.mark.slow) for count in (3, 4, 5, 6))])
def test_every_column_of_panels_has_tick_labels_beneath_its_lowest_panel(specimen_study, count):
    figure = predictive_figure(first(specimen_study.posteriors, count), discrepancy=True, unit=KPA)
    shown = [axis for axis in figure.axes if axis.get_visible()]
    assert len(shown) == count
    figure.draw_without_rendering()
    lowest = {}
    for axis in shown:
        lowest[axis.get_subplotspec().colspan.start] = axis
    for axis in lowest.values():
        labels = [label for label in axis.get_xticklabels() if label.get_visible() and label.get_text()]
        assert len(labels) >= 2
    assert sum(axis.xaxis.get_tick_params()["labelbottom"] for axis in shown) == len(lowest)


def test_panels_share_the_limits_of_stress_and_hold_every_measurement(specimen_study):
    figure = predictive_figure(specimen_study.posteriors, discrepancy=False, unit=KPA)
    shown = [axis for axis in figure.axes if axis.get_visible()]
    assert len({axis.get_ylim() for axis in shown}) == 1
    low, high = shown[0].get_ylim()
    stress_kpa = 1000 * specimen_study.experiment.stress
    assert low < stress_kpa.min() < stress_kpa.max() < high


def test_a_panel_tells_how_many_measurements_are_inside_its_band(specimen_study):
    figure = predictive_figure(specimen_study.posteriors, discrepancy=True, unit=KPA)
    for axis, (name, posterior) in zip(figure.axes, specimen_study.posteriors.items(), strict=False):
        stretch, stress = posterior.model.experiment.stretch, posterior.model.experiment.stress
        band = posterior.predict(stretch, unit="MPa")
        inside = int(((band["low"] <= stress) & (stress <= band["high"])).sum())
        assert axis.get_title(loc="left") == f"{name}:  {inside} of 12 inside"


def test_the_axis_names_the_unit_of_the_file(specimen_study):
    posteriors = first(specimen_study.posteriors, 2)
    assert predictive_figure(posteriors, discrepancy=True, unit=KPA)._supylabel.get_text() == (
        "engineering stress [kPa]"
    )
    assert marginal_figure(posteriors, "C10", KPA).axes[0].get_xlabel() == "C10 [kPa]"


def test_a_marginal_bar_is_the_95_percent_interval_in_the_unit_of_the_file(specimen_study):
    posteriors = first(specimen_study.posteriors, 1)
    (posterior,) = posteriors.values()
    axis = marginal_figure(posteriors, "C10", KPA, truth=1.2).axes[0]
    bar = next(line for line in axis.lines if line.get_linewidth() == 4)
    np.testing.assert_allclose(bar.get_xdata(), 1000 * np.array(posterior.solution.marginals["C10"].hdi()))
    assert axis.texts[0].get_text() == "true value 1200"


@pytest.mark.slow
def test_the_same_figure_is_saved_as_the_same_bytes(specimen_study, tmp_path):
    posteriors = first(specimen_study.posteriors, 2)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        save_figure(predictive_figure(posteriors, discrepancy=True, unit=KPA), tmp_path / name, "figure")
    for kind in ("svg", "png"):
        one, two = ((tmp_path / name / f"figure.{kind}").read_bytes() for name in ("one", "two"))
        assert one == two


def test_drawing_leaves_the_users_matplotlib_settings_alone(specimen_study):
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    predictive_figure(first(specimen_study.posteriors, 1), discrepancy=True, unit=KPA)
    assert dict(mpl.rcParams) == before


def test_stretches_beyond_which_stability_is_lost_are_shaded():
    data = tq.datasets.load("rubber-treloar-uniaxial")
    for material, shaded in (("mooney-rivlin", [(1.0, 7.512)]), ("neo-hookean", [])):
        posteriors = {"none": tq.fit(data, material=material, discrepancy="none")}
        (axis,) = predictive_figure(posteriors, discrepancy=False, unit=KPA).axes
        spans = [patch for patch in axis.patches if "stability" in patch.get_label()]
        assert [(span.get_x(), span.get_x() + span.get_width()) for span in spans] == shaded


def test_no_legend_is_wider_than_its_figure():
    data = tq.datasets.load("rubber-treloar-uniaxial")
    posteriors = {"none": tq.fit(data, material="mooney-rivlin", discrepancy="none")}
    figure = predictive_figure(posteriors, discrepancy=True, unit=KPA)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().width <= figure.bbox.width


def test_dollar_signs_in_a_name_are_shown_as_they_are(specimen_study, tmp_path):
    name = "price $5_$ and $\\frac.csv"
    figure = predictive_figure({name: next(iter(specimen_study.posteriors.values()))}, discrepancy=True, unit=KPA)
    save_figure(figure, tmp_path, "named")
    assert figure.axes[0].get_title(loc="left").startswith(name)


@pytest.mark.slow
@pytest.mark.parametrize(("is_narrow", "width"), [(False, 1000), (True, 400)])
def test_the_answer_has_the_width_of_a_page_and_letters_that_are_read_there(specimen_study, tmp_path, is_narrow, width):
    figure = answer_on_new_figure(described_curves(specimen_study.posteriors["auto"]), KPA, is_narrow=is_narrow)
    assert (96 * figure.get_size_inches()).tolist() == pytest.approx([width, 480])
    figure.draw_without_rendering()
    least = min(text.get_fontsize() for text in figure.findobj(lambda drawn: hasattr(drawn, "get_fontsize")))
    assert least * 96 / 72 >= 11  # pixels of the page
    page = figure.bbox
    (legend,) = figure.legends
    for shown in (legend, *figure.axes):
        box = shown.get_tightbbox()
        assert page.x0 - 1 <= box.x0 <= box.x1 <= page.x1 + 1
        assert page.y0 - 1 <= box.y0 <= box.y1 <= page.y1 + 1
    axis = figure.axes[0]
    assert axis.get_ylabel() == "engineering stress [kPa]"
    (measured,) = [line for line in axis.lines if line.get_label() == "measured"]
    np.testing.assert_allclose(measured.get_ydata(), 1000 * specimen_study.experiment.stress)
    save_figure(figure, tmp_path, "answer")
    head = (tmp_path / "answer.svg").read_text()[:2000]
    assert f'width="{0.75 * width:g}pt"' in head


def test_the_answer_to_several_tests_grows_by_rows():
    stretch = np.linspace(0.8, 1.3, 8)
    modes = ("uniaxial", "planar", "equibiaxial")
    tests = [tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.02, seed=1, mode=mode) for mode in modes]
    posterior = tq.fit(tests, discrepancy="none", noise_sd=0.02)
    wide, narrow = (
        answer_on_new_figure(described_curves(posterior), KPA, is_narrow=is_narrow) for is_narrow in (False, True)
    )
    assert 96 * wide.get_figheight() == pytest.approx(480)
    assert 96 * narrow.get_figheight() == pytest.approx(480 + 2 * 300)
    assert len({axis.get_subplotspec().colspan.start for axis in narrow.axes}) == 1
    assert [axis.get_ylabel() for axis in narrow.axes] == ["engineering stress [kPa]"] * 3
    assert [axis.get_ylabel() for axis in wide.axes] == ["engineering stress [kPa]", "", ""]
