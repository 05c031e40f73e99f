"""Direction and condition of tests: said by a column, a sheet or a file, shown, written, and asked for."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError
from tissuq.report.tables import write_csv
from tissuq.report.writer import data_file
from written_files import text_file, workbook

STRETCH = np.linspace(1, 1.3, 20)
FACTORS = {"longitudinal": 1.0, "transverse": 1.5}


def rows(factor, *cells):
    return [",".join([f"{x:.9f}", f"{1e3 * factor * neo_hookean(x):.9f}", *cells]) for x in STRETCH]


@pytest.fixture
def by_column(tmp_path):
    lines = [line for name, factor in FACTORS.items() for line in rows(factor, name, "frozen")]
    return text_file(tmp_path / "aorta.csv", "stretch,stress [kPa],Fibre direction,Treatment", *lines)


@pytest.fixture
def by_sheet(tmp_path):
    sheets = {
        f"S1 {name.title()}": [["stretch", "stress [kPa]"], *([x, 1e3 * factor * neo_hookean(x)] for x in STRETCH)]
        for name, factor in FACTORS.items()
    }
    return workbook(tmp_path / "aorta-frozen.xlsx", **sheets)


@pytest.mark.parametrize("source", ["by_column", "by_sheet"])
def test_direction_and_condition_are_fields_that_choose_tests(request, source):
    path = request.getfixturevalue(source)
    tests = tq.read_tests(path)
    assert [(test.direction, test.condition) for test in tests] == [(name, "frozen") for name in FACTORS]
    for direction, factor in FACTORS.items():
        (test,) = tq.read_tests(path, only={"direction": direction, "condition": "Frozen"})
        np.testing.assert_allclose(test.stress, factor * neo_hookean(STRETCH), atol=1e-11)
    with pytest.raises(InputError, match="the direction of the test is 'longitudinal', not 'radial'"):
        tq.read_tests(path, only={"direction": "radial"})


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("aorta_circumferential_fresh.csv", ("circumferential", "fresh")),
        ("LongitudinalDry.csv", ("longitudinal", "dry")),
        ("0deg and 90deg.csv", ("", "")),
        ("biaxial rewetted.csv", ("", "")),
    ],
)
def test_words_in_the_name_of_a_file_say_them(tmp_path, name, labels):
    path = text_file(tmp_path / name, "stretch,stress [kPa]", *rows(1.0))
    data = tq.read(path, mode="uniaxial")
    assert (data.direction, data.condition) == labels
    if labels[0]:
        assert len(tq.read(path, only={"direction": labels[0].upper()})) == len(STRETCH)
        assert f"direction {labels[0]}, condition {labels[1]}" in str(tq.inspect(path))
    with pytest.raises(InputError, match="direction of the test is"):
        tq.read(path, mode="uniaxial", only={"direction": "radial"})


@pytest.mark.parametrize(
    "line", ["Axial pre-stretch ratio 150%", "Axial stretch (lambda_z): 1.5", "axial strain = 50 %"]
)
def test_an_axial_stretch_above_the_table_is_no_direction(tmp_path, line):
    data = tq.read(text_file(tmp_path / "test.csv", "stretch,stress (kPa)", *rows(1.0)))
    above = text_file(tmp_path / "above.csv", f"{line}\n{(tmp_path / 'test.csv').read_text(encoding='utf-8')}")
    assert (tq.read(above).direction, data.direction) == ("", "")
    above.write_text(above.read_text(encoding="utf-8").replace(line, "Axial strip 3"), encoding="utf-8")
    assert tq.read(above).direction == "axial"


def test_they_are_written_with_the_data_and_kept_in_a_posterior(by_column, tmp_path):
    tests = tq.read_tests(by_column)
    write_csv(tmp_path / "data.csv", data_file(tq.Experiment.of(tests))["data.csv"])
    with (tmp_path / "data.csv").open(newline="") as lines:
        cells = [(row["direction"], row["condition"]) for row in csv.DictReader(lines)]
    assert cells == [(name, "frozen") for name in FACTORS for _ in STRETCH]
    posterior = tq.fit(tests, discrepancy="none", noise_sd=1e-3)
    posterior.save(tmp_path / "fit.nc")
    loaded = tq.load(tmp_path / "fit.nc").model.experiment.tests
    assert [test.direction for test in loaded] == list(FACTORS)


def test_they_may_be_said_of_what_is_measured():
    data = tq.Experiment("uniaxial", [1.0, 1.1], [0.0, 0.2], direction="radial", condition="wet")
    assert (data.direction, data.condition) == ("radial", "wet")
    assert data.labelled(direction="axial").direction == "axial"


@pytest.mark.parametrize(
    "line",
    [
        "Specimen: A12",
        "# Sample ID = A12",
        "Date: 2.3.2024; 10:15\nProbe;A12",
        '"Specimen label","A12",',
        "Operator: NN\tSpecimen No.: A12",
    ],
)
def test_a_line_above_the_table_names_the_specimen_as_a_column_does(tmp_path, line):
    separator = ";" if ";A12" in line else "\t" if "\t" in line else ","
    lines = [row.replace(",", separator) for row in ["stretch,stress [kPa]", *rows(1)]]
    above = text_file(tmp_path / "above.csv", line, *lines)
    column = text_file(tmp_path / "column.csv", "stretch,stress [kPa],Specimen", *rows(1, "A12"))
    assert [tq.read(file).specimen for file in (above, column)] == ["A12", "A12"]
    assert "specimen A12" in str(tq.inspect(above))


@pytest.mark.parametrize(
    "line",
    [
        "Specimen: 1",  # which every file of a machine may say
        "Sample: porcine liver",
        "Specimens: A1-A6",
        "Specimen,L0",
        "Specimen: A1; Specimen: A2",
        "Specimen,A1,,A2",
    ],
)
def test_numbers_materials_and_several_specimens_name_none(tmp_path, line):
    assert tq.read(text_file(tmp_path / "above.csv", line, "stretch,stress [kPa]", *rows(1))).specimen == ""
