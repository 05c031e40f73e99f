import json
from math import nan

import pytest

import tissuq as tq
from tissuq.experiments.units import StressUnit
from tissuq.report.measured import named
from tissuq.report.summary import stability_section, summary_table
from tissuq.report.tables import interval, significant, stretch_in_words, write_csv, write_json

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
    [(None, ""), (0, "0"), (1.2345, "1.23"), (-0.05, "-0.05"), (1234.5, "1230"), (123456, "123000"), (1e-7, "1e-07"),
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
        (1e-12, 2e-12, 1e-13, ("1.00e-12", "2.00e-12")),
        (5.0512e-5, 7.0e-5, 5e-6, ("5.05e-05", "7.00e-05")),
        (1e-12, 2.5e-5, 6e-6, ("0", "2.50e-05")),
        (1e-6, 1e-6, 0.03, ("0.000", "0.000")),
        (2e-5, 3.123e-5, 0.0, ("2.00e-05", "3.12e-05")),
        (2e-5, 2e-5, float("nan"), ("2.00e-05", "2.00e-05")),
        (9.9995128, 9.9999999, 1.6e-4, ("9.9995", "10.0000")),
        (1234567.0, 2345678.0, 3e5, ("1234600", "2345700")),
    ],
)
def test_an_interval_is_shown_to_two_digits_of_the_sd_and_five_at_most(low, high, sd, texts):
    assert interval(low, high, sd) == texts


def test_a_summary_is_rounded_alike_in_the_unit_of_the_file():
    table = summary_table([ROW], StressUnit("kPa", 1e-3), "title")
    assert table.headers[:4] == ["discrepancy", "C10, kPa", "sd", "95 % interval"]
    assert table.rows[0][:4] == ["none", "1235", "30", "[1175, 1294]"]
    table = summary_table([ROW], StressUnit("MPa", 1.0), "title")
    assert table.headers[4:] == ["truth", "log ev.", "in band", "alone"]
    assert table.rows == [["none", "1.235", "0.030", "[1.175, 1.294]", "yes", "-12.35", "97 %", "50 %"]]


def test_a_summary_has_columns_for_what_is_known_of_any_of_its_rows():
    sampled = ROW | {"contains_truth": None, "log_evidence": None, "rhat": 1.0012, "ess": 812.4}
    sampled |= {"stable": 0.85, "lost_at": 0.925, "lost_at_low": 0.9071, "lost_at_high": 0.932}
    unknown = dict.fromkeys(("contains_truth", "rhat", "stable", "lost_at", "lost_at_low", "lost_at_high"))
    table = summary_table([sampled, ROW | unknown], StressUnit("MPa", 1.0), "title")
    assert table.headers[4:] == ["log ev.", "in band", "alone", "stable", "lost at stretch", "R-hat", "ESS"]
    assert table.rows[0][4:] == ["", "97 %", "50 %", "85 %", "0.925 [0.907, 0.932]", "1.001", "812"]
    assert table.rows[1][4:] == ["-12.35", "97 %", "50 %", "", "", "", ""]
    stable = sampled | {"lost_at": None, "lost_at_low": None, "lost_at_high": None}
    assert "lost at stretch" not in summary_table([stable], StressUnit("MPa", 1.0), "title").headers


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
    assert stability_section([row]).blocks[1].rows == [
        ["auto", "uniaxial", "0.9 to 1.1", "85 %", "0.925 [0.907, 0.932]", ""]
    ]


def test_a_title_names_the_test_and_its_specimen():
    first, second, third = (
        tq.simulate("neo-hookean", {"C10": 0.4}, [1.1, 1.2, 1.3], 0.01, seed=seed).labelled(
            name=name, specimen=specimen
        )
        for seed, (name, specimen) in enumerate((("tension", "pig 3"), ("pig 3 shear", "pig 3"), ("x" * 40, "pig 4")))
    )
    assert named(first) == "tension, specimen pig 3"
    assert named(second) == "pig 3 shear"
    assert named(tq.Experiment.of([first, second])) == "tension + pig 3 shear"
    assert named(tq.Experiment.of([first, third])) == "2 tests"


def test_a_stretch_and_its_interval_have_the_same_digits():
    assert stretch_in_words(1.94, 1.9, 2.0) == "1.94 [1.90, 2.00]"
    assert stretch_in_words(None, None, None) == ""
