import gc

import numpy as np
import pytest

from loading import MEASURED, PAIRS, SHEAR, TEXTBOOK
from tissuq.errors import InputError, ModelError
from tissuq.experiments.modes import LoadingMode, SimpleShear, ThinTube, loading_mode, loading_modes


@pytest.fixture(params=list(loading_modes()))
def mode(request):
    return loading_mode(request.param)


EVERY_STRESS = pytest.mark.parametrize("measured", MEASURED, ids=str)


def test_the_modes_are_those_of_the_documentation():
    assert list(loading_modes()) == [
        "uniaxial", "equibiaxial", "planar", "simple-shear", "simple-shear-normal", "biaxial", "inflated-tube",
        "constrained-uniaxial", "thin-tube",
    ]  # fmt: skip


def test_every_mode_is_undeformed_at_its_reference(mode):
    assert mode.principal_stretches(mode.reference) == (1.0, 1.0, 1.0)
    assert mode.reference.shape == (() if len(mode.controls) == 1 else (len(mode.controls),))


def test_every_mode_has_a_path_for_each_stress_at_its_own_states(mode):
    assert len(mode.paths) == len(mode.stresses)
    points = mode.excursion([-0.3, 0.2, 0.6])
    for path in mode.paths:
        np.testing.assert_array_equal(path.abscissa(points).shape, (3,))
        states = path.moved(points, 0.0).stretches, mode.principal_stretches(points)
        found, own = (np.sort(np.broadcast_arrays(*state), axis=0) for state in states)
        np.testing.assert_allclose(found, own, rtol=1e-14)


def assert_known_plane(mode, plane, C):
    # What a uniaxial and an equibiaxial test leave to the material's symmetry is not known.
    known = {"uniaxial": [True, False, False], "equibiaxial": [False, False, False]}.get(mode.name, [True, True, True])
    for is_known, found, expected in zip(known, plane, (C[0, 0], C[1, 1], C[0, 1]), strict=True):
        assert (found is not None) == is_known
        assert found is None or found == pytest.approx(expected, rel=1e-14, abs=1e-16)


@EVERY_STRESS
def test_the_deformation_is_that_of_the_textbook(measured):
    for point in measured.points:
        F = measured.gradient(point)
        found, C = measured.path.moved(point, 0.0), F.T @ F
        np.testing.assert_allclose(np.linalg.det(F), 1.0, rtol=1e-14)
        np.testing.assert_allclose(sorted(found.stretches), sorted(np.linalg.svd(F)[1]), rtol=1e-13)
        np.testing.assert_allclose(found.stretches[2], F[2, 2], rtol=1e-14)
        assert_known_plane(measured.mode, found.plane, C)


@EVERY_STRESS
def test_a_step_moves_what_the_stress_works_on(measured):
    row, column = measured.component
    point, step = measured.points[2], 1e-3
    F = measured.gradient(point)
    F[row, column] += step
    if measured.mode.name in ("uniaxial", "equibiaxial"):
        F = measured.gradient(point + step)
    F[2, 2] = 1 / np.linalg.det(F[:2, :2])
    found, C = measured.path.moved(point, step), F.T @ F
    np.testing.assert_allclose(sorted(found.stretches), sorted(np.linalg.svd(F)[1]), rtol=1e-13)
    assert_known_plane(measured.mode, found.plane, C)


@EVERY_STRESS
def test_the_cauchy_ratio_is_that_of_the_tensors(measured):
    # Cauchy stress = P F', with no other component of P in the row of a measured one.
    row, column = measured.component
    expected = [measured.gradient(point)[column, column] for point in measured.points]
    assert measured.gradient(measured.points[0])[column, row] == 0.0 or row == column
    np.testing.assert_allclose(measured.path.cauchy_ratio(measured.points), expected, rtol=1e-15)


def test_the_engineering_stress_is_f_times_the_second_piola_kirchhoff_stress_where_that_is_determined(mode):
    points, gradient, components = TEXTBOOK[mode.name]
    random = np.random.default_rng(1)
    second = [part + part.T for part in random.standard_normal((len(points), 3, 3))]
    first = [gradient(point) @ stress for point, stress in zip(points, second, strict=True)]
    measured, expected = (np.array([[stress[c] for stress in each] for c in components]) for each in (second, first))
    if mode.name == "simple-shear":
        with pytest.raises(InputError, match="does not determine it"):
            mode.from_second_piola_kirchhoff(points, measured)
        return
    np.testing.assert_allclose(mode.from_second_piola_kirchhoff(points, measured), expected, rtol=1e-13)


def test_shear_of_either_sign_is_a_mirror_image():
    there, back = (SimpleShear().principal_stretches(sign * SHEAR) for sign in (1, -1))
    np.testing.assert_allclose(there[0], back[1], rtol=1e-15)
    np.testing.assert_allclose(there[0] - there[1], SHEAR, rtol=1e-12)


def test_the_stresses_of_a_tube_are_in_equilibrium_with_pressure_and_force():
    # Laplace: hoop Cauchy stress = p r/h; a cut across: axial Cauchy stress 2 pi r h = force + p pi r^2.
    radius, thickness, pressure, force = 4.0, 0.25, 0.016, np.linspace(-0.1, 0.5, len(PAIRS))
    hoop, axial = PAIRS.T
    r, h = radius * hoop, thickness / (hoop * axial)
    expected = pressure * r / h, (force + pressure * np.pi * r**2) / (2 * np.pi * r * h)
    stress = ThinTube.engineering_stresses(PAIRS, pressure, force, radius, thickness)
    for path, own, cauchy in zip(ThinTube().paths, stress.T, expected, strict=True):
        np.testing.assert_allclose(own * path.cauchy_ratio(PAIRS), cauchy, rtol=1e-14)


def test_a_mode_with_several_stresses_has_no_single_path():
    with pytest.raises(ModelError, match=r"'biaxial' measures engineering stress of axis 1 and .* one of its paths"):
        loading_mode("biaxial").at(PAIRS)


def test_every_mode_says_what_it_is(mode):
    assert mode.description


@pytest.mark.parametrize(
    ("name", "at_four"),
    [("uniaxial", (4.0, 0.5, 0.5)), ("equibiaxial", (4.0, 4.0, 0.0625)), ("planar", (4.0, 1.0, 0.25))],
)
def test_the_principal_stretches_are_those_of_the_textbook(name, at_four):
    assert loading_mode(name).principal_stretches(4.0) == pytest.approx(at_four)


def test_a_mode_is_taken_as_it_is():
    uniaxial = loading_mode("uniaxial")
    assert loading_mode(uniaxial) is uniaxial


def test_modes_of_the_same_kind_are_equal():
    assert loading_mode("planar") == loading_mode("planar")
    assert loading_mode("planar") != loading_mode("uniaxial")


def test_an_unknown_mode_is_answered_with_the_modes_there_are():
    with pytest.raises(ModelError, match=r"no loading mode named 'uniaxal'.*Did you mean 'uniaxial'.*planar"):
        loading_mode("uniaxal")


@pytest.mark.parametrize("name", ["uniaxial", "planar"])
def test_a_specimen_along_axis_2_is_deformed_as_one_along_axis_1_with_the_axes_exchanged(name):
    along_1, along_2 = loading_mode(name), loading_mode(f"{name}@2")
    assert (along_2.name, along_2.along_axis_1, loading_mode(f"{name}@1")) == (f"{name}@2", along_1, along_1)
    assert along_2 == loading_mode(f"{name}@2") != along_1
    first, second = (mode.path.moved(1.3, 0.0) for mode in (along_1, along_2))
    assert second.plane[:2] == first.plane[:2][::-1]
    assert second.stretches == (first.stretches[1], first.stretches[0], first.stretches[2])
    assert along_2.is_curve
    assert along_2.reference == 1.0


@pytest.mark.parametrize("name", ["equibiaxial@2", "uniaxial@3", "simple-shear@1"])
def test_other_modes_and_axes_are_refused_in_words(name):
    with pytest.raises(ModelError, match=rf"'{name}': after @ stands axis 1 or 2 .* as in uniaxial@2 or planar@2"):
        loading_mode(name)


@pytest.mark.slow
def test_a_mode_defined_outside_the_package_is_found_by_its_name():
    class Squeeze(LoadingMode):
        name = "squeeze-for-a-test"
        description = "lateral compression"

        def principal_stretches(self, stretch):
            return stretch**-0.5, stretch**-0.5, stretch

    assert loading_mode("squeeze-for-a-test") == Squeeze()
    del Squeeze
    gc.collect()  # or the tests over all modes would see it
    assert "squeeze-for-a-test" not in loading_modes()
