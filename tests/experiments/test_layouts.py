"""Layouts of tables as machines and laboratories write them: what is no column, no test and no name of one."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from tissuq.experiments.reading.tests_in_file import find_tests_in_file, read_tests
from tissuq.experiments.units import stress_unit
from written_files import check_curve, text_file, workbook

SIZES = {"length": "20 mm", "area": "10 mm2"}
STRETCH = ramp()
MOVED, FORCE = 20 * (STRETCH - 1), 10 * neo_hookean(STRETCH)
"""Of a specimen of 20 mm with 10 mm²."""
CURVE = list(zip((STRETCH - 1).tolist(), neo_hookean(STRETCH).tolist(), strict=True))
"""Strains and stresses."""


def lines_of(*columns, separator=","):
    return [separator.join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True)]


def check(tests, names, factors=(1.0, 1.1, 1.2), stretch=STRETCH):
    """Compare tests with neo-Hookean specimens, each so many times as stiff."""
    assert [test.name for test in tests] == list(names)
    for test, factor in zip(tests, factors, strict=False):
        check_curve(test, stretch, factor * neo_hookean(test.stretch), atol=2e-6)


STATEMENTS = [["L0 (mm)", "20"], ["Width (mm)", "5"], ["Thickness (mm)", "2"], ["Fmax (N)", "0.3"]]


def test_statements_to_the_right_of_a_table_are_of_the_specimen(tmp_path):
    rows = lines_of(MOVED, FORCE)
    rows[:4] = [",".join([row, "", *statement]) for row, statement in zip(rows, STATEMENTS, strict=False)]
    path = text_file(tmp_path / "right.csv", "Displacement (mm),Force (N),,Specimen,Tendon 4", *rows)
    check(read_tests(path), ["right"])


def test_words_beside_every_row_are_columns(tmp_path):
    rows = [f"{row},,{name},7" for name in "AB" for row in lines_of(MOVED, FORCE)]
    path = text_file(tmp_path / "both.csv", "Displacement (mm),Force (N),,Specimen,Age", *rows)
    check(read_tests(path, dimensions=SIZES), "AB", (1.0, 1.0))


def test_a_few_rows_beside_many_are_no_test(tmp_path):
    strain = STRETCH - 1
    rows = lines_of(strain, 1e3 * neo_hookean(STRETCH), strain, 1e3 * neo_hookean(STRETCH))
    rows[2:] = [",".join([*row.split(",")[:2], "", ""]) for row in rows[2:]]
    path = text_file(tmp_path / "wide.csv", ",".join(["Strain [-],Stress [kPa]"] * 2), *rows)
    (test,) = find_tests_in_file(path)
    check([test.reading.experiment], ["1"])
    assert "'2' is left out: of 3 rows or fewer, and no test." in test.reading.warnings


def test_blocks_of_a_machine_are_named_by_their_numbers(tmp_path):
    lines = ["Results Table 1", ",Maximum Load", ",(N)", "1,0.5", "2,0.6", "3,0.7", ""]
    for number, factor in enumerate((1.0, 1.1, 1.2), start=1):
        rows = lines_of(np.arange(60) / 10, MOVED, factor * FORCE)
        lines += [f"{number},Time,Extension,Load", ",(s),(mm),(N)", *(f",{row}" for row in rows), ""]
    check(read_tests(text_file(tmp_path / "raw.csv", *lines), dimensions=SIZES), "123")


@pytest.mark.parametrize("name", ["Specimen {}", "Specimen: {}"])
def test_what_is_stated_above_a_table_is_of_it_and_does_not_name_it(tmp_path, name):
    lines = []
    for number, factor in ((1, 1.0), (2, 1.5)):
        lines += [name.format(f"T{number}"), f"Gauge length: {20 * factor} mm", "Width: 5 mm", "Thickness: 2 mm"]
        lines += ["Displacement (mm)\tForce (N)", *lines_of(factor * MOVED, FORCE, separator="\t")]
    names = ["Specimen T1", "Specimen T2"] if ":" not in name else ["T1", "T2"]
    check(read_tests(text_file(tmp_path / "all.txt", *lines)), names, (1.0, 1.0))


@pytest.mark.parametrize("separator", ["\t", ","])
def test_one_unknown_unit_among_known_ones_is_a_unit(tmp_path, separator):
    header = (
        separator.join(["Axial Displacement", "Axial Force", "Axial Count"]),
        separator.join(["mm", "N", "segments"]),
    )
    rows = lines_of(MOVED, FORCE, np.zeros(60), separator=separator)
    path = text_file(tmp_path / "mts.txt", *header, *rows)
    check(read_tests(path, dimensions=SIZES), ["mts"])
    table = find_tests_in_file(path, dimensions=SIZES)[0].reading.table
    assert table.units == ("mm", "N", "segments")


@pytest.mark.parametrize("end", ["<END DATA>\n", ""])
def test_of_positions_along_three_axes_the_one_that_moves_is_read(tmp_path, end):
    """As a Mach-1 writes them, between lines that say where data begin and end."""
    stretch, path = ramp(1.3), tmp_path / "move.txt"
    head = "<Mach-1 File>\n<INFO>\nDate:\t2020-02-03\n<END INFO>\n<Move Relative>\nVelocity, mm/s:\t0.1\n<DATA>\n"
    names = "\t".join(["Time, s", *(f"Position ({axis}), mm" for axis in "zxy"), "Fz, gf"])
    load = 10 * neo_hookean(stretch) / 9.80665e-3
    rows = [
        f"{k}\t{12 + 10 * (x - 1):.6f}\t0.000\t0.000\t{f:.6f}\n"
        for k, (x, f) in enumerate(zip(stretch, load, strict=True))
    ]
    path.write_text(f"{head}{names}\n{''.join(rows)}{end}")
    with pytest.warns(UserWarning, match=r"check the column: 'Position \(z\), mm' was taken for the displacement"):
        data = tq.read(path, length="10 mm", area="10 mm2")
    check_curve(data, stretch, neo_hookean(stretch), atol=2e-6)


def test_names_of_one_letter_are_not_units_of_a_statement_above(tmp_path):
    path = text_file(tmp_path / "a.csv", "Operator,JR", "N,s,strain", *lines_of(FORCE, MOVED, STRETCH - 1))
    reading = find_tests_in_file(path, columns={"force": "N"}, dimensions={"area": "10 mm2"}, force_unit="N")[0].reading
    assert reading.table.names == ("N", "s", "strain")


def test_a_table_that_begins_anew_after_a_blank_line_is_of_two_tests(tmp_path):
    rows = lines_of(MOVED, FORCE), lines_of(MOVED, 1.1 * FORCE)
    path = text_file(tmp_path / "blocks.csv", "Displacement (mm),Force (N)", *rows[0], "", *rows[1])
    tests = find_tests_in_file(path, dimensions=SIZES)
    check([test.reading.experiment for test in tests], "12")
    assert any("begins anew after a blank line" in text for text in tests[0].reading.warnings)
    with pytest.raises(InputError, match=r"several tables: 1 in lines 2 to 61, 2 in lines 63 to 122.*--table 1"):
        tq.read(path, dimensions=SIZES)


@pytest.mark.parametrize("column", ["words", "numbers"])
def test_blocks_that_a_column_names_are_parted_by_it(tmp_path, column):
    names = {"words": ("A", "B"), "numbers": ("1", "2")}[column]
    rows = [[f"{name},{row}" for row in lines_of(MOVED, FORCE)] for name in names]
    path = text_file(tmp_path / "long.csv", "Specimen,Displacement (mm),Force (N)", *rows[0], "", *rows[1])
    check(read_tests(path, dimensions=SIZES), names, (1.0, 1.0))


def test_a_blank_line_between_cycles_or_in_a_curve_parts_nothing(tmp_path):
    moved, force = np.concatenate([MOVED, MOVED[::-1]]), np.concatenate([FORCE, FORCE[::-1]])
    rows, header = lines_of(moved, force), "Displacement (mm),Force (N)"
    for name, cut in (("cycles", len(rows)), ("curve", 30)):
        path = text_file(tmp_path / f"{name}.csv", header, *rows[:cut], "", *rows[cut:], *rows)
        assert len(tq.read(path, dimensions=SIZES)) == 240
    rows = [f"{time / 10},{row}" for time, row in enumerate([*lines_of(MOVED, FORCE)] * 2)]
    path = text_file(tmp_path / "time.csv", f"Time (s),{header}", *rows[:60], "", *rows[60:])
    assert len(tq.read(path, dimensions=SIZES)) == 120


@pytest.mark.parametrize(("separator", "marks"), [(",", ",."), (";", ".,")])
def test_thousands_separators_are_told_by_numbers_with_both_marks(tmp_path, separator, marks):
    header = separator.join(["Displacement (um)", "Force (mN)"])
    rows = [
        separator.join(f'"{value:,.3f}"'.translate(str.maketrans(",.", marks)) for value in row)
        for row in zip(1e3 * MOVED, 1e3 * FORCE, strict=True)
    ]
    path = text_file(tmp_path / "thousands.csv", header, *rows)
    check(read_tests(path, dimensions=SIZES), ["thousands"])
    (test,) = find_tests_in_file(path, dimensions=SIZES)
    assert test.reading.warnings[0].startswith(f"'{marks[0]}' was taken for a thousands separator, as in")


def test_a_group_of_three_digits_is_thousands_only_where_another_number_says_so(tmp_path):
    rows = ["1,000;0,000", "1,050;0,150", "1,100;0,290"]
    assert tq.read(text_file(tmp_path / "a.csv", "stretch;stress (kPa)", *rows)).stretch.max() == pytest.approx(1.1)
    rows = ["0;0", "500;150", "1,000;290", "1,500.5;420"]
    path = text_file(tmp_path / "b.csv", "displacement (um);stress (kPa)", *rows)
    assert tq.read(path, length="10 mm").stretch.tolist() == pytest.approx([1, 1.05, 1.1, 1.15005])


def test_structures_of_matlab_are_tests_and_what_they_state_is_of_them(tmp_path):
    savemat = pytest.importorskip("scipy.io").savemat
    tests = np.zeros((1, 2), dtype=[(name, "O") for name in ("name", "disp_mm", "force_N", "L0_mm", "area_mm2")])
    tests[0, 0] = ("S1", MOVED, FORCE, 20.0, 10.0)
    tests[0, 1] = ("S2", 0.5 * MOVED[:50], 2.0 * FORCE[:50], 10.0, 20.0)
    savemat(tmp_path / "a.mat", {"tests": tests, "fs": 100.0})
    first, second = read_tests(tmp_path / "a.mat")
    check([first], ["tests S1"], (1.0,))
    check([second], ["tests S2"], (1.0,), STRETCH[:50])


def test_structures_of_newer_files_of_matlab_are_tests(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        tests = file.create_group("tests")
        fields = {"stretch": [STRETCH] * 2, "stress_kPa": [1e3 * neo_hookean(STRETCH), 1.1e3 * neo_hookean(STRETCH)]}
        fields["name"] = [np.frombuffer(name, dtype=np.uint8).astype(np.uint16) for name in (b"S1", b"S2")]
        for name, values in fields.items():
            references = tests.create_dataset(name, (1, 2), dtype=h5py.ref_dtype)
            for number, value in enumerate(values):
                stored = file.create_dataset(f"#refs#/{name}{number}", data=value[:, None])
                stored.attrs["MATLAB_class"] = np.bytes_("char" if name == "name" else "double")
                references[0, number] = stored.ref
    with (tmp_path / "a.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    check(read_tests(tmp_path / "a.mat"), ["tests S1", "tests S2"])


@pytest.mark.parametrize("is_upright", [True, False])
@pytest.mark.parametrize("has_common_stretch", [True, False])
def test_matrices_of_matlab_hold_a_test_in_each_column(tmp_path, is_upright, has_common_stretch):
    savemat = pytest.importorskip("scipy.io").savemat
    stress = np.stack([1e3 * factor * neo_hookean(STRETCH) for factor in (1.0, 1.1, 1.2)])
    stretch = STRETCH if has_common_stretch else np.stack([STRETCH] * 3)
    stress[1, 50:] = np.nan
    upright = {"stretch": stretch.T, "stress_kPa": stress.T}
    savemat(tmp_path / "a.mat", upright if is_upright else {name: value.T for name, value in upright.items()})
    tests = read_tests(tmp_path / "a.mat")
    check(tests[::2], ["test 1", "test 3"], (1.0, 1.2))
    check(tests[1:2], ["test 2"], (1.1,), STRETCH[:50])


def test_two_columns_of_matrices_of_matlab_may_be_axes_and_are_asked_about(tmp_path):
    savemat = pytest.importorskip("scipy.io").savemat
    stress = np.stack([1e3 * factor * neo_hookean(STRETCH) for factor in (1.0, 1.1)])
    savemat(tmp_path / "a.mat", {"stretch": np.stack([STRETCH] * 2).T, "stress_kPa": stress.T})
    with pytest.raises(InputError, match="is of a biaxial test"):
        read_tests(tmp_path / "a.mat")
    (test,) = read_tests(tmp_path / "a.mat", mode="biaxial")
    assert test.stress.shape == (60, 2)


FACTORS = (1.0, 1.1, 1.2)
STRESSES = [1e3 * factor * neo_hookean(STRETCH) for factor in FACTORS]


@pytest.mark.parametrize("above", ["Strain,Stress (kPa),,", "Strain,Stress (kPa)"])
@pytest.mark.parametrize("unit", ["(-)", ""])
def test_specimens_are_named_beneath_the_quantity_that_they_share(tmp_path, above, unit):
    columns = lines_of(STRETCH - 1, *STRESSES, np.mean(STRESSES, axis=0), np.std(STRESSES, axis=0))
    path = text_file(tmp_path / "a.csv", above, f"{unit},ID 12,ID 15,Left,mean,SD", *columns)
    tests = read_tests(path)
    check(tests, ["ID 12", "ID 15", "Left"])
    assert not any(test.standard_error.any() for test in tests)


@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("Strain,S1 (kPa),S2 (kPa),S3 (kPa),Mean (kPa),SD (kPa)", ["s1", "s2", "s3"]),
        ("Strain,Stress 1 (kPa),Stress 2 (kPa),Stress 3 (kPa),Average stress (kPa),Std Dev (kPa)", "123"),
    ],
)
def test_means_and_spreads_beside_specimens_are_none(tmp_path, header, names):
    mean, sd = np.mean(STRESSES, axis=0), np.std(STRESSES, axis=0)
    path = text_file(tmp_path / "a.csv", header, *lines_of(STRETCH - 1, *STRESSES, mean, sd))
    tests = read_tests(path, mode="uniaxial")
    check(tests, names)
    assert not any(test.standard_error.any() for test in tests)


def test_numbered_stresses_beside_their_mean_are_no_axes(tmp_path):
    header = "Strain,Stress 1 (kPa),Stress 2 (kPa)"
    rows = lines_of(STRETCH - 1, *STRESSES[:2], np.mean(STRESSES[:2], axis=0))
    check(read_tests(text_file(tmp_path / "a.csv", f"{header},Average stress (kPa)", *rows)), "12")
    with pytest.raises(InputError, match="is of a biaxial test"):
        read_tests(text_file(tmp_path / "b.csv", f"{header},Temperature (K)", *rows))


def test_principal_stresses_and_components_are_no_specimens(tmp_path):
    for names in ("S1 (kPa),S2 (kPa),T", "S11 (kPa),S22 (kPa),S33 (kPa)"):
        path = text_file(tmp_path / "a.csv", f"Strain,{names}", *lines_of(STRETCH - 1, *STRESSES))
        with pytest.raises(InputError, match=r"no column is recognised as stress|is of a biaxial test"):
            read_tests(path)


def test_means_of_groups_are_tests_each_with_its_spread(tmp_path):
    header = "Strain,Control mean (kPa),Control SD (kPa),Treated mean (kPa),Treated SD (kPa)"
    spreads = [0.1 * STRESSES[0] + 0.01, 0.3 * STRESSES[1] + 0.01]
    columns = STRETCH - 1, STRESSES[0], spreads[0], STRESSES[1], spreads[1]
    path = text_file(tmp_path / "a.csv", header, *lines_of(*columns))
    tests = read_tests(path, mean_of=10_000)
    check(tests, ["control", "treated"])
    for test, spread in zip(tests, spreads, strict=True):
        np.testing.assert_allclose(test.standard_error, 1e-3 * spread / 100, rtol=1e-3)


def test_japanese_of_windows_is_read_and_latin_letters_are_none(tmp_path):
    rows = lines_of(STRETCH - 1, STRESSES[0])
    for name, encoding in (
        ("ひずみ", "cp932"),
        ("Dehnung der Länge – Prüfkörper Ä’s", "cp1252"),
        ("élongation à", "cp1252"),
    ):
        content = "\n".join([f"{name},応力 (kPa)" if encoding == "cp932" else f"{name},Stress (kPa)", *rows])
        (tmp_path / "a.csv").write_bytes(content.encode(encoding))
        table = find_tests_in_file(tmp_path / "a.csv", columns={"strain": 1, "stress": 2})[0].reading.table
        assert table.names[0] == name


@pytest.mark.parametrize("above", ["", ",,Results,", ",,Results"])
@pytest.mark.parametrize("results", [["Modulus (kPa),120", "Peak,3.2"], ["", "Modulus,120,kPa", "Peak,3.2,kPa"]])
def test_results_typed_beside_the_rows_are_no_cells_of_them(tmp_path, above, results):
    stretch = np.linspace(1, 1.3, 31)
    stress = 50 * (stretch - stretch**-2)
    rows = [f"{x:.8g},{y:.8g}" for x, y in zip(stretch, stress, strict=True)]
    beside = [f"{row},,{text}" for row, text in zip(rows, results, strict=False)] + rows[len(results) :]
    path = text_file(tmp_path / "test.csv", f"Stretch,Stress (kPa){above}", *beside)
    data = tq.read(path)
    check_curve(data, stretch, stress / 1000, rtol=1e-7)


def test_a_sheet_of_statistics_is_left_out_beside_a_long_test(tmp_path):
    rows = [["Stretch", "Stress (kPa)"], *([1 + k / 200, float(k)] for k in range(60))]
    head = [["Serie", "Fm", "dL bei Fm"], ["n = 2", "N", "mm"]]
    statistics = [*head, ["x", 3.1, 2.2], ["s", 0.4, 0.3], ["v", 12.9, 13.6]]
    path = workbook(tmp_path / "series.xlsx", **{"Probe 1": rows, "Statistik": statistics})
    with pytest.warns(UserWarning, match="sheet 'Statistik' is no test: it is short"):
        (test,) = tq.read_tests(path)
    assert len(test) == 60


def test_a_load_along_one_of_two_axes_is_read_alone_as_the_message_says(tmp_path):
    columns = lines_of(STRETCH, np.ones(len(STRETCH)) + 0.1 * (STRETCH - 1), STRESSES[0])
    path = text_file(tmp_path / "a.csv", "stretch x,stretch y,stress x (kPa)", *columns)
    with pytest.raises(InputError, match=r"a load along axis x alone: read that one, axis='x' \(--axis x\)"):
        read_tests(path)
    (test,) = read_tests(path, axis="x", mode="planar")
    assert (test.mode.name, test.size) == ("planar", len(STRETCH))


@pytest.mark.parametrize("separator", [";", "\t", ","])
@pytest.mark.parametrize("unit", ["kPa", "kPa ", "MPa", "N/mm2"])
def test_a_unit_in_every_cell_of_a_column_is_its_unit(tmp_path, separator, unit):
    rows = [f"{100 * x!r} %{separator}{y!r} {unit}" for x, y in CURVE]
    path = text_file(tmp_path / "test.csv", "made today", f"strain{separator}stress", *rows)
    with pytest.warns(
        UserWarning, match="'stress': the cells are numbers with their unit, and were read as numbers in"
    ):
        data = tq.read(path)
    check_curve(data, [1 + x for x, _ in CURVE], [y * stress_unit(unit).to_mpa for _, y in CURVE], rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "cells"),
    [
        ("stress", ["0 kPa", "1 kPa", "2 MPa"]),
        ("stress (MPa)", ["0 kPa", "1 kPa", "2 kPa"]),
        ("stress", ["0 kPa", "1 kPa", "2"]),
    ],
)
def test_cells_of_several_units_or_another_one_than_the_heading_are_asked_about(tmp_path, name, cells):
    path = text_file(tmp_path / "test.csv", f"stretch;{name}", *(f"1.{k};{cell}" for k, cell in enumerate(cells)))
    with pytest.raises(tq.InputError, match=r"line 2, column 'stress.*': '0 kPa' is a number with its unit"):
        tq.read(path)


def test_names_of_tests_that_are_loads_with_their_unit_stay_names(tmp_path):
    rows = [f"{1 + x:.6f},{factor * y:.6f},{load}" for load, factor in (("5 N", 1.0), ("10 N", 1.1)) for x, y in CURVE]
    tests = read_tests(text_file(tmp_path / "loads.csv", "stretch,stress (MPa),Load", *rows))
    assert [test.name for test in tests] == ["5 N", "10 N"]


def test_sizes_with_units_in_a_sheet_of_their_own_make_no_table(tmp_path):
    path = text_file(tmp_path / "sizes.csv", "Width;Length", *["5 mm;20 mm"] * 8)
    with pytest.raises(tq.InputError, match="holds no rows of numbers"):
        tq.read(path)


def test_curves_of_a_picture_are_asked_about_once(tmp_path):
    rows = [f"{1 + x:.6f},{y:.6f},{1 + 2 * x:.6f},{y:.6f}" for x, y in CURVE]
    path = text_file(tmp_path / "picture.csv", "Control,,Treated,", "X,Y,X,Y", *rows)
    with pytest.raises(tq.InputError, match="--column stretch=X --column stress=Y --stress-unit kPa"):
        read_tests(path)
    tests = read_tests(path, stretch="X", stress="Y", unit="kPa")
    assert [test.name for test in tests] == ["Control", "Treated"]
    np.testing.assert_allclose(tests[1].stretch, [1 + 2 * x for x, _ in CURVE], rtol=1e-6)
    with pytest.raises(tq.InputError, match="--column shear=X --column stress=Y --stress-unit kPa"):
        read_tests(path, mode="simple-shear")
