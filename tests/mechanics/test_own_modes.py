"""Loading modes defined outside the package, simulated, fitted and predicted along one and the same path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import tissuq as tq
from tissuq.experiments.modes import Deformation, LoadingMode, Path
from tissuq.mechanics import NeoHookean

STRETCH = np.linspace(0.8, 1.6, 20)
NOISE_SD = 1e-3


@dataclass(frozen=True)
class FirstAxis(Path):
    """A step of the first stretch alone, at l2 = sqrt(l1)."""

    def moved(self, point, step):
        first, second = point + step, point**0.5
        return Deformation.along_axes((first, second, 1 / (first * second)))


class HalfBiaxial(LoadingMode):
    """F = diag(l, sqrt(l), l^-3/2), of which the stress of axis 1 is measured: not the derivative of W by l."""

    name = property(lambda self: "half-biaxial")  # of the object, so that no other test finds the class by its name
    description = "axis 2 follows axis 1, whose stress alone is measured"

    def principal_stretches(self, point):
        return point, point**0.5, point**-1.5

    @property
    def paths(self):
        return (FirstAxis(),)


class Pushed(LoadingMode):
    """Compression of the sheet's faces: the stress is the derivative of W by the control, which is its one path."""

    name = property(lambda self: "pushed")
    description = "compression across the sheet"

    def principal_stretches(self, point):
        return point**-0.5, point**-0.5, point


def half_biaxial(stretch):
    """Stress of axis 1 of a neo-Hookean material with C10 = 0.5: 2 C10 (l1 - 1 / (l1^3 l2^2))."""
    return stretch - stretch**-4


def pushed(stretch):
    return stretch - stretch**-2


CASES = [(HalfBiaxial(), half_biaxial), (Pushed(), pushed)]
EVERY_MODE = pytest.mark.parametrize(("mode", "expected"), CASES, ids=lambda case: getattr(case, "name", ""))


def measured(mode):
    return tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, NOISE_SD, seed=1, mode=mode)


@EVERY_MODE
@pytest.mark.parametrize("repetitions", [1, 1000])
def test_its_stress_is_that_of_the_textbook(mode, expected, repetitions):
    points = np.repeat(STRETCH, repetitions)
    stress = tq.engineering_stress(NeoHookean(), mode, points, [0.5])
    np.testing.assert_allclose(stress, expected(points), rtol=1e-12, atol=1e-14)


@EVERY_MODE
@pytest.mark.parametrize("discrepancy", ["none", "constant", "gp", "taylor", "auto"])
def test_what_is_simulated_is_identified(mode, expected, discrepancy):
    np.testing.assert_allclose(measured(mode).stress, expected(STRETCH), atol=5 * NOISE_SD)
    posterior = tq.fit(measured(mode), discrepancy=discrepancy, noise_sd=NOISE_SD)
    C10 = posterior.summary().loc["C10"]
    assert abs(C10["mean"] - 0.5) < 4 * C10["sd"] < 0.01


@EVERY_MODE
@pytest.mark.parametrize("discrepancy", ["none", "auto"])
def test_it_is_predicted_as_measured_and_as_textbooks_have_other_modes(mode, expected, discrepancy):
    posterior = tq.fit(measured(mode), discrepancy=discrepancy, noise_sd=NOISE_SD)
    stretch = np.array([0.9, 1.2, 1.5])
    np.testing.assert_allclose(posterior.predict(stretch)["median"], expected(stretch), atol=3 * NOISE_SD)
    uniaxial = posterior.predict(stretch, mode="uniaxial")
    assert np.all((uniaxial["low"] < stretch - stretch**-2) & (stretch - stretch**-2 < uniaxial["high"]))


@EVERY_MODE
def test_it_is_one_of_several_tests(mode, expected):
    uniaxial = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, NOISE_SD, seed=2)
    together = tq.fit([measured(mode), uniaxial], discrepancy="none", noise_sd=NOISE_SD, tolerances=tq.Tolerances())
    unit = np.concatenate([expected(STRETCH), STRETCH - STRETCH**-2]) / 0.5
    stress = np.concatenate([measured(mode).stress, uniaxial.stress])
    C10 = together.summary().loc["C10"]
    assert C10["mean"] == pytest.approx(unit @ stress / (unit @ unit), rel=1e-9)
    assert C10["sd"] == pytest.approx(NOISE_SD / np.sqrt(unit @ unit), rel=1e-6)


def test_what_was_measured_in_another_mode_predicts_it():
    posterior = tq.fit(tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, NOISE_SD, seed=1), noise_sd=NOISE_SD)
    stretch = np.array([0.9, 1.1, 1.2])
    band = posterior.predict(stretch, mode=HalfBiaxial(), noise=False)
    assert np.all((band["low"] < half_biaxial(stretch)) & (half_biaxial(stretch) < band["high"]))


def test_a_material_without_stress_along_one_of_the_paths_is_fitted():
    # The normal stress of a neo-Hookean material in simple shear is zero (the thickness is free).
    shear = np.linspace(-0.4, 0.6, 11)
    data = tq.simulate("neo-hookean", {"C10": 0.5}, shear, NOISE_SD, seed=1, mode="simple-shear-normal")
    C10 = tq.fit(data, discrepancy="none", noise_sd=NOISE_SD).summary().loc["C10"]
    assert C10["mean"] == pytest.approx(2 * shear @ data.stress[:, 0] / (4 * shear @ shear), rel=1e-9)
