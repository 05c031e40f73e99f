"""Fibres: tension only, where they lie, what they become at the ends of their parameters, and what is refused."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import tissuq as tq
from closed_forms import EVERY, has_stress
from loading import MEASURED, PAIRS, SHEAR
from tissuq.experiments.modes import Biaxial, Planar, SimpleShear, SimpleShearNormal, Uniaxial
from tissuq.mechanics import engineering_stress, initial_shear_modulus, material_named, stress_basis
from tissuq.mechanics.stress import complex_step_stress, differentiator, path_energy, traced_stress_basis

LAWS = {"standard-fibres": [0.7], "exponential-fibres": [0.7, 1.3], "dispersed-fibres": [0.7, 1.3, 0.1]}
EVERY_LAW = pytest.mark.parametrize("law", LAWS)


def other_modes():
    # The lateral stretch of two families in a matrix is found, in test_equilibrium.py.
    pairs = [(m, each) for m in EVERY for each in MEASURED if not has_stress(m, each)]
    return [(m, each) for m, each in pairs if each.mode.name != "uniaxial" or m.shears or m.needs_matrix]


@pytest.mark.parametrize(
    ("material", "measured"), other_modes(), ids=lambda each: getattr(each, "name", None) or str(each)
)
def test_a_mode_that_does_not_prescribe_the_whole_deformation_is_refused_in_words(material, measured):
    with pytest.raises(tq.ModelError, match=r"has fibres, and this loading mode says .* only of an isotropic material"):
        engineering_stress(material, measured.path, [1.1], np.ones(len(material.parameters)))


@EVERY_LAW
def test_compressed_fibres_have_neither_stress_nor_energy(law):
    first, second = Biaxial().paths
    points = np.array([[0.8, 0.9], [0.9, 0.7], [0.95, 0.95]])
    fibres, values = material_named(law), [*LAWS[law], 0.6]
    values = [0.0 if p.symbol == "kappa" else v for p, v in zip(fibres.parameters, values, strict=True)]
    for path in (first, second):
        np.testing.assert_array_equal(path_energy(fibres, path, points, values), 0.0)
        np.testing.assert_array_equal(engineering_stress(fibres, path, points, values), 0.0)


@EVERY_LAW
def test_energy_and_stress_have_no_jump_where_fibres_begin_to_bear(law):
    fibres, values = material_named(f"{law}:one@0"), LAWS[law]
    values = [0.0 if p.symbol == "kappa" else v for p, v in zip(fibres.parameters, values, strict=True)]
    near = 1 + np.array([-1e-6, 0.0, 1e-6])
    assert np.abs(path_energy(fibres, Planar().path, near, values)).max() < 1e-11
    assert np.abs(engineering_stress(fibres, Planar(), near, values)).max() < 1e-5


@pytest.mark.slow
@EVERY_LAW
def test_the_compiled_stress_is_that_of_the_imaginary_step_on_both_sides_of_the_branch(law):
    fibres = material_named(f"neo-hookean+{law}")
    values = np.array([0.4, *LAWS[law], 0.6])
    is_linear = np.array([p.is_linear for p in fibres.parameters])
    for path, points in (
        (SimpleShear().path, SHEAR),
        (Biaxial().paths[0], PAIRS),
        (SimpleShearNormal().paths[1], SHEAR),
    ):
        quick = complex_step_stress(fibres, path.at(points), values[None])
        assert quick is not None
        basis = differentiator().jit(partial(traced_stress_basis, fibres, path.at(points)))(values[~is_linear])
        compiled = np.asarray(basis) @ values[is_linear]
        np.testing.assert_allclose(quick[0], compiled, rtol=1e-12, atol=1e-14)


@EVERY_LAW
def test_at_rest_the_compiled_stress_is_taken_and_has_the_others_values(law):
    # There is a kink at the reference, which a difference quotient tells from a derivative.
    fibres, points = material_named(f"neo-hookean+{law}"), np.array([0.9, 1.0, 1.1, 1.2])
    values = [0.4, *LAWS[law], 0.2]
    found = engineering_stress(fibres, Planar(), points, values)
    assert found[1] == 0.0
    np.testing.assert_allclose(found[2:], engineering_stress(fibres, Planar(), points[2:], values), rtol=1e-12)


@EVERY_LAW
def test_the_initial_modulus_is_that_of_the_matrix(law):
    assert initial_shear_modulus(material_named(f"neo-hookean+{law}"), [0.4, *LAWS[law], 0.6]) == 0.8
    assert initial_shear_modulus(material_named(law), [*LAWS[law], 0.6]) == 0.0


def test_stretched_fibres_add_to_the_tangent_along_them_as_documented():
    # d2W/dl2 = 4 k at l = 1, beside 8 C10 of the matrix with one lateral axis held.
    step = 1e-6
    sum_ = material_named("neo-hookean+standard-fibres:one@0")
    slope = engineering_stress(sum_, Planar(), [1 + step], [0.4, 0.7])[0] / step
    assert slope == pytest.approx(8 * 0.4 + 4 * 0.7, rel=1e-5)
    slope = engineering_stress(sum_, Planar(), [1 - step], [0.4, 0.7])[0] / -step
    assert slope == pytest.approx(8 * 0.4, rel=1e-5)


@pytest.mark.parametrize(
    ("law", "values", "limit", "of_limit"),
    [
        ("exponential-fibres", [0.7, 1e-9, 0.6], "standard-fibres", [0.7, 0.6]),
        ("dispersed-fibres", [0.7, 1.3, 0.0, 0.6], "exponential-fibres", [0.7, 1.3, 0.6]),
        ("dispersed-fibres", [0.7, 1.3, 1 / 3, 0.6], "dispersed-fibres", [0.7, 1.3, 1 / 3, 1.1]),
        ("exponential-fibres@30", [0.7, 1.3], "exponential-fibres", [0.7, 1.3, np.pi / 6]),
        ("exponential-fibres@0", [0.35, 1.3], "exponential-fibres:one@0", [0.7, 1.3]),
    ],
)
def test_a_law_becomes_another_one(law, values, limit, of_limit):
    for each in MEASURED:
        if each.mode.name not in ("uniaxial", "equibiaxial"):
            found = engineering_stress(material_named(law), each.path, each.points, values)
            expected = engineering_stress(material_named(limit), each.path, each.points, of_limit)
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)


def test_one_family_tells_the_sign_of_a_shear_and_two_do_not():
    one, two = material_named("exponential-fibres:one"), material_named("exponential-fibres")
    there, back = (
        engineering_stress(one, SimpleShear(), sign * np.array([0.1, 0.3]), [1.0, 0.5, 0.7]) for sign in (1, -1)
    )
    assert (there > 0).all()
    assert np.abs(back).max() < 0.1 * there.min()
    there, back = (
        engineering_stress(two, SimpleShear(), sign * np.array([0.1, 0.3]), [1.0, 0.5, 0.7]) for sign in (1, -1)
    )
    np.testing.assert_allclose(there, -back, rtol=1e-12)


def test_a_uniaxial_test_along_the_fibres_is_that_of_a_symmetric_material():
    stretch = np.array([0.8, 1.1, 1.4])
    found = stress_basis(material_named("neo-hookean+standard-fibres:one@0"), Uniaxial().at(stretch))
    tension = np.maximum(stretch**2 - 1, 0)
    np.testing.assert_allclose(found, np.column_stack([2 * (stretch - stretch**-2), 2 * stretch * tension]), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("holzapfel-gasser-ogden", "neo-hookean+exponential-fibres"),
        ("gasser-ogden-holzapfel", "neo-hookean+dispersed-fibres"),
        ("standard-reinforcing + rivlin:C01", "neo-hookean+standard-fibres+rivlin:C01"),
    ],
)
def test_the_laws_of_the_literature_are_sums(name, parts):
    assert material_named(name) == material_named(parts)
    assert material_named(parts).name == (parts if "rivlin" in parts else name)


def test_a_name_tells_families_and_a_known_angle_and_is_the_materials_own():
    for name in ("exponential-fibres:one@30", "standard-fibres@12.5", "dispersed-fibres:one"):
        material = material_named(name)
        assert material.name == name
        assert material == material_named(name)
        assert ("phi" in [p.symbol for p in material.parameters]) == ("@" not in name)
    assert [p.symbol for p in material_named("exponential-fibres:one@0+exponential-fibres@40").parameters] == [
        "k1_1", "k2_1", "k1_2", "k2_2",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: material_named("exponential-fibres@91"), "lie at 0 to 90 degrees from axis 1, not 91"),
        (lambda: material_named("fibers:one@30"), "no material named 'fibers:one@30'"),
        (lambda: type(material_named("standard-fibres"))(families=3), "one family of fibres or two, not 3"),
        (lambda: material_named("standard-fibres").strain_energy(4.0, 4.0, [1.0, 0.5]), "not known from I1 and I2"),
        (lambda: material_named("standard-fibres").energy((1.0, 1.0, 1.0), [1.0, 0.5]), "not known from stretches"),
        (lambda: material_named("exponential-fibres+exponential-fibres"), "would have k1, k2, phi twice"),
    ],
)
def test_what_has_no_meaning_is_refused_in_words(call, words):
    with pytest.raises(tq.ModelError, match=words):
        call()


def test_fibres_are_fitted_with_a_matrix_and_not_without():
    truth = {"C10": 0.01, "k1": 0.05, "k2": 1.5, "phi": 0.6}
    data = tq.simulate("holzapfel-gasser-ogden", truth, np.linspace(0.8, 1.4, 25), 1e-4, seed=1, mode="planar")
    posterior = tq.fit(data, material="neo-hookean+exponential-fibres@34.377", discrepancy="none", noise_sd=1e-4)
    summary = posterior.summary()
    for symbol in ("C10", "k1", "k2"):
        assert abs(summary.loc[symbol, "mean"] - truth[symbol]) < 4 * summary.loc[symbol, "sd"], symbol
    assert posterior.initial_shear_modulus.mean == pytest.approx(2 * summary.loc["C10", "mean"])
    with pytest.raises(tq.ModelError, match="the criteria are those of isotropic materials"):
        posterior.stability()
    with pytest.raises(tq.ModelError, match="only of an isotropic material"):
        posterior.predict([1.1], mode="equibiaxial")
    (true,) = tq.simulate("holzapfel-gasser-ogden", truth, [1.1], 0.0, mode="uniaxial").stress
    assert posterior.predict([1.1], mode="uniaxial")["median"].iloc[0] == pytest.approx(true, abs=2e-4)
    assert posterior.assess().stable == {}
    with pytest.raises(tq.ModelError, match=r"fibres only.*add a matrix, as in 'neo-hookean.exponential-fibres'"):
        tq.fit(data, material="exponential-fibres")


@pytest.mark.parametrize(
    ("law", "truth"),
    [
        ("standard-reinforcing", {"C10": 0.01, "k": 0.05, "phi": 0.6}),  # the short version has no rate
        pytest.param(
            "holzapfel-gasser-ogden", {"C10": 0.01, "k1": 0.05, "k2": 1.5, "phi": 0.6}, marks=pytest.mark.slow
        ),
    ],
)
def test_two_stresses_of_a_biaxial_test_tell_stiffness_rate_and_angle(law, truth):
    stretch = [[1 + a * t, 1 + b * t] for a, b in ((1, 1), (1, 0.5), (0.5, 1)) for t in np.linspace(0.05, 0.3, 8)]
    data = tq.simulate(law, truth, stretch, 1e-3, seed=1, mode="biaxial")
    summary = tq.fit(data, material=law, discrepancy="none", noise_sd=1e-3).summary()
    for symbol, value in truth.items():
        assert abs(summary.loc[symbol, "mean"] - value) < 4 * summary.loc[symbol, "sd"], symbol
    assert summary.loc["phi", "sd"] < 0.01


def test_several_tests_of_fibres_are_fitted_together_where_each_prescribes_the_deformation():
    truth, options = {"C10": 0.01, "k": 0.05, "phi": 0.6}, {"discrepancy": "none", "noise_sd": 2e-4}
    law, shear = "standard-reinforcing", np.linspace(-0.4, 0.5, 10)
    sheared = tq.simulate(law, truth, shear, 2e-4, seed=1, mode="simple-shear")
    planar = tq.simulate(law, truth, np.linspace(0.8, 1.4, 12), 2e-4, seed=2, mode="planar")
    posterior = tq.fit([sheared, planar], material=law, **options)
    summary = posterior.summary()
    for symbol, value in truth.items():
        assert abs(summary.loc[symbol, "mean"] - value) < 4 * summary.loc[symbol, "sd"], symbol
    with pytest.raises(tq.ModelError, match="only of an isotropic material"):
        posterior.predict([1.1], mode="equibiaxial")
    pulled = tq.simulate("neo-hookean", {"C10": 0.01}, np.linspace(0.8, 1.3, 8), 2e-4, seed=3, mode="equibiaxial")
    with pytest.raises(tq.ModelError, match="only of an isotropic material"):
        tq.fit([sheared, pulled], material=law, **options)
