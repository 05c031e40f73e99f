"""Deformations that a file holds twice, of machine and specimen, are asked about; tabs part numbered names."""

import re

import numpy as np
import pytest

import tissuq as tq
from written_files import by_name, check_curve, written

LENGTH, AREA = 20.0, 10.0  # mm, mm2
STRAIN = np.linspace(0, 0.3, 31)
STRETCH = 1 + STRAIN
STRESS = 2 * 0.05 * (STRETCH - STRETCH**-2)  # MPa
SIZES = {"length": f"{LENGTH:g} mm", "area": f"{AREA:g} mm2"}


def asked(path, **options):
    with pytest.raises(tq.InputError, match="measured on the specimen") as error:
        tq.read(path, **options)
    return re.findall(r'--column (\w+)="([^"]+)"', str(error.value))


@pytest.mark.parametrize(
    ("name", "role", "values"),
    [
        ("Local strain (%)", "strain", 100 * STRAIN),
        ("Strain_yy VIC", "strain", STRAIN),
        ("DIC exx", "strain", STRAIN),
        ("eps_yy [1] - Engineering", "strain", STRAIN),
        ("Optical stretch", "stretch", STRETCH),
    ],
)
def test_a_strain_of_the_specimen_beside_the_crosshead_is_asked_about(tmp_path, name, role, values):
    crosshead = 1.4 * LENGTH * STRAIN  # the grips slip, so that the machine moves farther
    path = by_name(tmp_path, **{"Crosshead (mm)": crosshead, "Load (N)": STRESS * AREA, name: values})
    choices = asked(path, **SIZES)
    assert choices == [("displacement", "Crosshead (mm)"), (role, name)]
    specimen = tq.read(path, columns=dict([choices[1]]), area=SIZES["area"])
    check_curve(specimen, STRETCH, STRESS, rtol=1e-5, stress_atol=1e-9)
    machine = tq.read(path, columns=dict([choices[0]]), **SIZES)
    np.testing.assert_allclose(machine.stretch, 1 + 1.4 * STRAIN, rtol=1e-5)


@pytest.mark.parametrize(("first", "second"), [("Strain", "DIC strain"), ("Strain (%)", "Optical strain (%)")])
def test_two_strains_of_which_one_is_of_a_camera_are_asked_about(tmp_path, first, second):
    scale = 100 if "%" in first else 1
    columns = {first: 1.4 * scale * STRAIN, second: scale * STRAIN, "Stress (kPa)": 1000 * STRESS}
    path = by_name(tmp_path, **columns)
    assert asked(path) == [("strain", first), ("strain", second)]
    np.testing.assert_allclose(tq.read(path, columns={"strain": second}).stretch, STRETCH, rtol=1e-5)
    path = by_name(tmp_path, **columns | {first: scale * STRAIN})
    np.testing.assert_allclose(tq.read(path).stretch, STRETCH, rtol=1e-5)


def test_strains_across_the_test_and_its_limits_are_not_asked_about(tmp_path):
    columns = {"Crosshead (mm)": LENGTH * STRAIN, "Load (N)": STRESS * AREA, "Lateral strain (%)": -40 * STRAIN}
    path = by_name(tmp_path, **columns)
    np.testing.assert_allclose(tq.read(path, **SIZES).stretch, STRETCH, rtol=1e-5)


@pytest.mark.parametrize(
    "names", [("Time", "Extension 1", "Load 1"), ("Elapsed Time", "Scan 2 Displacement", "Load 1")]
)
def test_tabs_part_names_with_numbers_over_a_row_of_units(tmp_path, names):
    head = "\t".join(names) + "\ns\tmm\tN"
    path = written(tmp_path, head, STRAIN, LENGTH * STRAIN, STRESS * AREA, separator="\t", name="test.txt")
    experiment = tq.read(path, columns={"displacement": names[1], "force": names[2]}, **SIZES)
    check_curve(experiment, STRETCH, STRESS, rtol=1e-5, stress_atol=1e-9)


def test_of_a_load_and_an_extension_with_and_without_correction_the_corrected_ones_are_read_and_said(tmp_path):
    extension, force = STRAIN * LENGTH, STRESS * AREA
    columns = {
        "Extension (mm)": 1.05 * extension,
        "Corrected extension (mm)": extension,
        "Load (N)": force + 0.1,
        "Compliance corrected load (N)": force,
    }
    path = by_name(tmp_path, **columns)
    with pytest.warns(UserWarning, match=r"'Corrected extension \(mm\)' is read, and not 'Extension \(mm\)' beside it"):
        data = tq.read(path, dimensions=SIZES)
    check_curve(data, STRETCH, STRESS, stress_atol=1e-7)
    with pytest.warns(UserWarning, match=r"'Load \(N\)' is read, and not 'Compliance corrected load \(N\)'"):
        data = tq.read(path, dimensions=SIZES, force="Load (N)")
    np.testing.assert_allclose(data.stress, STRESS + 0.1 / AREA, atol=1e-7)


def test_a_corrected_column_alone_is_read_without_a_word(tmp_path, recwarn):
    path = by_name(tmp_path, **{"Corrected extension (mm)": STRAIN * LENGTH, "Load (N)": STRESS * AREA})
    np.testing.assert_allclose(tq.read(path, dimensions=SIZES).stretch, STRETCH, rtol=1e-6)
    assert not list(recwarn)
