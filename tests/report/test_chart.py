"""The chart of a page shows the posterior's numbers: its data, and what a browser makes of them."""

import json
import re

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.units import stress_unit
from tissuq.pictures import curves
from tissuq.pictures.answer import answer_on_new_figure
from tissuq.pictures.curves import described
from tissuq.report.chart import chart_data
from tissuq.report.figures import predictive_figure

KPA = stress_unit("kPa")
OPTIONS = {"material": "mooney-rivlin", "discrepancy": "none", "noise_sd": 0.01}


@pytest.fixture(scope="module")
def posterior():
    data = tq.simulate("mooney-rivlin", {"C10": 0.5, "C01": 0.1}, np.linspace(0.8, 1.5, 15), noise_sd=0.01, seed=3)
    return tq.fit(data.labelled(name="pig", stress_unit="kPa"), **OPTIONS)


@pytest.fixture(scope="module")
def data(posterior):
    return chart_data({"none": posterior}, "none", KPA)


def arrays(mapping):
    return {name: np.array(column, float) for name, column in mapping.items() if name != "formulation"}


def of_node(data, test, node=0):
    """The columns of the material (g, k) at a node of its exponent."""
    return np.array(data["tests"][test]["basis"][node], float).T


def test_the_first_view_has_every_measurement_and_the_posteriors_bands(posterior, data):
    view, test, experiment = arrays(data["views"][0]), data["tests"][0], posterior.model.experiment
    np.testing.assert_allclose(test["measured_at"], experiment.stretch, rtol=1e-4)
    np.testing.assert_allclose(test["measured"], 1000 * experiment.stress, rtol=1e-4)
    assert (np.diff(test["x"]) > 0).all()
    assert (test["x"][0], test["x"][-1]) == pytest.approx((0.8, 1.5))
    for noise, names in ((True, ("low", "median", "high")), (False, ("stress_low", "median", "stress_high"))):
        table = posterior.predict(test["x"], noise=noise, unit="kPa")
        for column, name in zip(("low", "median", "high"), names, strict=True):
            np.testing.assert_allclose(view[name], table[column], rtol=2e-3, atol=0.05)
    assert "alone" not in view  # without a discrepancy the material alone is all


def test_both_ends_of_a_predicted_mode_are_seen_where_one_is_far_larger():
    stretch = np.linspace(1, 6, 21)
    posterior = tq.fit(tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.05, seed=1), discrepancy="none")
    shown = chart_data({"none": posterior}, "none", KPA)
    (number,) = (k for k, test in enumerate(shown["tests"]) if test["name"] == "equibiaxial (predicted)")
    (view,) = (view for view in shown["views"] if view["test"] == number)
    (low, high), x = view["limits"], np.array(shown["tests"][number]["x"])
    assert min(view["median"]) < 5 * low  # compression goes on below
    assert max(view["median"]) > (high - low) / 10
    np.testing.assert_allclose(x[1:] / x[:-1], x[1] / x[0], rtol=1e-3)


def test_the_axis_holds_the_measurements_and_leaves_what_is_far_out():
    vague = tq.simulate("neo-hookean", {"C10": 0.5}, [0.98, 1.0, 1.02, 1.04], noise_sd=0.02, seed=1)
    posterior = tq.fit(vague, discrepancy="none")  # so few that the noise is anything
    view, stress = chart_data({"none": posterior}, "none", KPA)["views"][0], 1000 * vague.stress
    low, high = view["limits"]
    assert low < stress.min() < stress.max() < high
    assert high - low < 2.5 * max(np.ptp(stress), np.ptp(view["median"]))
    assert max(view["high"]) > high


def test_the_sliders_of_linear_parameters_give_the_stress_of_the_material(posterior, data):
    values = {"C10": 700.0, "C01": -50.0}
    assert [slider["name"] for slider in data["parameters"]] == list(values)
    for slider in data["parameters"]:
        marginal = posterior.marginals[slider["name"]]
        assert slider["value"] == pytest.approx(1000 * marginal.mean, rel=1e-4)
        assert slider["low"] < slider["value"] < slider["high"]
        assert slider["unit"] == "kPa"
    stretch = np.array(data["tests"][0]["x"])
    closed_form = 2 * (stretch - stretch**-2) * values["C10"] + 2 * (1 - stretch**-3) * values["C01"]
    np.testing.assert_allclose(of_node(data, 0) @ list(values.values()), closed_form, rtol=1e-3, atol=0.3)


def test_a_slider_ends_where_the_prior_does():
    priors = {"C10": tq.Uniform(0.0, 0.6)}
    vague = tq.simulate("neo-hookean", {"C10": 0.5}, [0.9, 1.1], noise_sd=0.2, seed=1)
    posterior = tq.fit(vague, discrepancy="none", noise_sd=0.2, priors=priors)
    (slider,) = chart_data({"none": posterior}, "none", KPA)["parameters"]
    assert (slider["low"], slider["high"]) == (0.0, 600.0)


def ogden(alpha, x):
    return 2 / alpha * (x ** (alpha - 1) - x ** (-alpha / 2 - 1))


def gent(limit, x):
    return (x - x**-2) / (1 - (x**2 + 2 / x - 3) / limit)


@pytest.mark.parametrize(
    ("law", "symbol", "closed_form", "values"),
    [
        ("ogden-1", "alpha1", ogden, {"mu1": 0.5, "alpha1": 3.0}),
        ("gent", "Jm", gent, {"mu": 0.5, "Jm": 8.0}),  # from one to a hundred times the strains, near which it locks
    ],
)
def test_the_slider_of_an_exponent_interpolates_between_curves_that_are_exact(law, symbol, closed_form, values):
    measured = tq.simulate(law, values, np.linspace(0.7, 1.6, 25), noise_sd=0.1, seed=4)
    posterior = tq.fit(measured, material=law, discrepancy="none", noise_sd=0.1)
    data = chart_data({"none": posterior}, "none", KPA)
    assert [slider["name"] for slider in data["parameters"]] == [*values]
    assert data["fixed"] == []
    exponent, x, nodes = data["parameters"][1], np.array(data["tests"][0]["x"]), data["nodes"]
    scale = np.log if data["is_logarithm"] else np.asarray
    low, high = (float(scale(exponent[end])) for end in ("low", "high"))
    assert (min(nodes), max(nodes)) == pytest.approx((low, high), rel=1e-4)
    columns = [of_node(data, 0, node)[:, 0] for node in range(len(nodes))]
    for value in np.linspace(exponent["low"], exponent["high"], 60):
        found = sum(
            column * np.prod([(scale(value) - other) / (node - other) for other in nodes if other != node])
            for node, column in zip(nodes, columns, strict=True)
        )  # Lagrange's form of the polynomial, of which the page takes the barycentric one
        exact = closed_form(value, x)
        np.testing.assert_allclose(found, exact, atol=0.01 * np.abs(exact).max())


@pytest.mark.slow
def test_several_exponents_stay_at_their_medians_and_are_named():
    values = {"mu1": 0.5, "alpha1": 3.0, "mu2": 0.1, "alpha2": -2.0}
    measured = tq.simulate("ogden-2", values, np.linspace(0.7, 1.6, 14), noise_sd=0.02, seed=4)
    posterior = tq.fit(measured, material="ogden-2", discrepancy="none", noise_sd=0.02)
    data = chart_data({"none": posterior}, "none", KPA)
    assert [slider["name"] for slider in data["parameters"]] == ["mu1", "mu2"]
    assert (data["nodes"], data["fixed"]) == ([], ["alpha1", "alpha2"])
    x = np.array(data["tests"][0]["x"])
    for column, symbol in zip(of_node(data, 0).T, data["fixed"], strict=True):
        alpha = float(posterior.marginals[symbol].quantile(0.5))
        np.testing.assert_allclose(column, 2 / alpha * (x ** (alpha - 1) - x ** (-alpha / 2 - 1)), rtol=1e-3, atol=1e-4)


def test_modes_that_were_not_measured_are_predicted_within_the_measured_strains(posterior, data):
    assert [test["name"] for test in data["tests"]] == ["uniaxial", "equibiaxial (predicted)", "planar (predicted)"]
    planar, stable = data["tests"][2], posterior.stable_ranges["planar"]
    assert (planar["x"][0], planar["x"][-1]) == pytest.approx((stable.low, stable.high), rel=1e-4)
    assert planar["measured"] == []
    (view,) = [view for view in data["views"] if view["test"] == 2]
    table = posterior.predict(planar["x"], mode="planar", unit="kPa")
    np.testing.assert_allclose(view["high"], table["high"], rtol=2e-3, atol=0.05)


@pytest.mark.slow
def test_a_formulation_that_says_nothing_of_a_mode_has_no_view_of_it(posterior):
    process = tq.fit(posterior.model.experiment, **OPTIONS | {"discrepancy": "gp"})
    views = chart_data({"none": posterior, "gp": process}, "gp", KPA)["views"]
    assert [(view["formulation"], view["test"]) for view in views] == [("gp", 0), ("none", 0)]


def test_paths_of_a_test_with_two_controls_are_drawn_by_themselves():
    up = np.linspace(1.02, 1.2, 8)
    points = np.concatenate([np.column_stack([up, up]), np.column_stack([up, 1 + 0.5 * (up - 1)])])
    measured = tq.simulate("neo-hookean", {"C10": 0.5}, points, noise_sd=0.02, seed=2, mode="biaxial")
    data = chart_data({"none": tq.fit(measured, discrepancy="none", noise_sd=0.02)}, "none", KPA)
    for test, x in zip(data["tests"][:4], (up, up, up, 1 + 0.5 * (up - 1)), strict=True):
        np.testing.assert_allclose(test["x"], x, rtol=1e-4)
        np.testing.assert_allclose(test["measured_at"], x, rtol=1e-4)
        assert "path" in test["name"]
    assert [test["control"] for test in data["tests"][:4]] == 2 * ["stretch of axis 1"] + 2 * ["stretch of axis 2"]


def test_a_stress_along_an_axis_that_is_held_is_drawn_against_the_other_one():
    up = np.linspace(1.02, 1.2, 8)
    points = np.concatenate([np.column_stack([up, np.full(8, held)]) for held in (1.0, 1.1)])
    measured = tq.simulate("neo-hookean", {"C10": 0.5}, points, noise_sd=0.02, seed=2, mode="biaxial")
    data = chart_data({"none": tq.fit(measured, discrepancy="none", noise_sd=0.02)}, "none", KPA)
    for number, test in enumerate(data["tests"][:4]):
        np.testing.assert_allclose(test["x"], up, rtol=1e-4)
        assert test["control"] == "stretch of axis 1"
        assert test["name"].endswith(f", stretch of axis 2 {(1.0, 1.1)[number % 2]:g}")


def test_measurements_that_are_no_curve_are_drawn_where_they_were_made_however_many(monkeypatch):
    monkeypatch.setattr("tissuq.report.chart.MAX_MEASUREMENTS", 20)
    points = 1 + np.random.default_rng(0).uniform(0.0, 0.2, (50, 2))
    measured = tq.simulate("neo-hookean", {"C10": 0.5}, points, noise_sd=0.02, seed=2, mode="biaxial")
    posterior = tq.fit(measured, discrepancy="none", noise_sd=0.02)
    data = chart_data({"none": posterior}, "none", KPA)
    for axis, (test, view) in enumerate(zip(data["tests"][:2], data["views"][:2], strict=True)):
        order = np.argsort(points[:, axis])[np.linspace(0, 49, 20).astype(int)]
        assert not test["is_curve"]
        assert test["x"] == test["measured_at"]
        np.testing.assert_allclose(test["x"], points[order, axis], rtol=1e-4)
        np.testing.assert_allclose(test["measured"], 1000 * measured.curves[axis].stress[order], rtol=1e-4)
        first, second = points[order, axis], points[order, 1 - axis]
        closed_form = 1000 * (first - first**-3 * second**-2)  # of engineering stress for C10 = 0.5
        np.testing.assert_allclose(view["median"], closed_form, rtol=0.1, atol=20)


def test_what_is_known_of_the_curves_is_not_computed_anew(posterior, monkeypatch):
    found = {"none": described(posterior.solution)}
    expected = chart_data({"none": posterior}, "none", KPA, found)
    calls = []
    original = curves.predict_bands
    monkeypatch.setattr(curves, "predict_bands", lambda *args, **options: calls.append(1) or original(*args, **options))
    assert chart_data({"none": posterior}, "none", KPA, found) == expected
    answer_on_new_figure(found["none"], KPA, is_narrow=False)
    predictive_figure({"none": posterior}, discrepancy=True, unit=KPA, computed=found)
    assert calls == []
    chart_data({"none": posterior}, "none", KPA)
    assert calls == [1]


def test_the_data_are_json_of_at_most_a_few_digits(data):
    text = json.dumps(data, allow_nan=False)
    assert max(map(len, re.findall(r"\d+\.?\d*", text))) <= 11


def test_measurements_of_unloading_are_told_from_those_of_loading():
    stretch = [*np.linspace(1, 1.3, 6), *np.linspace(1.27, 1.03, 5)]
    cyclic = tq.fit(tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.01, 1), discrepancy="none", noise_sd=0.01)
    (test, *_) = chart_data({"none": cyclic}, "none", KPA)["tests"]
    back = [at for at, is_back in zip(test["measured_at"], test["is_back"], strict=True) if is_back]
    assert sorted(back) == pytest.approx(sorted(stretch[6:]), rel=1e-4)


def test_the_material_alone_is_shown_where_it_is_determined():
    """Of three linear parameters beside an energy that may be any of their sums nothing is known of the sum alone."""
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, np.linspace(0.8, 1.6, 16), noise_sd=0.01, seed=1)
    for material, is_shown in (("yeoh", False), ("neo-hookean", True)):
        posterior = tq.fit(data, material=material, noise_sd=0.01)
        assert ("alone" in chart_data({"auto": posterior}, "auto", KPA)["views"][0]) == is_shown
