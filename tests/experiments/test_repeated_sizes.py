"""Sizes of several specimens over their columns, and several measurements of one size: the true curves are read."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from written_files import check_curve, written

L = ramp()
P = neo_hookean(L)
LENGTHS, WIDTHS, THICKNESSES = (20.0, 25.0, 16.0), (5.0, 4.0, 6.0), (1.2, 1.0, 1.5)
MOVED = [(L - 1) * length for length in LENGTHS]
FORCES = [P * width * thickness for width, thickness in zip(WIDTHS, THICKNESSES, strict=True)]
EACH = [column for pair in zip(MOVED, FORCES, strict=True) for column in pair]


def with_sizes(folder, head, columns, separator=","):
    return written(folder, "\n".join(head), *columns, separator=separator)


def check(tests, names=("S1", "S2", "S3"), stretch=L, stress=P):
    assert [test.name.upper() for test in tests] == list(names)
    for test in tests:
        check_curve(test, stretch, stress, rtol=1e-6, stress_atol=1e-9)


def apart(name, values):
    return f"{name},{values[0]},,{values[1]},,{values[2]}"


def beside_labels(name, values, empty=""):
    return ",".join(f"{empty}{name} (mm),{value}" for value in values)


def test_values_stand_over_the_columns_of_their_tests(tmp_path):
    sizes = {"Length (mm)": LENGTHS, "Width (mm)": WIDTHS, "Thickness (mm)": THICKNESSES}
    head = [",S1,,S2,,S3,", *(apart(*size) for size in sizes.items()), "," + ",".join(["Disp (mm),Load (N)"] * 3)]
    check(tq.read_tests(with_sizes(tmp_path, head, [0 * L, *EACH])))


@pytest.mark.parametrize("columns", ["Extension (mm),Load (N)", "Load (N),Extension (mm)"])
def test_each_value_may_have_its_own_label_whichever_column_comes_first(tmp_path, columns):
    sizes = {"Width": WIDTHS, "Thickness": THICKNESSES, "Length": LENGTHS}
    head = ["S1,,S2,,S3,", *(beside_labels(*size) for size in sizes.items()), ",".join([columns] * 3)]
    each = EACH if columns.startswith("Ext") else [column for k in range(3) for column in (FORCES[k], MOVED[k])]
    check(tq.read_tests(with_sizes(tmp_path, head, each)))


def test_each_value_may_stand_in_one_cell_with_its_label(tmp_path):
    head = ["S1,,S2,,S3,"]
    for name, unit, values in (("L0", "mm", LENGTHS), ("Width", "mm", WIDTHS), ("Thickness", "mm", THICKNESSES)):
        head.append(",,".join(f"{name} = {value} {unit}" for value in values) + ",")
    check(tq.read_tests(with_sizes(tmp_path, [*head, ",".join(["Disp (mm),Load (N)"] * 3)], EACH)))


def test_sizes_named_after_tests_are_theirs(tmp_path):
    sizes = {"Length": LENGTHS, "Width": WIDTHS, "Thickness": THICKNESSES}
    head = [f"{name} S{k + 1} (mm),{size[k]}" for name, size in sizes.items() for k in range(3)]
    check(tq.read_tests(with_sizes(tmp_path, [*head, "S1,,S2,,S3,", ",".join(["Disp (mm),Load (N)"] * 3)], EACH)))


def test_forces_beside_one_displacement_have_their_own_sizes(tmp_path):
    moved = np.linspace(0, 4, 50)
    stretches = [1 + moved / length for length in LENGTHS]
    forces = [neo_hookean(s) * w * t for s, w, t in zip(stretches, WIDTHS, THICKNESSES, strict=True)]
    head = [
        "Length (mm),20,25,16",
        "Width (mm),5,4,6",
        "Thickness (mm),1.2,1,1.5",
        "Displacement (mm),Force S1 (N),Force S2 (N),Force S3 (N)",
    ]
    for test, stretch in zip(tq.read_tests(with_sizes(tmp_path, head, [moved, *forces])), stretches, strict=True):
        check([test], [test.name.upper()], stretch, neo_hookean(stretch))


def test_values_that_stand_over_no_test_are_asked_about(tmp_path):
    head = ["S1,,S2,,S3,", "Length (mm),20,25,16", ",".join(["Disp (mm),Load (N)"] * 3)]
    path = with_sizes(tmp_path, head, EACH)
    with pytest.raises(InputError, match=r"several lengths: 20 mm .* 25 mm .* 16 mm .*FILE#NAME"):
        tq.read_tests(path, area="6 mm2")


def test_sizes_numbered_as_the_tests_are_theirs(tmp_path):
    numbers = (1, 2, 3)
    sizes = {"Length": LENGTHS, "Width": WIDTHS, "Thickness": THICKNESSES}
    head = [f"{name} {k} (mm),{size[k - 1]}" for name, size in sizes.items() for k in numbers]
    head.append(",".join(f"Disp_{k} (mm),Load_{k} (N)" for k in numbers))
    check(tq.read_tests(with_sizes(tmp_path, head, EACH)), ("1", "2", "3"))


@pytest.mark.parametrize(
    "head",
    [
        ["Gauge length 1 (mm),20", "Width 1 (mm),5", "Thickness 1 (mm),1.2"],
        ["Gauge length #1: 20 mm", "Width #1: 5 mm", "Thickness1 (mm): 1.2"],
        ["Messlänge 1 [mm],20", "Breite 1 [mm],5", "Dicke_1 [mm],1.2"],
    ],
)
def test_the_number_of_a_size_is_not_its_value(tmp_path, head):
    check([tq.read(with_sizes(tmp_path, [*head, "Disp (mm),Load (N)"], EACH[:2]))], ["TEST"])


@pytest.mark.parametrize(
    "thickness",
    [
        ["Thickness 1 (mm),1.1", "Thickness 2 (mm),1.2", "Thickness 3 (mm),1.3"],
        ["Thickness (mm),1.1,1.2,1.3"],
        ["Thickness (mm): 1.1, 1.2, 1.3"],
        ["Thickness 1: 1.1 mm", "Thickness 2: 1.2 mm", "Thickness 3: 1.3 mm", "Mean thickness: 1.2 mm"],
    ],
)
def test_measurements_of_one_size_are_averaged_with_a_note(tmp_path, thickness):
    path = with_sizes(tmp_path, ["L0 (mm),20", "Width (mm),5", *thickness, "Disp (mm),Load (N)"], EACH[:2])
    with pytest.warns(UserWarning, match=r"the thickness is the mean of 3 measurements \(1.1, 1.2, 1.3, in line"):
        check([tq.read(path)], ["TEST"])


def test_measurements_may_follow_one_another_in_a_line_without_cells(tmp_path):
    head = ["L0: 20 mm", "Width: 5 mm", "Thickness (mm): 1.1 1.2 1.3", "Disp_mm Load_N"]
    path = with_sizes(tmp_path, head, EACH[:2], separator=" ")
    with pytest.warns(UserWarning, match=r"the thickness is the mean of 3 measurements"):
        check([tq.read(path)], ["TEST"])


@pytest.mark.parametrize(
    "head",
    [
        ["Specimen,A,B,C", "Length (mm),20,21,19"],
        ["Specimen,1,2,3", "Length (mm),20,21,19"],
        [",A 1,A 2,A 3", "Length (mm),20,21,19"],
        ["Length (mm),20,21,19", ",A 1,A 2,A 3"],
    ],
)
def test_values_of_named_specimens_are_no_measurements_of_one(tmp_path, head):
    path = with_sizes(tmp_path, [*head, "Disp (mm),Load (N)"], EACH[:2])
    with pytest.raises(InputError, match=r"several lengths: 20 mm .* 21 mm .* 19 mm"):
        tq.read(path, area="6 mm2")


def test_numbered_sizes_above_several_tables_are_of_the_tables(tmp_path):
    rows = [f"{u:.8g},{f:.8g}" for u, f in zip(*EACH[:2], strict=True)]
    head = ["Length 1 (mm),20", "Length 2 (mm),21", "Disp (mm),Load (N)"]
    (tmp_path / "test.csv").write_text("\n".join([*head, *rows, "", "Disp (mm),Load (N)", *rows]), encoding="utf-8")
    with pytest.raises(InputError, match="two lengths: 20 mm in line 1 and 21 mm in line 2"):
        tq.read_tests(tmp_path / "test.csv", area="6 mm2")


def test_measurements_far_apart_are_asked_about(tmp_path):
    head = ["L0 (mm),20", "Width (mm),5", "Thickness 1 (mm),1.0", "Thickness 2 (mm),1.3", "Disp (mm),Load (N)"]
    path = with_sizes(tmp_path, head, EACH[:2])
    with pytest.raises(InputError, match=r"two thicknesses: 1 mm in line 3 and 1.3 mm in line 4"):
        tq.read(path)
    check([tq.read(path, width="5 mm", thickness="1.2 mm")], ["TEST"])
