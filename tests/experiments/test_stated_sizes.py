"""Sizes of specimens that files state: where they stand, what they are called, and where nothing may be guessed."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import tissuq as tq
from tissuq import InputError
from tissuq.experiments.reading.tests_in_file import find_tests_in_file
from written_files import check_curve, message, text_file, workbook

LENGTH, THICKNESS = 20.0, 2.0
WIDTHS = {"A 1": 5.0, "A 2": 4.0}
STRETCH = np.linspace(1, 1.3, 31)
STRESS = 0.04 * (STRETCH - STRETCH**-2)
TABLE = "Displacement (mm);Force (N)\n"


def forces(width):
    return STRESS * width * THICKNESS


def rows(*columns, separator=";"):
    return "".join(separator.join(f"{cell:.8g}" for cell in row) + "\n" for row in zip(*columns, strict=True))


MEASURED = rows(LENGTH * (STRETCH - 1), forces(5))


def written(folder, text, name="test.csv"):
    return text_file(folder / name, text)


def columns_of_sizes(folder, sizes="{:g};{:g};{:g};"):
    text = "Specimen;L0_mm;Width_mm;Thickness (mm);Displacement_mm;Force_N\n"
    for name, width in WIDTHS.items():
        of_specimen = rows(LENGTH * (STRETCH - 1), forces(width)).splitlines()
        beside = [sizes.format(LENGTH, width, THICKNESS)] + [sizes.format(LENGTH, width, THICKNESS)] * 30
        text += "".join(f"{name};{left}{row}\n" for left, row in zip(beside, of_specimen, strict=True))
    return written(folder, text)


def table_above(folder, units="\n;mm;mm;mm"):
    head = f"Size;Thickness;Width;Gauge_Length{units}\nA 1;2.0;5.0;20.0\nA 2;2.0;4.0;20.0\n\nA 1;;A 2;\n"
    names = "Stroke;Force;Stroke;Force\nmm;N;mm;N\n"
    moved = LENGTH * (STRETCH - 1)
    return written(folder, head + names + rows(moved, forces(5), moved, forces(4)))


def sheet_of_results(folder):
    results = [[None, "L0", "b0", "a0"], ["Legende", "mm", "mm", "mm"], ["A 1", 20, 5, 2], ["A 2", 20, 4, 2]]
    head, moved = ["Standardweg (mm)", "Standardkraft (N)"], LENGTH * (STRETCH - 1)
    measured = {name: [head, *zip(moved, forces(width), strict=True)] for name, width in WIDTHS.items()}
    return workbook(folder / "book.xlsx", Ergebnisse=results, **measured)


FILES = {"columns": columns_of_sizes, "table above": table_above, "sheet": sheet_of_results}


@pytest.mark.parametrize("layout", FILES)
def test_every_specimen_has_its_own_sizes(layout, tmp_path):
    tests = tq.read_tests(FILES[layout](tmp_path))
    assert [test.name for test in tests] == list(WIDTHS)
    for test in tests:
        check_curve(test, STRETCH, STRESS, rtol=1e-6, stress_atol=1e-9)


@pytest.mark.parametrize("layout", FILES)
def test_what_reads_a_specimen_alone_finds_its_sizes_too(layout, tmp_path):
    path = FILES[layout](tmp_path)
    for test in find_tests_in_file(path):
        options = {name: value for name, value in test.options.items() if name != "name"}
        np.testing.assert_allclose(tq.read(path, **options).stress, STRESS, rtol=1e-6, atol=1e-9)


PLACES = {"columns": "column 'Width_mm'", "table above": "line 4", "sheet": "'Ergebnisse', line 4"}


@pytest.mark.parametrize(("layout", "place"), list(PLACES.items()))
def test_a_size_given_for_all_is_used_and_the_specimen_it_contradicts_is_named(layout, place, tmp_path):
    with pytest.warns(
        UserWarning, match=r"^A 2: the cross-section is 10 mm2 \(as given\), but the file says 8"
    ) as found:
        first, second = tq.read_tests(FILES[layout](tmp_path), area="10 mm2")
    texts = [str(warning.message) for warning in found if "is no test" not in str(warning.message)]
    assert [place in text for text in texts] == [True]
    np.testing.assert_allclose(first.stress, STRESS, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(second.stress, 0.8 * STRESS, rtol=1e-6, atol=1e-9)


def test_a_side_of_the_cross_section_that_the_file_contradicts_is_named_where_it_states_no_other(tmp_path):
    path = written(tmp_path, f"# width: 8 mm\ndisplacement [mm],force [N]\n{rows(STRETCH - 1, STRESS, separator=',')}")
    with pytest.warns(UserWarning, match=r"the width is 10 mm \(as given\), but the file says 8 mm \(in line 1\)"):
        tq.read(path, length="1 mm", width="10 mm", thickness="0.1 mm")


def test_a_long_table_of_sizes_above_the_measurements_is_no_test(tmp_path):
    widths = [5.0, 4.0, 3.0, 6.0, 7.0]
    head = "Size;Width [mm];Area [mm²];L0 [mm]\n"
    head += "".join(f"S{k};{width:g};{width * THICKNESS:g};20\n" for k, width in enumerate(widths, 1))
    text = f"{head}\nSpecimen;Weg (mm);Kraft (N)\n"
    for k, width in enumerate(widths, 1):
        of_specimen = rows(LENGTH * (STRETCH - 1), forces(width)).splitlines()
        text += "".join(f"S{k};{row}\n" for row in of_specimen)
    tests = tq.read_tests(written(tmp_path, text))
    assert len(tests) == 5
    for test in tests:
        np.testing.assert_allclose(test.stress, STRESS, rtol=1e-6, atol=1e-9)


def test_a_unit_that_sizes_lack_is_that_of_displacements_and_said(tmp_path):
    path = table_above(tmp_path, units="")
    with pytest.warns(UserWarning, match="check the unit: the file states no unit of the sizes .* assumed, mm"):
        tests = tq.read_tests(path)
    np.testing.assert_allclose(tests[1].stress, STRESS, rtol=1e-6, atol=1e-9)
    mixed = path.read_text(encoding="utf-8").replace("mm;N;mm;N", "mm;N;um;N")
    with pytest.raises(InputError, match="give the undeformed length"):
        tq.read_tests(written(tmp_path, mixed))


def test_a_column_of_sizes_holds_one_number(tmp_path):
    names = "Displacement (mm);Force (N);L0 (mm);Width (mm);Thickness (mm)\n"
    filled = MEASURED.replace("\n", ";20;5;2\n")
    first_only = MEASURED.replace("\n", ";20;5;2\n", 1).replace("\n", ";;;\n").replace(";2;;;", ";2", 1)
    for text in (filled, first_only):
        np.testing.assert_allclose(tq.read(written(tmp_path, names + text)).stress, STRESS, rtol=1e-6, atol=1e-9)
    current = rows(LENGTH * (STRETCH - 1), forces(5), STRETCH * 0 + 20, 5 * STRETCH**-0.5, STRETCH * 0 + 2)
    with pytest.raises(InputError, match="The thickness is known, so that the width is enough"):
        tq.read(written(tmp_path, names + current))


def test_specimens_of_one_size_are_told_apart_by_their_names(tmp_path):
    text = "Width (mm);Thickness (mm);L0 (mm);Specimen;Displacement (mm);Force (N)\n"
    for name, width in (("S1", 5.0), ("S2", 5.0), ("S3", 4.0)):
        of_specimen = rows(LENGTH * (STRETCH - 1), forces(width)).splitlines()
        text += "".join(f"{width};{THICKNESS};{LENGTH};{name};{row}\n" for row in of_specimen)
    tests = tq.read_tests(written(tmp_path, text))
    assert [test.name for test in tests] == ["S1", "S2", "S3"]
    for test in tests:
        np.testing.assert_allclose(test.stress, STRESS, rtol=1e-6, atol=1e-9)


def test_rows_without_values_leave_each_specimen_its_rows(tmp_path):
    text = columns_of_sizes(tmp_path).read_text(encoding="utf-8").splitlines()
    text[3] = "A 1;20;5;2;;"
    first, second = tq.read_tests(written(tmp_path, "\n".join(text)))
    assert (len(first), len(second)) == (30, 31)
    np.testing.assert_allclose(second.stress, STRESS, rtol=1e-6, atol=1e-9)


LINES = {
    "English": "Initial specimen length: 20 mm\nMean width (mm): 5.0 ± 0.2\nThickness 2 mm",
    "names with units": "L0_mm;20\nwidth_mm;5\nthickness_mm;2",
    "area with its unit": "L0_mm = 20\narea_mm2 = 10",
    "testXpert": '"Probenbreite b0";"5,00";"mm"\n"Probendicke a0";"2,00";"mm"\n"Messlänge Standardweg";"20,00";"mm"',
    "German": "Anfangsmesslänge L0;20;mm\nAnfangsquerschnitt S₀;10;mm²",
    "French": "Longueur initiale (mm);20\nLargeur de l'éprouvette (mm);5\nEpaisseur (mm);2",
    "French section": "Longueur initiale (mm);20\nSection (mm²);10",
    "Spanish": "Longitud inicial: 20 mm\nAnchura de la probeta: 5 mm\nEspesor: 2 mm",
    "Portuguese": "Comprimento inicial (mm);20\nLargura (mm);5\nEspessura (mm);2",
    "Italian": "Lunghezza iniziale;20;mm\nLarghezza del provino;5;mm\nSpessore;2;mm",
    "Dutch": "Inklemlengte;20 mm\nBreedte;5 mm\nDikte van het proefstuk;2 mm",
    "Chinese": "试样宽度(mm);5\n试样厚度(mm);2\n原始标距(mm);20",
    "Japanese": "試験片の幅;5;mm\n厚さ;2;mm\n標点距離;20;mm",
}


@pytest.mark.parametrize("language", LINES)
def test_sizes_are_recognised_by_the_words_of_standards(language, tmp_path):
    data = tq.read(written(tmp_path, f"{LINES[language]}\n\n{TABLE}{MEASURED}"))
    check_curve(data, STRETCH, STRESS, rtol=1e-6, stress_atol=1e-9)


def test_a_height_is_the_length_of_a_cylinder_only(tmp_path):
    radius = np.sqrt(5 * THICKNESS / np.pi)
    cylinder = f"Disc diameter (mm);{2 * radius:.8f}\nHeight (mm);20\n{TABLE}{MEASURED}"
    data = tq.read(written(tmp_path, cylinder))
    np.testing.assert_allclose(data.stress, STRESS, rtol=1e-6, atol=1e-9)
    with pytest.raises(InputError, match=r"line 2 'Height \(mm\): 20': if that is the length, give --length \"20 mm\""):
        tq.read(written(tmp_path, f"Area (mm2);10\nHeight (mm);20\n{TABLE}{MEASURED}"))


@pytest.mark.parametrize(
    ("head", "options", "words"),
    [
        ("Abc;20;mm", {}, "The file says in line 1 'Abc: 20 mm': if that is the length, give --length \"20 mm\"."),
        ("Abc;2;cm\nDef (mm);7", {}, "'Def (mm): 7': if one of these is the length, give --length \"NUMBER mm\"."),
        ("clamps (about 20 mm apart)", {}, "'clamps (about 20 mm apart)': if that is the length"),
        ("Rate;10;mm/min", {}, '(--diameter "4 mm"). None is recognised in the file.'),
        ("Abc;9;mm²", {"length": "20 mm"}, "'Abc: 9 mm²': if that is the area, give --area \"9 mm2\"."),
        ("Width;5;mm\nAbc;2;mm", {"length": "20 mm"}, "if that is the thickness, give --thickness \"2 mm\"."),
        ("Abc;2;mm", {"length": "20 mm"}, "width or thickness or diameter, give --width \"2 mm\" or --thickness"),
    ],
)  # fmt: skip
def test_sizes_that_are_not_recognised_are_quoted(head, options, words, tmp_path):
    assert words in message(written(tmp_path, f"{head}\n\n{TABLE}{MEASURED}"), **options)


@pytest.mark.parametrize("second", ["Einspannlänge;30;mm", "Messlänge L0;30;mm"])
def test_two_lengths_that_differ_are_asked_about(second, tmp_path):
    text = f"Messlänge Standardweg;20;mm\n{second}\nBreite;5;mm\nDicke;2;mm\n{TABLE}{MEASURED}"
    with pytest.raises(InputError, match=r"two lengths: 20 mm in line 1 and 30 mm in line 2\. Say which: --length"):
        tq.read(written(tmp_path, text))


@pytest.mark.parametrize(
    "name", ["Mean diameter", "Gesamtlänge", "Crack length", "Section modulus", "Grip width", "Length Standardweg"]
)
def test_sizes_of_other_things_are_not_those_of_the_specimen(name, tmp_path):
    with pytest.raises(InputError, match="give the undeformed"):
        tq.read(written(tmp_path, f"{name};4;mm\n{TABLE}{MEASURED}"))


def test_a_file_that_states_what_is_given_warns_of_nothing(tmp_path):
    text = f"Gauge length;20;mm\nWidth;5;mm\nThickness;2;mm\n{TABLE}{MEASURED}"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tq.read(written(tmp_path, text), area="10 mm2", length="20 mm")
    with pytest.warns(UserWarning, match="the length is 25 mm .as given., but the file says 20 mm .in line 1."):
        tq.read(written(tmp_path, text), length="25 mm")


def test_sizes_in_one_line_are_read_between_semicolons_and_commas(tmp_path):
    text = rows(LENGTH * (STRETCH - 1), forces(5), separator=",")
    for head in ("Width 5 mm; thickness 2 mm; gauge length 20 mm", "sheet, width 5 mm, thickness 2 mm, length 20 mm"):
        data = tq.read(written(tmp_path, f"{head}\nDisplacement (mm),Force (N)\n{text}"))
        np.testing.assert_allclose(data.stress, STRESS, rtol=1e-6)


@pytest.mark.parametrize("product", ["5 x 2 mm", "5 mm x 2 mm", "5×2 mm", "5 * 2 mm"])
def test_a_product_of_sizes_is_not_quoted_as_one_of_them(tmp_path, product):
    text = rows(LENGTH * (STRETCH - 1), forces(5), separator=",")
    path = written(tmp_path, f"Specimen {product}\nDisplacement (mm),Force (N)\n{text}")
    with pytest.raises(InputError, match=r'if that is the area, give --area "10 mm2"\.'):
        tq.read(path, dimensions={"length": "20 mm"})
    np.testing.assert_allclose(tq.read(path, length="20 mm", area="10 mm2").stress, STRESS, rtol=1e-6)
    np.testing.assert_allclose(tq.read(path, length="20 mm", area=product).stress, STRESS, rtol=1e-6)


@pytest.mark.parametrize(
    "stated",
    [
        "Cross-section: 5 x 2 mm",
        "Cross-section 5 × 2 mm",
        "cross section (mm): 5mm x 2mm",
        "Querschnitt: 0,5 x 0,2 cm",
        "Width x thickness: 5 x 2 mm",
        "b x h [mm]: 5 x 2",
        "Length x width x thickness: 20 x 5 x 2 mm",
    ],
)
def test_a_product_that_is_called_a_cross_section_or_its_sides_is_read(tmp_path, stated):
    path = written(tmp_path, f"{stated}\n{TABLE}{MEASURED}")
    data = tq.read(path) if stated.startswith("Length") else tq.read(path, length="20 mm")
    np.testing.assert_allclose(data.stress, STRESS, rtol=1e-6)
    np.testing.assert_allclose(data.stretch, STRETCH, rtol=1e-6)


def test_a_width_that_is_a_product_is_refused_and_as_an_area_it_is_read(tmp_path):
    path = written(tmp_path, TABLE + MEASURED)
    with pytest.raises(InputError, match=r"two sides of a cross-section: give it as area \(--area\)"):
        tq.read(path, length="20 mm", width="5 x 2 mm", thickness="2 mm")


@pytest.mark.parametrize("name", ["Force per width (N/m)", "Tension [N/m]", "Line load (N/m)", "Force (N/m)"])
@pytest.mark.parametrize("stated", ["Thickness: 2 mm", "Width x thickness: 5 x 2 mm", ""])
def test_a_force_per_width_over_the_thickness_is_a_stress(tmp_path, name, stated):
    # In N/m it is 1000 times the stress in MPa times the thickness in mm.
    text = rows(STRETCH, 1e3 * STRESS * THICKNESS)
    path = written(tmp_path, f"{stated}\nStretch;{name}\n{text}")
    if not stated:
        with pytest.raises(InputError, match=r'give the undeformed thickness \(--thickness "2 mm"\)'):
            tq.read(path)
    data = tq.read(path) if stated else tq.read(path, thickness="2 mm")
    np.testing.assert_allclose(data.stress, STRESS, rtol=1e-6, atol=1e-9)
    taut = tq.read(path, preload="8 N/m", **({} if stated else {"thickness": "2 mm"}))
    assert taut.stress[0] >= 8e-3 / 2
    assert len(taut) < len(data)


def test_the_options_that_a_force_per_width_does_not_need_are_refused(tmp_path):
    path = written(tmp_path, f"Stretch;Force per width (N/m)\n{rows(STRETCH, 2e3 * STRESS)}")
    with pytest.raises(InputError, match="leave area out"):
        tq.read(path, area="10 mm2")
    with pytest.raises(InputError, match=r"--column force=NAME. and give the undeformed thickness"):
        tq.read(path, stress=2, stress_unit="N/m")
    np.testing.assert_allclose(tq.read(path, force=2, thickness="2 mm").stress, STRESS, rtol=1e-6, atol=1e-9)


def test_all_sizes_that_are_missing_are_asked_for_at_once_and_the_advice_reads_the_file(tmp_path):
    path = written(tmp_path, TABLE + MEASURED)
    text = message(path)
    for option in ("--length", "--area", "--width", "--diameter"):
        assert option in text
    text = message(path, area="10 mm2")
    assert "--length" in text
    assert "--area" not in text
    np.testing.assert_allclose(tq.read(path, area="10 mm2", length="20 mm").stress, STRESS, rtol=1e-6)


def test_a_file_of_sizes_alone_says_where_sizes_are_read(tmp_path):
    path = written(tmp_path, "specimen,width [mm],length [mm],remark\nS1,5,20,good\nS2,5.1,21,good\nS3,5.2,22,cut\n")
    with pytest.raises(InputError, match=r"holds sizes \('width \[mm\]', 'length \[mm\]'\), which are read where"):
        tq.read(path)
    path = written(tmp_path, "width [mm],travel [mm],load of the cell\n5,0,0\n5.1,1,0.1\n5.2,2,0.2\n")
    with pytest.raises(InputError, match="no column is recognised") as refusal:
        tq.read(path)
    assert "holds sizes" not in str(refusal.value)


@pytest.mark.parametrize("start", ["", "# "])
@pytest.mark.parametrize(
    ("names", "units", "values", "area"),
    [
        ("Width;Thickness;Length", "mm;mm;mm", "5;2;20", 10.0),
        ("Width (mm);Thickness (mm);Length (mm)", None, "5;2;20", 10.0),
        ("Area (mm2);Length (mm)", None, "10;20", 10.0),
        ("Width 1 (mm);Width 2 (mm);Thickness (mm);Length (mm)", None, "5;5,2;2;20", 10.2),
        ("Specimen;Width 1 (mm);Width 2 (mm);Thickness 1 (mm);Length (mm)", None, "S1;5;5,2;2;20", 10.2),
    ],
)
def test_names_over_a_row_of_sizes_state_none_and_the_first_of_them_counts(tmp_path, start, names, units, values, area):
    """The 1 in the name of a first width is no millimetre."""
    head = [start + line for line in (names, units, values) if line]
    rows = [f"{k};{k / 10:g}".replace(".", ",") for k in range(12)]
    path = text_file(tmp_path / "test.csv", *head, "Displacement [mm];Force [N]", *rows)
    data = tq.read(path)
    assert data.stretch[-1] == pytest.approx(1 + 11 / 20)
    assert data.stress[-1] == pytest.approx(1.1 / area)


@pytest.mark.parametrize("separator", ["\t", ";", ","])
def test_a_unit_stands_between_the_name_of_a_size_and_its_value(tmp_path, separator):
    head = [
        separator.join(cells) for cells in (("Width", "mm", "5"), ("Thickness", "um", "2000"), ("Length", "cm", "2"))
    ]
    rows = [f"{k}{separator}{k / 10:g}" for k in range(12)]
    path = text_file(tmp_path / "test.csv", *head, f"Displacement [mm]{separator}Force [N]", *rows)
    data = tq.read(path)
    assert data.stretch[-1] == pytest.approx(1 + 11 / 20)
    assert data.stress[-1] == pytest.approx(1.1 / 10)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("Durchmesser: 20.61\nHöhe: 9.23", "in line 1 'Durchmesser: 20.61', in line 2 'Höhe: 9.23', without a unit"),
        ("Diamètre (mm);20,61\nÉpaisseur (mm);9,23", r'along its thickness, give --length "9.23 mm" \(in line 2\)'),
    ],
)
def test_a_message_about_a_missing_size_quotes_what_may_be_it(tmp_path, head, words):
    rows = [f"{0.1 * k:.2f};{0.02 * k:.3f}".replace(".", ",") for k in range(12)]
    file = text_file(tmp_path / "liver.csv", head, "Weg (mm);Kraft (N)", *rows)
    with pytest.raises(tq.InputError, match=words):
        tq.read(file)


@pytest.mark.parametrize("head", ["Ø;20,61;mm\nHöhe;9,23;mm", "Durchmesser;20,61;mm\nAusgangslänge L0;9,23;mm"])
def test_diameters_and_lengths_by_the_signs_and_words_of_german_machines(tmp_path, head):
    rows = [f"{0.1 * k:.2f};{0.02 * k:.3f}".replace(".", ",") for k in range(12)]
    file = text_file(tmp_path / "Zugversuch.csv", head, "Weg (mm);Kraft (N)", *rows)
    data = tq.read(file)
    assert data.stretch.max() == pytest.approx(1 + 1.1 / 9.23)
    assert data.stress.max() == pytest.approx(0.22 / (np.pi / 4 * 20.61**2))


@pytest.mark.parametrize(
    "name", ["Proben-Nr.", "Probenbezeichnung", "Prüfling", "Nom de l'échantillon", "Nombre de la probeta"]
)
def test_the_specimen_is_that_of_a_line_above_the_table_in_words_of_machines(tmp_path, name):
    rows = [f"{1 + 0.02 * k:.2f};{0.02 * k:.3f}".replace(".", ",") for k in range(12)]
    file = text_file(tmp_path / "Zugversuch.csv", f"{name};L1;", "Stretch;Spannung (kPa)", *rows)
    assert tq.read(file).specimen == "L1"
