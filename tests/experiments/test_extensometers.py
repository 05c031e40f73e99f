"""An extensometer or a camera beside the displacement of the machine: which is read is asked, and both can be."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError
from written_files import check_curve, text_file, written

STRETCH = np.linspace(1, 1.3, 50)
SIZES = {"length": "10 mm", "area": "6 mm2"}
MACHINE_STRAIN = 1.5
"""Displacement of the machine over that of the specimen, whose grips slip."""


def of_both(folder, machine, local):
    strain = STRETCH - 1
    values = 100 * strain if "%" in local else 10 * strain
    columns = 10 * MACHINE_STRAIN * strain, values, 6 * neo_hookean(STRETCH)
    return written(folder, f"{machine},{local},Load (N)", *columns)


@pytest.mark.parametrize("machine", ["Crosshead (mm)", "Extension (mm)"])
@pytest.mark.parametrize(
    ("local", "role"),
    [
        ("Extensometer (mm)", "displacement"),
        ("Video extension (mm)", "displacement"),
        ("LVDT (mm)", "displacement"),
        ("EXT1 (mm)", "displacement"),
        ("Ext.1 (mm)", "displacement"),
        ("Displacement (Strain 1) (mm)", "displacement"),
        ("AVE2 (%)", "strain"),
        ("Video Axial Strain (%)", "strain"),
        ("Optical strain (%)", "strain"),
        ("Dehnung Feinwegaufnehmer (%)", "strain"),
    ],
)
def test_the_measurement_on_the_specimen_is_offered_in_the_form_that_reads_it(tmp_path, machine, local, role):
    path = of_both(tmp_path, machine, local)
    with pytest.raises(InputError, match="They give different stretches") as error:
        tq.read_experiment(path, dimensions=SIZES)
    assert f'--column {role}="{local}"' in str(error.value)
    assert f'--column displacement="{machine}"' in str(error.value)
    sizes = SIZES if role == "displacement" else {"area": SIZES["area"]}
    of_specimen = tq.read_experiment(path, dimensions=sizes, columns={role: local})
    np.testing.assert_allclose(of_specimen.stretch, STRETCH, atol=1e-8)
    of_machine = tq.read_experiment(path, dimensions=SIZES, columns={"displacement": machine})
    np.testing.assert_allclose(of_machine.stretch - 1, MACHINE_STRAIN * (STRETCH - 1), atol=1e-8)


def test_an_extensometer_beside_the_machine_is_asked_about_in_each_of_several_tests(tmp_path):
    """As software of Shimadzu writes them beside one another, under the names of the specimens."""
    strain = STRETCH - 1
    columns = (np.arange(50.0), 6 * neo_hookean(STRETCH), 10 * MACHINE_STRAIN * strain, 10 * strain)
    rows = [",".join([f'"{value:.9f}"' for value in row] * 2) for row in zip(*columns, strict=True)]
    heads = ['"Disc A",,,,"Disc B",,,', ",".join(['"Time","Force","Stroke","Ext.1"'] * 2)]
    path = text_file(tmp_path / "several.csv", *heads, ",".join(['"sec","N","mm","mm"'] * 2), *rows)
    with pytest.raises(InputError, match=r'or --column displacement="Ext.1" --column force="Force"\.') as error:
        tq.read_tests(path, dimensions=SIZES)
    assert str(error.value).count("'Ext.1'") == 1
    tests = tq.read_tests(path, dimensions=SIZES, columns={"displacement": "Ext.1", "force": "Force"})
    assert [test.name for test in tests] == ["Disc A", "Disc B"]
    for test in tests:
        np.testing.assert_allclose(test.stretch, STRETCH, atol=1e-8)


def test_the_strain_of_an_extensometer_beside_that_of_the_machine_is_asked_about(tmp_path):
    columns = MACHINE_STRAIN * (STRETCH - 1), STRETCH - 1, 1e3 * neo_hookean(STRETCH)
    path = written(tmp_path, "Strain (mm/mm),Strain Ex1 (mm/mm),Stress (kPa)", *columns)
    with pytest.raises(InputError, match="They give different stretches") as error:
        tq.read(path)
    assert '--column strain="Strain Ex1 (mm/mm)"' in str(error.value)
    np.testing.assert_allclose(tq.read(path, columns={"strain": "Strain Ex1 (mm/mm)"}).stretch, STRETCH, atol=1e-8)


@pytest.mark.parametrize("local", ["Temperature (C)", "Gauge length (mm)"])
def test_what_is_no_deformation_raises_no_question(tmp_path, local):
    path = of_both(tmp_path, "Crosshead (mm)", "Extensometer (mm)")
    lines = path.read_text().replace("Extensometer (mm)", local).splitlines()
    rows = [f"{a},20.0,{c}" for a, _, c in (line.split(",") for line in lines[1:])]
    path.write_text("\n".join([lines[0], *rows]))
    data = tq.read_experiment(path, dimensions=SIZES)
    np.testing.assert_allclose(data.stretch - 1, MACHINE_STRAIN * (STRETCH - 1), atol=1e-8)


DISTANCE = 812.0
"""Of the undeformed marks, px."""


@pytest.mark.parametrize(
    "name", ["Marker distance (px)", "Distance [pixels]", "Video extensometer (px)", "Markerabstand / Pixel", "d [px]"]
)
@pytest.mark.parametrize("stated", ["", "812 px", "812 pixel"])
def test_distances_of_marks_in_pixels_over_the_undeformed_one_are_stretches(tmp_path, name, stated):
    stretch = np.linspace(1, 1.3, 40)
    columns = DISTANCE * stretch, 10 * 0.05 * (stretch - stretch**-2)
    path = written(tmp_path, f"{name};Force (N)", *columns, separator=";")
    data = tq.read(path, area="10 mm2", length=stated or None)
    check_curve(data, stretch, columns[1] / 10, rtol=1e-9, stress_atol=1e-9)
    assert f"/ 812 px (undeformed: {'as given' if stated else 'in its first row'})" in data.source


def test_distances_in_pixels_that_begin_under_load_are_asked_about_and_the_advice_reads_them(tmp_path):
    stretch = np.linspace(1.1, 1.3, 40)
    columns = DISTANCE * stretch, 10 * 0.05 * (stretch - stretch**-2)
    path = written(tmp_path, "Gauge length: 20 mm\nMarks (px);Force (N)", *columns, separator=";")
    with pytest.raises(
        InputError, match=r"with 3\d % of the largest load. Give the undeformed distance in pixels: --length"
    ):
        tq.read(path, area="10 mm2")
    np.testing.assert_allclose(tq.read(path, area="10 mm2", length="812 px").stretch, stretch, rtol=1e-9)
    with pytest.raises(InputError, match=r'so must be the undeformed one: give it as --length "893.2 px"'):
        tq.read(path, area="10 mm2", length="20 mm")


def test_pixels_beside_the_displacement_of_the_machine_are_asked_about(tmp_path):
    stretch = np.linspace(1, 1.3, 40)
    columns = 25 * (stretch - 1), DISTANCE * stretch, 10 * 0.05 * (stretch - stretch**-2)
    path = written(tmp_path, "Displacement (mm),Marker distance (px),Force (N)", *columns)
    with pytest.raises(InputError, match=r'--column length="Marker distance \(px\)"'):
        tq.read(path, area="10 mm2", length="20 mm")
    data = tq.read(path, area="10 mm2", columns={"length": "Marker distance (px)"})
    np.testing.assert_allclose(data.stretch, stretch, rtol=1e-9)
    with pytest.raises(InputError, match=r"read as --column length=NAME"):
        tq.read(path, area="10 mm2", columns={"displacement": "Marker distance (px)"}, length="20 mm")
