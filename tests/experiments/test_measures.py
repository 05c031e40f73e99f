"""Measures of strain and stress, against the tensors that define them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.linalg import logm

import tissuq as tq
from tissuq.errors import InputError
from tissuq.experiments.reading.headings import measure_in
from tissuq.experiments.reading.measures import STRAIN_MEASURES, STRESS_MEASURES
from tissuq.experiments.reading.read import read_experiment
from written_files import by_name, check_curve, message, text_file, written

MU = 0.04  # MPa
STRETCH = np.array([0.8, 0.9, 1.0, 1.2, 1.5])
SHEAR = np.array([-0.3, 0.0, 0.2, 0.6])
TENSORS = [name for name in STRESS_MEASURES if name != "torsion"]  # of which test_torsion.py is


def tensors(gradients):
    """Return strains and stresses (MPa) of a neo-Hookean solid whose third axis is free, as 3 x 3 tensors."""
    for F in gradients:
        b = F @ F.T
        cauchy = MU * (b - b[2, 2] * np.eye(3))
        strains = {
            "engineering": F - np.eye(3),
            "true": logm(b).real / 2,
            "green": (F.T @ F - np.eye(3)) / 2,
            "almansi": (np.eye(3) - np.linalg.inv(b)) / 2,
        }
        first = cauchy @ np.linalg.inv(F).T
        stresses = {
            "engineering": first, "cauchy": cauchy, "second-piola-kirchhoff": np.linalg.inv(F) @ first
        }  # fmt: skip
        yield strains, stresses


UNIAXIAL = [np.diag([stretch, stretch**-0.5, stretch**-0.5]) for stretch in STRETCH]
SHEARED = [np.array([[1, shear, 0], [0, 1, 0], [0, 0, 1]]) for shear in SHEAR]
P11 = [stresses["engineering"][0, 0] for _, stresses in tensors(UNIAXIAL)]


def components(gradients, strain, stress, place):
    pairs = [(strains[strain][place], stresses[stress][place]) for strains, stresses in tensors(gradients)]
    return np.array(pairs).T


@pytest.mark.parametrize("stress", TENSORS)
@pytest.mark.parametrize("strain", [name for name, measure in STRAIN_MEASURES.items() if measure.stretch])
def test_every_measure_gives_the_stretch_and_engineering_stress_of_its_tensor(tmp_path, strain, stress):
    values = components(UNIAXIAL, strain, stress, (0, 0))
    file = by_name(tmp_path, strain=100 * values[0], stress=1000 * values[1])
    units = {"strain_unit": "%", "stress_unit": "kPa"}
    data = read_experiment(file, strain_type=strain, stress_type=stress, **units)
    check_curve(data, STRETCH, P11, rtol=1e-9, stress_atol=1e-12)


@pytest.mark.parametrize("stress", TENSORS)
def test_stresses_of_two_axes_are_converted_along_each(tmp_path, stress):
    gradients = [np.diag([l1, l2, 1 / (l1 * l2)]) for l1, l2 in [(1.0, 1.0), (1.2, 1.1), (1.1, 1.3)]]
    columns = {}
    for axis, place in (("x", (0, 0)), ("y", (1, 1))):
        columns[f"Green strain {axis}"], columns[f"stress {axis} [MPa]"] = components(gradients, "green", stress, place)
    data = read_experiment(by_name(tmp_path, **columns), mode="biaxial", stress_type=stress)
    expected = [[stresses["engineering"][axis, axis] for axis in (0, 1)] for _, stresses in tensors(gradients)]
    np.testing.assert_allclose(data.stress, expected, atol=1e-9)
    np.testing.assert_allclose(data.stretch, [np.diag(F)[:2] for F in gradients], rtol=1e-9)


@pytest.mark.parametrize("strain", ["engineering", "green", "almansi"])
@pytest.mark.parametrize("stress", ["engineering", "cauchy"])
def test_components_of_shear_give_the_amount_of_shear_and_its_stress(tmp_path, strain, stress):
    values = components(SHEARED, strain, stress, (0, 1))
    file = by_name(tmp_path, shear=values[0], stress=values[1])
    data = read_experiment(file, mode="simple-shear", strain_type=strain, stress_type=stress, stress_unit="MPa")
    check_curve(data, SHEAR, MU * SHEAR, atol=1e-9)


@pytest.mark.parametrize(
    "name", ["Shear angle (deg)", "Scherwinkel [°]", "angle de cisaillement (rad)", "shear_angle_mrad"]
)
def test_an_angle_of_shear_is_recognised_with_its_unit(tmp_path, name):
    factor = 1000 if "mrad" in name else 1 if "rad" in name else 180 / np.pi
    file = by_name(tmp_path, **{name: factor * np.arctan(SHEAR), "stress [MPa]": MU * SHEAR})
    np.testing.assert_allclose(read_experiment(file, mode="simple-shear").stretch, SHEAR, atol=1e-9)


def test_an_angle_without_a_unit_is_asked_about(tmp_path):
    file = by_name(tmp_path, **{"shear angle": np.degrees(np.arctan(SHEAR)), "stress [MPa]": MU * SHEAR})
    with pytest.raises(InputError, match=r"states no unit of angle; give strain_unit \(--strain-unit rad\)"):
        read_experiment(file, mode="simple-shear")
    data = read_experiment(file, mode="simple-shear", strain_unit="deg")
    np.testing.assert_allclose(data.stretch, SHEAR, atol=1e-9)


def test_one_component_of_the_second_stress_does_not_tell_the_shear_stress_but_two_do(tmp_path):
    shear, normal = ([strains[place] for strains in (s["second-piola-kirchhoff"] for _, s in tensors(SHEARED))]
                     for place in ((0, 1), (1, 1)))  # fmt: skip
    file = by_name(tmp_path, shear=SHEAR, s12=shear, s22=normal)
    given = {"stress_type": "second-piola-kirchhoff", "stress_unit": "MPa"}
    with pytest.raises(InputError, match=r"P12 = S12 \+ g S22"):
        read_experiment(file, mode="simple-shear", columns={"stress": "s12"}, **given)
    data = read_experiment(file, mode="simple-shear-normal", columns={"stress": "s12", "stress2": "s22"}, **given)
    expected = [[stresses["engineering"][place] for place in ((0, 1), (1, 1))] for _, stresses in tensors(SHEARED)]
    np.testing.assert_allclose(data.stress, expected, atol=1e-12)


def test_positive_compression_changes_the_sign_of_the_strain_that_is_in_the_file(tmp_path):
    stretch = np.array([1.0, 0.9, 0.7])
    stress = MU * (stretch - stretch**-2)
    file = by_name(tmp_path, **{"True strain": -np.log(stretch), "Engineering stress [MPa]": -stress})
    data = read_experiment(file, compression_positive=True)
    check_curve(data, stretch, stress, rtol=1e-9)


def test_a_preload_does_not_change_the_area_that_the_second_stress_is_over(tmp_path):
    stretch = 1 + np.linspace(0.0, 0.5, 51)
    force_over_area = np.maximum(0.0, stretch - 1.1)
    given = {"preload": "0.05 MPa"}
    by_force, by_second = (
        read_experiment(by_name(tmp_path, **{"stretch": stretch, name: stress}), **given)
        for name, stress in (("stress [MPa]", force_over_area), ("PK2 [MPa]", force_over_area / stretch))
    )
    shared = min(len(by_force), len(by_second))
    np.testing.assert_allclose(by_second.stress[-shared:], by_force.stress[-shared:], rtol=1e-9)


@pytest.mark.parametrize(
    ("quantity", "meaning"),
    [
        ("true strain", ("strain", "true")),
        ("log strain", ("strain", "true")),
        ("ln strain", ("strain", "true")),
        ("hencky", ("strain", "true")),
        ("log. dehnung", ("dehnung", "true")),
        ("ln λ", ("strain", "true")),
        ("contrainte de cauchy", ("contrainte", "cauchy")),
        ("deformación real", ("deformación", "true")),
        ("tensión real", ("tensión", "cauchy")),
        ("pkii", ("stress", "second-piola-kirchhoff")),
        ("natural strain", ("strain", "true")),
        ("strain true", ("strain", "true")),
        ("wahre dehnung", ("dehnung", "true")),
        ("logarithmische dehnung", ("dehnung", "true")),
        ("déformation vraie", ("déformation", "true")),
        ("déformation logarithmique", ("déformation", "true")),
        ("deformación verdadera", ("deformación", "true")),
        ("deformación logarítmica", ("deformación", "true")),
        ("deformazione vera", ("deformazione", "true")),
        ("真应变", ("应变", "true")),
        ("対数ひずみ", ("ひずみ", "true")),
        ("technische dehnung", ("dehnung", "engineering")),
        ("deformación unitaria", ("deformación", "engineering")),
        ("deformazione unitaria", ("deformazione", "engineering")),
        ("déformation relative", ("déformation", "engineering")),
        ("工程应力", ("应力", "engineering")),
        ("green lagrange strain", ("strain", "green")),
        ("green lagrange", ("strain", "green")),
        ("euler almansi strain", ("strain", "almansi")),
        ("tensile true strain", ("tensile strain", "true")),
        ("true stress", ("stress", "cauchy")),
        ("cauchy", ("stress", "cauchy")),
        ("sigma true", ("stress", "cauchy")),
        ("wahre spannung", ("spannung", "cauchy")),
        ("contrainte vraie", ("contrainte", "cauchy")),
        ("kirchhoff stress", ("stress", "cauchy")),
        ("2nd piola kirchhoff stress", ("stress", "second-piola-kirchhoff")),
        ("second pk", ("stress", "second-piola-kirchhoff")),
        ("stress pk2", ("stress", "second-piola-kirchhoff")),
        ("first piola kirchhoff stress", ("stress", "engineering")),
        ("pk1", ("stress", "engineering")),
        ("nominal stress y", ("stress y", "engineering")),
        ("piola kirchhoff stress", ("piola kirchhoff stress", "")),
        ("green", ("green", "")),
        ("log", ("log", "")),
        ("logger strain", ("logger strain", "")),
        ("strain", ("strain", "")),
        ("engineering department", ("engineering department", "")),
    ],
)
def test_words_for_measures_are_known_in_several_languages(quantity, meaning):
    assert measure_in(quantity) == meaning


@pytest.mark.parametrize(
    ("strain", "stress", "expected"),
    [
        ("True strain (%)", "Engineering stress (MPa)", ("true", "engineering")),
        ("Strain (true) [%]", "Stress (true) [MPa]", ("true", "cauchy")),
        ("wahre Dehnung [%]", "wahre Spannung [MPa]", ("true", "cauchy")),
        ("déformation vraie (%)", "contrainte vraie (MPa)", ("true", "cauchy")),
        ("Green-Lagrange strain (%)", "PK2 (MPa)", ("green", "second-piola-kirchhoff")),
        ("Hencky_strain_%", "Cauchy_stress_MPa", ("true", "cauchy")),
        ("Green strain E11 (%)", "Cauchy stress T11 (MPa)", ("green", "cauchy")),
        ("Green-Lagrange strain E_xx [%]", "PK2 stress S11 (MPa)", ("green", "second-piola-kirchhoff")),
        ("Green strain E_GL (%)", "2nd Piola-Kirchhoff stress S_11 [MPa]", ("green", "second-piola-kirchhoff")),
        ("E11 (Green) [%]", "Cauchy T11 [MPa]", ("green", "cauchy")),
    ],
)
def test_names_that_say_the_measure_need_no_option(tmp_path, strain, stress, expected):
    values = components(UNIAXIAL, *expected, (0, 0))
    file = by_name(tmp_path, **{strain: 100 * values[0], stress: values[1]})
    data = read_experiment(file)
    check_curve(data, STRETCH, P11, rtol=1e-9, stress_atol=1e-9)


@pytest.mark.parametrize("name", ["F11", "F_11 [-]", "Fxx", "lambda11", "λ_11"])
def test_a_diagonal_component_of_the_deformation_gradient_is_a_stretch(tmp_path, name):
    data = read_experiment(by_name(tmp_path, **{name: STRETCH, "P11 [MPa]": P11}))
    check_curve(data, STRETCH, P11, rtol=1e-9, stress_atol=1e-12)


def test_what_is_called_like_a_component_but_has_a_unit_of_force_is_a_force(tmp_path):
    file = by_name(tmp_path, **{"stretch": STRETCH, "Fxx (N)": 10 * np.array(P11)})
    data = read_experiment(file, dimensions={"area": "10 mm2"})
    np.testing.assert_allclose(data.stress, P11, atol=1e-9)


def test_components_of_both_axes_are_a_biaxial_test(tmp_path):
    points = np.column_stack([STRETCH, np.sqrt(STRETCH)])
    names = ("F11", "F22", "Cauchy stress T11 [MPa]", "Cauchy stress T22 [MPa]")
    file = by_name(tmp_path, **dict(zip(names, (*points.T, *(points**2 - 1).T), strict=True)))
    data = read_experiment(file, mode="biaxial")
    check_curve(data, points, points - 1 / points, rtol=1e-9, stress_atol=1e-9)


def test_the_engineering_pair_goes_before_the_true_one(tmp_path):
    columns = {"Strain": STRETCH - 1, "Stress [MPa]": np.array(P11), "True strain": np.log(STRETCH)}
    columns["True stress [MPa]"] = columns["Stress [MPa]"] * STRETCH
    file = by_name(tmp_path, **columns)
    for strain_type, stress_type in product((None, "true"), (None, "cauchy")):
        data = read_experiment(file, strain_type=strain_type, stress_type=stress_type)
        check_curve(data, STRETCH, P11, rtol=1e-9, stress_atol=1e-12)


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        ("True strain,Stress [MPa]", {}, "does not say which type of stress it is, and strain 'True strain' is true"),
        ("Strain,True stress [MPa]", {}, "does not say which type of strain it is"),
        ("Green strain,P (MPa)", {}, "does not say which type of stress it is"),
        ("E11,PK2 [MPa]", {"columns": {"strain": "E11"}}, "may be a strain of several types"),
        ("E_GL (%),Engineering stress (MPa)", {}, "may be a strain of several types"),
        ("Lagrangian strain (%),Engineering stress (MPa)", {}, "may be a strain of several types"),
        (
            "Shear strain e12,Shear stress (MPa)",
            {"mode": "simple-shear", "columns": {"shear": 1}},
            "half of the amount of shear: to read twice its values give --strain-type green",
        ),
        ("Strain,S (MPa)", {}, "'S (MPa)' may be a stress of several types"),
        ("Strain,S11 (MPa)", {}, "'S11 (MPa)' may be a stress of several types"),
        ("True strain,Engineering stress [MPa]", {"strain_type": "green"}, "named a strain of type 'true'"),
        ("stretch,True stress [MPa]", {"stress_type": "engineering"}, "named a stress of type 'cauchy'"),
        ("stretch,stress [MPa]", {"strain_type": "true"}, "read as stretch"),
        (
            "strain,stress [MPa]",
            {"strain_type": "angle", "strain_unit": "rad"},
            "does not tell a stretch",
        ),
        ("strain,Shear stress [MPa]", {}, "is a load in shear"),
        ("Truestrain (%),Engineering stress (MPa)", {}, "may be a strain of several types"),
        ("stretch,Truestress (MPa)", {}, "'Truestress (MPa)' may be a stress of several types"),
        ("stretch,Truestress (MPa)", {"columns": {"stress": 2}}, "'Truestress (MPa)' may be a stress of several types"),
        ("Strain,Pressure (MPa)", {}, "no column is recognised as stress"),
        ("Strain,Innendruck (MPa)", {}, "is a pressure. For a tube"),
        ("Strain (%),Stress (MPa),Storage modulus (Pa)", {}, "is of oscillations"),
        ("strain,stress [MPa]", {"strain_type": "logarithmic"}, "strain_type must be one of engineering, true"),
    ],
)
def test_what_names_leave_open_or_contradict_is_refused_with_what_settles_it(tmp_path, names, options, words):
    columns = [STRETCH - 1 if "stretch" not in names else STRETCH, P11, 5 + STRETCH]
    assert words in message(written(tmp_path, names, *columns[: 1 + names.count(",")]), **options)


def test_strains_beyond_what_a_measure_can_be_are_refused(tmp_path):
    file = by_name(tmp_path, **{"Green strain": [-0.6, 0.0, 0.2], "engineering stress [MPa]": [-0.2, 0.0, 0.1]})
    with pytest.raises(InputError, match=r"-0\.6 is no strain of type 'green', which is larger than -0\.5"):
        read_experiment(file)


def test_inspect_says_the_measures_and_how_they_are_converted(tmp_path):
    values = components(UNIAXIAL, "true", "cauchy", (0, 0))
    text = str(tq.inspect(by_name(tmp_path, **{"True strain [%]": 100 * values[0], "True stress [MPa]": values[1]})))
    assert "'True strain [%]' is true strain, 'True stress [MPa]' is cauchy stress" in text
    assert "stretch = exp(column 'True strain [%]' x 0.01)" in text
    assert "Cauchy stress divided by stretch to engineering stress" in text


OTHER_STRAINS = {
    "true": "True strain, TrueStrain, trueStrain (%), Strain_true, strain true [%], ε_true, ε_log (%), Log. strain, "
    "e_log, ln(lambda), ln λ, Hencky, ln_strain (%), Dehnung (wahr) [%], log. Dehnung, déf. log (%), Strain [ln], "
    "Deformación real (%), logarithmic_strain, True_Strain_%, eps_true, true eps (mm/mm), εt (%), e_ln (%)",
    "green": "Green strain, GreenStrain (%), E_green, Green-Lagrange, Green–Lagrange strain (%), E11 (%), Exx, E (-), "
    "E_xx [-], Lagrange strain (%), Lagrangian strain (mm/mm), E_GL, Green–St. Venant strain",
}
OTHER_STRESSES = {
    "cauchy": "True stress (MPa), TrueStress (MPa), Cauchy stress [MPa], sigma (MPa), σ (MPa), Stress_true_MPa, "
    "Cauchy (MPa), σ11 (MPa), sigma_xx [MPa], t11 (MPa), contrainte de Cauchy (MPa), esfuerzo verdadero (MPa), "
    "τ (MPa), Tensión real (MPa), 真应力 (MPa), Kirchhoff stress (MPa)",
    "second-piola-kirchhoff": "2nd PK (MPa), PK2 (MPa), S (MPa), S11 (MPa), S_11 [MPa], 2PK stress (MPa), S2PK (MPa), "
    "Piola-Kirchhoff stress (MPa), stress_PK2 (MPa), Sxx (MPa), 2. PK-Spannung (MPa), PKII (MPa)",
}


@pytest.mark.parametrize(
    ("strain", "stress", "measures"),
    [
        *((name, stress, (measure, "engineering")) for measure, names in OTHER_STRAINS.items()
          for name in names.split(", ") for stress in ("Stress (MPa)", "Engineering stress (MPa)")),
        *((strain, name, ("engineering", measure)) for measure, names in OTHER_STRESSES.items()
          for name in names.split(", ") for strain in ("Strain", "Engineering strain")),
    ],
)  # fmt: skip
def test_no_other_measure_is_read_as_the_engineering_one_without_a_word(tmp_path, strain, stress, measures):
    values = components(UNIAXIAL, *measures, (0, 0))
    factor = 100 if "%" in strain else 1
    try:
        data = read_experiment(by_name(tmp_path, **{strain: factor * values[0], stress: values[1]}))
    except InputError:
        return
    check_curve(data, STRETCH, P11, rtol=1e-9, stress_atol=1e-9)


@pytest.mark.parametrize(
    ("strain", "stress", "words"),
    [
        ("Green strain x", "Green strain y", "is read as stress, and its name says 'green'"),
        ("PK2 stress x", "PK2 stress y", "is read as strain, and its name says 'second-piola-kirchhoff'"),
    ],
)
def test_a_strain_is_no_type_of_stress_and_a_stress_none_of_strain(tmp_path, strain, stress, words):
    path = text_file(tmp_path / "test.csv", f"{strain},{stress}\n0,0\n0.1,1\n0.2,2")
    with pytest.raises(tq.InputError, match=words):
        tq.read(path, strain=strain, stress=stress)
