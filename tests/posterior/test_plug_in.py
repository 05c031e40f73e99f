"""Estimates that are plugged in are visible, and say what they cost."""

import numpy as np
import pytest

import tissuq as tq
from tissuq.posterior.plug_in import FACTORS

STRETCH = np.linspace(0.8, 1.3, 9)


def specimens(count):
    """Neo-Hookean specimens a tenth apart."""
    moduli = 0.5 * np.linspace(0.9, 1.1, count)
    return [
        tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=0.01, seed=number)
        for number, modulus in enumerate(moduli)
    ]


def test_one_test_with_independent_noise_needs_no_estimate():
    posterior = tq.fit(specimens(1)[0], discrepancy="none", noise_sd=0.01)
    assert posterior.model.fitted_errors.fits == 0
    assert "taken as known" not in posterior.how


def test_two_specimens_need_their_mean_curve():
    errors = tq.fit(specimens(2), discrepancy="none", noise_sd=0.01, tolerances=tq.Tolerances(stress=0.18))
    assert errors.model.fitted_errors.fits == 3
    assert errors.how.endswith(
        "the mean curve along which whole tests err estimated by 3 further fits and then taken as known"
    )


def test_specimens_tell_how_far_they_are_apart():
    posterior = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01)
    errors, tolerances = posterior.model.fitted_errors, posterior.model.tolerances
    assert errors.fits == 3 + len(FACTORS)
    standard = tq.estimands()["tissue"].sizes
    assert tolerances.stress == pytest.approx(errors.factor * standard["stress"])
    assert tolerances.test == pytest.approx(errors.factor * standard["test"])
    assert 0.03 < np.hypot(tolerances.stress, tolerances.test) < 0.2
    assert f"the spread between tests ({errors.factor:.3g} times the stated one)" in posterior.how


@pytest.mark.parametrize("spread", [0.0, 0.02])
def test_more_specimens_that_agree_narrow_the_interval(spread):
    widths = []
    for count in (1, 2, 3, 5):
        moduli = 0.5 * (1 + spread * np.linspace(-1, 1, count))
        tests = [
            tq.simulate("neo-hookean", {"C10": modulus}, STRETCH, noise_sd=0.01, seed=number)
            for number, modulus in enumerate(moduli)
        ]
        low, high = tq.fit(tests, discrepancy="none", noise_sd=0.01, tolerances="tissue").marginals["C10"].hdi()
        assert low < 0.5 < high
        widths.append(high - low)
    assert np.all(np.diff(widths) < 0)


def test_tests_in_different_modes_do_not_tell_how_far_they_are_apart():
    other = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, mode="planar", noise_sd=0.01, seed=9)
    model = tq.fit([specimens(1)[0], other], discrepancy="none", noise_sd=0.01).model
    assert model.fitted_errors.factor is None
    assert model.tolerances == tq.Tolerances("tissue")


def test_consecutive_noise_needs_its_lag():
    posterior = tq.fit(specimens(1)[0], discrepancy="none", noise="autoregressive", tolerances="as-tested")
    errors = posterior.model.fitted_errors
    assert errors.fits == 10
    assert f"the lag-1 correlation of {errors.lag:.3g} estimated by 10 further fits" in posterior.how


def test_tolerances_of_the_user_leave_the_spread_alone():
    posterior = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01, tolerances=tq.Tolerances(stress=0.1))
    assert posterior.model.fitted_errors.factor is None
    assert posterior.model.fitted_errors.fits == 3
