import sys
from pathlib import Path

import numpy as np
import pytest

from marks import slow_but
from tissuq.errors import InputError, ModelError
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.read import read_experiment
from written_files import check_curve, message, text_file

pytestmark = pytest.mark.filterwarnings("ignore:check the unit:UserWarning")  # many headings here state no unit

LAB_FILES = Path(__file__).parent / "lab_files"
BAD_FILES = Path(__file__).parent / "bad_files"

GOOD = {
    "plain.csv": ({}, [1.0, 1.1, 1.2], [0.0, 0.5, 1.25]),
    "zwick_semicolon_decimal_comma_latin1.csv": ({}, [1.0, 1.05, 1.1], [0.0, 0.125, 0.25]),
    "instron_metadata_block.csv": ({}, [1.0, 1.1, 1.2], [0.0, 4.5e-3, 12.5e-3]),
    "tabs_units_row.tsv": ({}, [1.0, 1.1, 1.2], [0.0, 2e-3, 5e-3]),
    "blanks.txt": ({}, [1.0, 1.5, 2.0], [0.0, 1.5, 2.5]),
    "cauchy.csv": ({"stress_type": "cauchy"}, [1.0, 1.25, 2.0], [0.0, 4e-3, 15e-3]),
    "true_stress.csv": ({}, [1.0, 1.1], [0.0, 0.5e-3 / 1.1]),
    "strain_percent.csv": ({}, [0.9, 1.0, 1.1], [-2e-3, 0.0, 1.5e-3]),
    "unsorted_repeated.csv": ({}, [1.2, 1.0, 1.1, 1.1, 1.0], [3e-3, 0.0, 1.5e-3, 1.25e-3, 0.125e-3]),
    "compression_positive.csv": ({"compression_positive": True}, [1.0, 0.9, 0.8], [0.0, -2e-3, -5e-3]),
    "no_header.csv": ({"columns": {"stretch": 1, "stress": 2}}, [1.0, 1.1, 1.2], [0.0, 0.5, 1.25]),
    "numpy_savetxt.txt": ({}, [1.0, 1.1], [0.0, 0.5]),
    "utf16_excel.txt": ({}, [1.0, 1.1], [0.0, 4.5e-3]),
    "utf8_bom.csv": ({}, [1.0, 1.1], [0.0, 4.5e-3]),
    "quoted_decimal_commas.csv": ({}, [1.0, 1.1], [0.0, 0.5]),
    "noise_near_one.csv": (
        {},
        [0.999, 0.9995, 1.0, 1.0005, 1.1, 1.2],
        [0.02e-3, 0.01e-3, -0.01e-3, -0.02e-3, 2e-3, 5e-3],
    ),
    "text_column.csv": ({}, [1.0, 1.1], [0.0, 4.5e-3]),
    "minus_sign.csv": ({}, [0.9, 1.0, 1.1], [-1.5, 0.0, 1.2]),
}

BAD = {
    "empty.csv": ["empty.csv is empty"],
    "only_comments.csv": ["holds only comments and blank lines"],
    "only_header.csv": ["holds no rows of numbers", "(1) reads 'stretch,stress_kPa'"],
    "binary.csv": ["is a binary file, not text", "CSV"],
    "workbook.csv": ["Excel workbook", "CSV"],
    "one_line.csv": ["not a table in text form"],
    "unknown_columns.csv": [
        "no column is recognised as stretch, strain, displacement or length",
        "'elongation', 'load'",
        "--column stretch=NAME (or strain=, displacement=, length=)",
    ],
    "no_header.csv": ["2 columns have no names", 'columns={"stretch": 1, "stress": 2}'],
    "stretch_and_strain.csv": ["'stretch' (number 1) and 'strain' (number 2)", 'columns={"stretch": "NAME"}'],
    "two_stresses.csv": ["'stress_kPa' (number 2) and 'nominal stress [kPa]' (number 3)"],
    "log_strain.csv": ["'stress' does not say which type of stress it is", "--stress-type"],
    "text_in_number_column.csv": ["line 3, column 'stress': 'n/a' is not a number"],
    "text_in_first_row.csv": ["line 2, column 'stretch': '--' is not a number"],
    "footer.csv": ["line 4, column 'stretch': 'End of test' is not a number"],
    "nan.csv": ["line 5, column 'stress': 'nan' is not a finite number"],
    "infinite.csv": ["line 3, column 'stress': 'inf' is not a finite number"],
    "empty_cell.csv": ["line 3, column 'stress': the cell is empty"],
    "short_row.csv": ["line 3, column 'stress': the cell is empty"],
    "long_row.csv": ["line 3 has 3 cells, but line 1 with the column names has 2", "decimal commas"],
    "negative_stretch.csv": ["line 3, column 'stretch': stretch -1.1 is not positive"],
    "strain_named_stretch.csv": ["line 2, column 'stretch': stretch 0 is not", "--column strain=stretch"],
    "strain_without_zero_named_stretch.csv": ["look like strain, not stretch", "--column strain=stretch"],
    "stretch_named_strain.csv": [
        "line 2, column 'strain'",
        "looks like a stretch",
        "--column stretch=strain",
    ],
    "percent_without_unit.csv": ["line 4, column 'strain': strain 20 without a unit", "--strain-unit %"],
    "strain_below_minus_one.csv": ["line 2, column 'strain'", "larger than -1"],
    "compression_positive.csv": [
        "line 4, column 'stress_kPa'",
        "at stretch 0.8 (compression) the stress is positive",
        "compression_positive=True (--compression-positive)",
    ],
    "tension_negative.csv": ["line 4, column 'stress_kPa'", "(tension) the stress is negative"],
    "unknown_unit.csv": ["column 'stress [furlong]'", "not a unit of stress", "--stress-unit"],
    "force.csv": ["column 'stress [N]': 'N' is a force", "undeformed cross-section"],
    "mass_over_area.csv": ["'kg/cm2' is a mass over an area", "kgf/cm2"],
    "two_units.csv": ["the name says 'kPa'", "says 'MPa'"],
    "mixed_decimals.csv": ["points and decimal commas are mixed", "'0.0' in line 2", "'1,0' in line 2"],
    "thousands.csv": ["line 3, column 'stress': '1,234.5' seems to have a thousands separator"],
    "comma_is_separator_and_decimal.csv": [
        "line 2 has 4 cells",
        "separate the columns by semicolons or tabs",
    ],
    "commas_without_header.csv": ["may be decimal commas or separators (line 1: 1,05)"],
    "pause_after_first_row.csv": ["2 columns have no names"],
    "short_first_row.txt": ["line 2, column 'stress': the cell is empty"],
    "open_quotation_mark.csv": ["line 3: a quotation mark has no partner"],
}


@pytest.fixture
def written(tmp_path):
    def write(text, name="test.csv"):
        return text_file(tmp_path / name, text)

    return write


@pytest.mark.parametrize("name", sorted(GOOD))
def test_a_laboratory_file_is_read(name):
    options, stretch, stress = GOOD[name]
    data = read_experiment(LAB_FILES / name, **options)
    check_curve(data, stretch, stress, rtol=1e-15)


@pytest.mark.parametrize("name", sorted(BAD))
def test_a_bad_file_is_refused_with_place_finding_and_advice(name):
    text = message(BAD_FILES / name)
    assert name in text
    for words in BAD[name]:
        assert words in text


def test_every_file_beside_this_test_is_tested():
    assert {file.name for file in LAB_FILES.iterdir()} == set(GOOD)
    assert {file.name for file in BAD_FILES.iterdir()} == set(BAD)


def test_the_source_tells_file_columns_units_conversions_and_rows():
    data = read_experiment(LAB_FILES / "strain_percent.csv")
    assert data.source == (
        "strain_percent.csv: stretch = 1 + column 'Strain (%)' x 0.01; "
        "engineering stress from column 'Stress (kPa)' in kPa (from the file); 3 rows (lines 2 to 4)"
    )
    assert (data.name, data.stress_unit, data.mode.name) == ("strain_percent", "kPa", "uniaxial")


def test_the_source_tells_that_mpa_was_assumed():
    data = read_experiment(LAB_FILES / "plain.csv")
    assert "MPa (assumed: the file states no unit)" in data.source
    assert data.stress_unit == "MPa"


def test_the_source_tells_that_cauchy_stress_was_divided_by_stretch():
    data = read_experiment(LAB_FILES / "cauchy.csv", stress_type="cauchy")
    assert "cauchy stress from column 'Cauchy stress [kPa]'" in data.source
    assert "divided by stretch" in data.source


def test_the_source_tells_that_the_sign_was_changed():
    data = read_experiment(LAB_FILES / "compression_positive.csv", compression_positive=True)
    assert "sign of stress changed: compression is positive" in data.source


def test_mode_and_name_are_those_given():
    data = read_experiment(LAB_FILES / "plain.csv", mode="planar", name="sheet 3")
    assert (data.mode.name, data.name) == ("planar", "sheet 3")


@pytest.mark.parametrize(
    "heading",
    [
        "stress_kPa",
        "Stress [kPa]",
        "Stress (kPa)",
        "stress/kPa",
        "Stress / kPa",
        "STRESS kPa",
        "Stress in kPa",
        "Engineering stress [kPa]",
        "nominal_stress_kPa",
        "engineering-stress (kPa)",
    ],
)
def test_the_heading_of_the_stress_gives_its_unit(written, heading):
    data = read_experiment(written(f"stretch,{heading}\n1.0,0\n1.1,2\n"))
    assert data.stress.tolist() == [0.0, 0.002]
    assert data.stress_unit == "kPa"


@pytest.mark.parametrize("heading", ["stretch", "Stretch [-]", "stretch_ratio", "lambda", "λ", "Λ", "Stretch (mm/mm)"])
def test_the_stretch_is_recognised_by_its_name(written, heading):
    assert read_experiment(written(f"stress,{heading}\n0,1.0\n2,1.5\n")).stretch.tolist() == [1.0, 1.5]


@pytest.mark.parametrize("heading", ["strain", "Engineering strain", "nominal_strain [mm/mm]", "Strain (1)"])
def test_the_strain_is_recognised_by_its_name_and_one_is_added(written, heading):
    assert read_experiment(written(f"stress,{heading}\n0,0.0\n2,0.5\n")).stretch.tolist() == [1.0, 1.5]


def test_a_strain_rate_is_not_taken_for_the_strain(written):
    data = read_experiment(written("strain_rate,strain,stress\n0.01,0.0,0\n0.01,0.5,2\n"))
    assert data.stretch.tolist() == [1.0, 1.5]


@pytest.mark.parametrize("wanted", ["Load / area", "load / area", "2", 2])
def test_a_column_is_given_by_name_in_any_capitals_or_by_number(written, wanted):
    path = written("Lambda,Load / area\n1.0,0\n1.1,2\n")
    data = read_experiment(path, columns={"stress": wanted}, stress_unit="kPa")
    assert data.stress.tolist() == [0.0, 0.002]


def test_an_exact_name_goes_before_one_in_other_capitals(written):
    path = written("stretch,S,s\n1.0,0,0\n1.1,2,3\n")
    assert read_experiment(path, columns={"stress": "s"}).stress.tolist() == [0.0, 3.0]


def test_a_column_is_given_by_its_name_without_the_unit(written):
    data = read_experiment(written("x [%],P [kPa]\n0,0\n10,2\n"), columns={"strain": "x", "stress": "P"})
    assert data.stretch.tolist() == [1.0, 1.1]
    assert data.stress.tolist() == [0.0, 0.002]


def test_a_column_named_strain_may_hold_stretches(written):
    data = read_experiment(written("Strain,Stress\n1.0,0\n1.1,2\n"), columns={"stretch": "Strain"})
    assert data.stretch.tolist() == [1.0, 1.1]


def test_a_strain_given_as_stretch_is_answered_with_how_to_say_it(written):
    text = message(written("Strain,Stress\n0.0,0\n0.1,2\n"), columns={"stretch": "Strain"})
    assert 'columns={"strain": "Strain"} or --column strain=Strain' in text


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"stress": "Stess"}, "no column 'Stess' (asked for as stress). Did you mean 'Stress'?"),
        ({"stress": "force"}, "The columns are: 'Strain', 'Stress', 'Stress'"),
        ({"stress": "Stress"}, "'Stress' (number 2) and 'Stress' (number 3)"),
        ({"stress": 4}, "no column '4'"),
        ({"stress": 0}, "no column '0'"),
        ({"strain": 1, "stretch": 1}, "both stretch and strain"),
        ({"strain": 2, "stress": 2}, "cannot be both strain and stress"),
        ({"energy": "Stress"}, "cannot be given as 'energy'"),
        ({"force": 2, "stress": 3}, "both stress and force"),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused(written, columns, words):
    assert words in message(written("Strain,Stress,Stress\n0.0,0,0\n0.1,2,2\n"), columns=columns)


def test_a_column_named_true_stress_is_refused_as_engineering_stress(written):
    path = written("stretch,True stress\n1.0,0\n1.1,2\n")
    text = message(path, columns={"stress": "True stress"}, stress_type="engineering")
    assert "named a stress of type 'cauchy' but read as 'engineering'" in text


def test_a_column_named_nominal_stress_is_refused_as_cauchy_stress(written):
    path = written("stretch,nominal stress\n1.0,0\n1.1,2\n")
    text = message(path, columns={"stress": 2}, stress_type="cauchy")
    assert "named a stress of type 'engineering' but read as 'cauchy'" in text


def test_a_given_stress_unit_may_repeat_that_of_the_file_in_another_spelling(written):
    data = read_experiment(written("stretch,stress [N/mm2]\n1.0,0\n1.1,2\n"), stress_unit="MPa")
    assert data.stress.tolist() == [0.0, 2.0]


def test_a_given_stress_unit_goes_before_words_that_are_no_unit(written):
    data = read_experiment(written("stretch,stress (mean)\n1.0,0\n1.1,2\n"), stress_unit="kPa")
    assert data.stress.tolist() == [0.0, 0.002]


def test_words_after_the_name_of_a_stretch_are_no_unit(written):
    assert read_experiment(written("stretch (ratio),stress\n1.0,0\n1.1,2\n")).stretch.tolist() == [1.0, 1.1]


def test_a_length_is_refused_as_strain_unless_its_unit_is_given(written):
    path = written("strain [mm],stress\n0,0\n0.5,2\n")
    assert "column 'strain [mm]': 'mm' is not a unit of strain" in message(path)
    assert read_experiment(path, strain_unit="1").stretch.tolist() == [1.0, 1.5]


def test_a_heading_with_millipascal_is_asked_about(written):
    path = written("stretch,stress_mPa\n1.0,0\n1.1,2\n")
    assert "column 'stress_mPa': 'mPa' is the millipascal" in message(path)
    assert read_experiment(path, stress_unit="MPa").stress.tolist() == [0.0, 2.0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"stress_unit": "MPa"}, "stress_unit='MPa' is given, but the file says 'kPa'"),
        ({"strain_unit": "1"}, "strain_unit='1' is given, but the file says '%'"),
        ({"stress_unit": "N"}, "'N' is a force"),
        ({"strain_unit": "mm"}, "'mm' is not a unit of strain"),
        (
            {"columns": {"stretch": "Strain"}, "strain_unit": "%"},
            "is read as stretch, but strain_unit='%' is given",
        ),
        (
            {"stress_type": "Kirchhoff"},
            "stress_type must be one of engineering, cauchy, second-piola-kirchhoff, torsion, not 'Kirchhoff'",
        ),
        ({"skip_rows": -1}, "skip_rows must be a number of lines"),
        ({"skip_rows": 99}, "holds only comments and blank lines"),
    ],
)
def test_options_that_contradict_the_file_or_each_other_are_refused(options, words):
    assert words in message(LAB_FILES / "strain_percent.csv", **options)


def test_a_strain_unit_is_given_when_the_file_has_none(written):
    data = read_experiment(written("strain,stress\n0,0\n50,2\n"), strain_unit="%")
    assert data.stretch.tolist() == [1.0, 1.5]


def test_large_strains_without_unit_are_read_when_said_to_be_plain(written):
    data = read_experiment(written("strain,stress\n0,0\n11,2\n"), strain_unit="1")
    assert data.stretch.tolist() == [1.0, 12.0]


def test_an_unknown_mode_is_refused_before_the_file_is_read():
    with pytest.raises(ModelError, match="no loading mode named 'shear'"):
        read_experiment("no such file", mode="shear")


def test_skipped_rows_are_not_looked_at_but_counted(written):
    path = written("stretch,stress\n1,2\n3,4\nstretch,stress\n1.0,0.0\n1.1,oops\n1.2,1\n")
    assert "line 6, column 'stress': 'oops'" in message(path, skip_rows=3)


def test_no_row_is_dropped_when_text_interrupts_the_table():
    text = message(BAD_FILES / "pause_after_first_row.csv", columns={"stretch": 1, "stress": 2})
    assert "line 2, column number 1: 'PAUSE' is not a number" in text


def test_a_missing_file_is_answered_with_the_one_that_is_there(written):
    path = written("stretch,stress\n1.0,0.0\n", name="cortex.csv")
    text = message(path.with_name("cortx.csv"))
    assert "there is no such file" in text
    assert "cortex.csv'?" in text


def test_a_missing_folder_is_reported():
    assert "there is no such file" in message("no/such/folder/test.csv")


def test_a_folder_is_refused(tmp_path):
    assert "is a folder" in message(tmp_path)


@pytest.mark.parametrize(
    ("error", "words"), [(PermissionError(), "no permission"), (OSError("disk on fire"), "disk on fire")]
)
def test_a_file_that_cannot_be_opened_is_reported(written, monkeypatch, error, words):
    def refuse(self):
        raise error

    path = written("stretch,stress\n1.0,0.0\n")
    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert words in message(path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n"])
def test_lines_may_end_in_any_way(tmp_path, end):
    path = tmp_path / "test.csv"
    path.write_bytes(end.join(["stretch,stress", "1.0,0.0", "", "1.1,x", "1.2,1"]).encode())
    assert "line 4, column 'stress': 'x'" in message(path)


def test_a_return_at_the_end_of_a_cell_ends_no_line(tmp_path):
    path = tmp_path / "test.csv"
    path.write_bytes(b"stretch,stress\n1.0\r,0.0\n1.1\r,x\n1.2\r,1\n")
    assert "line 3, column 'stress': 'x'" in message(path)
    path.write_bytes(b"stretch,stress\n1.0\r,0.0\n1.1\r,0.5\n1.2\r,1\n")
    assert read_experiment(path).stress.tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1"])
def test_files_may_be_in_any_usual_encoding(tmp_path, encoding):
    path = tmp_path / "test.csv"
    path.write_bytes("stretch,stress [N/mm²]\n1.0,0.0\n1.1,2.0\n".encode(encoding))
    assert read_experiment(path).stress_unit == "N/mm²"


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "   "])
def test_cells_may_be_separated_in_any_usual_way(written, separator):
    path = written("\n".join(separator.join(row) for row in [("stretch", "stress"), ("1.0", "0"), ("1.1", "2")]))
    assert read_experiment(path).stretch.tolist() == [1.0, 1.1]


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_decimal_commas_are_understood_with_every_separator_but_the_comma(written, separator):
    path = written("\n".join(separator.join(row) for row in [("stretch", "stress"), ("1,0", "0"), ("1,1", "2,5e-1")]))
    data = read_experiment(path)
    assert data.stretch.tolist() == [1.0, 1.1]
    assert data.stress.tolist() == [0.0, 0.25]


def test_a_trailing_separator_adds_no_column(written):
    assert read_experiment(written("stretch,stress,\n1.0,0.0,\n1.1,0.5,\n")).stress.tolist() == [0.0, 0.5]


def test_a_single_row_is_an_experiment(written):
    assert len(read_experiment(written("stretch,stress\n1.1,0.5\n"))) == 1


def test_a_preload_before_tension_does_not_trip_the_check_of_signs(written):
    data = read_experiment(written("stretch,stress\n0.99,0.02\n1.0,0.03\n1.1,0.5\n1.2,1.0\n"))
    assert data.stress.tolist() == [0.02, 0.03, 0.5, 1.0]


def test_hysteresis_in_tension_does_not_trip_the_check_of_signs(written):
    data = read_experiment(written("stretch,stress\n1.0,0\n1.2,1.0\n1.1,0.1\n1.05,-0.15\n"))
    assert data.stress[-1] == -0.15


def test_the_sign_is_asked_for_in_compression_even_when_tension_is_right(written):
    text = message(written("stretch,stress\n0.8,1.5\n0.9,0.5\n1.0,0\n1.1,0.4\n1.2,0.8\n"))
    assert "line 2, column 'stress': at stretch 0.8 (compression)" in text


def test_numbers_are_read_to_the_last_digit(written):
    path = written("stretch,stress\n1.0,0.1\n1.2345678901234567,0.30000000000000004\n")
    data = read_experiment(path)
    assert data.stretch[1] == 1.2345678901234567
    assert data.stress[1] == 0.30000000000000004


@pytest.mark.parametrize("copies", slow_but([5], [5, 40]))
def test_a_damaged_file_is_read_or_refused_but_never_breaks_the_program(tmp_path, copies):
    random = np.random.default_rng(7)
    path = tmp_path / "test.csv"
    for name in sorted(GOOD):
        whole = (LAB_FILES / name).read_bytes()
        for _ in range(copies):
            damaged = bytearray(whole)
            for position in random.integers(0, len(damaged), size=random.integers(1, 5)):
                damaged[position] = random.choice(list(b'0,;."\t\n -#e[\x00\xff'))
            path.write_bytes(damaged[: random.integers(1, len(damaged) + 1)])
            try:
                read_experiment(path, **GOOD[name][0])
            except InputError as error:
                assert "test.csv" in str(error)  # noqa: PT017


@pytest.mark.slow
def test_many_rows_are_read_at_once_and_not_one_by_one(tmp_path):
    """Ninety thousand further rows cost fewer than two calls of Python functions each: seconds for a million."""
    rows = "".join(f"{1 + i * 1e-6:.6f};{i * 1e-6:.6f}\n".replace(".", ",") for i in range(1000))
    calls = []
    for thousands in (10, 100):
        path = text_file(tmp_path / f"{thousands}.csv", "stretch;stress\n" + rows * thousands)
        count = 0

        def counted(frame, event, argument):
            nonlocal count
            count += event == "call"

        before = sys.getprofile()
        sys.setprofile(counted)
        try:
            reading = read_file(path)  # what is strange about it is looked for in every cycle, whatever its rows
        finally:
            sys.setprofile(before)
        assert len(reading.experiment) == 1000 * thousands
        calls.append(count)
    assert calls[1] - calls[0] < 2 * 90_000


def shear_file(folder, header="gamma,shear stress [kPa]", rows=((-0.1, -1.5), (0.0, 0.0), (0.2, 3.0))):
    (folder / "shear.csv").write_text("\n".join([header, *(f"{a},{b}" for a, b in rows)]) + "\n", encoding="utf-8")
    return folder / "shear.csv"


@pytest.mark.parametrize("header", ["gamma,shear stress [kPa]", "amount of shear,stress_kPa", "Shear [-],Stress [kPa]"])
@pytest.mark.parametrize("stress_type", ["engineering", "cauchy"])
def test_an_amount_of_shear_and_its_stress_are_read(tmp_path, header, stress_type):
    data = read_experiment(shear_file(tmp_path, header), mode="simple-shear", stress_type=stress_type)
    check_curve(data, [-0.1, 0.0, 0.2], [-1.5e-3, 0.0, 3e-3])


def test_a_column_is_given_as_shear_by_name(tmp_path):
    data = read_experiment(shear_file(tmp_path, "k,stress"), mode="simple-shear", columns={"shear": "k"})
    assert data.stretch.tolist() == [-0.1, 0.0, 0.2]


@pytest.mark.parametrize("header", ["stretch,stress [kPa]", "lambda [-],shear stress [kPa]"])
def test_an_amount_of_shear_under_the_name_of_a_stretch_is_read_and_told(tmp_path, header):
    file = shear_file(tmp_path, header, [(0.0, 0.0), (0.1, 1.5), (0.5, 7.5), (1.2, 18.0)])
    with pytest.warns(UserWarning, match=r"check the column: .* was taken for the amount of shear") as told:
        data = read_experiment(file, mode="simple-shear")
    assert data.stretch.tolist() == [0.0, 0.1, 0.5, 1.2]
    name = header.split(",")[0]
    assert f'shear="{name}"' in str(told[0].message)
    said = read_experiment(file, mode="simple-shear", columns={"shear": name})
    assert said.stretch.tolist() == data.stretch.tolist()


@pytest.mark.filterwarnings("error")
def test_negative_amounts_of_shear_are_no_stretches_and_read_without_a_doubt(tmp_path):
    file = shear_file(tmp_path, "stretch,stress [kPa]", [(-0.1, -1.5), (0.1, 1.5), (0.5, 7.5), (1.2, 18.0)])
    assert read_experiment(file, mode="simple-shear").stretch.tolist() == [-0.1, 0.1, 0.5, 1.2]


def test_a_true_stretch_is_not_taken_for_an_amount_of_shear(tmp_path):
    file = shear_file(tmp_path, "stretch,stress [kPa]", [(1.0, 0.0), (1.1, 1.5), (1.5, 7.5)])
    with pytest.raises(InputError, match=r"1 to 1.5.*--column shear=\"stretch\".*--mode uniaxial"):
        read_experiment(file, mode="simple-shear")
    with pytest.raises(InputError, match="give it so: --column shear=NAME"):
        read_experiment(file, mode="simple-shear", columns={"stretch": "stretch"})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mode": "uniaxial"}, "no column is recognised as stretch, strain"),
        ({"mode": "uniaxial", "columns": {"shear": "gamma"}}, "given as shear, but this loading mode has a stretch"),
        ({"mode": "simple-shear", "columns": {"strain": "gamma"}}, "given as strain, but .* has an amount of shear"),
        ({"mode": "simple-shear", "compression_positive": True}, "no meaning for a shear stress"),
        ({"mode": "biaxial"}, "'biaxial' has .* axis 2, and the file's columns do not tell both"),
    ],
)
def test_what_does_not_go_with_a_mode_is_refused(tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        read_experiment(shear_file(tmp_path), **options)


def test_a_shear_stress_against_the_shear_is_refused(tmp_path):
    file = shear_file(tmp_path, rows=((-0.1, 1.5), (0.0, 0.0), (0.2, -3.0)))
    with pytest.raises(InputError, match=r"at an amount of shear of 0\.2 the shear stress is -3 kPa"):
        read_experiment(file, mode="simple-shear")


@pytest.mark.parametrize(
    ("error", "separator", "row"),
    [
        ("#REF!", ",", 0),
        ("#DIV/0!", ";", 3),
        ("#N/A", "\t", 5),
        ("#WERT!", ";", 0),
        ("#BEZUG!", ",", 3),
        ("#NV", "\t", 1),
    ],
)
def test_a_row_that_begins_with_an_error_of_a_spreadsheet_is_no_comment(written, error, separator, row):
    rows = [[f"1.{k}", f"0.{k}"] for k in range(6)]
    rows[row][0] = error
    text = "\n".join(separator.join(cells) for cells in [["stretch", "stress [kPa]"], *rows])
    said = message(written(text + "\n"))
    assert f"line {row + 2}, column 'stretch'" in said
    assert f"'{error}' is not a number" in said


def test_a_hash_before_other_words_begins_a_comment(written):
    path = written("# N/A stands for nothing\nstretch,stress [kPa]\n#REFERENCE\n1.1,0.1\n#1.2,0.2\n1.3,0.3\n1.4,0.4\n")
    np.testing.assert_allclose(read_experiment(path).stretch, [1.1, 1.3, 1.4])
