"""Files of tests with two stresses are read at once: by the axes in their names, or by columns given for each."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import C01, C10, biotester_protocols, mooney_rivlin
from tissuq.errors import InputError
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.findings import data_warnings
from tissuq.experiments.reading.read import read_experiment
from written_files import check_curve, message, text_file, written

STRETCH = np.array([[1.0, 1.0], [1.1, 1.05], [1.2, 1.1], [1.3, 1.15]])
STRESS = mooney_rivlin(STRETCH)
AXES = "stretch x,stretch y,stress x [kPa],stress_y [kPa]"
BIAXIAL = {"mode": "biaxial"}


def of_axes(folder, heading=AXES, stretch=STRETCH, stress=STRESS):
    return written(folder, heading, *stretch.T, *(1e3 * stress).T)


def test_both_axes_of_a_machines_file_are_fitted_to_the_parameters_they_were_made_with(tmp_path):
    file = biotester_protocols()
    data = read_experiment(file.written(tmp_path), **file.options)
    summary = tq.fit(data, material="mooney-rivlin", discrepancy="none").summary(unit="MPa")
    assert summary["mean"].loc[["C10", "C01"]].tolist() == pytest.approx([C10, C01], rel=1e-4)


def test_the_source_tells_the_sizes_of_each_axis(tmp_path):
    file = biotester_protocols()
    source = read_experiment(file.written(tmp_path), **file.options).source
    assert "axis x: stretch = 1 + column 'XDisplacement_um' in um (from the file) / 5 mm" in source
    assert "axis y: stretch = 1 + column 'YDisplacement_um' in um (from the file) / 5.1 mm" in source
    assert (
        "7.65 mm2 (width 5.1 mm from column 'YSize_um' less the displacement and thickness 1.5 mm as given)" in source
    )
    assert "7.5 mm2 (width 5 mm from column 'XSize_um' less the displacement and thickness 1.5 mm as given)" in source
    assert source.count("only loading of all 3 cycles") == 1


def test_length_and_width_are_the_sizes_along_the_axes(tmp_path):
    file = biotester_protocols()
    sizes = {"length": "10 mm", "width": "20.4 mm", "thickness": "1.5 mm"}
    data = read_experiment(file.written(tmp_path), **file.options | {"dimensions": sizes})
    check_curve(data, 1 + (file.stretch - 1) / [2, 4], file.stress / [4, 2], atol=1e-6)


def test_one_area_is_that_of_both_axes(tmp_path):
    file = biotester_protocols()
    data = read_experiment(file.written(tmp_path), **file.options | {"dimensions": {"area": "15 mm2"}})
    check_curve(data, file.stretch, file.stress * [0.51, 0.5], atol=1e-6)


def test_a_given_thickness_goes_before_an_area_in_the_file(tmp_path):
    file = biotester_protocols()
    path = file.written(tmp_path)
    path.write_bytes(b"Area,99,mm2\n" + path.read_bytes())
    np.testing.assert_allclose(read_experiment(path, **file.options).stress, file.stress, atol=1e-6)


@pytest.mark.parametrize(
    ("heading", "columns"),
    [
        (AXES, None),
        (
            "lambda1,lambda2,P1 [kPa],P2 [kPa]",
            {"stretch": "lambda1", "stretch2": "lambda2", "stress": "P1", "stress2": "P2"},
        ),
        ("stretch,second,stress [kPa],P2 [kPa]", {"stretch2": "second", "stress2": 4}),
        ("stretch x,stretch y,P1 [kPa],P2 [kPa]", {"stress": 3, "stress2": 4}),
    ],
)
def test_columns_of_stretches_and_stresses_are_read(tmp_path, heading, columns):
    data = read_experiment(of_axes(tmp_path, heading), mode="biaxial", columns=columns)
    check_curve(data, STRETCH, STRESS, rtol=1e-10, stress_atol=1e-15)
    assert data.stress_unit == "kPa"


def test_sizes_that_only_one_kind_of_column_needs_are_not_refused(tmp_path):
    path = written(tmp_path, "stretch x,stretch y,force x [N],force y [N]", *STRETCH.T, *(STRESS * [40, 20]).T)
    data = read_experiment(path, mode="biaxial", dimensions={"length": "10 mm", "width": "20 mm", "thickness": "2 mm"})
    np.testing.assert_allclose(data.stress, STRESS, rtol=1e-10, atol=1e-15)
    moved = (STRETCH - 1) * [10, 20]
    path = written(tmp_path, "disp x [mm],disp y [mm],stress x [MPa],stress y [MPa]", *moved.T, *STRESS.T)
    data = read_experiment(path, mode="biaxial", dimensions={"length": "10 mm", "width": "20 mm"})
    np.testing.assert_allclose(data.stretch, STRETCH, rtol=1e-10)


def test_cauchy_stresses_are_divided_by_the_stretch_of_their_own_axis(tmp_path):
    path = of_axes(tmp_path, stress=STRESS * STRETCH)
    reading = read_file(path, mode="biaxial", stress_type="cauchy")
    np.testing.assert_allclose(reading.experiment.stress, STRESS, rtol=1e-10, atol=1e-15)


def test_cycles_are_those_of_both_axes_where_one_is_held_at_a_time(tmp_path):
    there = np.linspace(0, 0.2, 11)
    back = np.concatenate([there, there[-2::-1]])
    stretch = np.concatenate([1 + np.outer(back, ratio) for ratio in ((1, 0), (0, 1))])
    path = of_axes(tmp_path, stretch=stretch, stress=mooney_rivlin(stretch))
    assert [(each.start, each.peak) for each in read_file(path, mode="biaxial").cycles] == [(0, 10), (20, 31)]
    data = read_experiment(path, mode="biaxial", cycle=2, branch="loading", every=2)
    np.testing.assert_allclose(data.stretch, stretch[20:32:2])


def test_a_preload_is_that_of_each_axis_and_both_carry_it_in_the_rows_kept(tmp_path):
    steps = np.linspace(0, 0.3, 31)
    stretch = 1 + np.outer(steps, [1, 0.5])
    data = read_experiment(
        of_axes(tmp_path, stretch=stretch, stress=mooney_rivlin(stretch)), mode="biaxial", preload="5 kPa"
    )
    kept = (mooney_rivlin(stretch) >= 5e-3).all(axis=1)
    reference = [np.interp(5e-3, mooney_rivlin(stretch)[:, k], stretch[:, k]) for k in range(2)]
    check_curve(data, stretch[kept] / reference, mooney_rivlin(stretch)[kept], rtol=1e-9)


def test_a_preload_that_the_axes_never_carry_together_is_told(tmp_path):
    path = of_axes(tmp_path, stress=np.array([[0, 0.02], [0, 0.02], [0.02, 0], [0.02, 0]]))
    assert "no row is left, for all are carrying less than 5 kPa" in message(path, mode="biaxial", preload="5 kPa")


def test_one_axis_may_be_shorter_than_undeformed_under_tension(tmp_path):
    stretch = np.array([[1.0, 1.0], [1.2, 0.98], [1.4, 0.96]])
    stress = mooney_rivlin(stretch)
    assert stress[2, 1] > 0
    data = read_experiment(of_axes(tmp_path, stretch=stretch, stress=stress), mode="biaxial")
    np.testing.assert_allclose(data.stress, stress, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    ("mode", "heading", "deformation", "columns"),
    [
        ("constrained-uniaxial", "stretch,pulled,held", [1.0, 1.1, 1.2], {"stress": "pulled", "stress2": "held"}),
        ("simple-shear-normal", "gamma,stress,normal", [0.0, 0.1, 0.2], {"stress2": "normal"}),
    ],
)
def test_a_second_stress_of_one_control_is_given_by_its_column(tmp_path, mode, heading, deformation, columns):
    sign = -1 if mode == "simple-shear-normal" else 1
    path = written(tmp_path, heading, deformation, [0, 0.2, 0.4], [0, 0.1 * sign, 0.2 * sign])
    data = read_experiment(path, mode=mode, columns=columns, stress_unit="kPa")
    assert data.stretch.tolist() == deformation
    np.testing.assert_allclose(data.stress, [[0, 0], [2e-4, 1e-4 * sign], [4e-4, 2e-4 * sign]])


def test_a_thin_tube_is_read_from_columns_given_for_both_stresses(tmp_path):
    path = of_axes(tmp_path, "hoop,axial,hoop stress [kPa],axial stress [kPa]")
    columns = {"stretch": "hoop", "stress": "hoop stress", "stretch2": "axial", "stress2": "axial stress"}
    data = read_experiment(path, mode="thin-tube", columns=columns)
    np.testing.assert_allclose(data.stress, STRESS, rtol=1e-10, atol=1e-15)
    assert "and the file's columns do not tell both" in message(path, mode="thin-tube")


@pytest.mark.parametrize(
    ("heading", "options", "words"),
    [
        (AXES, {"axis": "x"}, "'biaxial' reads both axes; leave axis (--axis) out"),
        (AXES, {"compression_positive": True}, "for loading modes with one stress, not for 'biaxial'"),
        (AXES, {"dimensions": {"diameter": "2 mm"}}, "do not follow from a diameter. Give thickness"),
        (AXES, {"dimensions": {"thickness": "2 mm"}}, "is read as stress, which needs no thickness"),
        (AXES, {"columns": {"stress2": "stress x"}}, "'stress x [kPa]' cannot be that of both engineering stress of"),
        (AXES, {"columns": {"stress2": "stress z"}}, "no column 'stress z' (asked for as stress). Did you mean"),
        (AXES, {"columns": {"stress2": "stress z"}}, "(This is about axis y: roles of its columns end in 2, as"),
        (AXES, {"mode": "constrained-uniaxial"}, "--column stress=NAME --column stress2=NAME (in Python columns=)."),
        (AXES, {"mode": "constrained-uniaxial", "columns": {"stress2": 4}, "preload": "1 kPa"}, "does not say which"),
        (AXES, {"mode": "constrained-uniaxial", "columns": {"stretch2": 4, "stress2": 3}}, "cannot be given as 'str"),
        ("a,b,stretch,stress", {}, "name them 'stretch x', 'stress x', 'stretch y', 'stress y'"),
        ("stretch,b,stress,d", {"columns": {"stress2": "d"}}, "the file's columns do not tell both. The columns are"),
        ("disp x [mm],disp y [mm],stress x,stress y", {}, 'give the undeformed length (--length "20 mm"'),
        (
            "disp x [mm],disp y [mm],stress x,stress y",
            {"dimensions": {"length": "2 mm"}},
            "Along it the specimen measures --width, and across it --length.)",
        ),
        (
            "hoop,axial,load [N],more [N]",
            {"mode": "thin-tube", "columns": {"stretch": 1, "stretch2": 2, "force": 3, "force2": 4}},
            "column 'load [N]' holds a force, and in loading mode 'thin-tube' columns are read as",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_told(tmp_path, heading, options, words):
    assert words in message(of_axes(tmp_path, heading), **BIAXIAL | options)


def test_a_stress_against_the_tension_of_both_axes_is_refused(tmp_path):
    text = message(of_axes(tmp_path, stress=STRESS * [1, -1]), mode="biaxial")
    assert "column 'stress_y [kPa]': at stretch 1.15 (tension) the stress is negative" in text


def test_an_inspection_tells_both_axes_and_what_is_strange_about_one(tmp_path):
    steps = np.linspace(0, 0.3, 40)
    stretch = 1 + np.outer(steps, [1, 0.5])
    stress = mooney_rivlin(stretch) + np.array([0, 0.005])
    inspection = tq.inspect(of_axes(tmp_path, stretch=stretch, stress=stress), mode="biaxial")
    text = " ".join(str(inspection).split())
    assert "'stretch x' is stretch of axis x" in text
    assert "stretch axis x: 1 to 1.3; axis y: 1 to 1.15" in text
    assert [note[:50] for note in inspection.warnings] == ["axis y: at stretch 1 the stress is already 5 kPa, "]
    assert len(inspection.noise_sds) == 2


def test_an_axis_that_is_held_at_its_length_is_read(tmp_path):
    path = tmp_path / "biaxial strip.csv"
    path.write_text(
        "stretch x,stretch y,stress x [kPa],stress y [kPa]\n1,1,0,0\n1.1,1,2.1,0.8\n1.2,1,4.5,1.7\n", encoding="utf-8"
    )
    data = read_experiment(path, mode="biaxial")
    assert data.stretch.tolist() == [[1, 1], [1.1, 1], [1.2, 1]]
    assert data.curves[1].stress.tolist() == [0, 0.8e-3, 1.7e-3]


def test_a_first_axis_without_a_number_is_read_beside_the_second(tmp_path):
    head = "mode,stretch,stress_MPa,stretch_2,stress_2_MPa"
    rows = "biaxial,1,0,1,0\nbiaxial,1.1,2.1,1.05,0.8\nbiaxial,1.2,4.5,1.1,1.7\n"
    path = text_file(tmp_path / "sheet.csv", f"{head}\n{rows}")
    data = read_experiment(path)
    assert data.stretch.tolist() == [[1, 1], [1.1, 1.05], [1.2, 1.1]]
    assert [curve.stress.tolist() for curve in data.curves] == [[0, 2.1, 4.5], [0, 0.8, 1.7]]
    path.write_text(f"{head},stress_3_MPa,stress\n".replace("stretch_2", "x_2") + "1,1,1,1,1,1,1\n", encoding="utf-8")
    with pytest.raises(InputError, match="stress2=NAME"):
        read_experiment(path, mode="biaxial")


def test_an_inspection_says_of_each_axis_what_its_ranges_are(tmp_path):
    rows = "".join(f"{1 + k / 20},{k * 3.0},{1 + k / 10},{k * 4.0}\n" for k in range(8))
    path = text_file(tmp_path / "sheet.csv", f"stretch,stress_kPa,stretch_2,stress_2_kPa\n{rows}")
    found = tq.inspect(path, mode="biaxial")
    assert "axis 1: stretch 1 to 1.35, stress 0 to 21 kPa; axis 2: stretch 1 to 1.7, stress 0 to 28 kPa" in found.line
    text = " ".join(str(found).split())
    assert "stretch axis 1: 1 to 1.35; axis 2: 1 to 1.7" in text
    assert "'stress_2_kPa' is stress of axis 2" in text
    assert "of engineering stress of" not in text


SHEAR = np.array([0.0, 0.5, 1.0, 1.5])


@pytest.mark.parametrize(
    ("names", "components", "said"),
    [
        ("F11,F22,F12,F21", [0.06 * SHEAR, 0.0 * SHEAR], "column 'F12' says that the sheet was sheared"),
        ("F11,F22,F12,F21", [0.08 * SHEAR, 0.02 * SHEAR], "columns 'F12' and 'F21' say that the sheet was sheared"),
        ("F11,F22,F12,F21", [0.08 * SHEAR, -0.07 * SHEAR], ""),  # mostly a rotation
        ("F11,F22,F12,F21", [0.02 * SHEAR, 0.01 * SHEAR], ""),
        ("stretch x,stretch y,E12,note", [0.04 * SHEAR, 1 + SHEAR], "column 'E12' says that the sheet was sheared"),
        ("stretch x,stretch y,E12,note", [0.015 * SHEAR, 1 + SHEAR], ""),
        ("F11,F22,F12,E12", [0.04 * SHEAR, 0.02 * SHEAR], ""),  # one shear, in two measures
        ("stretch x,stretch y,E12,E21", [0.015 * SHEAR, 0.015 * SHEAR], ""),
        ("F11,F22,F12,E12", [0.06 * SHEAR, 0.03 * SHEAR], "columns 'F12' and 'E12' say that the sheet was sheared"),
        ("stretch x,stretch y,gamma [deg],E12 [µε]", [2 * SHEAR, 2e4 * SHEAR], ""),
        ("stretch x,stretch y,gamma [deg],E12 [MPa]", [5 * SHEAR, 1 + SHEAR], "column 'gamma [deg]' says that"),
    ],
)
def test_a_sheet_that_was_sheared_too_is_doubted(tmp_path, names, components, said):
    columns = (*STRETCH.T, *components, *(1e3 * STRESS).T)
    path = written(tmp_path, f"{names},stress x [kPa],stress y [kPa]", *columns)
    doubts = [text for text in data_warnings(read_file(path, **BIAXIAL)) if "sheared" in text]
    assert len(doubts) == bool(said)
    assert all(text.startswith(said) for text in doubts)
