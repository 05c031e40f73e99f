"""Sizes of specimens in a table of their own: what is read of it, and that forces become the stresses of each."""

from __future__ import annotations

import shutil
import tomllib

import numpy as np
import pytest
from openpyxl import Workbook

import tissuq as tq
from command_line import done_in, run_in
from tissuq.experiments.reading.specimens_in_files import read_column
from tissuq.experiments.reading.table_of_specimens import TableOfSizes
from tissuq.studies.fit_settings import PopulationSettings
from written_files import text_file

SIZES = {"A": (20.0, 10.2, 3.1), "B": (21.5, 9.8, 2.9), "C": (19.2, 10.0, 3.3)}
"""Length, width and thickness of the specimens, mm."""
HEADER = "specimen,length [mm],width [mm],thickness [mm]"
MODULUS_MPA = {"A": 0.002, "B": 0.0015, "C": 0.0027}


def stress(name, stretch):
    """The stress of a specimen, MPa; neo-Hookean with a little scatter of its own."""
    scatter = 1e-5 * np.random.default_rng(ord(name)).standard_normal(stretch.size)
    return MODULUS_MPA[name] * (stretch - stretch**-2) + scatter


def settings_in(path):
    return tomllib.loads(path.read_text(encoding="utf-8"))


def rows_of(name, stretch):
    length, width, thickness = SIZES[name]
    force = stress(name, stretch) * width * thickness
    return [f"{(x - 1) * length!r},{f!r}" for x, f in zip(stretch.tolist(), force.tolist(), strict=True)]


@pytest.fixture
def laboratory(tmp_path):
    """A folder of forces and displacements of three specimens, and the sizes of these in a table beside the files."""
    stretch = np.linspace(1.0, 1.3, 20)
    folder = tmp_path / "tests"
    folder.mkdir()
    for name in SIZES:
        text_file(folder / f"{name}.csv", "displacement [mm],force [N]", *rows_of(name, stretch))
    text_file(folder / "sizes.csv", HEADER, *(",".join(map(str, (name, *sizes))) for name, sizes in SIZES.items()))
    return folder


def check_stress(experiment, name):
    assert np.allclose(experiment.stress, stress(name, experiment.stretch), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["specimen,length [mm],width [mm],thickness [mm],age", "A.csv,20,10,3,62"], (20, 10, 3)),
        (["Probe;Länge (cm);Breite b0 (mm);Dicke 1 (mm);Dicke 2 (mm)", "A;2,0;10;2,9;3,1"], (20, 10, 3)),
        (["id\tgauge length\twidth\tthickness", "\t[mm]\t[mm]\t[µm]", "A\t20\t10\t3000"], (20, 10, 3)),
        (["# of 3 May", "specimen,L0 [mm],width,thickness", "A,20,10 mm,3 mm"], (20, 10, 3)),
    ],
)
def test_tables_of_laboratories_are_read(tmp_path, lines, expected):
    (sizes,) = tq.read_sizes(text_file(tmp_path / "sizes.csv", *lines)).values()
    assert {name: float(text.removesuffix(" mm")) for name, text in sizes.items()} == pytest.approx(
        dict(zip(("length", "width", "thickness"), expected, strict=True))
    )


def test_an_area_takes_the_place_of_the_sides_that_it_is_of(tmp_path):
    table = text_file(tmp_path / "sizes.csv", "name,area [mm2],width [mm],thickness [mm]", "A,30,10,3")
    assert tq.read_sizes(table) == {"A": {"area": "30.0 mm2", "thickness": "3.0 mm"}}


def test_a_height_is_the_length_where_no_other_is_named(tmp_path):
    table = text_file(tmp_path / "sizes.csv", "name,height [mm],diameter [mm]", "A,8,12", "B,,9")
    assert tq.read_sizes(table) == {"A": {"diameter": "12.0 mm", "length": "8.0 mm"}, "B": {"diameter": "9.0 mm"}}


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([HEADER, "A,20,1o,3"], "line 2, column 'width [mm]': '1o' is no size"),
        ([HEADER, "A,20,10 mm2,3"], "line 2, column 'width [mm]': '10 mm2' is no size"),
        ([HEADER, "A,20,-10,3"], "'-10' is no size"),
        (["specimen,length,width [mm]", "A,20,10"], "column 'length': '20' is no size with a unit"),
        (["specimen,area [mm2],width [mm],thickness [mm]", "A,40,10,3"], "cross-section is 40 mm2 and 30 mm2"),
        (["specimen,width 1 [mm],width 2 [mm]", "A,4,10"], "the width is 4 mm and 10 mm"),
        (["specimen,age", "A,40"], "'age' is known as a size"),
        ([HEADER, "A,20,10,3", "A.csv,20,10,3"], "specimen 'A' has several rows"),
        ([HEADER], "holds no sizes"),
        ([HEADER, "A,20,10,3", ",20,10.4,3"], "line 3, column 'specimen': the row names no specimen"),
    ],
)
def test_what_is_no_table_of_sizes_is_refused(tmp_path, lines, words):
    with pytest.raises(tq.InputError) as refusal:
        tq.read_sizes(text_file(tmp_path / "sizes.csv", *lines))
    assert words in str(refusal.value)


def test_rows_without_cells_stand_between_groups(tmp_path):
    table = text_file(tmp_path / "sizes.csv", HEADER, "A,20,10,3", ",,,", ", , ,", "B,20,10,3", ",,,")
    assert list(tq.read_sizes(table)) == ["A", "B"]


def test_sizes_are_in_the_first_sheet_and_a_message_says_so(tmp_path):
    book = Workbook()
    book.active.title = "Notes"
    sheet = book.create_sheet("Sizes")
    sheet.append(HEADER.split(","))
    sheet.append(["A", 20, 10, 3])
    book.save(tmp_path / "book.xlsx")
    with pytest.raises(tq.InputError, match="sheet 'Notes', which is the first, holds no sizes"):
        tq.read_sizes(tmp_path / "book.xlsx")


def test_python_reads_each_file_with_its_sizes(laboratory):
    for name, dimensions in tq.read_sizes(laboratory / "sizes.csv").items():
        check_stress(tq.read(laboratory / f"{name}.csv", dimensions=dimensions), name)


def test_fit_takes_the_sizes_of_each_file_and_keeps_them_with_the_run(laboratory, tmp_path):
    options = ["--mode", "uniaxial", "--discrepancy", "none", "--no-figures"]
    done_in(laboratory, "fit", laboratory, "--sizes", laboratory / "sizes.csv", *options, "--out", tmp_path / "run")
    tests = settings_in(tmp_path / "run" / "run.toml")["tests"]
    for test, (length, width, thickness) in zip(tests, SIZES.values(), strict=True):
        assert test["dimensions"] == {
            "length": f"{length} mm", "width": f"{width} mm", "thickness": f"{thickness} mm"
        }  # fmt: skip


def test_an_option_takes_the_place_of_the_size_in_the_table(laboratory):
    file, table = laboratory / "A.csv", laboratory / "sizes.csv"
    said = done_in(laboratory, "inspect", file, "--sizes", table, "--length", "40 mm").out
    assert "40 mm (length as given)" in said
    assert "31.62 mm2" in said
    said = done_in(laboratory, "inspect", file, "--sizes", table, "--area", "30 mm2").out
    assert "30 mm2 (as given)" in said
    assert "20 mm (length as given)" in said


def test_a_population_takes_the_sizes_of_its_specimens_and_is_repeated_with_them(laboratory, tmp_path):
    first, again = tmp_path / "first", tmp_path / "again"
    options = ["--discrepancy", "none", "--no-figures", "--out"]
    done_in(laboratory, "population", laboratory, "--sizes", laboratory / "sizes.csv", *options, first)
    done_in(laboratory, "population", "--config", first / "run.toml", "--no-figures", "--out", again)
    assert (first / "specimens.csv").read_bytes() == (again / "specimens.csv").read_bytes()
    assert (first / "input" / "sizes-of-specimens.csv").read_bytes() == (laboratory / "sizes.csv").read_bytes()


def test_specimens_in_a_column_have_the_sizes_of_their_rows(laboratory, tmp_path):
    stretch = np.linspace(1.0, 1.3, 20)
    lines = [f"{name},{row}" for name in SIZES for row in rows_of(name, stretch)]
    file = text_file(tmp_path / "all.csv", "sample,displacement [mm],force [N]", *lines)
    for name, (reading,) in read_column(file, "sample", TableOfSizes.read(laboratory / "sizes.csv")).items():
        check_stress(reading.experiment, name)


def test_a_folder_of_tests_has_the_sizes_of_its_specimen(laboratory, tmp_path):
    for name in SIZES:
        folder = tmp_path / "specimens" / name
        folder.mkdir(parents=True)
        for number, low in enumerate((1.0, 1.01), 1):
            rows = rows_of(name, np.linspace(low, 1.3, 20))
            text_file(folder / f"test {number}.csv", "displacement [mm],force [N]", *rows)
    options = ["--sizes", laboratory / "sizes.csv", "--discrepancy", "none", "--no-figures", "--out", tmp_path / "run"]
    assert "modulus" in done_in(tmp_path, "population", tmp_path / "specimens", *options).out


def test_a_file_that_may_have_the_sizes_of_its_folder_says_which_it_takes(laboratory, tmp_path):
    (tmp_path / "A").mkdir()
    (laboratory / "B.csv").rename(tmp_path / "A" / "B.csv")
    table = text_file(tmp_path / "sizes.csv", HEADER, "A,20,10,3")
    with pytest.warns(UserWarning, match="its sizes are taken from the row of its folder, 'A'"):
        done_in(tmp_path, "inspect", tmp_path / "A" / "B.csv", "--sizes", table)
    text_file(table, HEADER, "A,20,10,3", "B,20,11,3")
    with pytest.warns(UserWarning, match="another for its folder, 'A': its sizes are taken from its own"):
        assert "11 mm as given" in done_in(tmp_path, "inspect", tmp_path / "A" / "B.csv", "--sizes", table).out


def test_tests_in_the_folder_of_a_specimen_do_not_take_the_sizes_of_another_that_has_their_name(laboratory, tmp_path):
    for name in SIZES:
        folder = tmp_path / "specimens" / name
        folder.mkdir(parents=True)
        for test in ("A", "B"):
            shutil.copy(laboratory / f"{name}.csv", folder / f"{test}.csv")
    settings = PopulationSettings(files=("specimens",), sizes=str(laboratory / "sizes.csv"), mode="uniaxial")
    for name, readings in settings.readings(tmp_path).items():
        for reading in readings:
            check_stress(reading.experiment, name)


def test_rows_that_differ_in_capitals_alone_are_not_taken_for_each_other(tmp_path):
    sizes = TableOfSizes.read(text_file(tmp_path / "sizes.csv", HEADER, "S-1 left,20,10,3", "s_1_Left,20,11,3"))
    assert sizes.dimensions(["s_1_Left"], "a test", None)["width"] == "11.0 mm"
    with pytest.raises(tq.InputError, match="both may be 'S_1_LEFT'"):
        sizes.dimensions(["S_1_LEFT"], "a test", None)


@pytest.mark.parametrize("command", ["inspect", "fit", "population"])
def test_a_file_without_a_row_is_refused(laboratory, tmp_path, command):
    table = text_file(tmp_path / "others.csv", HEADER, "X,20,10,3")
    (laboratory / "sizes.csv").unlink()
    said = run_in(laboratory, command, laboratory, "--sizes", table).err
    assert "others.csv has no row for" in said
    assert "its rows are of X" in said


def test_a_configuration_has_sizes_of_its_own(laboratory, tmp_path):
    study = tmp_path / "study.toml"
    done_in(laboratory, "inspect", laboratory / "A.csv", "--sizes", laboratory / "sizes.csv", "--write", study)
    assert settings_in(study)["tests"][0]["dimensions"]["length"] == "20.0 mm"
    said = run_in(laboratory, "fit", "--config", study, "--sizes", laboratory / "sizes.csv").err
    assert "'dimensions' of a test" in said
