"""Files that count compression as positive: what is read is the stress of a neo-Hookean specimen, tension positive."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError
from written_files import check_curve, text_file, written

LENGTH, AREA = 20.0, 300.0
BOTH_WAYS = np.concatenate([np.linspace(1, 1.15, 30), np.linspace(1.15, 0.85, 60)])
COMPRESSION = np.concatenate([np.ones(20), np.linspace(1, 0.7, 60)])
SIZES = {"length": "20 mm", "area": "300 mm2"}


def read(folder, name, deformation, force, **options):
    path = written(folder, f"{name},Normal Force (N)", deformation, force)
    dimensions = {"area": SIZES["area"]} if name.startswith("Gap") else SIZES
    return tq.read_experiment(path, dimensions=dimensions, **options)


@pytest.mark.parametrize("stretch", [BOTH_WAYS, COMPRESSION], ids=["both ways", "compression"])
@pytest.mark.parametrize("preload", [0.0, -0.0008], ids=["free", "preloaded"])
@pytest.mark.parametrize(
    ("name", "deformation"),
    [
        ("Gap (mm)", lambda stretch: LENGTH * stretch),
        ("Displacement (mm)", lambda stretch: LENGTH * (stretch - 1)),
        ("Displacement (mm)", lambda stretch: LENGTH * (1 - stretch)),
    ],
    ids=["gap", "displacement", "displacement of the plate"],
)
def test_a_load_that_counts_compression_as_positive_is_turned_as_a_whole(tmp_path, name, deformation, stretch, preload):
    # Rows at rest, of a preload, and those in tension change their sign, too.
    stress = neo_hookean(stretch) + preload
    data = read(tmp_path, name, deformation(stretch), -AREA * stress, compression_positive=True)
    check_curve(data, stretch, stress, atol=1e-8)


@pytest.mark.parametrize("name", ["Gap (mm)", "Displacement (mm)"])
def test_amounts_of_the_load_change_their_sign_in_compression_alone(tmp_path, name):
    stress = neo_hookean(BOTH_WAYS)
    deformation = LENGTH * (BOTH_WAYS - (not name.startswith("Gap")))
    data = read(tmp_path, name, deformation, np.abs(AREA * stress), compression_positive=True)
    np.testing.assert_allclose(data.stress, stress, atol=1e-8)


def test_a_gap_with_tension_positive_is_not_turned(tmp_path):
    force = AREA * neo_hookean(BOTH_WAYS)
    with pytest.raises(InputError, match=r"already negative in the file\. Leave out"):
        read(tmp_path, "Gap (mm)", LENGTH * BOTH_WAYS, force, compression_positive=True)


TENSION = np.linspace(1, 1.3, 40)


@pytest.mark.parametrize(("turn", "sign", "sign_of_load"), [("load", 1, -1), ("deformation", -1, 1), ("both", -1, -1)])
@pytest.mark.parametrize("stretch", [TENSION, BOTH_WAYS], ids=["tension", "both ways"])
def test_signs_are_turned_as_asked(tmp_path, turn, sign, sign_of_load, stretch):
    stress = neo_hookean(stretch)
    deformation, force = sign * LENGTH * (stretch - 1), sign_of_load * AREA * stress
    data = read(tmp_path, "Displacement (mm)", deformation, force, turn=turn)
    check_curve(data, stretch, stress, atol=1e-8)


@pytest.mark.parametrize("name", ["Displacement (mm)", "Stretch"])
def test_the_message_on_tension_with_negative_loads_names_the_option_that_reads_it(tmp_path, name):
    stress = neo_hookean(TENSION)
    deformation = TENSION if name == "Stretch" else LENGTH * (TENSION - 1)
    path = written(tmp_path, f"{name},Force (N)", deformation, -AREA * stress)
    sizes = {"area": "300 mm2"} if name == "Stretch" else SIZES
    with pytest.raises(InputError, match=r"turn='load' \(--turn load\)"):
        tq.read(path, dimensions=sizes)
    np.testing.assert_allclose(tq.read(path, dimensions=sizes, turn="load").stress, stress, atol=1e-8)


def test_shear_of_the_other_sign_is_turned(tmp_path):
    shear = np.linspace(0, 0.4, 30)
    path = written(tmp_path, "Shear,Stress (kPa)", shear, -40 * shear)
    with pytest.raises(InputError, match=r"turn='load' \(--turn load\)"):
        tq.read(path, mode="simple-shear")
    for turn, sign in (("load", 1), ("deformation", -1)):
        data = tq.read(path, mode="simple-shear", turn=turn)
        check_curve(data, sign * shear, sign * 0.04 * shear, atol=1e-12)


def test_both_loads_of_a_sheet_are_turned(tmp_path):
    stress = 0.04 * (TENSION - TENSION**-5)
    columns = [TENSION, -1e3 * stress, TENSION, -1e3 * stress]
    path = written(tmp_path, "stretch x,stress x (kPa),stretch y,stress y (kPa)", *columns)
    with pytest.raises(InputError, match=r"turn='load' \(--turn load\)"):
        tq.read(path)
    np.testing.assert_allclose(tq.read(path, turn="load").stress, np.column_stack([stress, stress]), atol=1e-9)
    with pytest.raises(InputError, match=r"turn='load' \(--turn load\)"):
        tq.read(path, compression_positive=True)
    path.write_text("\n".join(line.replace("-", "", 1) for line in path.read_text().splitlines()))
    with pytest.raises(InputError, match="The other axis has the right sign: change that of this column in the file"):
        tq.read(path)


def test_positions_whose_load_does_not_begin_at_zero_are_read_by_the_zero_of_the_load(tmp_path):
    stress = neo_hookean(TENSION)
    path = written(tmp_path, "Position (mm),Force (N)", 35 + LENGTH * (TENSION - 1), AREA * (stress + 0.01))
    with pytest.raises(InputError, match="--load-zero first"):
        tq.read(path, dimensions=SIZES)
    data = tq.read(path, dimensions=SIZES, load_zero="first")
    check_curve(data, TENSION, stress, atol=1e-8)


def test_negative_numbers_of_a_test_that_is_called_tension_are_asked_about(tmp_path):
    columns = -LENGTH * (TENSION - 1), -AREA * neo_hookean(TENSION)
    path = written(tmp_path, "Displacement (mm),Force (N)", *columns, name="tension.csv")
    with pytest.raises(InputError, match=r"turn='both' \(--turn both\).*--tension-positive"):
        tq.read(path, dimensions=SIZES)
    np.testing.assert_allclose(tq.read(path, dimensions=SIZES, turn="both").stretch, TENSION, atol=1e-8)
    assert tq.read(path, dimensions=SIZES, compression_positive=False).stretch.max() == 1


DISC = "Durchmesser;20,61;mm\nProbenhöhe;9,23;mm\n"
BLOCK = "Breite;12,0;mm\nDicke;11,0;mm\nMesslänge;9,23;mm\n"
SECTION = "Fläche;333,6;mm2\nMesslänge;9,23;mm\n"


@pytest.mark.parametrize(
    ("head", "area"),
    [(DISC, np.pi / 4 * 20.61**2), (BLOCK, 132.0), (SECTION, 333.6)],
    ids=["disc", "block", "area alone"],
)
def test_positive_numbers_of_a_specimen_broader_than_long_are_asked_about(tmp_path, head, area):
    columns = 9.23 * (1 - COMPRESSION), -area * neo_hookean(COMPRESSION)
    rows = [f"{d:.9f};{f:.9f}".replace(".", ",") for d, f in zip(*columns, strict=True)]
    path = text_file(tmp_path / "Leber.csv", f"{head}Weg (mm);Kraft (N)", *rows)
    with pytest.raises(InputError, match=r"broader \(.* than long \(9.23 mm\).*--compression-positive.*--tension-pos"):
        tq.read(path)
    sizes = {"length": "9.23 mm", "area": f"{area} mm2"}
    data = tq.read(path, compression_positive=True, dimensions=sizes)
    check_curve(data, COMPRESSION, neo_hookean(COMPRESSION), atol=1e-8)
    assert tq.read(path, compression_positive=False).stretch.max() == pytest.approx(1.3)
    path.with_name("Zugversuch.csv").write_text(path.read_text())
    assert tq.read(path.with_name("Zugversuch.csv")).stretch.max() == pytest.approx(1.3)
    path.write_text(path.read_text().replace("9,23;mm", "30,0;mm"))
    assert tq.read(path).stretch.max() > 1


def test_what_cannot_be_turned_and_a_turn_that_is_wrong_are_refused(tmp_path):
    stress = neo_hookean(TENSION)
    with pytest.raises(InputError, match=r"turn \(--turn\) must be one of load, deformation, both"):
        read(tmp_path, "Displacement (mm)", TENSION - 1, stress, turn="stress")
    with pytest.raises(InputError, match="give one of them"):
        read(tmp_path, "Displacement (mm)", TENSION - 1, stress, turn="load", compression_positive=True)
    with pytest.raises(InputError, match=r"--turn load: turn others, or leave it out"):
        read(tmp_path, "Displacement (mm)", LENGTH * (TENSION - 1), AREA * stress, turn="load")
    with pytest.raises(InputError, match=r"has no other sign: turn the load alone"):
        read(tmp_path, "Gap (mm)", LENGTH * TENSION, -AREA * stress, turn="both")


@pytest.mark.parametrize(
    ("load_zero", "unit", "scale"),
    [("first", "N", 1.0), ("0.5 N", "N", 1.0), ("500 mN", "N", 1.0), ("0.5 N", "mN", 1e3), ("first", "mN", 1e3)],
)
def test_what_a_load_cell_reads_without_load_is_taken_off(tmp_path, load_zero, unit, scale):
    stress = neo_hookean(TENSION)
    columns = LENGTH * (TENSION - 1), scale * (AREA * stress + 0.5)
    path = written(tmp_path, f"Displacement (mm),Force ({unit})", *columns)
    data = tq.read(path, dimensions=SIZES, load_zero=load_zero)
    np.testing.assert_allclose(data.stress, stress, atol=1e-8)
    assert "counted from" in data.source


def test_the_zero_of_stresses_is_taken_off_and_inspect_proposes_it(tmp_path):
    stress = neo_hookean(TENSION)
    path = written(tmp_path, "Stretch,Stress (kPa)", TENSION, 1e3 * stress + 6)
    assert "--load-zero first takes off" in " ".join(str(tq.inspect(path)).split())
    for load_zero in ("first", "6 kPa", "0.006 MPa"):
        np.testing.assert_allclose(tq.read(path, load_zero=load_zero).stress, stress, atol=1e-9)
    for wrong in ("6", "six", "6 N", "6 mm"):
        with pytest.raises(InputError, match=r"load_zero \(--load-zero\) must be 'first', or a stress"):
            tq.read(path, load_zero=wrong)


@pytest.mark.parametrize(
    ("above", "names"),
    [
        ("", "Strain (compression) [%],Stress [kPa]"),
        ("", "Axial compressive strain [%],Stress [kPa]"),
        ("", "Compr. strain [%],Compr. stress [kPa]"),
        ("Method: unconfined compression\nSample: 3\n", "Strain [%],Stress [kPa]"),
        ("Art: Druckversuch\nProbe: 3\n", "Dehnung [%],Spannung [kPa]"),
        ("Method: compr.\nSample: 3\n", "Strain [%],Stress [kPa]"),
    ],
)
def test_compression_that_is_written_positive_is_asked_about_wherever_the_file_says_it(tmp_path, above, names):
    stretch = np.linspace(1, 0.7, 40)
    path = written(tmp_path, f"{above}{names}", 100 * (1 - stretch), -1e3 * neo_hookean(stretch))
    with pytest.raises(InputError, match=r"compression.*--compression-positive"):
        tq.read(path)
    data = tq.read(path, compression_positive=True)
    check_curve(data, stretch, neo_hookean(stretch), atol=1e-9)


@pytest.mark.parametrize("above", ["", "Frame: tension and compression\n", "Extension rate: 1 mm/min\n"])
def test_where_nothing_says_compression_positive_strains_are_those_of_tension(tmp_path, above):
    path = written(tmp_path, f"{above}Strain,Stress [kPa]", TENSION - 1, 1e3 * neo_hookean(TENSION))
    np.testing.assert_allclose(tq.read(path).stretch, TENSION, atol=1e-9)
