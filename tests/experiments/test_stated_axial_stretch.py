"""The axial stretch of a tube that a line above its table states, in various words, and in what contradicts it."""

import numpy as np
import pytest

import tissuq as tq
from tissuq.errors import InputError
from written_files import check_curve, text_file

SIZES = {"diameter": "1.2 mm", "thickness": "0.15 mm"}
ROWS = "0,1.0\n10,1.12\n20,1.25\n40,1.43\n60,1.52\n80,1.57\n100,1.6\n120,1.62\n"


def tube(folder, line, name="artery.csv"):
    return text_file(folder / name, f"Rat aorta\n{line}\nPressure (mmHg),Outer diameter (mm)\n{ROWS}")


@pytest.mark.parametrize(
    "line",
    [
        "Axial stretch: 1.5",
        "# axial stretch = 1.5",
        "Axial stretch (lambda_z) = 1,5",
        '"Axial stretch";1,5;;',
        "Longitudinal stretch ratio,1.5,,",
        "Axial stretch [%]: 150",
        "in-vivo axial stretch: 150 %",
        "axial strain: 50 %",
        "λz: 1.5 (as in vivo)",
        "Pre-stretch: 1.5 ± 0.01",
        "pressurised at an axial stretch of 1.5.",
    ],
)
def test_a_line_that_states_the_axial_stretch_is_the_option(tmp_path, line):
    read = tq.read(tube(tmp_path, line), **SIZES)
    given = tq.read(tube(tmp_path, "in Krebs solution"), axial_stretch=1.5, **SIZES)
    assert read.mode.name == given.mode.name == "inflated-tube"
    check_curve(read, given.stretch, given.stress, rtol=1e-12)
    assert "axial stretch 1.5 (line 2, '" in read.source


@pytest.mark.parametrize(
    "line",
    [
        "Axial stretch: 1.3, 1.5, 1.7",
        "Axial stretch: 1,3; 1,5",
        "Axial stretch 1: 1.3",
        "Axial stretch: 1.3-1.5",
        "Axial stretch rate: 0.1",
        "Axial stretch: 1.3 to 1.5",
    ],
)
def test_lines_of_several_axial_stretches_or_of_other_quantities_are_not_read(tmp_path, line):
    with pytest.raises(InputError, match="--axial-stretch"):
        tq.read(tube(tmp_path, line), mode="inflated-tube", **SIZES)


@pytest.mark.parametrize(
    ("line", "options", "words"),
    [
        ("Axial stretch: 1.5", {"axial_stretch": 1.6}, "line 2: the axial stretch is 1.5 .* axial_stretch says 1.6"),
        ("Axial stretch: 1.5", {"mode": "planar"}, "line 2: the axial stretch is 1.5, and in loading mode 'planar'"),
        ("Axial stretch: 50 %", {}, "line 2: 'Axial stretch: 50 %' is 0.5 times the undeformed length"),
        ("Axial stretch: 150", {}, "line 2: 'Axial stretch: 150' is 150 times"),
        ("Axial stretch: 1.5\nAxial stretch: 1.6", {}, "line 2, 'Axial stretch: 1.5', and another by line 3"),
    ],
)
def test_contradictions_and_what_is_hardly_an_axial_stretch_are_refused(tmp_path, line, options, words):
    with pytest.raises(InputError, match=words.replace("axial_stretch says", "--axial-stretch says")):
        tq.read(tube(tmp_path, line), **options, **SIZES)


def test_a_tube_at_its_undeformed_length_by_a_line_is_read_so(tmp_path):
    read = tq.read(tube(tmp_path, "Axial stretch: 1.0"), **SIZES)
    held = tq.read(tube(tmp_path, "in Krebs solution"), mode="planar", **SIZES)
    np.testing.assert_allclose(read.stress, held.stress, rtol=1e-12)


def test_a_line_says_the_axial_stretch_where_the_force_was_measured_too(tmp_path):
    file = tmp_path / "artery.csv"
    rows = "".join(f"{row},{10 + k}\n" for k, row in enumerate(ROWS.split()))
    file.write_text(f"Axial stretch: 1.5\nPressure (mmHg),Outer diameter (mm),Axial force (mN)\n{rows}")
    read = tq.read(file, **SIZES)
    assert read.mode.name == "thin-tube"
    np.testing.assert_array_equal(read.stretch[:, 1], 1.5)


def test_it_says_nothing_where_no_tube_was_inflated(tmp_path):
    file = text_file(tmp_path / "strip.csv", "Axial stretch: 1.5\nstrain,stress (kPa)\n0,0\n0.1,3\n0.2,6\n0.3,10")
    assert tq.read(file).mode.name == "uniaxial"
