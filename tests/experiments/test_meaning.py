"""What names of columns, tests and files mean: each advice, followed, reads the true stretches and stresses."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean, ramp
from tissuq.errors import InputError
from written_files import check_curve, text_file, written

L = ramp()
P = 1e3 * neo_hookean(L)  # kPa
SIZES = {"length": "10 mm", "area": "4 mm2"}
D = 10 * (L - 1)  # mm
N = P * 4e-3  # N


def check(path, expected="uniaxial", stretch=L, stress=P, **options):
    (test,) = tq.read_tests(path, **options)
    assert test.mode.name == expected
    check_curve(test, stretch, 1e-3 * stress, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("Time_s,TrueStrain,TrueStress_kPa", (L, np.log(L), P * L)),
        ("EngStrain,EngStress_kPa,TrueStrain,TrueStress_kPa", (L - 1, P, np.log(L), P * L)),
        ("Circumferential stretch,Circumferential Cauchy stress (kPa)", (L, P * L)),
        ("Strain (mm/m),Stress (kPa)", (1000 * (L - 1), P)),
        ("% Strain,Stress (kPa)", (100 * (L - 1), P)),
        ("Draw ratio,Stress (kPa)", (L, P)),
        ("Strain,Stress mean (kPa),Stress min (kPa),Stress max (kPa)", (L - 1, P, 0.9 * P, 1.1 * P)),
        ("Strain,Stress exp (kPa),Stress sim (kPa)", (L - 1, P, 1.1 * P)),
        ("GreenStrain (%),PK2 (kPa)", (50 * (L**2 - 1), P / L)),
        ("Green strain E (-),2nd PK stress S (kPa)", ((L**2 - 1) / 2, P / L)),
    ],
)
def test_measures_are_known_by_words_without_blanks_and_directions(tmp_path, head, columns):
    check(written(tmp_path, head, *columns))


@pytest.mark.parametrize(
    "head",
    [
        "AxialDisplacement(mm),ForceN",
        "displacement_mm,force_n",
        "Cross Head Travel (mm),Load (N)",
        "Cross-head displacement [mm],Force [N]",
        "Grip displacement [mm],Force [N]",
        "Actuator Displacement (mm),Load (N)",
        "Position(Linear:Position) (mm),Load(Linear:Load) (N)",
        "Spostamento [mm],Forza [N]",
        "変位(mm),荷重(N)",
        "Verplaatsing (mm),Kracht (N)",
        "Déplacement (mm),Effort (N)",
        "Deplacement (mm),Pruefkraft (N)",
    ],
)
@pytest.mark.filterwarnings("error:check the column")
def test_displacements_and_forces_are_known_by_many_names(tmp_path, head):
    path = written(tmp_path, f"Total Cycles,{head},Elapsed Cycles", 1 + 0 * L, D, N, np.arange(len(L)))
    check(path, dimensions=SIZES)


@pytest.mark.parametrize(
    "head",
    [
        "Deformazione [%],Tensione [kPa]",
        "Rek (%),Spanning (kPa)",
        "ひずみ(%),応力(kPa)",
        "Deformacion (%),Tension (kPa)",
    ],
)
def test_strains_and_stresses_are_known_in_many_languages_beside_forces(tmp_path, head):
    check(written(tmp_path, f"{head},x (mm),F (N)", 100 * (L - 1), P, D, N))


def test_empty_columns_of_stress_and_strain_are_not_read_beside_forces(tmp_path):
    path = written(tmp_path, "Force (N),Displacement (mm),Stress (kPa),Strain", N, D, 0 * L, 0 * L)
    check(path, dimensions=SIZES)


def test_directions_in_a_wall_are_axes(tmp_path):
    names = "Circumferential stretch,Axial stretch,Circumferential Cauchy stress (kPa),Axial Cauchy stress (kPa)"
    across = 1 + (L - 1) / 2
    path = written(tmp_path, names, L, across, L * P, across * P / 2, name="artery.csv")
    check(path, "biaxial", np.stack([L, across], axis=1), np.stack([P, P / 2], axis=1))


@pytest.mark.parametrize(
    ("names", "stress_type"), [("P1,P2", None), ("P_x,P_y", None), ("S1,S2", "second-piola-kirchhoff")]
)
def test_a_letter_beside_two_axes_is_a_stress_by_its_unit(tmp_path, names, stress_type):
    across, symbols = 1 + (L - 1) / 2, names.split(",")
    divisors = (L, across) if stress_type else (1, 1)
    heads = f"lambda_1,lambda_2,{symbols[0]} (kPa),{symbols[1]} (kPa)"
    path = written(tmp_path, heads, L, across, P / divisors[0], P / 2 / divisors[1], name="sheet.csv")
    options = {} if stress_type is None else {"stress_type": stress_type}
    stretch, stress = np.stack([L, across], axis=1), np.stack([P, P / 2], axis=1)
    check(path, "biaxial", stretch, stress, mode="biaxial", **options)
    if stress_type:
        with pytest.raises(InputError, match="may be a stress of several types"):
            tq.read(path, mode="biaxial")


def test_a_plane_that_slides_over_another_is_sheared(tmp_path):
    path = written(tmp_path, "Shear displacement (mm),Shear force (N)", D, N, name="shear.csv")
    check(path, "simple-shear", L - 1, dimensions=SIZES)
    path = written(tmp_path, "d (mm),F (N)", D, N, name="any.csv")
    check(path, "simple-shear", L - 1, dimensions=SIZES, columns={"sliding": 1, "force": 2})


@pytest.mark.parametrize("name", ["T19_PureShear.csv", "pure_shear_3.csv", "liver planar.csv"])
def test_pure_shear_is_planar(tmp_path, name):
    check(written(tmp_path, "Stretch,Stress (kPa)", L, P, name=name), "planar")


@pytest.mark.parametrize(
    ("name", "head", "columns", "words", "options"),
    [
        ("a.csv", "# Cauchy stress\nStretch,Stress (kPa)", (L, P * L), "Cauchy stress'", {"stress_type": "cauchy"}),
        (
            "b.csv",
            "Strain measure:,logarithmic\nStrain,Engineering stress (kPa)",
            (np.log(L), P),
            "line 1 says",
            {"strain_type": "true", "stress_type": "engineering"},
        ),
        ("compression_1.csv", "Strain,Stress (kPa)", (L - 1, P), "--tension-positive", {"compression_positive": False}),
        ("confined_1.csv", "Stretch,Stress (kPa)", (L, P), "--mode uniaxial", {"mode": "uniaxial"}),
        (
            "cells.csv",
            "Disp (mm),Load 10N (N),Load 1kN (N)",
            (D, N, 1.01 * N),
            "force=",
            {"dimensions": SIZES, "columns": {"force": "Load 10N (N)"}},
        ),
        (
            "position.csv",
            "Position (mm),Force (N)",
            (35.2 - D, N),
            "--tension-positive",
            {"dimensions": SIZES, "compression_positive": False},
        ),
        ("rubber_PS.csv", "Stretch,Stress (kPa)", (L, P), "--mode uniaxial, or another", {"mode": "uniaxial"}),
        (
            "of_area_1.csv",
            "Strain,Force (kN),Stress (MPa)",
            (L - 1, 1e-3 * N, N),
            '--column force="Force (kN)", and the --area',
            {"dimensions": {"area": "4 mm2"}, "columns": {"force": "Force (kN)"}},
        ),
        (
            "membrane.csv",
            "Pressure (kPa),Stretch,Stress (kPa)",
            (L - 1, L, P),
            "--mode uniaxial",
            {"mode": "uniaxial"},
        ),
        (
            "two_strains.csv",
            "Strain_x,Lambda_x,Stress_x (kPa)",
            (100 * (L - 1), L, P),
            "may be the strain or stretch: 'Strain_x' (number 1) and 'Lambda_x' (number 2)",
            {"columns": {"stretch": "Lambda_x"}},
        ),
        ("percent.csv", "Stretch (%),Stress (kPa)", (100 * (L - 1), P), "strain=", {"columns": {"strain": 1}}),
        ("weight.csv", "Displacement (mm),Load (g)", (D, N / 9.80665e-3), "force_unit gf", {"force_unit": "gf"}),
    ],
)
@pytest.mark.filterwarnings("ignore:column")
def test_what_is_open_is_asked_about_and_the_advice_reads_it(tmp_path, name, head, columns, words, options):
    path = written(tmp_path, head, *columns, name=name)
    sizes = {"dimensions": SIZES} if "mm)" in head else {}
    with pytest.raises(InputError) as refusal:
        tq.read_tests(path, **sizes)
    assert words.replace("force_unit", "--force-unit") in str(refusal.value)
    check(path, **(sizes | options))


def test_a_height_in_percent_is_no_length(tmp_path):
    path = written(tmp_path, "Height (mm),Height (%),Stress (kPa)", 10 * L, 100 * L, P)
    check(path, length="10 mm")


@pytest.mark.parametrize("mode", ["simple-shear", "uniaxial"])
def test_columns_without_names_are_asked_for_in_roles_that_the_mode_has(tmp_path, mode):
    path = text_file(tmp_path / "test.csv", "".join(f"{k},{strain:.8g}\n" for k, strain in enumerate(L - 1)))
    role = "shear" if mode == "simple-shear" else "stretch"
    with pytest.raises(InputError, match=rf"--column {role}=1 --column stress=2"):
        tq.read(path, mode=mode)


def test_a_strain_beyond_1_that_is_called_a_stretch_is_told_by_where_its_stress_is_least(tmp_path):
    stretch = np.linspace(1.02, 4, 30)
    path = written(tmp_path, "Stretch,Stress (kPa)", stretch - 1, 1e3 * neo_hookean(stretch))
    with pytest.raises(
        InputError, match=r"0.02 where the stress is least\) look like strain, not stretch.*strain=Stre"
    ):
        tq.read(path)
    check(path, stretch=stretch, stress=1e3 * neo_hookean(stretch), columns={"strain": "Stretch"})


def test_a_gel_that_breaks_far_in_compression_is_read(tmp_path):
    """Its stress is least there, and its stretches are none the less what they are called."""
    stretch, stress = np.linspace(1, 0.3, 30), 1e3 * neo_hookean(np.linspace(1, 0.3, 30))
    stress += -0.5
    stress[-2:] = -0.1
    check(written(tmp_path, "Stretch,Stress (kPa)", stretch, stress), stretch=stretch, stress=stress)


def test_an_amount_of_shear_that_is_1_at_rest_is_asked_about_and_the_advice_reads_it(tmp_path):
    path = written(tmp_path, "Shear,Stress (kPa)", L, P, name="shear_1.csv")
    with pytest.raises(InputError, match=r"If 1 was added to it, take that off; .* --mode planar"):
        tq.read(path)
    check(written(tmp_path, "Shear,Stress (kPa)", L - 1, P, name="shear_2.csv"), "simple-shear", L - 1)
    check(path, "planar", mode="planar", columns={"stretch": 1})


@pytest.mark.parametrize(
    ("names", "count"),
    [
        ("Strain,Force (N),Stress (MPa),Strain,Force (N),Stress (MPa)", 2),
        ("Strain A,Force A (N),Stress A (MPa),Strain B,Force B (N),Stress B (MPa)", 1),
    ],
)
def test_a_force_over_1_mm2_is_asked_about_of_tests_side_by_side_too(tmp_path, names, count):
    path = written(tmp_path, names, L - 1, N, N, L - 1, 2 * N, 2 * N, name="export.csv")
    strain, force, stress = names.split(",")[:3]
    advice = (
        f'--column strain="{strain}" --column force="{force}", and the --area .*{strain}" --column stress="{stress}"'
    )
    with pytest.raises(InputError, match=advice.replace("(", r"\(").replace(")", r"\)")):
        tq.read_tests(path)
    tests = tq.read_tests(path, columns={"strain": strain, "force": force}, area="4 mm2")
    assert len(tests) == count
    for number, test in enumerate(tests, 1):
        np.testing.assert_allclose(test.stress, 1e-3 * number * P, rtol=1e-5, atol=1e-9)


def test_an_area_of_1_mm2_that_is_meant_is_read_as_stated(tmp_path):
    path = written(tmp_path, "Strain,Force (N),Stress (MPa)", L - 1, 1e-3 * P, 1e-3 * P)
    check(path, columns={"strain": 1, "stress": "Stress (MPa)"})


def test_compression_that_is_named_is_not_read_as_tension(tmp_path):
    path = written(tmp_path, "Displacement (mm),Force (N)", 10 * (1 - 1 / L), N, name="compression_1.csv")
    with pytest.raises(InputError, match="--compression-positive"):
        tq.read_tests(path, dimensions=SIZES)
    check(path, stretch=1 / L, stress=-P, dimensions=SIZES, compression_positive=True)


def test_displacements_of_compression_may_be_positive_and_forces_negative(tmp_path):
    path = written(tmp_path, "Displacement (mm),Force (N)", 10 * (1 - 1 / L), -N)
    with pytest.raises(InputError, match="--compression-positive"):
        tq.read_tests(path, dimensions=SIZES)
    check(path, stretch=1 / L, stress=-P, dimensions=SIZES, compression_positive=True)


def test_what_a_rheometer_sheared_is_not_read_as_tension(tmp_path):
    head = "Geometry name,20mm parallel plate\nStep time,Strain,Stress,Torque\ns,%,Pa,uN.m"
    path = written(tmp_path, head, L, 100 * (L - 1), 1000 * P, P, name="stress growth.csv")
    with pytest.raises(InputError, match=r"line 1 says .*parallel plate.* --mode simple-shear"):
        tq.read_tests(path)
    check(path, "simple-shear", L - 1, mode="simple-shear")


@pytest.mark.parametrize("beside", ["Normal force", "Normalkraft", "Gap", "Torque"])
def test_strains_and_stresses_beside_what_a_rheometer_writes_are_asked_about(tmp_path, beside):
    head = f"Time (s),Strain (%),Stress (Pa),{beside}"
    path = written(tmp_path, head, L, 100 * (L - 1), 1000 * P, P, name="export.csv")
    with pytest.raises(InputError, match=rf"{beside}'.* --mode simple-shear.* --mode uniaxial"):
        tq.read_tests(path)
    check(path, "simple-shear", L - 1, mode="simple-shear")
    check(path, "uniaxial", mode="uniaxial")


def test_components_of_tensors_are_of_axes_once_their_measures_are_said(tmp_path):
    across = 1 + (L - 1) / 2
    path = written(
        tmp_path,
        "E11,E22,S11 (kPa),S22 (kPa)",
        *((L**2 - 1) / 2, (across**2 - 1) / 2, P / L, P / across),
        name="sheet.csv",
    )
    options = {}
    for words, option in (
        ("mode='biaxial'", {"mode": "biaxial"}),
        ("stress_type", {"stress_type": "second-piola-kirchhoff"}),
        ("strain_type", {"strain_type": "green"}),
    ):
        with pytest.raises(InputError, match=words):
            tq.read(path, **options)
        options |= option
    check(path, "biaxial", np.stack([L, across], axis=1), np.stack([P, P], axis=1), **options)


@pytest.mark.parametrize("head", ["Stretch λ [-],Stress [kPa]", "λ [-],Spannung σ [kPa]", "Streckung λ,Stress σ (kPa)"])
def test_a_symbol_after_a_name_leaves_it_what_it_is(tmp_path, head):
    check(written(tmp_path, head, L, P))


def test_a_displacement_in_simple_shear_is_asked_about_as_sliding_and_the_advice_reads_it(tmp_path):
    path = written(tmp_path, "Displacement (mm),Force (N)", 10 * (L - 1), N)
    options = {"mode": "simple-shear", "dimensions": SIZES}
    with pytest.raises(InputError, match="--column sliding=NAME"):
        tq.read(path, **options)
    check(path, "simple-shear", L - 1, sliding="Displacement (mm)", **options)


def test_a_name_that_stands_twice_is_asked_about_in_its_role(tmp_path):
    path = written(tmp_path, "Strain (%),Strain (%),Stress (kPa)", 100 * (L - 1), 50 * (L - 1), P)
    with pytest.raises(InputError, match=r"several columns may be the strain: .* --column strain=NAME"):
        tq.read(path, columns={"strain": "Strain (%)"})


SHEET = {"length": "10 mm", "width": "20 mm", "thickness": "2 mm"}


@pytest.mark.parametrize(
    "names",
    [
        "lambda_x,lambda_y,Fx (N),Fy (N)",
        "lambda_y,F_y (N),lambda_x,F_x (N)",
        "lambda1,lambda2,F1 (N),F2 (N)",
        "stretch_1,stretch_2,force_1 (N),force_2 (N)",
    ],
)
def test_two_stretches_and_two_forces_are_of_both_axes_of_a_sheet_whose_sizes_are_given(tmp_path, names):
    across = 1 + (L - 1) / 2
    values = {"x": (L, 0.04 * P), "y": (across, 0.01 * P)}  # N of kPa on 20 mm x 2 mm, and half of them on 10 mm x 2 mm
    columns = []
    for name in names.replace("1", "x").replace("2", "y").split(","):
        axis = name.removesuffix(" (N)")[-1]
        columns.append(values[axis]["N" in name])
    path = written(tmp_path, names, *columns, name="sheet.csv")
    check(path, "biaxial", np.stack([L, across], axis=1), np.stack([P, P / 2], axis=1), dimensions=SHEET)


@pytest.mark.parametrize(
    ("names", "options"),
    [
        ("stretch_1,force_1 (N),stretch_2,force_2 (N)", {"dimensions": SHEET}),  # of two specimens, one after another
        ("stretch_1,stretch_2,force_1 (N),force_2 (N)", {"area": "2 mm2"}),
        ("displacement_1 (mm),displacement_2 (mm),force_1 (N),force_2 (N)", {"dimensions": SHEET}),
    ],
)
def test_numbers_that_may_be_those_of_specimens_are_asked_about(tmp_path, names, options):
    path = written(tmp_path, names, L, L, P, P, name="sheet.csv")
    with pytest.raises(InputError, match=r"mode='biaxial'.* If numbers in the names are of two specimens"):
        tq.read(path, **options)
