"""Excel workbooks of testing machines."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from tissuq.experiments.reading import workbooks
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.inspection import inspect
from tissuq.experiments.reading.read import read_experiment
from tissuq.experiments.reading.tests_in_file import read_tests
from written_files import check_curve, message, text_file, workbook

openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed")


def specimen_sheet(length=20.0):
    head = [["Prüfer", "Jörg"], ["Einspannlänge", length, "mm"], ["Probenquerschnitt", 10, "mm²"], []]
    names = [["Prüfzeit", "Standardweg", "Standardkraft"], ["s", "mm", "N"]]
    rows = ([number, length * (value - 1), neo_hookean(value) * 10] for number, value in enumerate(ramp()))
    return [*head, *names, *rows]


@pytest.fixture
def book(tmp_path):
    """A workbook with a sheet of remarks and two specimens."""
    specimens = {"Probe 1": specimen_sheet(), "Probe 2": specimen_sheet(length=25.0)}
    return workbook(tmp_path / "zwick.xlsx", Remarks=[["wet, 37 degrees"]], **specimens)


@pytest.mark.parametrize("sheet", ["Probe 2", 3, "3"])
def test_a_sheet_is_read_to_the_last_digit(book, sheet):
    reading = read_file(book, sheet=sheet)
    np.testing.assert_allclose(reading.experiment.stretch, ramp(), rtol=1e-15)
    np.testing.assert_allclose(reading.experiment.stress, neo_hookean(ramp()), rtol=0, atol=1e-17)
    assert "25 mm (length in line 2)" in reading.used.steps[0]
    assert reading.experiment.source.startswith("zwick.xlsx, sheet 'Probe 2': stretch")
    assert reading.experiment.name == "zwick"


def test_the_only_sheet_with_a_table_needs_no_name(tmp_path):
    path = workbook(tmp_path / "one.xlsx", Sheet=[["wet"]], **{"Probe 1": specimen_sheet()})
    assert len(read_experiment(path)) == 60


def test_several_sheets_with_tables_are_asked_about(book):
    assert "several sheets hold tables: 'Probe 1', 'Probe 2'. Say which: sheet='Probe 1'" in message(book)


def test_a_sheet_that_is_not_there_is_answered_with_those_that_are(book):
    assert "has no sheet 'Probe 3'. The sheets are: 'Remarks', 'Probe 1', 'Probe 2'" in message(book, sheet="Probe 3")


def test_a_text_file_has_no_sheets(tmp_path):
    path = text_file(tmp_path / "test.csv", "stretch,stress\n1,0")
    assert "is not an Excel workbook and has no sheets" in message(path, sheet=1)


def test_a_workbook_without_a_table_is_refused(tmp_path):
    path = workbook(tmp_path / "empty.xlsx", Sheet=[["nothing", "yet"]])
    assert "no sheet with a table of numbers" in message(path)


def test_a_bad_cell_is_named_by_its_row_and_column(tmp_path):
    path = workbook(tmp_path / "test.xlsx", Sheet=[["stretch", "stress"], [1.0, 0], [1.1, None], [1.2, 3]])
    assert "sheet 'Sheet', line 3, column 'stress': the cell is empty" in message(path)


@pytest.mark.parametrize(("heading", "top"), [("strain", 1.2), ("strain (%)", 1.2), ("strain (mm/mm)", None)])
def test_cells_shown_as_percentages_are_what_is_shown(tmp_path, heading, top):
    rows = [["time", heading, "stress (kPa)"], [0, 0.0, 0], [1, 0.1, 2], [2, 0.2, 3]]
    book = openpyxl.load_workbook(workbook(tmp_path / "test.xlsx", Sheet=rows))
    for cell in book.active["B"][1:]:
        cell.number_format = "0%"
    book.save(tmp_path / "test.xlsx")
    if top is None:
        assert "'0 %' is a percentage. Write plain numbers" in message(tmp_path / "test.xlsx")
    else:
        inspection = inspect(tmp_path / "test.xlsx")
        assert inspection.reading.experiment.stretch.tolist() == pytest.approx([1.0, 1.1, top])
        assert any("the cells are percentages" in text for text in inspection.warnings)


def test_without_openpyxl_it_is_said_what_to_install(book, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert "reading it needs openpyxl: pip install 'tissuq[excel]'" in message(book, sheet=1)


def test_a_stray_cell_in_the_last_column_does_not_make_every_row_that_long(tmp_path, monkeypatch):
    book = openpyxl.load_workbook(workbook(tmp_path / "stray.xlsx", Sheet=specimen_sheet()))
    book.active["XFD1"] = "x"
    book.save(tmp_path / "stray.xlsx")
    cells = []
    shown = workbooks._shown
    monkeypatch.setattr(workbooks, "_shown", lambda cell: cells.append(cell) or shown(cell))
    found = read_experiment(tmp_path / "stray.xlsx")
    np.testing.assert_allclose(found.stretch, ramp(), rtol=1e-12)
    assert len(cells) < 16_384 + 4 * (len(found) + 6)


def test_a_stray_cell_beside_the_data_is_told(tmp_path):
    book = openpyxl.load_workbook(workbook(tmp_path / "stray.xlsx", Sheet=specimen_sheet()))
    book.active["XFD10"] = 7
    book.save(tmp_path / "stray.xlsx")
    assert "line 10 has 16384 cells" in message(tmp_path / "stray.xlsx")


def test_a_workbook_kept_by_hand_is_read_with_the_sizes_of_each_specimen(tmp_path):
    """A sheet of sizes, then specimens beside one another under merged names, with a remark between the rows."""
    sizes = [
        ["Probe", "Breite (mm)", "Dicke (mm)", "Länge (mm)"],
        ["P1", 5, 2, 20],
        ["P2", 5.2, 2.1, 25],
        ["Mittel", 5, 2, 20],
    ]
    head = [
        ["Zugversuch"],
        [],
        ["Probe P1", None, None, "Probe P2"],
        ["Weg", "Kraft", None, "Weg", "Kraft"],
        ["mm", "N", None, "mm", "N"],
    ]
    stretch = np.linspace(1, 1.3, 30)
    stress = 0.04 * (stretch - stretch**-2)
    curves = zip(stretch, stress, strict=True)
    rows = [[20 * (x - 1), y * 10, None, 25 * (x - 1), 1.1 * y * 5.2 * 2.1] for x, y in curves]
    rows.insert(13, ["Klemme nachgezogen"])
    path = workbook(tmp_path / "book.xlsx", Übersicht=sizes, Daten=[*head, *rows])
    with pytest.raises(InputError, match=r"sheet 'Daten', line 19, .*'Klemme nachgezogen' is not a number"):
        read_tests(path)
    with pytest.warns(UserWarning, match="'Übersicht' is no test"):
        tests = read_tests(path, leave_out="19")
    for test, factor in zip(tests, (1.0, 1.1), strict=True):
        check_curve(test, stretch, factor * stress, rtol=1e-9, stress_atol=1e-12)
