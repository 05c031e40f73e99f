"""Derivatives by the principal stretches: against closed forms, and what is no arithmetic of NumPy."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from tissuq.finite_elements.energy_derivatives import gradient, gradient_and_hessian, is_arithmetic

ALPHA = 3.0
STRETCHES = np.random.default_rng(0).uniform(0.7, 1.4, (3, 40))


def energy(stretches):
    return sum(stretch**ALPHA for stretch in stretches) - 3


def test_gradient_and_hessian_are_those_of_an_ogden_term():
    """W = sum of J^(-a/3) l_i^a: dW/dl_i = J^(-a/3) (a l_i^a - a/3 S) / l_i with S the sum of l^a, and so on."""
    powers, J = STRETCHES**ALPHA, STRETCHES.prod(axis=0)
    scale, total = J ** (-ALPHA / 3), powers.sum(axis=0)
    first = scale * ALPHA * (powers - total / 3) / STRETCHES
    second = np.zeros((3, 3, STRETCHES.shape[1]))
    for i in range(3):
        for j in range(3):
            in_logs = ALPHA**2 * scale * ((i == j) * powers[i] - (powers[i] + powers[j]) / 3 + total / 9)
            second[i, j] = (in_logs - (i == j) * first[i] * STRETCHES[i]) / (STRETCHES[i] * STRETCHES[j])
    np.testing.assert_allclose(gradient(energy, STRETCHES), first, rtol=1e-12, atol=1e-12)
    found_first, found_second = gradient_and_hessian(energy, STRETCHES)
    np.testing.assert_allclose(found_first, first, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found_second, second, rtol=1e-8, atol=1e-8)


def test_a_stretch_that_is_no_number_has_no_derivatives_and_does_not_stop_the_others():
    stretches = STRETCHES.copy()
    stretches[:, 3] = np.nan
    first, second = gradient_and_hessian(energy, stretches)
    assert np.isnan(first[:, 3]).all()
    assert np.isnan(second[:, :, 3]).all()
    np.testing.assert_array_equal(np.delete(first, 3, axis=1), np.delete(gradient(energy, STRETCHES), 3, axis=1))


def test_what_complex_steps_do_not_differentiate_is_seen():
    assert is_arithmetic(energy)
    assert not is_arithmetic(lambda stretches: jnp.exp(stretches[0] - 1))
    assert not is_arithmetic(lambda stretches: np.abs(stretches[0] ** 2 + stretches[1] - 2))
