"""Columns under unknown names, told by their units where these leave no choice."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from written_files import check_curve, text_file

STRETCH = np.linspace(1.0, 1.3, 12)
STRESS = 100 * (STRETCH - STRETCH**-2)  # kPa
COLUMNS = {
    "time": np.arange(12) * 0.1,
    "mm": 20 * (STRETCH - 1),
    "N": STRESS * 0.02,
    "%": 100 * (STRETCH - 1),
    "ratio": STRETCH - 1,
    "kPa": STRESS,
    "MPa": STRESS * 1e-3,
    "five": np.full(12, 5.0),
    "wide": 10 - STRETCH,
}
SIZES = {"dimensions": {"length": "20 mm", "area": "20 mm2"}}


def written(folder, names, kinds, above="", units=""):
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*(COLUMNS[kind] for kind in kinds), strict=True)]
    return text_file(folder / "test.csv", *filter(None, [above, names, units, *rows]))


@pytest.mark.parametrize(
    ("names", "kinds"),
    [
        ("Elapsed Time (s),Position(Linear:Position) (mm),Load(Linear:Load) (N)", ["time", "mm", "N"]),
        ("Stroke (mm),Fz (N)", ["mm", "N"]),
        ("Fz (N),u [mm],Temperature (C)", ["N", "mm", "five"]),
        ("Allongement (mm),Effort (N)", ["mm", "N"]),
        ("\u4f4d\u79fb (mm),\u529b (N)", ["mm", "N"]),
        ("d [mm],F [N],Width (mm)", ["mm", "N", "wide"]),
        ("Zyklus,d [mm],F [N],set point (mm)", ["five", "mm", "N", "five"]),
    ],
)
def test_one_length_and_one_force_are_unambiguous_whatever_their_names(tmp_path, names, kinds):
    data = tq.read_experiment(written(tmp_path, names, kinds), **SIZES)
    check_curve(data, STRETCH, STRESS * 1e-3, rtol=1e-7, stress_atol=1e-9)


@pytest.mark.parametrize(
    ("names", "kinds"),
    [
        ("Strain,Stress N/mm^2", ["ratio", "MPa"]),
        ("Elongation (%),P (kPa)", ["%", "kPa"]),
        ("eps,sigma_eng [kPa]", ["ratio", "kPa"]),
        ("epsilon [mm/mm],P11 (kPa)", ["ratio", "kPa"]),
    ],
)
@pytest.mark.filterwarnings("ignore:check the unit")
def test_a_stress_and_a_strain_are_told_by_their_units(tmp_path, names, kinds):
    data = tq.read_experiment(written(tmp_path, names, kinds))
    check_curve(data, STRETCH, STRESS * 1e-3, rtol=1e-7, stress_atol=1e-9)


def test_a_row_of_units_tells_as_much_and_its_names_may_be_numbered(tmp_path):
    file = written(tmp_path, "1,Zeit,Weg A,Fz", ["five", "time", "mm", "N"], "Results Table 1", ",(s),(mm),(N)")
    data = tq.read_experiment(file, **SIZES)
    check_curve(data, STRETCH, STRESS * 1e-3, rtol=1e-7, stress_atol=1e-9)


def test_axes_may_be_numbered(tmp_path):
    file = written(tmp_path, "stretch_1,stretch_2,stress_1 (kPa),stress_2 (kPa)", ["ratio", "ratio", "kPa", "kPa"])
    text = file.read_text(encoding="utf-8").splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in text[1:]]
    lines = [f"{1 + a!r},{1 + 0.5 * b!r},{c!r},{2 * d!r}" for a, b, c, d in rows]
    file.write_text("\n".join([text[0], *lines]), encoding="utf-8")
    data = tq.read_experiment(file, mode="biaxial")
    check_curve(data, np.column_stack([STRETCH, (1 + STRETCH) / 2]), np.outer(STRESS * 1e-3, [1, 2]), stress_atol=1e-9)


@pytest.mark.parametrize(
    ("names", "kinds", "words"),
    [
        ("A (N),B (N),d (mm)", ["N", "five", "mm"], None),
        ("A (N),B (N),d (mm)", ["N", "wide", "mm"], "no column is recognised as stress or force"),
        ("d (mm),e (mm),F (N)", ["mm", "wide", "N"], "no column is recognised as stretch"),
        ("d (mm),e,F (N)", ["mm", "wide", "N"], "no column is recognised as stretch"),
        ("eps,sigma [kPa]", ["ratio", "kPa"], "no column is recognised as stress"),
        ("eps,True P [kPa]", ["ratio", "kPa"], "no column is recognised as stress"),
        ("Shear [-],Stress [kPa]", ["ratio", "kPa"], "'Shear \\[-\\]' is read as shear, which needs no length"),
    ],
)
def test_where_several_columns_could_be_meant_nothing_is_taken(tmp_path, names, kinds, words):
    file = written(tmp_path, names, kinds)
    if words is None:
        assert len(tq.read_experiment(file, **SIZES)) == 12
        return
    with pytest.raises(tq.InputError, match=words):
        tq.read_experiment(file, **SIZES)
