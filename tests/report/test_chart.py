"""The chart of a page shows the posterior's numbers: its data, and what a browser makes of them."""

import html
import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.units import stress_unit
from tissuq.report.chart import chart_data

KPA = stress_unit("kPa")
OPTIONS = {"material": "mooney-rivlin", "discrepancy": "none", "noise_sd": 0.01}
CHROMIUM = "chromium --headless --no-sandbox --disable-gpu --disable-background-networking --virtual-time-budget=4000"


@pytest.fixture(scope="module")
def posterior():
    data = tq.simulate("mooney-rivlin", {"C10": 0.5, "C01": 0.1}, np.linspace(0.8, 1.5, 15), noise_sd=0.01, seed=3)
    return tq.fit(data.labelled(name="pig", stress_unit="kPa"), **OPTIONS)


@pytest.fixture(scope="module")
def data(posterior):
    return chart_data({"none": posterior}, "none", KPA)


def test_the_first_view_has_every_measurement_and_the_posteriors_bands(posterior, data):
    view = {name: np.array(column, float) for name, column in data["views"][0].items() if isinstance(column, list)}
    is_measured = np.isfinite(view["measured"])
    experiment = posterior.model.experiment
    np.testing.assert_allclose(view["x"][is_measured], experiment.stretch, rtol=1e-4)
    np.testing.assert_allclose(view["measured"][is_measured], 1000 * experiment.stress, rtol=1e-4)
    assert (np.diff(view["x"]) >= 0).all()
    for noise, names in ((True, ("low", "median", "high")), (False, ("stress_low", "median", "stress_high"))):
        table = posterior.predict(view["x"], noise=noise, unit="kPa")
        for column, name in zip(("low", "median", "high"), names, strict=True):
            np.testing.assert_allclose(view[name], table[column], rtol=2e-3, atol=0.05)


def test_the_sliders_of_linear_parameters_give_the_stress_of_the_material(posterior, data):
    view, values = data["views"][0], {"C10": 700.0, "C01": -50.0}
    assert [slider["name"] for slider in data["parameters"]] == list(values)
    for slider in data["parameters"]:
        marginal = posterior.marginals[slider["name"]]
        assert slider["value"] == pytest.approx(1000 * marginal.mean, rel=1e-4)
        assert slider["low"] < slider["value"] < slider["high"]
    stretch = np.array(view["x"])
    closed_form = 2 * (stretch - stretch**-2) * values["C10"] + 2 * (1 - stretch**-3) * values["C01"]
    np.testing.assert_allclose(np.array(view["basis"]).T @ list(values.values()), closed_form, rtol=1e-3, atol=0.3)


def test_modes_that_were_not_measured_are_predicted_within_the_measured_strains(posterior, data):
    views = {view["name"]: view for view in data["views"]}
    assert list(views) == ["uniaxial", "equibiaxial (predicted)", "planar (predicted)"]
    planar, stable = views["planar (predicted)"], posterior.stable_ranges["planar"]
    assert (planar["x"][0], planar["x"][-1]) == pytest.approx((stable.low, stable.high), rel=1e-4)
    assert set(planar["measured"]) == {None}


def test_a_formulation_that_says_nothing_of_a_mode_has_no_view_of_it(posterior):
    process = tq.fit(posterior.model.experiment, **OPTIONS | {"discrepancy": "gp"})
    views = chart_data({"none": posterior, "gp": process}, "gp", KPA)["views"]
    assert [(view["formulation"], view["name"]) for view in views] == [("gp", "uniaxial"), ("none", "uniaxial")]


def test_the_data_are_json_of_at_most_a_few_digits(data):
    text = json.dumps(data, allow_nan=False)
    assert max(map(len, re.findall(r"\d+\.?\d*", text))) <= 11


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="Chromium is not installed (make system)")
def test_a_browser_draws_the_chart_and_reads_the_last_measurement_out(posterior, tmp_path):
    file = tmp_path / "pig.csv"
    experiment = posterior.model.experiment
    rows = "".join(f"{x},{1000 * y}\n" for x, y in zip(experiment.stretch, experiment.stress, strict=True))
    file.write_text(f"stretch,stress_kPa\n{rows}", encoding="utf-8")
    fit = [
        sys.executable,
        "-m",
        "tissuq",
        "fit",
        file,
        "--material",
        "mooney-rivlin",
        "--discrepancy",
        "none",
        "--noise-sd",
        "10",
    ]
    subprocess.run([*fit, "--out", tmp_path / "run"], check=True, capture_output=True)
    command = [*CHROMIUM.split(), f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", tmp_path / "run/report.html"]
    page = html.unescape(subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout)
    assert "<canvas" in page
    (said,) = re.findall(r'<p class="chart-readout"[^>]*>([^<]*)<', page)
    table = tq.load(tmp_path / "run").predict([1.5], unit="kPa")
    numbers = [float(text) for text in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", said.replace("95 %", ""))]
    expected = [1.5, 1000 * experiment.stress[-1], *table[["median", "low", "high"]].iloc[0]]
    assert numbers[:5] == pytest.approx(expected, rel=6e-3), said
