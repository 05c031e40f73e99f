"""The folder of a ranking of tests."""

from __future__ import annotations

import json
import shlex
import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.next_test.targets import target_named
from tissuq.parameters.priors import prior_from
from tissuq.report.design import _best, _noise_option, design_figure, design_result, design_table
from tissuq.report.result import Result, Table
from tissuq.report.writer import write_result
from tissuq.result_warning import ResultWarning
from tissuq.studies.design import DesignSettings, DesignStudy
from tissuq.studies.option_texts import priors


@pytest.fixture(scope="module")
def study():
    data = tq.simulate("gent", {"mu": 1.0, "Jm": 1.2}, np.linspace(0.75, 1.6, 16), 0.02, seed=1)
    data = tq.Experiment("uniaxial", data.stretch, data.stress, "gent & co").labelled(stress_unit="kPa")
    posterior = tq.fit(data, material="gent", discrepancy="none", noise_sd=0.02)
    targets = [target_named(each, posterior.model) for each in ("modulus", "Jm")]
    table = posterior.design(points=(8,), target=["modulus", "Jm"])
    settings = DesignSettings(run="run", targets=("modulus", "Jm"), points=(8,))
    return DesignStudy(settings, posterior, tuple(targets), table, "same", 0.18)


def test_numbers_are_in_the_unit_of_the_data(study):
    first, second = study.targets
    table = design_table(study, first)
    rows = table.rows
    best = study.table[study.table["target"] == "modulus"].iloc[0]
    assert rows[0][0] == best["candidate"]
    assert float(rows[0][1]) == pytest.approx(best["sd_after"], rel=0.005)
    assert rows[0][2].startswith(f"{100 * best['reduction']:.1f} %")
    assert table.title.endswith("kPa now")
    assert "kPa" not in design_table(study, second).title
    assert rows[-1][1:3] == ["", ""]


def test_the_next_step_says_where_the_same_test_again_is_as_good(study, tmp_path):
    repeats, words = study.table["is_repeat"], "(the same test again lowers it as much), and fit it together"
    for loss, is_said in ((0.005, True), (0.03, False)):
        best = study.table.loc[~repeats & (study.table["target"] == "modulus"), "reduction"].max()
        table = study.table.assign(reduction=study.table["reduction"].mask(repeats, best - loss))
        result = design_result(replace(study, table=table), study.settings, tmp_path / "run")
        assert (words in result.next_step) is is_said


def test_the_next_step_fits_what_was_fitted(study, tmp_path):
    result = design_result(study, study.settings, tmp_path / "run")
    words = "tissuq fit DATA.csv NEW.csv --material gent --discrepancy none --mode uniaxial --mode "
    assert words in result.next_step
    assert "--noise-sd 20 --estimand as-tested" in result.next_step  # kPa


@pytest.mark.parametrize(
    ("options", "mode", "said"),
    [
        ({"noise_sd": [0.01, 0.04]}, "equibiaxial", " --noise-sd 10,0.04,20"),  # geometric mean of all for a new mode,
        ({"noise_sd": [0.01, 0.04]}, "planar", " --noise-sd 10,0.04,40"),  # and of those in one that was measured
        ({"noise_sd": 0.02}, "planar", " --noise-sd 20,0.02,20"),
        ({"noise": "proportional"}, "planar", " --noise proportional"),
        ({}, "planar", ""),
    ],
)
def test_the_next_step_has_the_noise_of_the_fit(options, mode, said):
    stretch = [0.7, 0.9, 1.1, 1.3, 1.6]
    measured = [
        tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.02, seed=1, mode=name).labelled(stress_unit=unit)
        for name, unit in (("uniaxial", "kPa"), ("planar", "MPa"))
    ]
    model = tq.fit(measured, discrepancy="none", tolerances="as-tested", **options).model
    assert _noise_option(model, mode) == said


def test_the_next_step_has_priors_in_the_unit_of_the_data_and_what_must_be_stable(tmp_path):
    data = tq.simulate("gent", {"mu": 1.0, "Jm": 1.2}, np.linspace(0.75, 1.6, 16), 0.02, seed=1)
    data, normal = data.labelled(stress_unit="kPa"), tq.Normal(1.0, 0.2, low=0.0)
    chosen = {"mu": normal, "Jm": tq.Uniform(1.0, 3.0)}
    posterior = tq.fit(data, material="gent", discrepancy="none", noise_sd=0.02, priors=chosen, stable_in="uniaxial")
    table = posterior.design(points=(8,), target="modulus")
    targets, settings = [target_named("modulus", posterior.model)], DesignSettings(run="run", targets=("modulus",))
    study = DesignStudy(settings, posterior, tuple(targets), table, "same", 0.18)
    words = shlex.split(design_result(study, settings, tmp_path / "run").next_step)
    texts = [words[index + 1] for index, word in enumerate(words) if word == "--prior"]
    of_settings = {symbol: prior_from(prior) for symbol, prior in priors(texts).items()}
    assert of_settings == {"mu": normal.scaled(1000), "Jm": chosen["Jm"]}
    assert words[words.index("--stable-in") + 1] == "uniaxial"


def test_a_table_beneath_the_answer_has_the_ten_best_tests_and_a_folded_one_has_all(study, tmp_path):
    result = design_result(study, study.settings, tmp_path / "run")
    folded = [block for block in result.sections[0].blocks if isinstance(block, Table)]
    assert result.sections[0].title == "Every test"
    for target, short, long in zip(("modulus", "Jm"), result.tables, folded, strict=True):
        tests = study.table["candidate"][study.table["target"] == target].tolist()
        assert [row[0] for row in short.rows] == tests[:10]
        assert short.note == f"{len(tests) - 10} more tests under 'Every test', and in design.csv."
        assert ([row[0] for row in long.rows], long.note) == (tests, "")


def test_tests_that_are_as_good_as_the_best_are_named_with_it(study):
    new = ~study.table["is_repeat"] & (study.table["target"] == "modulus")
    names = study.table["candidate"][new].tolist()
    for count, words in ((0, ""), (2, f" (as good as the best: {names[1]})"),
                         (5, f" (as good as the best: {names[1]}, {names[2]} and 2 more)")):  # fmt: skip
        is_tied = new & (new.cumsum() <= count)
        number = _best(replace(study, table=study.table.assign(is_tied=is_tied)), study.targets[0])
        assert f" kPa{words}; repeating the data" in number.remark


@pytest.mark.slow
def test_everything_is_written(study, tmp_path):
    write_result(design_result(study, study.settings, tmp_path / "run"), tmp_path)
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    figures = {f"figures/{name}.{kind}" for name in ("answer", "design") for kind in ("svg", "png")}
    wanted = {"design.csv", "design.json", "run.toml", "report.html", "result.json"} | figures
    assert names == wanted
    written = pd.read_csv(tmp_path / "design.csv", keep_default_na=False, na_values=["nan"])
    is_stress = study.table["target"] == "modulus"
    for name in ("sd_now", "sd_after"):
        pd.testing.assert_series_equal(written[name], study.table[name], check_dtype=False)
    assert written["unit"].tolist() == ["kPa" if stress else "" for stress in is_stress]
    rows = json.loads((tmp_path / "design.json").read_text())
    assert [row["candidate"] for row in rows] == study.table["candidate"].tolist()
    assert rows[-1]["sd_after"] is None
    page = (tmp_path / "report.html").read_text()
    assert "gent &amp; co" in page
    assert "is expected to lower its sd by" in page


def test_what_the_fit_says_of_its_measurements_comes_before_a_further_test(study, tmp_path):
    assert design_result(study, study.settings, tmp_path).next_step.startswith("make the first of these tests")
    said = Result(
        command="fit", title="a fit", subject="", numbers=(), finding="", next_step="fit again.",
        warnings=(ResultWarning("it tore.", "measurements"), ResultWarning("few.", "few-measurements")),
    )  # fmt: skip
    write_result(said, tmp_path, figures=False)
    result = design_result(study, study.settings, tmp_path)
    assert result.next_step.startswith("see first to the warning about the fit")
    assert [warning for warning in result.warnings if "tore" in warning or "few" in warning] == ["it tore."]


def test_without_figures_there_are_none(study, tmp_path):
    write_result(design_result(study, study.settings, tmp_path / "run"), tmp_path, figures=False)
    assert not (tmp_path / "figures").exists()
    assert "<img" not in (tmp_path / "report.html").read_text()


def test_long_names_of_tests_leave_room_for_the_figure(study, tmp_path):
    named = study.table.assign(candidate=study.table["candidate"] + " (brain-cortex-of-the-second-specimen)")
    figure = design_result(replace(study, table=named), study.settings, tmp_path).picture.figure()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.draw_without_rendering()
    assert figure.axes[0].get_position().width > 0.4


def test_the_figure_has_a_panel_for_each_target_with_the_best_on_top(study):
    axes = design_figure(study, study.targets).axes
    assert [axis.get_title(loc="left") for axis in axes] == ["initial shear modulus", "Jm"]
    labels = [label.get_text() for label in axes[0].get_yticklabels()]
    assert labels[0] == study.table["candidate"].iloc[0]
    assert any("again" in label for label in labels)
    assert "kPa" in axes[0].get_xlabel()
    assert "kPa" not in axes[1].get_xlabel()


def test_points_that_are_means_as_those_of_the_fit_are_said_to_be(study):
    stretch = np.linspace(1.01, 1.4, 6000)
    data = tq.simulate("neo-hookean", {"C10": 0.4}, stretch, noise_sd=0.1, seed=1)
    of_means = replace(study, posterior=tq.fit(data, discrepancy="none", noise="independent"))
    assert any(
        "its points, as those of the fit, are means of 3 measurements." in each for each in of_means.explanations
    )
    assert not any("means of" in each for each in study.explanations)
