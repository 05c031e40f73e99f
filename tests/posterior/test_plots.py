"""Pictures of posteriors: what is drawn is what is computed, in the unit of the axes, on the axes that are given."""

import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gallery
import tissuq as tq

STRETCH = np.linspace(0.75, 1.5, 16)


@pytest.fixture(autouse=True)
def _no_figure_is_left_open():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def data():
    found = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, STRETCH, noise_sd=0.02, seed=1)
    return found.labelled(stress_unit="kPa", name="specimen")


@pytest.fixture(scope="module")
def posterior(data):
    return gallery.fit(data, discrepancy="yeoh", noise_sd=0.02)


@pytest.fixture(scope="module")
def plain(data):
    return gallery.fit(data, discrepancy="none", noise_sd=0.02)


@pytest.fixture(scope="module")
def two_tests(data):
    planar = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, STRETCH, 0.02, seed=2, mode="planar")
    return tq.fit([data, planar.labelled(name="sheet")], discrepancy="yeoh", noise_sd=0.02)


def ends_of(collection):
    """Return stretch, low and high of an area, as it was drawn."""
    vertices = collection.get_paths()[0].vertices
    low, high = {}, {}
    for x, y in vertices.tolist():
        low[x], high[x] = min(y, low.get(x, y)), max(y, high.get(x, y))
    at = sorted(low)
    return np.array(at), np.array([low[x] for x in at]), np.array([high[x] for x in at])


def by_label(axis):
    return dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))


@pytest.mark.parametrize("unit", [None, "MPa"])
def test_the_bands_are_those_that_are_predicted_in_the_unit_of_the_axis(posterior, data, unit):
    axis = posterior.plot(unit=unit)
    shown, factor = unit or "kPa", 1.0 if unit else 1000.0
    assert axis.get_ylabel() == f"engineering stress [{shown}]"
    labelled = by_label(axis)
    for label, noise in (("95 % of measurements", True), ("95 % of the stress", False)):
        at, low, high = ends_of(labelled[label])
        band = posterior.predict(at, noise=noise, unit=shown)
        np.testing.assert_allclose(low, band["low"], rtol=1e-9, atol=1e-9 * factor)
        np.testing.assert_allclose(high, band["high"], rtol=1e-9, atol=1e-9 * factor)
    alone = labelled["neo-hookean alone, 95 %"]
    band = posterior.predict(alone.get_xdata(), discrepancy=False, noise=False, unit=shown)
    np.testing.assert_allclose(alone.get_ydata(), band["median"], rtol=1e-9, atol=1e-9 * factor)
    measured = labelled["measured"]
    np.testing.assert_allclose(measured.get_xdata(), data.stretch)
    np.testing.assert_allclose(measured.get_ydata(), factor * data.stress)


def test_the_title_counts_the_measurements_inside(posterior):
    inside = int(posterior.inside_bands()[0].sum())
    assert posterior.plot().get_title(loc="left") == f"{inside} of 16 measurements inside their 95 % band"


def test_without_a_discrepancy_there_is_neither_a_strip_nor_a_material_alone(plain, posterior):
    assert len(plain.plot().figure.axes) == 1
    assert len(posterior.plot().figure.axes) == 2
    assert not [label for label in by_label(plain.plot()) if "alone" in label]
    with pytest.raises(tq.InputError, match="no discrepancy to draw"):
        plain.plot_discrepancy()


@pytest.mark.parametrize("material", ["neo-hookean", "generalised-mooney-rivlin-with-a-long-name"])
def test_no_legend_is_wider_than_its_figure(posterior, material, monkeypatch):
    monkeypatch.setattr(type(posterior.model.material), "name", material)
    for axis in (posterior.plot(), posterior.plot_prediction(), posterior.plot_parameters()[0]):
        figure = axis.figure
        figure.draw_without_rendering()
        (legend,) = figure.legends
        box = legend.get_window_extent()
        assert figure.bbox.x0 <= box.x0 <= box.x1 <= figure.bbox.x1


def test_several_tests_are_panels_and_come_as_an_array(two_tests):
    axes = two_tests.plot()
    assert axes.shape == (2,)
    for axis, test in zip(axes, two_tests.model.experiment.tests, strict=True):
        assert axis.get_title(loc="left").startswith(f"{test.name}\n")
        np.testing.assert_allclose(by_label(axis)["measured"].get_ydata(), 1000 * test.stress)
    _, given = plt.subplots(1, 2)
    assert list(two_tests.plot(given)) == list(given)
    with pytest.raises(tq.InputError, match="2 panels"):
        two_tests.plot(given[0])


def test_two_stresses_of_a_test_are_panels_with_their_own_names():
    along = np.linspace(1.02, 1.2, 6)
    points = np.concatenate([np.column_stack([along, along]), np.column_stack([along, 1 + 0.5 * (along - 1)])])
    sheet = tq.simulate("neo-hookean", {"C10": 0.5}, points, 0.01, seed=3, mode="biaxial")
    axes = tq.fit(sheet, discrepancy="none", noise_sd=0.01).plot()
    assert [axis.get_ylabel() for axis in axes] == ["stress of axis 1 [MPa]", "stress of axis 2 [MPa]"]
    for axis, column in zip(axes, sheet.stress.T, strict=True):
        drawn = np.concatenate([line.get_ydata() for line in axis.lines if line.get_linestyle() == "None"])
        assert sorted(drawn) == sorted(column.tolist())
        assert len(axis.collections) == 2  # a band for each of two paths


CALLS = {
    "plot": lambda posterior, **given: posterior.plot(**given),
    "prediction": lambda posterior, **given: posterior.plot_prediction("planar", **given),
    "parameters": lambda posterior, **given: posterior.plot_parameters(["C10"], **given),
    "discrepancy": lambda posterior, **given: posterior.plot_discrepancy(**given),
    "stability": lambda posterior, **given: posterior.plot_stability(**given),
    "experiment": lambda posterior, **given: posterior.model.experiment.plot(**given),
    "ensemble": lambda posterior, **given: posterior.ensemble(8).plot("planar", **given),
    "compare": lambda posterior, **given: tq.plot_compare([posterior, posterior], **given),
}


@pytest.mark.parametrize("name", CALLS)
def test_axes_that_are_given_are_those_that_come_back(posterior, name):
    figure, axis = plt.subplots()
    settings = dict(plt.rcParams)
    assert CALLS[name](posterior, ax=axis) is axis
    assert axis.has_data()
    assert figure.axes == [axis]
    assert plt.get_fignums() == [figure.number]
    new = CALLS[name](posterior)
    assert new.has_data()
    assert len(plt.get_fignums()) == 2
    assert new.get_xlabel() == axis.get_xlabel() or name == "plot"  # a new figure names it beneath its strip
    assert dict(plt.rcParams) == settings


def test_a_prediction_far_beyond_the_data_keeps_them_legible(posterior, data):
    axis = posterior.plot_prediction("uniaxial", np.linspace(0.5, 4.0, 60))
    low, high = axis.get_ylim()
    stress = 1000 * data.stress
    assert low < stress.min() < stress.max() < high
    assert high - low < 8 * np.ptp(stress)
    hatched = [patch for patch in axis.patches if patch.get_hatch()]
    edges = sorted(edge for patch in hatched for edge in (patch.get_x(), patch.get_x() + patch.get_width()))
    assert edges[1:3] == pytest.approx([STRETCH[0], STRETCH[-1]])
    axis.figure.draw_without_rendering()


@pytest.mark.parametrize("mode", ["uniaxial", "planar"])
def test_vague_data_keep_an_axis_that_is_read_and_it_says_where_the_bands_end(mode):
    vague = tq.simulate("neo-hookean", {"C10": 0.5}, [0.98, 1.0, 1.02, 1.04], noise_sd=0.02, seed=1)
    posterior = gallery.fit(vague.labelled(stress_unit="kPa"), discrepancy="none", noise_sd=0.3)
    axis = posterior.plot_prediction(mode)
    low, high = axis.get_ylim()
    table = posterior.predict(np.linspace(0.98, 1.04, 61), mode=mode)
    assert low < table["median"].min() < table["median"].max() < high
    measured = 1000 * vague.stress if mode == "uniaxial" else table["median"].to_numpy()
    assert high - low < 5.5 * max(np.ptp(measured), np.ptp(table["median"]))
    hidden = [end for end in (table["low"].min(), table["high"].max()) if not low <= end <= high]
    words = [text.get_text() for text in axis.texts]
    assert len(words) == bool(hidden)
    assert hidden or mode == "planar"  # which is drawn farther, on an axis that holds the whole band
    numbers = [float(w) for text in words for w in text[len("bands go on to ") : -len(" kPa")].split(" and ")]
    assert numbers == pytest.approx(hidden, rel=0.1)


def test_a_prediction_shows_the_bands_of_the_mode(posterior):
    axis = posterior.plot_prediction("equibiaxial", unit="MPa")
    median = by_label(axis)["predicted median"]
    band = posterior.predict(median.get_xdata(), noise=False, mode="equibiaxial", unit="MPa")
    low, high = axis.get_ylim()
    inside = (band["median"] > low) & (band["median"] < high)
    assert inside.mean() > 0.5
    np.testing.assert_allclose(median.get_ydata()[inside], band["median"][inside], rtol=1e-9)
    assert "measured" not in by_label(axis)


def test_a_prediction_stops_before_a_material_locks_unless_it_is_asked_for():
    data = tq.simulate("gent", {"mu": 0.3, "Jm": 1.5}, np.linspace(0.7, 1.5, 20), 0.01, seed=1)
    found = tq.fit(data, material="gent", discrepancy="none", noise_sd=0.01)
    median = by_label(found.plot_prediction())["predicted median"]
    assert np.isfinite(median.get_ydata()).all()
    assert median.get_xdata().max() >= 1.5
    with pytest.raises(tq.ModelError, match=r"no stress at a stretch .*of 4"):
        found.plot_prediction(stretch=[1.0, 4.0])
    assert len(plt.get_fignums()) == 1  # that of the first


def test_a_mode_of_several_controls_that_was_not_measured_needs_points(posterior):
    with pytest.raises(tq.InputError, match="stretch="):
        posterior.plot_prediction("biaxial")
    axes = posterior.plot_prediction("biaxial", [[1.0, 1.1], [1.1, 1.1], [1.2, 1.1]])
    assert [axis.get_ylabel() for axis in axes] == [
        "engineering stress of axis 1 [kPa]", "engineering stress of axis 2 [kPa]"
    ]  # fmt: skip


def test_an_error_of_the_stress_is_left_out_of_other_modes_and_the_title_says_so(data):
    found = gallery.fit(data, discrepancy="constant", noise_sd=0.02)
    title = found.plot_prediction("planar").get_title(loc="left")
    assert title == "planar\nneo-hookean alone, discrepancy unknown"
    assert found.plot_prediction().get_title(loc="left") == "uniaxial"


def test_parameters_are_densities_with_priors_and_intervals_in_the_unit(posterior):
    modulus, c10 = posterior.plot_parameters()
    assert (modulus.get_xlabel(), c10.get_xlabel()) == ("initial shear modulus [kPa]", "C10 [kPa]")
    marginal, labelled = posterior.marginals["C10"], by_label(c10)
    np.testing.assert_allclose(labelled["median and 95 % interval"].get_xdata(), 1000 * np.array(marginal.hdi()))
    at, low, high = ends_of(labelled["posterior"])
    np.testing.assert_allclose(high, marginal.pdf(at / 1000) / 1000, atol=1e-12)
    assert not low.any()
    assert np.trapezoid(high, at) == pytest.approx(1.0, abs=5e-3)
    prior = labelled["prior"]
    ends = posterior.model.priors["C10"].support
    np.testing.assert_allclose(prior.get_ydata(), 1 / (1000 * (ends[1] - ends[0])))
    assert "prior" not in by_label(modulus)


def test_what_is_no_parameter_is_refused_before_a_figure_is_made(posterior):
    for call in (lambda: posterior.plot_parameters(["C99"]), lambda: tq.plot_compare([posterior], "C99")):
        with pytest.raises(tq.InputError, match="no parameter 'C99'"):
            call()
    with pytest.raises(tq.InputError, match="nothing to compare"):
        tq.plot_compare({})
    assert not plt.get_fignums()


def test_a_comparison_has_a_row_for_every_fit_with_its_interval(posterior, plain):
    unnamed = tq.plot_compare(fit for fit in (posterior, posterior))
    names = [label.get_text().replace("\n", " ") for label in unnamed.get_yticklabels()]
    assert names[1] == f"{names[0]} (2)"
    plt.close(unnamed.figure)
    axis = tq.plot_compare({"with": posterior, "without": plain}, truth=1.0)
    assert [label.get_text() for label in axis.get_yticklabels()] == ["with", "without"]
    bars = [
        line.get_xdata() for line in axis.lines if line.get_solid_capstyle() == "butt" and len(line.get_xdata()) == 2
    ]
    expected = [1000 * np.array(fit.initial_shear_modulus.hdi()) for fit in (posterior, plain)]
    np.testing.assert_allclose([bar for bar in bars if bar[0] != bar[1]], expected)
    assert axis.get_xlabel() == "initial shear modulus [kPa]"
    assert axis.texts[0].get_text() == "true value 1000"


def test_stability_is_drawn_for_every_mode_as_it_is_computed(posterior):
    axis = posterior.plot_stability()
    lines = by_label(axis)
    assert set(lines.pop("95 %, from where it counts as stable").get_ydata()) == {95.0}
    assert set(lines) == set(posterior.stable_ranges)
    for mode, line in lines.items():
        table = posterior.stability(mode, line.get_xdata())
        np.testing.assert_allclose(line.get_ydata(), 100 * table["stable"])


def test_every_draw_is_a_line_and_their_median_too(posterior):
    draws = posterior.ensemble(12)
    axis = draws.plot("planar", [1.0, 1.1, 1.2], unit="MPa")
    *lines, median = axis.lines
    stress = draws.stress(tq.loading_modes()["planar"](), np.array([1.0, 1.1, 1.2]))
    np.testing.assert_allclose([line.get_ydata() for line in lines], stress, atol=1e-12)
    np.testing.assert_allclose(median.get_ydata(), np.median(stress, axis=0), atol=1e-12)
    with pytest.raises(tq.InputError, match="one control and one stress"):
        draws.plot("biaxial")


def test_laws_are_rows_with_their_moduli_and_the_average_last(data):
    found = tq.fit_laws(data, ["neo-hookean", "yeoh"], discrepancy="none", noise_sd=0.02)
    axis = found.plot()
    names = [label.get_text() for label in axis.get_yticklabels()]
    assert names == ["yeoh (100 %)", "neo-hookean (< 0.1 %)", "all, by probability"]
    bars = [line.get_xdata() for line in axis.lines if len(line.get_xdata()) == 2 and line.get_marker() == "None"]
    moduli = [found.fits["yeoh"].initial_shear_modulus, found.fits["neo-hookean"].initial_shear_modulus, found.modulus]
    np.testing.assert_allclose(bars, [1000 * np.array(modulus.hdi()) for modulus in moduli])
    page = found._repr_html_()
    assert "stresses in kPa" in page
    assert page.index("yeoh") < page.index("neo-hookean")


def test_notebooks_show_a_table_and_a_figure_and_leave_none_open(posterior, two_tests, plain):
    shown = [posterior, two_tests, posterior.model.experiment, two_tests.model.experiment, posterior.ensemble(4)]
    pages = [thing._repr_html_() for thing in [*shown, tq.average({"yeoh": posterior, "none": plain})]]
    assert [page.count("<table") for page in pages] == [1] * 6
    assert [page.count("<svg") for page in pages] == [1, 1, 1, 1, 0, 0]
    assert all("stresses in kPa" in page or "[kPa]" in page for page in pages)
    assert not plt.get_fignums()


def test_a_notebook_shows_a_posterior_without_any_further_fit(posterior, monkeypatch):
    monkeypatch.setattr(type(posterior.solver), "solve", lambda *_: pytest.fail("fitted again"))
    assert "<svg" in posterior._repr_html_()


@pytest.mark.slow
def test_importing_and_fitting_do_not_import_matplotlib():
    code = (
        "import sys, tissuq as tq\n"
        "data = tq.simulate('neo-hookean', {'C10': 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.02, seed=1)\n"
        "tq.fit(data, discrepancy='none', noise_sd=0.02).summary(), tq.plot_compare, tq.Population, tq.Prediction\n"
        "print([name for name in sys.modules if name.startswith('matplotlib')])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "[]"
