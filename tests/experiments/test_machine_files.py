"""Every layout of a testing machine is read back to the stretches and stresses that it was written from."""

from __future__ import annotations

import numpy as np
import pytest

from machine_files import LAYOUTS, biotester, instron, instron_compression, univert, wintest, zwick
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.read import read_experiment
from written_files import check_curve, message, text_file


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_is_read_back(layout, tmp_path):
    file = LAYOUTS[layout]()
    data = read_experiment(file.written(tmp_path), **file.options)
    check_curve(data, file.stretch, file.stress, rtol=0, atol=1e-5)
    assert data.stress_unit == "kPa"


def test_the_steps_tell_where_the_dimensions_come_from(tmp_path):
    steps = read_file(zwick().written(tmp_path)).used.steps
    assert "column 'Standardweg' in mm (from the file) / 25 mm (length in line 4)" in steps[0]
    assert "6.2 mm2 (width 4 mm in line 3 and thickness 1.55 mm in line 2)" in steps[1]
    assert steps[-1] == "80 rows (lines 9 to 88)"


def test_a_given_dimension_goes_before_the_files_and_the_contradiction_is_told(tmp_path):
    file = instron()
    reading = read_file(file.written(tmp_path), dimensions={"area": "20 mm2", "length": "20.0 mm"})
    np.testing.assert_allclose(reading.experiment.stress, file.stress / 2, atol=1e-5)
    assert reading.doubts == (
        "the cross-section is 20 mm2 (as given), but the file says 10 mm2 (width 5 mm in line 3 and thickness 2 mm in "
        "line 4).",
    )


def test_one_part_of_a_cross_section_may_be_given_and_the_other_stated(tmp_path):
    file = instron()
    with pytest.warns(UserWarning, match="thickness 4 mm as given"):
        data = read_experiment(file.written(tmp_path), dimensions={"thickness": "4 mm"})
    np.testing.assert_allclose(data.stress, file.stress / 2, atol=1e-5)


@pytest.mark.parametrize(
    ("dimensions", "words"),
    [
        ({"length": "10 mm"}, 'undeformed cross-section: area (--area "10 mm2"), or width and thickness'),
        ({"length": "10 mm", "width": "5 mm"}, "The width is known, so that the thickness is enough"),
        ({"area": "6 mm2"}, 'give the undeformed length (--length "20 mm"'),
        ({"area": "6 mm2", "length": "20"}, "the length '20' has no unit"),
        ({"area": "6 mm2", "length": "20 s"}, "'s' is not a unit of length; write one of mm, cm"),
        ({"area": "6 mm2", "length": "-2 mm"}, "'-2 mm' is not a length; write a positive number"),
        ({"area": "6 mm2", "diameter": "2 mm"}, "give the cross-section in one way"),
        ({"height": "6 mm"}, "there is no dimension 'height'; give area, width, thickness, diameter, length"),
    ],
)
def test_dimensions_that_are_missing_or_wrong_are_asked_for(tmp_path, dimensions, words):
    assert words in message(wintest().written(tmp_path), dimensions=dimensions)


def test_two_lengths_in_one_file_are_asked_about(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("Gauge length (mm),10\nGrip separation,20,mm\nArea,2,mm²\nDisp (mm),Load (N)\n0,0\n1,2\n")
    text = message(path)
    assert "two lengths: 10 mm in line 1 and 20 mm in line 2. Say which: --length" in text
    with pytest.warns(UserWarning, match="the file says 10 mm"):
        data = read_experiment(path, dimensions={"length": "20 mm"})
    assert (data.stretch.tolist(), data.stress.tolist()) == ([1.0, 1.05], [0.0, 1.0])


def test_dimensions_that_are_not_needed_may_be_unclear(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text(
        "Gauge length (mm),10\nGrip separation,20,mm\nWidth,2,mm\nWidth,3,mm\nstrain,stress [kPa]\n0,0\n1,2\n"
    )
    assert read_experiment(path).stretch.tolist() == [1.0, 2.0]


def test_sections_of_the_file_that_contradict_each_other_are_asked_about(tmp_path):
    path = text_file(tmp_path / "test.csv", "Length,10,mm\nArea,2,mm2\nDiameter,4,mm\nDisp (mm),Load (N)\n0,0\n1,2")
    assert "could be 2 mm2 (in line 2) or 12.5664 mm2 (diameter 4 mm in line 3)" in message(path)


@pytest.mark.parametrize(
    ("unit", "factor"), [("N", 1), ("mN", 1e-3), ("kN", 1e3), ("gf", 9.80665e-3), ("uN", 1e-6), ("µN", 1e-6)]
)
def test_forces_are_read_in_their_unit(tmp_path, unit, factor):
    path = text_file(tmp_path / "test.csv", f"Disp [µm],Load [{unit}]\n0,0\n1000,3")
    data = read_experiment(path, dimensions={"length": "1 cm", "diameter": "2 mm"})
    np.testing.assert_allclose(data.stress, [0, 3 * factor / np.pi], rtol=1e-14)
    np.testing.assert_allclose(data.stretch, [1, 1.1], rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("Disp [mm],Load [g]\n", {}, "column 'Load [g]': 'g' is a mass, not a force; if the unit of force is meant"),
        ("Disp [mm],Load (grams)\n", {}, "write gf. To say it yourself, give force_unit (--force-unit gf)"),
        ("Disp [mm],Load\nmm,Pounds\n", {}, "write lbf. To say it yourself, give force_unit (--force-unit lbf)"),
        ("Disp [mm],Load\n", {}, "column 'Load': the file states no unit of force; give force_unit (--force-unit N)"),
        ("Disp,Load [N]\n", {}, "states no unit of length; give displacement_unit (--displacement-unit mm)"),
        ("Disp [mm],Load [N]\n", {"force_unit": "kN"}, "force_unit='kN' is given, but the file says 'N'"),
        ("Disp [mm],Load [N]\n", {"stress_type": "cauchy"}, "holds forces, which over the undeformed cross-section"),
        ("Disp [mm],Stress [kPa]\n", {}, "is read as stress, which needs no area"),
        ("Strain [%],Load [N]\n", {}, "is read as strain, which needs no length"),
        ("Strain [%],Load [N]\n", {"displacement_unit": "mm"}, "read as strain, but displacement_unit='mm' is given"),
    ],
)
def test_units_and_options_that_do_not_fit_the_columns_are_refused(tmp_path, text, options, words):
    path = text_file(tmp_path / "test.csv", text + "0,0\n1,2\n")
    assert words in message(path, dimensions={"length": "10 mm", "area": "2 mm2"}, **options)


def test_stress_goes_before_force_and_strain_before_displacement(tmp_path):
    path = text_file(tmp_path / "test.csv", "Weg [mm];Dehnung [%];Kraft [N];Spannung [MPa]\n0;0;0;0\n1;10;2;0,5")
    data = read_experiment(path)
    assert (data.stretch.tolist(), data.stress.tolist()) == ([1.0, 1.1], [0.0, 0.5])


def test_compression_is_asked_about_where_a_name_says_it(tmp_path):
    file = instron_compression()
    text = message(file.written(tmp_path), dimensions={"length": "5 mm"})
    assert "line 54, column 'Compressive extension (mm)'" in text
    assert "--compression-positive" in text


@pytest.mark.parametrize("sign", [1, -1])
def test_positive_displacements_in_compression_change_their_sign_whatever_that_of_the_force(tmp_path, sign):
    path = text_file(tmp_path / "test.csv", f"Disp [mm],Load [N]\n0,0\n1,{sign * 2}")
    options = {"dimensions": {"length": "10 mm", "area": "2 mm2"}, "compression_positive": True}
    data = read_experiment(path, **options)
    check_curve(data, [1.0, 0.9], [0.0, -1.0])


def test_a_biaxial_file_is_of_both_axes_unless_another_mode_asks_for_one(tmp_path):
    path = biotester().written(tmp_path)
    assert read_file(path, dimensions={"thickness": "0.8 mm"}).mode_source == "columns of both axes"
    text = message(path, mode="equibiaxial")
    assert "axis='x' (--axis x)" in text
    assert "both at once: mode='biaxial' (--mode biaxial)" in text
    assert "no columns of an axis 'x'" in message(instron().written(tmp_path), axis="x")
    assert "axis must be one of x, y, not 'z'" in message(path, axis="z")


def test_a_biaxial_files_other_axis_has_its_own_length(tmp_path):
    section = {"width": "5 mm", "thickness": "0.8 mm"}
    reading = read_file(biotester().written(tmp_path), axis="y", mode="equibiaxial", dimensions=section)
    assert "5.1 mm (length from column 'YSize_um' less the displacement)" in reading.used.steps[0]
    assert [cycle.label for cycle in reading.cycles] == ["Precondition 1", "Precondition 2", "Test 1 1"]


def test_the_length_is_the_size_less_the_displacement_at_the_first_row(tmp_path):
    """A record that begins 0.5 mm after the reference, at a size of 10.5 mm."""
    path = tmp_path / "univertData.csv"
    path.write_text("Time_S,Size_mm,Displacement_mm,Force_N\n0,10.5,0.5,1\n1,11,1,2\n2,12,2,4\n")
    data = read_experiment(path, dimensions={"area": "2 mm2"})
    check_curve(data, [1.05, 1.1, 1.2], [0.5, 1.0, 2.0])


def test_a_size_that_is_not_needed_is_not_used(tmp_path):
    file = univert()
    data = read_experiment(file.written(tmp_path), dimensions={"area": "12 mm2", "length": "30 mm"})
    np.testing.assert_allclose(data.stretch, 1 + (file.stretch - 1) / 2, atol=1e-6)


def test_a_table_of_results_is_passed_over_only_for_a_far_longer_one(tmp_path):
    head = "Maximum strain,Maximum stress\n0.5,2.5\n\nstrain,stress [MPa]\n"
    path = text_file(tmp_path / "test.csv", head + "".join(f"{k / 100},{k / 50}\n" for k in range(30)))
    assert len(read_experiment(path)) == 30
    path.write_text(head + "0.0,0.0\n0.1,0.5\n")
    assert "no column is recognised" in message(path)
