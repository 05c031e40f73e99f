"""Stability of drawn materials, against closed forms of the Mooney-Rivlin material and of its tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment.stability import calibrated_range, stability
from tissuq.experiments.modes import loading_mode
from tissuq.mechanics import NeoHookean
from tissuq.mechanics.invariants import invariants
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.parameter import Parameter

STRETCH = np.linspace(0.6, 2.5, 30)
MODES = ["uniaxial", "equibiaxial", "planar"]


def fitted(material, truth, noise_sd=1e-6, **options):
    """A posterior so narrow that every draw is the truth."""
    data = tq.simulate(material, truth, STRETCH, noise_sd=noise_sd, seed=1)
    return tq.fit(data, material=material, discrepancy="none", noise_sd=noise_sd, **options)


def hessian(stretches, C10, C01):
    """Second derivatives of W = C10 I1 + C01 I2 by e1, e2, with l_k = exp(e_k) and e3 = -e1 - e2."""
    squares = np.array([each**2 for each in stretches])
    own = 4 * (C10 * squares + C01 / squares)
    return np.array([[own[0] + own[2], own[2]], [own[2], own[1] + own[2]]])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("C01", [0.1, -0.1, -0.3])
def test_drucker_is_that_of_the_closed_tangent(mode, C01):
    posterior = fitted("mooney-rivlin", {"C10": 0.5, "C01": C01})
    mode, stretch = loading_mode(mode), np.linspace(0.45, 2.4, 60)
    found = stability(posterior.solution, mode, stretch)
    base = [np.broadcast_to(each, len(stretch)) for each in mode.principal_stretches(stretch)]
    least = np.linalg.eigvalsh(np.moveaxis(hessian(base, 0.5, C01), 2, 0))[:, 0]
    clear = np.abs(least) > 1e-3
    assert np.array_equal(found.drucker[clear], 1.0 * (least > 0)[clear])
    first, second, third = base
    # Baker-Ericksen of a Mooney-Rivlin material: C10 + C01 l_k^2 > 0 for every axis k whose other two stretches differ.
    pairs = [(first, third, second), (second, third, first), (first, second, third)]
    expected = np.all([(0.5 + C01 * k**2 > 0) | (np.abs(a - b) < 1e-9) for a, b, k in pairs], axis=0)
    assert np.array_equal(found.baker_ericksen, 1.0 * expected)


def test_stability_is_lost_from_the_reference_outward():
    posterior = fitted("mooney-rivlin", {"C10": 0.5, "C01": -0.15})
    table = posterior.stability("equibiaxial", np.linspace(0.5, 2.5, 81))
    assert table.loc[(table["stretch"] - 1).abs().idxmin(), "stable"] == 1
    for side in (table[table["stretch"] >= 1], table[table["stretch"] <= 1][::-1]):
        assert (np.diff(side["stable"]) <= 0).all()
    assert table["stable"].iloc[-1] == 0


@pytest.fixture(scope="module")
def lost_and_found_again():
    """A posterior of Yeoh materials, most of which soften near a stretch of 1.6 and stiffen again beyond."""
    stretch = np.linspace(1.02, 2.4, 40)
    data = tq.simulate("yeoh", {"C10": 0.5, "C20": -0.15, "C30": 0.03}, stretch, noise_sd=0.05, seed=1)
    return tq.fit(data, material="yeoh", discrepancy="none", noise_sd=0.05)


@pytest.mark.parametrize("stretch", [[2.4], [1.2, 2.4], [2.4, 1.2]])
def test_stability_that_is_lost_on_the_way_is_lost_whatever_stretches_are_asked_for(lost_and_found_again, stretch):
    """By the closed form of the stress; at single stretches it was said to be stable with a probability of one."""
    draws = lost_and_found_again.data["posterior"]
    C10, C20, C30 = (draws[name].to_numpy().ravel()[:, None] for name in ("C10", "C20", "C30"))
    way = np.linspace(1, 2.4, 2001)
    x = way**2 + 2 / way - 3
    stress = 2 * (way - way**-2) * (C10 + 2 * C20 * x + 3 * C30 * x**2)
    share = (np.diff(stress) > 0).all(axis=1).mean()
    table = lost_and_found_again.stability("uniaxial", stretch).set_index("stretch")
    assert 0.3 < share < 0.5
    assert table.loc[2.4, "stable"] == pytest.approx(share, abs=0.07)  # three standard errors of 500 draws
    assert table.loc[2.4, "rising"] > 0.95
    if 1.2 in stretch:
        assert table.loc[1.2, "stable"] > 0.95


def test_a_test_beyond_what_is_unstable_is_ranked_as_unstable(lost_and_found_again):
    table = lost_and_found_again.design(["uniaxial 1.01:2.4 10", "uniaxial 1.01:1.3 10"])
    ranked = table[~table["is_repeat"]].set_index("high")["stable"]
    assert ranked[2.4] < 0.6
    assert ranked[1.3] > 0.95


def test_a_material_with_a_negative_modulus_is_said_not_to_be_stable():
    """Mooney-Rivlin on Treloar's uniaxial data, where 2 (C10 + C01) comes out below zero."""
    data = tq.datasets.load("rubber-treloar-uniaxial")
    posterior = tq.fit(data, material="mooney-rivlin", discrepancy="none")
    assert posterior.initial_shear_modulus.mean < 0
    assert posterior.stability()["stable"].max() < 0.1
    found = posterior.stable_ranges["uniaxial"]
    assert (found.low, found.surely_high, found.loss_above.median) == (1, 1, 1)
    assert found.loss_above.probability == 1 - found.probability > 0.9
    (told,) = (text for text in posterior.warnings if "stable" in text)
    assert "rarely stable (already at rest: the initial shear modulus is negative)" in told


def test_the_calibrated_range_ends_where_an_invariant_leaves_what_was_measured():
    data = tq.simulate("neo-hookean", {"C10": 1.0}, STRETCH)
    model = StatisticalModel(data, NeoHookean(), discrepancy_named("none"), 0.01)
    most = [each.max() for each in invariants(data.mode.at(data.stretch))]
    assert calibrated_range(model, data.mode) == (0.6, 2.5)
    for name in ("equibiaxial", "planar"):
        for end in calibrated_range(model, loading_mode(name)):
            reached = [float(each[0]) for each in invariants(loading_mode(name).at([end]))]
            assert np.max(np.array(reached) / most) == pytest.approx(1, abs=1e-6)


def test_where_stability_is_lost_is_where_the_stress_of_the_closed_form_stops_rising():
    """A Mooney-Rivlin material with C01 < 0 in equibiaxial tension, to the distance of the stretches looked at."""
    posterior = fitted("mooney-rivlin", {"C10": 0.5, "C01": -0.15})
    found = posterior.stable_ranges["equibiaxial"]
    stretch = np.linspace(1, found.high, 2000)
    rising = np.diff(2 * (stretch - stretch**-5) * (0.5 - 0.15 * stretch**2)) > 0
    lost, step = stretch[np.argmin(rising)], (found.high - 1) / 30
    least = np.linalg.eigvalsh(np.moveaxis(hessian([stretch, stretch, stretch**-2.0], 0.5, -0.15), 2, 0))[:, 0]
    # Drucker and Baker-Ericksen (C10 + C01 l^2 > 0) fail later.
    assert 1 < lost < stretch[np.argmax(least <= 0)] < found.high < (0.5 / 0.15) ** 0.5
    assert found.loss_above.probability == 1
    assert found.loss_above.low == found.loss_above.high == pytest.approx(lost, abs=step)
    assert lost - step < found.surely_high <= lost
    assert found.probability == 0


def test_a_discrepancy_that_is_no_energy_has_no_part():
    posterior = tq.fit(tq.datasets.load("brain-cortex-uniaxial"), discrepancy="linear")
    assert posterior.marginals["C10"].quantile(1e-6) > 0
    assert posterior.marginals["m1"].quantile(1 - 1e-6) < 0
    assert {found.probability for found in posterior.stable_ranges.values()} == {1.0}


def test_a_shear_test_tells_stability_in_shear_and_in_the_modes_of_one_stretch():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(-0.5, 0.8, 20), 1e-6, mode="simple-shear")
    posterior = tq.fit(data, discrepancy="none", noise_sd=1e-6)
    assert calibrated_range(posterior.model, data.mode) == (-0.5, 0.8)
    assert posterior.stability()["stable"].min() == 1.0
    assert set(posterior.assess().stable) == {"uniaxial", "equibiaxial", "planar"}
    tension = tq.simulate("neo-hookean", {"C10": 1.0}, STRETCH)
    low, high = calibrated_range(replace(posterior.model, experiment=tension), data.mode)
    assert -low == pytest.approx(high)


@pytest.mark.slow
def test_an_energy_discrepancy_takes_part_and_its_share_is_that_of_its_draws():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.8, 1.3, 12), noise_sd=0.05, seed=3)
    posterior = tq.fit(data, discrepancy="auto", noise_sd=0.05)
    table = posterior.stability("uniaxial", np.linspace(0.5, 2.0, 31))
    at_the_reference = table.loc[(table["stretch"] - 1).abs().idxmin()]
    assert at_the_reference["drucker"] == 1
    assert table["stable"].iloc[[0, -1]].max() < at_the_reference["stable"]
    (sentence,) = (text for text in posterior.assess().sentences if "stable" in text)
    assert sentence.startswith("Over the measured range of the invariants material and discrepancy together")


def test_ogdens_law_loses_stability_where_its_own_tangent_does():
    """mu1 > 0 and |alpha| small: softening in uniaxial tension; the draws share it within what alpha1 leaves open."""
    posterior = fitted("ogden-1", {"mu1": 1.0, "alpha1": 2.0}, noise_sd=1e-3)
    table = posterior.stability("equibiaxial", np.linspace(0.6, 2.0, 15))
    assert table["stable"].min() == 1
    negative = fitted("ogden-1", {"mu1": 1.0, "alpha1": -1.0}, noise_sd=1e-3, priors={"alpha1": tq.Uniform(-1.2, -0.8)})
    stretch = np.linspace(1.05, 3.0, 40)
    found = stability(negative.solution, loading_mode("uniaxial"), stretch)
    # At alpha = -1 the engineering stress is 2 (l^-0.5 - l^-2), largest at 4^(2/3) = 2.52.
    assert np.array_equal(found.rising[stretch < 2.3], np.ones((stretch < 2.3).sum()))
    assert found.rising[stretch > 2.75].max() == 0


@pytest.mark.slow
def test_a_material_in_jax_is_as_stable_as_the_same_in_plain_arithmetic():
    from jax import numpy as jnp

    class InJax(tq.Material):
        name = "in-jax"
        formula, source = "mu / 2 (I1 - 3)", "here"
        parameters = (Parameter("mu", "modulus"),)

        def strain_energy(self, I1, I2, values):
            return values[0] / 2 * jnp.where(I1 > 3, I1 - 3, 0.0)

    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.03, seed=1)
    posterior = tq.fit(data, material=InJax(), discrepancy="none", noise_sd=0.03)
    table = posterior.stability()
    assert table[["baker_ericksen", "drucker", "rising", "stable"]].min().min() == 1
    assert set(posterior.assess().stable.values()) == {1.0}
