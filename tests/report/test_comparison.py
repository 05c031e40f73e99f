"""The figure and the page of a comparison."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.units import StressUnit
from tissuq.report.comparison import comparison_figure, comparison_result, comparison_table
from tissuq.report.writer import write_result

KPA = StressUnit("kPa", 1e-3)


@pytest.fixture(scope="module")
def table(specimen_study):
    names = ("none", "constant", "yeoh", "auto")
    return tq.compare({name: specimen_study.posteriors[name] for name in names}, unit="MPa")


def test_every_fit_is_a_row_and_the_parameter_is_in_the_unit_asked_for(table):
    figure = comparison_figure(table, KPA)
    evidence, prediction, parameter = figure.axes
    assert [label.get_text() for label in evidence.get_yticklabels()] == list(table.index)
    assert "kPa" in parameter.get_xlabel()
    bars = [line for line in parameter.lines if line.get_linewidth() == 4]
    np.testing.assert_allclose(
        [bar.get_xdata() for bar in bars], 1000 * table[["hdi_low", "hdi_high"]].to_numpy(), rtol=1e-12
    )
    assert any("for predictions only" in text.get_text() for text in prediction.texts)


def test_the_best_for_left_out_measurements_is_that_with_the_largest_elpd_and_others_are_below_it(table):
    best = sorted(table.index, key=lambda name: table["elpd"][name])[-1]
    numbers = {number.name: number.value for number in comparison_result(table, ["runs/a"], KPA).numbers}
    assert numbers["best for left-out measurements"] == best
    for row in comparison_table(table, KPA).rows:
        difference = float(row[5].split(" ± ")[0])
        assert difference == pytest.approx(table["elpd"][row[0]] - table["elpd"][best], abs=0.06)
        assert (row[5] == "0.0 ± 0.0") == (row[0] == best)


def test_the_parameter_comes_first_and_fits_that_predict_as_well_as_the_best_are_named(table):
    parameter = f"median of {table['parameter'].iloc[0]}, over the fits"
    alike = table.assign(
        median=0.0215, elpd_difference=[0.0, 1.0, 9.0, 3.0], elpd_difference_error=[0.0, 1.0, 1.0, 2.0]
    )
    alike = alike.assign(elpd=-alike["elpd_difference"], log_evidence=[9.0, 0.0, 0.0, 0.0])
    alike = alike.assign(probability=[0.997, 0.001, 0.001, 0.001])
    numbers = comparison_result(alike, ["runs/a"], KPA).numbers
    assert [number.name for number in numbers] == [parameter, "largest evidence", "best for left-out measurements"]
    assert numbers[0].value == "21.5 kPa"  # one number where all are the same
    assert numbers[1].remark == "probability more than 99 %"
    one, other = table.index[1], table.index[3]
    assert (numbers[2].value, numbers[2].remark) == (table.index[0], f"as good: {one}, {other}")


def test_what_is_far_below_is_told_at_the_edge(table):
    far = table.copy()
    far.loc["none", "log_bayes_factor"] = -12_345.0
    texts = [text.get_text() for text in comparison_figure(far, KPA).axes[0].texts]
    assert "-12345" in texts


def test_a_fit_that_predicts_exactly_as_well_as_the_best_is_as_good(specimen_study):
    fit = specimen_study.posteriors["yeoh"]
    twice = comparison_result(tq.compare({"first": fit, "second": fit}), ["first", "second"], KPA)
    assert twice.numbers[2].remark == "as good: second"


def test_what_is_not_known_is_said(table):
    unknown = table.copy()
    names = ["log_evidence", "log_bayes_factor", "log_bayes_factor_low", "log_bayes_factor_high", "probability"]
    unknown.loc["yeoh", names] = np.nan
    assert "not known" in [text.get_text() for text in comparison_figure(unknown, KPA).axes[0].texts]
    row = next(row for row in comparison_table(unknown, KPA).rows if row[0] == "yeoh")
    assert row[1:5] == [""] * 4
    nothing = table.copy()
    nothing[names] = np.nan
    comparison_figure(nothing, KPA).draw_without_rendering()


def test_parameters_of_different_names_are_named_one_by_one(table):
    mixed = table.copy()
    mixed["parameter"] = ["C10", "C10", "mu1", "C10"]
    words = [text.get_text() for text in comparison_figure(mixed, KPA).axes[2].texts]
    assert words == ["C10", "C10", "mu1", "C10"]


def test_the_page_says_what_a_comparison_does_not_tell(table, tmp_path):
    write_result(comparison_result(table, ["first", "second"], KPA), tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "do not apply to parameters" in page
    assert "tissuq compare first second" in page
    assert "the choice of material and discrepancy matters more" in page  # fits may be of several laws, with none
    assert page.count("<tr>") == 1 + len(table)
