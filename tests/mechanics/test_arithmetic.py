"""Functions for strain energies: beside those of complex numbers, and at an imaginary step their slopes."""

from __future__ import annotations

import numpy as np
import pytest

from tissuq.mechanics.arithmetic import expm1, power

REAL = np.linspace(0.05, 4.0, 40)


@pytest.mark.parametrize("size", [1e-30, 1e-13, 0.3])
def test_they_are_those_of_complex_numbers(size):
    value = REAL + 1j * size * np.linspace(-1, 1, 40)
    np.testing.assert_allclose(expm1(value), np.expm1(value), rtol=1e-14)
    for exponent in (-3.3, 0.7, 12.0):
        np.testing.assert_allclose(power(value, exponent), np.exp(exponent * np.log(value)), rtol=1e-13)


def test_a_step_has_the_slope():
    step, exponents = 1e-30, np.array([[-7.0], [2.5]])
    np.testing.assert_allclose(expm1(-REAL + 1j * step).imag / step, np.exp(-REAL), rtol=1e-14)
    slopes = power(REAL + 1j * step, exponents).imag / step
    np.testing.assert_allclose(slopes, exponents * REAL ** (exponents - 1), rtol=1e-14)


def test_real_numbers_and_no_numbers_stay_what_they_are():
    assert expm1(np.zeros(0, dtype=complex)).shape == (0,)
    np.testing.assert_array_equal(power(REAL, 2.5), REAL**2.5)
    assert np.isnan(expm1(np.array([np.nan + 0j, 1.0])))[0]
