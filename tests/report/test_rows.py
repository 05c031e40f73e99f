import json
from math import nan

import pytest

from tissuq.experiments.units import StressUnit
from tissuq.report.tables import interval, readable_stability, readable_summary, significant, write_csv, write_json

ROW = {
    "formulation": "none",
    "C10_mean": 1.23456,
    "C10_sd": 0.0304,
    "C10_hdi_low": 1.1749,
    "C10_hdi_high": 1.2941,
    "contains_truth": True,
    "log_evidence": -12.3456,
    "predictive_coverage": 0.966,
    "predictive_coverage_model_only": 0.5,
    "rhat": None,
    "ess": None,
    "seconds": 0.1234,
}


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, ""), (0, "0"), (1.2345, "1.23"), (-0.05, "-0.05"), (1234.5, "1,230"), (123456, "123,000"), (1e-7, "1e-07"),
     (3.2e9, "3.2e+09")],
)  # fmt: skip
def test_a_number_is_shown_with_three_significant_digits(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("low", "high", "sd", "texts"),
    [
        (1.23456, 2.34567, 0.3, ("1.23", "2.35")),
        (1.23456, 2.34567, 0.03, ("1.235", "2.346")),
        (123.4, 567.8, 120, ("123", "568")),
        (0.0, 0.0, 0.0, ("0.000", "0.000")),
        (1e-12, 2e-12, 1e-13, ("1e-12", "2e-12")),
    ],
)
def test_an_interval_is_shown_to_two_digits_of_the_sd(low, high, sd, texts):
    assert interval(low, high, sd) == texts


def test_a_summary_is_rounded_alike_in_the_unit_of_the_file():
    (row,) = readable_summary([ROW], StressUnit("kPa", 1e-3))
    assert (row["mean"], row["sd"], row["low"], row["high"]) == ("1235", "30", "1175", "1294")
    (row,) = readable_summary([ROW], StressUnit("MPa", 1.0))
    assert (row["mean"], row["sd"], row["low"], row["high"]) == ("1.235", "0.030", "1.175", "1.294")
    assert (row["log_evidence"], row["coverage"], row["coverage_model_only"]) == ("-12.35", "97%", "50%")
    assert row["rhat"] == row["ess"] == ""


def test_tables_hold_every_digit_and_nothing_where_there_is_no_number(tmp_path):
    write_csv(tmp_path / "table.csv", [{"a": 0.1 + 0.2, "b": None, "c": True}])
    assert (tmp_path / "table.csv").read_bytes() == b"a,b,c\n0.30000000000000004,,True\n"
    write_json(tmp_path / "table.json", [{"a": 0.1 + 0.2, "b": None, "c": nan}])
    assert json.loads((tmp_path / "table.json").read_text()) == [{"a": 0.1 + 0.2, "b": None, "c": None}]


def test_where_stability_is_lost_is_told_from_a_probability_of_5_percent():
    row = {"formulation": "auto", "mode": "uniaxial", "stretch_low": 0.9, "stretch_high": 1.1, "stable": 0.85}
    row |= {"lost_below_probability": 0.12, "lost_below_median": 0.925}
    row |= {"lost_below_low": 0.9071, "lost_below_high": 0.932}
    row |= {"lost_above_probability": 0.05, "lost_above_median": 1.0, "lost_above_low": 1.0, "lost_above_high": 1.0}
    assert readable_stability([row]) == [["auto", "uniaxial", "0.9 to 1.1", "85%", "0.925 [0.907, 0.932]", ""]]
