"""Energies in smooth pieces, against the functions that they follow."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuq.mechanics.draws import PiecewiseEnergy, pieces
from tissuq.mechanics.stress import differentiator

KNOTS = np.linspace(-0.7, 1.3, 201)
INSIDE = np.linspace(-0.69, 1.29, 57)


@pytest.fixture(scope="module")
def function():
    """f(s) = sin(2 s) + s^3, from its slopes."""
    (found,) = pieces(KNOTS, (2 * np.cos(2 * KNOTS) + 3 * KNOTS**2)[:, None])
    return found


def test_a_function_follows_from_its_slopes(function):
    np.testing.assert_allclose(function(INSIDE), np.sin(2 * INSIDE) + INSIDE**3, atol=1e-10)
    np.testing.assert_allclose(function.slope(INSIDE), 2 * np.cos(2 * INSIDE) + 3 * INSIDE**2, atol=1e-8)
    assert function(np.zeros(1))[0] == pytest.approx(0, abs=1e-15)


def test_several_functions_come_from_as_many_columns():
    one, other = pieces(KNOTS, np.stack([np.ones_like(KNOTS), KNOTS], axis=1))
    np.testing.assert_allclose(one(INSIDE), INSIDE, atol=1e-13)
    np.testing.assert_allclose(other(INSIDE), INSIDE**2 / 2, atol=1e-13)


@pytest.mark.parametrize(("end", "beyond"), [(-0.7, -3.0), (1.3, 2.5)])
def test_beyond_its_knots_it_goes_on_with_the_slope_of_the_end(function, end, beyond):
    slope = 2 * np.cos(2 * end) + 3 * end**2
    assert function.slope(np.array([beyond]))[0] == pytest.approx(slope)
    assert function(np.array([beyond]))[0] == pytest.approx(np.sin(2 * end) + end**3 + slope * (beyond - end))


def test_an_imaginary_step_gives_the_slope(function):
    places = np.concatenate([[-2.0], INSIDE, [3.0]])
    np.testing.assert_allclose(function(places + 1e-30j).imag / 1e-30, function.slope(places), rtol=1e-12)


@pytest.mark.slow
def test_jax_differentiates_it_twice(function):
    differentiator()
    second = jax.vmap(jax.grad(jax.grad(lambda place: function(place))))(jnp.asarray(INSIDE))
    np.testing.assert_allclose(second, -4 * np.sin(2 * INSIDE) + 6 * INSIDE, atol=2e-4)


def test_the_energy_adds_invariants_and_logarithms():
    first, second, logarithm = (pieces(np.linspace(*ends, 301), slope)[0] for ends, slope in [
        ((0.0, 5.0), np.full((301, 1), 0.4)), ((0.0, 5.0), np.full((301, 1), 0.1)),
        ((-1.0, 1.0), 0.6 * np.linspace(-1.0, 1.0, 301)[:, None]),
    ])  # fmt: skip
    stretches = np.array([1.5]), np.array([0.8]), np.array([1 / 1.2])
    one, two, three = (float(each[0]) for each in stretches)
    I1, I2 = one**2 + two**2 + three**2, one**-2 + two**-2 + three**-2
    logs = 0.3 * (np.log(one) ** 2 + np.log(two) ** 2 + np.log(three) ** 2)
    energy = PiecewiseEnergy(first, second, logarithm)
    assert energy(stretches)[0] == pytest.approx(0.4 * (I1 - 3) + 0.1 * (I2 - 3) + logs, rel=1e-12)
