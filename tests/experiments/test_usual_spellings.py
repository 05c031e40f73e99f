"""Names, units and numbers as laboratories spell them, and pages of HTML: the true curves are read from all."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from tissuq.experiments.units import FORCE, LENGTH, stress_unit
from written_files import check_curve, written

L = ramp()
P = 1e3 * neo_hookean(L)  # kPa
D, N = 20 * (L - 1), P * 8e-3  # mm and N, for a length of 20 mm and a section of 8 mm2
SIZES = {"length": "20 mm", "area": "8 mm2"}


def check(path, **options):
    (test,) = tq.read_tests(path, **options)
    check_curve(test, L, 1e-3 * P, rtol=1e-5, stress_atol=1e-7)


@pytest.mark.parametrize("mark", ["\u00a0", "\u202f", "\u2009", "'", "\u2019"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_blanks_that_do_not_break_and_apostrophes_part_thousands(tmp_path, mark, decimal):
    def form(value):
        return f"{value:,.3f}".replace(".", "|").replace(",", mark).replace("|", decimal)

    path = written(tmp_path, "Dehnung (%);Spannung (Pa)", 100 * (L - 1), 1e3 * P, separator=";", form=form)
    assert mark in path.read_text(encoding="utf-8")
    check(path)


PAGE = """<html><head><meta charset="utf-8"><title>Export</title><style>td {{color: red}}</style></head><body>
<h1>Tendon</h1><p>Gauge length: 20 mm</p><p>Area: 8 mm2</p><table border=1>
<tr><th>Time (s)</th><th><b>Extension</b> (mm)</th><th>Load<br>(N)</th></tr>
{rows}</table></body></html>"""


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_page_that_is_named_as_a_workbook_is_read(tmp_path, decimal, encoding):
    rows = "".join(
        f"<tr><td>{k}</td><td>{d:.7f}</td><td><p>{n:.7f}</p></td></tr>\n".replace(".", decimal)
        for k, (d, n) in enumerate(zip(D, N, strict=True))
    )
    path = tmp_path / "export.xls"
    path.write_text(PAGE.format(rows=rows), encoding=encoding)
    check(path)


def test_cells_that_span_columns_keep_the_others_in_their_places(tmp_path):
    rows = "".join(f"<tr><td>{s!r}</td><td>{p!r}</td></tr>" for s, p in zip(L.tolist(), P.tolist(), strict=True))
    head = "<tr><td colspan=2>Skin</td></tr><tr><th>Stretch</th><th>Stress (kPa)</th></tr>"
    path = tmp_path / "export.html"
    path.write_text(f"<!DOCTYPE html><table>{head}{rows}</table>", encoding="utf-8")
    check(path)


def test_tables_of_a_page_are_tests_each(tmp_path):
    rows = "".join(f"<tr><td>{s!r}<td>{p!r}" for s, p in zip(L.tolist(), P.tolist(), strict=True))
    table = f"<table><tr><th>Stretch<th>Stress (kPa)</tr>{rows}</table>"
    path = tmp_path / "export.xls"
    path.write_text(f"<!-- exported --><html><body>{table}{table}</body></html>", encoding="utf-8")
    tests = tq.read_tests(path)
    assert len(tests) == 2
    for test in tests:
        np.testing.assert_allclose(test.stress, 1e-3 * P, rtol=1e-9, atol=1e-12)


def test_other_kinds_of_xml_are_named(tmp_path):
    path = tmp_path / "export.xls"
    path.write_text('<?xml version="1.0"?><Workbook></Workbook>', encoding="utf-8")
    with pytest.raises(InputError, match=r"an XML document.* save it as \.xlsx"):
        tq.read(path)


@pytest.mark.parametrize(
    ("unit", "newtons"),
    [("cN", 1e-2), ("dN", 0.1), ("daN", 10), ("hN", 100), ("nN", 1e-9), ("pN", 1e-12), ("10^-3 N", 1e-3)],
)
def test_forces_have_all_prefixes(tmp_path, unit, newtons):
    assert FORCE.factor(unit) == pytest.approx(newtons)
    check(written(tmp_path, f"Weg (mm),Kraft ({unit})", D, N / newtons), **SIZES)


def test_powers_of_ten_multiply_units_and_those_of_numbers_are_asked_about(tmp_path):
    for unit in ("10^-2 MPa", "10⁻² MPa", "1e-2 MPa", "10**-2 N/mm2"):
        assert stress_unit(unit).to_mpa == pytest.approx(0.01)
    assert LENGTH.factor("10^-6 m") == pytest.approx(1e-3)
    check(written(tmp_path, "Strain,Stress (10^-2 MPa)", L - 1, 0.1 * P))
    with pytest.raises(InputError, match=r"'x10\^-2 MPa' may be .* write 10\^-2 MPa, without"):
        tq.read(written(tmp_path, "Strain,Stress (x10^-2 MPa)", L - 1, 0.1 * P))


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("lambda-1,P (kPa)", (L - 1, P)),
        ("λ − 1,Nominal stress (kPa)", (L - 1, P)),
        ("Stretch - 1 (-),Stress (kPa)", (L - 1, P)),
        ("L/L0,F/A0 (kPa)", (L, P)),
        ("ΔL/L0 (%),F/A0 (kPa)", (100 * (L - 1), P)),
        ("(L-L0)/L0,F/A0 (kPa)", (L - 1, P)),
        ("Nominelle Dehnung (%),Zugspannung (kPa)", (100 * (L - 1), P)),
        ("Gerinim (%),Gerilme (kPa)", (100 * (L - 1), P)),
        ("Stretch ratio,Wall stress (mmHg)", (L, P / 0.133322387415)),
    ],
)
def test_symbols_and_names_of_stretches_and_stresses(tmp_path, head, columns):
    check(written(tmp_path, head, *columns))


def test_what_is_numbered_from_one_to_two_is_of_axes(tmp_path):
    path = written(tmp_path, "lambda-1,lambda-2,stress-1 (kPa),stress-2 (kPa)", L, 1 + (L - 1) / 2, P, P / 2)
    test = tq.read(path, mode="biaxial")
    np.testing.assert_allclose(test.stretch, np.stack([L, 1 + (L - 1) / 2], axis=1), rtol=1e-6)


@pytest.mark.parametrize(
    "head",
    ["Uzama (mm),Kuvvet (N)", "Displacement (millimeters),Force (Newtons)", "Elongation (mm),Load (newton)"],
)
def test_displacements_and_forces(tmp_path, head):
    check(written(tmp_path, head, D, N), **SIZES)


@pytest.mark.parametrize(("unit", "values", "sizes"), [("%", 100 * (L - 1), {}), ("mm", D, {"length": "20 mm"})])
def test_an_elongation_is_what_its_unit_says_without_a_warning(tmp_path, unit, values, sizes):
    path = written(tmp_path, f"Elongation ({unit}),Stress (kPa)", values, P)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(path, **sizes)


def test_a_compression_is_a_strain_whose_sign_is_asked_about(tmp_path):
    stretch = np.linspace(1, 0.7, 30)
    path = written(tmp_path, "Compression (%),Stress (kPa)", 100 * (1 - stretch), -1e3 * neo_hookean(stretch))
    with pytest.raises(InputError, match="--compression-positive"):
        tq.read(path)
    test = tq.read(path, compression_positive=True)
    check_curve(test, stretch, neo_hookean(stretch), rtol=1e-6, stress_atol=1e-9)


@pytest.mark.parametrize(
    "head",
    [
        '"名前","厚さ","幅","標点間距離"\n"単位","mm","mm","mm"\n"1 _ 1","1.6","5","20"\n\n"1 _ 1",,',
        '"Name","Thickness","Width","Gauge_Length"\n"Units","mm","mm","mm"\n"1 _ 1","1.6","5","20"\n\n"1 _ 1",,',
        '"試験名","引張"\n"名前","厚さ","幅","標点間距離"\n"単位","mm","mm","mm"\n"1 _ 1","1.6","5","20"\n',
        "Einspannlänge bei Startposition,20,mm\nProbenfläche A0,8,mm2",
        "Messlänge L0: 20 mm\nProbenfläche A0 = 8 mm²",
    ],
)
def test_sizes_of_the_only_specimen_stand_in_a_table_of_it_or_in_lines(tmp_path, head):
    check(written(tmp_path, f"{head}\n時間,試験力,変位\nsec,N,mm", D, N, D))
    check(written(tmp_path, f"{head}\nTime,Force,Stroke\nsec,N,mm", D, N, D))


def test_the_sizes_of_two_specimens_are_of_neither(tmp_path):
    rows = '"1 _ 1","1.6","5","20"\n"1 _ 2","1.2","5","20"'
    head = f'"Name","Thickness","Width","Gauge_Length"\n"Units","mm","mm","mm"\n{rows}\n'
    with pytest.raises(InputError, match="give the undeformed length"):
        tq.read(written(tmp_path, f"{head}\nTime,Force,Stroke\nsec,N,mm", D, N, D))
