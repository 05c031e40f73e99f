"""Files in many languages, in any encoding: what is read is what was measured."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.experiments.reading.headings import dimensions_named, heading
from tissuq.experiments.reading.text_file import read_lines
from tissuq.experiments.reading.vocabulary import ROLES
from tissuq.experiments.units import FORCE, LENGTH, TORQUE, looks_like_unit, strain_factor, stress_unit
from written_files import check_curve, written

STRETCH = np.linspace(1, 1.3, 31)
STRESS = neo_hookean(STRETCH)
RUSSIAN = ["utf-8", "cp1251", "cp866", "koi8-r"]
CHINESE = ["utf-8", "gb18030", "utf-16"]
FORCES = [
    (RUSSIAN, "Перемещение, мм;Сила, Н", "Начальная длина: 20 мм", "Площадь поперечного сечения, мм2: 10"),
    (RUSSIAN, "Деформация, мм;Нагрузка, Н", "База: 20 мм", "Сечение: 5 x 2 мм"),
    (RUSSIAN, "Удлинение [мм];Нагрузка [Н]", "Начальная длина образца (мм);20", "Ширина (мм);5\nТолщина (мм);2"),
    (RUSSIAN, "Ход траверсы (мм);Усилие (Н)", "Расчётная длина = 20 мм", "Диаметр образца = 3.56824823 мм"),
    (CHINESE, "位移(mm);力(N)", "标距: 20 mm", "截面积: 10 mm2"),
    (CHINESE, "变形(毫米);负荷(牛)", "标距(mm);20", "宽度(mm);5\n厚度(mm);2"),
    (["utf-8", "big5"], "位移(mm);荷重(N)", "標距: 20 mm", "寬度: 5 mm\n厚度: 2 mm"),
    (["utf-8", "cp949"], "스트로크(mm);하중(N)", "L0: 20 mm", "A0: 10 mm2\n시험편: 인장"),
    (["utf-8", "cp1250"], "Przemieszczenie (mm);Siła (N)", "Długość pomiarowa: 20 mm", "Przekrój: 10 mm2"),
    (["utf-8", "cp1250"], "Droga (mm);Obciążenie (N)", "Długość próbki: 20 mm", "Szerokość: 5 mm\nGrubość: 2 mm"),
    (["utf-8", "cp1252"], "Course standard (mm);Force standard (N)", "L0 - course standard: 20 mm", "Section: 10 mm²"),
    (
        ["utf-8", "cp1252"],
        "Standard travel (mm);Standard force (N)",
        '"Gage length, standard travel";20;"mm"',
        '"Cross-section";10;"mm²"',
    ),
    (["utf-8", "cp932"], "変位(mm);荷重(N)", "標点距離: 20 mm", "幅: 5 mm\n厚さ: 2 mm"),
    (
        ["utf-8", "cp1252"],
        "Standardweg (mm);Standardkraft (N)",
        "Messlänge: 20 mm",
        "Öl à 3 µm ± 1 °C\nb0: 5 mm\nDicke: 2 mm",
    ),
]


def encoded(folder, encoding, head, names, *columns):
    return written(folder, "\n".join([*head, names]), *columns, separator=";", encoding=encoding)


@pytest.mark.parametrize(
    ("encoding", "names", "head"),
    [(encoding, names, head) for encodings, names, *head in FORCES for encoding in encodings],
)
def test_displacement_force_and_sizes_are_read_in_any_encoding(tmp_path, encoding, names, head):
    data = tq.read(encoded(tmp_path, encoding, head, names, 20 * (STRETCH - 1), 10 * STRESS))
    check_curve(data, STRETCH, STRESS, rtol=1e-7, stress_atol=1e-12)


@pytest.mark.parametrize(
    ("names", "deformation", "load", "unit"),
    [
        ("Деформация, %;Напряжение, МПа", 100 * (STRETCH - 1), STRESS, "МПа"),
        ("Относительное удлинение, %;Условное напряжение, кПа", 100 * (STRETCH - 1), 1e3 * STRESS, "кПа"),
        ("Истинная деформация;Истинное напряжение, Н/мм2", np.log(STRETCH), STRETCH * STRESS, "Н/мм2"),
        ("Степень растяжения;Напряжение, Па", STRETCH, 1e6 * STRESS, "Па"),
        ("拉伸比;应力(兆帕)", STRETCH, STRESS, "兆帕"),
        ("拉伸应变 (%);名义应力 (MPa)", 100 * (STRETCH - 1), STRESS, "MPa"),
        ("Odkształcenie (%);Naprężenie (MPa)", 100 * (STRETCH - 1), STRESS, "MPa"),
        ("인장 변형률 (%);인장 응력 (MPa)", 100 * (STRETCH - 1), STRESS, "MPa"),
    ],
)
def test_strains_and_stresses_are_read_with_their_measures_and_units(tmp_path, names, deformation, load, unit):
    encodings = {"拉": "gb18030", "ż": "cp1250", "인": "cp949"}
    encoding = next((encoding for letter, encoding in encodings.items() if letter in names), "cp1251")
    data = tq.read(encoded(tmp_path, encoding, [], names, deformation, load))
    check_curve(data, STRETCH, STRESS, rtol=1e-7, stress_atol=1e-12)
    assert data.stress_unit == unit


@pytest.mark.parametrize("line", ["Aire: 3 cm³", "œsophage, cœur", "Tamaño: ¿3 mm²?", "œuvre éprouvette", "kg/m³ x¹"])
def test_powers_and_letters_of_western_europe_are_not_taken_for_polish(tmp_path, line):
    path = tmp_path / "test.csv"
    path.write_bytes(line.encode("cp1252"))
    assert read_lines(path) == [line]


def test_a_column_of_specimens_in_russian_parts_them(tmp_path):
    lines = [
        f"{name};{x:.9g};{factor * 1e3 * neo_hookean(x):.9g}"
        for name, factor in (("А1", 1), ("Б2", 2))
        for x in STRETCH
    ]
    path = tmp_path / "test.csv"
    path.write_bytes("\n".join(["Образец;Степень растяжения;Напряжение, кПа", *lines]).encode("cp1251"))
    first, second = tq.read_tests(path)
    assert (first.name, second.name) == ("А1", "Б2")
    np.testing.assert_allclose(second.stress, 2 * STRESS, rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize(
    ("size", "name"),
    [
        ("area", "площадь сечения"),
        ("width", "начальная ширина"),
        ("thickness", "толщина образца"),
        ("diameter", "исходный диаметр"),
        ("length", "расстояние между захватами"),
        ("length", "расчетная длина"),
    ],
)
def test_every_size_has_a_name_in_russian(size, name):
    assert dimensions_named(name) == {size}


def test_every_role_has_a_name_in_russian():
    without = [role for role, names in ROLES.items() if not any(name[0] in "абвгдезиклмнопрстуфхцч" for name in names)]
    assert not without
    assert heading("Скорость сдвига, 1/с").quantity in ROLES["rate"]
    assert heading("Время, с").unit == "с"


def test_units_in_russian_and_chinese_are_those_in_latin_letters():
    assert stress_unit("кгс/см2").to_mpa == pytest.approx(0.0980665, rel=1e-12)
    assert stress_unit("мм рт. ст.").to_mpa == pytest.approx(133.322387415e-6, rel=1e-9)
    assert [FORCE.factor(unit) for unit in ("Н", "кН", "мН", "千牛")] == [1, 1e3, 1e-3, 1e3]
    assert [LENGTH.factor(unit) for unit in ("мм", "мкм", "毫米")] == [1, 1e-3, 1]
    assert TORQUE.factor("Н·м") == TORQUE.factor("Nm")
    assert strain_factor("мм/мм") == 1
    assert not any(map(looks_like_unit, ("Сила", "Образец", "位移")))


@pytest.mark.parametrize(
    ("encoding", "name"),
    [("gb18030", "力"), ("gb18030", "负荷"), ("big5", "力"), ("cp932", "力"), ("koi8-r", "сила"), ("cp1250", "Siła")],
)
def test_one_short_name_tells_the_encoding(tmp_path, encoding, name):
    data = tq.read(
        encoded(tmp_path, encoding, [], f"Strain;{name} (N)", STRETCH - 1, 10 * STRESS), dimensions={"area": "10 mm2"}
    )
    np.testing.assert_allclose(data.stress, STRESS, atol=1e-6)
    assert f"column '{name} (N)'" in data.source
