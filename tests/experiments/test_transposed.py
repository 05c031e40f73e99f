"""Tables on their side, and numbers as Fortran writes them."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from written_files import check_curve, text_file, workbook

STRETCH = ramp(rows=12)
STRESS = neo_hookean(STRETCH)


def written(folder, *rows, separator=","):
    return text_file(folder / "test.csv", *(separator.join(row) for row in rows))


def line(name, values, form="{:.9g}"):
    return [name, *map(form.format, values)]


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_names_in_the_first_column_and_values_along_lines_are_read(tmp_path, separator):
    head = [["Liver, 3 months"], ["Thickness (mm)", "2"]] if separator != "," else []
    path = written(tmp_path, *head, line("Stretch", STRETCH), line("Stress (kPa)", 1e3 * STRESS), separator=separator)
    data = tq.read(path)
    check_curve(data, STRETCH, STRESS, rtol=1e-8, stress_atol=1e-12)
    assert "read turned upright" in str(tq.inspect(path))


def test_units_may_stand_between_a_name_and_its_values(tmp_path):
    time = line("Time", range(len(STRETCH)))
    rows = [time, line("Displacement", 20 * (STRETCH - 1)), line("Force", 1e4 * STRESS)]
    for row, unit in zip(rows, ("s", "mm", "mN"), strict=True):
        row.insert(1, unit)
    data = tq.read(written(tmp_path, *rows, separator=";"), length="20 mm", area="10 mm2")
    check_curve(data, STRETCH, STRESS, rtol=1e-8, stress_atol=1e-12)


def test_a_sheet_on_its_side_is_read_and_a_faulty_cell_is_named_by_its_column(tmp_path):
    book = workbook(tmp_path / "test.xlsx", Sheet=[["Stretch", *STRETCH], ["Stress [kPa]", *(1e3 * STRESS)]])
    np.testing.assert_allclose(tq.read(book).stress, STRESS, rtol=1e-12, atol=1e-15)
    path = written(tmp_path, line("Stretch", STRETCH), [*line("Stress (kPa)", 1e3 * STRESS[:5]), "1e999", *["9"] * 6])
    with pytest.raises(InputError, match=r"column 7, column 'Stress \(kPa\)': '1e999' is too large"):
        tq.read(path)


def test_a_table_whose_first_column_names_specimens_stands_upright(tmp_path):
    rows = (["A", f"{x:.9g}", f"{1e3 * neo_hookean(x):.9g}"] for x in STRETCH)
    path = written(tmp_path, ["Specimen", "Stretch", "Stress (kPa)"], *rows)
    np.testing.assert_allclose(tq.read(path).stretch, STRETCH, rtol=1e-8)


@pytest.mark.parametrize("letter", "Dd")
def test_exponents_of_fortran_are_read(tmp_path, letter):
    rows = [[f"{value:.8E}".replace("E", letter) for value in row] for row in zip(STRETCH, 1e3 * STRESS, strict=True)]
    data = tq.read(written(tmp_path, ["Stretch", "Stress_2D-10 (kPa)"], *rows), stress=2)
    check_curve(data, STRETCH, STRESS, rtol=1e-8, stress_atol=1e-12)


def test_a_column_of_labels_that_are_names_of_quantities_stands_upright(tmp_path):
    lines = [f"Stretch,{k},{1 + 0.01 * k:.2f},{k},{k}" for k in range(30)]
    path = text_file(tmp_path / "sets.csv", "SetName,Time_S,stretch,stress [kPa],temperature", *lines)
    assert tq.read(path).stretch.tolist() == pytest.approx([1 + 0.01 * k for k in range(30)])
