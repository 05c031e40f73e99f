"""Many specimens in files: a file each, folders of repeated tests, or a column."""

from __future__ import annotations

import pytest

from tissuq import InputError
from tissuq.experiments.reading.specimens_in_files import find_tests, read_column
from tissuq.studies.files_of_tests import files_of

ROWS = ["0.9,-3.5", "1.1,2.8", "1.2,5"]


def write(file, rows=ROWS, head="stretch,stress_kPa"):
    file.parent.mkdir(exist_ok=True, parents=True)
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return file


def experiments_in(file, column):
    return {name: reading.experiment for name, (reading,) in read_column(file, column).items()}


def test_files_are_specimens_and_folders_are_repeated_tests(tmp_path):
    for name in ("all/b.csv", "all/a.csv", "all/c/first.csv", "all/c/second.txt", "all/notes.md", "all/empty/x.md"):
        write(tmp_path / name)
    for name in ("all/~$b.xlsx", "all/._a.csv", "all/c/~$second.xlsx"):  # of open workbooks, and of macOS
        (tmp_path / name).write_bytes(b"\x05Anna\x00")
    tests = find_tests([tmp_path / "all"])
    assert {name: [file.name for file in files] for name, files in tests.items()} == {
        "a": ["a.csv"],
        "b": ["b.csv"],
        "c": ["first.csv", "second.txt"],
    }
    assert list(find_tests([tmp_path / "all" / "b.csv"])) == ["b"]
    assert [file.name for file in files_of([tmp_path / "all"])] == ["a.csv", "b.csv"]


def test_a_column_names_specimens(tmp_path):
    rows = [f"{name},{row}" for name in ("P 2", "P1", "10") for row in ROWS]
    file = write(tmp_path / "all.csv", [*rows, "P1,1.3,8"], "patient,stretch,stress_kPa")
    for column in ("patient", 1):
        found = experiments_in(file, column)
        assert {name: len(each) for name, each in found.items()} == {"P 2": 3, "P1": 4, "10": 3}
    assert found["P1"].stretch.tolist() == [0.9, 1.1, 1.2, 1.3]
    assert found["P1"].stress_unit == "kPa"


def test_a_long_file_of_numbers_is_divided_too(tmp_path):
    rows = [f"{k % 4},{1 + 1e-5 * k},{k}" for k in range(12_000)]
    found = experiments_in(write(tmp_path / "all.csv", rows, "id,stretch,stress_kPa"), "id")
    assert [len(each) for each in found.values()] == [3000] * 4
    assert found["3"].stress[:2].tolist() == pytest.approx([0.003, 0.007])


def test_a_bad_cell_is_named_with_its_line(tmp_path):
    file = write(tmp_path / "all.csv", ["a,0.9,-3", "b,1.1,1", "b,1.2,oops", "a,1.1,3"], "who,stretch,stress_kPa")
    with pytest.raises(InputError, match="line 4, column 'stress_kPa'"):
        experiments_in(file, "who")
    file = write(tmp_path / "all.csv", ["a,0.9,-3", ",1.1,1", "b,1.2,2"], "who,stretch,stress_kPa")
    with pytest.raises(InputError, match=r"line 3, column 'who': the name of the specimen is missing"):
        experiments_in(file, "who")
    with pytest.raises(InputError, match="no column 'patient'"):
        experiments_in(file, "patient")


def test_names_that_clash_and_empty_folders_are_refused(tmp_path):
    for name in ("a/x.csv", "b/x.csv"):
        write(tmp_path / name)
    with pytest.raises(InputError, match="both named 'x'"):
        find_tests([tmp_path / "a" / "x.csv", tmp_path / "b" / "x.csv"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no files that end in"):
        find_tests([tmp_path / "empty"])


def test_the_options_of_the_reader_hold_for_every_specimen_of_a_file(tmp_path):
    rows = [f"{name},{k * 0.1:.1f},{k * size:.1f}" for name, size in (("a", 1.0), ("b", 2.0)) for k in range(6)]
    file = write(tmp_path / "all.csv", rows, "who,displacement_mm,force_N")
    options = {"dimensions": {"length": "10 mm", "area": "4 mm2"}, "preload": "2 N", "every": 2}
    found = {name: reading for name, (reading,) in read_column(file, "who", **options).items()}
    assert found["a"].experiment.stretch.tolist() == pytest.approx([1, 1 + 0.2 / 10.2])
    assert found["b"].experiment.stress.tolist() == pytest.approx([0.5, 1.5, 2.5])
    assert found["b"].experiment.name == "b"
    assert "the preload" in found["b"].experiment.source


def test_a_specimen_of_a_column_may_have_several_tests(tmp_path):
    modes = {"uniaxial": (1.0, 1.1, 1.2, 1.3, 1.4), "simple-shear": (0.0, 0.1, 0.2, 0.3, 0.4)}
    rows = [
        f"{who},{mode},{control},{size * abs(control - controls[0]):.3f}"
        for who, size in (("a", 1.0), ("b", 2.0))
        for mode, controls in modes.items()
        for control in controls
    ]
    found = read_column(write(tmp_path / "all.csv", rows, "who,mode,stretch,stress_kPa"), "who")
    for who, size in (("a", 1.0), ("b", 2.0)):
        assert [reading.experiment.mode.name for reading in found[who]] == list(modes)
        assert [reading.experiment.stress[-1] for reading in found[who]] == pytest.approx([4e-4 * size] * 2)
