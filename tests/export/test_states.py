"""The states in which cards are judged."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import tissuq as tq
from tissuq.export.draw_stresses import DrawStresses
from tissuq.export.states import ANGLES, POINTS_PER_PATH, SeenStates, are_stable, moduli


def test_states_keep_the_volume_and_end_where_an_invariant_was_largest(auto):
    states = SeenStates(auto.most)
    count = len(ANGLES) * POINTS_PER_PATH
    stretches = states.base[:, :count]
    assert stretches.prod(axis=0) == pytest.approx(np.ones(count))
    first, second = (stretches**2).sum(axis=0) - 3, (stretches**-2).sum(axis=0) - 3
    ends = np.arange(POINTS_PER_PATH - 1, count, POINTS_PER_PATH)
    reached = np.maximum(first / auto.most[0], second / auto.most[1])
    assert reached[ends] == pytest.approx(np.ones(len(ends)), abs=1e-9)
    assert reached.max() <= 1 + 1e-9
    logs = np.log(stretches[:, ends])
    angle = np.degrees(np.arctan2(np.sqrt(3) * (logs[1] - logs[2]), 2 * logs[0] - logs[1] - logs[2]))
    assert angle == pytest.approx(ANGLES)


def test_stresses_are_rivlins_differences(given):
    """t_i - t_j = 2 (l_i^2 - l_j^2) (W1 + l_k^2 W2)."""
    ensemble = given([("mooney-rivlin", [0.3, 0.2])])
    states = SeenStates(ensemble.most)
    one, two, three = states.base[:, : len(ANGLES) * POINTS_PER_PATH] ** 2
    first, second, third = (0.3 + 0.2 * each for each in (one, two, three))
    wanted = 2 * np.concatenate([(one - two) * third, (one - three) * second, (two - three) * first])
    (found,) = ensemble.stress(states, states.points)
    assert found == pytest.approx(wanted)
    assert states.of_unit_modulus == pytest.approx(np.concatenate([one - two, one - three, two - three]))


def test_moduli_are_those_of_the_materials(given):
    ensemble = given([("ogden-1", [0.7, -25.0])], [("ogden-1", [0.2, 12.0])])
    assert moduli(ensemble) == pytest.approx([0.7, 0.2], rel=1e-9)


def test_a_discrepancy_adds_nothing_to_the_moduli(auto):
    assert moduli(auto) == pytest.approx([2 * draw.values["C10"] for draw in auto], rel=1e-9)


def test_differences_are_relative_to_the_draws(given):
    wanted, found = given([("yeoh", [0.5, 0.1, 0.0])]), given([("yeoh", [0.6, 0.12, 0.0])])
    for each in DrawStresses(wanted).errors(found).values():
        assert np.abs(each) == pytest.approx(np.full_like(each, 0.2))


def test_what_is_smaller_than_a_hundredth_of_a_neo_hookean_stress_counts_as_that(given):
    """A Yeoh material whose uniaxial stress vanishes where I1 - 3 = C10 / (2 |C20|) = 0.25."""
    wanted, found = given([("yeoh", [0.5, -1.0, 0.0])]), given([("yeoh", [0.5, -1.001, 0.0])])
    apart = DrawStresses(wanted).errors(found)["uniaxial"][0]
    low, high = wanted.ranges["uniaxial"]
    stretch = np.sort(np.concatenate([1 + (end - 1) * np.arange(1, 31) / 30 for end in (low, high)]))
    x = stretch**2 + 2 / stretch - 3
    assert apart == pytest.approx(np.sign(stretch - 1) * -0.002 * x / np.maximum(np.abs(0.5 - 2 * x), 0.005), rel=1e-6)


def test_stability_is_that_of_the_ensemble(given):
    ensemble = given(*([("mooney-rivlin", [0.5, second])] for second in (0.0, -0.4, 0.1)))
    assert are_stable(ensemble).tolist() == [True, False, True]


def test_a_law_that_only_jax_can_differentiate_is_judged_too(given):
    def law(I1, I2, mu):
        return 0.5 * mu * (jnp.exp(I1 - 3) - 1)

    like = given([("demiray", [0.8, 1.0])])
    states = SeenStates(like.most)
    draw = tq.EnergyDraw(0, ((tq.FunctionLaw(law), (0.8,)),), None)
    found = replace(like, draws=(draw,)).stress(states, states.points)
    assert found == pytest.approx(like.stress(states, states.points))


@pytest.mark.slow
def test_draws_of_such_a_law_are_stable_too(data):
    def law(I1, I2, mu):
        return 0.5 * mu * (jnp.exp(I1 - 3) - 1)

    posterior = tq.fit(data, material=tq.FunctionLaw(law), discrepancy="none", noise_sd=0.02)
    ensemble = posterior.ensemble(2)
    assert ensemble.tried == len(ensemble) == 2
