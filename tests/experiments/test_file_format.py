"""A file format of one's own: sheets of cells, known by the first bytes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import tissuq as tq
from tissuq.experiments.reading import FileFormat
from written_files import text_file


@pytest.fixture(scope="module")
def notebook():
    class Notebook(FileFormat):
        """Sheets as lists of rows in JSON."""

        name = "test-notebook"
        signature = b'{"sheets"'

        def sheets(self, path):
            sheets = json.loads(Path(path).read_text())["sheets"]
            return {name: ["\t".join(map(str, row)) for row in rows] for name, rows in sheets.items()}

    return Notebook


@pytest.fixture
def file(notebook, tmp_path):
    rows = [["stretch", "stress (kPa)"], [1.0, 0.0], [1.1, 2.5], [1.2, 6.0]]
    path = tmp_path / "tests.json"
    path.write_text(json.dumps({"sheets": {"notes": [["soaked"]], "test": rows, "again": rows}}))
    return path


def test_a_sheet_is_read_like_a_workbooks(file):
    test = tq.read_experiment(file, sheet="again")
    assert test.stretch.tolist() == [1.0, 1.1, 1.2]
    assert test.stress.tolist() == pytest.approx([0.0, 0.0025, 0.006])


def test_several_sheets_with_tables_must_be_chosen_from(file):
    with pytest.raises(tq.InputError, match=r"several sheets hold tables: 'test', 'again'. Say which"):
        tq.read_experiment(file)
    with pytest.raises(tq.InputError, match="has no sheet 'third'"):
        tq.read_experiment(file, sheet="third")


def test_other_files_are_read_as_text(notebook, tmp_path):
    path = text_file(tmp_path / "test.csv", "stretch,stress_kPa\n1.0,0.0\n1.1,2.5")
    assert len(tq.read_experiment(path)) == 2


def failing(path):
    raise ValueError("bad checksum")


@pytest.mark.parametrize(
    ("sheets", "words"),
    [
        (lambda path: ["1\t2"], "must return the lines of every sheet as texts, by its name"),
        (lambda path: {"one": [b"1\t2"]}, "must return the lines of every sheet as texts, by its name"),
        (failing, "cannot read it: ValueError: bad checksum"),
    ],
)
def test_what_a_format_of_ones_own_does_wrong_is_said(sheets, words):
    class Wrong(FileFormat):
        """Its name is not kept."""

        name = property(lambda self: "wrong")
        signature = b"never"

        def sheets(self, path):
            return sheets(path)

    with pytest.raises(tq.InputError, match=rf"^some\.file: the format 'wrong' \(.*Wrong\) {words}"):
        Wrong().lines_by_sheet("some.file")
