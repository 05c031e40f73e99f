"""Errors that the measurements themselves show are in the intervals, unless the user states other sizes."""

import numpy as np
import pytest

import tissuq as tq

STRETCH = np.linspace(1.0, 1.3, 15)


def measured(seed=3, **least_errors):
    test = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.01, seed=seed)
    return tq.Experiment("uniaxial", test.stretch, test.stress, least_errors=least_errors)


def sizes(data, **options):
    return tq.fit(data, discrepancy="log", **options).model.tolerances.sizes


def test_usual_tolerances_are_at_least_as_large():
    usual = sizes(measured())
    assert sizes(measured(slack=0.02, resolution=1e-4)) == usual | {"slack": 0.02}


def test_a_test_with_known_noise_has_them_alone():
    assert sizes(measured(slack=0.02), noise_sd=0.01) == {"slack": 0.02}


def test_an_estimand_by_name_includes_them_and_as_tested_does_not():
    assert sizes(measured(slack=0.02), tolerances="tissue")["slack"] == 0.02
    assert sizes(measured(slack=0.02), tolerances="as-tested") == {}


@pytest.mark.parametrize("slack", [0.0, 0.001, 0.005])
def test_a_stated_number_is_obeyed(slack):
    stated = tq.Tolerances("specimen", slack=slack)
    assert sizes(measured(slack=0.02), tolerances=stated).get("slack", 0.0) == slack


def test_the_largest_of_several_tests_counts():
    tests = [measured(slack=0.01), measured(seed=4, slack=0.03, resolution=0.01)]
    assert tq.Experiment.of(tests).least_errors == {"slack": 0.03, "resolution": 0.01}


def test_an_error_without_name_is_refused():
    with pytest.raises(tq.errors.InputError, match="error of a test"):
        tq.fit(measured(slag=0.1), discrepancy="log")


def test_the_account_says_so_and_a_saved_fit_keeps_it(tmp_path):
    posterior = tq.fit(measured(slack=0.02), discrepancy="log", noise_sd=0.01)
    assert posterior.how.endswith("the tolerance slack of 0.02 is as large as the measurements show")
    posterior.save(tmp_path / "fit.nc")
    assert tq.Posterior.load(tmp_path / "fit.nc").how == posterior.how


def test_slack_widens_the_interval_as_generalised_least_squares_tells():
    """Stresses along a curve that a shift of the stretch of standard deviation 0.03 moves, to first order."""
    low, high = tq.fit(measured(slack=0.03), discrepancy="none", noise_sd=1e-4).marginals["C10"].hdi()
    basis, moved = 2 * (STRETCH - STRETCH**-2), 0.5 * 2 * (1 + 2 * STRETCH**-3) * STRETCH * 0.03
    precision = np.linalg.inv(np.eye(15) * 1e-8 + np.outer(moved, moved))
    assert high - low == pytest.approx(2 * 1.96 / np.sqrt(basis @ precision @ basis), rel=0.05)
    assert high - low > 1.5 * 2 * 1.96 * 1e-4 / np.sqrt(basis @ basis)
