"""Estimates that are plugged in are visible, and say what they cost."""

import numpy as np

import tissuq as tq

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
    errors = tq.fit(specimens(2), discrepancy="none", noise_sd=0.01)
    assert errors.model.fitted_errors.fits == 3
    assert errors.how.endswith(
        "the mean curve along which whole tests err estimated by 3 further fits and then taken as known"
    )


def test_four_specimens_tell_their_spread():
    posterior = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01)
    errors = posterior.model.fitted_errors
    assert errors.fits == 3 + 6 + 3
    assert errors.spread == posterior.model.tolerances.stress
    assert 0.03 < errors.spread < 0.2
    assert f"the spread of {errors.spread:.3g} between specimens" in posterior.how


def test_consecutive_noise_needs_its_lag():
    posterior = tq.fit(specimens(1)[0], discrepancy="none", noise="autoregressive")
    errors = posterior.model.fitted_errors
    assert errors.fits == 10
    assert f"the lag-1 correlation of {errors.lag:.3g} estimated by 10 further fits" in posterior.how


def test_tolerances_of_the_user_leave_the_spread_alone():
    posterior = tq.fit(specimens(4), discrepancy="none", noise_sd=0.01, tolerances=tq.Tolerances(stress=0.1))
    assert posterior.model.fitted_errors.spread is None
    assert posterior.model.fitted_errors.fits == 3
