"""Parameters that tests cannot tell apart: fibres in planar tension, whose stress depends on two of three numbers."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment.separability import inseparable_parameters

STRETCH, NOISE = np.linspace(1.02, 1.4, 12), 5e-4
LAW, TRUTH = "holzapfel-gasser-ogden", {"C10": 0.01, "k1": 0.03, "k2": 1.5, "phi": 0.6}


def fitted(*modes, material=LAW):
    tests = [tq.simulate(LAW, TRUTH, STRETCH, NOISE, seed=seed, mode=mode) for seed, mode in enumerate(modes)]
    return tq.fit(tests, material=material, discrepancy="none", noise_sd=NOISE, tolerances="as-tested")


def test_other_angles_with_other_stiffnesses_give_the_same_planar_stress():
    """I4 - 1 = cos(phi)^2 (l^2 - 1), so that only k1 cos(phi)^4 and k2 cos(phi)^4 are in the stress.

    The ridge is too thin for cells: points lie along it.
    """
    factor = (np.cos(0.6) / np.cos(0.9)) ** 4
    other = {"C10": 0.01, "k1": 0.03 * factor, "k2": 1.5 * factor, "phi": 0.9}
    one, another = (tq.simulate(LAW, values, STRETCH, mode="planar").stress for values in (TRUTH, other))
    np.testing.assert_allclose(one, another, rtol=1e-12)
    posterior = fitted("planar")
    assert posterior.solution.route == "exact"
    assert inseparable_parameters(posterior.solution) == ("k1", "k2", "phi")
    [warning] = [warning for warning in posterior.warnings if warning.code == "inseparable-parameters"]
    assert "k1 and k2 and phi apart: other values give the same stresses" in warning
    assert [use.verdict for use in posterior.answer.uses if "other loading modes" in use.purpose] == ["no"]


@pytest.mark.parametrize(
    ("modes", "material"),
    [
        (("planar", "planar@2"), LAW),
        (("planar",), "neo-hookean+exponential-fibres@30"),
        (("planar",), "gent"),
        (("planar",), "yeoh"),
    ],
)
def test_parameters_that_tests_tell_apart_are_not_named(modes, material):
    assert inseparable_parameters(fitted(*modes, material=material).solution) == ()
