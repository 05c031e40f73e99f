"""The figure, the tables and the folder of a prediction."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment.uses import Use, Verdict
from tissuq.report.prediction import band_table, prediction_figure, prediction_result, score_table
from tissuq.report.result import Result
from tissuq.report.writer import write_result
from tissuq.studies.predict_run import predicted
from tissuq.studies.run_settings import ComparedFile, PredictionSettings


@pytest.fixture(scope="module")
def posterior():
    data = tq.simulate("yeoh", {"C10": 0.4, "C20": 0.03, "C30": 0.0}, np.linspace(0.8, 1.6, 14), 0.02, seed=1)
    in_kpa = tq.Experiment("uniaxial", data.stretch, data.stress, "specimen").labelled(stress_unit="kPa")
    return tq.fit(in_kpa, discrepancy="yeoh", noise_sd=0.02)


@pytest.fixture(scope="module")
def planar():
    data = tq.simulate("yeoh", {"C10": 0.4, "C20": 0.03, "C30": 0.0}, [1.0, 1.1, 1.3, 2.2], 0.02, seed=2, mode="planar")
    return tq.Experiment("planar", data.stretch, data.stress, "other")


@pytest.fixture(scope="module")
def found(posterior, planar):
    return predicted(posterior, data=planar, stretch=[1.0, 1.1, 1.3, 2.2])


def test_numbers_are_in_the_unit_of_the_run(found):
    bands, scored = band_table(found), score_table(found, found.scores, found.data.name)
    rows, headers = bands.rows, bands.headers
    assert len(headers) == len(rows[0])
    assert [row[0] for row in rows] == ["1", "1.1", "1.3", "2.2"]
    median = found.bands[0, True, False]["median"][2]
    assert float(rows[2][1]) == pytest.approx(median, rel=0.05)
    assert [row[-1] for row in rows] == ["yes", "yes", "yes", "no"]
    scores = scored.rows
    assert "CRPS, kPa" in scored.headers
    assert float(scores[0][6]) == pytest.approx(found.scores["crps"][0], rel=0.01)
    assert [row[1] for row in scores] == ["all", "calibrated", "beyond"] * 2


def test_of_many_points_some_are_read_from_end_to_end(posterior):
    rows = band_table(predicted(posterior, stretch=np.linspace(0.8, 1.6, 101))).rows
    assert len(rows) == 13
    assert (rows[0][0], rows[-1][0]) == ("0.8", "1.6")


def test_what_is_not_calibrated_is_hatched_in_every_panel(found):
    figure = prediction_figure(found)
    low, high = found.calibrated_range
    assert len(figure.axes) == 2
    for axis in figure.axes:
        (shaded,) = [patch for patch in axis.patches if patch.get_hatch()]
        assert shaded.get_extents().transformed(axis.transData.inverted()).x0 == pytest.approx(high, rel=1e-6)
        marks = {line.get_label(): line.get_xdata().tolist() for line in axis.lines if line.get_marker() == "o"}
        assert marks == {"measured": [1.0, 1.1, 1.3], "measured beyond": [2.2]}
    assert low < 1


def test_nothing_is_hatched_where_all_is_calibrated(posterior):
    figure = prediction_figure(predicted(posterior, mode="equibiaxial"))
    assert not any(patch.get_hatch() for axis in figure.axes for patch in axis.patches)


def test_a_panel_shows_the_bands_in_the_unit_of_the_run(found):
    with_it, alone = prediction_figure(found).axes
    assert with_it.get_ylabel() == "engineering stress [kPa]"
    assert "with the discrepancy yeoh" in with_it.get_title("left")
    assert "neo-hookean alone" in alone.get_title("left")
    (median,) = [line for line in alone.lines if line.get_label() == "predicted median"]
    np.testing.assert_allclose(median.get_ydata(), found.bands[0, False, False]["median"], rtol=1e-12)
    inside = round(found.scores["inside"][0] * found.scores["count"][0])
    assert with_it.get_title("left").endswith(f"{inside} of 4 inside")


@pytest.mark.slow
def test_a_band_of_any_size_can_be_drawn(posterior):
    far = predicted(posterior, mode="equibiaxial", stretch=[1.0, 1.1, 1e9])
    figure = prediction_figure(far)
    figure.draw_without_rendering()
    assert max(abs(axis.get_ylim()[1]) for axis in figure.axes) < 1e6


@pytest.mark.parametrize("mode", ["biaxial", "simple-shear-normal"])
def test_every_stress_has_a_row_of_panels(posterior, mode):
    stretch = [[1.0, 1.1], [1.2, 1.1]] if mode == "biaxial" else [-0.1, 0.1]
    figure = prediction_figure(predicted(posterior, mode=mode, stretch=stretch))
    assert len(figure.axes) == 4
    labels = {axis.get_xlabel() for axis in figure.axes if axis.get_xlabel()}
    assert labels == {"stretch of axis 1 (stretch of axis 2 1.1)" if mode == "biaxial" else "amount of shear"}


def test_measurements_of_two_controls_are_drawn_one_by_one(posterior):
    test = tq.simulate("neo-hookean", {"C10": 0.4}, [[1.1, 1.0], [1.1, 1.2], [1.2, 1.2]], 0.02, seed=1, mode="biaxial")
    figure = prediction_figure(predicted(posterior, data=test))
    figure.draw_without_rendering()
    for axis in figure.axes:
        assert len(axis.collections) == 2  # the two bands, as bars


def test_a_folder_holds_tables_arrays_figure_and_page(found, planar, tmp_path):
    file = tmp_path / "other.csv"
    rows = [f"{a},{1000 * b}\n" for a, b in zip(planar.stretch, planar.stress, strict=True)]
    file.write_text("stretch,stress_kPa\n" + "".join(rows))
    folder = tmp_path / "out"
    folder.mkdir()
    settings = PredictionSettings(run="run", data=ComparedFile(file="other.csv"))
    write_result(prediction_result(found, settings, folder, tmp_path), folder)
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*.*")}
    assert names == {
        "prediction.csv", "prediction.nc", "scores.csv", "scores.json", "run.toml", "report.html", "input/other.csv",
        "figures/prediction.svg", "figures/prediction.png", "figures/answer.svg", "figures/answer.png", "result.json",
    }  # fmt: skip
    with (folder / "prediction.csv").open() as table:
        first = list(csv.DictReader(table))[2]
    assert float(first["median [kPa]"]) == found.bands[0, True, False]["median"][2]
    assert json.loads((folder / "scores.json").read_text())[0]["crps"] == found.scores["crps"][0]
    recipe = (folder / "run.toml").read_text()
    assert 'run = "../run"' in recipe
    assert 'file = "input/other.csv"' in recipe
    page = (folder / "report.html").read_text()
    assert "Of 3 measurements of other in the calibrated range" in page
    assert "1 of 4 points and 1 of 4 measurements lie outside the measured range" in page
    assert "data:image/svg+xml" in page


def test_the_legend_of_a_prediction_is_not_wider_than_its_figure(found):
    figure = prediction_figure(found)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert "measured beyond" in {text.get_text() for text in legend.get_texts()}
    assert 0 <= legend.get_window_extent().x0 <= legend.get_window_extent().x1 <= figure.bbox.width


def test_a_page_without_measurements_says_the_stress_at_the_end_of_the_range(posterior, tmp_path):
    found = predicted(posterior, mode="planar", stretch=[1.0, 1.2, 9.0])
    write_result(prediction_result(found, PredictionSettings(run="run"), tmp_path), tmp_path, figures=False)
    page = (tmp_path / "report.html").read_text()
    assert "engineering stress at stretch 1.2" in page
    assert re.search(
        r"Extrapolated to stretch 9, .*, the engineering stress is not known at all \(95\s%: .* to .*\)\.", page
    )
    assert "How the measurements are predicted" not in page
    assert "<img" not in page


def test_a_stress_near_zero_beside_a_large_one_is_known(posterior, tmp_path):
    """As that of the second axis where it is nearly free; only a band as wide as the other stress is none at all."""
    found = predicted(posterior, mode="biaxial", stretch=[[1.0, 1.0], [1.2, 1.0]])
    curves = dict(found.curves)
    for key, band in curves.items():
        if key[0] == 1:
            curves[key] = replace(
                band, median=0 * band.median + 1e-6, low=0 * band.low - 0.001, high=0 * band.high + 0.001
            )
    write_result(
        prediction_result(replace(found, curves=curves), PredictionSettings(run="run"), tmp_path),
        tmp_path,
        figures=False,
    )
    assert "not known at all" not in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("stretch", [[1.0, 1.1, 1.2], [1.0, 1.2, 9.0], [8.0, 9.0]])
@pytest.mark.parametrize("mode", ["planar", "biaxial"])
def test_the_finding_repeats_no_number_that_stands_above_it(posterior, tmp_path, mode, stretch):
    points = np.column_stack([stretch, stretch]) if mode == "biaxial" else stretch
    result = prediction_result(predicted(posterior, mode=mode, stretch=points), PredictionSettings(run="run"), tmp_path)
    record = result.record()
    shown = [number["text"].split()[0] for number in record["numbers"] if "stress" in number["name"]]
    assert len(shown) == (2 if mode == "biaxial" else 1)
    assert not [number for number in shown if f" {number} " in record["finding"]]
    assert "95 %: " in record["finding"]


@pytest.mark.parametrize(("mode", "reason"), [("uniaxial", "known here"), ("planar", "known elsewhere")])
def test_the_page_repeats_what_the_fit_says_of_predicting_the_mode(posterior, tmp_path, mode, reason):
    uses = [
        Use("predict these tests", Verdict.YES, "known here"),
        Use("predict other loading modes", Verdict.NO, "known elsewhere"),
    ]
    record = Result(command="fit", title="a fit", subject="a test", uses=tuple(uses)).record()
    (tmp_path / "run" / "posterior").mkdir(parents=True)
    (tmp_path / "run" / "result.json").write_text(json.dumps(record))
    found = predicted(posterior, mode=mode, stretch=[1.0, 1.2])
    settings = PredictionSettings(run="run")
    for formulations, reasons in ((["yeoh", "none"], [reason]), (["none", "yeoh"], []), (["yeoh", "auto"], [])):
        recipe = f'# tissuq fit --config\nfile = "input/a.csv"\ndiscrepancies = {formulations}\n'
        (tmp_path / "run" / "run.toml").write_text(recipe)
        for formulation in formulations:
            (tmp_path / "run" / "posterior" / f"{formulation}.nc").touch()
        assert [use.reason for use in prediction_result(found, settings, tmp_path, tmp_path).uses] == reasons
    (tmp_path / "run" / "result.json").write_text("{")
    assert prediction_result(found, settings, tmp_path, tmp_path).uses == ()


def test_compression_that_no_test_was_in_is_explained():
    data = tq.simulate("neo-hookean", {"C10": 0.4}, np.linspace(1.0, 1.6, 8), 0.01, seed=1)
    tension = tq.fit(data, discrepancy="none", noise_sd=0.01)
    assert predicted(tension, mode="equibiaxial", stretch=[0.85, 0.9, 1.0]).is_compression_deduced
    assert not predicted(tension, mode="equibiaxial", stretch=[1.0, 1.1]).is_compression_deduced
    assert not predicted(tension, mode="simple-shear", stretch=[-0.2, 0.2]).is_compression_deduced
