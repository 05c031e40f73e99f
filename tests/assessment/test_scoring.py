"""Scores of tests that were not seen, within the calibrated range and beyond."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment.stability import calibrated_range, is_calibrated
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import material_named
from tissuq.mechanics.invariants import invariants
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.statistical_model import StatisticalModel

STRETCH = np.linspace(0.8, 1.5, 12)


@pytest.fixture(scope="module")
def data():
    return tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.02, seed=1)


@pytest.fixture(scope="module")
def posterior(data):
    return tq.fit(data, discrepancy="none", noise_sd=0.02)


def test_measurements_beyond_are_scored_apart(posterior):
    end = calibrated_range(posterior.model, loading_mode("planar"))[1]
    stretch = np.array([1.1, 1.3, end, 1.01 * end, 2.0])
    test = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.02, mode="planar", seed=2)
    found = posterior.scores(test).set_index("range")
    assert found["count"].to_dict() == {"all": 5, "calibrated": 3, "beyond": 2}
    for name in ("inside", "crps", "interval_score"):
        assert found.loc["all", name] == pytest.approx(
            (3 * found.loc["calibrated", name] + 2 * found.loc["beyond", name]) / 5
        )
    near = tq.Experiment("planar", stretch[:3], test.stress[:3])
    assert posterior.scores(near)["range"].tolist() == ["all"]
    assert posterior.scores(near)["crps"][0] == pytest.approx(found.loc["calibrated", "crps"], rel=1e-12)


def test_cauchy_stresses_are_scored_as_such(posterior):
    test = tq.Experiment("planar", [1.2, 1.2], [0.6, 0.7])
    engineering, cauchy = (posterior.scores(test, stress_type=each).iloc[0] for each in ("engineering", "cauchy"))
    for name, ratio in {"inside": 1, "error": 1, "half_width": 1, "crps": 1.2, "interval_score": 1.2}.items():
        assert cauchy[name] == pytest.approx(ratio * engineering[name])
    with pytest.raises(tq.InputError, match="stress_type must be one of"):
        posterior.scores(test, stress_type="kirchhoff")


def test_every_stress_of_every_test_has_its_rows(posterior):
    both = tq.simulate("neo-hookean", {"C10": 0.5}, [[1.1, 1.0], [1.1, 1.2]], mode="biaxial")
    found = posterior.scores(both)
    assert found["measured"].tolist() == list(both.mode.stresses)
    assert found["inside"].min() == 1


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar", "simple-shear", "constrained-uniaxial"])
def test_a_mode_of_one_control_is_calibrated_up_to_its_range(posterior, data, mode):
    asked = loading_mode(mode)
    low, high = calibrated_range(posterior.model, asked)
    step = 1e-6
    points = np.array([low - step, low, asked.reference, high, high + step])
    assert is_calibrated(posterior.model, asked, points).tolist() == [False, True, True, True, False]
    largest = [each.max() for each in invariants(data.mode.at(data.stretch))]
    if mode != "uniaxial":  # there, what was measured is the range
        at_ends = invariants(asked.paths[0].at(np.array([low, high])))
        ratio = np.array([own / most for own, most in zip(at_ends, largest, strict=True)]).max(axis=0)
        np.testing.assert_allclose(ratio, 1, rtol=1e-6)


def test_points_of_several_controls_are_calibrated_where_both_invariants_are(posterior, data):
    first, second = (each.max() for each in invariants(data.mode.at(data.stretch)))
    points = np.array([[1.0, 1.0], [1.2, 1.05], [1.5, 1.5], [1.5**-0.5, 1.5], [1.01 * 1.5**-0.5, 1.51]])
    l1, l2 = points.T
    i1 = l1**2 + l2**2 + (l1 * l2) ** -2 - 3
    i2 = l1**-2 + l2**-2 + (l1 * l2) ** 2 - 3
    expected = (i1 <= first + 1e-9) & (i2 <= second + 1e-9)
    assert expected.tolist() == [True, True, False, True, False]
    assert is_calibrated(posterior.model, loading_mode("biaxial"), points).tolist() == expected.tolist()


def test_with_fibres_the_stretches_along_the_axes_are_to_be_measured_too():
    """A law that was stretched along axis 1 alone knows nothing of its stiffness along axis 2 at the same I1."""
    law, biaxial = "neo-hookean+exponential-fibres@30", loading_mode("biaxial")
    strip = np.column_stack([np.linspace(1, 1.2, 5), np.ones(5)])
    truth = {"C10": 0.002, "k1": 0.004, "k2": 3.0}
    both = tq.simulate(law, truth, strip, noise_sd=1e-4, mode="biaxial", seed=1)
    model = StatisticalModel(both, material_named(law), discrepancy_named("none"), 1e-4)
    points = np.array([[1.2, 1.0], [1.0, 1.2], [1.2, 1.01], [1.1, 0.99], [1.21, 1.0]])
    assert is_calibrated(model, biaxial, points).tolist() == [True, False, False, False, False]
    isotropic = replace(model, material=material_named("neo-hookean"))
    assert is_calibrated(isotropic, biaxial, points).tolist() == [True, True, False, True, False]


def test_of_a_sheet_with_a_direction_only_stretches_along_its_axes_were_measured():
    points = [(1 + a * share, 1 + b * share) for a, b in ((0.2, 0.2), (0.2, 0.1)) for share in (0.5, 1)]
    data = tq.simulate("neo-hookean", {"C10": 0.5}, points, mode="biaxial", noise_sd=0.01, seed=1)
    model = tq.fit(data, discrepancy="none", noise_sd=0.01).model
    for mode, is_measured in (("uniaxial", False), ("equibiaxial", True)):
        stretch = np.array([1.05])
        assert is_calibrated(model, loading_mode(mode), stretch).tolist() == [True]
        assert is_calibrated(model, loading_mode(mode), stretch, is_directed=True).tolist() == [is_measured]
