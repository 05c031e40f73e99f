"""Several tests in one file: in sheets, tables, columns or rows."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest

import tissuq as tq
from machine_files import MU, neo_hookean, ramp
from tissuq.errors import InputError
from tissuq.experiments.reading.findings import data_warnings
from tissuq.experiments.reading.tests_in_file import find_tests_in_file, read_tests
from written_files import check_curve, text_file, workbook

STIFFNESS = {"S1": 1.0, "S2": 1.1, "S3": 1.2}
SIZES = {"length": "10 mm", "area": "10 mm2"}


def cell(number):
    return f"{number:.6f}"


def rows_of(*columns):
    return [[cell(value) for value in row] for row in zip(*columns, strict=True)]


def written(path, rows, separator=","):
    path.write_text("\n".join(separator.join(row) for row in rows) + "\n", encoding="utf-8")
    return path


def check(tests, names=STIFFNESS, sizes=(1.0, 1.1, 1.2), stretch=None):
    """Compare tests with neo-Hookean specimens, each so many times as stiff."""
    assert [test.name for test in tests] == list(names)
    for test, size in zip(tests, sizes, strict=True):
        check_curve(test, ramp() if stretch is None else stretch, size * neo_hookean(test.stretch), atol=2e-6)


def one_column_a_specimen(header, names_above=()):
    stretch = ramp()
    columns = [stretch - 1, *(1e3 * size * neo_hookean(stretch) for size in STIFFNESS.values())]
    return [*([list(names_above)] if names_above else []), header, *rows_of(*columns)]


def pairs(header, names_above=()):
    stretch = ramp()
    columns = [column for size in STIFFNESS.values() for column in (stretch - 1, 1e3 * size * neo_hookean(stretch))]
    return [*([list(names_above)] if names_above else []), header, *rows_of(*columns)]


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        (one_column_a_specimen(["Strain", *(f"Stress_S{k} [kPa]" for k in "123")]), ["s1", "s2", "s3"]),
        (one_column_a_specimen(["Strain", *(f"Sample {k} stress [kPa]" for k in "123")]),
         ["sample 1", "sample 2", "sample 3"]),
        (one_column_a_specimen(["Strain", *["Stress [kPa]"] * 3], ["", *STIFFNESS]), STIFFNESS),
        (pairs(["Strain", "Stress [kPa]"] * 3), "123"),
        (pairs(["Strain", "Stress [kPa]"] * 3, ["S1", "", "S2", "", "S3", ""]), STIFFNESS),
        (pairs(["Strain", "Stress [kPa]", "Strain.1", "Stress [kPa].1", "Strain.2", "Stress [kPa].2"]), "123"),
        (pairs([name.format(k) for k in "ABC" for name in ("Strain {} [-]", "Stress {} [kPa]")]), "abc"),
    ],
)  # fmt: skip
def test_tests_beside_one_another_are_read_each_by_its_columns(tmp_path, rows, names):
    check(read_tests(written(tmp_path / "wide.csv", rows)), names)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (["Strain", "Stress [kPa]", "Stress [kPa]", "Stress [kPa]"], "several columns may be the stress"),
        (["Strain", "Stress 11 [kPa]", "Stress 22 [kPa]", "Stress 33 [kPa]"], "is of a biaxial test"),
        (["Strain", "Engineering stress [kPa]", "Nominal stress [kPa]", "Stress rate [kPa]"], "several columns may be"),
    ],
)
def test_columns_that_are_not_of_several_tests_are_not_taken_for_them(tmp_path, header, message):
    with pytest.raises(InputError, match=message):
        read_tests(written(tmp_path / "one.csv", one_column_a_specimen(header)))


def test_axes_x_and_y_are_of_one_test_and_1_and_2_are_asked_about(tmp_path):
    rows = rows_of(*[ramp()] * 2, *[ramp() - ramp() ** -5] * 2)
    header = ["stretch_{}", "stretch_{}", "stress_{} [kPa]", "stress_{} [kPa]"]
    lettered, numbered = (
        [name.format(axis) for name, axis in zip(header, axes, strict=True)] for axes in ("xyxy", "1212")
    )
    (test,) = find_tests_in_file(written(tmp_path / "axes.csv", [lettered, *rows]))
    assert (test.options["mode"], test.reading.mode_source) == ("biaxial", "columns of both axes")
    path = written(tmp_path / "either.csv", [numbered, *rows])
    with pytest.raises(InputError, match=r"--mode biaxial.*If numbers in the names are of two specimens, write S1"):
        read_tests(path)
    (test,) = find_tests_in_file(path, mode="biaxial")
    assert test.reading.experiment.stress.shape == (60, 2)


def test_stresses_along_axes_whose_measure_is_open_are_asked_about_and_the_advice_reads_them(tmp_path):
    stress = 1e3 * MU * (ramp() - ramp() ** -5)
    rows = [["lambda_x", "lambda_y", "sigma_xx[kPa]", "sigma_yy[kPa]"], *rows_of(ramp(), ramp(), stress, 2 * stress)]
    path = written(tmp_path / "sheet.csv", rows)
    with pytest.raises(InputError, match=r"--stress-type; in Python stress_type\): engineering, cauchy"):
        read_tests(path)
    (test,) = read_tests(path, stress_type="cauchy")
    assert test.mode.name == "biaxial"
    np.testing.assert_allclose(test.stress, np.outer(1e-3 * stress / ramp(), [1, 2]).reshape(60, 2), atol=2e-6)


@pytest.mark.parametrize(
    ("above", "own", "names"),
    [
        ([], ["10% PVA", "15% PVA", "20% PVA"], ["10% PVA", "15% PVA", "20% PVA"]),
        (["", "Control", "", "Treated"], ["n1", "n2", "n1"], ["Control n1", "Control n2", "Treated n1"]),
        ([], ["gel", "gel", "gel"], ["1", "2", "3"]),
    ],
)
def test_columns_of_specimens_are_given_by_the_first_and_the_last_number(tmp_path, above, own, names):
    """As tables beside the figures of papers have them."""
    path = written(tmp_path / "figure.csv", one_column_a_specimen(["Strain", *own], above))
    with pytest.raises(
        InputError, match=r"If columns 2 to 4 hold the stresses .* --column stress=2:4 and --stress-uni"
    ):
        read_tests(path)
    check(read_tests(path, columns={"stress": "2:4"}, stress_unit="kPa"), names=names)
    first_two = read_tests(path, columns={"strain": 1, "stress": "2:3"}, stress_unit="kPa")
    check(first_two, names=[test.name for test in first_two], sizes=(1.0, 1.1))
    for numbers in ("2:5", "3:2", "0:2"):
        with pytest.raises(InputError, match=f"has no columns {numbers}: it has 4 columns, counted from 1"):
            read_tests(path, columns={"stress": numbers}, stress_unit="kPa")


def test_a_shorter_test_ends_where_its_cells_do(tmp_path):
    rows = pairs(["Strain", "Stress [kPa]"] * 3)
    common = one_column_a_specimen(["Strain", "Stress_S1 [kPa]", "Stress_S2 [kPa]", "Stress_S3 [kPa]"])
    for row in rows[-7:]:
        row[2:4] = ["", ""]
    for row in common[-7:]:
        row[2] = "---"
    for content in (rows, common):
        tests = find_tests_in_file(written(tmp_path / "wide.csv", content))
        assert [len(test.reading.experiment) for test in tests] == [60, 53, 60]
        assert "7 rows without values of" in tests[1].reading.warnings[0]
        assert f"the first in line {len(content) - 6}" in tests[1].reading.warnings[0]
        np.testing.assert_allclose(tests[1].reading.experiment.stretch, ramp()[:53], atol=2e-6)


def test_missing_rows_are_left_out_and_many_with_a_missing_cell_are_not(tmp_path):
    rows = [["stretch", "stress [kPa]"], *rows_of(ramp(), 1e3 * neo_hookean(ramp()))]
    rows[10] = ["NaN", "NaN"]
    test = find_tests_in_file(written(tmp_path / "a.csv", rows))[0].reading
    assert len(test.experiment) == 59
    assert test.warnings == ("1 row without values of 'stretch' and 'stress [kPa]' left out, in line 11.",)
    rows[20] = ["1.1", "NaN"]
    test = find_tests_in_file(written(tmp_path / "b.csv", rows))[0].reading
    assert len(test.experiment) == 58
    assert test.warnings[1] == "1 row without a value of 'stretch' or 'stress [kPa]' left out, in line 21."
    for read in (tq.read, tq.read_tests):
        with pytest.warns(UserWarning, match="left out") as caught:
            read(tmp_path / "b.csv")
        assert [str(warning.message) for warning in caught] == list(test.warnings)
    for row in (31, 32, 33, 40):
        rows[row] = ["1.1", ""]
    lines = "21,32:34,41"
    words = rf"line 21, column 'stress \[kPa\]': 'NaN' is not.* Fill in the value\. .*: --leave-out {lines} \(leave_out"
    with pytest.raises(InputError, match=words):
        read_tests(written(tmp_path / "c.csv", rows))
    assert [len(test) for test in read_tests(tmp_path / "c.csv", leave_out=lines)] == [54]


def test_lines_that_cannot_be_read_are_left_out_as_the_message_says(tmp_path):
    rows = [["stretch", "stress [kPa]"], *rows_of(ramp(), 1e3 * neo_hookean(ramp()))]
    rows[20:20] = [["stop"], ["// camera trigger"]]
    rows[30] = ["1.2", "overload"]
    path = written(tmp_path / "a.csv", rows)
    with pytest.raises(InputError, match=r"line 21, column 'stretch': 'stop' is not .*--leave-out 21,31 "):
        read_tests(path)
    (test,) = read_tests(path, leave_out="21,31,40")
    np.testing.assert_allclose(test.stretch, np.delete(ramp(), [27, 36]), atol=2e-6)
    assert "without the rows in lines 21,31,40" in test.source


def steps(titles=("Tension - 1", "Tension - 2"), sizes=(1.0, 1.1)):
    """Two steps as a rheometer's software exports them."""
    lines = [["Filename", "test"], [""]]
    for title, size in zip(titles, sizes, strict=True):
        lines += [[""], ["[step]"], [title], ["Time", "Displacement", "Force"], ["s", "mm", "N"]]
        lines += rows_of(np.arange(60) / 10, 10 * (ramp() - 1), 10 * size * neo_hookean(ramp()))
    return lines


def test_tables_beneath_one_another_are_tests_named_by_their_titles(tmp_path):
    path = written(tmp_path / "steps.txt", steps(), "\t")
    check(read_tests(path, dimensions=SIZES), ["Tension - 1", "Tension - 2"], (1.0, 1.1))
    with pytest.raises(InputError, match=r"several tables: 1 in lines 8 to 67, 2 in lines 73 to 132.*--table 1"):
        tq.read_experiment(path, dimensions=SIZES)
    second = tq.read_experiment(path, dimensions=SIZES, table=2)
    np.testing.assert_allclose(second.stress, 1.1 * neo_hookean(ramp()), atol=2e-6)
    assert second.source.startswith("steps.txt, table 2: stretch")
    with pytest.raises(InputError, match="has no table 3; its tables are numbered from 1 to 2"):
        tq.read_experiment(path, table=3)


def test_tables_in_which_time_goes_on_are_one_test(tmp_path):
    lines, time = [["MTS793"]], np.arange(60) / 10
    for part in (slice(0, 25), slice(25, 60)):
        lines += [[""], ["Data Header:", "Time:", "5.1", "Sec"], ["Crosshead", "Load", "Time"], ["mm", "N", "Sec"]]
        lines += rows_of(10 * (ramp() - 1)[part], 10 * neo_hookean(ramp())[part], time[part])
    (test,) = find_tests_in_file(written(tmp_path / "mts.txt", lines, "\t"), dimensions=SIZES)
    check([test.reading.experiment], ["mts"], [1.0])
    assert "2 tables in lines 6 to 69 go on from one another, and are read as one" in test.reading.warnings[0]


def pages(*parts, title=""):
    lines = []
    for number, part in enumerate(parts):
        lines += [[f"{title} {number + 1}"]] if title else []
        lines += [["stretch", "stress [kPa]"], *rows_of(ramp()[part], 1e3 * neo_hookean(ramp())[part])]
    return lines


def test_pages_of_one_ramp_are_one_test_to_the_last_row(tmp_path):
    path = written(tmp_path / "a.csv", pages(slice(0, 20), slice(20, 40), slice(40, 59), slice(59, 60)))
    (test,) = read_tests(path)
    check_curve(test, ramp(), neo_hookean(ramp()), atol=1e-6)
    loading_and_unloading = written(tmp_path / "b.csv", pages(slice(0, 60), slice(None, None, -1)))
    assert [test.size for test in read_tests(loading_and_unloading)] == [120]


@pytest.mark.parametrize(
    "lines",
    [
        pages(slice(0, 60), slice(0, 60)),
        [*pages(slice(0, 60)), *rows_of(ramp()[58::-1], 1e3 * neo_hookean(ramp())[58::-1]), *pages(slice(0, 60))],
        pages(slice(0, 20), slice(40, 60)),
        pages(slice(0, 30), slice(30, 60), title="Specimen"),
    ],
    ids=["anew", "anew after unloading", "with a gap", "with titles"],
)
def test_tables_that_begin_anew_are_several_tests(tmp_path, lines):
    assert len(read_tests(written(tmp_path / "a.csv", lines))) == 2


def test_a_word_among_the_numbers_is_a_bad_cell_and_no_second_table(tmp_path):
    rows = [["stretch", "stress [kPa]"], *rows_of(ramp(), 1e3 * neo_hookean(ramp()))]
    rows.insert(30, ["stop", "stop"])
    with pytest.raises(InputError, match="line 31, column 'stretch': 'stop' is not a number"):
        read_tests(written(tmp_path / "a.csv", rows))


def sheet(names, deformation, stress):
    return [names, *([float(a), float(b)] for a, b in zip(deformation, stress, strict=True))]


TENSION = sheet(["stretch", "stress [kPa]"], ramp(), 1e3 * neo_hookean(ramp()))
SHEAR = sheet(["shear", "stress [kPa]"], ramp() - 1, 1e3 * MU * (ramp() - 1))
RESULTS = [["Specimen", "Maximum"], [1, 2.0], [2, 3.0]]


def test_sheets_are_tests_with_the_modes_that_they_say(tmp_path):
    path = workbook(tmp_path / "liver.xlsx", Results=RESULTS, tension=TENSION, Blatt3=SHEAR)
    tests = find_tests_in_file(path)
    assert [(test.name, test.options["mode"], test.reading.mode_source) for test in tests] == [
        ("tension", "uniaxial", "'tension'"),
        ("Blatt3", "simple-shear", "a column of shear"),
    ]
    assert "sheet 'Results' is no test: no columns of one" in tests[0].reading.warnings[-1]
    np.testing.assert_allclose(tests[1].reading.experiment.stress, MU * (ramp() - 1), rtol=1e-12)
    for test in tests:
        alone = tq.read_experiment(path, **test.options)
        assert alone.mode == test.reading.experiment.mode
        np.testing.assert_array_equal(alone.measured, test.reading.experiment.measured)


def test_a_long_table_that_is_not_understood_is_no_mere_results(tmp_path):
    unknown = sheet(["alpha", "beta"], ramp(), ramp())
    path = workbook(tmp_path / "liver.xlsx", tension=TENSION, other=unknown)
    with pytest.raises(InputError, match=r"sheet 'other': no column is recognised.*read 'tension': --sheet 'tension'"):
        read_tests(path)
    assert len(read_tests(path, sheet="tension")) == 1


def test_one_sheet_that_holds_a_test_is_the_test_of_the_file(tmp_path):
    (test,) = find_tests_in_file(workbook(tmp_path / "liver.xlsx", Results=RESULTS, Data=TENSION))
    assert test.options["sheet"] == "Data"


def test_options_that_only_some_tests_need_are_for_these(tmp_path):
    force = sheet(["Displacement [mm]", "Force [N]"], 10 * (1 - ramp()), -10 * neo_hookean(2 - ramp()))
    path = workbook(tmp_path / "liver.xlsx", compression=[[force[0][0], force[0][1]], *force[1:]], shear=SHEAR)
    tests = find_tests_in_file(path, dimensions=SIZES, compression_positive=True)
    assert [(test.options["dimensions"], test.options["compression_positive"]) for test in tests] == [
        (SIZES, True),
        (None, None),
    ]
    np.testing.assert_allclose(tests[1].reading.experiment.stress, MU * (ramp() - 1), rtol=1e-12)
    with pytest.raises(InputError, match="which needs no length"):
        tq.read_experiment(path, sheet="shear", dimensions=SIZES)


def test_a_mode_that_only_some_tests_say_is_asked_for(tmp_path):
    path = workbook(tmp_path / "liver.xlsx", tension=TENSION, Blatt3=TENSION)
    with pytest.raises(InputError, match=r"'Blatt3' does not say in which loading mode.*--mode once for all 2 tests"):
        read_tests(path)
    assert len(read_tests(path, mode="equibiaxial")) == 2


def test_tests_of_specimens_and_modes_in_rows_are_parted_by_both(tmp_path):
    rows = [["mode", "stretch", "stress_kPa", "specimen"]]
    for name, size in (("A", 1.0), ("B", 1.1)):
        for mode, stretch in (("uniaxial", ramp()), ("equibiaxial", ramp(1.2))):
            stress = MU * (stretch - stretch ** (-2.0 if mode == "uniaxial" else -5.0))
            rows += [[mode, *row, name] for row in rows_of(stretch, 1e3 * size * stress)]
    tests = read_tests(written(tmp_path / "rows.csv", rows))
    names = [(test.mode.name, round(1e3 * test.stress[-1], 3)) for test in tests]
    uni, equi = 1e3 * neo_hookean(1.4), 1e3 * MU * (1.2 - 1.2**-5)
    assert names == [
        (mode, pytest.approx(size * top, abs=1e-3))
        for size in (1.0, 1.1)
        for mode, top in (("uniaxial", uni), ("equibiaxial", equi))
    ]
    assert [test.specimen for test in tests] == ["A", "A", "B", "B"]


MODES = {"UT": ("uniaxial", -2), "EB": ("equibiaxial", -5), "PS": ("planar", -3)}
"""Loading modes as tables abbreviate them, with the power of a neo-Hookean stress in each."""


def check_modes(tests):
    """Compare tests with a neo-Hookean specimen in each of the modes."""
    assert [test.mode.name for test in tests] == [mode for mode, _ in MODES.values()]
    for test, (_, power) in zip(tests, MODES.values(), strict=True):
        check_curve(test, ramp(), MU * (ramp() - ramp() ** power), atol=2e-6)


@pytest.mark.parametrize("column", ["mode", "Type"])
def test_a_column_that_abbreviates_modes_tells_them(tmp_path, column):
    rows = [[column, "stretch", "stress_kPa"]]
    for name, (_, power) in MODES.items():
        rows += [[name, *row] for row in rows_of(ramp(), 1e3 * MU * (ramp() - ramp() ** power))]
    check_modes(read_tests(written(tmp_path / "rows.csv", rows)))


def test_letters_in_a_column_of_modes_that_are_none_are_refused(tmp_path):
    rows = [[mode, *row] for mode in ("UT", "BT") for row in rows_of(ramp(), 1e3 * neo_hookean(ramp()))]
    path = written(tmp_path / "rows.csv", [["mode", "stretch", "stress_kPa"], *rows])
    with pytest.raises(InputError, match=r"column 'mode': 'BT' is no loading mode that is known\. .*equibiaxial"):
        read_tests(path)
    (test,) = read_tests(path, only={"mode": "BT"}, mode="equibiaxial")
    assert test.mode.name == "equibiaxial"


@pytest.mark.parametrize(
    "names",
    [
        ["Uniaxial {} {}", "Equibiaxial {} {}", "Planar {} {}"],
        ["{}_uniaxial {}", "{}_equibiaxial {}", "{}_pure_shear {}"],
        ["UT_{} {}", "EB_{} {}", "PS_{} {}"],
    ],
)
def test_columns_that_modes_tell_apart_are_tests_in_these_modes(tmp_path, names):
    header = [name.format(*of) for name in names for of in (("strain", "(-)"), ("stress", "(kPa)"))]
    columns = [column for _, power in MODES.values() for column in (ramp() - 1, 1e3 * MU * (ramp() - ramp() ** power))]
    check_modes(read_tests(written(tmp_path / "wide.csv", [header, *rows_of(*columns)])))


def test_what_two_modes_may_be_called_is_said_where_their_columns_do_not_fit(tmp_path):
    header = ["stretch_uniaxial", "stress_uniaxial", "stretch_{}", "stress_{}"]
    rows = rows_of(*[ramp(), neo_hookean(ramp())] * 2)
    for mode, meant in (("shear", "call it planar"), ("biaxial", "call it equibiaxial")):
        path = written(tmp_path / f"{mode[0]}.csv", [[name.format(mode) for name in header], *rows])
        with pytest.raises(InputError, match=meant):
            read_tests(path)


def test_specimens_1_and_2_with_times_of_their_own_are_no_axes(tmp_path):
    names = ["Time {}", "Extension {} (mm)", "Load {} (N)", "Tensile strain (Extension) {} (%)"]
    header = [name.format(k) for k in (1, 2) for name in names]
    stretch = ramp()
    columns = [
        column
        for size in (1.0, 1.1)
        for column in (stretch, 10 * (stretch - 1), 10 * size * neo_hookean(stretch), 100 * (stretch - 1))
    ]
    path = written(tmp_path / "wide.csv", [header, *rows_of(*columns)])
    tests = find_tests_in_file(path, dimensions=SIZES)
    check([test.reading.experiment for test in tests], names="12", sizes=(1.0, 1.1))
    assert not [warning for test in tests for warning in data_warnings(test.reading) if "biaxial" in str(warning)]
    of_axes = [k for k, name in enumerate(header) if "Time" not in name]
    rows = [[header[k] for k in of_axes], *rows_of(*[columns[k] for k in of_axes])]
    with pytest.raises(InputError, match="is of a biaxial test"):
        read_tests(written(tmp_path / "axes.csv", rows), dimensions=SIZES)


def test_a_mode_comes_from_the_name_of_a_file_and_a_misfit_says_so(tmp_path):
    path = written(tmp_path / "liver-planar.csv", TENSION[:1] + rows_of(ramp(), neo_hookean(ramp())))
    assert tq.read_experiment(path).mode.name == "planar"
    assert tq.read_experiment(path, mode="uniaxial").mode.name == "uniaxial"
    path = written(tmp_path / "shear.csv", TENSION[:1] + rows_of(ramp(), neo_hookean(ramp())))
    with pytest.raises(InputError, match="The loading mode simple-shear is from the name of the file; give --mode"):
        tq.read_experiment(path)


def test_sheets_of_libreoffice_are_read(tmp_path):
    pytest.importorskip("python_calamine", reason="python-calamine is not installed")
    rows = "".join(
        "<table:table-row>"
        + "".join(
            f'<table:table-cell office:value-type="float" office:value="{value!r}"><text:p>{value:.2f}</text:p>'
            "</table:table-cell>"
            if isinstance(value, float)
            else f'<table:table-cell office:value-type="string"><text:p>{value}</text:p></table:table-cell>'
            for value in row
        )
        + "</table:table-row>"
        for row in TENSION
    )
    urn = "urn:oasis:names:tc:opendocument:xmlns"
    spaces = "".join(f' xmlns:{name}="{urn}:{name}:1.0"' for name in ("office", "table", "text"))
    sheet = f'<table:table table:name="tension">{rows}</table:table>'
    body = f"<office:body><office:spreadsheet>{sheet}</office:spreadsheet></office:body>"
    with zipfile.ZipFile(tmp_path / "test.ods", "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", f'<manifest:manifest xmlns:manifest="{urn}:manifest:1.0"/>')
        archive.writestr("content.xml", f"<office:document-content{spaces}>{body}</office:document-content>")
    (test,) = read_tests(tmp_path / "test.ods")
    np.testing.assert_array_equal(test.stress, 1e-3 * np.array([row[1] for row in TENSION[1:]]))


def matlab_file(path, kind, **variables):
    if kind == "5":
        from scipy.io import savemat

        savemat(path, variables)
        return path
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            for field, part in value.items() if isinstance(value, dict) else [("", value)]:
                file[f"{name}/{field}" if field else name] = np.atleast_2d(part) if np.ndim(part) < 2 else part.T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    return path


@pytest.mark.parametrize("kind", ["5", "7.3"])
def test_vectors_and_structures_of_matlab_are_tables(tmp_path, kind):
    stress = 1e3 * neo_hookean(ramp())
    path = matlab_file(tmp_path / "a.mat", kind, stretch=ramp(), stress=stress, comment_code=3.0)
    test = tq.read_experiment(path, stress_unit="kPa")
    np.testing.assert_array_equal(test.stretch, ramp())
    np.testing.assert_allclose(test.stress, neo_hookean(ramp()), rtol=1e-15)
    structure = {name: {"stretch": ramp(), "stress": size * stress} for name, size in STIFFNESS.items()}
    check(read_tests(matlab_file(tmp_path / "b.mat", kind, **structure), stress_unit="kPa"))
    matrix = matlab_file(tmp_path / "c.mat", kind, data=np.column_stack([ramp(), stress]))
    test = tq.read_experiment(matrix, columns={"stretch": 1, "stress": 2}, stress_unit="kPa")
    np.testing.assert_allclose(test.stress, neo_hookean(ramp()), rtol=1e-15)


def test_a_damaged_file_of_matlab_is_refused(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0 MAT-file, Platform: " + bytes(range(200)))
    with pytest.raises(InputError, match="seems to be a file of MATLAB, but it cannot be opened"):
        tq.read_experiment(tmp_path / "a.mat")


def test_a_table_of_parquet_is_read_to_the_last_digit(tmp_path):
    polars = pytest.importorskip("polars", reason="polars is not installed")
    columns = {"stretch": ramp(), "stress [MPa]": neo_hookean(ramp()), "Specimen": ["S1"] * len(ramp())}
    polars.DataFrame(columns).write_parquet(tmp_path / "test.parquet")
    test = tq.read(tmp_path / "test.parquet")
    np.testing.assert_array_equal(test.stretch, ramp())
    np.testing.assert_array_equal(test.stress, neo_hookean(ramp()))
    two = polars.concat([polars.DataFrame(columns | {"Specimen": [name] * len(ramp())}) for name in ("S1", "S2")])
    two.write_parquet(tmp_path / "two.parquet")
    assert [test.name for test in read_tests(tmp_path / "two.parquet")] == ["S1", "S2"]


def test_a_parquet_file_that_is_damaged_or_far_too_long_is_refused(tmp_path):
    polars = pytest.importorskip("polars", reason="polars is not installed")
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(range(200)) + b"PAR1")
    with pytest.raises(InputError, match="seems to be a Parquet file, but it cannot be opened"):
        tq.read(tmp_path / "a.parquet")
    long = polars.select(stretch=polars.repeat(1.0, 10_000_001))
    long.write_parquet(tmp_path / "b.parquet")
    assert (tmp_path / "b.parquet").stat().st_size < 100_000
    with pytest.raises(InputError, match="10000001 rows; at most 10000000 are read"):
        tq.read(tmp_path / "b.parquet")


def test_a_table_of_very_many_columns_is_refused_at_once(tmp_path):
    rows = [[f"x{k}" for k in range(9000)], *[[f"{row}.5"] * 9000 for row in range(8)]]
    with pytest.raises(InputError, match="a table of 9000 columns; at most 1000 are read"):
        read_tests(written(tmp_path / "wide.csv", rows))


BIAXIAL = """stretch x,stretch y,stress x [kPa],stress y [kPa]
1.0,1.0,0,0
1.1,1.05,2,1.5
1.2,1.1,4,3
"""


def test_one_axis_of_a_biaxial_machine_is_read_without_a_mode(tmp_path):
    path = text_file(tmp_path / "sheet.csv", BIAXIAL)
    for options in ({"axis": "y"}, {"columns": {"stretch": "stretch y", "stress": "stress y [kPa]"}}):
        (test,) = read_tests(path, **options)
        assert test.mode.name == "uniaxial"
        assert test.stretch.tolist() == [1.0, 1.05, 1.1]
        assert test.stress == pytest.approx([0, 1.5e-3, 3e-3])
    assert read_tests(path)[0].mode.name == "biaxial"


def test_shear_tests_beside_one_another_tell_their_mode(tmp_path):
    path = text_file(tmp_path / "fungi.csv", "Shear,Stress S1 [kPa],Stress S2 [kPa]\n0,0,0\n0.1,1,1.2\n0.2,2,2.4")
    tests = find_tests_in_file(path)
    assert [(test.name, test.options["mode"], test.reading.mode_source) for test in tests] == [
        ("s1", "simple-shear", "a column of shear"), ("s2", "simple-shear", "a column of shear")
    ]  # fmt: skip
    assert tests[1].reading.experiment.stress == pytest.approx([0, 1.2e-3, 2.4e-3])


def test_columns_that_r_names_by_specimen_and_quantity_are_tests_beside_one_another(tmp_path):
    names = [f"{name}.{quantity}" for name in STIFFNESS for quantity in ("strain", "stress")]
    path = written(tmp_path / "r.csv", pairs(names))
    with pytest.warns(UserWarning, match="no unit of stress"):
        tests = read_tests(path)
    assert [test.name for test in tests] == ["s1", "s2", "s3"]
    check(read_tests(path, stress_unit="kPa"), names=["s1", "s2", "s3"])


def test_curves_that_a_digitizer_names_x_and_y_beneath_their_names_are_read_by_these(tmp_path):
    stretch = ramp()
    curves = [(stretch - 1, 1e3 * neo_hookean(stretch)), (stretch[:20] - 1, 1.5e3 * neo_hookean(stretch[:20]))]
    rows = [["Longitudinal", "", "Circumferential", ""], ["X", "Y", "X", "Y"]]
    for number in range(len(stretch)):
        rows.append([cell(x[number]) if number < len(x) else "" for curve in curves for x in curve])
    path = written(tmp_path / "wpd.csv", rows)
    options = {"columns": {"strain": "X", "stress": "Y"}, "stress_unit": "kPa"}
    tests = [test.reading.experiment for test in find_tests_in_file(path, **options)]
    assert [(test.name, test.direction) for test in tests] == [
        ("Longitudinal", "longitudinal"),
        ("Circumferential", "circumferential"),
    ]
    for test, (strain, stress) in zip(tests, curves, strict=True):
        check_curve(test, 1 + strain, stress / 1e3, atol=2e-6)
    with pytest.raises(InputError, match="several columns may be the stress"):
        tq.read(path, **options)


def test_sheets_named_after_directions_are_read_in_the_same_loading_mode(tmp_path):
    of_direction = sheet(["strain", "stress [kPa]"], ramp() - 1, 1e3 * neo_hookean(ramp()))
    tests = find_tests_in_file(workbook(tmp_path / "aorta.xlsx", Axial=of_direction, Circ=of_direction))
    assert [(test.reading.experiment.direction, test.options["mode"]) for test in tests] == [
        ("axial", "uniaxial"),
        ("circ", "uniaxial"),
    ]


@pytest.mark.parametrize("line", ["Station Name: Biaxial.cfg", "Biaxial.cfg", "Machine: Biaxial", "Frame,Biaxial"])
def test_the_name_of_a_machine_or_of_its_settings_is_no_loading_mode(tmp_path, line):
    rows = "".join(f"{cell(x - 1)},{cell(1e3 * neo_hookean(x))}\n" for x in ramp())
    (tmp_path / "test.txt").write_text(f"Test data\n{line}\n\nStrain,Stress (kPa)\n{rows}")
    (test,) = find_tests_in_file(tmp_path / "test.txt")
    assert (test.options["mode"], test.reading.mode_source) == ("uniaxial", "nothing says otherwise")


def test_tables_under_the_same_title_are_numbered(tmp_path):
    rows = [f"{x - 1:.4f}\t{1e3 * neo_hookean(x):.6f}" for x in np.linspace(1, 1.3, 20)]
    block = "\n".join(["<DATA>", "Strain\tStress (kPa)", *rows, "<END DATA>"])
    path = text_file(tmp_path / "mach.txt", f"<Mach-1 File>\n{block}\n{block}")
    assert [test.name for test in read_tests(path)] == ["<DATA> 1", "<DATA> 2"]
